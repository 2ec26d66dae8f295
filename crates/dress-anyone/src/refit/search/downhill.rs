//! Steps by the gradient alone, with backtracking: plain descent, as in the paper, and L-BFGS.

use super::guards::{can_be_cut, farthest, without};
use super::point::Point;
use super::{Run, Search, Stepped};
use crate::descent::slope::Slope;
use crate::sim::energy::contact::Surface;
use crate::sim::equilibrium::RestStatus;
use nalgebra::DVector;

/// Part of what the slope promises by which the loss must fall (Armijo).
const WORTH: f64 = 1e-4;
/// A refused step is shortened to this part.
const SHORTEN: f64 = 0.4;

impl<'s, S: Surface> Search<'s, S> {
    /// Tries ever shorter steps along the slope's direction until one is accepted, then along the
    /// gradient's.
    pub(super) fn downhill(
        &self,
        best: &Point<'_>,
        floor: f64,
        slope: &mut Slope,
        run: &mut Run<'_, '_>,
    ) -> Stepped<'s> {
        let rigid = self.cages.rigid_modes(&best.zeta);
        let mut gradient = best.gradient.clone();
        without(&mut gradient, &rigid);
        loop {
            let mut step = slope.direction(&gradient);
            without(&mut step, &rigid);
            if !slope.knows_length() {
                step *= slope.length / self.reach(best, &step);
            }
            match self.backtrack(best, floor, (&gradient, step), slope, run) {
                Stepped::NoBetter if slope.forget() => {}
                stepped => return stepped,
            }
        }
    }

    /// Shortens the step until the loss falls. A pattern that cannot be cut costs no drape.
    fn backtrack(
        &self,
        best: &Point<'_>,
        floor: f64,
        (gradient, mut step): (&DVector<f64>, DVector<f64>),
        slope: &mut Slope,
        run: &mut Run<'_, '_>,
    ) -> Stepped<'s> {
        let mut refusals = 0;
        while refusals < self.params.refusals {
            let Some(zeta) = self.within_reach(best, &mut step) else {
                return Stepped::NoBetter;
            };
            slope.length = self.reach(best, &step);
            if can_be_cut(self.cages, self.mesh, &zeta, floor) {
                let wanted = best.total + WORTH * gradient.dot(&step);
                let start = self.predict(best, &step);
                match self.trial(&zeta, start, &|| wanted, Some(self.params.patience), run) {
                    Err(failed) if failed.status == RestStatus::Stopped => {
                        return Stepped::Interrupted;
                    }
                    Ok(Some(next)) => {
                        slope.length *= 2.0;
                        slope.learn(step, &next.gradient - &best.gradient);
                        return Stepped::Better(next);
                    }
                    _ => refusals += 1,
                }
            }
            step *= SHORTEN;
        }
        Stepped::NoBetter
    }

    /// Farthest that `step` moves any pattern vertex \[m\].
    fn reach(&self, best: &Point<'_>, step: &DVector<f64>) -> f64 {
        let moved = best.zeta.iter().zip(step.iter());
        let zeta: Vec<f64> = moved.map(|(z, d)| z + d).collect();
        farthest(&self.cages.deform(&zeta), &best.x_bar)
    }
}
