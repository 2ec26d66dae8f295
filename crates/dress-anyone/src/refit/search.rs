//! The search for the pattern (paper §4.6): drape, compare, step, until the loss stops falling.
//!
//! Steps come from the sensitivities of the drape at hand ([`newton`]) or from the gradient alone
//! ([`downhill`]); whatever makes it, a step is accepted only when the new rest shape can be cut
//! ([`guards`]), its drape does not fail, and the loss falls.

mod downhill;
pub(super) mod guards;
pub(super) mod newton;
pub(super) mod point;

use super::checkpoint::Checkpoint;
use super::{Clock, Found, Observer, Progress, RefitError, RefitParams};
use crate::cage::{Cages, Prior};
use crate::descent::slope::Slope;
use crate::descent::{Damping, DescentParams, Optimizer};
use crate::geometry::{Vec2, Vec3};
use crate::loss::Losses;
use crate::pattern::PatternMesh;
use crate::report::{Iteration, Status};
use crate::sim::Scene;
use crate::sim::energy::contact::Surface;
use crate::sim::equilibrium::RestStatus;
use guards::{farthest, quality_floor};
use nalgebra::DVector;
use point::Point;
use serde::{Deserialize, Serialize};

/// Predicted moves of the cloth beyond this are not trusted as a start \[m\].
const FARTHEST_PREDICTION: f64 = 0.03;
/// No triangle may fall below this part of the reference pattern's poorest.
const LEAST_QUALITY: f64 = 0.82;
/// A refused step is tried again only while it moves the pattern farther than this \[m\].
const SHORTEST_TRIAL: f64 = 1e-5;
/// How often a settled search drapes its pattern again from the target shape.
pub(super) const FRESH_STARTS: usize = 4;

/// Everything the search needs and does not change.
pub(super) struct Search<'a, S> {
    /// Name of the target body, for messages.
    pub(super) body: &'a str,
    pub(super) mesh: &'a PatternMesh,
    pub(super) cages: &'a Cages,
    /// ∂x̄ along each unknown, `[unknown][pattern vertex]`.
    pub(super) motions: &'a [Vec<Vec2>],
    pub(super) losses: &'a Losses,
    pub(super) scene: &'a Scene<'a, S>,
    pub(super) x_star: &'a [Vec3],
    pub(super) params: &'a DescentParams,
    /// How often a settled pattern is draped again from the target shape.
    pub(super) fresh_starts: usize,
    /// Parameters to note in checkpoints; none to make none.
    pub(super) keep: Option<&'a RefitParams>,
}

/// What changes from step to step.
struct Going<'s> {
    best: Box<Point<'s>>,
    /// The drape of the initial guess.
    initial: Vec<Vec3>,
    steps: Steps,
    /// Steps in a row that hardly lowered the loss.
    slow: usize,
    fresh_starts: usize,
    /// Farthest move of the last step \[m\]; none where it says nothing.
    moved: Option<f64>,
}

/// A pattern to begin from, and where its drape starts.
#[derive(Clone, Debug)]
pub(super) struct Guess {
    pub(super) zeta: Vec<f64>,
    /// \[m\].
    pub(super) x: Vec<Vec3>,
}

/// What changes while searching.
pub(super) struct Run<'a, 'b> {
    notes: Vec<Iteration>,
    drapes: usize,
    factorisations: usize,
    clock: &'a Clock,
    observe: &'a mut Observer<'b>,
    go_on: bool,
}

/// What makes the steps, and what it has learned.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) enum Steps {
    Newton(Damping),
    Downhill(Slope),
}

impl Steps {
    fn new(params: &DescentParams) -> Self {
        match params.optimizer {
            Optimizer::Lm => Self::Newton(Damping(params.damping)),
            Optimizer::Lbfgs => Self::Downhill(Slope::lbfgs(params.step)),
            Optimizer::Descent => Self::Downhill(Slope::steepest(params.step)),
        }
    }

    /// Whether what it learned has so many unknowns.
    pub(super) fn is_of(&self, unknowns: usize) -> bool {
        match self {
            Self::Newton(_) => true,
            Self::Downhill(slope) => slope.is_of(unknowns),
        }
    }
}

