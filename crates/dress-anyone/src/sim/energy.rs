//! The pieces of the total energy, one per file, value beside derivatives.

pub mod bend;
pub mod contact;
pub mod fold;
pub mod friction;
pub mod layers;
pub mod membrane;
