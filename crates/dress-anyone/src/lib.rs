//! Refits a garment to any body: a 2-D sewing pattern and its drape go in with a new body, and a
//! sewing pattern that can be cut and a drape at rest come out.
//!
//! The method is Chen et al. 2024, "Dress Anyone"; where this library departs from it,
//! `docs/deviations.md` says so and why. Read `refit` first: it is the data flow.
//!
//! # Modules and where the paper has them
//!
//! | module | paper | what |
//! |---|---|---|
//! | [`geometry`] | – | meshes, distances, quality |
//! | [`pattern`] | – | panels, seams, the meshed rest shape |
//! | [`body`] | §4.1 | bodies, and their distance field |
//! | [`body_model`] | §4.1 | a statistical body, fitted to any mesh |
//! | [`garment`] | – | pattern + sewing + fabric + drape |
//! | [`transfer`] | §4.2 | the target shape x* |
//! | [`cage`] | §4.3, §4.5 | control points ζ ↦ rest shape x̄, symmetric |
//! | [`sim`] | §3 | the drape and its adjoint |
//! | [`loss`] | §4.4 | what the refit minimises |
//! | [`descent`] | §4.6 | Levenberg–Marquardt, L-BFGS, gradient descent |
//! | `refit` | §4 | all of it, in order |
//! | [`io`] | – | files; the only place that knows their units |
//!
//! # Notation
//!
//! | paper | code | meaning |
//! |---|---|---|
//! | x | `x` | cloth vertex positions \[m\] |
//! | x̄ | `x_bar` | pattern vertex positions, the rest shape \[m\] |
//! | x* | `x_star` | target shape of the drape \[m\] |
//! | ζ | `zeta` | cage control points \[m\] |
//! | τ | `tau` | velocity kept per step \[–\] |
//! | α̃ | `alpha_tilde` | compliance over Δt² |
//! | –̂ | `…_hat` | gradient of the loss by … |
//!
//! SI units throughout; y is up; bodies face +z. Results do not depend on the number of threads.

#[cfg(test)]
mod check;
#[cfg(test)]
mod fixture;

pub mod body;
pub mod body_model;
pub mod cage;
pub mod descent;
pub mod garment;
pub mod geometry;
pub mod io;
pub mod loss;
pub mod pattern;
pub mod problem;
pub mod refit;
pub mod report;
pub mod sim;
pub mod transfer;
