//! The search for the pattern (paper §4.6): drape, compare, step, until the loss stops falling.
//!
//! Every step comes from the sensitivities of the drape at hand; a step is accepted only when the
//! new rest shape can be cut, its drape comes to rest, and the loss falls.

use super::{Clock, Found, Observer, Progress, RefitError};
use crate::cage::Cages;
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
use nalgebra::{DMatrix, DVector};

/// Predicted moves of the cloth beyond this are not trusted as a start \[m\].
const FARTHEST_PREDICTION: f64 = 0.03;
/// No triangle may fall below this part of the reference pattern's poorest.
const LEAST_QUALITY: f64 = 0.85;
/// A refused step is tried again only while it moves the pattern farther than this \[m\].
const SHORTEST_TRIAL: f64 = 1e-5;

/// Everything the search needs and does not change.
pub(super) struct Search<'a, S> {
    pub(super) mesh: &'a PatternMesh,
    pub(super) cages: &'a Cages,
    pub(super) losses: &'a Losses,
    pub(super) scene: &'a Scene<'a, S>,
    pub(super) params: &'a DescentParams,
    pub(super) affine_weight: f64,
}

/// The best so far.
struct Point<'a> {
    zeta: Vec<f64>,
    state: Differentiable<'a>,
    loss: Loss,
    /// Weighted loss with the affine prior.
    total: f64,
}

/// Work done, for the report.
#[derive(Default)]
struct Tally {
    drapes: usize,
    factorisations: usize,
}

