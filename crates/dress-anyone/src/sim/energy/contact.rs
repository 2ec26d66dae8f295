//! Contact of points of the cloth ([`crate::sim::cloth::ContactPoint`]) with the static body: a compliant
//! one-sided constraint (Stuyck & Chen 2023), U = ½ κ min(d(p) − h, 0)² per point, with κ = κ₀ · (the
//! point's reference area), and κ |d − h/2|³/(6 · 0.01 mm) more where d < h/2.
//!
//! The distance d comes from a [`Surface`] with a gradient and a Hessian, so force and stiffness
//! are exact derivatives of the energy, contact curvature included.

use crate::body::distance_field::DistanceField;
use crate::geometry::{Mat3, Vec3};
use crate::sim::material::OrFabric;
use serde::{Deserialize, Serialize};

/// Something solid that cloth lies on.
pub trait Surface: Sync {
    /// Signed distance \[m\] (positive outside) and its gradient; none where nothing is near.
    fn distance(&self, p: Vec3) -> Option<(f64, Vec3)>;
    /// The same where the distance is below `limit` \[m\]; elsewhere how far p may move at least before it
    /// can be \[m\]: most points of a cloth are far from the body, which may be cheap to tell.
    fn distance_below(&self, p: Vec3, limit: f64) -> Result<(f64, Vec3), f64> {
        self.distance(p).filter(|(d, _)| *d < limit).ok_or(0.0)
    }
    /// Hessian of the distance \[1/m\]; zero where nothing is near.
    fn curvature(&self, p: Vec3) -> Mat3;
}

impl Surface for DistanceField {
    fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
        self.sample(p).map(|s| (s.distance, s.gradient))
    }

    fn distance_below(&self, p: Vec3, limit: f64) -> Result<(f64, Vec3), f64> {
        self.sample_below(p, limit)
            .map(|s| (s.distance, s.gradient))
    }

    fn curvature(&self, p: Vec3) -> Mat3 {
        self.sample_with_hessian(p)
            .map_or_else(Mat3::zeros, |(_, hessian)| hessian)
    }
}

/// No body: cloth hangs free.
#[derive(Clone, Copy, Debug)]
pub struct Nothing;

impl Surface for Nothing {
    fn distance(&self, _: Vec3) -> Option<(f64, Vec3)> {
        None
    }

    fn curvature(&self, _: Vec3) -> Mat3 {
        Mat3::zeros()
    }
}

/// How cloth meets the body.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ContactParams {
    /// Distance h at which cloth starts to feel the body \[m\]: half the cloth's
    /// thickness plus what edges cut off at curved places. 2e-3 to 5e-3. The paper gives none.
    pub thickness: f64,
    /// κ₀ \[N/m³\]: pressure per depth. Higher sinks in less and solves slower.
    pub stiffness: f64,
    /// Coulomb's coefficient μ of cloth on the body \[–\]: 0 lets it slide. Cloth on skin 0.2 to 0.6.
    /// The paper has none.
    pub friction: OrFabric,
}

impl Default for ContactParams {
    fn default() -> Self {
        Self {
            thickness: 3e-3,
            stiffness: 5e6,
            friction: OrFabric::Number(0.0),
        }
    }
}

impl ContactParams {
    /// Whether there is friction at all.
    pub fn rubs(&self) -> bool {
        self.friction != OrFabric::Number(0.0)
    }
}

/// Part of the offset h below which contact grows firm: what is left is room for the body's bulge between
/// points, and taut cloth over a sharp fold presses too hard for springs that a hem rests on softly.
const FIRM_FROM: f64 = 0.5;
/// Depth below that at which it resists twice as steeply \[m\].
const FIRM: f64 = 1e-5;

/// U/κ, −∂U/∂d / κ and ∂²U/∂d² / κ at distance d from the body, where cloth touches it.
fn response(d: f64, h: f64) -> [f64; 3] {
    let depth = (FIRM_FROM * h - d).max(0.0);
    let (room, firm) = (h - d, depth * depth / (2.0 * FIRM));
    [
        0.5 * room * room + firm * depth / 3.0,
        room + firm,
        1.0 + depth / FIRM,
    ]
}

/// A point p that the body touches.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Contact {
    /// Contact stiffness κ \[N/m\].
    pub kappa: f64,
    /// Distance at which it begins to feel the body \[m\].
    pub h: f64,
    /// Where it is \[m\].
    pub p: Vec3,
    /// Signed distance \[m\], less than h.
    pub d: f64,
    /// Its gradient \[–\].
    pub n: Vec3,
}

impl Contact {
    /// A point of stiffness `kappa` at `p`; none where the body is farther than `h`.
    pub fn at(surface: &impl Surface, kappa: f64, h: f64, p: Vec3) -> Option<Self> {
        let (d, n) = surface.distance_below(p, h).ok()?;
        Some(Self { kappa, h, p, d, n })
    }

    /// U \[J\].
    pub fn energy(&self) -> f64 {
        self.kappa * response(self.d, self.h)[0]
    }

    /// −∂U/∂p \[N\].
    pub fn force(&self) -> Vec3 {
        self.n * (self.kappa * response(self.d, self.h)[1])
    }

