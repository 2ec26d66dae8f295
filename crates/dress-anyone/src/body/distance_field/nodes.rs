//! The nodes of a distance field and the distances they hold.
//!
//! Most of a field's cost are its searches for the closest triangle. Every second node along each axis
//! is searched; the others are where the surface is near, and elsewhere are the mean of the searched
//! ones around them, which is off by ½ s² (κ₁ + κ₂) at nodes s apart where the surface of equal
//! distance has curvatures κ: 0.3 mm, 20 mm from a wrist's bone, at 5 mm. Cloth that touches is nearer.

use crate::geometry::{ClosestPoint, TriangleMesh, Vec3};
use rayon::prelude::*;

/// Nodes `origin + spacing · (i, j, k)`, in bricks of 8 × 8 × 8, some of which are stored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Grid {
    pub(super) origin: Vec3,
    pub(super) spacing: f64,
    brick_count: [usize; 3],
    /// The bricks that are stored, in order.
    pub(super) stored: Vec<usize>,
    /// Where each brick stands among the stored, or [`ABSENT`]; `[brick]`.
    ordinals: Vec<u32>,
}

/// What a search found at a node.
#[derive(Clone, Copy, Debug)]
struct Found {
    /// Signed distance \[m\].
    value: f64,
    /// The nearest triangle of it or of a node nearby.
    triangle: Option<u32>,
}

/// The nodes whose three indices are even, of all stored bricks.
struct Evens<'a> {
    grid: &'a Grid,
    closest: &'a ClosestPoint,
    /// Brick by brick, x fastest.
    found: Vec<Found>,
}

/// Farther from the surface \[m\] odd nodes are means. The stencil of a point within 10 mm, where
/// contact takes place, has searched nodes only.
pub(super) const SEARCHED: f64 = 20e-3;
/// Nodes along the side of a brick.
pub(super) const SIDE: usize = 8;
/// Nodes of a brick.
pub(super) const BRICK: usize = SIDE * SIDE * SIDE;
/// Even nodes along the side of a brick.
const HALF: usize = SIDE / 2;
/// Even nodes of a brick.
const EVENS: usize = HALF * HALF * HALF;
/// No brick here: all of it is far outside.
const ABSENT: u32 = u32::MAX;

/// Signed distances \[m\] at the nodes of the stored bricks, brick by brick, x fastest; `reach` and
/// more where they are beyond it.
pub(super) fn distances(grid: &Grid, closest: &ClosestPoint, reach: f64) -> Vec<f64> {
    // The even nodes around an odd one within reach.
    let far = reach + 2.0 * grid.spacing;
    let found: Vec<[Found; EVENS]> = (grid.stored.par_iter())
        .map(|&brick| grid.evens(brick, closest, far))
        .collect();
    let evens = Evens {
        grid,
        closest,
        found: found.concat(),
    };
    let bricks: Vec<Vec<f64>> = (grid.stored.par_iter())
        .map(|&brick| grid.nodes(brick).map(|node| evens.value(node)).collect())
        .collect();
    bricks.concat()
}

impl Grid {
    /// Stores the bricks within `reach` \[m\] of the body and all inside it.
    pub(super) fn around(
        body: &TriangleMesh,
        closest: &ClosestPoint,
        spacing: f64,
        reach: f64,
    ) -> Self {
        let (low, high) = body.bounds();
        // Whole multiples of the spacing, so that a mirrored body has a mirrored field.
        let origin = low.map(|x| ((x - reach) / spacing).floor() * spacing);
        let extent = (high.add_scalar(reach) - origin) / (spacing * SIDE as f64);
        // An empty mesh has no extent.
        let brick_count = [extent.x, extent.y, extent.z].map(|x| x.ceil().max(0.0) as usize);
        let mut grid = Self {
            origin,
            spacing,
            brick_count,
            stored: Vec::new(),
            ordinals: vec![ABSENT; brick_count.iter().product()],
        };
        let is_near = |&brick: &usize| {
            let (centre, radius) = grid.ball_around(brick);
            closest.signed_distance(centre) <= reach + radius
        };
        let bricks = (0..grid.ordinals.len()).into_par_iter();
        grid.stored = bricks.filter(is_near).collect();
        for (ordinal, &brick) in grid.stored.iter().enumerate() {
            grid.ordinals[brick] = ordinal as u32;
        }
        grid
    }

    /// Nodes along an axis.
    pub(super) fn node_count(&self, axis: usize) -> usize {
        self.brick_count[axis] * SIDE
    }

