//! What happened in a refit, as plain numbers.

use crate::geometry::quality::QualitySummary;
use crate::loss::LossTerms;
use crate::sim::OrFabric;
use crate::sim::equilibrium::RestStatus;
use serde::{Deserialize, Serialize};

/// How a refit ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Status {
    /// The loss does not fall any further to speak of.
    Converged,
    /// The largest number of steps was taken.
    IterationLimit,
    /// No step that was tried lowers the loss, though its gradient promises it.
    Stalled,
    /// Interrupted: the best so far.
    Stopped,
}

/// Why a search took no further step.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// The loss fell by less than `descent.tolerance`.
    SmallChange,
    /// No pattern vertex moved farther than `descent.least_step`.
    ShortStep,
    /// By its gradient, no step lowers the loss by more than `descent.tolerance`.
    Flat,
    /// The gradient promises more, but no step that was tried lowered the loss.
    NoBetterStep,
    /// `descent.iterations` were taken.
    IterationLimit,
    /// Somebody asked to stop.
    Interrupted,
}

impl Ending {
    /// What that says of the result.
    pub fn status(self) -> Status {
        match self {
            Self::SmallChange | Self::ShortStep | Self::Flat => Status::Converged,
            Self::NoBetterStep => Status::Stalled,
            Self::IterationLimit => Status::IterationLimit,
            Self::Interrupted => Status::Stopped,
        }
    }
}

/// One accepted step, or the start.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct Iteration {
    /// 0 is the initial guess.
    pub iteration: usize,
    /// Rate of the springs that draw the cloth to x\* \[1/s²\]; 0 in free cloth. Losses of different
    /// rates are of different drapes.
    pub guide: f64,
    /// Weighted sum of the terms.
    pub loss: f64,
    /// The paper's shape-matching part of it.
    pub shape_matching: f64,
    /// The terms, unweighted.
    pub terms: LossTerms,
    /// ‖∂L/∂ζ‖ \[1/m\].
    pub gradient_norm: f64,
    /// ‖λ‖∞ \[m/N · 1/m\] of the adjoint K λ = x̂.
    pub adjoint_norm: f64,
    /// ‖f‖/(‖m‖|g|) of the drape.
    pub residual: f64,
    /// σ added to make the stiffness definite \[1/s²\]; 0 at a proper minimum.
    pub shift: f64,
    /// Farthest move of a pattern vertex in the step that led here \[m\].
    pub moved: f64,
    /// Drapes done so far, refused ones included.
    pub drapes: usize,
    /// Factorisations done so far.
    pub factorisations: usize,
    /// Since the start of the refit \[s\].
    pub elapsed: f64,
}

/// A drape's state.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct DrapeReport {
    /// How its search for equilibrium ended.
    pub status: RestStatus,
    /// ‖f‖/(‖m‖|g|).
    pub residual: f64,
    /// Coulomb's coefficient of cloth on the body \[–\], or "fabric" for the fabrics' own.
    pub friction: OrFabric,
    /// Deepest cloth vertex inside the body's mesh \[m\]; 0 when none is.
    pub deepest_penetration: f64,
    /// Cloth vertices inside the body's mesh.
    pub vertices_inside: usize,
    /// Pairs of a cloth triangle and a body triangle that intersect.
    pub through_body: usize,
    /// Pairs of cloth triangles that intersect and share no vertex.
    pub through_itself: usize,
    /// Smallest principal stretch of any triangle; below 0.6 the membrane model is out of its
    /// depth.
    pub least_stretch: f64,
    /// Largest principal stretch of any triangle.
    pub most_stretch: f64,
}

/// Triangle quality of a pattern.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PatternQuality {
    /// 4√3 A/(l₁²+l₂²+l₃²).
    pub quality: QualitySummary,
    /// Triangles of negative area.
    pub flipped: usize,
}

/// A stitch before and after.
#[derive(Clone, Debug, Serialize)]
pub struct SeamReport {
    /// "panel:edge" of both sides.
    pub sides: [String; 2],
    /// Lengths before \[m\].
    pub before: [f64; 2],
    /// Lengths after \[m\].
    pub after: [f64; 2],
    /// Change of the ratio of the two lengths \[–\]; 0 keeps the designed ease.
    pub ratio_change: f64,
}

/// A panel before and after.
#[derive(Clone, Debug, Serialize)]
pub struct PanelReport {
    /// Its name.
    pub panel: String,
    /// \[m²\].
    pub area_before: f64,
    /// \[m²\].
    pub area_after: f64,
    /// Farthest the deformed outline is from the curves written \[m\], `[edge]`.
    pub outline_residuals: Vec<f64>,
    /// Edge lengths before \[m\], `[edge]`.
    pub edges_before: Vec<f64>,
    /// Edge lengths after \[m\], `[edge]`.
    pub edges_after: Vec<f64>,
}

/// A pair of panels that mirror each other, or one that mirrors itself.
#[derive(Clone, Debug, Serialize)]
pub struct MirrorReport {
    /// Their names.
    pub panels: [String; 2],
    /// Farthest a corner of one, as written, is from the mirrored corner of the other, beyond what
    /// the input has \[m\].
    pub error: f64,
}

/// Time of one stage.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct StageTime {
    /// Its name.
    pub stage: &'static str,
    /// \[s\].
    pub seconds: f64,
}

/// Everything about a refit.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of this library.
    pub version: &'static str,
    /// How it ended.
    pub status: Status,
    /// Why no further step was taken.
    pub ending: Ending,
    /// Names of garment, source body and target body.
    pub names: [String; 3],
    /// Cloth vertices and triangles.
    pub size: [usize; 2],
    /// Real unknowns of the cages.
    pub unknowns: usize,
    /// The uniform scale of the initial guess.
    pub initial_scale: f64,
    /// The initial guess, then every accepted step.
    pub iterations: Vec<Iteration>,
    /// The loss of the pattern as written.
    pub written: Option<LossTerms>,
    /// Mean and largest distance of the final drape to x* \[m\].
    pub distance_to_target: [f64; 2],
    /// The garment on the source body.
    pub source_drape: DrapeReport,
    /// The pattern as written, on the target body.
    pub final_drape: DrapeReport,
    /// The input's triangles.
    pub quality_before: PatternQuality,
    /// The written pattern's.
    pub quality_after: PatternQuality,
    /// Per panel.
    pub panels: Vec<PanelReport>,
    /// Per stitch.
    pub seams: Vec<SeamReport>,
    /// Per mirror pair; empty with symmetry off.
    pub mirrors: Vec<MirrorReport>,
    /// Seconds per stage.
    pub stages: Vec<StageTime>,
}
