//! The signed distance to a body as a smooth function, for a simulator that wants two derivatives.
//!
//! Nodes of a grid (`nodes`) hold the signed distance of the body's mesh, and make the coefficients of a
//! uniform cubic B-spline (C², METHOD's choice for contact): d(p) = Σ_ijk B(u−i) B(v−j) B(w−k) c_ijk.
//! The spline of the distances themselves would be d + h²/6 ∇²d + O(h⁴), a millimetre too far out at
//! fingers; coefficients c = d − h²/6 ∇²d make up for it. Derivatives are the spline's own, exact.
//!
//! The body is made a solid first (lids on holes). Pseudonormals then tell the sign of every node;
//! a node they call outside that no path of outside nodes joins to the open air is inside after all:
//! eyes in the head, arms that overlap the torso. What no cloth gets into is filled (`crevices`).

mod crevices;
mod nodes;
mod pull_back;

use crate::geometry::watertight::watertight;
use crate::geometry::{ClosestPoint, Mat3, TriangleMesh, Vec3};
use nodes::{BRICK, Grid, SIDE};
use rayon::prelude::*;

/// Smooth signed distance to a body, everywhere inside it and in a band around it.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceField {
    grid: Grid,
    /// Farther outside \[m\] distances are not searched.
    reach: f64,
    /// Coefficients at the nodes \[m\], brick by brick, x fastest.
    values: Vec<f64>,
}

/// The field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Signed distance \[m\], negative inside.
    pub distance: f64,
    /// Its gradient \[–\]; of length one but where distances have a crease.
    pub gradient: Vec3,
}

impl DistanceField {
    /// Spacing of the nodes that suits a human body \[m\].
    pub const SPACING: f64 = 5e-3;
    /// Reach of the band outside the body that suits draping \[m\].
    pub const OUTER: f64 = 30e-3;

    /// The field of `body`, known to the distance `outer` \[m\] outside, with nodes `spacing` \[m\]
    /// apart. Finer is closer to the mesh; memory and time grow with 1/spacing³.
    pub fn new(body: &TriangleMesh, spacing: f64, outer: f64) -> Self {
        let closest = ClosestPoint::new(&watertight(body));
        // The stencil of a point within `outer` reaches two nodes farther along each axis.
        let reach = outer + 2.0 * 3.0_f64.sqrt() * spacing;
        let grid = Grid::around(body, &closest, spacing, reach);
        let values = nodes::distances(&grid, &closest, reach);
        let mut field = Self {
            grid,
            reach,
            values,
        };
        field.sink_what_no_air_reaches();
        field.fill_crevices();
        field.sharpen();
        field
    }

    /// Distance and gradient at `p`; none farther outside than the band.
    pub fn sample(&self, p: Vec3) -> Option<Sample> {
        let (c, [x, y, z]) = self.stencil(p)?;
        let [x, y, z] = [x, y, z].map(|t| [values(t), slopes(t)]);
        let mut sums = [0.0; 4];
        for k in 0..4 {
            for j in 0..4 {
                let (row, slope) = (dot(&x[0], &c[k][j]), dot(&x[1], &c[k][j]));
                let (yz, by_y, by_z) = (y[0][j] * z[0][k], y[1][j] * z[0][k], y[0][j] * z[1][k]);
                sums[0] += yz * row;
                sums[1] += yz * slope;
                sums[2] += by_y * row;
                sums[3] += by_z * row;
            }
        }
        let [distance, gx, gy, gz] = sums;
        Some(Sample {
            distance,
            gradient: Vec3::new(gx, gy, gz) / self.grid.spacing,
        })
    }

    /// The same where the distance is below `limit` \[m\]; elsewhere how far p may move at least before it
    /// can be \[m\]. Told from one node where that is far off.
    pub fn sample_below(&self, p: Vec3, limit: f64) -> Result<Sample, f64> {
        let u = (p - self.grid.origin) / self.grid.spacing;
        // What is no number, or below zero, becomes node 0, whose sample decides.
        let nearest = [0, 1, 2].map(|axis| (u[axis] + 0.5) as usize);
        let place = self.place(nearest).ok_or(0.0)?;
        let least = self.values[place] - DROP * self.grid.spacing;
        if least > limit {
            return Err((least - limit) / STEEPEST);
        }
        match self.sample(p) {
            Some(sample) if sample.distance < limit => Ok(sample),
            Some(sample) => Err((sample.distance - limit) / STEEPEST),
            None => Err(0.0),
        }
    }

