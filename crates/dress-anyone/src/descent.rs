//! How a search descends. Here Levenberg–Marquardt steps over plain vectors, which know nothing of
//! garments (METHOD §6.2); steps by the gradient alone are in [`slope`].
//!
//! The loss is a sum of squared residuals R(p). With J = ∂R/∂p, H = JᵀJ and g = JᵀR, the step is
//! d = −(H + μ diag H + μ ε I)⁻¹ g, the small ε for directions that change nothing.

pub mod slope;

use crate::problem::Problem;
use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

/// What makes the steps.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Optimizer {
    /// Levenberg–Marquardt: needs the drape's answer to every unknown, and few drapes.
    #[default]
    Lm,
    /// Limited-memory BFGS: needs the gradient alone.
    Lbfgs,
    /// Gradient descent with backtracking, as in the paper.
    Descent,
}

/// Where derivatives of the drape come from.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Gradient {
    /// The state of rest: one solve.
    #[default]
    Equilibrium,
    /// The steps that led to where the cloth is after `sim.step.time`, as in the paper.
    Trajectory,
}

/// How to descend.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct DescentParams {
    /// What makes the steps: `lm`, `lbfgs`, or the paper's `descent`.
    pub optimizer: Optimizer,
    /// Where derivatives of the drape come from: `equilibrium`, or the paper's `trajectory`, which
    /// goes with `lbfgs` and `descent`.
    pub gradient: Gradient,
    /// Largest number of accepted steps in free cloth. Each costs a drape; the paper's gradient descent
    /// takes hundreds.
    pub iterations: usize,
    /// Largest number of drapes refused in a row before the search is called stalled.
    pub refusals: usize,
    /// Most factorisations that the drape after a step may take: one that takes more is refused.
    pub patience: usize,
    /// First damping μ \[–\].
    pub damping: f64,
    /// Farthest any pattern vertex moves in one step \[m\]: a drape's derivative is to be trusted
    /// for one or two percent of a panel.
    pub step: f64,
    /// Converged when a step of `lm`, or two of another in a row, lower the loss by less than this part,
    /// or when by the gradient none lowers it by more \[–\].
    pub tolerance: f64,
    /// Converged when no pattern vertex moves farther than this in a step \[m\].
    pub least_step: f64,
}

impl Default for DescentParams {
    fn default() -> Self {
        Self {
            optimizer: Optimizer::default(),
            gradient: Gradient::default(),
            iterations: 40,
            refusals: 6,
            patience: 100,
            damping: 1e-2,
            step: 0.03,
            tolerance: 2e-3,
            least_step: 2e-4,
        }
    }
}

impl DescentParams {
    /// What does not go together.
    pub fn problems(&self) -> Vec<Problem> {
        if self.optimizer == Optimizer::Lm && self.gradient == Gradient::Trajectory {
            let text = "`trajectory` gives a gradient, and `lm` needs more; choose the optimizer \
                        `lbfgs` or `descent`, or the gradient `equilibrium`";
            return vec![Problem::at("descent parameter `gradient`", text)];
        }
        Vec::new()
    }
}

/// Residuals taken together: enough to multiply matrices rather than vectors.
const CHUNK: usize = 2048;

/// The quadratic model of the loss at one point.
#[derive(Clone, Debug)]
pub struct Model {
    h: DMatrix<f64>,
    g: DVector<f64>,
}

impl Model {
    /// From `count` residuals by `unknowns`: `fill(i, row)` writes ∂Rᵢ/∂p into a row of zeros and
    /// returns Rᵢ. The Jacobian is never held whole.
    pub fn new(
        count: usize,
        unknowns: usize,
        mut fill: impl FnMut(usize, &mut [f64]) -> f64,
    ) -> Self {
        let mut h = DMatrix::zeros(unknowns, unknowns);
        let mut g = DVector::zeros(unknowns);
        let mut first = 0;
        while first < count {
            let rows = CHUNK.min(count - first);
            // Column i of the transposed chunk is residual first + i.
            let mut transposed = DMatrix::zeros(unknowns, rows);
            let mut residuals = DVector::zeros(rows);
            for (i, mut column) in transposed.column_iter_mut().enumerate() {
                residuals[i] = fill(first + i, column.as_mut_slice());
            }
            h.gemm(1.0, &transposed, &transposed.transpose(), 1.0);
            g.gemv(1.0, &transposed, &residuals, 1.0);
            first += rows;
        }
        Self { h, g }
    }

