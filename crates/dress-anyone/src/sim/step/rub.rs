//! Coulomb friction in a time step: what the body carries is drawn back across it, by no more than μ
//! times what the body pushed it out (METHOD §2.3), once per step after the sweeps; and its adjoint.
//!
//! A contact point with λ > 0 has moved by Δ in this step, across the normal by T = (I − nnᵀ) Δ. It is
//! moved back by T min(1, μ λ W |∇d| / |T|), W its inverse mass.

use super::pull_back::Back;
use super::{Stepper, Tape, Touch};
use crate::geometry::Vec3;
use crate::sim::energy::contact::Surface;

/// One point drawn back.
struct Rub {
    /// Move of the step Δ, and what of it is across the normal \[m\].
    moved: Vec3,
    across: Vec3,
    /// Farthest that friction draws it back \[m\].
    limit: f64,
}

impl Rub {
    /// −T min(1, limit/|T|).
    fn back(&self) -> Vec3 {
        let length = self.across.norm();
        if length > self.limit {
            self.across * (-self.limit / length)
        } else {
            -self.across
        }
    }
}

impl<S: Surface> Stepper<'_, S> {
    /// The point of `touch`, which moved from `before` to `x`; none if the body does not carry it.
    fn rub_of(&self, touch: &Touch, before: &[Vec3], x: &[Vec3]) -> Option<Rub> {
        if !self.contact.rubs() || touch.lambda <= 0.0 {
            return None;
        }
        let steepness = touch.normal.norm();
        let normal = touch.normal / steepness;
        let moved = touch.point.at(x) - touch.point.at(before);
        let w = touch.point.inverse_mass(&self.w);
        Some(Rub {
            moved,
            across: moved - normal * normal.dot(&moved),
            limit: self.mu(touch) * touch.lambda * w * steepness,
        })
    }

    /// Coulomb's coefficient at a contact point.
    fn mu(&self, touch: &Touch) -> f64 {
        self.contact.friction.or(touch.point.friction)
    }

    /// Draws back what the body carries.
    pub(super) fn rub(
        &self,
        touching: &[Touch],
        before: &[Vec3],
        x: &mut [Vec3],
        mut tape: Option<&mut Tape>,
    ) {
        for touch in touching {
            let rub = self.rub_of(touch, before, x);
            let back = rub.map_or_else(Vec3::zeros, |rub| rub.back());
            let w = touch.point.inverse_mass(&self.w);
            for (a, weight) in touch.point.parts() {
                x[a] += back * (weight * self.w[a] / w);
            }
            if let Some(tape) = &mut tape {
                tape.rubbed.push(back);
            }
        }
    }

    /// Undoes [`Self::rub`], and hands the gradients on.
    pub(super) fn pull_back_rub(&self, tape: &Tape, back: &mut Back<'_>, before_hat: &mut [Vec3]) {
        for (e, touch) in tape.touching.iter().enumerate().rev() {
            let mu = self.mu(touch);
            let (drawn, point) = (tape.rubbed[e], &touch.point);
            let w = point.inverse_mass(&self.w);
            let mut drawn_hat = Vec3::zeros();
            let mut w_hat = 0.0;
            for (a, weight) in point.parts() {
                let along = weight * back.x_hat[a].dot(&drawn) / w;
                drawn_hat += back.x_hat[a] * (weight * self.w[a] / w);
                back.rest.w[a] += along;
                w_hat -= along * self.w[a] / w;
                back.x[a] -= drawn * (weight * self.w[a] / w);
            }
            if let Some(rub) = self.rub_of(touch, &tape.before, &back.x) {
                let steepness = touch.normal.norm();
                let normal = touch.normal / steepness;
                let length = rub.across.norm();
                let mut across_hat = -drawn_hat;
                if length > rub.limit {
                    let t = rub.across / length;
                    let limit_hat = -t.dot(&drawn_hat);
                    across_hat = (across_hat - t * t.dot(&across_hat)) * (rub.limit / length);
                    back.contact[e] += limit_hat * mu * w * steepness;
                    w_hat += limit_hat * mu * touch.lambda * steepness;
                    back.normal[e] += normal * (limit_hat * mu * touch.lambda * w);
                }
                let level = |v: Vec3| v - normal * normal.dot(&v);
                let turned =
                    rub.moved * normal.dot(&across_hat) + across_hat * normal.dot(&rub.moved);
                back.normal[e] -= level(turned) / steepness;
                let moved_hat = level(across_hat);
                for (a, weight) in point.parts() {
                    back.x_hat[a] += moved_hat * weight;
                    before_hat[a] -= moved_hat * weight;
                }
            }
            for (a, weight) in point.parts() {
                back.rest.w[a] += weight * weight * w_hat;
            }
        }
    }
}
