//! Integration tests, one binary: what no module can see of itself.

mod architecture;
mod gradient;
