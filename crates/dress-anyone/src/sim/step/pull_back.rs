//! The exact adjoint of one XPBD step: from gradients by the state after it to gradients by the state
//! before it and by the rest shape.
//!
//! Every visit to a constraint moved a few vertices by w ∇Cᵀ Δλ, with Δλ = A⁻¹ r, A = ∇C W ∇Cᵀ + α̃
//! and r = −C − α̃ λ. Walking back, the visits are undone one by one, and each hands the gradients
//! by what it wrote on to what it read: positions, λ, inverse masses w and rest data. With
//! r̂ = A⁻¹ Δλ̂ no derivative of A⁻¹ is ever formed. The functions stand in the order of those they
//! differentiate, in `step.rs`, `step/stretch.rs` and `step/turn.rs`; friction stands in `step/rub.rs`
//! both ways. Layers of cloth are left out: the cloth must not feel itself.

use super::{CREASE, State, Stepper, Tape, Touch};
use crate::geometry::{Mat2, Mat3, Vec2, Vec3};
use crate::sim::cloth::{Cloth, Fold, Rest};
use crate::sim::energy::contact::Surface;
use crate::sim::energy::membrane::{
    Elasticity, Mat3x2, constraint_gradient, constraint_mass, symmetric,
};
use crate::sim::step::solve_symmetric;

/// Gradients by what follows from the rest shape.
#[derive(Clone, Debug)]
pub struct RestHat {
    /// By D_m⁻¹, `[triangle]`.
    inverse: Vec<Mat2>,
    /// By Ā, `[triangle]`.
    area: Vec<f64>,
    /// By k, `[hinge]`.
    k: Vec<[f64; 4]>,
    /// By B/(A₁+A₂), `[hinge]`.
    stiffness: Vec<f64>,
    /// By w of the folds, `[fold]`.
    pub(super) fold: Vec<f64>,
    /// By 1/m, `[cloth vertex]`.
    pub(super) w: Vec<f64>,
}

/// What is carried back from visit to visit.
pub(super) struct Back<'b> {
    /// Positions and λ, as the visits are undone.
    pub(super) x: Vec<Vec3>,
    lambda_membrane: Vec<Vec3>,
    lambda_bend: Vec<Vec3>,
    pub(super) lambda_fold: Vec<f64>,
    pub(super) x_hat: Vec<Vec3>,
    membrane: Vec<Vec3>,
    bend: Vec<Vec3>,
    pub(super) folds: Vec<f64>,
    holds: Vec<f64>,
    pub(super) contact: Vec<f64>,
    pub(super) normal: Vec<Vec3>,
    offset: Vec<f64>,
    pub(super) rest: &'b mut RestHat,
}

