//! The search for the pattern (paper §4.6): drape, compare, step, until the loss stops falling.
//!
//! Steps come from the sensitivities of the drape at hand ([`newton`]) or from the gradient alone
//! ([`downhill`]); whatever makes it, a step is accepted only when the new rest shape can be cut
//! ([`guards`]), its drape does not fail, and the loss falls.

pub(super) mod aside;
mod downhill;
pub(super) mod guards;
pub(super) mod newton;
pub(super) mod point;
mod run;

use super::checkpoint::{Checkpoint, Keep};
use crate::cage::{Cages, Prior};
use crate::descent::slope::Slope;
use crate::descent::{Damping, DescentParams, Optimizer};
use crate::geometry::{Vec2, Vec3};
use crate::loss::Losses;
use crate::pattern::PatternMesh;
use crate::report::{Ending, Iteration};
use crate::sim::Scene;
use crate::sim::energy::contact::Surface;
use crate::sim::energy::friction::Grip;
use aside::Spare;
use guards::{farthest, quality_floor};
use nalgebra::DVector;
use point::{Failed, Point};
pub(super) use run::Run;
use serde::{Deserialize, Serialize};
use std::cell::OnceCell;
use std::sync::mpsc;

/// No triangle may fall below this part of the reference pattern's poorest.
const LEAST_QUALITY: f64 = 0.82;
/// A refused step is tried again only while it moves the pattern farther than this \[m\].
const SHORTEST_TRIAL: f64 = 1e-5;

/// Everything the search needs and does not change.
pub(super) struct Search<'a, S> {
    pub(super) mesh: &'a PatternMesh,
    pub(super) cages: &'a Cages,
    /// ∂x̄ along each unknown, `[unknown][pattern vertex]`.
    pub(super) motions: &'a [Vec<Vec2>],
    pub(super) losses: &'a Losses,
    pub(super) scene: &'a Scene<'a, S>,
    pub(super) params: &'a DescentParams,
    /// Rate of the guides in this scene's cloth \[1/s²\], for the record.
    pub(super) guide: f64,
    /// Cores for trials aside.
    pub(super) spare: &'a Spare,
    /// What to note in checkpoints besides the search; none to make none.
    pub(super) keep: Option<Keep<'a>>,
}

/// A pattern to begin from.
pub(super) struct Guess<'a> {
    pub(super) zeta: Vec<f64>,
    /// Where its drape starts \[m\], which may take drapes of its own.
    pub(super) start: Box<Start<'a>>,
}

impl Guess<'_> {
    /// A pattern, to be draped from `x` \[m\].
    pub(super) fn at(x: Vec<Vec3>, zeta: Vec<f64>) -> Self {
        let start = Box::new(move |_: &mut Run<'_, '_>| x.clone());
        Self { zeta, start }
    }
}

/// Brings cloth to where a drape starts \[m\].
pub(super) type Start<'a> = dyn Fn(&mut Run<'_, '_>) -> Vec<Vec3> + Send + Sync + 'a;

/// Where a search ended.
#[derive(Clone, Debug)]
pub(super) struct Settled {
    pub(super) zeta: Vec<f64>,
    /// \[m\].
    pub(super) x: Vec<Vec3>,
    /// Friction there; none without.
    pub(super) grips: Vec<Grip>,
    pub(super) ending: Ending,
}

/// What changes from step to step.
struct Going<'s> {
    best: Box<Point<'s>>,
    steps: Steps,
    /// Steps taken.
    taken: usize,
    /// Steps in a row that hardly lowered the loss.
    slow: usize,
    /// Farthest move of the last step \[m\]; none where it says nothing.
    moved: Option<f64>,
}

/// What makes the steps, and what it has learned.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Steps {
    Newton(Damping),
    Downhill(Slope),
}

/// How a step ended.
enum Stepped<'a> {
    Better(Box<Point<'a>>),
    /// No step promises to lower the loss to speak of.
    Level,
    NoBetter,
    Interrupted,
}

impl Steps {
    fn new(params: &DescentParams) -> Self {
        match params.optimizer {
            Optimizer::Lm => Self::Newton(Damping(params.damping)),
            Optimizer::Lbfgs => Self::Downhill(Slope::lbfgs(params.step)),
            Optimizer::Descent => Self::Downhill(Slope::steepest(params.step)),
        }
    }

