//! The search for the pattern (paper §4.6): drape, compare, step, until the loss stops falling.
//!
//! Every step comes from the sensitivities of the drape at hand; a step is accepted only when the
//! new rest shape can be cut, its drape comes to rest, and the loss falls.

use super::{Clock, Found, Observer, Progress, RefitError};
use crate::cage::{Cages, Prior};
use crate::descent::{Damping, DescentParams, Model};
use crate::geometry::quality::qualities;
use crate::geometry::{Vec2, Vec3};
use crate::loss::{Loss, Losses, Row};
use crate::pattern::PatternMesh;
use crate::report::{Iteration, Status};
use crate::sim::drape::Differentiable;
use crate::sim::energy::contact::Surface;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Drape, Scene, Start, drape};
use nalgebra::DVector;

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
}

/// A pattern, its drape, and its loss.
struct Point<'a> {
    zeta: Vec<f64>,
    state: Differentiable<'a>,
    loss: Loss,
    /// Weighted loss with the cages' priors.
    total: f64,
}

/// What changes while searching.
struct Run<'a, 'b> {
    notes: Vec<Iteration>,
    drapes: usize,
    factorisations: usize,
    clock: &'a Clock,
    observe: &'a mut Observer<'b>,
    go_on: bool,
}

impl<'s, S: Surface> Search<'s, S> {
    /// Searches from the best of several guesses, the initial one first. All are draped from the
    /// target shape.
    pub(super) fn run(
        &self,
        initial: Vec<f64>,
        others: Vec<Vec<f64>>,
        clock: &Clock,
        observe: &mut Observer<'_>,
    ) -> Result<Found, RefitError> {
        let mut run = Run {
            notes: Vec::new(),
            drapes: 0,
            factorisations: 0,
            clock,
            observe,
            go_on: true,
        };
        let mut best = self.first(initial, &mut run)?;
        let initial = best.state.drape.x.clone();
        self.note(&best, 0.0, &mut run);
        let mut moved = f64::INFINITY;
        for guess in others {
            if !run.go_on {
                break;
            }
            let drape = self.drape(&guess, self.x_star.to_vec(), &mut run);
            let point = self.point(guess, drape);
            if let Some(better) = point.filter(|point| point.total < best.total) {
                moved = farthest(&better.state.drape.x_bar, &best.state.drape.x_bar);
                best = better;
                self.note(&best, moved, &mut run);
            }
        }
        let floor = quality_floor(self.mesh, LEAST_QUALITY);
        let mut damping = Damping(self.params.damping);
        let mut slow = 0;
        let mut fresh_starts = 0;
        let status = loop {
            if !run.go_on {
                break Status::Stopped;
            }
            if run.notes.len() > self.params.iterations {
                break Status::IterationLimit;
            }
            let settled = slow >= 2 || moved < self.params.least_step;
            let mut stepped = Stepped::NoBetter;
            if !settled {
                stepped = self.step(&best, floor, &mut damping, &mut run);
            }
            if matches!(stepped, Stepped::NoBetter) && fresh_starts < self.fresh_starts {
                fresh_starts += 1;
                stepped = self.afresh(&best, &mut run);
            }
            let next = match stepped {
                Stepped::Better(next) => *next,
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
            moved = farthest(&next.state.drape.x_bar, &best.state.drape.x_bar);
            best = next;
            self.note(&best, moved, &mut run);
            if moved == 0.0 {
                // A fresh start: the same pattern, to be searched from again.
                moved = f64::INFINITY;
            }
        };
        Ok(Found {
            zeta: best.zeta,
            x_bar: best.state.drape.x_bar,
            x: best.state.drape.x,
            initial,
            status,
            iterations: run.notes,
        })
    }

    /// The initial guess at rest.
    fn first(&self, zeta: Vec<f64>, run: &mut Run<'_, '_>) -> Result<Point<'s>, RefitError> {
        let found = self.drape(&zeta, self.x_star.to_vec(), run);
        let (status, residual) = (found.status, found.residual);
        if status == RestStatus::Stopped {
            return Err(RefitError::Stopped);
        }
        let body = self.body.to_owned();
        self.point(zeta, found).ok_or(RefitError::NotAtRest {
            body,
            status,
            residual,
        })
    }