impl<S: Surface> Stepper<'_, S> {
    /// Turns `hat`, the gradients by the state after the step that is on `tape`, into those by the
    /// state before it, and adds those by the rest shape to `rest`. That step must have been the
    /// last.
    pub fn pull_back(&mut self, tape: &Tape, hat: &mut State, rest: &mut RestHat) {
        let count = tape.before.len();
        let mut before_hat = vec![Vec3::zeros(); count];
        for ((x, v), b) in hat.x.iter_mut().zip(&hat.v).zip(&mut before_hat) {
            *x += v * self.kept();
            *b -= v * self.kept();
        }
        self.pull_back_speed(tape, &mut hat.x, &mut before_hat);
        let mut back = Back {
            x: tape.swept.clone(),
            x_hat: std::mem::take(&mut hat.x),
            lambda_membrane: self.stretch.lambda(),
            lambda_bend: self.turn.lambda(),
            lambda_fold: self.lambda_fold.clone(),
            membrane: vec![Vec3::zeros(); self.cloth.triangles.len()],
            bend: vec![Vec3::zeros(); self.cloth.hinges.len()],
            folds: vec![0.0; self.lambda_fold.len()],
            holds: vec![0.0; self.lambda_hold.len()],
            contact: vec![0.0; tape.touching.len()],
            normal: vec![Vec3::zeros(); tape.touching.len()],
            offset: vec![0.0; tape.touching.len()],
            rest,
        };
        self.pull_back_rub(tape, &mut back, &mut before_hat);
        for sweep in (0..self.params.sweeps).rev() {
            self.pull_back_contact(tape, sweep, &mut back);
            self.pull_back_holds(tape, sweep, &mut back);
            self.pull_back_folds(tape, sweep, &mut back);
            self.pull_back_bend(tape, sweep, &mut back);
            self.pull_back_membrane(tape, sweep, &mut back);
        }
        self.pull_back_touching(tape, &back, &mut before_hat);
        hat.x = back.x_hat;
        for ((x, v), b) in hat.x.iter_mut().zip(&mut hat.v).zip(before_hat) {
            *v = *x * self.params.dt;
            *x += b;
        }
    }

    fn pull_back_speed(&self, tape: &Tape, x_hat: &mut [Vec3], before_hat: &mut [Vec3]) {
        let farthest = self.params.speed * self.params.dt;
        let moves = tape.swept.iter().zip(&tape.before);
        for ((hat, before_hat), (x, b)) in x_hat.iter_mut().zip(before_hat).zip(moves) {
            let moved = x - b;
            let length = moved.norm();
            if length > farthest {
                let across = *hat - moved * (moved.dot(hat) / (length * length));
                let by_move = across * (farthest / length);
                *before_hat += *hat - by_move;
                *hat = by_move;
            }
        }
    }

    /// With S(y) the matrix of [`symmetric`]: the visit moved corner a by w_a F S(Δλ) b_a.
    fn pull_back_membrane(&self, tape: &Tape, sweep: usize, back: &mut Back<'_>) {
        let order = self.stretch.order();
        let visits = &tape.membrane[sweep * order.len()..];
        let per_time = 1.0 / (self.params.dt * self.params.dt);
        let compliances: Vec<Mat3> = (self.cloth.materials.iter())
            .map(|material| inverse(&material.elasticity) * per_time)
            .collect();
        for (e, visit) in order.iter().zip(visits).rev() {
            let Some((f, delta)) = visit else {
                continue;
            };
            let e = *e as usize;
            let rest = &self.rest.triangles[e];
            let at = self.cloth.triangles[e].map(|a| a as usize);
            let w = at.map(|a| self.w[a]);
            let b = rest.gradients();
            let compliance = compliances[usize::from(self.cloth.material_of[e])];
            let alpha_tilde = compliance / rest.area;
            let b_squared = rest.weighted(w);
            let system = alpha_tilde + constraint_mass(f, &b_squared);
            let hats = at.map(|a| back.x_hat[a]);
            let lambda = back.lambda_membrane[e];
            back.lambda_membrane[e] -= delta;

            // x̂ pulled back to Δλ, and on to r.
            let p: Mat3x2 = (0..3).map(|i| hats[i] * (b[i] * w[i]).transpose()).sum();
            let fp = f.transpose() * p;
            let delta_hat = back.membrane[e] + Vec3::new(fp.m11, fp.m22, fp.m12 + fp.m21);
            let Some(r_hat) = solve_symmetric(&system, &delta_hat) else {
                continue;
            };
            back.membrane[e] -= alpha_tilde * r_hat;
            back.rest.area[e] += r_hat.dot(&(alpha_tilde * lambda)) / rest.area;

            let moves = constraint_gradient(f, delta);
            let turns = constraint_gradient(f, &r_hat);
            let (s_delta, s_r) = (symmetric(delta), symmetric(&r_hat));
            let against: [Vec3; 3] = std::array::from_fn(|i| hats[i] - turns * b[i]);
            let shifts: [Vec3; 3] = std::array::from_fn(|i| moves * (b[i] * w[i]));
            let f_hat = (p - turns * b_squared) * s_delta - (moves * b_squared + f) * s_r;
            let mut b_hat = [Vec2::zeros(); 3];
            for i in 0..3 {
                back.rest.w[at[i]] += against[i].dot(&(moves * b[i]));
                back.x[at[i]] -= shifts[i];
                back.x_hat[at[i]] += f_hat * b[i];
            }
            for i in 0..3 {
                b_hat[i] = s_delta * (f.transpose() * (against[i] * w[i]))
                    - s_r * (f.transpose() * shifts[i])
                    + f_hat.transpose() * back.x[at[i]];
            }
            let rows = [b_hat[1] - b_hat[0], b_hat[2] - b_hat[0]].map(|row| row.transpose());
            back.rest.inverse[e] += Mat2::from_rows(&rows);
        }
    }

    fn pull_back_bend(&self, tape: &Tape, sweep: usize, back: &mut Back<'_>) {
        let per_time = 1.0 / (self.params.dt * self.params.dt);
        let order = self.turn.order();
        let visits = &tape.bend[sweep * order.len()..];
        for (e, delta) in order.iter().zip(visits).rev() {
            let e = *e as usize;
            let rest = &self.rest.hinges[e];
            let at = self.cloth.hinges[e].vertices.map(|a| a as usize);
            let alpha_tilde = per_time / rest.stiffness;
            let mut inverse_mass = alpha_tilde;
            let mut delta_hat = back.bend[e];
            for (a, k) in at.into_iter().zip(rest.k) {
                inverse_mass += self.w[a] * k * k;
                delta_hat += back.x_hat[a] * (self.w[a] * k);
            }
            let r_hat = delta_hat / inverse_mass;
            let by_mass = -r_hat.dot(delta);
            let by_alpha = -r_hat.dot(&back.lambda_bend[e]);
            back.lambda_bend[e] -= delta;
            back.bend[e] -= r_hat * alpha_tilde;
            back.rest.stiffness[e] -= by_alpha * alpha_tilde / rest.stiffness;
            for (i, (a, k)) in at.into_iter().zip(rest.k).enumerate() {
                let along = delta.dot(&back.x_hat[a]);
                back.rest.w[a] += k * (along + by_mass * k);
                back.x[a] -= delta * (self.w[a] * k);
                back.rest.k[e][i] +=
                    self.w[a] * (along + 2.0 * by_mass * k) - r_hat.dot(&back.x[a]);
                back.x_hat[a] -= r_hat * k;
            }
        }
    }

    fn pull_back_holds(&mut self, tape: &Tape, sweep: usize, back: &mut Back<'_>) {
        let per_time = 1.0 / (self.params.dt * self.params.dt);
        let count = self.cloth.holds.len();
        for (e, hold) in self.cloth.holds.iter().enumerate().rev() {
            let delta = tape.holds[sweep * count + e];
            let a = hold.vertex as usize;
            let alpha_tilde = per_time / hold.stiffness;
            let y_hat = back.x_hat[a].y;
            let r_hat = (back.holds[e] + self.w[a] * y_hat) / (self.w[a] + alpha_tilde);
            back.holds[e] -= alpha_tilde * r_hat;
            back.rest.w[a] += delta * (y_hat - r_hat);
            back.x[a].y -= self.w[a] * delta;
            back.x_hat[a].y -= r_hat;
        }
    }

    fn pull_back_contact(&self, tape: &Tape, sweep: usize, back: &mut Back<'_>) {
        let count = tape.touching.len();
        for (e, touch) in tape.touching.iter().enumerate().rev() {
            let after = tape.contact[sweep * count + e];
            let before = if sweep == 0 {
                0.0
            } else {
                tape.contact[(sweep - 1) * count + e]
            };
            if after == 0.0 && before == 0.0 {
                // Apart before and after: nothing moved, and no λ is there to answer.
                back.contact[e] = 0.0;
                continue;
            }
            let delta = after - before;
            let mut delta_hat = 0.0;
            for (a, weight) in touch.point.parts() {
                let along = weight * touch.normal.dot(&back.x_hat[a]);
                delta_hat += self.w[a] * along;
                back.rest.w[a] += delta * along;
                back.normal[e] += back.x_hat[a] * (weight * self.w[a] * delta);
                back.x[a] -= touch.normal * (weight * self.w[a] * delta);
            }
            let after_hat = back.contact[e] + delta_hat;
            back.contact[e] = -delta_hat;
            if after > 0.0 {
                let w = touch.point.inverse_mass(&self.w);
                let squared = touch.normal.norm_squared();
                let r_hat = after_hat / (w * squared + touch.alpha_tilde);
                back.contact[e] += after_hat - touch.alpha_tilde * r_hat;
                back.normal[e] -= touch.point.at(&back.x) * r_hat;
                back.normal[e] -= touch.normal * (2.0 * w * r_hat * delta);
                back.offset[e] += r_hat;
                for (a, weight) in touch.point.parts() {
                    back.rest.w[a] -= weight * weight * squared * r_hat * delta;
                    back.x_hat[a] -= touch.normal * (weight * r_hat);
                }
            }
        }
    }

    /// Through normals and offsets of the contacts, to the positions before the step.
    fn pull_back_touching(&self, tape: &Tape, back: &Back<'_>, before_hat: &mut [Vec3]) {
        for (e, Touch { point, normal, .. }) in tape.touching.iter().enumerate() {
            let (n_hat, offset_hat) = (back.normal[e], back.offset[e]);
            if offset_hat == 0.0 && n_hat == Vec3::zeros() {
                continue;
            }
            let p = point.at(&tape.before);
            let Some((_, gradient)) = self.surface.distance(p) else {
                continue;
            };
            let n_hat = n_hat + p * offset_hat;
            let length = gradient.norm();
            let by_gradient = if length > CREASE {
                n_hat
            } else {
                (n_hat - normal * normal.dot(&n_hat)) / length
            };
            let p_hat = (normal - gradient) * offset_hat + self.surface.curvature(p) * by_gradient;
            for (a, weight) in point.parts() {
                before_hat[a] += p_hat * weight;
            }
        }
    }
}