    /// Distance, gradient and Hessian \[1/m\] at `p`; none farther outside than the band.
    pub fn sample_with_hessian(&self, p: Vec3) -> Option<(Sample, Mat3)> {
        let (c, [x, y, z]) = self.stencil(p)?;
        let [x, y, z] = [x, y, z].map(|t| [values(t), slopes(t), bends(t)]);
        let mut distance = 0.0;
        let mut gradient = Vec3::zeros();
        let mut hessian = Mat3::zeros();
        for k in 0..4 {
            for j in 0..4 {
                // The row along x: value, first and second derivative.
                let row = [
                    dot(&x[0], &c[k][j]),
                    dot(&x[1], &c[k][j]),
                    dot(&x[2], &c[k][j]),
                ];
                distance += y[0][j] * z[0][k] * row[0];
                gradient.x += y[0][j] * z[0][k] * row[1];
                gradient.y += y[1][j] * z[0][k] * row[0];
                gradient.z += y[0][j] * z[1][k] * row[0];
                hessian.m11 += y[0][j] * z[0][k] * row[2];
                hessian.m22 += y[2][j] * z[0][k] * row[0];
                hessian.m33 += y[0][j] * z[2][k] * row[0];
                hessian.m12 += y[1][j] * z[0][k] * row[1];
                hessian.m13 += y[0][j] * z[1][k] * row[1];
                hessian.m23 += y[1][j] * z[1][k] * row[0];
            }
        }
        let h = self.grid.spacing;
        hessian.fill_lower_triangle_with_upper_triangle();
        let sample = Sample {
            distance,
            gradient: gradient / h,
        };
        Some((sample, hessian / (h * h)))
    }

    /// Bytes held.
    pub fn memory(&self) -> usize {
        size_of_val(self.values.as_slice()) + self.grid.memory()
    }

    /// The coefficients around `p`, and where `p` lies between the second and third along x, y and z.
    fn stencil(&self, p: Vec3) -> Option<(Coefficients, [f64; 3])> {
        let (first, t) = self.place_of(p)?;
        // Along each axis the four nodes lie in one brick or in two neighbours.
        let local = first.map(|i| i % SIDE);
        let corner_at = |[x, y, z]: [usize; 3]| x / SIDE + 2 * (y / SIDE) + 4 * (z / SIDE);
        let across = corner_at(local.map(|i| i + 3));
        let mut starts = [0; 8];
        for corner in 0..8 {
            starts[corner] = if corner & across == corner {
                let node = [0, 1, 2].map(|axis| first[axis] + 3 * (corner >> axis & 1));
                self.grid.ordinal(node)? * BRICK
            } else {
                starts[corner & across]
            };
        }
        let mut coefficients = [[[0.0; 4]; 4]; 4];
        for (k, plane) in coefficients.iter_mut().enumerate() {
            let z = local[2] + k;
            for (j, row) in plane.iter_mut().enumerate() {
                let y = local[1] + j;
                let corner = corner_at([local[0], y, z]);
                let at = (z % SIDE * SIDE + y % SIDE) * SIDE;
                let here = starts[corner] + at + local[0];
                if local[0] + 4 <= SIDE {
                    row.copy_from_slice(&self.values[here..here + 4]);
                    continue;
                }
                let beyond = starts[corner | 1] + at;
                for (value, i) in row.iter_mut().zip(local[0]..) {
                    let place = i.checked_sub(SIDE);
                    *value = self.values[place.map_or(here + i - local[0], |i| beyond + i)];
                }
            }
        }
        Some((coefficients, t))
    }

    /// The first of the four nodes around `p` along each axis, and where `p` lies between the second and
    /// the third.
    fn place_of(&self, p: Vec3) -> Option<([usize; 3], [f64; 3])> {
        let u = (p - self.grid.origin) / self.grid.spacing;
        let mut first = [0; 3];
        for axis in 0..3 {
            let node_count = self.grid.node_count(axis);
            // Written so that a coordinate that is no number fails too.
            if !(u[axis] >= 1.0 && u[axis] < (node_count - 2) as f64) {
                return None;
            }
            first[axis] = u[axis] as usize - 1;
        }
        Some((first, [u.x.fract(), u.y.fract(), u.z.fract()]))
    }

    /// Makes negative what is not joined to the absent bricks through positive nodes.
    fn sink_what_no_air_reaches(&mut self) {
        let mut airy = vec![false; self.values.len()];
        let mut frontier = Vec::new();
        let reach = |place: usize, node, airy: &mut Vec<bool>, frontier: &mut Vec<_>| {
            if self.values[place] >= 0.0 && !airy[place] {
                airy[place] = true;
                frontier.push(node);
            }
        };
        for (ordinal, &brick) in self.grid.stored.iter().enumerate() {
            for (n, node) in self.grid.nodes(brick).enumerate() {
                let on_side = node.iter().any(|i| i % SIDE == 0 || i % SIDE == SIDE - 1);
                if on_side && self.neighbours(node).any(|(_, place)| place.is_none()) {
                    reach(ordinal * BRICK + n, node, &mut airy, &mut frontier);
                }
            }
        }
        while let Some(node) = frontier.pop() {
            for (neighbour, place) in self.neighbours(node) {
                if let Some(place) = place {
                    reach(place, neighbour, &mut airy, &mut frontier);
                }
            }
        }
        for (value, airy) in self.values.iter_mut().zip(airy) {
            if !airy {
                *value = -value.abs();
            }
        }
    }

