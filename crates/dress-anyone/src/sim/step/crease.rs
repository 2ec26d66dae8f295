//! Pressed folds in a time step, one after the other, and their adjoint.
//!
//! C = θ − θ̄, Δλ = −(C + α̃λ)/(Σ w|∇θ|² + α̃), corner a moves by w_a ∇_aθ Δλ. A garment has few of them.

use super::pull_back::Back;
use super::{Stepper, Tape};
use crate::geometry::Vec3;
use crate::sim::energy::contact::Surface;
use crate::sim::energy::fold;

/// A visit to a fold: where its corners were, and Δλ.
pub(super) type Visit = ([Vec3; 4], f64);

impl<S: Surface> Stepper<'_, S> {
    pub(super) fn sweep_folds(&mut self, x: &mut [Vec3], mut tape: Option<&mut Tape>) {
        for (e, fold) in self.cloth.folds.iter().enumerate() {
            let at = fold.hinge.vertices.map(|a| a as usize);
            let corners = at.map(|a| x[a]);
            let gradient = fold::gradient(corners);
            let alpha_tilde = self.fold_compliance(e);
            let mut mass = alpha_tilde;
            for (a, g) in at.into_iter().zip(&gradient) {
                mass += self.w[a] * g.norm_squared();
            }
            let c = fold::angle(corners) - self.rest.folds[e].angle;
            let delta = -(c + alpha_tilde * self.lambda_fold[e]) / mass;
            self.lambda_fold[e] += delta;
            for (a, g) in at.into_iter().zip(&gradient) {
                x[a] += g * (self.w[a] * delta);
            }
            if let Some(tape) = &mut tape {
                tape.folds.push((corners, delta));
            }
        }
    }

    /// α̃ of a fold.
    fn fold_compliance(&self, e: usize) -> f64 {
        1.0 / (self.rest.folds[e].stiffness * self.params.dt * self.params.dt)
    }

    pub(super) fn pull_back_folds(&self, tape: &Tape, sweep: usize, back: &mut Back<'_>) {
        let count = self.cloth.folds.len();
        for (e, fold) in self.cloth.folds.iter().enumerate().rev() {
            let (corners, delta) = tape.folds[sweep * count + e];
            let at = fold.hinge.vertices.map(|a| a as usize);
            let (gradient, hessian) = (fold::gradient(corners), fold::hessian(corners));
            let alpha_tilde = self.fold_compliance(e);
            let mut mass = alpha_tilde;
            let mut delta_hat = back.folds[e];
            for (a, g) in at.into_iter().zip(&gradient) {
                mass += self.w[a] * g.norm_squared();
                delta_hat += self.w[a] * g.dot(&back.x_hat[a]);
            }
            let r_hat = delta_hat / mass;
            let lambda = back.lambda_fold[e];
            back.lambda_fold[e] -= delta;
            back.folds[e] -= alpha_tilde * r_hat;
            back.rest.fold[e] += r_hat * lambda * alpha_tilde / self.rest.folds[e].stiffness;
            let gradient_hat: [Vec3; 4] = std::array::from_fn(|i| {
                let (a, g) = (at[i], gradient[i]);
                back.rest.w[a] += delta * g.dot(&back.x_hat[a]) - r_hat * delta * g.norm_squared();
                (back.x_hat[a] - g * (2.0 * r_hat)) * (self.w[a] * delta)
            });
            for (i, a) in at.into_iter().enumerate() {
                back.x[a] = corners[i];
                back.x_hat[a] -= gradient[i] * r_hat;
                for (k, hat) in gradient_hat.iter().enumerate() {
                    back.x_hat[a] += hessian[k][i].transpose() * hat;
                }
            }
        }
    }
}
