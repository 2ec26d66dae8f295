//! Bending: quadratic isometric bending over the hinges of the welded mesh (Bergou et al. 2006;
//! Wardetzky et al. 2007), linear in x, so that the same energy serves XPBD and Newton.
//!
//! c = Σ k_a x_a with |c| = 2 l̄ sin(θ/2) for isometric states, U = ½ B/(A₁+A₂) |c|². With the factor
//! 1/(A₁+A₂) a cylinder's energy is ½ B κ² per area; the 3/(A₁+A₂) of the literature is three
//! times too stiff (a test below holds this). Each side of a hinge takes its rest data from its own
//! panel, so seams bend too.

use crate::geometry::{Vec2, Vec3, cross2};

/// A hinge at rest: shared edge (x0, x1), then the corners opposite to it on side 0 and side 1.
#[derive(Clone, Copy, Debug)]
pub struct RestHinge {
    /// k_a \[–\]; they sum to zero.
    pub k: [f64; 4],
    /// B/(A₁+A₂) \[N/m\].
    pub stiffness: f64,
}

/// What the formulas need of one side: rest edge e and opposite corner w, both from p0.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side {
    e: Vec2,
    w: Vec2,
    pub(super) length: f64,
    pub(super) area: f64,
    foot: f64,
}

impl Side {
    pub(super) fn new([p0, p1, w]: [Vec2; 3]) -> Self {
        let (e, w) = (p1 - p0, w - p0);
        let length = e.norm();
        Self {
            e,
            w,
            length,
            area: 0.5 * cross2(e, w).abs(),
            foot: w.dot(&e) / (length * length),
        }
    }

    /// Variations of length, area and foot under a motion of (p0, p1, opposite).
    pub(super) fn push_forward(&self, [d0, d1, dw]: [Vec2; 3]) -> (f64, f64, f64) {
        let (de, dw) = (d1 - d0, dw - d0);
        let length = self.e.dot(&de) / self.length;
        let sign = cross2(self.e, self.w).signum();
        let area = 0.5 * sign * (cross2(de, self.w) + cross2(self.e, dw));
        let squared = self.length * self.length;
        let foot =
            (dw.dot(&self.e) + self.w.dot(&de)) / squared - 2.0 * self.foot * length / self.length;
        (length, area, foot)
    }

    /// Gradient by (p0, p1, opposite) of a function whose gradients by length, area and foot are
    /// given.
    pub(super) fn pull_back(&self, length: f64, area: f64, foot: f64) -> [Vec2; 3] {
        let squared = self.length * self.length;
        let turn = 0.5 * cross2(self.e, self.w).signum() * area;
        let e = self.e * (length / self.length - 2.0 * self.foot * foot / squared)
            + self.w * (foot / squared)
            + Vec2::new(self.w.y, -self.w.x) * turn;
        let w = self.e * (foot / squared) + Vec2::new(-self.e.y, self.e.x) * turn;
        [-e - w, e, w]
    }
}

impl RestHinge {
    /// From each side's rest corners (p0, p1, opposite) and the bending rigidity B \[N·m\].
    pub fn new(sides: [[Vec2; 3]; 2], rigidity: f64) -> Self {
        let sides = sides.map(Side::new);
        let mean = 0.5 * (sides[0].length + sides[1].length);
        let opposite = sides.map(|s| -mean * s.length / (2.0 * s.area));
        Self {
            k: weights(opposite, [sides[0].foot, sides[1].foot]),
            stiffness: rigidity / (sides[0].area + sides[1].area),
        }
    }

    /// Gradient by the rest corners of both sides of a function whose gradients by k and by the
    /// stiffness are given.
    pub fn pull_back(
        &self,
        corners: [[Vec2; 3]; 2],
        by_k: [f64; 4],
        by_stiffness: f64,
    ) -> [[Vec2; 3]; 2] {
        let sides = corners.map(Side::new);
        let mean = 0.5 * (sides[0].length + sides[1].length);
        let by_areas = -by_stiffness * self.stiffness / (sides[0].area + sides[1].area);
        let by_opposite: [f64; 2] = std::array::from_fn(|i| {
            let t = sides[i].foot;
            by_k[2 + i] - (1.0 - t) * by_k[0] - t * by_k[1]
        });
        let opposite = [self.k[2], self.k[3]];
        let by_mean: f64 = (0..2).map(|i| by_opposite[i] * opposite[i] / mean).sum();
        std::array::from_fn(|i| {
            let side = &sides[i];
            let length = by_opposite[i] * opposite[i] / side.length + 0.5 * by_mean;
            let area = by_areas - by_opposite[i] * opposite[i] / side.area;
            let foot = opposite[i] * (by_k[0] - by_k[1]);
            side.pull_back(length, area, foot)
        })
    }

