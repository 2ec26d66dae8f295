//! Stretch and shear: St. Venant–Kirchhoff with Green strain, one element per triangle.
//!
//! F = D_s D_m⁻¹, ε = ½(FᵀF − I), S = 𝔻ε, U = ½ Ā ε:S. As an XPBD constraint it is the paper's
//! (§3.1, after Stuyck & Chen 2023): C = (ε_uu, ε_vv, 2ε_uv) with compliance 𝔻⁻¹/Ā.
//! u runs along the panel's x axis (weft), v along its y axis (warp).

use crate::garment::Fabric;
use crate::geometry::{Mat2, Mat3, Vec2, Vec3};
use nalgebra::Matrix3x2;

/// 3×2: the deformation gradient and everything of its shape.
pub type Mat3x2 = Matrix3x2<f64>;

/// Stiffness 𝔻 on (ε_uu, ε_vv, 2ε_uv) \[N/m\]: orthotropic, without coupling of shear and stretch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Elasticity {
    /// 𝔻₀₀, weft.
    pub weft: f64,
    /// 𝔻₁₁, warp.
    pub warp: f64,
    /// 𝔻₀₁.
    pub coupling: f64,
    /// 𝔻₂₂.
    pub shear: f64,
}

impl From<&Fabric> for Elasticity {
    /// Plane stress: E/(1 − ν²) on the diagonal, ν times their geometric mean beside it, which is
    /// positive definite for every ν < 1.
    fn from(fabric: &Fabric) -> Self {
        let plane = 1.0 - fabric.poisson * fabric.poisson;
        Self {
            weft: fabric.weft / plane,
            warp: fabric.warp / plane,
            coupling: fabric.poisson * (fabric.weft * fabric.warp).sqrt() / plane,
            shear: fabric.shear,
        }
    }
}

impl Elasticity {
    /// Gradient by warp, weft, Poisson's ratio and shear of a fabric, given that by what follows from
    /// them.
    pub fn pull_back(&self, hat: &Self) -> [f64; 4] {
        let nu = self.coupling / (self.weft * self.warp).sqrt();
        let plane = 1.0 - nu * nu;
        let mean = (self.weft * self.warp).sqrt() * plane;
        let coupled = |own: f64| hat.coupling * 0.5 * nu * mean / (own * plane * plane);
        let by_nu = (hat.weft * self.weft + hat.warp * self.warp) * 2.0 * nu / plane
            + hat.coupling * mean * (1.0 + nu * nu) / (plane * plane);
        [
            hat.warp / plane + coupled(self.warp),
            hat.weft / plane + coupled(self.weft),
            by_nu,
            hat.shear,
        ]
    }

    /// 𝔻 applied to a symmetric strain, as a symmetric stress \[N/m\].
    pub fn stress(&self, strain: &Mat2) -> Mat2 {
        let uu = self.weft * strain.m11 + self.coupling * strain.m22;
        let vv = self.coupling * strain.m11 + self.warp * strain.m22;
        let uv = self.shear * (strain.m12 + strain.m21);
        Mat2::new(uu, uv, uv, vv)
    }
}

/// A triangle at rest.
#[derive(Clone, Copy, Debug)]
pub struct RestTriangle {
    /// D_m⁻¹ \[1/m\]; rows are the gradients of the hat functions of corners 1 and 2.
    pub inverse: Mat2,
    /// Ā \[m²\].
    pub area: f64,
}

impl RestTriangle {
    /// From its corners in the plane; the area must not be zero.
    pub fn new(corners: [Vec2; 3]) -> Self {
        let edges = Mat2::from_columns(&[corners[1] - corners[0], corners[2] - corners[0]]);
        let doubled = edges.determinant();
        let adjugate = Mat2::new(edges.m22, -edges.m12, -edges.m21, edges.m11);
        Self {
            inverse: adjugate / doubled,
            area: 0.5 * doubled,
        }
    }

    /// Gradient by the corners of a function whose gradients by `inverse` and `area` are given.
    pub fn pull_back(&self, inverse: &Mat2, area: f64) -> [Vec2; 3] {
        let turned = self.inverse.transpose();
        let edges = turned * (self.area * area) - turned * inverse * turned;
        let (g1, g2) = (edges.column(0).into_owned(), edges.column(1).into_owned());
        [-g1 - g2, g1, g2]
    }

