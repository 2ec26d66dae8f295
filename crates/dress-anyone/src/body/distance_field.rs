//! The signed distance to a body as a smooth function, for a simulator that wants two derivatives.
//!
//! Nodes of a grid hold the exact signed distance of the body's mesh and serve as coefficients of a
//! uniform cubic B-spline (C², METHOD's choice for contact): d(p) = Σ_ijk B(u−i) B(v−j) B(w−k) d_ijk.
//! Using the distances themselves as coefficients smooths them: the spline is d + h²/6 ∇²d + O(h⁴),
//! 0.07 mm at a sphere of 12 cm under 5 mm spacing. Derivatives are the spline's own, exact.
//!
//! The body is made a solid first (lids on holes). Pseudonormals then tell the sign of every node;
//! a node they call outside that no path of outside nodes joins to the open air is inside after all:
//! eyes in the head, arms that overlap the torso, crevices narrower than the spacing.

use crate::geometry::watertight::watertight;
use crate::geometry::{ClosestPoint, Mat3, TriangleMesh, Vec3};
use rayon::prelude::*;

/// Smooth signed distance to a body, everywhere inside it and in a band around it.
#[derive(Clone, Debug, PartialEq)]
pub struct DistanceField {
    grid: Grid,
    /// Where each brick's values start, or [`ABSENT`]; `[brick]`.
    starts: Vec<u32>,
    /// Distances at the nodes \[m\], brick by brick, x fastest.
    values: Vec<f64>,
}

/// The field at a point.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Signed distance \[m\], negative inside.
    pub distance: f64,
    /// Its gradient \[–\]; of length one but for the smoothing.
    pub gradient: Vec3,
}

/// Nodes `origin + spacing · (i, j, k)`, in bricks of 8 × 8 × 8.
#[derive(Clone, Debug, PartialEq)]
struct Grid {
    origin: Vec3,
    spacing: f64,
    brick_count: [usize; 3],
}

/// Nodes along the side of a brick.
const SIDE: usize = 8;
/// Nodes of a brick.
const BRICK: usize = SIDE * SIDE * SIDE;
/// No brick here: all of it is far outside.
const ABSENT: u32 = u32::MAX;

impl DistanceField {
    /// Spacing of the nodes that suits a human body \[m\].
    pub const SPACING: f64 = 5e-3;
    /// Reach of the band outside the body that suits draping \[m\].
    pub const OUTER: f64 = 30e-3;

