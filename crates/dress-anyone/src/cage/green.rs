//! Green coordinates of the plane, as complex barycentric coordinates.
//!
//! A point z inside a counter-clockwise cage z_j is carried along by `X̄ = Σ_j C_j(z) ζ_j` with the
//! constant complex numbers
//!
//! `2πi C_j = (B_{j+1}/A_{j+1}) Λ_j − (B_{j−1}/A_j) Λ_{j−1}`,
//! `A_j = z_j − z_{j−1}`, `B_j = z_j − z`, `Λ_j = log(B_{j+1}/B_j)`
//!
//! (Weber, Ben-Chen, Gotsman 2009, Cauchy coordinates). They are the vertex and normal coordinates of
//! Lipman, Levin, Cohen-Or 2008, the paper's §4.3, with the normals scaled by the stretch of their
//! edge; the map is holomorphic, hence conformal, and linear in ζ. Outside the cage it is zero.

use num_complex::Complex64;
use std::f64::consts::TAU;

/// `C_j(z)` \[–\] of a point strictly inside the counter-clockwise cage `control` \[m\].
pub fn coordinates(control: &[Complex64], z: Complex64) -> Vec<Complex64> {
    let mut c = vec![Complex64::ZERO; control.len()];
    for side in sides(control, z) {
        let [from, to] = side.ends;
        c[from] += (control[to] - z) / side.along * side.share;
        c[to] -= (control[from] - z) / side.along * side.share;
    }
    c
}

/// `dC_j/dz` \[1/m\], so that the map's complex derivative is `F'(z) = Σ_j C'_j(z) ζ_j`: its modulus
/// is the local scale, its argument the local rotation.
pub fn slopes(control: &[Complex64], z: Complex64) -> Vec<Complex64> {
    let mut d = vec![Complex64::ZERO; control.len()];
    for side in sides(control, z) {
        let [from, to] = side.ends;
        d[from] -= side.share / side.along;
        d[to] += side.share / side.along;
    }
    d
}

/// A side of the cage as seen from a point.
struct Side {
    ends: [usize; 2],
    /// From the first end to the second.
    along: Complex64,
    /// `Λ/2πi`; its real part is the part of a full turn that the side spans.
    share: Complex64,
}

fn sides(control: &[Complex64], z: Complex64) -> impl Iterator<Item = Side> + '_ {
    (0..control.len()).map(move |from| {
        let to = (from + 1) % control.len();
        let ratio = (control[to] - z) / (control[from] - z);
        Side {
            ends: [from, to],
            along: control[to] - control[from],
            share: ratio.ln() / Complex64::new(0.0, TAU),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use proptest::prelude::*;
    use std::f64::consts::PI;

    fn at(x: f64, y: f64) -> Complex64 {
        Complex64::new(x, y)
    }

    /// A concave cage with a notch from above.
    fn notched() -> Vec<Complex64> {
        [
            (-1.0, -1.2),
            (1.3, -0.9),
            (1.1, 0.8),
            (0.1, 0.6),
            (-0.2, 1.6),
            (-1.2, 0.7),
        ]
        .map(|(x, y)| at(x, y))
        .to_vec()
    }

    fn moved(control: &[Complex64], by: f64) -> Vec<Complex64> {
        let shake = |i: usize| by * at(noise(2 * i), noise(2 * i + 1));
        control
            .iter()
            .enumerate()
            .map(|(i, c)| c + shake(i))
            .collect()
    }

    fn sum(weights: &[Complex64], zeta: &[Complex64]) -> Complex64 {
        weights.iter().zip(zeta).map(|(w, z)| w * z).sum()
    }

    /// The closed form of Lipman et al. 2008: φ weighs the vertices, ψ the outward unit normals.
    fn vertex_and_normal_form(control: &[Complex64], eta: Complex64) -> (Vec<f64>, Vec<f64>) {
        let n = control.len();
        let (mut phi, mut psi) = (vec![0.0; n], vec![0.0; n]);
        let dot = |p: Complex64, q: Complex64| (p * q.conj()).re;
        for j in 0..n {
            let (a, b) = (control[(j + 1) % n] - control[j], control[j] - eta);
            let (q, s, r) = (dot(a, a), dot(b, b), 2.0 * dot(a, b));
            let ba = dot(b, -Complex64::I * a);
            let root = (4.0 * s * q - r * r).sqrt();
            let (l0, l1) = (s.ln(), (s + q + r).ln());
            let (a0, a1) = (r.atan2(root) / root, (2.0 * q + r).atan2(root) / root);
            let (a10, l10) = (a1 - a0, l1 - l0);
            psi[j] = -a.norm() / (4.0 * PI)
                * ((4.0 * s - r * r / q) * a10 + r / (2.0 * q) * l10 + l1 - 2.0);
            phi[(j + 1) % n] += ba / TAU * (l10 / (2.0 * q) - a10 * r / q);
            phi[j] -= ba / TAU * (l10 / (2.0 * q) - a10 * (2.0 + r / q));
        }
        (phi, psi)
    }

    proptest! {
        #[test]
        fn they_are_lipmans_with_stretched_normals(x in -0.7..0.7, y in -0.7..0.5) {
            let (control, z) = (notched(), at(x, y));
            let zeta = moved(&control, 0.3);
            let (phi, psi) = vertex_and_normal_form(&control, z);
            let n = control.len();
            let lipman: Complex64 = (0..n)
                .map(|j| {
                    let edge = control[(j + 1) % n] - control[j];
                    let deformed = zeta[(j + 1) % n] - zeta[j];
                    phi[j] * zeta[j] + psi[j] * (-Complex64::I * deformed / edge.norm())
                })
                .sum();
            // Round-off of a dozen terms of order one.
            prop_assert!((sum(&coordinates(&control, z), &zeta) - lipman).norm() < 1e-12);
        }

        #[test]
        fn similarities_are_reproduced(re in -2.0..2.0, im in -2.0..2.0, x in -0.7..0.7, y in -0.7..0.5) {
            let (control, z, a) = (notched(), at(x, y), at(re, im));
            let zeta: Vec<_> = control.iter().map(|c| a * c + at(0.3, -0.7)).collect();
            prop_assert!((sum(&coordinates(&control, z), &zeta) - (a * z + at(0.3, -0.7))).norm() < 1e-12);
            prop_assert!((sum(&slopes(&control, z), &zeta) - a).norm() < 1e-12);
        }

        #[test]
        fn the_map_is_conformal_with_the_stated_derivative(x in -0.6..0.6, y in -0.6..0.4) {
            let (control, h) = (notched(), 1e-5);
            let zeta = moved(&control, 0.4);
            let map = |dx: f64, dy: f64| sum(&coordinates(&control, at(x + dx, y + dy)), &zeta);
            let along_x = (map(h, 0.0) - map(-h, 0.0)) / (2.0 * h);
            let along_y = (map(0.0, h) - map(0.0, -h)) / (2.0 * h);
            let slope = sum(&slopes(&control, at(x, y)), &zeta);
            // Central differences: h² |F'''| / 6 with |F'''| < 1e2 this far from the cage.
            prop_assert!((along_x - slope).norm() < 1e-8);
            prop_assert!((along_y - Complex64::I * slope).norm() < 1e-8); // Cauchy–Riemann
        }
    }

    #[test]
    fn outside_the_cage_the_map_is_zero() {
        let sum: Complex64 = coordinates(&notched(), at(0.5, 1.5)).iter().sum();
        assert!(sum.norm() < 1e-12);
    }
}
