//! A tree of axis-parallel boxes: which of many boxes overlap a given one.
//!
//! Built by median splits of the boxes' middles along the longest axis, ties broken by index, so
//! the same boxes give the same tree; when boxes move a little, [`BoxTree::refit`] keeps the
//! splits. Boxes of very different size, as cloth has while its seams close, cost it little.
//! Nodes lie in one flat array, depth first: the left child of node i is i + 1.
//!
//! Whole trees are compared leaf by leaf: the boxes of a leaf lie together, so one walk down the
//! other tree serves them all.

use super::Vec3;
use rayon::prelude::*;

/// Smallest and largest corner of a box \[m\].
pub type Aabb = [Vec3; 2];

/// A tree over boxes known by their index.
#[derive(Clone, Debug)]
pub struct BoxTree {
    nodes: Vec<Node>,
    /// Box indices; every leaf owns a range of them.
    order: Vec<u32>,
    /// The boxes in the same order.
    boxes: Vec<Aabb>,
}

/// A box, and what it holds: `count` boxes from `first` on, or, when `count` is 0, a left child
/// right behind it and a right child at `first`.
#[derive(Clone, Debug)]
struct Node {
    hull: Aabb,
    first: u32,
    count: u32,
}

impl Node {
    /// Where a leaf's boxes lie.
    fn places(&self) -> std::ops::Range<usize> {
        self.first as usize..(self.first + self.count) as usize
    }
}

/// Nodes whose leaves are compared by one task.
const CHUNK: usize = 128;
/// Most boxes in a leaf.
const LEAF: usize = 4;
/// Median splits halve, so even 2³² boxes stay below this depth.
const MAX_DEPTH: usize = 48;

impl BoxTree {
    /// A tree over `boxes` \[m\].
    pub fn new(boxes: &[Aabb]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            order: (0..boxes.len() as u32).collect(),
            boxes: Vec::new(),
        };
        if !boxes.is_empty() {
            tree.split(boxes, 0, boxes.len());
        }
        tree.refit(boxes);
        tree
    }

    /// The same boxes, moved.
    pub fn refit(&mut self, boxes: &[Aabb]) {
        self.boxes.clear();
        self.boxes
            .extend(self.order.iter().map(|&i| boxes[i as usize]));
        for n in (0..self.nodes.len()).rev() {
            let node = &self.nodes[n];
            self.nodes[n].hull = if node.count > 0 {
                hull(&self.boxes[node.places()])
            } else {
                hull(&[self.nodes[n + 1].hull, self.nodes[node.first as usize].hull])
            };
        }
    }

    /// Visits every box that overlaps or touches `query`, always in the same order.
    pub fn overlapping(&self, query: &Aabb, mut visit: impl FnMut(u32)) {
        self.leaves_within(query, 0, |leaf| {
            for place in leaf.places() {
                if overlap(&self.boxes[place], query) {
                    visit(self.order[place]);
                }
            }
        });
    }

    /// What `visit` finds in every pair of an own box and one of `other` that overlap, always in the
    /// same order.
    pub fn overlaps<T: Send>(
        &self,
        other: &Self,
        visit: impl Fn(u32, u32) -> Option<T> + Sync,
    ) -> Vec<T> {
        self.by_leaf(|_, leaf, found| {
            other.leaves_within(&leaf.hull, 0, |near| {
                for i in leaf.places() {
                    for j in near.places() {
                        if overlap(&self.boxes[i], &other.boxes[j]) {
                            found.extend(visit(self.order[i], other.order[j]));
                        }
                    }
                }
            });
        })
    }

    /// What `visit` finds in every pair of own boxes that overlap, each pair once and the smaller
    /// index first, always in the same order.
    pub fn own_overlaps<T: Send>(&self, visit: impl Fn(u32, u32) -> Option<T> + Sync) -> Vec<T> {
        self.by_leaf(|index, leaf, found| {
            self.leaves_within(&leaf.hull, index, |near| {
                for i in leaf.places() {
                    for j in near.places().start.max(i + 1)..near.places().end {
                        if overlap(&self.boxes[i], &self.boxes[j]) {
                            let (a, b) = (self.order[i], self.order[j]);
                            found.extend(visit(a.min(b), a.max(b)));
                        }
                    }
                }
            });
        })
    }

    /// What `find` adds for each leaf, in the order of the leaves.
    fn by_leaf<T: Send>(&self, find: impl Fn(u32, &Node, &mut Vec<T>) + Sync) -> Vec<T> {
        let parts: Vec<Vec<T>> = (self.nodes.par_chunks(CHUNK).enumerate())
            .map(|(chunk, nodes)| {
                let mut found = Vec::new();
                for (index, node) in nodes.iter().enumerate().filter(|(_, n)| n.count > 0) {
                    find((chunk * CHUNK + index) as u32, node, &mut found);
                }
                found
            })
            .collect();
        parts.into_iter().flatten().collect()
    }

    /// Visits every leaf, node `from` or later, whose hull overlaps `query`.
    fn leaves_within(&self, query: &Aabb, from: u32, mut visit: impl FnMut(&Node)) {
        let mut stack = [0_u32; MAX_DEPTH];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let index = stack[height];
            let node = &self.nodes[index as usize];
            if !overlap(&node.hull, query) {
                continue;
            }
            if node.count > 0 {
                if index >= from {
                    visit(node);
                }
                continue;
            }
            stack[height] = node.first;
            height += 1;
            // All of the left subtree comes before its right sibling.
            if from < node.first {
                stack[height] = index + 1;
                height += 1;
            }
        }
    }

    /// Appends the subtree over `order[start..end]`, which is not empty.
    fn split(&mut self, boxes: &[Aabb], start: usize, end: usize) {
        let node = self.nodes.len();
        self.nodes.push(Node {
            hull: [Vec3::zeros(); 2],
            first: start as u32,
            count: (end - start) as u32,
        });
        if end - start <= LEAF {
            return;
        }
        let order = &mut self.order[start..end];
        let middle_of = |i: u32| boxes[i as usize][0] + boxes[i as usize][1];
        let (low, high) = super::bounds(order.iter().map(|&i| middle_of(i)));
        let axis = (high - low).imax();
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&i, &j| {
            let key = |i: u32| middle_of(i)[axis];
            key(i).total_cmp(&key(j)).then(i.cmp(&j))
        });
        self.split(boxes, start, start + middle);
        self.nodes[node].first = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(boxes, start + middle, end);
    }
}