    /// Gradients of the three hat functions \[1/m\].
    pub fn gradients(&self) -> [Vec2; 3] {
        let b1 = self.inverse.row(0).transpose();
        let b2 = self.inverse.row(1).transpose();
        [-b1 - b2, b1, b2]
    }

    /// Σ_a w_a b_a b_aᵀ for weights `w` of the corners.
    pub fn weighted(&self, w: [f64; 3]) -> Mat2 {
        let [a, b, c] = self.gradients();
        a * a.transpose() * w[0] + b * b.transpose() * w[1] + c * c.transpose() * w[2]
    }

    /// Σ_a y_a b_aᵀ: the deformation gradient for positions, its variation for displacements.
    pub fn gradient_of(&self, y: [Vec3; 3]) -> Mat3x2 {
        Mat3x2::from_columns(&[y[1] - y[0], y[2] - y[0]]) * self.inverse
    }
}

/// Green strain of a deformation gradient.
fn green_strain(f: &Mat3x2) -> Mat2 {
    (f.transpose() * f - Mat2::identity()) * 0.5
}

/// U \[J\].
pub fn energy(rest: &RestTriangle, d: &Elasticity, x: [Vec3; 3]) -> f64 {
    let strain = green_strain(&rest.gradient_of(x));
    0.5 * rest.area * strain.dot(&d.stress(&strain))
}

/// −∂U/∂x \[N\], per corner.
pub fn force(rest: &RestTriangle, d: &Elasticity, x: [Vec3; 3]) -> [Vec3; 3] {
    let f = rest.gradient_of(x);
    let p = f * d.stress(&green_strain(&f)) * (-rest.area);
    rest.gradients().map(|b| p * b)
}

/// ∂²U/∂x² \[N/m\], blocks `[a][b]` for b ≤ a, with the part `compression` of the compressive
/// stress: 1 is exact, 0 makes every element positive semi-definite.
pub fn stiffness(
    rest: &RestTriangle,
    d: &Elasticity,
    x: [Vec3; 3],
    compression: f64,
) -> [[Mat3; 3]; 3] {
    let f = rest.gradient_of(x);
    let mut s = d.stress(&green_strain(&f));
    if compression < 1.0 {
        let tension = positive_part(&s);
        s = tension + (s - tension) * compression;
    }
    let (fu, fv) = (f.column(0).into_owned(), f.column(1).into_owned());
    let (uu, vv, uv) = (
        fu * fu.transpose(),
        fv * fv.transpose(),
        fu * fv.transpose(),
    );
    let vu = uv.transpose();
    let b = rest.gradients();
    let mut blocks = [[Mat3::zeros(); 3]; 3];
    for i in 0..3 {
        for j in 0..=i {
            let (p, q) = (b[i], b[j]);
            // F (N_p 𝔻 N_qᵀ) Fᵀ with N_p = [[p.x, 0, p.y], [0, p.y, p.x]].
            let m_uu = d.weft * p.x * q.x + d.shear * p.y * q.y;
            let m_uv = d.coupling * p.x * q.y + d.shear * p.y * q.x;
            let m_vu = d.coupling * p.y * q.x + d.shear * p.x * q.y;
            let m_vv = d.warp * p.y * q.y + d.shear * p.x * q.x;
            let geometric = p.dot(&(s * q));
            blocks[i][j] =
                (uu * m_uu + uv * m_uv + vu * m_vu + vv * m_vv + Mat3::identity() * geometric)
                    * rest.area;
        }
    }
    blocks
}

/// The part of a symmetric 2×2 matrix with non-negative eigenvalues.
fn positive_part(s: &Mat2) -> Mat2 {
    let mean = 0.5 * (s.m11 + s.m22);
    let half = Vec2::new(0.5 * (s.m11 - s.m22), s.m12);
    let radius = half.norm();
    let (high, low) = (mean + radius, mean - radius);
    if low >= 0.0 {
        return *s;
    }
    if high <= 0.0 {
        return Mat2::zeros();
    }
    // high · (projector on the stretched direction); radius > 0 here since high > 0 > low.
    (Mat2::identity() + Mat2::new(half.x, half.y, half.y, -half.x) / radius) * (0.5 * high)
}

/// The constraint C = (ε_uu, ε_vv, 2ε_uv) of a deformation gradient.
pub fn constraint(f: &Mat3x2) -> Vec3 {
    let (fu, fv) = (f.column(0), f.column(1));
    Vec3::new(
        0.5 * (fu.dot(&fu) - 1.0),
        0.5 * (fv.dot(&fv) - 1.0),
        fu.dot(&fv),
    )
}

