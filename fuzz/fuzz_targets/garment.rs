//! Patterns (JSON) and drapes (OBJ).
#![no_main]

use dress_anyone::io::garment::{GarmentOptions, parse};
use dress_anyone::io::garment_obj::UvOptions;
use dress_anyone::io::garmentcode::RotationOrder;
use libfuzzer_sys::fuzz_target;
use std::path::Path;

fuzz_target!(|bytes: &[u8]| {
    let options = GarmentOptions {
        resolution: 0.05,
        rotation: RotationOrder::Extrinsic,
        uv: UvOptions {
            uv_scale: None,
            metres_per_unit: None,
            up: None,
        },
    };
    if let Ok(loaded) = parse(Path::new("garment"), bytes, &options) {
        let mesh = &loaded.garment.mesh;
        assert!(mesh.x_bar.iter().all(|x| x.iter().all(|v| v.is_finite())));
        let count = mesh.x_bar.len() as u32;
        assert!(mesh.triangles.as_flattened().iter().all(|&v| v < count));
        if let Some(drape) = &loaded.garment.drape {
            assert_eq!(drape.len(), mesh.cloth_vertex_count);
        }
    }
});
