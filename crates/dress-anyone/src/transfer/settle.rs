//! The loop of relaxing and rebinding.
//!
//! Cloth that touches is pulled to its distance to the body, by no more than the body may hold it
//! ([`super::hang`]); cloth that comes too near is pushed out. Both depend on where it is, so they alternate with
//! solves of all the rest.

use super::bind::{Carried, smoothstep};
use super::clear::above;
use super::hold::Firmness;
use super::relax::{Hold, Relaxation};
use crate::geometry::{ClosestPoint, Vec3};
use rayon::prelude::*;

/// A garment on its way to the target shape.
pub(super) struct Settling<'a> {
    pub(super) relaxation: Relaxation,
    /// The target.
    pub(super) body: &'a ClosestPoint,
    pub(super) bound: Vec<Carried>,
    pub(super) grounds: Vec<Ground>,
    /// The loop ends when nothing moves farther \[m\].
    pub(super) still: f64,
    /// Most rounds.
    pub(super) rounds: usize,
}

/// How a vertex stands to the body.
pub(super) struct Ground {
    /// Unit direction away from it, or zero where there is none.
    pub(super) across: Vec3,
    /// Share by which it touches \[–\].
    pub(super) touching: f64,
    /// Distance \[m\] of what touches.
    pub(super) wanted: f64,
    /// How hard it may be held to the body \[unit of the relaxation's forces\].
    pub(super) pressure: f64,
    pub(super) firmness: Firmness,
}

impl Ground {
    /// The hold of a vertex that is where it should be.
    pub(super) fn usual(&self) -> Hold {
        let firm = self.touching * self.firmness.touching;
        self.firmness.loose(self.across) + self.across * self.across.transpose() * firm
    }
}

/// Rounds in full steps; later ones shorten as 1, 1/2, 1/3 …: above a crease of the body the nearest
/// side may change with every round, and short steps settle between.
const FULL_ROUNDS: usize = 4;
/// Error of a relaxed vertex, as part of how far one may still move when the loop ends.
const EXACT: f64 = 1e-6;
/// Above the least distance, pushing out fades over this part of it, so that what is near does not flutter.
const FADE: f64 = 0.25;

impl Settling<'_> {
    /// Moves `x` to where it stays, no nearer to the body than `least` \[m\]; the rounds that took, and whether
    /// they were enough.
    pub(super) fn settle(&self, x: &mut [Vec3], least: &[f64]) -> (usize, bool) {
        for round in 0..self.rounds {
            let (pulls, holds): (Vec<Vec3>, Vec<Hold>) = (0..x.len())
                .into_par_iter()
                .map(|v| self.pull(v, x[v], least[v]))
                .unzip();
            let relaxed = (self.relaxation).relax(&pulls, &holds, x, EXACT * self.still);
            let step = 1.0 / (1 + round.saturating_sub(FULL_ROUNDS)) as f64;
            let mut farthest = 0.0_f64;
            for (x, relaxed) in x.iter_mut().zip(relaxed) {
                let move_ = (relaxed - *x) * step;
                farthest = farthest.max(move_.norm());
                *x += move_;
            }
            if farthest <= self.still {
                return (round + 1, true);
            }
        }
        (self.rounds, false)
    }

    /// How vertex `v`, now at `x`, is held: M z and M.
    fn pull(&self, v: usize, x: Vec3, least: f64) -> (Vec3, Hold) {
        let ground = &self.grounds[v];
        let firm = ground.firmness.touching;
        let mut hold = ground.firmness.loose(ground.across);
        let mut pull = hold * self.bound[v].point;
        let mut spring = |stiffness: f64, along: Vec3, to: Vec3| {
            hold += along * along.transpose() * stiffness;
            pull += along * (along.dot(&to) * stiffness);
        };
        if let Some((now, outward)) = above(self.body, x) {
            let too_far = now - ground.wanted.max(least);
            let mut stiffness = ground.touching * firm;
            if stiffness * too_far > ground.pressure {
                stiffness = ground.pressure / too_far;
            }
            spring(stiffness, ground.across, x - outward * too_far);
            let near = 1.0 - smoothstep((now - least) / (FADE * least).max(f64::MIN_POSITIVE));
            let out = (least - now).max(0.0);
            let stiffness = (1.0 - ground.touching) * near * firm;
            spring(stiffness, outward, x + outward * out);
        }
        (pull, hold)
    }
}
