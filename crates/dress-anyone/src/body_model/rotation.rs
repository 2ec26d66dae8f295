//! Rotations by axis and angle, and how they answer to a change: R(θ + δ) ≈ exp(J_l(θ) δ) R(θ) with
//! the left Jacobian J_l = I + (1 − cos φ)/φ² [θ]ₓ + (φ − sin φ)/φ³ [θ]ₓ², φ = |θ|.

use crate::geometry::{Mat3, Vec3};

/// exp [θ]ₓ (Rodrigues).
pub(super) fn rotation(theta: Vec3) -> Mat3 {
    *nalgebra::Rotation3::new(theta).matrix()
}

/// J_l(θ): turns a change of θ into an angular velocity.
pub(super) fn left_jacobian(theta: Vec3) -> Mat3 {
    let cross = theta.cross_matrix();
    let angle = theta.norm();
    let squared = angle * angle;
    let (first, second) = if angle < SMALL {
        (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        (
            (1.0 - angle.cos()) / squared,
            (angle - angle.sin()) / (squared * angle),
        )
    };
    Mat3::identity() + cross * first + cross * cross * second
}

/// Below this angle \[rad\] the series' next term, φ⁴/5040, is below round-off.
const SMALL: f64 = 1e-3;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{STEP, assert_derivative, noise};

    #[test]
    fn the_left_jacobian_is_the_derivative_of_the_rotation() {
        for (i, size) in [0.0, 1e-4, 9e-4, 2e-3, 1.0, 3.1].into_iter().enumerate() {
            let vector = |seed| Vec3::from_fn(|c, _| noise(seed + c));
            let theta = vector(3 * i).normalize() * size;
            let (delta, probe) = (vector(100 + 3 * i), vector(200 + 3 * i));
            let aim = vector(300 + 3 * i);
            let turned = |s: f64| aim.dot(&(rotation(theta + delta * s) * probe));
            let slope = aim.dot(&(left_jacobian(theta) * delta).cross(&(rotation(theta) * probe)));
            // Central differences of values of order one: about 1e-10.
            assert_derivative(turned, slope, STEP, 1.0, 1e-8);
        }
    }
}
