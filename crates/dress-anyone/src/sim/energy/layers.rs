//! Contact of cloth with cloth: a vertex and a triangle, or two edges, closer than a thickness h.
//!
//! U = m κ φ(δ), φ = h (h − δ)²/(2δ) for δ < h: near h it is the spring ½ (h − δ)², at δ → 0 it
//! has no bound, so layers do not pass each other. δ is the distance of the closest points,
//! r = Σ β_k x_k with weights β that depend on free parameters y (none at a corner, one on an
//! edge, two in a face or between edges); from ∂(½r²)/∂y = 0 follows
//! ∇²(½r²) = B − E (gᵀg)⁻¹ Eᵀ, g = ∂r/∂y. Between parallel edges the closest points jump: m, of
//! Li et al. 2020 (IPC, §5.2), fades the pair out there.

use crate::geometry::{Mat2, Mat3, Vec2, Vec3};
use crate::sim::material::OrFabric;
use serde::{Deserialize, Serialize};

/// How cloth meets cloth.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LayerParams {
    /// Whether cloth feels cloth at all. The paper does not say.
    pub on: bool,
    /// Distance h at which layers begin to feel each other \[m\]: the thickness of the fabrics, but no less
    /// than [`LEAST_THICKNESS`], or a number. 1e-3 to 3e-3.
    pub thickness: OrFabric,
    /// κ₀ \[N/m³\]: pressure per depth, near h. Higher yields less and solves slower.
    pub stiffness: f64,
}

impl Default for LayerParams {
    fn default() -> Self {
        Self {
            on: true,
            thickness: OrFabric::Fabric,
            stiffness: 1e6,
        }
    }
}

/// Least distance at which layers of thin fabrics begin to feel each other \[m\]: moves are cut where
/// layers meet, and take ever more steps the closer they are.
pub const LEAST_THICKNESS: f64 = 2e-3;

/// Two pieces of cloth that may touch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Pair {
    /// A vertex and the corners of a triangle, or the ends of one edge and of the other.
    pub vertices: [u32; 4],
    /// Which of the two.
    pub kind: Kind,
    /// Contact stiffness κ \[N/m\].
    pub kappa: f64,
    /// Distance h at which they begin to feel each other \[m\].
    pub h: f64,
}

/// What touches what.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Kind {
    /// Vertex and triangle.
    PointTriangle,
    /// Edge and edge; |e₁ × e₂|² \[m⁴\] below which they count as ever more parallel.
    EdgeEdge(f64),
}

/// The closest points of a pair.
#[derive(Clone, Copy, Debug)]
pub struct Closest {
    /// r = Σ β_k x_k \[m\], from the second to the first.
    pub r: Vec3,
    /// Weights of the four vertices.
    pub beta: [f64; 4],
    /// ∂β/∂y of the free parameters y.
    free: [[f64; 4]; 2],
    free_count: usize,
}

impl Pair {
    /// The closest points when the vertices are at `x` \[m\].
    pub fn closest(&self, x: [Vec3; 4]) -> Closest {
        match self.kind {
            Kind::PointTriangle => point_triangle(x),
            Kind::EdgeEdge(_) => edge_edge(x),
        }
    }

    /// U \[J\].
    pub fn energy(&self, x: [Vec3; 4]) -> f64 {
        let delta = self.closest(x).r.norm();
        if delta >= self.h {
            return 0.0;
        }
        self.kappa * spring(self.h, delta)[0] * self.fade(x).map_or(1.0, |f| f.m[0])
    }

    /// −∂U/∂x \[N\]; none where there is no contact.
    pub fn force(&self, x: [Vec3; 4]) -> Option<[Vec3; 4]> {
        let closest = self.closest(x);
        let delta = closest.r.norm();
        if delta >= self.h {
            return None;
        }
        let [value, slope, _] = spring(self.h, delta).map(|s| s * self.kappa);
        let n = closest.r / delta;
        let fade = self.fade(x);
        let m = fade.as_ref().map_or(1.0, |f| f.m[0]);
        let mut force = closest.beta.map(|b| n * (-m * slope * b));
        if let Some(fade) = fade {
            let by_c = fade.gradient();
            for k in 0..4 {
                force[k] -= by_c[k] * (fade.m[1] * value);
            }
        }
        Some(force)
    }

