//! The pattern as it will be cut: deformed outlines turned back into curves, and the mesh of just
//! those curves.

use super::Found;
use crate::body::DistanceField;
use crate::garment::Garment;
use crate::geometry::{Vec2, Vec3};
use crate::pattern::Pattern;
use crate::pattern::outline::{conform, refit_outlines};
use crate::sim::Scene;
use crate::sim::differentiable::differentiable_at;

/// A pattern as written.
pub(super) struct Written {
    pub(super) pattern: Pattern,
    /// Rest positions of the mesh on its curves \[m\].
    pub(super) x_bar: Vec<Vec2>,
    /// Farthest the deformed outline is from the written curve \[m\], `[panel][edge]`.
    pub(super) residuals: Vec<Vec<f64>>,
}

/// Writes the deformed rest shape as curves, within `tolerance` \[m\] where cubics allow it.
pub(super) fn write(garment: &Garment, x_bar: &[Vec2], tolerance: f64) -> Written {
    let outlines = refit_outlines(&garment.pattern, &garment.mesh, x_bar, tolerance);
    Written {
        x_bar: conform(&outlines.pattern, &garment.mesh, x_bar),
        pattern: outlines.pattern,
        residuals: outlines.residuals,
    }
}

/// Where the drape of the pattern that was found is predicted to go with that as written \[m\]; where it is if that
/// cannot be told.
pub(super) fn predicted(
    scene: &Scene<'_, DistanceField>,
    found: &Found,
    written: &Written,
) -> Vec<Vec3> {
    let moved = written.x_bar.iter().zip(&found.x_bar);
    let motion = moved.map(|(w, f)| w - f).collect();
    let state = differentiable_at(scene, &found.x_bar, found.x.clone(), found.grips.clone());
    let predicted = state.and_then(|state| state.predicted(motion));
    predicted.unwrap_or_else(|| found.x.clone())
}