impl<'a, 'b> Run<'a, 'b> {
    /// Nothing done yet.
    pub(super) fn new(clock: &'a Clock, observe: &'a mut Observer<'b>) -> Self {
        Self {
            notes: Vec::new(),
            drapes: 0,
            factorisations: 0,
            clock,
            observe,
            go_on: true,
        }
    }
}

impl<'s, S: Surface> Search<'s, S> {
    /// Searches from the best of several guesses, the initial one first, draped from the target
    /// shape.
    pub(super) fn run(
        &self,
        initial: Vec<f64>,
        others: Vec<Guess>,
        clock: &Clock,
        observe: &mut Observer<'_>,
    ) -> Result<Found, RefitError> {
        let mut run = Run::new(clock, observe);
        let mut best = self.first(initial, &mut run)?;
        let initial = best.x.clone();
        self.note(&best, 0.0, &mut run);
        let mut moved = None;
        for guess in others {
            if !run.go_on {
                break;
            }
            let tried = self.candidate(guess.zeta, guess.x, &mut run);
            if let Some(better) = tried.ok().filter(|tried| tried.total < best.total) {
                let better = self.accept(better);
                let far = farthest(&better.x_bar, &best.x_bar);
                // The same pattern from another start says nothing of how far there is to go.
                moved = Some(far).filter(|far| *far > 0.0);
                best = better;
                self.note(&best, far, &mut run);
            }
        }
        let going = Going {
            best,
            initial,
            steps: Steps::new(self.params),
            slow: 0,
            fresh_starts: 0,
            moved,
        };
        Ok(self.go_on(going, run))
    }

    /// Goes on from a checkpoint; none if the drape it left cannot be factored any more.
    pub(super) fn resume(
        &self,
        from: Checkpoint,
        clock: &Clock,
        observe: &mut Observer<'_>,
    ) -> Option<Found> {
        let mut run = Run::new(clock, observe);
        run.drapes = from.drapes;
        run.factorisations = from.factorisations;
        run.notes.clone_from(&from.notes);
        let going = Going {
            best: self.restored(&from)?,
            initial: from.initial,
            steps: from.steps,
            slow: from.slow,
            fresh_starts: from.fresh_starts,
            moved: from.moved,
        };
        Some(self.go_on(going, run))
    }

    /// Steps until there is a reason to stop.
    fn go_on(&self, going: Going<'s>, mut run: Run<'_, '_>) -> Found {
        let Going {
            mut best,
            initial,
            mut steps,
            mut slow,
            mut fresh_starts,
            mut moved,
        } = going;
        let floor = quality_floor(self.mesh, LEAST_QUALITY);
        let status = loop {
            if let Some(keep) = self.keep {
                let checkpoint = Checkpoint {
                    params: keep.clone(),
                    x_star: self.x_star.to_vec(),
                    initial: initial.clone(),
                    zeta: best.zeta.clone(),
                    x: best.x.clone(),
                    grips: best
                        .state
                        .as_ref()
                        .map_or_else(Vec::new, |s| s.grips().to_vec()),
                    gradient: best.gradient.clone(),
                    adjoint_norm: best.adjoint_norm,
                    residual: best.residual,
                    shift: best.shift,
                    steps: steps.clone(),
                    slow,
                    fresh_starts,
                    moved,
                    notes: run.notes.clone(),
                    drapes: run.drapes,
                    factorisations: run.factorisations,
                    elapsed: run.clock.elapsed(),
                };
                let go_on = (run.observe)(&Progress::Checkpoint(Box::new(checkpoint)));
                run.go_on &= go_on;
            }
            if !run.go_on {
                break Status::Stopped;
            }
            if run.notes.len() > self.params.iterations {
                break Status::IterationLimit;
            }
            // Short steps by the gradient alone say nothing: the next may be long again.
            let short = moved.is_some_and(|moved| moved < self.params.least_step);
            let still = short && matches!(steps, Steps::Newton(_));
            let settled = slow >= 2 || still;
            let mut stepped = Stepped::NoBetter;
            if !settled {
                stepped = match &mut steps {
                    Steps::Newton(damping) => self.newton(&best, floor, damping, &mut run),
                    Steps::Downhill(slope) => self.downhill(&best, floor, slope, &mut run),
                };
            }
            if matches!(stepped, Stepped::NoBetter) && fresh_starts < self.fresh_starts {
                fresh_starts += 1;
                stepped = self.afresh(&best, &mut run);
            }
            let next = match stepped {
                Stepped::Better(next) => next,
                Stepped::Interrupted => break Status::Stopped,
                Stepped::NoBetter if slow > 0 || settled => break Status::Converged,
                Stepped::NoBetter => break Status::Stalled,
            };
            let fall = (best.total - next.total) / best.total;
            slow = if fall < self.params.tolerance {
                slow + 1
            } else {
                0
            };
            let far = farthest(&next.x_bar, &best.x_bar);
            best = next;
            self.note(&best, far, &mut run);
            // A fresh start moves nothing: the same pattern, to be searched from again.
            moved = Some(far).filter(|far| *far > 0.0);
        };
        Found {
            zeta: best.zeta,
            x_bar: best.x_bar,
            x: best.x,
            initial,
            status,
            iterations: run.notes,
        }
    }

