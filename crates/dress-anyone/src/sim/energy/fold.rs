//! Pressed folds: a hinge that rests at an angle (METHOD §1.3 b; Bridson et al. 2003, Grinspun et al.
//! 2003), where [`super::bend`] rests flat.
//!
//! U = ½ w (θ − θ̄)² with w = φ B l̄²/(A₁+A₂): for φ = 1, θ̄ = 0 and small angles the energy of the flat
//! hinge; φ is how much firmer a pressed crease is than the cloth. θ is the angle by which side 1 is
//! turned out of the plane of side 0, positive towards the back of side 0, whose corners (x0, x1, x2) run
//! counter-clockwise seen from its front. It lies between −π and π, where the cloth would lie on itself,
//! and is not continued beyond.

use super::bend::Side;
use crate::geometry::{Mat3, Vec2, Vec3};

/// A fold at rest: shared edge (x0, x1), then the corners opposite to it on side 0 and side 1.
#[derive(Clone, Copy, Debug)]
pub struct RestFold {
    /// w \[N·m\].
    pub stiffness: f64,
    /// θ̄ \[rad\].
    pub angle: f64,
}

/// A side of the hinge as it is: edge e and opposite corner d from x0, and N = ±e × d.
struct Bent {
    e: Vec3,
    d: Vec3,
    /// N's sign.
    sign: f64,
    /// N/|N|² \[1/m²\].
    q: Vec3,
    /// With l = |e|, ∂θ/∂x = c l q: c is 1 − t, t and −1 for x0, x1 and the opposite corner, where
    /// t = d·e/l² is the place at which its height meets the edge.
    c: [f64; 3],
}

/// Which corners belong to each side.
const CORNERS: [[usize; 3]; 2] = [[0, 1, 2], [0, 1, 3]];
/// What e and d are of (x0, x1, opposite).
const OF_E: [f64; 3] = [-1.0, 1.0, 0.0];
const OF_D: [f64; 3] = [-1.0, 0.0, 1.0];

impl Bent {
    fn new(x: [Vec3; 4], side: usize) -> Self {
        let (e, d) = (x[1] - x[0], x[2 + side] - x[0]);
        let sign = if side == 0 { 1.0 } else { -1.0 };
        let normal = e.cross(&d) * sign;
        let t = d.dot(&e) / e.norm_squared();
        Self {
            e,
            d,
            sign,
            q: normal / normal.norm_squared(),
            c: [1.0 - t, t, -1.0],
        }
    }

    /// The derivative of c_a l q by corner b.
    fn turn(&self, a: usize, b: usize) -> Mat3 {
        let Self { e, d, q, .. } = self;
        let (length, t) = (e.norm(), self.c[1]);
        let along = e / length;
        let normal_by = (e.cross_matrix() * OF_D[b] - d.cross_matrix() * OF_E[b]) * self.sign;
        let q_by = (Mat3::identity() * q.norm_squared() - q * q.transpose() * 2.0) * normal_by;
        let t_by =
            (e * OF_D[b] + d * OF_E[b]) / (length * length) - along * (2.0 * t * OF_E[b] / length);
        let c_by = t_by * [-1.0, 1.0, 0.0][a];
        let c_l_by = c_by * length + along * (self.c[a] * OF_E[b]);
        q * c_l_by.transpose() + q_by * (self.c[a] * length)
    }
}

/// θ \[rad\].
pub fn angle(x: [Vec3; 4]) -> f64 {
    let [n0, n1] = [0, 1].map(|side| Bent::new(x, side).q);
    let e = x[1] - x[0];
    (n0.cross(&n1).dot(&e) / e.norm()).atan2(n0.dot(&n1))
}

/// ∂θ/∂x \[1/m\].
pub fn gradient(x: [Vec3; 4]) -> [Vec3; 4] {
    let mut gradient = [Vec3::zeros(); 4];
    for (side, corners) in CORNERS.iter().enumerate() {
        let bent = Bent::new(x, side);
        for (a, c) in corners.iter().zip(bent.c) {
            gradient[*a] += bent.q * (c * bent.e.norm());
        }
    }
    gradient
}

/// ∂²θ/∂x² \[1/m²\], blocks `[a][b]`.
pub fn hessian(x: [Vec3; 4]) -> [[Mat3; 4]; 4] {
    let mut blocks = [[Mat3::zeros(); 4]; 4];
    for (side, corners) in CORNERS.iter().enumerate() {
        let bent = Bent::new(x, side);
        for a in 0..3 {
            for b in 0..3 {
                blocks[corners[a]][corners[b]] += bent.turn(a, b);
            }
        }
    }
    blocks
}

