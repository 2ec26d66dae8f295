//! Levenberg–Marquardt steps: from the sensitivities of the drape at hand, by every unknown.

use super::guards::{can_be_cut, without};
use super::point::{Failed, Point};
use super::{Run, Search, Stepped};
use crate::cage::Cages;
use crate::descent::{Damping, Model};
use crate::geometry::Vec2;
use crate::loss::Row;
use crate::pattern::PatternMesh;
use crate::sim::energy::contact::Surface;
use crate::sim::equilibrium::RestStatus;
use nalgebra::DVector;

/// Ever shorter steps from a point, as the model gives them with ever more damping.
struct Shorter<'a, 's, S> {
    search: &'a Search<'s, S>,
    best: &'a Point<'a>,
    model: &'a Model,
    /// Steps that move a panel as a whole.
    rigid: &'a [Vec<f64>],
    /// Least quality of triangles.
    floor: f64,
    /// Of the next step.
    damping: Damping,
    /// Steps given.
    given: usize,
}

/// A step to try.
struct Try {
    zeta: Vec<f64>,
    step: DVector<f64>,
    damping: Damping,
}

impl<S> Clone for Shorter<'_, '_, S> {
    fn clone(&self) -> Self {
        Self { ..*self }
    }
}

impl<S: Surface> Shorter<'_, '_, S> {
    /// The next step that promises a fall to speak of, with a pattern that can be cut.
    fn next<'p>(&mut self) -> Result<Try, Stepped<'p>> {
        let Self { search, best, .. } = *self;
        while self.given < search.params.refusals {
            let damping = self.damping;
            let Some(mut step) = self.model.step(damping.0) else {
                break;
            };
            without(&mut step, self.rigid);
            let Some(zeta) = search.within_reach(best, &mut step) else {
                break;
            };
            if self.model.promise(&step) < search.params.tolerance * best.total {
                return Err(match self.given {
                    0 => Stepped::Level,
                    _ => Stepped::NoBetter,
                });
            }
            self.damping.tighten();
            if can_be_cut(search.cages, search.mesh, &zeta, self.floor) {
                self.given += 1;
                return Ok(Try {
                    zeta,
                    step,
                    damping,
                });
            }
        }
        Err(Stepped::NoBetter)
    }
}

impl<'s, S: Surface> Search<'s, S> {
    /// Tries ever shorter steps from `best` until the loss falls, as long as they promise a fall to speak
    /// of, two at a time where there is a core to spare. A pattern that cannot be cut costs no drape.
    pub(super) fn newton(
        &self,
        best: &Point<'_>,
        floor: f64,
        damping: &mut Damping,
        run: &mut Run<'_, '_>,
    ) -> Stepped<'s> {
        let model = self.model(best);
        let mut shorter = Shorter {
            search: self,
            best,
            model: &model,
            rigid: &self.cages.rigid_modes(&best.zeta),
            floor,
            damping: *damping,
            given: 0,
        };
        let draped = |tried: &Try, run: &mut Run<'_, '_>| {
            let start = self.predict(best, &tried.step);
            let wanted = || best.total;
            self.trial(&tried.zeta, start, &wanted, Some(self.params.patience), run)
        };
        let mut made = None;
        loop {
            let tried = match shorter.next() {
                Ok(tried) => tried,
                Err(ended) => return ended,
            };
            let found = if let Some(made) = made.take() {
                run.count_made(made)
            } else {
                let after = shorter.clone().next().ok();
                let after = after.map(|after| move |run: &mut Run<'_, '_>| draped(&after, run));
                let enough = |found: &Result<Option<_>, Failed>| {
                    Failed::stopped(found) || matches!(found, Ok(Some(_)))
                };
                let (found, aside) =
                    run.beside(self.spare, |run| draped(&tried, run), after, enough);
                made = aside;
                found
            };
            match found {
                Err(failed) if failed.status == RestStatus::Stopped => {
                    return Stepped::Interrupted;
                }
                Ok(Some(next)) => {
                    *damping = tried.damping;
                    damping.relax();
                    return Stepped::Better(next);
                }
                _ => {}
            }
        }
    }

    /// The Gauss–Newton model at `best`: residuals of all terms by all unknowns, through drape and
    /// cage.
    pub(in crate::refit) fn model(&self, best: &Point<'_>) -> Model {
        let state = best.state.as_ref();
        let state = state.expect("Levenberg–Marquardt goes with drapes at rest alone");
        let moves = state.sensitivities(self.motions.iter().cloned());
        let rows = self.losses.rows(&best.x, &best.x_bar);
        let priors = self.priors(&best.zeta);
        let count = rows.len() + priors.len();
        Model::new(count, self.motions.len(), |i, by| {
            if let Some(row) = rows.get(i) {
                for (j, motion) in self.motions.iter().enumerate() {
                    by[j] = slope(row, &moves[3 * best.x.len() * j..], motion);
                }
                row.value
            } else {
                priors[i - rows.len()].fill(by)
            }
        })
    }
}

/// ∂x̄ along each unknown of `cages`, `[unknown][pattern vertex]`.
pub(in crate::refit) fn motions(cages: &Cages, mesh: &PatternMesh) -> Vec<Vec<Vec2>> {
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
pub(in crate::refit) fn slope(row: &Row, moves: &[f64], motion: &[Vec2]) -> f64 {
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
