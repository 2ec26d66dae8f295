//! Coulomb friction in a time step: what the body carries is drawn back across it, by no more than μ
//! times what the body pushed it out (METHOD §2.3), once per step after the sweeps; and its adjoint.
//!
//! A contact point with λ > 0 has moved by Δ in this step, across the normal by T = (I − nnᵀ) Δ. It is
//! moved back by T min(1, μ λ W |∇d| / |T|), W its inverse mass.

use super::contact::{Block, Points};
use super::lanes::{Four, Four3, of_lane};
use crate::geometry::Vec3;

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

impl<const N: usize> Block<N> {
    /// Point `l`, which moved from where it was `before` to where it is in `rows`; none if the body does
    /// not carry it, or is too slippery.
    fn rub_of(&self, l: usize, before: &[Four], rows: &[Four]) -> Option<Rub> {
        let (mu, lambda) = (self.mu.0[l], self.lambda.0[l]);
        if mu == 0.0 || lambda <= 0.0 {
            return None;
        }
        let normal = of_lane(&self.normal, l);
        let steepness = normal.norm();
        let normal = normal / steepness;
        let moved = self.point(l, rows) - self.point(l, before);
        Some(Rub {
            moved,
            across: moved - normal * normal.dot(&moved),
            limit: mu * lambda * self.inverse_mass(l, rows) * steepness,
        })
    }
}

impl<const N: usize> Points<N> {
    /// Draws back what the body carries.
    pub(super) fn rub(&mut self, before: &[Four], rows: &mut [Four]) {
        for &i in &self.near {
            let (block, mut drawn) = (&self.blocks[i], Four3::default());
            for (l, _) in self.elements[i].each() {
                let Some(rub) = block.rub_of(l, before, rows) else {
                    continue;
                };
                let (back, mass) = (rub.back(), block.inverse_mass(l, rows));
                for (a, share) in block.corners_of(l) {
                    let part = share * rows[a].0[3] / mass;
                    rows[a].shift(back * part);
                }
                for (lanes, back) in drawn.iter_mut().zip(back.iter()) {
                    lanes.0[l] = *back;
                }
            }
            self.rubbed.push(drawn);
        }
    }

    /// Undoes [`Self::rub`] on `rows`, and hands the gradients `hats` on.
    pub(super) fn pull_back_rub(
        &mut self,
        before: &[Four],
        rows: &mut [Four],
        hats: &mut [Four],
        before_hat: &mut [Four],
    ) {
        for ((n, &i), drawn) in self.near.iter().enumerate().zip(&self.rubbed).rev() {
            let (block, points, own) = (&self.blocks[i], &self.elements[i], &mut self.hats[n]);
            for (l, _) in points.each().rev() {
                let drawn = of_lane(drawn, l);
                let mass = block.inverse_mass(l, rows);
                let (mut drawn_hat, mut mass_hat) = (Vec3::zeros(), 0.0);
                for (a, share) in block.corners_of(l) {
                    let part = share * rows[a].0[3] / mass;
                    let along = hats[a].vector().dot(&drawn);
                    drawn_hat += hats[a].vector() * part;
                    hats[a].0[3] += along * share / mass;
                    mass_hat -= along * part / mass;
                    rows[a].shift(-drawn * part);
                }
                if let Some(rub) = block.rub_of(l, before, rows) {
                    let (mu, lambda) = (block.mu.0[l], block.lambda.0[l]);
                    let normal = of_lane(&block.normal, l);
                    let steepness = normal.norm();
                    let normal = normal / steepness;
                    let length = rub.across.norm();
                    let mut across_hat = -drawn_hat;
                    let mut normal_hat = Vec3::zeros();
                    if length > rub.limit {
                        let t = rub.across / length;
                        let limit_hat = -t.dot(&drawn_hat);
                        across_hat = (across_hat - t * t.dot(&across_hat)) * (rub.limit / length);
                        own.lambda.0[l] += limit_hat * mu * mass * steepness;
                        mass_hat += limit_hat * mu * lambda * steepness;
                        normal_hat += normal * (limit_hat * mu * lambda * mass);
                    }
                    let level = |v: Vec3| v - normal * normal.dot(&v);
                    let turned =
                        rub.moved * normal.dot(&across_hat) + across_hat * normal.dot(&rub.moved);
                    normal_hat -= level(turned) / steepness;
                    for (lanes, by) in own.normal.iter_mut().zip(normal_hat.iter()) {
                        lanes.0[l] += by;
                    }
                    let moved_hat = level(across_hat);
                    for (a, share) in block.corners_of(l) {
                        hats[a].shift(moved_hat * share);
                        before_hat[a].shift(moved_hat * -share);
                    }
                }
                for (a, share) in block.corners_of(l) {
                    hats[a].0[3] += share * share * mass_hat;
                }
            }
        }
    }
}