    /// ∂²U/∂x² \[N/m\], blocks `[a][b]`; none where there is no contact. With the part `exactness`
    /// of all that bends: 1 is exact, 0 keeps the positive semi-definite part along the normal.
    pub fn stiffness(&self, x: [Vec3; 4], exactness: f64) -> Option<[[Mat3; 4]; 4]> {
        let closest = self.closest(x);
        let delta = closest.r.norm();
        if delta >= self.h {
            return None;
        }
        let [value, slope, bend] = spring(self.h, delta).map(|s| s * self.kappa);
        let n = closest.r / delta;
        let fade = self.fade(x);
        let m = fade.as_ref().map_or(1.0, |f| f.m[0]);
        let along = n * n.transpose();
        let mut blocks = [[Mat3::zeros(); 4]; 4];
        for (k, row) in blocks.iter_mut().enumerate() {
            for (l, block) in row.iter_mut().enumerate() {
                *block = along * (m * bend * closest.beta[k] * closest.beta[l]);
            }
        }
        if exactness == 0.0 {
            return Some(blocks);
        }
        let half_square = closest.hessian(x);
        for k in 0..4 {
            for l in 0..4 {
                let turn = half_square[k][l] - along * (closest.beta[k] * closest.beta[l]);
                blocks[k][l] += turn * (exactness * m * slope / delta);
            }
        }
        if let Some(fade) = fade {
            let (by_c, second) = (fade.gradient(), fade.hessian());
            for k in 0..4 {
                for l in 0..4 {
                    let (bk, bl) = (n * closest.beta[k], n * closest.beta[l]);
                    let mixed = bk * by_c[l].transpose() + by_c[k] * bl.transpose();
                    let own = by_c[k] * by_c[l].transpose() * fade.m[2] + second[k][l] * fade.m[1];
                    blocks[k][l] += (mixed * (fade.m[1] * slope) + own * value) * exactness;
                }
            }
        }
        Some(blocks)
    }

    /// The fading of edges that are nearly parallel; none where it does not act.
    fn fade(&self, x: [Vec3; 4]) -> Option<Fade> {
        let Kind::EdgeEdge(limit) = self.kind else {
            return None;
        };
        let (e, f) = (x[1] - x[0], x[3] - x[2]);
        let c = e.cross(&f).norm_squared();
        if c >= limit {
            return None;
        }
        let part = c / limit;
        let m = [
            part * (2.0 - part),
            2.0 * (1.0 - part) / limit,
            -2.0 / (limit * limit),
        ];
        Some(Fade { e, f, m })
    }
}

/// φ, φ′ and φ″ at δ < h.
fn spring(h: f64, delta: f64) -> [f64; 3] {
    let q = h / delta;
    [
        0.5 * h * (h - delta) * (q - 1.0),
        0.5 * h * (1.0 - q * q),
        q * q * q,
    ]
}

/// m(c) = (c/c₀)(2 − c/c₀) with c = |e × f|², and its derivatives by c.
struct Fade {
    e: Vec3,
    f: Vec3,
    m: [f64; 3],
}

/// Signs with which the four vertices enter the two edges.
const SIGNS: [f64; 4] = [-1.0, 1.0, -1.0, 1.0];

impl Fade {
    /// ∂c/∂x.
    fn gradient(&self) -> [Vec3; 4] {
        let Self { e, f, .. } = self;
        let by_e = (e * f.norm_squared() - f * e.dot(f)) * 2.0;
        let by_f = (f * e.norm_squared() - e * e.dot(f)) * 2.0;
        [-by_e, by_e, -by_f, by_f]
    }

    /// ∂²c/∂x².
    fn hessian(&self) -> [[Mat3; 4]; 4] {
        let Self { e, f, .. } = self;
        let across = |v: &Vec3| (Mat3::identity() * v.norm_squared() - v * v.transpose()) * 2.0;
        let ef = (e * f.transpose() * 2.0 - f * e.transpose() - Mat3::identity() * e.dot(f)) * 2.0;
        let by = [[across(f), ef], [ef.transpose(), across(e)]];
        std::array::from_fn(|k| std::array::from_fn(|l| by[k / 2][l / 2] * (SIGNS[k] * SIGNS[l])))
    }
}

impl Closest {
    /// ∂²(½r²)/∂x².
    fn hessian(&self, x: [Vec3; 4]) -> [[Mat3; 4]; 4] {
        let (beta, count) = (self.beta, self.free_count);
        let mut blocks = [[Mat3::zeros(); 4]; 4];
        for k in 0..4 {
            for l in 0..4 {
                blocks[k][l].fill_diagonal(beta[k] * beta[l]);
            }
        }
        let g = self.free.map(|gamma| combine(&gamma, &x));
        let inverse = match count {
            0 => return blocks,
            1 => Mat2::new(1.0 / g[0].norm_squared(), 0.0, 0.0, 0.0),
            _ => {
                let mixed = g[0].dot(&g[1]);
                let gram = Mat2::new(g[0].norm_squared(), mixed, mixed, g[1].norm_squared());
                gram.try_inverse().unwrap_or_else(Mat2::zeros)
            }
        };
        let e = |k: usize, p: usize| g[p] * beta[k] + self.r * self.free[p][k];
        for k in 0..4 {
            for l in 0..4 {
                for p in 0..count {
                    for q in 0..count {
                        blocks[k][l] -= e(k, p) * e(l, q).transpose() * inverse[(p, q)];
                    }
                }
            }
        }
        blocks
    }
}

