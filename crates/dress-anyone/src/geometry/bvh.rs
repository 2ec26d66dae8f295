//! A tree of bounding volumes around triangles, for nearest-triangle queries.
//!
//! A volume is a flat cylinder (a puck) lying on its patch of surface: on smooth meshes it hugs the
//! patch far closer than a box, and a point hovering over many triangles opens only those below it.
//! Nearly all of a query are distances from pucks. A node therefore holds four, side by side in single
//! precision, of which a processor takes all at once; what rounding may hide is allowed for.
//! Built by median splits along the longest axis, ties broken by index, so the same triangles give
//! the same tree.

use super::{Vec3, bounds};

/// A volume tree over triangles known by their index.
#[derive(Clone, Debug, PartialEq)]
pub struct Bvh {
    /// The root last.
    nodes: Vec<Node>,
    /// Triangle indices; every leaf owns a range of them.
    order: Vec<u32>,
}

/// Up to four volumes and what they hold.
#[derive(Clone, Debug, PartialEq)]
struct Node {
    pucks: Pucks,
    /// Nodes, or in a leaf the places of triangles.
    children: [u32; LANES],
    count: u32,
    is_leaf: bool,
}

/// Cylinders about unit axes, side by side.
#[derive(Clone, Debug, Default, PartialEq)]
struct Pucks {
    centre: [[f32; LANES]; 3],
    axis: [[f32; LANES]; 3],
    radius: [f32; LANES],
    half_height: [f32; LANES],
}

/// A cylinder about a unit `axis`.
#[derive(Clone, Debug, PartialEq)]
struct Puck {
    centre: Vec3,
    axis: Vec3,
    radius: f64,
    half_height: f64,
}

/// Volumes of a node, and triangles in a leaf.
const LANES: usize = 4;
/// Splits into four leave at most ⌈n/4⌉, so even 2³² triangles stay below this depth; of four children
/// three wait while one is opened.
const MOST_WAITING: usize = 3 * 17 + 1;
/// Pucks are made larger by this part of the farthest coordinate, and squared distances shorter by this
/// part, so that rounding never hides a triangle that ties. Single precision has 6·10⁻⁸; a height and a
/// radius that differ by little lose a few more digits, but add little then.
const SLACK: f64 = 1e-6;
const SHORTER: f32 = 1.0 - 1e-5;

