//! The refit (paper §4): a garment that fits one body in, the same design for another body out.
//!
//! [`refit`] is the data flow: source drape → target shape x* (§4.2) → cages (§4.3) and symmetry
//! (§4.5) → initial scale, all these in `refit/prepare.rs` → drapes and steps (§3, §4.4) → the
//! pattern as written.

pub mod checkpoint;
pub mod dress;
mod flatten;
pub mod gradient_check;
mod levels;
mod measure;
mod prepare;
pub mod recovery;
mod search;
pub mod transfer;
mod untangle;
mod written;

use crate::body::{Body, DistanceField};
use crate::cage::CageParams;
use crate::descent::DescentParams;
use crate::garment::{Fabric, FabricZone, Garment, PressedFold, cuts, fold_lines, unknown_panels};
use crate::geometry::{Vec2, Vec3};
use crate::loss::{LossParams, LossTerms};
use crate::pattern::Pattern;
use crate::problem::Problem;
use crate::report::{Ending, Report, StageTime};
use crate::sim::drape::DrapeProgress;
use crate::sim::energy::friction::Grip;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Cloth, SimParams, Start, drape};
use crate::transfer::{TransferError, TransferParams};
use checkpoint::Checkpoint;
use dress::{HoldParams, drape_on_surface};
pub use measure::drape_report;
use prepare::Prepared;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use untangle::untangled;

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
    /// Panels of another fabric or grain.
    pub fabric_zones: Vec<FabricZone>,
    /// Folds that are pressed along seams.
    pub folds: Vec<PressedFold>,
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
    /// Vertices of the mesh that is searched first; 0 for none. The paper has none.
    pub coarse: usize,
    /// Vertices of the mesh that is searched next, from which a finer one takes over; 0 for none. The paper
    /// has none.
    pub medium: usize,
}

impl RefitParams {
    /// The cloth of `garment`: its panels cut, its folds pressed. What they name must be there.
    fn cloth(&self, garment: &Garment) -> Cloth {
        let (pattern, mesh) = (&garment.pattern, &garment.mesh);
        let cuts = cuts(pattern, &self.fabric, &self.fabric_zones);
        let mut cloth = Cloth::cut_from(mesh, &cuts);
        cloth.press(mesh, &fold_lines(pattern, &self.folds).unwrap_or_default());
        cloth
    }

    /// Fabrics and folds that are told of something that the pattern does not have.
    pub fn problems(&self, pattern: &Pattern) -> Vec<Problem> {
        let mut problems = unknown_panels(pattern, &self.fabric_zones);
        problems.extend(fold_lines(pattern, &self.folds).err().into_iter().flatten());
        problems
    }
}

impl Default for RefitParams {
    fn default() -> Self {
        Self {
            symmetry: true,
            outline_tolerance: crate::pattern::outline::TOLERANCE,
            fabric: Fabric::default(),
            fabric_zones: Vec::new(),
            folds: Vec::new(),
            hold: HoldParams::default(),
            sim: SimParams::default(),
            transfer: TransferParams::default(),
            cage: CageParams::default(),
            loss: LossParams::default(),
            descent: DescentParams::default(),
            coarse: 800,
            medium: 2500,
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
    /// The search may be taken up from here.
    Checkpoint(Box<Checkpoint>),
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
    #[error("{}", does_not_rest(.body, *.status, *.residual, .broken.as_deref()))]
    NotAtRest {
        /// Name of the body.
        body: String,
        /// How the search ended.
        status: RestStatus,
        /// ‖f‖/(‖m‖|g|).
        residual: f64,
        /// Where it broke down, if it did.
        broken: Option<String>,
    },
    /// The checkpoint is of another refit.
    #[error(
        "the checkpoint is of another refit: garment, bodies and parameters must be those that it was \
         made with"
    )]
    OtherCheckpoint,
    /// Stopped before there was anything to keep.
    #[error("interrupted before the first drape was done: there is nothing to keep yet")]
    Stopped,
}