    /// The initial guess, draped.
    fn first(&self, zeta: Vec<f64>, run: &mut Run<'_, '_>) -> Result<Box<Point<'s>>, RefitError> {
        match self.candidate(zeta, self.x_star.to_vec(), run) {
            Ok(first) => Ok(self.accept(first)),
            Err(failed) => Err(failed.on(self.body)),
        }
    }

    /// What the cages had better not do.
    fn priors(&self, zeta: &[f64]) -> Vec<Prior> {
        let weights = self.losses.weights();
        self.cages.priors(zeta, weights.affine, weights.cage)
    }

    /// The pattern at hand, draped again from the target shape: the drape may be caught in a fold
    /// that a fresh start does not have.
    fn afresh(&self, best: &Point<'_>, run: &mut Run<'_, '_>) -> Stepped<'s> {
        let clearly_better = (1.0 - self.params.tolerance) * best.total;
        match self.candidate(best.zeta.clone(), self.x_star.to_vec(), run) {
            Ok(next) if next.total < clearly_better => Stepped::Better(self.accept(next)),
            Err(failed) if failed.status == RestStatus::Stopped => Stepped::Interrupted,
            _ => Stepped::NoBetter,
        }
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

    /// Where the drape goes to first order, if that is known and near enough to be believed; else
    /// where it is.
    fn predict(&self, best: &Point<'_>, step: &DVector<f64>) -> Vec<Vec3> {
        let x = &best.x;
        let Some(state) = &best.state else {
            return x.clone();
        };
        let mut motion = vec![Vec2::zeros(); self.mesh.x_bar.len()];
        for (by, d) in self.motions.iter().zip(step.iter()) {
            for (sum, by) in motion.iter_mut().zip(by) {
                *sum += by * *d;
            }
        }
        let moves = state.sensitivities(std::iter::once(motion));
        let moved = x.iter().zip(moves.chunks_exact(3));
        let moved: Vec<Vec3> = moved
            .map(|(p, d)| p + Vec3::new(d[0], d[1], d[2]))
            .collect();
        let far = moved
            .iter()
            .zip(x)
            .any(|(a, b)| !((a - b).norm() < FARTHEST_PREDICTION));
        if far { x.clone() } else { moved }
    }

    /// Notes an accepted point, and tells it.
    fn note(&self, best: &Point<'_>, moved: f64, run: &mut Run<'_, '_>) {
        let iteration = run.notes.len();
        run.go_on = (run.observe)(&Progress::Iteration {
            iteration,
            loss: best.total,
            terms: best.loss.terms,
        });
        run.notes.push(Iteration {
            iteration,
            loss: best.total,
            shape_matching: best.loss.terms.shape_matching(self.losses.weights()),
            terms: best.loss.terms,
            gradient_norm: best.gradient.norm(),
            adjoint_norm: best.adjoint_norm,
            residual: best.residual,
            shift: best.shift,
            moved,
            drapes: run.drapes,
            factorisations: run.factorisations,
            elapsed: run.clock.elapsed(),
        });
    }
}

/// How a step ended.
enum Stepped<'a> {
    Better(Box<Point<'a>>),
    NoBetter,
    Interrupted,
}