    /// Where the brick of `node` stands among the stored; none where it is not, or `node` is beyond
    /// the grid.
    pub(super) fn ordinal(&self, node: [usize; 3]) -> Option<usize> {
        let [x, y, z] = node.map(|i| i / SIDE);
        let [nx, ny, nz] = self.brick_count;
        if x >= nx || y >= ny || z >= nz {
            return None;
        }
        let ordinal = self.ordinals[(z * ny + y) * nx + x];
        (ordinal != ABSENT).then_some(ordinal as usize)
    }

    /// The nodes of a brick, x fastest.
    pub(super) fn nodes(&self, brick: usize) -> impl Iterator<Item = [usize; 3]> + use<> {
        let [x, y, z] = self.corner(brick);
        (0..BRICK).map(move |n| [x + n % SIDE, y + n / SIDE % SIDE, z + n / SIDE / SIDE])
    }

    /// Bytes held besides itself.
    pub(super) fn memory(&self) -> usize {
        size_of_val(self.stored.as_slice()) + size_of_val(self.ordinals.as_slice())
    }

    /// The first node of a brick.
    fn corner(&self, brick: usize) -> [usize; 3] {
        let [nx, ny, _] = self.brick_count;
        [brick % nx, brick / nx % ny, brick / nx / ny].map(|i| i * SIDE)
    }

    pub(super) fn position(&self, node: [usize; 3]) -> Vec3 {
        self.origin + Vec3::from(node.map(|i| i as f64)) * self.spacing
    }

    /// Centre and radius of the ball around a brick's nodes.
    fn ball_around(&self, brick: usize) -> (Vec3, f64) {
        let half = Vec3::repeat(0.5 * (SIDE - 1) as f64 * self.spacing);
        (self.position(self.corner(brick)) + half, half.norm())
    }

    /// What is found at a brick's even nodes, x fastest. They are visited back and forth, so that the
    /// triangle under one is a good first guess for the next.
    fn evens(&self, brick: usize, closest: &ClosestPoint, far: f64) -> [Found; EVENS] {
        let corner = self.corner(brick);
        let mut found = Found {
            value: -f64::INFINITY,
            triangle: None,
        };
        let mut evens = [found; EVENS];
        for n in 0..EVENS {
            let turn = |i: usize, back: bool| if back { HALF - 1 - i } else { i };
            let (row, z) = (n / HALF, n / HALF / HALF);
            let y = turn(row % HALF, z % 2 == 1);
            let x = turn(n % HALF, row % 2 == 1);
            // Neighbours differ by their spacing at most, so one that far beyond is not asked.
            if found.value - 2.0 * self.spacing > far {
                found.value -= 2.0 * self.spacing;
            } else {
                let node = [corner[0] + 2 * x, corner[1] + 2 * y, corner[2] + 2 * z];
                found = self.search(node, closest, found.triangle);
            }
            evens[(z * HALF + y) * HALF + x] = found;
        }
        evens
    }

    /// The exact distance at `node`, found sooner where triangle `hint` is near.
    fn search(&self, node: [usize; 3], closest: &ClosestPoint, hint: Option<u32>) -> Found {
        let p = self.position(node);
        let foot = match hint {
            None => closest.query(p, f64::INFINITY),
            Some(triangle) => closest.query_near(p, f64::INFINITY, triangle),
        }
        .expect("the mesh has triangles and the point is finite");
        Found {
            value: closest.signed(p, &foot),
            triangle: Some(foot.triangle),
        }
    }
}

impl Evens<'_> {
    /// Signed distance at a node of a stored brick.
    fn value(&self, node: [usize; 3]) -> f64 {
        let below = self.found[self.place(node).expect("its brick is stored")];
        if node.iter().all(|i| i % 2 == 0) {
            return below.value;
        }
        self.mean_around(node).unwrap_or_else(|| {
            let found = self.grid.search(node, self.closest, below.triangle);
            found.value
        })
    }

    /// Mean of the even nodes around an odd one; none near the surface, or where one is missing.
    fn mean_around(&self, node: [usize; 3]) -> Option<f64> {
        let [xs, ys, zs] = node.map(|i| if i % 2 == 0 { [i, i] } else { [i - 1, i + 1] });
        let (mut low, mut high, mut sum) = (f64::INFINITY, f64::NEG_INFINITY, 0.0);
        for z in zs {
            for y in ys {
                for x in xs {
                    let value = self.found[self.place([x, y, z])?].value;
                    (low, high, sum) = (low.min(value), high.max(value), sum + value);
                }
            }
        }
        (low > SEARCHED || high < -SEARCHED).then_some(sum / 8.0)
    }

    /// Where the even node at or below `node` stands; none in an absent brick.
    fn place(&self, node: [usize; 3]) -> Option<usize> {
        let [x, y, z] = node.map(|i| i % SIDE / 2);
        Some(self.grid.ordinal(node)? * EVENS + (z * HALF + y) * HALF + x)
    }
}
