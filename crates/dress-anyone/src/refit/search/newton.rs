//! Levenberg–Marquardt steps: from the sensitivities of the drape at hand, by every unknown.

use super::guards::{can_be_cut, without};
use super::point::Point;
use super::{Run, Search, Stepped};
use crate::cage::Cages;
use crate::descent::{Damping, Model};
use crate::geometry::Vec2;
use crate::loss::Row;
use crate::pattern::PatternMesh;
use crate::sim::energy::contact::Surface;
use crate::sim::equilibrium::RestStatus;

impl<'s, S: Surface> Search<'s, S> {
    /// Tries ever shorter steps from `best` until the loss falls, as long as they promise a fall to speak
    /// of. A pattern that cannot be cut costs no drape.
    pub(super) fn newton(
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
                break;
            };
            without(&mut step, &rigid);
            let Some(zeta) = self.within_reach(best, &mut step) else {
                break;
            };
            if model.promise(&step) < self.params.tolerance * best.total {
                return match refusals {
                    0 => Stepped::Level,
                    _ => Stepped::NoBetter,
                };
            }
            if can_be_cut(self.cages, self.mesh, &zeta, floor) {
                let start = self.predict(best, &step);
                match self.trial(&zeta, start, best.total, self.params.patience, run) {
                    Err(failed) if failed.status == RestStatus::Stopped => {
                        return Stepped::Interrupted;
                    }
                    Ok(Some(next)) => {
                        damping.relax();
                        return Stepped::Better(next);
                    }
                    _ => refusals += 1,
                }
            }
            damping.tighten();
        }
        Stepped::NoBetter
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