impl Bvh {
    /// A tree over triangles given by their corners \[m\].
    pub fn new(triangles: &[[Vec3; 3]]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(triangles.len()),
            order: (0..triangles.len() as u32).collect(),
        };
        if !triangles.is_empty() {
            let (low, high) = bounds(triangles.as_flattened());
            let farthest = low.amax().max(high.amax());
            tree.split(triangles, 0, triangles.len(), SLACK * farthest);
        }
        tree
    }

    /// Triangles in the order of the leaves; the places [`Self::nearest`] speaks of index this.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Visits every place that may be no farther from `p` than the squared bound \[m²\], roughly
    /// near ones first. `visit(place, bound)` returns the new bound, at most the old one.
    pub fn nearest(&self, p: Vec3, mut bound: f64, mut visit: impl FnMut(usize, f64) -> f64) {
        let Some(root) = self.nodes.len().checked_sub(1) else {
            return;
        };
        let at = [p.x, p.y, p.z].map(|x| x as f32);
        let mut waiting = [(0_u32, 0.0_f32); MOST_WAITING];
        waiting[0].0 = root as u32;
        let mut count = 1;
        while count > 0 {
            count -= 1;
            let (index, squared_distance) = waiting[count];
            if f64::from(squared_distance) > bound {
                continue;
            }
            let node = &self.nodes[index as usize];
            let squared_distances = node.pucks.squared_distances(at);
            let children = node.children.iter().zip(squared_distances);
            let children = children.take(node.count as usize);
            if node.is_leaf {
                for (&place, squared_distance) in children {
                    if f64::from(squared_distance) <= bound {
                        bound = visit(place as usize, bound);
                    }
                }
                continue;
            }
            let first = count;
            for (&child, squared_distance) in children {
                if f64::from(squared_distance) > bound {
                    continue;
                }
                // The nearest of them last, so that it is opened first.
                let mut slot = count;
                while slot > first && waiting[slot - 1].1 < squared_distance {
                    waiting[slot] = waiting[slot - 1];
                    slot -= 1;
                }
                waiting[slot] = (child, squared_distance);
                count += 1;
            }
        }
    }

    /// Appends the subtree over `order[start..end]`, which is not empty, and returns its root.
    fn split(&mut self, triangles: &[[Vec3; 3]], start: usize, end: usize, slack: f64) -> u32 {
        let mut node = Node {
            pucks: Pucks::default(),
            children: [0; LANES],
            count: 0,
            is_leaf: end - start <= LANES,
        };
        let parts: Vec<[usize; 2]> = if node.is_leaf {
            (start..end).map(|place| [place, place + 1]).collect()
        } else {
            let middle = self.halve(triangles, start, end);
            let halves = [[start, middle], [middle, end]];
            let quarters = halves.map(|[start, end]| {
                let middle = self.halve(triangles, start, end);
                [[start, middle], [middle, end]]
            });
            quarters.concat()
        };
        for (lane, [start, end]) in parts.into_iter().enumerate() {
            let patch = self.order[start..end].iter();
            let patch: Vec<[Vec3; 3]> = patch.map(|&t| triangles[t as usize]).collect();
            node.pucks.set(lane, &Puck::around(&patch, slack));
            node.children[lane] = if node.is_leaf {
                start as u32
            } else {
                self.split(triangles, start, end, slack)
            };
            node.count += 1;
        }
        self.nodes.push(node);
        self.nodes.len() as u32 - 1
    }

    /// Puts the lower half of `order[start..end]` along its longest axis first; where the upper begins.
    fn halve(&mut self, triangles: &[[Vec3; 3]], start: usize, end: usize) -> usize {
        let order = &mut self.order[start..end];
        let corners = order.iter().flat_map(|&t| triangles[t as usize]);
        let (low, high) = bounds(corners.collect::<Vec<_>>());
        let axis = (high - low).imax();
        let middle = order.len() / 2;
        order.select_nth_unstable_by(middle, |&i, &j| {
            let key = |t: u32| triangles[t as usize].iter().map(|p| p[axis]).sum::<f64>();
            key(i).total_cmp(&key(j)).then(i.cmp(&j))
        });
        start + middle
    }
}

impl Puck {
    /// A puck about the mean normal of a patch, too large by `slack` \[m\].
    fn around(patch: &[[Vec3; 3]], slack: f64) -> Self {
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
        Self {
            centre,
            axis,
            radius: radius + slack,
            half_height: 0.5 * (top - bottom) + slack,
        }
    }
}

impl Pucks {
    fn set(&mut self, lane: usize, puck: &Puck) {
        for i in 0..3 {
            self.centre[i][lane] = puck.centre[i] as f32;
            self.axis[i][lane] = puck.axis[i] as f32;
        }
        self.radius[lane] = puck.radius as f32;
        self.half_height[lane] = puck.half_height as f32;
    }

    /// Squared distances from `p` \[m²\], none too large.
    fn squared_distances(&self, p: [f32; 3]) -> [f32; LANES] {
        // Not `f32::max`, which asks what is no number.
        let positive = |x: f32| if x > 0.0 { x } else { 0.0 };
        std::array::from_fn(|l| {
            let [x, y, z] = [0, 1, 2].map(|i| p[i] - self.centre[i][l]);
            let height = x * self.axis[0][l] + y * self.axis[1][l] + z * self.axis[2][l];
            let across = positive(x * x + y * y + z * z - height * height);
            let aside = positive(across.sqrt() - self.radius[l]);
            let above = positive(height.abs() - self.half_height[l]);
            let squared = (above * above + aside * aside) * SHORTER;
            // Infinitely far is as far as can be told.
            if squared < f32::MAX {
                squared
            } else {
                f32::MAX
            }
        })
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
            let mut pucks = Pucks::default();
            pucks.set(i % LANES, &Puck::around(&[triangle], SLACK));
            let distance = |p: Vec3| {
                f64::from(pucks.squared_distances([p.x, p.y, p.z].map(|x| x as f32))[i % LANES])
            };
            let p = point(i + 5000) * 3.0;
            let nearest = (triangle.iter().map(|q| (p - q).norm_squared())).fold(9e9, f64::min);
            assert!(distance(p) <= nearest);
            assert_eq!(distance(triangle[0]), 0.0);
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