impl RestFold {
    /// From each side's rest corners (p0, p1, opposite), φ B \[N·m\] and the rest angle \[rad\].
    pub fn new(corners: [[Vec2; 3]; 2], rigidity: f64, angle: f64) -> Self {
        let [a, b] = corners.map(Side::new);
        let mean = 0.5 * (a.length + b.length);
        Self {
            stiffness: rigidity * mean * mean / (a.area + b.area),
            angle,
        }
    }

    /// Gradient by the rest corners of both sides of a function whose gradient by the stiffness is
    /// given.
    pub fn pull_back(&self, corners: [[Vec2; 3]; 2], by_stiffness: f64) -> [[Vec2; 3]; 2] {
        let sides = corners.map(Side::new);
        let hat = by_stiffness * self.stiffness;
        let by_length = 2.0 * hat / (sides[0].length + sides[1].length);
        let by_area = -hat / (sides[0].area + sides[1].area);
        sides.map(|side| side.pull_back(by_length, by_area, 0.0))
    }

    /// U \[J\].
    pub fn energy(&self, x: [Vec3; 4]) -> f64 {
        let off = angle(x) - self.angle;
        0.5 * self.stiffness * off * off
    }

    /// −∂U/∂x \[N\].
    pub fn force(&self, x: [Vec3; 4]) -> [Vec3; 4] {
        let moment = self.stiffness * (self.angle - angle(x));
        gradient(x).map(|g| g * moment)
    }

    /// ∂²U/∂x² \[N/m\], blocks `[a][b]`, with the part `exactness` of what can make it indefinite: 1 is
    /// exact, 0 positive semi-definite.
    pub fn stiffness(&self, x: [Vec3; 4], exactness: f64) -> [[Mat3; 4]; 4] {
        let g = gradient(x);
        let moment = exactness * self.stiffness * (angle(x) - self.angle);
        let turning = hessian(x);
        std::array::from_fn(|a| {
            std::array::from_fn(|b| {
                g[a] * g[b].transpose() * self.stiffness + turning[a][b] * moment
            })
        })
    }
}

/// Gradient of λ·f by the rest corners of both sides.
pub fn rest_pull_back(
    rest: &RestFold,
    corners: [[Vec2; 3]; 2],
    x: [Vec3; 4],
    lambda: [Vec3; 4],
) -> [[Vec2; 3]; 2] {
    let g = gradient(x);
    let along: f64 = (0..4).map(|a| g[a].dot(&lambda[a])).sum();
    rest.pull_back(corners, (rest.angle - angle(x)) * along)
}

