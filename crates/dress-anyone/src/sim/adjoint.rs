//! Derivatives of the equilibrium by the rest shape (METHOD §3.2–3.4).
//!
//! f(x, x̄) = 0 gives K δx = (∂f/∂x̄) δx̄ with K = −∂f/∂x. One factor of the exact K serves the
//! adjoint, λ = K⁻¹ x̂ and x̄̂ = λᵀ ∂f/∂x̄, and the sensitivities ∂x/∂ζ; λ gives the gradients by fabrics
//! ([`fabric`]) and by the body ([`body`]) as well. It is the limit of the
//! paper's time-stepping adjoint (§3.2) at rest, at the price of one solve.

pub mod body;
pub mod fabric;

use super::cloth::{Cloth, GRAVITY, Rest};
use super::energy::{bend, fold, membrane};
use crate::geometry::{Vec2, Vec3};

/// λᵀ ∂f/∂x̄ at positions `x`: membrane, bending, and weight through the lumped masses. Contact
/// stiffness and holds do not depend on x̄.
pub fn rest_pull_back(
    cloth: &Cloth,
    rest: &Rest,
    x_bar: &[Vec2],
    x: &[Vec3],
    lambda: &[Vec3],
) -> Vec<Vec2> {
    let mut hat = vec![Vec2::zeros(); x_bar.len()];
    for (e, t) in cloth.triangles.iter().enumerate() {
        let corners = t.map(|a| x[a as usize]);
        let multipliers = t.map(|a| lambda[a as usize]);
        let material = cloth.material(e);
        let along: f64 = multipliers.iter().map(|l| l.dot(&GRAVITY)).sum();
        let by_rest = membrane::rest_pull_back(
            &rest.triangles[e],
            &material.elasticity,
            corners,
            multipliers,
            along * material.density / 3.0,
        );
        for (v, g) in cloth.rest_triangles[e]
            .iter()
            .zip(material.off_grain(by_rest))
        {
            hat[*v as usize] += g;
        }
    }
    for hinge in &cloth.hinges {
        let corners = hinge.vertices.map(|a| x[a as usize]);
        let multipliers = hinge.vertices.map(|a| lambda[a as usize]);
        let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
        let by_rest = bend::rest_pull_back(sides, cloth.rigidity(hinge), corners, multipliers);
        for (v, g) in hinge.rest.iter().flatten().zip(by_rest.iter().flatten()) {
            hat[*v as usize] += g;
        }
    }
    for (rest, pressed) in rest.folds.iter().zip(&cloth.folds) {
        let hinge = &pressed.hinge;
        let corners = hinge.vertices.map(|a| x[a as usize]);
        let multipliers = hinge.vertices.map(|a| lambda[a as usize]);
        let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
        let by_rest = fold::rest_pull_back(rest, sides, corners, multipliers);
        for (v, g) in hinge.rest.iter().flatten().zip(by_rest.iter().flatten()) {
            hat[*v as usize] += g;
        }
    }
    hat
}

/// (∂f/∂x̄) δx̄ at positions `x` \[N\].
pub fn rest_push_forward(
    cloth: &Cloth,
    rest: &Rest,
    x_bar: &[Vec2],
    x: &[Vec3],
    delta: &[Vec2],
) -> Vec<Vec3> {
    let mut change = vec![Vec3::zeros(); x.len()];
    let still = |v: &[u32]| v.iter().all(|v| delta[*v as usize] == Vec2::zeros());
    for (e, t) in cloth.triangles.iter().enumerate() {
        let at = cloth.rest_triangles[e];
        if still(&at) {
            continue;
        }
        let corners = t.map(|a| x[a as usize]);
        let material = cloth.material(e);
        let forces = membrane::rest_push_forward(
            &rest.triangles[e],
            &material.elasticity,
            corners,
            material.on_grain(at.map(|v| delta[v as usize])),
            GRAVITY * (material.density / 3.0),
        );
        for (a, f) in t.iter().zip(forces) {
            change[*a as usize] += f;
        }
    }
    for hinge in &cloth.hinges {
        if still(&hinge.rest[0]) && still(&hinge.rest[1]) {
            continue;
        }
        let corners = hinge.vertices.map(|a| x[a as usize]);
        let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
        let motion = hinge.rest.map(|side| side.map(|v| delta[v as usize]));
        let forces = bend::rest_push_forward(sides, cloth.rigidity(hinge), corners, motion);
        for (a, f) in hinge.vertices.iter().zip(forces) {
            change[*a as usize] += f;
        }
    }
    for (rest, pressed) in rest.folds.iter().zip(&cloth.folds) {
        let hinge = &pressed.hinge;
        let corners = hinge.vertices.map(|a| x[a as usize]);
        let sides = hinge.rest.map(|side| side.map(|v| x_bar[v as usize]));
        let motion = hinge.rest.map(|side| side.map(|v| delta[v as usize]));
        let forces = fold::rest_push_forward(rest, sides, corners, motion);
        for (a, f) in hinge.vertices.iter().zip(forces) {
            change[*a as usize] += f;
        }
    }
    change
}
