//! The refit (paper §4).

pub mod dress;
