//! Body meshes: OBJ, PLY, STL.
#![no_main]

use dress_anyone::io::body::{BodyOptions, parse};
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    if let Ok(body) = parse(Path::new("body"), bytes, &BodyOptions::default()) {
        let mesh = &body.mesh;
        assert!(mesh.positions.iter().all(|p| p.iter().all(|v| v.is_finite())));
        let count = mesh.positions.len() as u32;
        assert!(mesh.triangles.as_flattened().iter().all(|&v| v < count));
    }
});
