//! What no step may do, whatever makes it, and a few measures of steps.

use crate::cage::Cages;
use crate::geometry::Vec2;
use crate::geometry::quality::qualities;
use crate::pattern::PatternMesh;
use nalgebra::DVector;

/// Whether the rest shape at `zeta` can be cut: cages and outlines do not cross, and no triangle is
/// flipped or poorer than `floor`.
pub(in crate::refit) fn can_be_cut(
    cages: &Cages,
    mesh: &PatternMesh,
    zeta: &[f64],
    floor: f64,
) -> bool {
    cages.check(zeta).is_ok() && least_quality(mesh, &cages.deform(zeta)) >= floor
}

/// The part `of` of the quality of the reference pattern's poorest triangle.
pub(in crate::refit) fn quality_floor(mesh: &PatternMesh, of: f64) -> f64 {
    of * least_quality(mesh, &mesh.x_bar)
}

fn least_quality(mesh: &PatternMesh, x_bar: &[Vec2]) -> f64 {
    let each = qualities(x_bar, &mesh.triangles);
    each.into_iter().fold(f64::INFINITY, f64::min)
}

/// Farthest any vertex is from its partner \[m\].
pub(in crate::refit) fn farthest(a: &[Vec2], b: &[Vec2]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    apart.fold(0.0, f64::max)
}

/// Removes from `step` what only moves panels about: it does nothing to the drape, and would turn
/// panels against their grain.
pub(in crate::refit) fn without(step: &mut DVector<f64>, rigid: &[Vec<f64>]) {
    for mode in rigid {
        let along: f64 = mode.iter().zip(step.iter()).map(|(m, s)| m * s).sum();
        for (s, m) in step.iter_mut().zip(mode) {
            *s -= along * m;
        }
    }
}
