//! The control cage of each panel (paper §4.3): control points ζ carry the rest shape x̄ = x̄(ζ).

pub mod enclose;
#[cfg(test)]
pub(crate) mod fixture;
pub mod green;