    /// How many steps in a row must hardly lower the loss before it will not fall any further: those by
    /// the gradient alone zigzag.
    fn slow_steps(&self) -> usize {
        match self {
            Self::Newton(_) => 1,
            Self::Downhill(_) => 2,
        }
    }

    /// Whether what it learned has so many unknowns.
    fn is_of(&self, unknowns: usize) -> bool {
        match self {
            Self::Newton(_) => true,
            Self::Downhill(slope) => slope.is_of(unknowns),
        }
    }
}

impl<'s, S: Surface> Search<'s, S> {
    /// Searches from the best of several guesses; why the last failed if none comes to rest. The first two are
    /// draped at the same time where there is a core to spare; the second then waits where it has to know how good
    /// the first is.
    pub(super) fn run(
        &self,
        guesses: &[Guess<'_>],
        run: &mut Run<'_, '_>,
    ) -> Result<Settled, Failed> {
        let draped = |guess: &Guess<'_>, wanted: &dyn Fn() -> f64, run: &mut Run<'_, '_>| {
            let start = (guess.start)(run);
            self.trial(&guess.zeta, start, wanted, None, run)
        };
        let (tell, told) = mpsc::channel();
        let first = |run: &mut Run<'_, '_>| {
            let found = draped(&guesses[0], &|| f64::INFINITY, run);
            if let Ok(Some(first)) = &found {
                // Nobody listens where there is no second.
                let _ = tell.send(first.total);
            }
            drop(tell);
            found
        };
        let second = guesses.get(1).map(|guess| {
            move |run: &mut Run<'_, '_>| {
                let known = OnceCell::new();
                let beaten = || told.recv().unwrap_or(f64::INFINITY);
                draped(guess, &|| *known.get_or_init(beaten), run)
            }
        });
        let (found, mut made) = run.beside(self.spare, first, second, Failed::stopped);
        let mut found = Some(found);
        let mut best: Option<Box<Point<'s>>> = None;
        let mut failed = Failed::STOPPED;
        for guess in guesses {
            let beaten = best.as_ref().map_or(f64::INFINITY, |best| best.total);
            let found = match (found.take(), made.take()) {
                (Some(found), later) => {
                    made = later;
                    found
                }
                (None, Some(made)) => run.count_made(made),
                (None, None) => draped(guess, &|| beaten, run),
            };
            match found {
                Ok(Some(next)) => {
                    let far = best.map_or(0.0, |best| farthest(&next.x_bar, &best.x_bar));
                    run.note(self, &next, far);
                    best = Some(next);
                }
                Ok(None) => {}
                Err(why) => failed = why,
            }
        }
        let going = Going {
            best: best.ok_or(failed)?,
            steps: Steps::new(self.params),
            taken: 0,
            slow: 0,
            moved: None,
        };
        Ok(self.go_on(going, run))
    }

    /// Goes on from a checkpoint; none if it does not fit, or the drape it left cannot be factored any
    /// more.
    pub(super) fn resume(&self, from: Checkpoint, run: &mut Run<'_, '_>) -> Option<Settled> {
        let unknowns = self.cages.unknown_count();
        let fits = [from.zeta.len(), from.gradient.len()] == [unknowns; 2]
            && from.x.len() == self.mesh.cloth_vertex_count
            && from.steps.is_of(unknowns);
        let going = Going {
            best: fits.then(|| self.restored(&from)).flatten()?,
            steps: from.steps,
            taken: from.taken,
            slow: from.slow,
            moved: from.moved,
        };
        Some(self.go_on(going, run))
    }

    /// A guess, draped: where it lies \[m\], and its note as the first of all.
    pub(super) fn first(
        &self,
        guess: Guess<'_>,
        run: &mut Run<'_, '_>,
    ) -> Result<(Vec<Vec3>, Iteration), Failed> {
        let start = (guess.start)(run);
        let first = self.accept(self.candidate(guess.zeta, start, run)?)?;
        let note = run.noted(0, self, &first, 0.0);
        Ok((first.x, note))
    }

