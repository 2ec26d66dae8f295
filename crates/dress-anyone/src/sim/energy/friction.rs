//! Coulomb friction of cloth on the body, as elastic–plastic anchors (METHOD §2.3).
//!
//! A contact point p that carries the load N is tied to its anchor a, where it began to touch, by a
//! spring across the normal n: u = (I − nnᵀ)(p − a), f = −k u as long as k|u| ≤ μN (it sticks), and
//! −μN u/|u| beyond (it slips). With N and n of the last look that is the gradient of a convex
//! potential, which the static solve minimises; looks and solves alternate until they agree. The
//! exact stiffness at the end, anchors fixed, has N and n follow p, and is not symmetric.

use super::contact::{Contact, Surface};
use crate::geometry::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// Stiffness k of the tie, as part of the contact's: what sticks creeps by five times as much as
/// contact yields.
const TIE: f64 = 0.2;

/// A contact point with friction.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Grip {
    /// Where it began to touch \[m\]; none while it does not.
    anchor: Option<Vec3>,
    /// Unit normal of the body at the last look.
    normal: Vec3,
    /// μN \[N\] at the last look.
    limit: f64,
}

impl Grip {
    /// Takes load and normal from where the point, of contact stiffness `kappa` \[N/m\] and offset
    /// `h` \[m\], now is.
    pub fn look(&mut self, surface: &impl Surface, mu: f64, [kappa, h]: [f64; 2], p: Vec3) {
        let contact = Contact::at(surface, kappa, h, p);
        let push = contact.map_or(Vec3::zeros(), |contact| contact.force());
        let load = push.norm();
        if load > 0.0 {
            let anchor = self.anchor.unwrap_or(p);
            *self = Self {
                anchor: Some(anchor),
                normal: push / load,
                limit: mu * load,
            };
        } else {
            *self = Self::default();
        }
    }

    /// The slip u \[m\]; none where nothing touches.
    fn slip(&self, p: Vec3) -> Option<Vec3> {
        let w = p - self.anchor?;
        Some(w - self.normal * self.normal.dot(&w))
    }

    /// Whether it gives way.
    pub fn slips(&self, kappa: f64, p: Vec3) -> bool {
        (self.slip(p)).is_some_and(|u| TIE * kappa * u.norm() > self.limit)
    }

    /// ½ k|u|², linear beyond the limit \[J\].
    pub fn energy(&self, kappa: f64, p: Vec3) -> f64 {
        let k = TIE * kappa;
        self.slip(p).map_or(0.0, |u| {
            let length = u.norm();
            if self.slips(kappa, p) {
                self.limit * (length - 0.5 * self.limit / k)
            } else {
                0.5 * k * length * length
            }
        })
    }

    /// −∂U/∂p \[N\].
    pub fn force(&self, kappa: f64, p: Vec3) -> Vec3 {
        let k = TIE * kappa;
        self.slip(p).map_or_else(Vec3::zeros, |u| {
            if self.slips(kappa, p) {
                u * (-self.limit / u.norm())
            } else {
                u * -k
            }
        })
    }

    /// ∂²U/∂p² \[N/m\], positive semi-definite; none where nothing touches.
    pub fn stiffness(&self, kappa: f64, p: Vec3) -> Option<Mat3> {
        let k = TIE * kappa;
        let u = self.slip(p)?;
        let across = Mat3::identity() - self.normal * self.normal.transpose();
        Some(if self.slips(kappa, p) {
            let (length, t) = (u.norm(), u.normalize());
            (across - t * t.transpose()) * (self.limit / length)
        } else {
            across * k
        })
    }