    /// Turns distances into coefficients of a spline that has them, nearly: the spline of c is
    /// c + h²/6 ∇²c + O(h⁴).
    fn sharpen(&mut self) {
        let bricks: Vec<Vec<f64>> = (self.grid.stored.par_iter().enumerate())
            .map(|(ordinal, &brick)| {
                let values = &self.values[ordinal * BRICK..(ordinal + 1) * BRICK];
                let sharp = |(node, d): ([usize; 3], &f64)| {
                    let value = |_, place: usize| self.values[place];
                    let bend = self.bend(node, *d, value);
                    d - bend.clamp(-self.sharpest(), self.sharpest())
                };
                self.grid.nodes(brick).zip(values).map(sharp).collect()
            })
            .collect();
        self.values = bricks.concat();
    }

    /// h²/6 ∇²d at a node of distance `d`, given the distance of each neighbour by its place.
    fn bend(&self, node: [usize; 3], d: f64, of: impl Fn([usize; 3], usize) -> f64) -> f64 {
        // Farther off some nodes hold means of others, with kinks of their own.
        if d.abs() > nodes::SEARCHED - self.grid.spacing {
            return 0.0;
        }
        let mut bend = 0.0;
        for (neighbour, place) in self.neighbours(node) {
            bend += place.map_or(0.0, |place| of(neighbour, place) - d);
        }
        bend / 6.0
    }

    /// Most by which a coefficient differs from the distance \[m\].
    fn sharpest(&self) -> f64 {
        SHARPEST * self.grid.spacing
    }

    /// The six nodes around `node` and the places of their values; none in absent bricks.
    fn neighbours(&self, node: [usize; 3]) -> impl Iterator<Item = ([usize; 3], Option<usize>)> {
        (0..6).map(move |side| {
            let (axis, forth) = (side / 2, side % 2 == 0);
            let mut neighbour = node;
            // Wraps below zero, which lies beyond every brick.
            let step = if forth { 1 } else { usize::MAX };
            neighbour[axis] = node[axis].wrapping_add(step);
            (neighbour, self.place(neighbour))
        })
    }

    fn place(&self, node: [usize; 3]) -> Option<usize> {
        let local = (node[2] % SIDE * SIDE + node[1] % SIDE) * SIDE + node[0] % SIDE;
        Some(self.grid.ordinal(node)? * BRICK + local)
    }
}

/// Values of 4³ neighbouring nodes, `[z][y][x]`.
type Coefficients = [[[f64; 4]; 4]; 4];

/// Most by which a coefficient differs from the distance, in spacings: more only where distances have a
/// crease, which the spline would overshoot.
const SHARPEST: f64 = 0.2;
/// By how much the field falls below its coefficient at the nearest node at most, in spacings: distances
/// differ by no more than their places, p is √¾ from that node, and the spline's weights spread by
/// another √(1/3) along each axis: √(¾ + 1); and twice what coefficients differ from distances.
const DROP: f64 = 1.33 + 2.0 * SHARPEST;
/// Most that the field rises or falls per way \[–\]: along each axis neighbouring coefficients differ by one
/// spacing at most, and by what both differ from distances.
const STEEPEST: f64 = 1.74 * (1.0 + 2.0 * SHARPEST);

fn dot(weights: &[f64; 4], values: &[f64; 4]) -> f64 {
    let products: [f64; 4] = [
        weights[0] * values[0],
        weights[1] * values[1],
        weights[2] * values[2],
        weights[3] * values[3],
    ];
    (products[0] + products[1]) + (products[2] + products[3])
}

/// Weights of four neighbouring nodes: the uniform cubic B-spline at `t` in 0..1 between the second
/// and the third.
fn values(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        s * s * s / 6.0,
        2.0 / 3.0 - t * t * (1.0 - 0.5 * t),
        2.0 / 3.0 - s * s * (1.0 - 0.5 * s),
        t * t * t / 6.0,
    ]
}

/// Their derivatives by t.
fn slopes(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [
        -0.5 * s * s,
        t * (1.5 * t - 2.0),
        s * (2.0 - 1.5 * s),
        0.5 * t * t,
    ]
}

/// Their second derivatives by t.
fn bends(t: f64) -> [f64; 4] {
    let s = 1.0 - t;
    [s, 3.0 * t - 2.0, 3.0 * s - 2.0, t]
}

#[cfg(test)]
mod tests;