/// 𝔻⁻¹ \[m/N\].
fn inverse(d: &Elasticity) -> Mat3 {
    let determinant = d.weft * d.warp - d.coupling * d.coupling;
    Mat3::new(
        d.warp / determinant,
        -d.coupling / determinant,
        0.0,
        -d.coupling / determinant,
        d.weft / determinant,
        0.0,
        0.0,
        0.0,
        1.0 / d.shear,
    )
}

impl RestHat {
    /// No gradient yet.
    pub fn none(cloth: &Cloth) -> Self {
        Self {
            inverse: vec![Mat2::zeros(); cloth.triangles.len()],
            area: vec![0.0; cloth.triangles.len()],
            k: vec![[0.0; 4]; cloth.hinges.len()],
            stiffness: vec![0.0; cloth.hinges.len()],
            fold: vec![0.0; cloth.folds.len()],
            w: vec![0.0; cloth.vertex_count],
        }
    }

    /// The gradient by the rest shape: masses grow with the areas about a vertex, m = Σ ρ Ā/3.
    pub fn pull_back(&self, cloth: &Cloth, rest: &Rest, x_bar: &[Vec2]) -> Vec<Vec2> {
        let mut hat = vec![Vec2::zeros(); x_bar.len()];
        for (e, t) in cloth.triangles.iter().enumerate() {
            let by_mass = |a: usize| -self.w[a] / (rest.mass[a] * rest.mass[a]);
            let masses: f64 = t.iter().map(|a| by_mass(*a as usize)).sum();
            let material = cloth.material(e);
            let area = self.area[e] + material.density / 3.0 * masses;
            let corners = rest.triangles[e].pull_back(&self.inverse[e], area);
            for (v, g) in cloth.rest_triangles[e]
                .iter()
                .zip(material.off_grain(corners))
            {
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
