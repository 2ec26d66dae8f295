//! A tree of axis-aligned boxes around the items of a mesh, for nearest-item queries.
//!
//! Built by median splits along the longest axis, ties broken by item index, so the same items give
//! the same tree. Nodes lie in one flat array, depth first: the left child of node i is i + 1.

use super::Vec3;

/// A box tree over items known by their index.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Item indices; every leaf owns a range of them.
    items: Vec<u32>,
}

/// A box, and what it holds: `count` items from `first` on, or, when `count` is 0, a left child
/// right behind it and a right child at `first`.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    low: Vec3,
    high: Vec3,
    first: u32,
    count: u32,
}

/// Most items in a leaf.
const LEAF: usize = 4;
/// Median splits halve, so even 2³² items stay below this depth.
const MAX_DEPTH: usize = 48;
/// Boxes this much (relative) beyond the best squared distance are still opened, so that rounding
/// never hides an item that ties.
const SLACK: f64 = 1.0 + 1e-12;

impl Bvh {
    /// A tree over `boxes`: smallest and largest corner of each item \[m\].
    pub fn new(boxes: &[(Vec3, Vec3)]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            items: (0..boxes.len() as u32).collect(),
        };
        if !boxes.is_empty() {
            tree.split(boxes, 0, boxes.len());
        }
        tree
    }

    /// Items in the order of the leaves; the places [`Self::nearest`] speaks of index this.
    pub fn items(&self) -> &[u32] {
        &self.items
    }

    /// Visits every place whose box is no farther from `p` than the bound, near boxes first.
    /// `visit(place, bound)` returns the new squared bound \[m²\], at most the old one.
    pub fn nearest(&self, p: Vec3, mut bound: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let mut stack = [(0_u32, 0.0); MAX_DEPTH];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let (index, squared_distance) = stack[height];
            if squared_distance > bound * SLACK {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for place in node.first..node.first + node.count {
                    bound = visit(place as usize, bound);
                }
                continue;
            }
            let left = (index + 1, self.squared_distance(index + 1, p));
            let right = (node.first, self.squared_distance(node.first, p));
            let (near, far) = if right.1 < left.1 {
                (right, left)
            } else {
                (left, right)
            };
            for child in [far, near] {
                if child.1 <= bound * SLACK {
                    stack[height] = child;
                    height += 1;
                }
            }
        }
    }

    fn squared_distance(&self, node: u32, p: Vec3) -> f64 {
        let node = &self.nodes[node as usize];
        (p.inf(&node.high).sup(&node.low) - p).norm_squared()
    }

    /// Appends the subtree over `items[start..end]`, which is not empty.
    fn split(&mut self, boxes: &[(Vec3, Vec3)], start: usize, end: usize) {
        let items = &mut self.items[start..end];
        let of = |item: u32| boxes[item as usize];
        let (low, high) = (items.iter().map(|&i| of(i)))
            .reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
            .expect("the range is not empty");
        let node = self.nodes.len();
        self.nodes.push(Node {
            low,
            high,
            first: start as u32,
            count: (end - start) as u32,
        });
        if end - start <= LEAF {
            return;
        }
        let axis = (high - low).imax();
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |&i, &j| {
            let key = |item: u32| of(item).0[axis] + of(item).1[axis];
            key(i).total_cmp(&key(j)).then(i.cmp(&j))
        });
        self.split(boxes, start, start + middle);
        self.nodes[node].first = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(boxes, start + middle, end);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    #[test]
    fn the_nearest_item_is_the_one_brute_force_finds() {
        let point = |i: usize| Vec3::new(noise(3 * i), noise(3 * i + 1), noise(7 * i + 2));
        let points: Vec<Vec3> = (0..500).map(point).collect();
        let tree = Bvh::new(&points.iter().map(|&p| (p, p)).collect::<Vec<_>>());
        for i in 0..200 {
            let p = point(1000 + i) * 1.5;
            let squared = |item: u32| (points[item as usize] - p).norm_squared();
            let mut best = (f64::INFINITY, u32::MAX);
            let mut visited = 0;
            tree.nearest(p, f64::INFINITY, |place, _| {
                visited += 1;
                let item = tree.items()[place];
                best = if squared(item) < best.0 {
                    (squared(item), item)
                } else {
                    best
                };
                best.0
            });
            let expected = (0..500).map(squared).fold(f64::INFINITY, f64::min);
            assert_eq!(best.0, expected);
            // A tree that pruned nothing would visit all 500.
            assert!(visited < 250, "{visited} visited");
        }
    }

    #[test]
    fn an_empty_tree_has_nothing_to_visit() {
        Bvh::new(&[]).nearest(Vec3::zeros(), f64::INFINITY, |_, _| panic!("no items"));
    }
}
