//! A second guess for the pattern, from the target shape alone: the rest shape under which every
//! triangle of x* is stretched as it was in the source drape.
//!
//! Per triangle, with C = FᵀF of the source drape and C* of the target shape, both over the
//! reference rest shape, the wanted change of the rest shape is the symmetric A with A C A = C*, up
//! to a rotation R. The cages are fitted to it by minimising Σ w |x̄-map − R A|² + (curvature and
//! seam terms of the loss), R anew in every round, as in as-rigid-as-possible mapping (Sorkine &
//! Alexa 2007). No drape is needed. Not in the paper, whose initial guess is a uniform scale.

use super::prepare::Prepared;
use super::search::guards::{can_be_cut, quality_floor, without};
use super::search::newton::slope;
use crate::descent::Model;
use crate::geometry::{Mat2, Vec2, Vec3};
use crate::loss::Row;
use crate::pattern::PatternMesh;
use crate::sim::energy::membrane::RestTriangle;
use nalgebra::DVector;

/// How much more evenness is asked of the cages than in the search, to leave it room.
const ROOM: f64 = 20.0;
/// Rounds of rotations and fits.
const ROUNDS: usize = 12;
/// Weight of the mean squared strain that remains: 1 % costs 0.1.
const STRAIN: f64 = 1000.0;
/// No triangle may fall below this part of the reference pattern's poorest; leaves the search room.
const LEAST_QUALITY: f64 = 0.85;
/// Damping of the fits, for what nothing determines.
const DAMPING: f64 = 1e-4;

/// Unknowns, starting from the initial guess, whose rest shape makes x* as stretched as the source
/// drape is over the reference.
pub(super) fn flatten(prepared: &Prepared<'_>) -> Vec<f64> {
    let mesh = &prepared.garment.mesh;
    let wanted: Vec<Wanted> = (0..mesh.triangles.len())
        .filter_map(|t| Wanted::new(mesh, t, &prepared.source_drape, &prepared.x_star))
        .collect();
    let area: f64 = wanted.iter().map(|w| w.rest.area).sum();
    fitted(prepared, prepared.initial(), ROOM, |x_bar| {
        let rows = |w: &Wanted| w.rows(x_bar, (STRAIN * w.rest.area / area).sqrt());
        wanted.iter().flat_map(rows).collect()
    })
}

/// The unknowns nearest to what `wanted`, residuals of the rest shape alone, asks for, with the terms of
/// the loss that ask for a good pattern, and `evenness` times as much evenness of the cages.
pub(super) fn fitted(
    prepared: &Prepared<'_>,
    mut zeta: Vec<f64>,
    evenness: f64,
    wanted: impl Fn(&[Vec2]) -> Vec<Row>,
) -> Vec<f64> {
    let Prepared {
        cages,
        motions,
        losses,
        x_star,
        ..
    } = prepared;
    let mesh = &prepared.garment.mesh;
    let floor = quality_floor(mesh, LEAST_QUALITY);
    for _ in 0..ROUNDS {
        let x_bar = cages.deform(&zeta);
        // At x* itself only the terms of the pattern remain.
        let of_pattern = |row: &Row| row.x.is_empty();
        let mut rows: Vec<Row> = losses.rows(x_star, &x_bar);
        rows.retain(of_pattern);
        rows.extend(wanted(&x_bar));
        let weights = losses.weights();
        let priors = cages.priors(&zeta, weights.affine, evenness * weights.cage);
        let model = Model::new(rows.len() + priors.len(), motions.len(), |i, by| {
            let Some(row) = rows.get(i) else {
                return priors[i - rows.len()].fill(by);
            };
            for (by, motion) in by.iter_mut().zip(motions) {
                *by = slope(row, &[], motion);
            }
            row.value
        });
        let Some(mut step) = model.step(DAMPING) else {
            return zeta;
        };
        without(&mut step, &cages.rigid_modes(&zeta));
        let Some(next) = shortened(&zeta, &step, |next| can_be_cut(cages, mesh, next, floor))
        else {
            return zeta;
        };
        zeta = next;
    }
    zeta
}