/// The box around `points`, of which there is at least one, widened by `margin` \[m\] on all sides.
pub fn around(points: &[Vec3], margin: f64) -> Aabb {
    let (mut low, mut high) = (points[0], points[0]);
    for p in &points[1..] {
        low = Vec3::new(low.x.min(p.x), low.y.min(p.y), low.z.min(p.z));
        high = Vec3::new(high.x.max(p.x), high.y.max(p.y), high.z.max(p.z));
    }
    [low.add_scalar(-margin), high.add_scalar(margin)]
}

/// Whether two boxes have a point in common.
fn overlap(a: &Aabb, b: &Aabb) -> bool {
    a[0].x <= b[1].x
        && b[0].x <= a[1].x
        && a[0].y <= b[1].y
        && b[0].y <= a[1].y
        && a[0].z <= b[1].z
        && b[0].z <= a[1].z
}

/// The box around boxes, of which there is at least one.
fn hull(boxes: &[Aabb]) -> Aabb {
    let first = boxes[0];
    boxes[1..].iter().fold(first, |[low, high], other| {
        [low.inf(&other[0]), high.sup(&other[1])]
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    fn scattered(count: usize, seed: usize) -> Vec<Aabb> {
        let noise3 = |i: usize| Vec3::from_fn(|c, _| noise(seed + 3 * i + c));
        (0..count)
            .map(|i| {
                // A few large ones among many small ones.
                let size = if i % 50 == 0 { 0.5 } else { 0.05 };
                around(&[noise3(i), noise3(i) + noise3(i + 7000) * size], 0.01)
            })
            .collect()
    }

    fn found(tree: &BoxTree, query: &Aabb) -> Vec<u32> {
        let mut all = Vec::new();
        tree.overlapping(query, |i| all.push(i));
        all.sort_unstable();
        all
    }

    fn brute(boxes: &[Aabb], query: &Aabb) -> Vec<u32> {
        let near = |i: &u32| overlap(&boxes[*i as usize], query);
        (0..boxes.len() as u32).filter(near).collect()
    }

    #[test]
    fn it_finds_what_a_look_at_every_box_finds_also_after_they_moved() {
        let (before, after) = (scattered(500, 1), scattered(500, 9001));
        let mut tree = BoxTree::new(&before);
        for query in &before {
            assert_eq!(found(&tree, query), brute(&before, query));
        }
        tree.refit(&after);
        for query in &before {
            assert_eq!(found(&tree, query), brute(&after, query));
        }
    }

    #[test]
    fn whole_trees_find_what_a_look_at_every_pair_finds() {
        let (some, others) = (scattered(700, 1), scattered(300, 9001));
        let (tree, other) = (BoxTree::new(&some), BoxTree::new(&others));
        let mut found = tree.overlaps(&other, |i, j| Some((i, j)));
        found.sort_unstable();
        let mut expected = Vec::new();
        for (i, a) in some.iter().enumerate() {
            expected.extend(brute(&others, a).into_iter().map(|j| (i as u32, j)));
        }
        assert_eq!(found, expected);
        let mut own = tree.own_overlaps(|i, j| Some((i, j)));
        own.sort_unstable();
        let mut expected = Vec::new();
        for (i, a) in some.iter().enumerate() {
            let later = brute(&some, a).into_iter().filter(|j| *j > i as u32);
            expected.extend(later.map(|j| (i as u32, j)));
        }
        assert_eq!(own, expected);
        assert!(own.len() > 10, "{}", own.len());
    }

    #[test]
    fn an_empty_tree_overlaps_nothing() {
        let query = around(&[Vec3::zeros()], 1.0);
        assert!(found(&BoxTree::new(&[]), &query).is_empty());
    }
}
