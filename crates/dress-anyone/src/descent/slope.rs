//! Descent by the gradient alone: the paper's plain one (§4.6), and L-BFGS (Nocedal & Wright 2006,
//! algorithms 7.4 and 7.5), over plain vectors.
//!
//! L-BFGS keeps the last steps s and changes of the gradient y. Its direction is −H g, where H is
//! (sᵀy/yᵀy) I, improved by each kept pair in turn so that H y = s. Plain descent keeps none. How
//! long a step may be is for the caller to try; [`Slope::length`] is where to begin.

use nalgebra::DVector;
use serde::{Deserialize, Serialize};
use std::collections::VecDeque;

/// Pairs that L-BFGS keeps; more hardly help where the loss is not smooth.
const KEPT: usize = 10;

/// Where to go next, as a search by gradients learns it.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Slope {
    /// Largest number of pairs kept: none for plain descent.
    most: usize,
    /// (s, y), oldest first.
    pairs: VecDeque<(DVector<f64>, DVector<f64>)>,
    /// Length of the next step along a normalised direction, in the caller's measure, where the
    /// direction does not tell: twice what last succeeded.
    pub length: f64,
}

impl Slope {
    /// Plain descent, whose first step is as long as this.
    pub fn steepest(length: f64) -> Self {
        Self {
            most: 0,
            pairs: VecDeque::new(),
            length,
        }
    }

    /// L-BFGS, whose first step is as long as this.
    pub fn lbfgs(length: f64) -> Self {
        Self {
            most: KEPT,
            ..Self::steepest(length)
        }
    }

    /// Where to go from a point of this gradient; always downhill.
    pub fn direction(&self, gradient: &DVector<f64>) -> DVector<f64> {
        let mut q = gradient.clone();
        let mut along = Vec::new();
        for (s, y) in self.pairs.iter().rev() {
            let alpha = s.dot(&q) / s.dot(y);
            q.axpy(-alpha, y, 1.0);
            along.push(alpha);
        }
        if let Some((s, y)) = self.pairs.back() {
            q *= s.dot(y) / y.norm_squared();
        }
        for ((s, y), alpha) in self.pairs.iter().zip(along.into_iter().rev()) {
            let beta = y.dot(&q) / s.dot(y);
            q.axpy(alpha - beta, s, 1.0);
        }
        -q
    }

    /// Whether the direction's own length means something: that of a Newton step.
    pub fn knows_length(&self) -> bool {
        !self.pairs.is_empty()
    }

    /// A step s changed the gradient by y. Where the loss is not convex along it nothing is learned.
    pub fn learn(&mut self, s: DVector<f64>, y: DVector<f64>) {
        if self.most == 0 || !(s.dot(&y) > 1e-10 * s.norm() * y.norm()) {
            return;
        }
        if self.pairs.len() == self.most {
            self.pairs.pop_front();
        }
        self.pairs.push_back((s, y));
    }

    /// Whether what it learned has so many unknowns.
    pub fn is_of(&self, unknowns: usize) -> bool {
        let right = |v: &DVector<f64>| v.len() == unknowns;
        self.pairs.iter().all(|(s, y)| right(s) && right(y))
    }

    /// No step along the direction helped: begins anew with the gradient. Whether that is something
    /// else.
    pub fn forget(&mut self) -> bool {
        let had = self.knows_length();
        self.pairs.clear();
        had
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn rosenbrock(p: &DVector<f64>) -> (f64, DVector<f64>) {
        let (a, b) = (1.0 - p[0], p[1] - p[0] * p[0]);
        let gradient = DVector::from_row_slice(&[-2.0 * a - 400.0 * p[0] * b, 200.0 * b]);
        (a * a + 100.0 * b * b, gradient)
    }

    /// The loss after at most `steps` steps with backtracking.
    fn descend(mut slope: Slope, steps: usize) -> f64 {
        let mut p = DVector::from_row_slice(&[-1.2, 1.0]);
        for _ in 0..steps {
            let (loss, gradient) = rosenbrock(&p);
            let mut step = slope.direction(&gradient);
            if !slope.knows_length() {
                step *= slope.length / step.norm();
            }
            while rosenbrock(&(&p + &step)).0 > loss + 1e-4 * gradient.dot(&step) {
                step *= 0.5;
                if step.norm() < 1e-12 {
                    return loss;
                }
            }
            slope.length = 2.0 * step.norm();
            p += &step;
            slope.learn(step, rosenbrock(&p).1 - gradient);
        }
        rosenbrock(&p).0
    }

    #[test]
    fn lbfgs_solves_rosenbrock_where_plain_descent_only_falls() {
        let first = 24.2;
        let plain = descend(Slope::steepest(0.1), 60);
        assert!(plain < 0.2 * first, "{plain}");
        let lbfgs = descend(Slope::lbfgs(0.1), 60);
        // A Newton-like method squares its error near the end.
        assert!(lbfgs < 1e-12 && plain > 1e-4, "{lbfgs} {plain}");
    }

    #[test]
    fn the_last_pair_is_honoured_exactly() {
        let mut slope = Slope::lbfgs(1.0);
        let s = DVector::from_row_slice(&[0.3, -0.1, 0.7]);
        let y = DVector::from_row_slice(&[1.0, 0.2, 2.0]);
        slope.learn(
            DVector::from_row_slice(&[1.0, 2.0, 0.0]),
            DVector::from_row_slice(&[2.0, 1.0, 1.0]),
        );
        slope.learn(s.clone(), y.clone());
        // The secant equation H y = s.
        assert!((slope.direction(&y) + s).norm() < 1e-12);
    }

    #[test]
    fn a_step_over_a_ridge_teaches_nothing() {
        let mut slope = Slope::lbfgs(1.0);
        let s = DVector::from_row_slice(&[1.0, 0.0]);
        slope.learn(s.clone(), -s.clone());
        assert!(!slope.knows_length());
        assert_eq!(slope.direction(&s), -s);
    }
}
