//! Points of the cloth that feel the body: those of a triangular grid in every triangle of the mesh,
//! its vertices included. A mesh alone would let the body come through between its vertices.

use crate::geometry::Vec3;
use std::collections::BTreeMap;

/// A point of a triangle that feels the body: p = Σ weight · x over its corners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ContactPoint {
    /// Cloth vertices, rising; those without weight come last and repeat the first.
    corners: [u32; 3],
    /// Positive, and zero for what repeats; they add up to one.
    weights: [f64; 3],
    /// Its part of the reference pattern's area \[m²\].
    pub area: f64,
    /// Coulomb's coefficient on the body \[–\]: the mean of the fabrics about it.
    pub friction: f64,
}

impl ContactPoint {
    /// The vertices that make it up, with their weights ∂p/∂x.
    pub fn parts(&self) -> impl Iterator<Item = (usize, f64)> + use<> {
        let parts = self.corners.into_iter().zip(self.weights);
        parts
            .filter(|(_, w)| *w > 0.0)
            .map(|(v, w)| (v as usize, w))
    }

    /// The same point with vertex `number[v]` in place of v; numbers rise with v.
    pub(in crate::sim) fn renumbered(&self, number: &[u32]) -> Self {
        Self {
            corners: self.corners.map(|v| number[v as usize]),
            ..*self
        }
    }

    /// Where it is \[m\].
    pub fn at(&self, x: &[Vec3]) -> Vec3 {
        self.parts().map(|(v, w)| x[v] * w).sum()
    }

    /// Σ weight² w over its vertices: what a push at the point moves it by, for the inverse masses
    /// `w` \[1/kg\].
    pub fn inverse_mass(&self, w: &[f64]) -> f64 {
        self.parts().map(|(v, weight)| weight * weight * w[v]).sum()
    }
}

/// Farthest that points are apart \[m\]: across it a limb of 25 mm radius bulges by half a millimetre.
const SPACING: f64 = 10e-3;

/// Pieces into which the sides of `count` triangles of such areas \[m²\] are cut.
fn pieces(count: usize, area: impl Fn(usize) -> f64) -> u32 {
    let mean = (0..count).map(area).sum::<f64>() / count.max(1) as f64;
    // Of an equilateral triangle of mean size.
    let side = (4.0 / 3.0_f64.sqrt() * mean).sqrt();
    (side / SPACING).ceil().max(1.0) as u32
}

/// The points of all `triangles` of the sewn cloth, once each, with areas that integrate over the pieces
/// into which the grid cuts every triangle, from the triangles' `area` \[m²\] and `friction`. The grid of a
/// triangle is halved as often as `halved` tells, that of those after its end never; each of its points then
/// still has the area of one in the whole grid, for taut cloth hangs on few points of a sharp fold, and must
/// not press through them.
pub(super) fn contact_points(
    triangles: &[[u32; 3]],
    area: impl Fn(usize) -> f64,
    friction: impl Fn(usize) -> f64,
    halved: &[u8],
) -> Vec<ContactPoint> {
    let coarse = pieces(triangles.len(), &area);
    let most = halved.iter().copied().max().unwrap_or(0);
    let finest = coarse << most;
    // Of every point the corners with their shares, out of the finest pieces; area, and friction times area.
    let mut sums: BTreeMap<[(u32, u32); 3], [f64; 2]> = BTreeMap::new();
    for (t, triangle) in triangles.iter().enumerate() {
        let halved = halved.get(t).copied().unwrap_or(0);
        let pieces = coarse << halved;
        let third = area(t) / f64::from(3 * coarse * coarse);
        for i in 0..=pieces {
            for j in 0..=pieces - i {
                let shares = [pieces - i - j, i, j].map(|share| share << (most - halved));
                let around = match shares.iter().filter(|s| **s > 0).count() {
                    1 => 1.0,
                    2 => 3.0,
                    _ => 6.0,
                };
                let sum = sums.entry(key(*triangle, shares)).or_default();
                sum[0] += third * around;
                sum[1] += third * around * friction(t);
            }
        }
    }
    let point = |(key, [area, sum]): ([(u32, u32); 3], [f64; 2])| ContactPoint {
        corners: key.map(|(v, _)| v),
        weights: key.map(|(_, share)| f64::from(share) / f64::from(finest)),
        area,
        friction: sum / area,
    };
    sums.into_iter().map(point).collect()
}

/// The corners that have a share, rising, and then the first of them again with none.
fn key(triangle: [u32; 3], shares: [u32; 3]) -> [(u32, u32); 3] {
    let mut parts = [0, 1, 2].map(|k| (triangle[k], shares[k]));
    // Those without a share come last.
    parts.sort_unstable_by_key(|(v, share)| (*share == 0, *v));
    parts.map(|(v, share)| {
        if share == 0 {
            (parts[0].0, 0)
        } else {
            (v, share)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pattern::PatternMesh;
    use crate::sim::cloth::fixtures;
    use approx::assert_relative_eq;

    fn points(mesh: &PatternMesh) -> Vec<ContactPoint> {
        halved_points(mesh, &[])
    }

    fn halved_points(mesh: &PatternMesh, halved: &[u8]) -> Vec<ContactPoint> {
        let area = |t| mesh.rest_area(t, &mesh.x_bar);
        contact_points(&mesh.triangles, area, |_| 0.0, halved)
    }

    #[test]
    fn points_integrate_linear_functions_over_the_cloth() {
        let (width, height) = (0.6, 0.4);
        let mesh = fixtures::sheet(12, 8, 0.05);
        let points = points(&mesh);
        let x: Vec<Vec3> = mesh
            .x_bar
            .iter()
            .map(|p| Vec3::new(p.x, p.y, 0.0))
            .collect();
        let total = |f: &dyn Fn(Vec3) -> f64| -> f64 {
            points
                .iter()
                .map(|point| point.area * f(point.at(&x)))
                .sum()
        };
        assert_relative_eq!(total(&|_| 1.0), width * height, max_relative = 1e-12);
        let first_moment = 0.5 * width * width * height;
        assert_relative_eq!(total(&|p| p.x), first_moment, max_relative = 1e-12);
    }

    #[test]
    fn a_halved_grid_has_the_points_of_the_whole_and_more_that_count_as_much() {
        let mesh = fixtures::sheet(3, 2, 0.025);
        let (whole, halved) = (points(&mesh), halved_points(&mesh, &[0, 0, 1]));
        // Three pieces a side become six: 28 points instead of 10.
        assert_eq!(halved.len(), whole.len() + 18);
        let among_halved = |p: &ContactPoint| {
            let mut same = halved.iter();
            same.any(|q| (q.corners, q.weights, q.area) == (p.corners, p.weights, p.area))
        };
        assert!(whole.iter().all(among_halved));
    }

    #[test]
    fn points_of_a_side_are_shared_by_its_triangles() {
        let mesh = fixtures::sheet(3, 2, 0.025);
        assert_eq!(
            pieces(mesh.triangles.len(), |t| mesh.rest_area(t, &mesh.x_bar)),
            3
        );
        let points = points(&mesh);
        // Three sides a triangle, two triangles an inner side; ten outer sides. Two points on each side
        // and one in each triangle.
        let sides = usize::midpoint(3 * mesh.triangles.len(), 10);
        assert_eq!(
            points.len(),
            mesh.x_bar.len() + 2 * sides + mesh.triangles.len()
        );
    }
}