    /// The field of `body`, known to the distance `outer` \[m\] outside, with nodes `spacing` \[m\]
    /// apart. Finer is closer to the mesh: smoothing falls with spacing², memory and time grow
    /// with 1/spacing³.
    pub fn new(body: &TriangleMesh, spacing: f64, outer: f64) -> Self {
        let solid = watertight(body);
        let closest = ClosestPoint::new(&solid);
        // The stencil of a point within `outer` reaches two nodes farther along each axis.
        let reach = outer + 2.0 * 3.0_f64.sqrt() * spacing;
        let grid = Grid::around(&solid, spacing, reach);
        let brick_total = grid.brick_count.iter().product::<usize>();
        let stored: Vec<usize> = (0..brick_total)
            .into_par_iter()
            .filter(|&b| {
                let (centre, radius) = grid.ball_around(b);
                closest.signed_distance(centre) <= reach + radius
            })
            .collect();
        let bricks: Vec<Vec<f64>> = stored
            .par_iter()
            .map(|&b| grid.distances(b, &closest, reach))
            .collect();
        let mut starts = vec![ABSENT; brick_total];
        for (place, &b) in stored.iter().enumerate() {
            starts[b] = (place * BRICK) as u32;
        }
        let mut field = Self {
            grid,
            starts,
            values: bricks.concat(),
        };
        field.sink_what_no_air_reaches(&stored);
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

    /// The same where the distance is below `limit` \[m\]; told from one node where that is far off.
    pub fn sample_below(&self, p: Vec3, limit: f64) -> Option<Sample> {
        let u = (p - self.grid.origin) / self.grid.spacing;
        // What is no number, or below zero, becomes node 0, whose sample decides.
        let place = self.place([0, 1, 2].map(|axis| (u[axis] + 0.5) as usize))?;
        if self.values[place] - DROP * self.grid.spacing > limit {
            return None;
        }
        self.sample(p).filter(|s| s.distance < limit)
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
        size_of_val(self.values.as_slice()) + size_of_val(self.starts.as_slice())
    }

    /// The coefficients around `p`, and where `p` lies between the second and third along x, y and z.
    fn stencil(&self, p: Vec3) -> Option<(Coefficients, [f64; 3])> {
        let u = (p - self.grid.origin) / self.grid.spacing;
        let mut first = [0; 3];
        for axis in 0..3 {
            let node_count = self.grid.brick_count[axis] * SIDE;
            // Written so that a coordinate that is no number fails too.
            if !(u[axis] >= 1.0 && u[axis] < (node_count - 2) as f64) {
                return None;
            }
            first[axis] = u[axis] as usize - 1;
        }
        // Along each axis the four nodes lie in one brick or in two neighbours.
        let mut starts = [0; 8];
        for (corner, start) in starts.iter_mut().enumerate() {
            let [x, y, z] = first;
            let brick = [
                (x + 3 * (corner & 1)) / SIDE,
                (y + 3 * (corner >> 1 & 1)) / SIDE,
                (z + 3 * (corner >> 2)) / SIDE,
            ];
            *start = self.starts[self.grid.brick_index(brick)];
            if *start == ABSENT {
                return None;
            }
        }
        let mut coefficients = [[[0.0; 4]; 4]; 4];
        let second = |axis: usize, i: usize| (first[axis] + i) / SIDE - first[axis] / SIDE;
        for k in 0..4 {
            for j in 0..4 {
                let row = second(1, j) << 1 | second(2, k) << 2;
                let at = (first[2] + k) % SIDE * SIDE + (first[1] + j) % SIDE;
                for i in 0..4 {
                    let start = starts[row | second(0, i)] as usize;
                    coefficients[k][j][i] = self.values[start + at * SIDE + (first[0] + i) % SIDE];
                }
            }
        }
        Some((coefficients, [u.x.fract(), u.y.fract(), u.z.fract()]))
    }

    /// Makes negative what is not joined to the absent bricks through positive nodes.
    fn sink_what_no_air_reaches(&mut self, stored: &[usize]) {
        let mut airy = vec![false; self.values.len()];
        let mut frontier = Vec::new();
        let reach = |place: usize, node, airy: &mut Vec<bool>, frontier: &mut Vec<_>| {
            if self.values[place] >= 0.0 && !airy[place] {
                airy[place] = true;
                frontier.push(node);
            }
        };
        for &b in stored {
            let corner = self.grid.brick(b).map(|i| i * SIDE);
            for n in 0..BRICK {
                let local = [n % SIDE, n / SIDE % SIDE, n / SIDE / SIDE];
                let node = [0, 1, 2].map(|axis| corner[axis] + local[axis]);
                let on_side = local.iter().any(|&i| i == 0 || i == SIDE - 1);
                if on_side && self.neighbours(node).any(|(_, place)| place.is_none()) {
                    let place = self.starts[b] as usize + n;
                    reach(place, node, &mut airy, &mut frontier);
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
        let brick = node.map(|i| i / SIDE);
        let inside = (0..3).all(|axis| brick[axis] < self.grid.brick_count[axis]);
        let start = inside.then(|| self.starts[self.grid.brick_index(brick)])?;
        (start != ABSENT).then(|| start as usize + node_in_brick(node))
    }
}

impl Grid {
    fn around(solid: &TriangleMesh, spacing: f64, reach: f64) -> Self {
        let (low, high) = solid.bounds();
        let origin = low.add_scalar(-reach);
        let extent = (high - low).add_scalar(2.0 * reach) / (spacing * SIDE as f64);
        // An empty mesh has no extent.
        let brick_count = [extent.x, extent.y, extent.z].map(|x| x.ceil().max(0.0) as usize);
        Self {
            origin,
            spacing,
            brick_count,
        }
    }

    fn brick_index(&self, brick: [usize; 3]) -> usize {
        (brick[2] * self.brick_count[1] + brick[1]) * self.brick_count[0] + brick[0]
    }

    fn brick(&self, index: usize) -> [usize; 3] {
        let [nx, ny, _] = self.brick_count;
        [index % nx, index / nx % ny, index / nx / ny]
    }

    fn position(&self, node: [usize; 3]) -> Vec3 {
        self.origin + Vec3::from(node.map(|i| i as f64)) * self.spacing
    }

    /// Centre and radius of the ball around a brick's nodes.
    fn ball_around(&self, index: usize) -> (Vec3, f64) {
        let half = Vec3::repeat(0.5 * (SIDE - 1) as f64 * self.spacing);
        let corner = self.position(self.brick(index).map(|i| i * SIDE));
        (corner + half, half.norm())
    }

    /// Signed distances at a brick's nodes, `reach` where they are beyond it: no sample within the
    /// band needs those. The nodes are visited back and forth, so that the triangle under one is a
    /// good first guess for the next.
    fn distances(&self, index: usize, closest: &ClosestPoint, reach: f64) -> Vec<f64> {
        let corner = self.brick(index).map(|i| i * SIDE);
        let mut values = vec![0.0; BRICK];
        let mut value = -f64::INFINITY;
        let mut hint = None;
        for n in 0..BRICK {
            let turn = |i: usize, back: bool| if back { SIDE - 1 - i } else { i };
            let (row, z) = (n / SIDE, n / SIDE / SIDE);
            let y = turn(row % SIDE, z % 2 == 1);
            let x = turn(n % SIDE, row % 2 == 1);
            let p = self.position([corner[0] + x, corner[1] + y, corner[2] + z]);
            // Neighbours differ by their spacing at most, so one that far beyond is not asked.
            if value - self.spacing > reach {
                value -= self.spacing;
            } else {
                let foot = match hint {
                    None => closest.query(p, f64::INFINITY),
                    Some(triangle) => closest.query_near(p, f64::INFINITY, triangle),
                }
                .expect("the mesh has triangles and the point is finite");
                hint = Some(foot.triangle);
                value = closest.signed(p, &foot);
            }
            values[(z * SIDE + y) * SIDE + x] = value;
        }
        values
    }
}

fn node_in_brick(node: [usize; 3]) -> usize {
    (node[2] % SIDE * SIDE + node[1] % SIDE) * SIDE + node[0] % SIDE
}

/// Values of 4³ neighbouring nodes, `[z][y][x]`.
type Coefficients = [[[f64; 4]; 4]; 4];

/// By how much the field falls below its value at the nearest node at most, in spacings: distances
/// differ by no more than their places, p is √¾ from that node, and the spline's weights spread by
/// another √(1/3) along each axis: √(¾ + 1).
const DROP: f64 = 1.33;

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
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};
    use crate::geometry::closest_point::tests::sphere;

    fn direction(i: usize) -> Vec3 {
        Vec3::new(noise(5 * i), noise(7 * i + 1), noise(11 * i + 2)).normalize()
    }

    #[test]
    fn the_field_of_a_sphere_is_its_distance_smoothed_as_told() {
        let (radius, h) = (0.12, 5e-3);
        let field = DistanceField::new(&sphere(radius, 6), h, 0.03);
        for i in 0..500 {
            let n = direction(i);
            // From 4 cm inside to the end of the band.
            let d = 0.035 * noise(i + 77) - 0.005;
            let p = n * (radius + d);
            let sample = field.sample(p).unwrap();
            // ∇²d = 2/r. Circumcircles of 2.6 mm sag by 2.6²/(2·120) mm.
            let expected = d + h * h / 6.0 * 2.0 / (radius + d);
            assert!(
                (sample.distance - expected).abs() < 29e-6,
                "{:e}",
                sample.distance - expected
            );
            // Facets tilt by up to 1 degree; the spline averages over a few of them.
            assert!(sample.gradient.normalize().angle(&n) < 0.2_f64.to_radians());
        }
        assert_eq!(field.sample(Vec3::x() * 0.4), None);
        assert_eq!(field.sample(Vec3::repeat(f64::NAN)), None);
    }

    #[test]
    fn every_point_within_the_band_has_a_sample() {
        let field = DistanceField::new(&sphere(0.1, 3), 7e-3, 0.02);
        for i in 0..2000 {
            let p = direction(i) * (0.12 * noise(i + 5).abs().cbrt() - 1e-9);
            assert!(field.sample(p).is_some());
        }
    }

    #[test]
    fn gradient_and_hessian_are_those_of_the_spline() {
        let field = DistanceField::new(&sphere(0.05, 2), 5e-3, 0.03);
        for i in 0..100 {
            let p = direction(i) * (0.05 + 0.025 * noise(i + 3));
            let along = direction(i + 500);
            let at = |s: f64| field.sample_with_hessian(p + along * s).unwrap();
            let (sample, hessian) = at(0.0);
            let slope = sample.gradient.dot(&along);
            assert_derivative(|s| at(s).0.distance, slope, 1e-6, 1.0, 1e-6);
            for axis in 0..3 {
                let slope = hessian.row(axis).transpose().dot(&along);
                // Hessians are of the order of 1/radius = 20 per metre.
                assert_derivative(|s| at(s).0.gradient[axis], slope, 1e-7, 20.0, 1e-6);
            }
        }
    }

    #[test]
    fn second_derivatives_do_not_jump_between_cells() {
        let field = DistanceField::new(&sphere(0.05, 2), 5e-3, 0.03);
        for i in 0..20 {
            let cell = (
                field.grid.position([20, 11 + i % 8, 13]) - Vec3::x() * 1e-9,
                2e-9,
            );
            let before = field.sample_with_hessian(cell.0).unwrap().1;
            let after = field
                .sample_with_hessian(cell.0 + Vec3::x() * cell.1)
                .unwrap()
                .1;
            // Third derivatives below 1e5 per square metre.
            assert!((after - before).norm() < 1e-3);
        }
    }

    #[test]
    fn the_number_of_threads_changes_nothing() {
        let build = |threads| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
            let body = sphere(0.05, 3);
            pool.unwrap()
                .install(|| DistanceField::new(&body, 5e-3, 0.03))
        };
        assert_eq!(build(1), build(2));
    }

    #[test]
    fn holes_are_closed_and_what_lies_inside_is_inside() {
        // A head with a hole in its crown, an eye within, wound inside out.
        let mut head = sphere(0.1, 4);
        head.triangles
            .retain(|t| t.iter().any(|&v| head.positions[v as usize].y < 0.09));
        let eye = sphere(0.02, 2);
        let offset = head.positions.len() as u32;
        head.positions
            .extend(eye.positions.iter().map(|p| p + Vec3::z() * 0.05));
        let flipped = |t: &[u32; 3]| [t[0] + offset, t[2] + offset, t[1] + offset];
        head.triangles.extend(eye.triangles.iter().map(flipped));
        let field = DistanceField::new(&head, 5e-3, 0.03);
        for i in 0..500 {
            let p = direction(i) * 0.12 * noise(i + 9).abs();
            let deep = p.norm() < 0.08 && (p - Vec3::z() * 0.05).norm() > 0.028;
            let sample = field.sample(p).unwrap();
            // On the eye itself the distance vanishes; the smoothing lifts it a little.
            assert!(sample.distance < 1e-3 || p.norm() > 0.085);
            assert!(!deep || sample.distance < -5e-3);
            assert!(p.norm() < 0.105 || sample.distance > 2e-3);
        }
    }

    #[test]
    fn a_sample_below_a_limit_is_the_sample_wherever_it_is_below_it() {
        let field = DistanceField::new(&sphere(0.05, 3), 5e-3, 0.03);
        let mut counts = [0, 0];
        for i in 0..3000 {
            let p = direction(i) * (0.09 * noise(i + 5).abs());
            for limit in [-0.01, 0.0, 3e-3, 0.02] {
                let sample = field.sample(p);
                let below = sample.filter(|s| s.distance < limit);
                assert_eq!(field.sample_below(p, limit), below);
                assert_eq!(field.sample_with_hessian(p).map(|(s, _)| s), sample);
                counts[usize::from(below.is_some())] += 1;
            }
        }
        assert!(counts.iter().all(|n| *n > 1000), "{counts:?}");
        assert_eq!(field.sample_below(Vec3::repeat(f64::NAN), 1.0), None);
        assert_eq!(field.sample_below(Vec3::repeat(9.0), 1.0), None);
    }

    #[test]
    fn nothing_has_no_distance() {
        let field = DistanceField::new(&TriangleMesh::default(), 5e-3, 0.03);
        assert_eq!(field.sample(Vec3::zeros()), None);
    }

    /// `DRESS_BODY=….obj cargo test -p dress-anyone build_time -- --ignored --nocapture`
    #[test]
    #[ignore = "measures; needs a body"]
    fn build_time_and_memory_of_a_real_body() {
        let Some(path) = std::env::var_os("DRESS_BODY") else {
            println!("skipped: DRESS_BODY names no .obj file");
            return;
        };
        let text = std::fs::read_to_string(path).unwrap();
        let mut body = TriangleMesh::default();
        for line in text.lines() {
            let mut words = line.split_whitespace();
            let kind = words.next();
            if kind == Some("v") {
                let numbers = words.take(3).map(|x| x.parse::<f64>().unwrap());
                body.positions.push(Vec3::from_iterator(numbers));
            } else if kind == Some("f") {
                let index =
                    |word: &str| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
                let corners: Vec<u32> = words.map(index).collect();
                let fan = corners[1..]
                    .windows(2)
                    .map(|pair| [corners[0], pair[0], pair[1]]);
                body.triangles.extend(fan);
            }
        }
        let start = std::time::Instant::now();
        let field = DistanceField::new(&body, DistanceField::SPACING, DistanceField::OUTER);
        println!(
            "{} triangles, {} nodes, {:.1} MB, {:.2} s",
            body.triangles.len(),
            field.values.len(),
            field.memory() as f64 * 1e-6,
            start.elapsed().as_secs_f64()
        );
        let sunk = field.values.iter().filter(|v| **v < 0.0).count();
        println!(
            "{:.4} m³ inside",
            sunk as f64 * DistanceField::SPACING.powi(3)
        );
    }
}
