//! The `dress` program.

#![allow(
    dead_code,
    unused_imports,
    unreachable_pub,
    reason = "the commands that call these modules are not written yet"
)]

mod params;
mod picture;
mod progress;

fn main() {}
