//! Painted ease: points with a number each.
#![no_main]

use dress_anyone::io::paint::parse;
use libfuzzer_sys::fuzz_target;

fuzz_target!(|bytes: &[u8]| {
    if let Ok((points, values)) = parse(bytes) {
        assert_eq!(points.len(), values.len());
        assert!(points.iter().all(|p| p.iter().all(|v| v.is_finite())));
        assert!(values.iter().all(|v| v.is_finite()));
    }
});
