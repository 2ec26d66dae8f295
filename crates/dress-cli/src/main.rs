//! The `dress` program.

#![expect(
    dead_code,
    reason = "the commands that call these modules are not written yet"
)]
#![allow(
    unreachable_pub,
    reason = "modules of a program are written like a library's"
)]

mod params;
mod picture;
mod progress;

fn main() {}