fn does_not_rest(body: &str, status: RestStatus, residual: f64, broken: Option<&str>) -> String {
    match status {
        RestStatus::Sliding => format!(
            "the garment slides off the body `{body}`: nothing holds it. Label the edges of its \
             waist or neckline (`lower_interface`), name their labels in the parameter \
             `hold.labels`, hold its upper rim (`hold.rim`), or let friction hold it \
             (`sim.contact.friction`, say 0.4, or \"fabric\")"
        ),
        RestStatus::NotFinite => format!(
            "the drape on the body `{body}` broke down (positions or gradients are no longer numbers){}. Check \
             the unit of the garment, its fabric, and its placement around the body",
            broken.map(|told| format!(" {told}")).unwrap_or_default()
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
    refit_from(garment, source, target, params, Given::default(), observe)
}

/// What a refit is given besides its inputs.
#[derive(Clone, Debug, Default)]
pub struct Given {
    /// The shape to aim for \[m\], `[cloth vertex]`, instead of one carried over from the source body.
    pub x_star: Option<Vec<Vec3>>,
    /// Where to go on from, as if it had not been interrupted.
    pub checkpoint: Option<Checkpoint>,
}

/// A [`refit`] that is given more.
pub fn refit_from(
    garment: &Garment,
    source: &Body,
    target: &Body,
    params: &RefitParams,
    given: Given,
    observe: &mut Observer<'_>,
) -> Result<Refit, RefitError> {
    let mut clock = Clock::new();
    let Given { x_star, checkpoint } = given;
    if let Some(checkpoint) = &checkpoint {
        clock.before = checkpoint.elapsed;
    }
    let prepared = Prepared::new(
        garment,
        [source, target],
        x_star,
        params,
        &mut clock,
        observe,
    )?;
    let scene = prepared.scene();

    // §3, §4.4, §4.6: drape, compare, step.
    let found = levels::searched(&prepared, checkpoint, &mut clock, observe)?;

    // The pattern as it will be cut: curves within the tolerance, and the drape of just that.
    clock.stage("pattern as written", observe);
    let written = written::write(garment, &found.x_bar, params.outline_tolerance);
    let start = written::predicted(&scene, &found, &written);
    let last = drape(&scene, &written.x_bar, start, Start::Near, &mut |p, _| {
        observe(&Progress::Drape(p));
        true
    });
    let last = if found.ending == Ending::Interrupted {
        last
    } else {
        untangled(garment, &scene, &written.x_bar, last, &mut |p, _| {
            observe(&Progress::Drape(p))
        })
    };
    clock.stage("done", observe);

    let measured = measure::Measured {
        garment,
        source,
        target,
        source_drape: &prepared.source_drape,
        x_star: &prepared.x_star,
        symmetry: prepared.symmetry.as_ref(),
        written: &written,
        last: &last,
        losses: &prepared.losses,
    };
    let report = measured.report(
        found.ending,
        prepared.scale,
        prepared.cages.unknown_count(),
        found.iterations,
        clock.stages,
    );
    Ok(Refit {
        pattern: written.pattern,
        x_bar: written.x_bar,
        x: last.x,
        source_drape: prepared.source_drape,
        x_star: prepared.x_star,
        initial: found.initial,
        report,
    })
}

/// The garment's drape on `body`, which must come to rest.
fn drape_to_rest(
    garment: &Garment,
    (body, surface): (&Body, &DistanceField),
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Result<Vec<Vec3>, RefitError> {
    let found = drape_on_surface(garment, body, surface, params, &mut |p, _| {
        observe(&Progress::Drape(p))
    });
    if found.status == RestStatus::Stopped {
        return Err(RefitError::Stopped);
    }
    accept(&found, garment, body)?;
    Ok(found.x)
}

/// Refuses a drape of `garment` that is not nearly at rest on `body`.
pub fn accept(found: &crate::sim::Drape, garment: &Garment, body: &Body) -> Result<(), RefitError> {
    let near = found.residual < NEARLY_AT_REST && found.status != RestStatus::Sliding;
    if found.status == RestStatus::AtRest || near {
        return Ok(());
    }
    Err(RefitError::NotAtRest {
        body: body.name.clone(),
        status: found.status,
        residual: found.residual,
        broken: (found.broken).map(|broken| broken.told(&garment.pattern, &garment.mesh)),
    })
}

/// Times the stages.
pub(crate) struct Clock {
    start: Instant,
    /// Seconds that an interrupted run had taken.
    before: f64,
    current: Option<(&'static str, Instant)>,
    stages: Vec<StageTime>,
}

impl Clock {
    fn new() -> Self {
        Self {
            start: Instant::now(),
            before: 0.0,
            current: None,
            stages: Vec::new(),
        }
    }

    /// A clock for work beside this one's.
    fn same_start(&self) -> Self {
        Self {
            start: self.start,
            before: self.before,
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
        self.before + self.start.elapsed().as_secs_f64()
    }
}

/// What a refit ended with before it was written.
pub(crate) struct Found {
    x_bar: Vec<Vec2>,
    x: Vec<Vec3>,
    grips: Vec<Grip>,
    initial: Vec<Vec3>,
    ending: Ending,
    iterations: Vec<crate::report::Iteration>,
}