/// Y with (∂C/∂x_a)ᵀ y = Y b_a for every corner a: F times y as a symmetric matrix.
pub fn constraint_gradient(f: &Mat3x2, y: &Vec3) -> Mat3x2 {
    f * symmetric(y)
}

/// Σ_a w_a (∂C/∂x_a)(∂C/∂x_a)ᵀ, given Σ_a w_a b_a b_aᵀ.
pub fn constraint_mass(f: &Mat3x2, b: &Mat2) -> Mat3 {
    let g = f.transpose() * f;
    let uu_uv = b.m11 * g.m12 + b.m12 * g.m11;
    let vv_uv = b.m12 * g.m22 + b.m22 * g.m12;
    let shear = b.m11 * g.m22 + 2.0 * b.m12 * g.m12 + b.m22 * g.m11;
    Mat3::new(
        b.m11 * g.m11,
        b.m12 * g.m12,
        uu_uv,
        b.m12 * g.m12,
        b.m22 * g.m22,
        vv_uv,
        uu_uv,
        vv_uv,
        shear,
    )
}

/// (y₀, y₁, y₂) as [[y₀, y₂], [y₂, y₁]].
pub fn symmetric(y: &Vec3) -> Mat2 {
    Mat2::new(y.x, y.z, y.z, y.y)
}

/// Gradient of λ·f by the rest corners x̄ (METHOD: W = −λ·f = Ā S:e_L), where `weight` is
/// (ρ/3) Σ_a λ_a·g, the part of λ·f that gravity adds per rest area.
pub fn rest_pull_back(
    rest: &RestTriangle,
    d: &Elasticity,
    x: [Vec3; 3],
    lambda: [Vec3; 3],
    weight: f64,
) -> [Vec2; 3] {
    let f = rest.gradient_of(x);
    let l = rest.gradient_of(lambda);
    let s = d.stress(&green_strain(&f));
    let fl = f.transpose() * l;
    let e = (fl + fl.transpose()) * 0.5;
    let t = d.stress(&e);
    let metric = f.transpose() * f;
    let m = (Mat2::identity() * s.dot(&e) - e * s * 2.0 - metric * t) * (-rest.area)
        + Mat2::identity() * (rest.area * weight);
    let g = m * rest.inverse.transpose();
    let (g1, g2) = (g.column(0).into_owned(), g.column(1).into_owned());
    [-g1 - g2, g1, g2]
}

/// Change of the forces under a motion `delta` of the rest corners, at fixed x; `gravity` is
/// ρ g/3, which each corner gets per rest area.
pub fn rest_push_forward(
    rest: &RestTriangle,
    d: &Elasticity,
    x: [Vec3; 3],
    delta: [Vec2; 3],
    gravity: Vec3,
) -> [Vec3; 3] {
    let f = rest.gradient_of(x);
    let s = d.stress(&green_strain(&f));
    let z = Mat2::from_columns(&[delta[1] - delta[0], delta[2] - delta[0]]) * rest.inverse;
    let cz = f.transpose() * f * z;
    let s_delta = d.stress(&((cz + cz.transpose()) * -0.5));
    let f_delta = -f * z;
    let p = f * s * z.trace() + f_delta * s + f * s_delta - f * s * z.transpose();
    let mass = gravity * (rest.area * z.trace());
    rest.gradients().map(|b| p * b * -rest.area + mass)
}

/// Gradient of λ·f by the stiffnesses.
pub fn elasticity_pull_back(rest: &RestTriangle, x: [Vec3; 3], lambda: [Vec3; 3]) -> Elasticity {
    let f = rest.gradient_of(x);
    let fl = f.transpose() * rest.gradient_of(lambda);
    let (strain, e) = (green_strain(&f), (fl + fl.transpose()) * 0.5);
    // λ·f = −Ā 𝔻ε : e, with 𝔻 on (ε_uu, ε_vv, 2ε_uv).
    Elasticity {
        weft: -rest.area * strain.m11 * e.m11,
        warp: -rest.area * strain.m22 * e.m22,
        coupling: -rest.area * (strain.m11 * e.m22 + strain.m22 * e.m11),
        shear: -rest.area * 4.0 * strain.m12 * e.m12,
    }
}

#[cfg(test)]
mod tests;
