//! Holds in a time step: vertices kept near a height by springs, as XPBD constraints c = y − height; and
//! their adjoint.

use super::lanes::Four;
use crate::sim::cloth::Cloth;

/// Held vertices of a part of a cloth.
#[derive(Default)]
pub(super) struct Holds {
    each: Vec<Held>,
    /// Δλ of every visit that was recorded.
    tape: Vec<f64>,
}

struct Held {
    place: u32,
    height: f64,
    alpha_tilde: f64,
    lambda: f64,
    lambda_hat: f64,
}

impl Holds {
    /// `holds` of a cloth, whose vertices have the places `place` in the part.
    pub(super) fn new(cloth: &Cloth, holds: &[u32], place: impl Fn(u32) -> u32, dt: f64) -> Self {
        let held = |e: &u32| {
            let hold = &cloth.holds[*e as usize];
            Held {
                place: place(hold.vertex),
                height: hold.height,
                alpha_tilde: 1.0 / (hold.stiffness * dt * dt),
                lambda: 0.0,
                lambda_hat: 0.0,
            }
        };
        Self {
            each: holds.iter().map(held).collect(),
            tape: Vec::new(),
        }
    }

    /// Forgets what was recorded.
    pub(super) fn clear(&mut self) {
        self.tape.clear();
    }

    /// Visits every hold once. The `first` sweep of a step begins with λ = 0.
    pub(super) fn sweep(&mut self, rows: &mut [Four], first: bool, record: bool) {
        for held in &mut self.each {
            if first {
                held.lambda = 0.0;
            }
            let [_, y, _, w] = &mut rows[held.place as usize].0;
            let right = held.height - *y - held.alpha_tilde * held.lambda;
            let delta = right / (*w + held.alpha_tilde);
            held.lambda += delta;
            *y += *w * delta;
            if record {
                self.tape.push(delta);
            }
        }
    }

    /// Walks back through the last sweep that was recorded. The `last` sweep of a step leaves λ to nobody.
    pub(super) fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four], last: bool) {
        let visits = self.tape.split_off(self.tape.len() - self.each.len());
        for (held, delta) in self.each.iter_mut().zip(visits).rev() {
            let [_, y, _, w] = &mut rows[held.place as usize].0;
            let [_, y_hat, _, w_hat] = &mut hats[held.place as usize].0;
            let lambda_hat = if last { 0.0 } else { held.lambda_hat };
            let right_hat = (lambda_hat + *w * *y_hat) / (*w + held.alpha_tilde);
            held.lambda_hat = lambda_hat - held.alpha_tilde * right_hat;
            *w_hat += delta * (*y_hat - right_hat);
            *y -= *w * delta;
            *y_hat -= right_hat;
        }
    }
}