    /// Drapes the pattern of the unknowns `zeta` from a nearby start.
    fn drape(&self, zeta: &[f64], start: Vec<Vec3>, run: &mut Run<'_, '_>) -> Drape {
        let x_bar = self.cages.deform(zeta);
        let found = drape(self.scene, &x_bar, start, Start::Near, &mut |p| {
            (run.observe)(&Progress::Drape(p))
        });
        run.drapes += 1;
        run.factorisations += found.iterations;
        found
    }

    /// The loss at a drape; none unless it is at rest.
    fn point(&self, zeta: Vec<f64>, found: Drape) -> Option<Point<'s>> {
        if found.status != RestStatus::AtRest {
            return None;
        }
        let state = found.differentiable(self.scene)?;
        let loss = self.losses.evaluate(&state.drape.x, &state.drape.x_bar);
        let priors = self.priors(&zeta);
        let total = loss.total + priors.iter().map(|p| p.value * p.value).sum::<f64>();
        Some(Point {
            zeta,
            state,
            loss,
            total,
        })
    }

    /// What the cages had better not do.
    fn priors(&self, zeta: &[f64]) -> Vec<Prior> {
        let weights = self.losses.weights();
        self.cages.priors(zeta, weights.affine, weights.cage)
    }

    /// The Gauss–Newton model at `best`: residuals of all terms by all unknowns, through drape and
    /// cage.
    fn model(&self, best: &Point<'_>) -> Model {
        let drape = &best.state.drape;
        let moves = best.state.sensitivities(self.motions.iter().cloned());
        let rows = self.losses.rows(&drape.x, &drape.x_bar);
        let priors = self.priors(&best.zeta);
        let count = rows.len() + priors.len();
        Model::new(count, self.motions.len(), |i, by| {
            if let Some(row) = rows.get(i) {
                for (j, motion) in self.motions.iter().enumerate() {
                    by[j] = slope(row, &moves[3 * drape.x.len() * j..], motion);
                }
                row.value
            } else {
                priors[i - rows.len()].fill(by)
            }
        })
    }

    /// Tries ever shorter steps until one is accepted. A pattern that cannot be cut costs no drape.
    fn step(
        &self,
        best: &Point<'_>,
        floor: f64,
        damping: &mut Damping,
        run: &mut Run<'_, '_>,
    ) -> Stepped<'s> {
        let model = self.model(best);
        let rigid = self.cages.rigid_modes(&best.zeta);
        let mut refusals = 0;
        while refusals < self.params.refusals {
            let Some(mut step) = model.step(damping.0) else {
                return Stepped::NoBetter;
            };
            without(&mut step, &rigid);
            let Some(zeta) = self.within_reach(best, &mut step) else {
                return Stepped::NoBetter;
            };
            if !can_be_cut(self.cages, self.mesh, &zeta, floor) {
                damping.tighten();
                continue;
            }
            let found = self.drape(&zeta, self.predict(best, &step), run);
            if found.status == RestStatus::Stopped {
                return Stepped::Interrupted;
            }
            let next = self.point(zeta, found);
            if let Some(next) = next.filter(|next| next.total < best.total) {
                damping.relax();
                return Stepped::Better(Box::new(next));
            }
            refusals += 1;
            damping.tighten();
        }
        Stepped::NoBetter
    }

    /// The pattern at hand, draped again from the target shape: the drape may be caught in a fold
    /// that a fresh start does not have.
    fn afresh(&self, best: &Point<'_>, run: &mut Run<'_, '_>) -> Stepped<'s> {
        let found = self.drape(&best.zeta, self.x_star.to_vec(), run);
        if found.status == RestStatus::Stopped {
            return Stepped::Interrupted;
        }
        let clearly_better = (1.0 - self.params.tolerance) * best.total;
        self.point(best.zeta.clone(), found)
            .filter(|next| next.total < clearly_better)
            .map_or(Stepped::NoBetter, |next| Stepped::Better(Box::new(next)))
    }

    /// The unknowns after `step`, shortened where it moves a pattern vertex too far; none if it
    /// hardly moves any.
    fn within_reach(&self, best: &Point<'_>, step: &mut DVector<f64>) -> Option<Vec<f64>> {
        let after = |step: &DVector<f64>| -> Vec<f64> {
            let moved_by = best.zeta.iter().zip(step.iter());
            moved_by.map(|(z, d)| z + d).collect()
        };
        let moved = farthest(&self.cages.deform(&after(step)), &best.state.drape.x_bar);
        if !(moved > SHORTEST_TRIAL) {
            return None;
        }
        *step *= (self.params.step / moved).min(1.0);
        Some(after(step))
    }

    /// Where the drape goes to first order, if that is near enough to be believed.
    fn predict(&self, best: &Point<'_>, step: &DVector<f64>) -> Vec<Vec3> {
        let mut motion = vec![Vec2::zeros(); self.mesh.x_bar.len()];
        for (by, d) in self.motions.iter().zip(step.iter()) {
            for (sum, by) in motion.iter_mut().zip(by) {
                *sum += by * *d;
            }
        }
        let moves = best.state.sensitivities(std::iter::once(motion));
        let x = &best.state.drape.x;
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
        let (through_drape, lambda) = best.state.pull_back(&best.loss.x_hat);
        let direct = &best.loss.x_bar_hat;
        let hat: Vec<Vec2> = through_drape
            .iter()
            .zip(direct)
            .map(|(a, b)| a + b)
            .collect();
        let gradient = self.cages.pull_back(&hat);
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
            gradient_norm: gradient.iter().map(|g| g * g).sum::<f64>().sqrt(),
            adjoint_norm: lambda.iter().map(Vec3::norm).fold(0.0, f64::max),
            residual: best.state.drape.residual,
            shift: best.state.shift,
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

/// Whether the rest shape at `zeta` can be cut: cages and outlines do not cross, and no triangle is
/// flipped or poorer than `floor`.
pub(super) fn can_be_cut(cages: &Cages, mesh: &PatternMesh, zeta: &[f64], floor: f64) -> bool {
    cages.check(zeta).is_ok() && least_quality(mesh, &cages.deform(zeta)) >= floor
}

/// The part `of` of the quality of the reference pattern's poorest triangle.
pub(super) fn quality_floor(mesh: &PatternMesh, of: f64) -> f64 {
    of * least_quality(mesh, &mesh.x_bar)
}

fn least_quality(mesh: &PatternMesh, x_bar: &[Vec2]) -> f64 {
    let each = qualities(x_bar, &mesh.triangles);
    each.into_iter().fold(f64::INFINITY, f64::min)
}

/// Farthest any vertex is from its partner \[m\].
fn farthest(a: &[Vec2], b: &[Vec2]) -> f64 {
    let apart = a.iter().zip(b).map(|(a, b)| (a - b).norm());
    apart.fold(0.0, f64::max)
}

/// ∂x̄ along each unknown of `cages`, `[unknown][pattern vertex]`.
pub(super) fn motions(cages: &Cages, mesh: &PatternMesh) -> Vec<Vec<Vec2>> {
    let motion = |j: usize| {
        let mut motion = vec![Vec2::zeros(); mesh.x_bar.len()];
        for (v, d) in cages.column(j) {
            motion[v as usize] += d;
        }
        motion
    };
    (0..cages.unknown_count()).map(motion).collect()
}

/// ∂r along one unknown: through the cloth's moves and the pattern's motion.
pub(super) fn slope(row: &Row, moves: &[f64], motion: &[Vec2]) -> f64 {
    let mut sum = 0.0;
    for (v, g) in &row.x {
        let d = &moves[3 * *v as usize..];
        sum += g.x * d[0] + g.y * d[1] + g.z * d[2];
    }
    for (v, g) in &row.x_bar {
        sum += g.dot(&motion[*v as usize]);
    }
    sum
}

/// Removes from `step` what only moves panels about: it does nothing to the drape, and would turn
/// panels against their grain.
pub(super) fn without(step: &mut DVector<f64>, rigid: &[Vec<f64>]) {
    for mode in rigid {
        let along: f64 = mode.iter().zip(step.iter()).map(|(m, s)| m * s).sum();
        for (s, m) in step.iter_mut().zip(mode) {
            *s -= along * m;
        }
    }
}