/// `zeta` moved by the longest of a few parts of `step` that is allowed.
fn shortened(
    zeta: &[f64],
    step: &DVector<f64>,
    allowed: impl Fn(&[f64]) -> bool,
) -> Option<Vec<f64>> {
    [1.0, 0.5, 0.25, 0.1, 0.03].into_iter().find_map(|part| {
        let moved = zeta.iter().zip(step.iter());
        let next: Vec<f64> = moved.map(|(z, d)| z + part * d).collect();
        allowed(&next).then_some(next)
    })
}

/// What one triangle's rest shape should become.
struct Wanted {
    corners: [u32; 3],
    rest: RestTriangle,
    /// A \[–\].
    change: Mat2,
}

impl Wanted {
    /// None where a triangle of either drape has collapsed.
    fn new(mesh: &PatternMesh, t: usize, drape: &[Vec3], x_star: &[Vec3]) -> Option<Self> {
        let corners = mesh.triangles[t];
        let rest = RestTriangle::new(corners.map(|v| mesh.x_bar[v as usize]));
        let metric = |x: &[Vec3]| {
            let f = rest.gradient_of(corners.map(|v| x[mesh.sewing[v as usize] as usize]));
            f.transpose() * f
        };
        // A = C^-½ (C^½ C* C^½)^½ C^-½, the geometric mean of C⁻¹ and C*.
        let root = square_root(&metric(drape))?;
        let inverse = root.try_inverse()?;
        let change = inverse * square_root(&(root * metric(x_star) * root))? * inverse;
        Some(Self {
            corners,
            rest,
            change,
        })
    }

    /// Residuals of the four entries of x̄-map − R A.
    fn rows(&self, x_bar: &[Vec2], scale: f64) -> [Row; 4] {
        let b = self.rest.gradients();
        let mut map = Mat2::zeros();
        for (v, b) in self.corners.iter().zip(b) {
            map += x_bar[*v as usize] * b.transpose();
        }
        let goal = rotation_of(&(map * self.change)) * self.change;
        std::array::from_fn(|k| {
            let (i, j) = (k / 2, k % 2);
            let mut axis = Vec2::zeros();
            axis[i] = scale;
            let by = |a: usize| (self.corners[a], axis * b[a][j]);
            Row {
                value: scale * (map - goal)[(i, j)],
                x: Vec::new(),
                x_bar: (0..3).map(by).collect(),
            }
        })
    }
}

/// The rotation nearest to `m`.
fn rotation_of(m: &Mat2) -> Mat2 {
    let (c, s) = (m.m11 + m.m22, m.m21 - m.m12);
    let length = c.hypot(s);
    if length == 0.0 {
        return Mat2::identity();
    }
    Mat2::new(c, -s, s, c) / length
}

/// Square root of a symmetric positive definite 2×2 matrix; none if it is not.
fn square_root(m: &Mat2) -> Option<Mat2> {
    let squared = m.determinant();
    if !(squared > 0.0 && m.trace() > 0.0) {
        return None;
    }
    // Cayley–Hamilton: √M = (M + √det I)/√(tr + 2 √det).
    let root = squared.sqrt();
    Some((m + Mat2::identity() * root) / (m.trace() + 2.0 * root).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn the_square_root_squares_to_the_matrix() {
        let m = Mat2::new(2.0, 0.3, 0.3, 0.7);
        let root = square_root(&m).expect("positive definite");
        assert_relative_eq!(root * root, m, epsilon = 1e-14);
        assert!(square_root(&Mat2::new(1.0, 2.0, 2.0, 1.0)).is_none());
    }

    #[test]
    fn the_nearest_rotation_of_a_turned_stretch_is_its_turn() {
        let turn = Mat2::new(0.6, -0.8, 0.8, 0.6);
        let stretch = Mat2::new(1.3, 0.2, 0.2, 0.9);
        assert_relative_eq!(rotation_of(&(turn * stretch)), turn, epsilon = 1e-14);
    }
}
