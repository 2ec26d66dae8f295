//! The pattern as it will be cut: deformed outlines turned back into curves, and the mesh of just
//! those curves.

use crate::garment::Garment;
use crate::geometry::Vec2;
use crate::pattern::Pattern;
use crate::pattern::outline::{conform, refit_outlines};

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
