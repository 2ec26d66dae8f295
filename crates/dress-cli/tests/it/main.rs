//! The program as its users run it: files in, exit status and messages out.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod fixtures;
mod good_input;
mod gradient;