impl<S: Surface> Search<'_, S> {
    /// Searches from the unknowns `zeta`, draping first from the target shape.
    pub(super) fn run(
        &self,
        zeta: &[f64],
        x_star: &[Vec3],
        clock: &mut Clock,
        observe: &mut Observer<'_>,
    ) -> Result<Found, RefitError> {
        let mut tally = Tally::default();
        let first = self.drape(zeta, x_star.to_vec(), &mut tally, observe);
        let (status, residual) = (first.status, first.residual);
        if status == RestStatus::Stopped {
            return Err(RefitError::Stopped);
        }
        let failed = || RefitError::NotAtRest {
            body: "target".to_owned(),
            status,
            residual,
        };
        let mut best = self.point(zeta.to_vec(), first).ok_or_else(failed)?;
        let initial = best.state.drape.x.clone();
        let floor = LEAST_QUALITY * self.least_quality(&self.mesh.x_bar);
        let mut damping = Damping(self.params.damping);
        let mut history = Vec::new();
        let mut moved = 0.0;
        let mut slow = 0;
        clock.stage("search", observe);
        let status = loop {
            let model = self.model(&best);
            let note = self.note(&best, &model, moved, &tally, history.len(), clock);
            let go_on = observe(&Progress::Iteration {
                iteration: note.iteration,
                loss: note.loss,
                terms: note.terms,
            });
            history.push(note);
            if !go_on {
                break Status::Stopped;
            }
            if slow >= 2 || (history.len() > 1 && moved < self.params.least_step) {
                break Status::Converged;
            }
            if history.len() > self.params.iterations {
                break Status::IterationLimit;
            }
            match self.step(&best, &model, floor, &mut damping, &mut tally, observe) {
                Stepped::Better(next, distance) => {
                    let fall = (best.total - next.total) / best.total;
                    slow = if fall < self.params.tolerance {
                        slow + 1
                    } else {
                        0
                    };
                    (best, moved) = (*next, distance);
                }
                Stepped::NoBetter if slow > 0 => break Status::Converged,
                Stepped::NoBetter => break Status::Stalled,
                Stepped::Interrupted => break Status::Stopped,
            }
        };
        Ok(Found {
            x_bar: best.state.drape.x_bar,
            x: best.state.drape.x,
            initial,
            status,
            iterations: history,
        })
    }

    fn drape(
        &self,
        zeta: &[f64],
        start: Vec<Vec3>,
        tally: &mut Tally,
        observe: &mut Observer<'_>,
    ) -> Drape {
        let x_bar = self.cages.deform(zeta);
        let found = drape(self.scene, &x_bar, start, Start::Near, &mut |p| {
            observe(&Progress::Drape(p))
        });
        tally.drapes += 1;
        tally.factorisations += found.iterations;
        found
    }

    /// The loss at a drape; none unless it is at rest.
    fn point(&self, zeta: Vec<f64>, found: Drape) -> Option<Point<'_>> {
        if found.status != RestStatus::AtRest {
            return None;
        }
        let state = found.differentiable(self.scene)?;
        let loss = self.losses.evaluate(&state.drape.x, &state.drape.x_bar);
        let total = loss.total
            + self
                .affine_rows(&zeta)
                .iter()
                .map(|(_, r, _)| r * r)
                .sum::<f64>();
        Some(Point {
            zeta,
            state,
            loss,
            total,
        })
    }

    /// The prior that prefers conformal maps: rows (unknown, residual, derivative).
    fn affine_rows(&self, zeta: &[f64]) -> Vec<(usize, f64, f64)> {
        let weight = self.affine_weight.sqrt();
        let affine = self.cages.affine_unknowns().into_iter();
        affine
            .map(|(j, size)| (j, weight * zeta[j] / size, weight / size))
            .collect()
    }

    /// The Gauss–Newton model at `best`: residuals of all terms by all unknowns, through drape and
    /// cage.
    fn model(&self, best: &Point<'_>) -> Model {
        let count = self.cages.unknown_count();
        let motions: Vec<Vec<Vec2>> = (0..count)
            .map(|j| {
                let mut motion = vec![Vec2::zeros(); self.mesh.x_bar.len()];
                for (v, d) in self.cages.column(j) {
                    motion[v as usize] += d;
                }
                motion
            })
            .collect();
        let drape = &best.state.drape;
        let moves = best.state.sensitivities(motions.iter().cloned());
        let rows = self.losses.rows(&drape.x, &drape.x_bar);
        let priors = self.affine_rows(&best.zeta);
        let mut jacobian = DMatrix::zeros(rows.len() + priors.len(), count);
        for j in 0..count {
            let moves = &moves[3 * drape.x.len() * j..];
            for (i, row) in rows.iter().enumerate() {
                jacobian[(i, j)] = slope(row, moves, &motions[j]);
            }
        }
        for (i, (j, _, by)) in priors.iter().enumerate() {
            jacobian[(rows.len() + i, *j)] = *by;
        }
        let values = rows
            .iter()
            .map(|r| r.value)
            .chain(priors.iter().map(|p| p.1));
        let residuals = DVector::from_iterator(rows.len() + priors.len(), values);
        Model::new(&jacobian, &residuals)
    }

    /// Tries ever shorter steps until one is accepted.
    fn step(
        &self,
        best: &Point<'_>,
        model: &Model,
        floor: f64,
        damping: &mut Damping,
        tally: &mut Tally,
        observe: &mut Observer<'_>,
    ) -> Stepped<'_> {
        let rigid = self.cages.rigid_modes(&best.zeta);
        for _ in 0..self.params.refusals {
            let Some(mut step) = model.step(damping.0) else {
                return Stepped::NoBetter;
            };
            without(&mut step, &rigid);
            let Some((zeta, moved)) = self.cuttable(best, &mut step, floor) else {
                return Stepped::NoBetter;
            };
            let start = self.predict(best, &step);
            let found = self.drape(&zeta, start, tally, observe);
            if found.status == RestStatus::Stopped {
                return Stepped::Interrupted;
            }
            if let Some(next) = self
                .point(zeta, found)
                .filter(|next| next.total < best.total)
            {
                damping.relax();
                return Stepped::Better(Box::new(next), moved);
            }
            damping.tighten();
        }
        Stepped::NoBetter
    }

    /// Shortens `step` until no pattern vertex moves too far and the rest shape can be cut: cages
    /// and outlines do not cross, and no triangle is poor or flipped.
    fn cuttable(
        &self,
        best: &Point<'_>,
        step: &mut DVector<f64>,
        floor: f64,
    ) -> Option<(Vec<f64>, f64)> {
        loop {
            let zeta: Vec<f64> = best
                .zeta
                .iter()
                .zip(step.iter())
                .map(|(z, d)| z + d)
                .collect();
            let x_bar = self.cages.deform(&zeta);
            let pairs = x_bar.iter().zip(&best.state.drape.x_bar);
            let moved = pairs.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            if !(moved > SHORTEST_TRIAL) {
                return None;
            }
            if moved > self.params.step {
                *step *= 0.999 * self.params.step / moved;
            } else if self.cages.check(&zeta).is_ok() && self.least_quality(&x_bar) >= floor {
                return Some((zeta, moved));
            } else {
                *step *= 0.5;
            }
        }
    }

    fn least_quality(&self, x_bar: &[Vec2]) -> f64 {
        qualities(x_bar, &self.mesh.triangles)
            .into_iter()
            .fold(f64::INFINITY, f64::min)
    }

    /// Where the drape goes to first order, if that is near enough to be believed.
    fn predict(&self, best: &Point<'_>, step: &DVector<f64>) -> Vec<Vec3> {
        let mut motion = vec![Vec2::zeros(); self.mesh.x_bar.len()];
        for (j, d) in step.iter().enumerate() {
            for (v, by) in self.cages.column(j) {
                motion[v as usize] += by * *d;
            }
        }
        let moves = best.state.sensitivities(std::iter::once(motion));
        let x = &best.state.drape.x;
        let moves: Vec<Vec3> = moves
            .chunks_exact(3)
            .map(|c| Vec3::new(c[0], c[1], c[2]))
            .collect();
        if moves.iter().any(|d| !(d.norm() < FARTHEST_PREDICTION)) {
            return x.clone();
        }
        x.iter().zip(moves).map(|(p, d)| p + d).collect()
    }

    fn note(
        &self,
        best: &Point<'_>,
        model: &Model,
        moved: f64,
        tally: &Tally,
        iteration: usize,
        clock: &Clock,
    ) -> Iteration {
        let (_, lambda) = best.state.pull_back(&best.loss.x_hat);
        Iteration {
            iteration,
            loss: best.total,
            shape_matching: best.loss.terms.shape_matching(self.losses.weights()),
            terms: best.loss.terms,
            gradient_norm: model.gradient_norm(),
            adjoint_norm: lambda.iter().map(Vec3::norm).fold(0.0, f64::max),
            residual: best.state.drape.residual,
            shift: best.state.shift,
            moved,
            drapes: tally.drapes,
            factorisations: tally.factorisations,
            elapsed: clock.elapsed(),
        }
    }
}

/// How a step ended.
enum Stepped<'a> {
    Better(Box<Point<'a>>, f64),
    NoBetter,
    Interrupted,
}

/// ∂r along one unknown: through the cloth's moves and the pattern's motion.
fn slope(row: &Row, moves: &[f64], motion: &[Vec2]) -> f64 {
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
fn without(step: &mut DVector<f64>, rigid: &[Vec<f64>]) {
    for mode in rigid {
        let along: f64 = mode.iter().zip(step.iter()).map(|(m, s)| m * s).sum();
        for (s, m) in step.iter_mut().zip(mode) {
            *s -= along * m;
        }
    }
}
