//! The drape (paper §3): cloth on a static body, brought to rest, and its derivatives.
//!
//! [`cloth`] is the topology, [`material`] what it is made of, [`energy`] the pieces of the total energy U(x; x̄), each with its
//! derivatives beside it. [`step`] is the paper's XPBD integrator, which brings placed panels
//! together; [`equilibrium`] then finds f = −∂U/∂x = 0 by Newton's method, and [`adjoint`]
//! differentiates that state. [`mod@drape`] does the first two in order, [`differentiable`] the third.
//! [`trajectory`] drapes and
//! differentiates as the paper does: by time steps alone, and all of them.

pub mod adjoint;
pub mod broken;
pub mod cloth;
pub mod differentiable;
pub mod drape;
pub mod energy;
pub mod equilibrium;
pub mod layers;
pub mod material;
#[cfg(test)]
mod properties;
pub mod step;
pub mod system;
pub mod trajectory;
pub use broken::Broken;
pub use cloth::{Cloth, Fold, Hold, Rest};
pub use differentiable::Differentiable;
pub use drape::{Drape, Scene, SimParams, Solver, Start, drape};
pub use material::{Material, OrFabric};
pub use system::Assembly;
pub use trajectory::Trajectory;