    /// c \[m\].
    pub fn curvature_vector(&self, x: [Vec3; 4]) -> Vec3 {
        (0..4).map(|a| x[a] * self.k[a]).sum()
    }

    /// U \[J\].
    pub fn energy(&self, x: [Vec3; 4]) -> f64 {
        0.5 * self.stiffness * self.curvature_vector(x).norm_squared()
    }

    /// −∂U/∂x \[N\]. The stiffness block (a, b) is `stiffness · k_a k_b · I`, a constant.
    pub fn force(&self, x: [Vec3; 4]) -> [Vec3; 4] {
        let c = self.curvature_vector(x) * -self.stiffness;
        self.k.map(|k| c * k)
    }
}

/// k from the weights of the two opposite corners and the feet of their heights.
fn weights(opposite: [f64; 2], foot: [f64; 2]) -> [f64; 4] {
    let k0 = -(1.0 - foot[0]) * opposite[0] - (1.0 - foot[1]) * opposite[1];
    let k1 = -foot[0] * opposite[0] - foot[1] * opposite[1];
    [k0, k1, opposite[0], opposite[1]]
}

/// Gradient of λ·f by the rest corners of both sides.
pub fn rest_pull_back(
    corners: [[Vec2; 3]; 2],
    rigidity: f64,
    x: [Vec3; 4],
    lambda: [Vec3; 4],
) -> [[Vec2; 3]; 2] {
    let hinge = RestHinge::new(corners, rigidity);
    let (c, c_lambda) = (hinge.curvature_vector(x), hinge.curvature_vector(lambda));
    // λ·f = −H c·c_λ.
    let by_k =
        std::array::from_fn(|a| -hinge.stiffness * (x[a].dot(&c_lambda) + lambda[a].dot(&c)));
    hinge.pull_back(corners, by_k, -c.dot(&c_lambda))
}

