//! The refit (paper §4): a garment that fits one body in, the same design for another body out.
//!
//! [`refit`] is the data flow: source drape → target shape x* (§4.2) → cages (§4.3) and symmetry
//! (§4.5) → initial scale → drapes and steps (§3, §4.4) → the pattern as written.

pub mod dress;
mod flatten;
mod measure;
mod search;
mod stiffen;
mod written;

use crate::body::Body;
use crate::body::distance_field::DistanceField;
use crate::cage::{CageParams, Cages};
use crate::descent::DescentParams;
use crate::garment::{Fabric, Garment};
use crate::geometry::{Vec2, Vec3};
use crate::loss::{LossParams, LossTerms, Losses};
use crate::pattern::Pattern;
use crate::pattern::symmetry::Symmetry;
use crate::problem::Problem;
use crate::report::{Report, StageTime, Status};
use crate::sim::drape::DrapeProgress;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Assembly, Cloth, Scene, SimParams, Start, drape};
use crate::transfer::{TransferError, TransferParams, target_shape};
use dress::{HoldParams, drape_on, holds};
pub use measure::drape_report;
use serde::{Deserialize, Serialize};
use std::time::Instant;

/// Everything about how to refit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct RefitParams {
    /// Keep mirror pairs and self-mirrored panels mirrored (paper §4.5).
    pub symmetry: bool,
    /// How far the written curves may be from the deformed outline before a line becomes a
    /// quadratic and a quadratic a cubic curve \[m\].
    pub outline_tolerance: f64,
    /// The cloth.
    pub fabric: Fabric,
    /// What keeps it up.
    pub hold: HoldParams,
    /// The drape.
    pub sim: SimParams,
    /// The target shape.
    pub transfer: TransferParams,
    /// The cages.
    pub cage: CageParams,
    /// The loss.
    pub loss: LossParams,
    /// The search.
    pub descent: DescentParams,
}

impl Default for RefitParams {
    fn default() -> Self {
        Self {
            symmetry: true,
            outline_tolerance: crate::pattern::outline::TOLERANCE,
            fabric: Fabric::default(),
            hold: HoldParams::default(),
            sim: SimParams::default(),
            transfer: TransferParams::default(),
            cage: CageParams::default(),
            loss: LossParams::default(),
            descent: DescentParams::default(),
        }
    }
}