    /// ‖∂L/∂p‖ of the loss L = RᵀR.
    pub fn gradient_norm(&self) -> f64 {
        2.0 * self.g.norm()
    }

    /// ½ ∂L/∂p of the loss L = RᵀR.
    pub fn half_gradient(&self) -> &DVector<f64> {
        &self.g
    }

    /// H⁻¹ `by`; of what nothing determines, a great deal.
    pub fn undamped(&self, by: &DVector<f64>) -> DVector<f64> {
        let mut h = self.h.clone();
        let mean = h.diagonal().sum() / by.len() as f64;
        for i in 0..by.len() {
            h[(i, i)] += 1e-9 * mean;
        }
        let definite = h.cholesky();
        definite.map_or(by * f64::INFINITY, |h| h.solve(by))
    }

    /// By how much the loss falls along `step`.
    pub fn promise(&self, step: &DVector<f64>) -> f64 {
        -(2.0 * self.g.dot(step) + step.dot(&(&self.h * step)))
    }

    /// The step for damping `mu`; none if the model is not finite.
    pub fn step(&self, mu: f64) -> Option<DVector<f64>> {
        let n = self.g.len();
        let mean = self.h.diagonal().sum() / n as f64;
        let mut damped = self.h.clone();
        for i in 0..n {
            damped[(i, i)] += mu * self.h[(i, i)] + mu * 1e-6 * mean;
        }
        Some(damped.cholesky()?.solve(&-&self.g))
    }
}

/// The damping μ, as steps succeed and fail.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Damping(pub f64);

impl Damping {
    /// A step lowered the loss: trust the model more.
    pub fn relax(&mut self) {
        self.0 = (self.0 / 5.0).max(1e-8);
    }

    /// A step failed: trust the model less.
    pub fn tighten(&mut self) {
        self.0 *= 6.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn model(j: &DMatrix<f64>, r: &DVector<f64>) -> Model {
        Model::new(j.nrows(), j.ncols(), |i, row| {
            row.copy_from_slice(j.row(i).transpose().as_slice());
            r[i]
        })
    }

    #[test]
    fn linear_residuals_are_solved_in_one_undamped_step() {
        let j = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 0.5, -1.0, 3.0, 0.2]);
        let solution = DVector::from_row_slice(&[0.7, -0.4]);
        let model = model(&j, &(-&j * &solution));
        let step = model.step(0.0).expect("full rank");
        // What it promises is all of the loss.
        let all = (&j * &solution).norm_squared();
        assert!((model.promise(&step) - all).abs() < 1e-12 * all);
        assert!((step - solution).norm() < 1e-12);
    }

    #[test]
    fn a_direction_that_changes_nothing_is_not_taken() {
        let j = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 2.0, 0.0]);
        let model = model(&j, &DVector::from_row_slice(&[1.0, 1.0]));
        let step = model.step(1e-2).expect("damped");
        assert_eq!(step[1], 0.0);
        assert!(step[0] < 0.0);
    }

    #[test]
    fn rosenbrock_is_solved_with_the_damping_rule() {
        let residuals =
            |p: &DVector<f64>| DVector::from_row_slice(&[1.0 - p[0], 10.0 * (p[1] - p[0] * p[0])]);
        let mut p = DVector::from_row_slice(&[-1.2, 1.0]);
        let mut damping = Damping(1e-2);
        for _ in 0..60 {
            let j = DMatrix::from_row_slice(2, 2, &[-1.0, 0.0, -20.0 * p[0], 10.0]);
            let r = residuals(&p);
            let step = model(&j, &r).step(damping.0).expect("damped");
            let next = &p + step;
            if residuals(&next).norm() < r.norm() {
                p = next;
                damping.relax();
            } else {
                damping.tighten();
            }
        }
        assert!((p - DVector::from_row_slice(&[1.0, 1.0])).norm() < 1e-9);
    }
}