/// Change of the forces under a motion `delta` of the rest corners of both sides, at fixed x.
pub fn rest_push_forward(
    corners: [[Vec2; 3]; 2],
    rigidity: f64,
    x: [Vec3; 4],
    delta: [[Vec2; 3]; 2],
) -> [Vec3; 4] {
    let hinge = RestHinge::new(corners, rigidity);
    let sides = corners.map(Side::new);
    let mean = 0.5 * (sides[0].length + sides[1].length);
    let d: [_; 2] = std::array::from_fn(|i| sides[i].push_forward(delta[i]));
    let d_mean = 0.5 * (d[0].0 + d[1].0);
    let opposite = [hinge.k[2], hinge.k[3]];
    let d_opposite: [f64; 2] = std::array::from_fn(|i| {
        opposite[i] * (d_mean / mean + d[i].0 / sides[i].length - d[i].1 / sides[i].area)
    });
    let mut d_k = weights(d_opposite, [sides[0].foot, sides[1].foot]);
    for i in 0..2 {
        d_k[0] += d[i].2 * opposite[i];
        d_k[1] -= d[i].2 * opposite[i];
    }
    let d_stiffness = -hinge.stiffness * (d[0].1 + d[1].1) / (sides[0].area + sides[1].area);
    let c = hinge.curvature_vector(x);
    let d_c: Vec3 = (0..4).map(|a| x[a] * d_k[a]).sum();
    std::array::from_fn(|a| {
        -c * (d_stiffness * hinge.k[a] + hinge.stiffness * d_k[a])
            - d_c * (hinge.stiffness * hinge.k[a])
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};
    use approx::assert_relative_eq;

    fn sides(seed: usize) -> [[Vec2; 3]; 2] {
        let n = |i: usize| 0.15 * noise(seed + i);
        // Side lengths differ, as across an eased seam.
        [
            [
                Vec2::new(n(0), n(1)),
                Vec2::new(1.0 + n(2), n(3)),
                Vec2::new(0.4, 0.9 + n(4)),
            ],
            [
                Vec2::new(n(5), n(6)),
                Vec2::new(1.1 + n(7), n(8)),
                Vec2::new(0.6, -0.8 + n(9)),
            ],
        ]
    }

    fn quad<T>(f: impl Fn(usize) -> T) -> [T; 4] {
        std::array::from_fn(f)
    }

    fn vectors(seed: usize) -> [Vec3; 4] {
        quad(|a| Vec3::new(noise(seed + a), noise(seed + 10 + a), noise(seed + 20 + a)))
    }

    fn dot(a: [Vec3; 4], b: [Vec3; 4]) -> f64 {
        a.iter().zip(&b).map(|(a, b)| a.dot(b)).sum()
    }

    #[test]
    fn a_flat_hinge_has_no_curvature_and_any_rigid_motion_keeps_it_so() {
        let s = sides(0);
        let shared = [s[0], [s[0][0], s[0][1], s[1][2]]];
        let hinge = RestHinge::new(shared, 1.0);
        let turn = nalgebra::Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        let lift = |p: Vec2| turn * Vec3::new(p.x, p.y, 0.0) + Vec3::new(1.0, 2.0, 3.0);
        let x = [
            lift(shared[0][0]),
            lift(shared[0][1]),
            lift(shared[0][2]),
            lift(shared[1][2]),
        ];
        // Exact up to round-off of coordinates of order three.
        assert!(hinge.curvature_vector(x).norm() < 1e-13);
    }

    #[test]
    fn a_folded_hinge_measures_twice_the_sine_of_half_its_angle() {
        let rest = [
            [Vec2::zeros(), Vec2::new(2.0, 0.0), Vec2::new(0.7, 1.0)],
            [Vec2::zeros(), Vec2::new(2.0, 0.0), Vec2::new(1.2, -0.8)],
        ];
        let theta: f64 = 0.7;
        let x = [
            Vec3::zeros(),
            Vec3::new(2.0, 0.0, 0.0),
            Vec3::new(0.7, 1.0, 0.0),
            Vec3::new(1.2, -0.8 * theta.cos(), 0.8 * theta.sin()),
        ];
        let c = RestHinge::new(rest, 1.0).curvature_vector(x);
        assert_relative_eq!(
            c.norm(),
            2.0 * 2.0 * (0.5 * theta).sin(),
            max_relative = 1e-12
        );
    }

    #[test]
    fn a_cylinder_stores_half_b_kappa_squared_per_area() {
        // Equilateral strip of edge h rolled on radius r across rows: hinges between rows fold by
        // the angle its rows subtend, slanted ones by what is left; sum over one period.
        let (h, r) = (0.02, 0.5);
        let height = h * 3.0_f64.sqrt() / 2.0;
        let on = |p: Vec2| Vec3::new(p.x, r * (p.y / r).sin(), r * (p.y / r).cos());
        let hinge = |p0: Vec2, p1: Vec2, a: Vec2, b: Vec2| {
            RestHinge::new([[p0, p1, a], [p0, p1, b]], 1.0).energy([on(p0), on(p1), on(a), on(b)])
        };
        let at = |i: f64, j: f64| Vec2::new(h * (i + 0.5 * j), height * j);
        let energy = hinge(at(0., 0.), at(1., 0.), at(0., 1.), at(1., -1.))
            + hinge(at(0., 0.), at(0., 1.), at(1., 0.), at(-1., 1.))
            + hinge(at(1., 0.), at(0., 1.), at(0., 0.), at(1., 1.));
        let area = h * height;
        // Within the discretisation error of an equilateral mesh (1.00–1.01).
        assert_relative_eq!(energy / area, 0.5 / (r * r), max_relative = 0.02);
    }

    #[test]
    fn force_is_minus_the_slope_of_the_energy() {
        let hinge = RestHinge::new(sides(4), 2.0);
        let (x, d) = (vectors(5), vectors(77));
        let u = |s: f64| hinge.energy(quad(|a| x[a] + d[a] * s));
        assert_derivative(u, -dot(hinge.force(x), d), 1e-5, 1.0, 1e-8);
    }

    #[test]
    fn rest_derivatives_agree_with_differences_and_with_each_other() {
        for seed in 0..10 {
            let corners = sides(31 * seed);
            let (x, lambda) = (vectors(17 * seed), vectors(17 * seed + 40));
            let delta: [[Vec2; 3]; 2] = std::array::from_fn(|i| {
                std::array::from_fn(|j| {
                    Vec2::new(noise(seed + 5 * i + j), noise(seed + 60 + 3 * i + j))
                })
            });
            let moved = |s: f64| -> [[Vec2; 3]; 2] {
                std::array::from_fn(|i| std::array::from_fn(|j| corners[i][j] + delta[i][j] * s))
            };
            let lambda_dot_force = |s: f64| dot(RestHinge::new(moved(s), 2.0).force(x), lambda);
            let hat = rest_pull_back(corners, 2.0, x, lambda);
            let pulled: f64 = (0..2)
                .flat_map(|i| (0..3).map(move |j| (i, j)))
                .map(|(i, j)| hat[i][j].dot(&delta[i][j]))
                .sum();
            assert_derivative(lambda_dot_force, pulled, 1e-6, 1.0, 1e-7);
            let pushed = rest_push_forward(corners, 2.0, x, delta);
            assert_relative_eq!(dot(pushed, lambda), pulled, max_relative = 1e-9);
        }
    }
}