    /// ∂²U/∂p² \[N/m\], with the part `curvature` of the curvature term: 1 is exact, 0 makes it positive
    /// semi-definite.
    pub fn stiffness(&self, surface: &impl Surface, curvature: f64) -> Mat3 {
        let [_, push, slope] = response(self.d, self.h);
        let mut k = self.n * self.n.transpose() * slope;
        if curvature > 0.0 {
            k -= surface.curvature(self.p) * (curvature * push);
        }
        k * self.kappa
    }

    /// Gradient of λ·push, where push is the [`Self::force`], by the distance d and by its gradient.
    pub fn distance_pull_back(&self, lambda: Vec3) -> (f64, Vec3) {
        let [_, push, slope] = response(self.d, self.h);
        (
            -self.kappa * slope * self.n.dot(&lambda),
            lambda * (self.kappa * push),
        )
    }
}

#[cfg(test)]
pub(crate) mod fixtures {
    //! Solids with closed-form distances.

    use super::*;

    /// The half-space below `height`.
    pub(crate) struct Floor {
        pub(crate) height: f64,
    }

    impl Surface for Floor {
        fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
            Some((p.y - self.height, Vec3::y()))
        }

        fn curvature(&self, _: Vec3) -> Mat3 {
            Mat3::zeros()
        }
    }

    /// A leaning, flattened cone: at height y the points with
    /// hypot(x − lean · y, flat · z) = radius − slope · y.
    /// Round (`flat` 1) and upright (`lean` 0), cloth can turn on it freely.
    #[derive(Clone, Copy)]
    pub(crate) struct Cone {
        pub(crate) radius: f64,
        pub(crate) slope: f64,
        pub(crate) flat: f64,
        pub(crate) lean: f64,
    }

    impl Cone {
        /// Rows map p to (x − lean · y, flat · z).
        fn across(&self) -> (Vec3, Vec3) {
            (
                Vec3::new(1.0, -self.lean, 0.0),
                Vec3::new(0.0, 0.0, self.flat),
            )
        }
    }

    impl Surface for Cone {
        fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
            let (u, v) = self.across();
            let rho = u.dot(&p).hypot(v.dot(&p));
            let cosine = 1.0 / self.slope.hypot(1.0);
            let d = (rho - self.radius + self.slope * p.y) * cosine;
            let outward = (u * u.dot(&p) + v * v.dot(&p)) / rho;
            Some((d, (outward + Vec3::y() * self.slope) * cosine))
        }

        fn curvature(&self, p: Vec3) -> Mat3 {
            let (u, v) = self.across();
            let rho = u.dot(&p).hypot(v.dot(&p));
            let around = (v * u.dot(&p) - u * v.dot(&p)) / rho;
            around * around.transpose() / (rho * self.slope.hypot(1.0))
        }
    }

    /// A ball about the origin.
    pub(crate) struct Ball {
        pub(crate) radius: f64,
    }

    impl Surface for Ball {
        fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
            Some((p.norm() - self.radius, p.normalize()))
        }

        fn curvature(&self, p: Vec3) -> Mat3 {
            let n = p.normalize();
            (Mat3::identity() - n * n.transpose()) / p.norm()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixtures::{Ball, Cone};
    use super::*;
    use crate::check::assert_derivative;

    fn check(surface: &impl Surface, p: Vec3) {
        let at = |p: Vec3| Contact::at(surface, 3.0, 0.1, p).expect("the point must touch");
        let d = Vec3::new(0.3, -0.5, 0.7);
        let q = Vec3::new(-0.2, 0.9, 0.4);
        let slope = -at(p).force().dot(&d);
        assert_derivative(|s| at(p + d * s).energy(), slope, 1e-5, 1e-3, 1e-7);
        let k = at(p).stiffness(surface, 1.0);
        let g = |s: f64| -at(p + d * s).force().dot(&q);
        assert_derivative(g, q.dot(&(k * d)), 1e-5, 1e-3, 1e-7);
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        check(&Ball { radius: 1.0 }, Vec3::new(0.6, 0.5, -0.68));
        // Inside, where it is firm.
        check(&Ball { radius: 1.0 }, Vec3::new(0.5, 0.5, -0.68));
        let cone = Cone {
            radius: 1.0,
            slope: 0.3,
            flat: 0.9,
            lean: 0.1,
        };
        check(&cone, Vec3::new(0.6, -0.1, 0.83));
    }

    #[test]
    fn straps_of_tight_garments_stay_outside() {
        // Where they cut in, the tightest of the 2021 templates press with some 200 kPa on an average
        // body; with contact softer than this, hundreds of triangles of the body came through them.
        let params = ContactParams::default();
        let ball = Ball { radius: 1.0 };
        let p = Vec3::x() * (1.0 + 0.1 * params.thickness);
        let contact = Contact::at(&ball, params.stiffness, params.thickness, p);
        let pressure = contact.expect("touches").force().norm();
        assert!(pressure > 200e3, "{pressure}");
    }

    #[test]
    fn nothing_pushes_where_nothing_touches() {
        let ball = Ball { radius: 1.0 };
        let far = Vec3::new(2.0, 0.0, 0.0);
        assert_eq!(Contact::at(&ball, 1.0, 0.1, far), None);
    }
}