    /// Change of the force with that of the contact's push N n, which load and normal follow, of
    /// coefficient `mu`; the point stays. None where nothing touches.
    pub fn follow(&self, mu: f64, kappa: f64, p: Vec3) -> Option<Mat3> {
        let (k, u) = (TIE * kappa, self.slip(p)?);
        let (n, load) = (self.normal, self.limit / mu);
        let w = p - self.anchor?;
        // The push changes its length by dN = nᵀ d(Nn), its direction by dn = (I − nnᵀ) d(Nn) / N.
        let turning = (Mat3::identity() - n * n.transpose()) / load;
        let slipping = turning * n.dot(&w) + n * (w.transpose() * turning);
        Some(if self.slips(kappa, p) {
            let (length, t) = (u.norm(), u.normalize());
            let beside = (Mat3::identity() - t * t.transpose()) * slipping;
            beside * (self.limit / length) - t * n.transpose() * mu
        } else {
            slipping * k
        })
    }

    /// Derivative of the force by the coefficient, `mu` \[N\]; zero where it sticks.
    pub fn by_coefficient(&self, mu: f64, kappa: f64, p: Vec3) -> Vec3 {
        if self.slips(kappa, p) {
            self.force(kappa, p) / mu
        } else {
            Vec3::zeros()
        }
    }

    /// What the exact −∂f/∂p \[N/m\] has beyond [`Self::stiffness`]: load and normal follow the
    /// contact, of coefficient `mu`. None where nothing touches.
    pub fn drift(
        &self,
        surface: &impl Surface,
        mu: f64,
        [kappa, h]: [f64; 2],
        p: Vec3,
    ) -> Option<Mat3> {
        let pressing = Contact::at(surface, kappa, h, p)?.stiffness(surface, 1.0);
        Some(self.follow(mu, kappa, p)? * pressing)
    }
}

#[cfg(test)]
mod tests {
    use super::super::contact::fixtures::Ball;
    use super::*;
    use crate::check::assert_derivative;

    const MU: f64 = 0.4;
    const AT: [f64; 2] = [3.0, 0.1];

    /// A grip anchored beside p by `away`, as part of the slip at which it gives way.
    fn grip(away: f64) -> (Ball, Grip, Vec3) {
        let ball = Ball { radius: 1.0 };
        let p = Vec3::new(0.6, 0.5, -0.68);
        let mut grip = Grip::default();
        grip.look(&ball, MU, AT, p);
        let give = grip.limit / (TIE * AT[0]);
        grip.anchor = Some(p - Vec3::new(0.5, -0.3, 0.4).normalize() * (away * give));
        (ball, grip, p)
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        for away in [0.5, 3.0] {
            let (_, grip, p) = grip(away);
            let d = Vec3::new(0.3, -0.5, 0.7);
            let q = Vec3::new(-0.2, 0.9, 0.4);
            let slope = -grip.force(AT[0], p).dot(&d);
            assert_derivative(|s| grip.energy(AT[0], p + d * s), slope, 1e-5, 1e-3, 1e-7);
            let k = grip.stiffness(AT[0], p).expect("touches");
            let pull = |s: f64| -grip.force(AT[0], p + d * s).dot(&q);
            assert_derivative(pull, q.dot(&(k * d)), 1e-5, 1e-3, 1e-7);
        }
    }

    #[test]
    fn the_exact_stiffness_has_load_and_normal_follow() {
        for away in [0.5, 3.0] {
            let (ball, grip, p) = grip(away);
            let d = Vec3::new(0.3, -0.5, 0.7);
            let q = Vec3::new(-0.2, 0.9, 0.4);
            let k = grip.stiffness(AT[0], p).expect("touches")
                + grip.drift(&ball, MU, AT, p).expect("touches");
            let pull = |s: f64| {
                let mut moved = grip;
                moved.look(&ball, MU, AT, p + d * s);
                -moved.force(AT[0], p + d * s).dot(&q)
            };
            assert_derivative(pull, q.dot(&(k * d)), 1e-6, 1e-3, 1e-7);
        }
    }

    #[test]
    fn what_leaves_the_body_forgets_its_anchor() {
        let (ball, mut grip, p) = grip(0.5);
        grip.look(&ball, MU, AT, p * 2.0);
        assert_eq!(grip, Grip::default());
        assert_eq!(grip.force(AT[0], p), Vec3::zeros());
    }
}
