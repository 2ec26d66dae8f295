//! A tree of bounding volumes around triangles, for nearest-triangle queries.
//!
//! A volume is a flat cylinder (a puck) lying on its patch of surface: on smooth meshes it hugs the
//! patch far closer than a box, and a point hovering over many triangles opens only those below it.
//! Built by median splits along the longest axis, ties broken by index, so the same triangles give
//! the same tree. Nodes lie in one flat array, depth first: the left child of node i is i + 1.

use super::{Vec3, bounds};

/// A volume tree over triangles known by their index.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    nodes: Vec<Node>,
    /// Triangle indices; every leaf owns a range of them.
    order: Vec<u32>,
    /// The volume of each triangle, in the same order.
    pucks: Vec<Puck>,
}

/// A volume, and what it holds: `count` triangles from `first` on, or, when `count` is 0, a left
/// child right behind it and a right child at `first`.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    puck: Puck,
    first: u32,
    count: u32,
}

/// A cylinder about a unit `axis`.
#[derive(Clone, Debug, PartialEq)]
struct Puck {
    centre: Vec3,
    axis: Vec3,
    radius: f64,
    half_height: f64,
}

/// Most triangles in a leaf.
const LEAF: usize = 4;
/// Median splits halve, so even 2³² triangles stay below this depth.
const MAX_DEPTH: usize = 48;
/// Pucks are made this much too large, so that rounding never hides a triangle that ties.
const SLACK: f64 = 1.0 + 1e-7;

impl Bvh {
    /// A tree over triangles given by their corners \[m\].
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(triangles.len()),
            order: (0..triangles.len() as u32).collect(),
            pucks: Vec::new(),
        };
        if !triangles.is_empty() {
            tree.split(triangles, 0, triangles.len());
        }
        let puck = |&t: &u32| Puck::around(&[triangles[t as usize]]);
        tree.pucks = tree.order.iter().map(puck).collect();
        tree
    }

    /// Triangles in the order of the leaves; the places [`Self::nearest`] speaks of index this.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Visits every place that may be no farther from `p` than the squared bound \[m²\], roughly
    /// near ones first. `visit(place, bound)` returns the new bound, at most the old one.
    pub fn nearest(&self, p: Vec3, mut bound: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let mut stack = [(0_u32, 0.0); MAX_DEPTH];
        let mut height = usize::from(!self.nodes.is_empty());
        while height > 0 {
            height -= 1;
            let (index, squared_distance) = stack[height];
            if squared_distance > bound {
                continue;
            }
            let node = &self.nodes[index as usize];
            if node.count > 0 {
                for place in node.first as usize..(node.first + node.count) as usize {
                    if self.pucks[place].squared_distance(p) <= bound {
                        bound = visit(place, bound);
                    }
                }
                continue;
            }
            let [left, right] = [index + 1, node.first]
                .map(|child| (child, self.nodes[child as usize].puck.squared_distance(p)));
            let (near, far) = if right.1 < left.1 {
                (right, left)
            } else {
                (left, right)
            };
            for child in [far, near] {
                if child.1 <= bound {
                    stack[height] = child;
                    height += 1;
                }
            }
        }
    }

    /// Appends the subtree over `order[start..end]`, which is not empty.
    fn split(&mut self, triangles: &[[Vec3; 3]], start: usize, end: usize) {
        let order = &mut self.order[start..end];
        let patch: Vec<[Vec3; 3]> = order.iter().map(|&t| triangles[t as usize]).collect();
        let node = self.nodes.len();
        self.nodes.push(Node {
            puck: Puck::around(&patch),
            first: start as u32,
            count: (end - start) as u32,
        });
        if end - start <= LEAF {
            return;
        }
        let (low, high) = bounds(patch.as_flattened());
        let axis = (high - low).imax();
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&i, &j| {
            let key = |t: u32| triangles[t as usize].iter().map(|p| p[axis]).sum::<f64>();
            key(i).total_cmp(&key(j)).then(i.cmp(&j))
        });
        self.split(triangles, start, start + middle);
        self.nodes[node].first = self.nodes.len() as u32;
        self.nodes[node].count = 0;
        self.split(triangles, start + middle, end);
    }
}

impl Puck {
    /// A puck about the mean normal of a patch.
    fn around(patch: &[[Vec3; 3]]) -> Self {
        let normal: Vec3 = (patch.iter())
            .map(|[a, b, c]| (b - a).cross(&(c - a)))
            .sum();
        let axis = normal.try_normalize(0.0).unwrap_or_else(Vec3::y);
        let points = patch.as_flattened();
        let (low, high) = bounds(points);
        let middle = (low + high) * 0.5;
        let heights = points.iter().map(|p| (p - middle).dot(&axis));
        let (bottom, top) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), h| {
            (h.min(low), h.max(high))
        });
        let centre = middle + axis * (0.5 * (bottom + top));
        let radius = (points.iter())
            .map(|p| p - centre)
            .map(|offset| (offset - axis * offset.dot(&axis)).norm())
            .fold(0.0, f64::max);
        let slack = (SLACK - 1.0) * (radius + top - bottom);
        Self {
            centre,
            axis,
            radius: radius + slack,
            half_height: 0.5 * (top - bottom) + slack,
        }
    }

    fn squared_distance(&self, p: Vec3) -> f64 {
        let offset = p - self.centre;
        let height = offset.dot(&self.axis);
        let aside = (offset.norm_squared() - height * height).max(0.0).sqrt() - self.radius;
        let above = (height.abs() - self.half_height).max(0.0);
        above * above + aside.max(0.0) * aside.max(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    #[test]
    fn a_puck_is_no_farther_than_what_it_holds() {
        let point = |i: usize| Vec3::new(noise(3 * i), noise(3 * i + 1), noise(7 * i + 2));
        for i in 0..200 {
            let triangle = [point(3 * i), point(3 * i + 1), point(3 * i + 2)];
            let puck = Puck::around(&[triangle]);
            let p = point(i + 5000) * 3.0;
            let nearest = (triangle.iter().map(|q| (p - q).norm_squared())).fold(9e9, f64::min);
            assert!(puck.squared_distance(p) <= nearest);
            assert_eq!(puck.squared_distance(triangle[0]), 0.0);
        }
    }

    #[test]
    fn far_triangles_are_not_visited() {
        let flat = |t: usize| {
            let corner = Vec3::new((t % 50) as f64, 0.0, (t / 50) as f64);
            [corner, corner + Vec3::x(), corner + Vec3::z()]
        };
        let triangles: Vec<_> = (0..2500).map(flat).collect();
        let tree = Bvh::new(&triangles);
        let mut visited = Vec::new();
        // 30 edges above the sheet: boxes and spheres would open hundreds of triangles.
        let p = Vec3::new(20.2, 30.0, 17.2);
        tree.nearest(p, 30.0_f64.powi(2), |place, bound| {
            visited.push(tree.order()[place]);
            bound
        });
        assert!(visited.contains(&(17 * 50 + 20)));
        assert!(visited.len() < 10, "{visited:?}");
    }

    #[test]
    fn an_empty_tree_has_nothing_to_visit() {
        Bvh::new(&[]).nearest(Vec3::zeros(), f64::INFINITY, |_, _| panic!("no triangles"));
    }
}