/// Change of the forces under a motion `delta` of the rest corners of both sides, at fixed x.
pub fn rest_push_forward(
    rest: &RestFold,
    corners: [[Vec2; 3]; 2],
    x: [Vec3; 4],
    delta: [[Vec2; 3]; 2],
) -> [Vec3; 4] {
    let sides = corners.map(Side::new);
    let d: [_; 2] = std::array::from_fn(|i| sides[i].push_forward(delta[i]));
    let longer = 2.0 * (d[0].0 + d[1].0) / (sides[0].length + sides[1].length);
    let larger = (d[0].1 + d[1].1) / (sides[0].area + sides[1].area);
    let moment = rest.stiffness * (longer - larger) * (rest.angle - angle(x));
    gradient(x).map(|g| g * moment)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};
    use crate::sim::energy::bend::RestHinge;
    use approx::assert_relative_eq;

    /// Side 0 in the plane y > 0 with its front up, side 1 turned by θ towards its back.
    fn folded(theta: f64) -> [Vec3; 4] {
        [
            Vec3::zeros(),
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.7, 1.0, 0.0),
            Vec3::new(1.2, -0.8 * theta.cos(), -0.8 * theta.sin()),
        ]
    }

    const REST: [[Vec2; 3]; 2] = [
        [
            Vec2::new(0.0, 0.0),
            Vec2::new(2.0, 0.0),
            Vec2::new(0.7, 1.0),
        ],
        [
            Vec2::new(0.0, 0.1),
            Vec2::new(2.1, 0.0),
            Vec2::new(1.2, -0.8),
        ],
    ];

    fn quad<T>(f: impl Fn(usize) -> T) -> [T; 4] {
        std::array::from_fn(f)
    }

    fn vectors(seed: usize, size: f64) -> [Vec3; 4] {
        quad(|a| Vec3::from_fn(|c, _| size * noise(seed + 3 * a + c)))
    }

    fn dot(a: [Vec3; 4], b: [Vec3; 4]) -> f64 {
        a.iter().zip(&b).map(|(a, b)| a.dot(b)).sum()
    }

    /// Out of shape, too.
    fn crumpled(theta: f64, seed: usize) -> [Vec3; 4] {
        let (x, off) = (folded(theta), vectors(seed, 0.2));
        quad(|a| x[a] + off[a])
    }

    #[test]
    fn the_angle_is_that_by_which_one_side_is_turned_towards_the_back() {
        for theta in [-3.1, -1.0, 0.0, 0.4, 2.0, 3.1] {
            assert_relative_eq!(angle(folded(theta)), theta, epsilon = 1e-12);
        }
    }

    #[test]
    fn gradient_and_hessian_are_derivatives_of_the_angle() {
        for (i, theta) in [-2.5, -0.3, 0.8, 2.8].into_iter().enumerate() {
            let x = crumpled(theta, 40 * i);
            let (d, q) = (vectors(200 + i, 1.0), vectors(300 + i, 1.0));
            let at = |s: f64| quad(|a| x[a] + d[a] * s);
            assert_derivative(|s| angle(at(s)), dot(gradient(x), d), 1e-5, 1e-2, 1e-8);
            let h = hessian(x);
            let mut bilinear = 0.0;
            for a in 0..4 {
                for b in 0..4 {
                    bilinear += q[a].dot(&(h[a][b] * d[b]));
                    let error = (h[a][b] - h[b][a].transpose()).norm();
                    assert!(error < 1e-12 * h[a][b].norm().max(1.0), "symmetric");
                }
            }
            assert_derivative(|s| dot(gradient(at(s)), q), bilinear, 1e-5, 1e-2, 1e-8);
        }
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        let rest = RestFold::new(REST, 3.0, 2.9);
        for (i, theta) in [-0.5, 0.1, 2.6].into_iter().enumerate() {
            let x = crumpled(theta, 60 * i);
            let (d, q) = (vectors(500 + i, 1.0), vectors(600 + i, 1.0));
            let at = |s: f64| quad(|a| x[a] + d[a] * s);
            let slope = -dot(rest.force(x), d);
            assert_derivative(|s| rest.energy(at(s)), slope, 1e-5, 1e-2, 1e-8);
            let along = |exactness| -> f64 {
                let k = rest.stiffness(x, exactness);
                let row = |a: usize| (0..4).map(|b| q[a].dot(&(k[a][b] * d[b]))).sum::<f64>();
                (0..4).map(row).sum()
            };
            let pull = |s: f64| -dot(rest.force(at(s)), q);
            assert_derivative(pull, along(1.0), 1e-5, 1e-2, 1e-8);
            let k = rest.stiffness(x, 0.0);
            let quadratic: f64 = (0..16)
                .map(|i| d[i / 4].dot(&(k[i / 4][i % 4] * d[i % 4])))
                .sum();
            assert!(quadratic >= 0.0);
        }
    }

    #[test]
    fn a_fold_that_rests_flat_is_a_hinge_for_small_angles() {
        let flat = [REST[0], [REST[0][0], REST[0][1], REST[1][2]]];
        let (fold, hinge) = (RestFold::new(flat, 2.0, 0.0), RestHinge::new(flat, 2.0));
        let x = folded(1e-3);
        // The hinge measures 2 sin(θ/2): the difference is θ²/24 of its square.
        assert_relative_eq!(fold.energy(x), hinge.energy(x), max_relative = 1e-6);
    }

    #[test]
    fn rest_derivatives_agree_with_differences_and_with_each_other() {
        for seed in 0..5 {
            let (x, lambda) = (crumpled(0.6, 17 * seed), vectors(900 + seed, 1.0));
            let delta: [[Vec2; 3]; 2] = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    Vec2::new(noise(seed + 5 * i + j), noise(seed + 60 + 3 * i + j))
                })
            });
            let moved = |s: f64| -> [[Vec2; 3]; 2] {
                std::array::from_fn(|i| std::array::from_fn(|j| REST[i][j] + delta[i][j] * s))
            };
            let at = |s: f64| RestFold::new(moved(s), 2.0, 2.5);
            let rest = at(0.0);
            let hat = rest_pull_back(&rest, REST, x, lambda);
            let pairs = hat.iter().flatten().zip(delta.iter().flatten());
            let pulled: f64 = pairs.map(|(h, d)| h.dot(d)).sum();
            assert_derivative(|s| dot(at(s).force(x), lambda), pulled, 1e-6, 1e-2, 1e-7);
            let pushed = rest_push_forward(&rest, REST, x, delta);
            assert_relative_eq!(dot(pushed, lambda), pulled, max_relative = 1e-9);
        }
    }
}