    /// Steps until there is a reason to stop.
    fn go_on(&self, going: Going<'s>, run: &mut Run<'_, '_>) -> Settled {
        let mut going = going;
        let floor = quality_floor(self.mesh, LEAST_QUALITY);
        let ending = loop {
            if let Some(keep) = self.keep {
                run.keep(going.checkpoint(keep));
            }
            if run.stopped() {
                break Ending::Interrupted;
            }
            if let Some(ending) = self.ending(&going) {
                break ending;
            }
            let best = &going.best;
            let stepped = match &mut going.steps {
                Steps::Newton(damping) => self.newton(best, floor, damping, run),
                Steps::Downhill(slope) => self.downhill(best, floor, slope, run),
            };
            let next = match stepped {
                Stepped::Better(next) => next,
                Stepped::Interrupted => break Ending::Interrupted,
                Stepped::Level => break Ending::Flat,
                Stepped::NoBetter => break Ending::NoBetterStep,
            };
            let slow = best.total - next.total < self.params.tolerance * best.total;
            let far = farthest(&next.x_bar, &best.x_bar);
            going.slow = if slow { going.slow + 1 } else { 0 };
            going.moved = Some(far);
            going.taken += 1;
            going.best = next;
            run.note(self, &going.best, far);
        };
        Settled {
            grips: going.best.grips(),
            zeta: going.best.zeta,
            x: going.best.x,
            ending,
        }
    }

    /// A reason to take no further step.
    fn ending(&self, going: &Going<'_>) -> Option<Ending> {
        let (params, best) = (self.params, &going.best);
        let promised = best.gradient.norm() * params.step;
        // Short steps by the gradient alone say nothing: the next may be long again.
        let newton = matches!(going.steps, Steps::Newton(_));
        let short = going.moved.is_some_and(|far| far < params.least_step);
        if going.taken >= params.iterations {
            Some(Ending::IterationLimit)
        } else if going.slow >= going.steps.slow_steps() {
            Some(Ending::SmallChange)
        } else if short && newton {
            Some(Ending::ShortStep)
        } else if promised <= params.tolerance * best.total {
            Some(Ending::Flat)
        } else {
            None
        }
    }

    /// What the cages had better not do.
    fn priors(&self, zeta: &[f64]) -> Vec<Prior> {
        let weights = self.losses.weights();
        self.cages.priors(zeta, weights.affine, weights.cage)
    }

    /// The unknowns after `step`, shortened where it moves a pattern vertex too far; none if it
    /// hardly moves any.
    fn within_reach(&self, best: &Point<'_>, step: &mut DVector<f64>) -> Option<Vec<f64>> {
        let after = |step: &DVector<f64>| -> Vec<f64> {
            let moved_by = best.zeta.iter().zip(step.iter());
            moved_by.map(|(z, d)| z + d).collect()
        };
        let moved = farthest(&self.cages.deform(&after(step)), &best.x_bar);
        if !(moved > SHORTEST_TRIAL) {
            return None;
        }
        *step *= (self.params.step / moved).min(1.0);
        Some(after(step))
    }

    /// Where the drape goes to first order, if that is known and near enough to be believed; else where it
    /// is.
    fn predict(&self, best: &Point<'_>, step: &DVector<f64>) -> Vec<Vec3> {
        let mut motion = vec![Vec2::zeros(); self.mesh.x_bar.len()];
        for (by, d) in self.motions.iter().zip(step.iter()) {
            for (sum, by) in motion.iter_mut().zip(by) {
                *sum += by * *d;
            }
        }
        let state = best.state.as_ref();
        let predicted = state.and_then(|state| state.predicted(motion));
        predicted.unwrap_or_else(|| best.x.clone())
    }
}

impl Going<'_> {
    fn checkpoint(&self, keep: Keep<'_>) -> Checkpoint {
        let best = &self.best;
        Checkpoint {
            params: keep.params.clone(),
            x_star: keep.x_star.to_vec(),
            initial: keep.initial.to_vec(),
            level: keep.level,
            zeta: best.zeta.clone(),
            x: best.x.clone(),
            grips: best.grips(),
            gradient: best.gradient.clone(),
            adjoint_norm: best.adjoint_norm,
            residual: best.residual,
            shift: best.shift,
            steps: self.steps.clone(),
            taken: self.taken,
            slow: self.slow,
            moved: self.moved,
            notes: Vec::new(),
            drapes: 0,
            factorisations: 0,
            elapsed: 0.0,
        }
    }
}