/// What a refit tells while it works; the observer answers whether to go on.
#[derive(Clone, Debug)]
pub enum Progress {
    /// A stage begins.
    Stage(&'static str),
    /// A drape proceeds.
    Drape(DrapeProgress),
    /// A step was accepted (or, for 0, the initial guess draped).
    Iteration {
        /// Accepted steps.
        iteration: usize,
        /// Weighted sum of the terms.
        loss: f64,
        /// The terms, unweighted.
        terms: LossTerms,
    },
}

/// Asked at every step of the work; `false` stops it at the best so far.
pub type Observer<'a> = dyn FnMut(&Progress) -> bool + 'a;

/// A refitted garment.
#[derive(Clone, Debug)]
pub struct Refit {
    /// The pattern, as it should be written: same panels, edges and stitches as the input's.
    pub pattern: Pattern,
    /// Its mesh's rest positions \[m\], `[pattern vertex]`.
    pub x_bar: Vec<Vec2>,
    /// Its drape on the target body \[m\], `[cloth vertex]`.
    pub x: Vec<Vec3>,
    /// The garment on the source body \[m\].
    pub source_drape: Vec<Vec3>,
    /// The target shape x* \[m\].
    pub x_star: Vec<Vec3>,
    /// The drape of the initial guess \[m\].
    pub initial: Vec<Vec3>,
    /// What happened.
    pub report: Report,
}

/// Why there is no refit.
#[derive(Clone, Debug, thiserror::Error)]
pub enum RefitError {
    /// The garment cannot be refitted.
    #[error("{}", .0.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n"))]
    Garment(Vec<Problem>),
    /// The bodies do not fit together.
    #[error(transparent)]
    Transfer(#[from] TransferError),
    /// The garment does not come to rest on a body.
    #[error("{}", does_not_rest(.body, *.status, *.residual))]
    NotAtRest {
        /// Name of the body.
        body: String,
        /// How the search ended.
        status: RestStatus,
        /// ‖f‖/(‖m‖|g|).
        residual: f64,
    },
    /// Stopped before there was anything to keep.
    #[error("interrupted before the first drape was done: there is nothing to keep yet")]
    Stopped,
}

fn does_not_rest(body: &str, status: RestStatus, residual: f64) -> String {
    match status {
        RestStatus::Sliding => format!(
            "the garment slides off the body `{body}`: nothing holds it. Label the edges of its \
             waist or neckline (`lower_interface`), or name their labels in the parameter \
             `hold.labels`"
        ),
        RestStatus::NotFinite => format!(
            "the drape on the body `{body}` broke down (positions are no longer numbers). Check \
             the unit of the garment, and its placement around the body"
        ),
        _ => format!(
            "the garment does not come to rest on the body `{body}` (force residual {residual:.1e} \
             of its weight). Allow more iterations (`sim.equilibrium.iterations`), or mesh it finer"
        ),
    }
}

/// A drape whose residual is below this is good enough to aim from, though not at rest [–].
const NEARLY_AT_REST: f64 = 1e-3;

/// Refits `garment`, which fits `source`, to `target`. The bodies must share one topology.
pub fn refit(
    garment: &Garment,
    source: &Body,
    target: &Body,
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Result<Refit, RefitError> {
    let mut clock = Clock::new();
    let mesh = &garment.mesh;

    // The drape on the source body: the file's own, or from the placed panels.
    clock.stage("source drape", observe);
    let source_drape = match &garment.drape {
        Some(x) => x.clone(),
        None => drape_to_rest(garment, source, params, observe)?,
    };

    // §4.2: the shape to aim for.
    clock.stage("target shape", observe);
    let outward = mesh.outward_triangles();
    let x_star = target_shape(&source_drape, &outward, source, target, &params.transfer)?.x_star;

    // §4.3, §4.5: the unknowns are the control points of one cage per panel.
    clock.stage("cages", observe);
    let symmetry = params
        .symmetry
        .then(|| Symmetry::detect(&garment.pattern, mesh, garment.drape.as_deref()));
    let cages = Cages::enclose(&garment.pattern, mesh, symmetry.as_ref(), &params.cage)
        .map_err(RefitError::Garment)?;
    let scale = initial_scale(garment, &source_drape, &x_star);

    // §3, §4.4: drape, compare, step.
    clock.stage("target body", observe);
    let surface = DistanceField::new(&target.mesh, DistanceField::SPACING, DistanceField::OUTER);
    let mut cloth = Cloth::new(mesh, &params.fabric);
    cloth.holds = holds(garment, &x_star, &params.hold);
    let assembly = Assembly::new(&cloth);
    let scene = Scene {
        cloth: &cloth,
        assembly: &assembly,
        surface: &surface,
        params: &params.sim,
    };
    let losses = Losses::new(&garment.pattern, mesh, &x_star, &params.loss);
    let motions = search::motions(&cages, mesh);
    let search = search::Search {
        mesh,
        cages: &cages,
        losses: &losses,
        scene: &scene,
        x_star: &x_star,
        params: &params.descent,
        body: &target.name,
        motions: &motions,
        fresh_starts: search::FRESH_STARTS,
    };
    clock.stage("search in stiffer cloth", observe);
    let initial = cages.scaled(scale);
    let drapes = [source_drape.as_slice(), &x_star];
    let flattened = flatten::flatten(mesh, &cages, &motions, &losses, drapes, initial.clone());
    let mut guesses = vec![flattened];
    let third = stiffen::stiffened(&search, initial.clone(), guesses.clone(), &clock, observe)?;
    guesses.extend(third);
    clock.stage("search", observe);
    let found = search.run(initial, guesses, &clock, observe)?;

    // The pattern as it will be cut: curves within the tolerance, and the drape of just that.
    clock.stage("pattern as written", observe);
    let written = written::write(garment, &found.x_bar, params.outline_tolerance);
    let last = drape(
        &scene,
        &written.x_bar,
        found.x.clone(),
        Start::Near,
        &mut |_| true,
    );
    clock.stage("done", observe);

    let measured = measure::Measured {
        garment,
        source,
        target,
        source_drape: &source_drape,
        x_star: &x_star,
        symmetry: symmetry.as_ref(),
        written: &written,
        last: &last,
        losses: &losses,
    };
    let report = measured.report(
        found.status,
        scale,
        cages.unknown_count(),
        found.iterations,
        clock.stages,
    );
    Ok(Refit {
        pattern: written.pattern,
        x_bar: written.x_bar,
        x: last.x,
        source_drape,
        x_star,
        initial: found.initial,
        report,
    })
}

/// The garment's drape on `body`, which must come to rest.
fn drape_to_rest(
    garment: &Garment,
    body: &Body,
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Result<Vec<Vec3>, RefitError> {
    let found = drape_on(
        garment,
        body,
        &params.fabric,
        &params.hold,
        &params.sim,
        &mut |p| observe(&Progress::Drape(p)),
    );
    if found.status == RestStatus::Stopped {
        return Err(RefitError::Stopped);
    }
    accept(&found, body)?;
    Ok(found.x)
}

/// Refuses a drape that is not nearly at rest on `body`.
pub fn accept(found: &crate::sim::Drape, body: &Body) -> Result<(), RefitError> {
    let near = found.residual < NEARLY_AT_REST && found.status != RestStatus::Sliding;
    if found.status == RestStatus::AtRest || near {
        return Ok(());
    }
    Err(RefitError::NotAtRest {
        body: body.name.clone(),
        status: found.status,
        residual: found.residual,
    })
}

/// The uniform scale of the initial guess (§4.6, corrected): √ of the growth of the cloth's area
/// from drape to target, so that stretch already in the drape does not count as size.
fn initial_scale(garment: &Garment, drape: &[Vec3], x_star: &[Vec3]) -> f64 {
    let triangles = garment.mesh.cloth_triangles();
    let area = |x: &[Vec3]| -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| x[v as usize]);
            (b - a).cross(&(c - a)).norm()
        };
        triangles.iter().map(doubled).sum()
    };
    (area(x_star) / area(drape)).sqrt().clamp(0.3, 3.0)
}

/// Times the stages.
pub(crate) struct Clock {
    start: Instant,
    current: Option<(&'static str, Instant)>,
    stages: Vec<StageTime>,
}

impl Clock {
    fn new() -> Self {
        Self {
            start: Instant::now(),
            current: None,
            stages: Vec::new(),
        }
    }

    /// Ends the current stage and begins another.
    fn stage(&mut self, stage: &'static str, observe: &mut Observer<'_>) {
        if let Some((stage, since)) = self.current.replace((stage, Instant::now())) {
            let seconds = since.elapsed().as_secs_f64();
            self.stages.push(StageTime { stage, seconds });
        }
        observe(&Progress::Stage(stage));
    }

    /// Since the start [s].
    fn elapsed(&self) -> f64 {
        self.start.elapsed().as_secs_f64()
    }
}

/// What a refit ended with before it was written.
pub(crate) struct Found {
    zeta: Vec<f64>,
    x_bar: Vec<Vec2>,
    x: Vec<Vec3>,
    initial: Vec<Vec3>,
    status: Status,
    iterations: Vec<crate::report::Iteration>,
}
