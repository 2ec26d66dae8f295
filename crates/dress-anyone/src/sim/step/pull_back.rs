//! The exact adjoint of one XPBD step: from gradients by the state after it to gradients by the state
//! before it and by the rest shape.
//!
//! Every visit to a constraint moved a few vertices by w ∇Cᵀ Δλ, with Δλ = A⁻¹ r, A = ∇C W ∇Cᵀ + α̃
//! and r = −C − α̃ λ. Walking back, the visits are undone one by one, and each hands the gradients
//! by what it wrote on to what it read: positions, λ, inverse masses w and rest data. With
//! r̂ = A⁻¹ Δλ̂ no derivative of A⁻¹ is ever formed. Each kind of constraint has its walk back beside its
//! sweep. Layers of cloth are left out: the cloth must not feel itself.

use super::lanes::{Four, row};
use super::{State, Stepper};
use crate::geometry::{Mat2, Vec2};
use crate::sim::cloth::{Cloth, Fold, Rest};
use crate::sim::energy::contact::Surface;

/// Gradients by what follows from the rest shape.
#[derive(Clone, Debug)]
pub(super) struct RestHat {
    /// By D_m⁻¹, `[triangle]`.
    pub(super) inverse: Vec<Mat2>,
    /// By Ā, `[triangle]`.
    pub(super) area: Vec<f64>,
    /// By k, `[hinge]`.
    pub(super) k: Vec<[f64; 4]>,
    /// By B/(A₁+A₂), `[hinge]`.
    pub(super) stiffness: Vec<f64>,
    /// By w of the folds, `[fold]`.
    pub(super) fold: Vec<f64>,
}

impl<S: Surface> Stepper<'_, S> {
    /// Turns `hat`, the gradients by the state after the step that was recorded last, into those by the
    /// state before it, and notes those by the rest shape. A step can be walked back through once.
    pub fn pull_back(&mut self, hat: &mut State) {
        let count = hat.x.len();
        let mut before_hat = vec![Four::default(); count];
        let farthest = self.params.speed * self.params.dt;
        let mut hats = Vec::with_capacity(count);
        for (place, v) in self.order.iter().map(|v| *v as usize).enumerate() {
            let by_move = hat.v[v] * self.params.kept();
            let x_hat = hat.x[v] + by_move;
            let moved = self.rows[place].vector() - self.before[place].vector();
            let length = moved.norm();
            let kept = if length > farthest {
                let across = x_hat - moved * (moved.dot(&x_hat) / (length * length));
                across * (farthest / length)
            } else {
                x_hat
            };
            before_hat[place] = row(x_hat - kept - by_move, 0.0);
            hats.push(row(kept, 0.0));
        }
        // One entry into the pool of threads serves all sweeps.
        rayon::scope(|_| self.sweep_back(&mut hats, &mut before_hat));
        self.w_hat.resize(count, 0.0);
        for (place, v) in self.order.iter().map(|v| *v as usize).enumerate() {
            let by_wish = hats[place].vector();
            hat.v[v] = by_wish * self.params.dt;
            hat.x[v] = by_wish + before_hat[place].vector();
            self.w_hat[v] += hats[place].0[3];
        }
    }

    /// Walks back through friction and all sweeps.
    fn sweep_back(&mut self, hats: &mut [Four], before_hat: &mut [Four]) {
        let (before, rows) = (&self.before, &mut self.rows);
        self.whole.pull_back_rub(before, rows, hats, before_hat);
        for sweep in (0..self.params.sweeps).rev() {
            let last = sweep + 1 == self.params.sweeps;
            self.whole.pull_back_contacts(rows, hats);
            self.whole.pull_back(rows, hats, last);
        }
        self.whole.pull_back_look(self.surface, before, before_hat);
    }

    /// The gradient by the rest shape `x_bar` \[m\] of all steps walked back through since it was last
    /// asked for, `[pattern vertex]`.
    pub fn by_rest_shape(&mut self, x_bar: &[Vec2]) -> Vec<Vec2> {
        let (cloth, rest) = (self.cloth, self.rest);
        let mut all = RestHat {
            inverse: vec![Mat2::zeros(); cloth.triangles.len()],
            area: vec![0.0; cloth.triangles.len()],
            k: vec![[0.0; 4]; cloth.hinges.len()],
            stiffness: vec![0.0; cloth.hinges.len()],
            fold: vec![0.0; cloth.folds.len()],
        };
        self.whole.hand_over(rest, &mut all);
        let mut w_hat = std::mem::take(&mut self.w_hat);
        w_hat.resize(cloth.vertex_count, 0.0);
        all.pull_back(cloth, rest, &w_hat, x_bar)
    }
}

impl RestHat {
    /// The gradient by the rest shape: masses grow with the areas about a vertex, m = Σ ρ Ā/3.
    fn pull_back(&self, cloth: &Cloth, rest: &Rest, w_hat: &[f64], x_bar: &[Vec2]) -> Vec<Vec2> {
        let mut hat = vec![Vec2::zeros(); x_bar.len()];
        for (e, t) in cloth.triangles.iter().enumerate() {
            let by_mass = |a: usize| -w_hat[a] / (rest.mass[a] * rest.mass[a]);
            let masses: f64 = t.iter().map(|a| by_mass(*a as usize)).sum();
            let material = cloth.material(e);
            let area = self.area[e] + material.density / 3.0 * masses;
            let corners = rest.triangles[e].pull_back(&self.inverse[e], area);
            let corners = material.off_grain(corners);
            for (v, g) in cloth.rest_triangles[e].iter().zip(corners) {
                hat[*v as usize] += g;
            }
        }
        for (e, hinge) in cloth.hinges.iter().enumerate() {
            let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
            let by_sides = rest.hinges[e].pull_back(sides, self.k[e], self.stiffness[e]);
            for (v, g) in hinge.rest.iter().flatten().zip(by_sides.iter().flatten()) {
                hat[*v as usize] += g;
            }
        }
        for (e, Fold { hinge, .. }) in cloth.folds.iter().enumerate() {
            let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
            let by_sides = rest.folds[e].pull_back(sides, self.fold[e]);
            for (v, g) in hinge.rest.iter().flatten().zip(by_sides.iter().flatten()) {
                hat[*v as usize] += g;
            }
        }
        hat
    }
}

#[cfg(test)]
mod tests;
