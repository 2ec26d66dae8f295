//! Statistical body models: npz.
#![no_main]

use dress_anyone::io::body_model::parse;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    // Nothing to hold on to in what is accepted: it is for the fit to use.
    let _ = parse(Path::new("model.npz"), bytes);
});