fn combine(weights: &[f64; 4], x: &[Vec3; 4]) -> Vec3 {
    (0..4).map(|k| x[k] * weights[k]).sum()
}

fn closest(x: &[Vec3; 4], beta: [f64; 4], free: &[[f64; 4]]) -> Closest {
    let mut all = [[0.0; 4]; 2];
    all[..free.len()].copy_from_slice(free);
    Closest {
        r: combine(&beta, x),
        beta,
        free: all,
        free_count: free.len(),
    }
}

/// The point of triangle (1, 2, 3) closest to vertex 0, by the region it lies over.
fn point_triangle(x: [Vec3; 4]) -> Closest {
    let [p, a, b, c] = x;
    // Along a side from corner i to corner j.
    let side = |i: usize, j: usize, t: f64| {
        let (mut beta, mut free) = ([1.0, 0.0, 0.0, 0.0], [0.0; 4]);
        (beta[i], beta[j]) = (t - 1.0, -t);
        (free[i], free[j]) = (1.0, -1.0);
        closest(&x, beta, &[free])
    };
    let corner = |i: usize| {
        let mut beta = [1.0, 0.0, 0.0, 0.0];
        beta[i] = -1.0;
        closest(&x, beta, &[])
    };
    // Projections of p, from each corner, on the sides ab and ac.
    let sides = |from: Vec3| Vec2::new((b - a).dot(&(p - from)), (c - a).dot(&(p - from)));
    let (at_a, at_b, at_c) = (sides(a), sides(b), sides(c));
    if at_a.x <= 0.0 && at_a.y <= 0.0 {
        return corner(1);
    }
    if at_b.x >= 0.0 && at_b.y <= at_b.x {
        return corner(2);
    }
    let over_c = at_a.x * at_b.y - at_b.x * at_a.y;
    if over_c <= 0.0 && at_a.x >= 0.0 && at_b.x <= 0.0 {
        return side(1, 2, at_a.x / (at_a.x - at_b.x));
    }
    if at_c.y >= 0.0 && at_c.x <= at_c.y {
        return corner(3);
    }
    let over_b = at_c.x * at_a.y - at_a.x * at_c.y;
    if over_b <= 0.0 && at_a.y >= 0.0 && at_c.y <= 0.0 {
        return side(1, 3, at_a.y / (at_a.y - at_c.y));
    }
    let over_a = at_b.x * at_c.y - at_c.x * at_b.y;
    let (from_b, from_c) = (at_b.y - at_b.x, at_c.x - at_c.y);
    if over_a <= 0.0 && from_b >= 0.0 && from_c >= 0.0 {
        return side(2, 3, from_b / (from_b + from_c));
    }
    let sum = over_a + over_b + over_c;
    let (v, w) = (over_b / sum, over_c / sum);
    let free = [[0.0, 1.0, -1.0, 0.0], [0.0, 1.0, 0.0, -1.0]];
    closest(&x, [1.0, v + w - 1.0, -v, -w], &free)
}

