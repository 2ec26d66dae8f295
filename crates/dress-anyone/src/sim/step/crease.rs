//! Pressed folds in a time step, one after the other, and their adjoint.
//!
//! C = θ − θ̄, Δλ = −(C + α̃λ)/(Σ w|∇θ|² + α̃), corner a moves by w_a ∇_aθ Δλ. A garment has few of them.

use super::lanes::{Four, row};
use super::pull_back::RestHat;
use crate::geometry::Vec3;
use crate::sim::cloth::{Cloth, Rest};
use crate::sim::energy::fold;

/// Folds of a part of a cloth, with one rest shape.
#[derive(Default)]
pub(super) struct Creases {
    each: Vec<Crease>,
    /// Every visit that was recorded: where the corners were, and Δλ.
    tape: Vec<([Vec3; 4], f64)>,
    dt: f64,
}

struct Crease {
    fold: usize,
    places: [usize; 4],
    angle: f64,
    alpha_tilde: f64,
    lambda: f64,
    lambda_hat: f64,
    /// By α̃.
    alpha_hat: f64,
}

impl Creases {
    /// `folds` of a cloth, whose vertices have the places `place` in the part.
    pub(super) fn new(cloth: &Cloth, folds: &[u32], place: impl Fn(u32) -> u32, dt: f64) -> Self {
        let crease = |e: &u32| Crease {
            fold: *e as usize,
            places: (cloth.folds[*e as usize].hinge.vertices).map(|v| place(v) as usize),
            angle: 0.0,
            alpha_tilde: 0.0,
            lambda: 0.0,
            lambda_hat: 0.0,
            alpha_hat: 0.0,
        };
        Self {
            each: folds.iter().map(crease).collect(),
            tape: Vec::new(),
            dt,
        }
    }

    /// Takes on a rest shape.
    pub(super) fn grow(&mut self, rest: &Rest) {
        for crease in &mut self.each {
            let fold = &rest.folds[crease.fold];
            crease.angle = fold.angle;
            crease.alpha_tilde = 1.0 / (fold.stiffness * self.dt * self.dt);
        }
    }

    /// Forgets what was recorded.
    pub(super) fn clear(&mut self) {
        self.tape.clear();
    }

    /// Visits every fold once. The `first` sweep of a step begins with λ = 0.
    pub(super) fn sweep(&mut self, rows: &mut [Four], first: bool, record: bool) {
        for crease in &mut self.each {
            if first {
                crease.lambda = 0.0;
            }
            let corners = crease.places.map(|a| rows[a].vector());
            let gradient = fold::gradient(corners);
            let mut mass = crease.alpha_tilde;
            for (a, g) in crease.places.into_iter().zip(&gradient) {
                mass += rows[a].0[3] * g.norm_squared();
            }
            let c = fold::angle(corners) - crease.angle;
            let delta = -(c + crease.alpha_tilde * crease.lambda) / mass;
            crease.lambda += delta;
            for (a, g) in crease.places.into_iter().zip(&gradient) {
                let by = rows[a].0[3] * delta;
                rows[a].shift(g * by);
            }
            if record {
                self.tape.push((corners, delta));
            }
        }
    }

    /// Walks back through the last sweep that was recorded. The `last` sweep of a step leaves λ to nobody.
    pub(super) fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four], last: bool) {
        let visits = self.tape.split_off(self.tape.len() - self.each.len());
        for (crease, (corners, delta)) in self.each.iter_mut().zip(visits).rev() {
            let (gradient, hessian) = (fold::gradient(corners), fold::hessian(corners));
            let lambda_hat = if last { 0.0 } else { crease.lambda_hat };
            let mut mass = crease.alpha_tilde;
            let mut delta_hat = lambda_hat;
            for (a, g) in crease.places.into_iter().zip(&gradient) {
                let w = rows[a].0[3];
                mass += w * g.norm_squared();
                delta_hat += w * g.dot(&hats[a].vector());
            }
            let right_hat = delta_hat / mass;
            crease.alpha_hat -= right_hat * crease.lambda;
            crease.lambda -= delta;
            crease.lambda_hat = lambda_hat - crease.alpha_tilde * right_hat;
            let gradient_hat: [Vec3; 4] = std::array::from_fn(|i| {
                let (a, g) = (crease.places[i], gradient[i]);
                let x_hat = hats[a].vector();
                hats[a].0[3] += delta * (g.dot(&x_hat) - right_hat * g.norm_squared());
                (x_hat - g * (2.0 * right_hat)) * (rows[a].0[3] * delta)
            });
            for (i, a) in crease.places.into_iter().enumerate() {
                let mut by_place = -gradient[i] * right_hat;
                for (k, hat) in gradient_hat.iter().enumerate() {
                    by_place += hessian[k][i].transpose() * hat;
                }
                hats[a].shift(by_place);
                rows[a] = row(corners[i], rows[a].0[3]);
            }
        }
    }

    /// Adds the gradients by the rest shape to `all`, and forgets them.
    pub(super) fn hand_over(&mut self, rest: &Rest, all: &mut RestHat) {
        for crease in &mut self.each {
            // α̃ = Δt⁻²/stiffness.
            let by_alpha = std::mem::take(&mut crease.alpha_hat) * crease.alpha_tilde;
            all.fold[crease.fold] -= by_alpha / rest.folds[crease.fold].stiffness;
        }
    }
}
