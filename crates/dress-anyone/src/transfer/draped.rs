//! A garment on the source body, and what its target shape needs to know of it.

use crate::geometry::mesh::vertex_normals;
use crate::geometry::{ClosestPoint, Vec3};
use rayon::prelude::*;
use std::iter::Sum;
use std::ops::Mul;

/// A welded cloth where it lies on the source body.
pub(super) struct Draped<'a> {
    /// Positions \[m\].
    pub(super) x: &'a [Vec3],
    pub(super) triangles: &'a [[u32; 3]],
    /// The neighbours of every vertex along the triangles' edges, ascending.
    pub(super) rings: &'a [Vec<u32>],
    /// Usual length of the edges at each vertex \[m\]; once it is known where they go, half way to there.
    pub(super) sizes: Vec<f64>,
    /// Signed distances to the body \[m\].
    pub(super) distance: Vec<f64>,
    /// Unit directions in which the cloth faces, away from the body on the whole, freed from folds; zero where
    /// it faces none.
    pub(super) facing: Vec<Vec3>,
    /// The unit direction against which cloth hangs.
    pub(super) up: Vec3,
    /// The body's \[m\]: lengths that mean the same on all bodies are shares of it.
    pub(super) height: f64,
}

/// Length over which the directions that cloth faces are averaged, as share of the body's height: 8 cm on an
/// adult, so that folds do not count.
const FOLDS: f64 = 0.05;
/// Most rounds of averaging.
const ROUNDS: f64 = 150.0;

impl<'a> Draped<'a> {
    pub(super) fn new(
        x: &'a [Vec3],
        (triangles, rings): (&'a [[u32; 3]], &'a [Vec<u32>]),
        surface: &ClosestPoint,
        (up, height): (Vec3, f64),
    ) -> Self {
        let mut draped = Self {
            x,
            triangles,
            sizes: sizes(x, rings),
            distance: (x.par_iter())
                .map(|&x| surface.signed_distance(x))
                .collect(),
            facing: Vec::new(),
            up,
            height,
            rings,
        };
        let normals = draped.averaged(vertex_normals(x, triangles), FOLDS);
        // The winding of a whole garment may be inside out.
        let agreement: f64 = (x.iter().zip(&normals))
            .filter_map(|(&x, n)| {
                Some(
                    surface
                        .pseudonormal(&surface.query(x, f64::INFINITY)?)
                        .dot(n),
                )
            })
            .sum();
        let unit = |n: &Vec3| n.try_normalize(1e-9).map(|n| n * agreement.signum());
        draped.facing = (normals.iter())
            .map(|n| unit(n).unwrap_or_else(Vec3::zeros))
            .collect();
        draped
    }

    /// Takes the sizes of edges half way to those of `points`, where everything is `growth` times as large: what
    /// is a third as long there is held alike on the way there and on the way back.
    pub(super) fn meet(&mut self, points: &[Vec3], growth: f64) {
        let there = sizes(points, self.rings);
        for (size, there) in self.sizes.iter_mut().zip(there) {
            *size = (*size * there / growth).sqrt();
        }
    }

    /// Numbers at the vertices, averaged along the cloth over about this share of the body's height.
    pub(super) fn averaged<T>(&self, mut values: Vec<T>, share: f64) -> Vec<T>
    where
        T: Copy + Sum + Mul<f64, Output = T>,
    {
        let size = self.sizes.iter().sum::<f64>() / self.sizes.len().max(1) as f64;
        let rounds = (share * self.height / size).powi(2).clamp(1.0, ROUNDS) as usize;
        for _ in 0..rounds {
            let mean = |(ring, own): (&Vec<u32>, &T)| {
                let around = ring.iter().map(|&i| values[i as usize]);
                around.chain([*own]).sum::<T>() * (1.0 / (1 + ring.len()) as f64)
            };
            values = self.rings.iter().zip(&values).map(mean).collect();
        }
        values
    }
}

/// Mean length of the edges around each vertex \[m\]; never far below the usual, for slivers and
/// loose vertices must be held too.
fn sizes(x: &[Vec3], rings: &[Vec<u32>]) -> Vec<f64> {
    let size = |(v, ring): (usize, &Vec<u32>)| {
        let sum: f64 = ring.iter().map(|&i| (x[i as usize] - x[v]).norm()).sum();
        sum / ring.len().max(1) as f64
    };
    let sizes: Vec<f64> = rings.iter().enumerate().map(size).collect();
    let mean = sizes.iter().sum::<f64>() / sizes.len().max(1) as f64;
    sizes.iter().map(|size| size.max(0.5 * mean)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use crate::geometry::TriangleMesh;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;

    #[test]
    fn sizes_half_way_are_the_same_there_and_back() {
        let TriangleMesh {
            positions: here,
            triangles,
        } = sphere(0.5, 2);
        // Half as large, and parts of it a third as long again.
        let place = |(i, p): (usize, &Vec3)| {
            0.5 * Vec3::new(p.x, p.y - 0.67 * p.y.max(0.0), p.z + 0.01 * noise(i))
        };
        let there: Vec<Vec3> = here.iter().enumerate().map(place).collect();
        let met = |from: &[Vec3], to: &[Vec3], growth: f64| {
            let body = TriangleMesh {
                positions: from.to_vec(),
                triangles: triangles.clone(),
            };
            let rings = rings(from.len(), &triangles);
            let (surface, upright) = (ClosestPoint::new(&body), (Vec3::y(), 1.0));
            let mut draped = Draped::new(from, (&triangles, &rings), &surface, upright);
            let before = draped.sizes.clone();
            draped.meet(to, growth);
            (before, draped.sizes)
        };
        let (plain, on_the_way) = met(&here, &there, 0.5);
        let (_, back) = met(&there, &here, 2.0);
        for (a, b) in on_the_way.iter().zip(&back) {
            assert!((a * 0.5 / b - 1.0).abs() < 1e-12, "{a} {b}");
        }
        let changed = plain.iter().zip(&on_the_way).map(|(a, b)| b / a);
        let least = changed.fold(f64::INFINITY, f64::min);
        // On the sides edges of all directions shrink to some 0.7 of their mean; √0.7 = 0.84.
        assert!((0.8..0.88).contains(&least), "{least}");
    }
}