/// The closest points of the segments (0, 1) and (2, 3).
fn edge_edge(x: [Vec3; 4]) -> Closest {
    let (d1, d2, r) = (x[1] - x[0], x[3] - x[2], x[0] - x[2]);
    let (a, e, b) = (d1.norm_squared(), d2.norm_squared(), d1.dot(&d2));
    let (c, f) = (d1.dot(&r), d2.dot(&r));
    let unit = |value: f64| if value > 0.0 { value.min(1.0) } else { 0.0 };
    let squared_area = a * e - b * b;
    let mut s = unit((b * f - c * e) / squared_area);
    let mut t = (b * s + f) / e;
    if !(t > 0.0) {
        (s, t) = (unit(-c / a), 0.0);
    } else if t > 1.0 {
        (s, t) = (unit((b - c) / a), 1.0);
    }
    let by_s = [-1.0, 1.0, 0.0, 0.0];
    let by_t = [0.0, 0.0, 1.0, -1.0];
    let inside = |y: f64| 0.0 < y && y < 1.0;
    let beta = [1.0 - s, s, t - 1.0, -t];
    match (inside(s), inside(t)) {
        (true, true) => closest(&x, beta, &[by_s, by_t]),
        (true, false) => closest(&x, beta, &[by_s]),
        (false, true) => closest(&x, beta, &[by_t]),
        (false, false) => closest(&x, beta, &[]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};

    const H: f64 = 0.5;

    fn check(kind: Kind, x: [Vec3; 4], seed: usize) {
        let pair = Pair {
            vertices: [0, 1, 2, 3],
            kind,
            kappa: 3.0,
            h: H,
        };
        let along = |seed: usize| -> [Vec3; 4] {
            std::array::from_fn(|k| Vec3::from_fn(|c, _| noise(seed + 3 * k + c)))
        };
        let (d, q) = (along(seed), along(seed + 40));
        let at = |s: f64| std::array::from_fn(|k| x[k] + d[k] * s);
        assert!(pair.energy(x) > 0.0, "they must touch");
        let force = pair.force(x).expect("touches");
        let slope: f64 = -(0..4).map(|k| force[k].dot(&d[k])).sum::<f64>();
        assert_derivative(|s| pair.energy(at(s)), slope, 1e-6, 1e-3, 1e-7);
        let k = pair.stiffness(x, 1.0).expect("touches");
        let slope: f64 = (0..4)
            .flat_map(|a| (0..4).map(move |b| (a, b)))
            .map(|(a, b)| q[a].dot(&(k[a][b] * d[b])))
            .sum();
        let pull = |s: f64| {
            let force = pair.force(at(s)).expect("touches");
            -(0..4).map(|k| force[k].dot(&q[k])).sum::<f64>()
        };
        assert_derivative(pull, slope, 1e-6, 1e-3, 1e-6);
    }

    const TRIANGLE: [Vec3; 3] = [
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(1.0, 0.1, 0.0),
        Vec3::new(0.2, -0.1, 1.2),
    ];

    #[test]
    fn a_point_over_each_part_of_a_triangle_has_exact_derivatives() {
        let over = [
            (0.4, 0.3),
            (-0.1, -0.1),
            (1.2, -0.1),
            (0.2, 1.35),
            (0.5, -0.2),
            (-0.15, 0.6),
            (0.8, 0.6),
        ];
        for (i, (u, w)) in over.into_iter().enumerate() {
            let p = Vec3::new(u, 0.25, w);
            let [a, b, c] = TRIANGLE;
            check(Kind::PointTriangle, [p, a, b, c], 100 * i);
        }
    }

    #[test]
    fn two_edges_have_exact_derivatives_also_at_their_ends_and_when_nearly_parallel() {
        let first = [Vec3::new(-1.0, 0.0, 0.1), Vec3::new(1.0, 0.05, 0.0)];
        let seconds = [
            // Crossing; beyond an end; corner to corner; nearly parallel.
            [Vec3::new(0.1, 0.3, -1.0), Vec3::new(-0.2, 0.2, 1.0)],
            [Vec3::new(0.1, 0.2, 0.2), Vec3::new(-0.2, 0.4, 1.0)],
            [Vec3::new(1.1, 0.2, 0.2), Vec3::new(1.9, 0.4, 1.0)],
            [Vec3::new(-1.0, 0.2, -0.1), Vec3::new(1.0, 0.25, 0.2)],
        ];
        for (i, second) in seconds.into_iter().enumerate() {
            let x = [first[0], first[1], second[0], second[1]];
            check(Kind::EdgeEdge(0.5), x, 1000 * i);
        }
    }

    #[test]
    fn what_is_a_thickness_apart_does_not_push_and_what_nearly_meets_pushes_without_bound() {
        let [a, b, c] = TRIANGLE;
        let pair = Pair {
            vertices: [0, 1, 2, 3],
            kind: Kind::PointTriangle,
            kappa: 1.0,
            h: H,
        };
        let normal = (c - a).cross(&(b - a)).normalize();
        let at = |height: f64| [(a + b + c) / 3.0 + normal * height, a, b, c];
        assert_eq!(pair.energy(at(H + 1e-9)), 0.0);
        assert!(pair.force(at(H + 1e-9)).is_none());
        // φ′ = h/2 (1 − (h/δ)²): at h/1000 a million times h/2.
        let force = pair.force(at(1e-3 * H)).expect("touches")[0];
        assert!((force.dot(&normal) / (0.5 * H * (1e6 - 1.0)) - 1.0).abs() < 1e-9);
    }
}
