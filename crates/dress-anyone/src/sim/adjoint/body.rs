//! Derivatives of the equilibrium by the body (METHOD §2.6, §10).
//!
//! The body acts through the distance d and its gradient ∇d at the contact points: the push −κ U′(d) ∇d,
//! and friction, whose load and normal are the push's. With λ = K⁻ᵀ x̂ that gives gradients by d and ∇d
//! at every point that touches; the [`DistanceField`] hands them on to its nodes, whose values are the
//! exact distances of the body's mesh, and to the mesh's vertices. Friction's anchors stay.

use crate::body::DistanceField;
use crate::geometry::{TriangleMesh, Vec3};
use crate::sim::energy::contact::Contact;
use crate::sim::system::System;

/// Gradient by the vertices of `body`, the mesh of the system's field, at positions `x`.
pub fn body_pull_back(
    system: &System<'_, DistanceField>,
    body: &TriangleMesh,
    x: &[Vec3],
    lambda: &[Vec3],
) -> Vec<Vec3> {
    let contact = &system.contact;
    let felt = |(i, point): (usize, &crate::sim::cloth::ContactPoint)| {
        let (kappa, p) = (system.kappa(point), point.at(x));
        let mut push_hat = point.at(lambda);
        if let Some(grip) = system.grips.get(i) {
            let mu = contact.friction.or(point.friction);
            if let Some(follow) = grip.follow(mu, kappa, p) {
                push_hat += follow.transpose() * push_hat;
            }
        }
        let h = contact.thickness;
        let touching = Contact::at(system.surface, kappa, h, p)?;
        let (by_distance, by_gradient) = touching.distance_pull_back(push_hat);
        Some((p, by_distance, by_gradient))
    };
    let points = system.cloth.contacts.iter().enumerate();
    (system.surface).pull_back(body, points.filter_map(felt))
}
