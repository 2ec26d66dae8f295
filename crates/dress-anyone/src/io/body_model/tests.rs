use super::super::npz::tests::{npy, zip};
use super::*;

/// A member of 32-bit reals.
fn reals(shape: &str, values: &[f32]) -> Vec<u8> {
    let data: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
    npy("'<f4'", "False", shape, &data)
}

/// Four vertices, 22 joints in a chain, two components.
fn members() -> Vec<(&'static str, Vec<u8>)> {
    let joints = LEAST_JOINTS;
    let mut regressor = vec![0.0; joints * 4];
    let mut weights = vec![0.0; 4 * joints];
    (0..joints).for_each(|j| regressor[4 * j + j % 4] = 1.0);
    (0..4).for_each(|v| weights[joints * v + v] = 1.0);
    let mut tree: Vec<f32> = (0..joints).map(|j| j as f32 - 1.0).collect();
    tree[0] = 4_294_967_295.0;
    tree.extend((0..joints).map(|j| j as f32));
    let template: Vec<f32> = (0..12).map(|i| i as f32).collect();
    let shapes: Vec<f32> = (0..24).map(|i| i as f32).collect();
    vec![
        ("v_template", reals("(4, 3)", &template)),
        ("shapedirs", reals("(4, 3, 2)", &shapes)),
        ("J_regressor", reals("(22, 4)", &regressor)),
        ("weights", reals("(4, 22)", &weights)),
        ("kintree_table", reals("(2, 22)", &tree)),
        ("f", reals("(2, 3)", &[0.0, 1.0, 2.0, 2.0, 1.0, 3.0])),
    ]
}

fn complaint(members: &[(&str, Vec<u8>)]) -> String {
    parse(Path::new("m.npz"), &zip(members, true, None))
        .unwrap_err()
        .to_string()
}

#[test]
fn a_small_model_in_smpls_layout_is_read() {
    let model = parse(Path::new("m.npz"), &zip(&members(), true, None)).unwrap();
    let parts = model.parts();
    assert_eq!(
        (
            parts.shape_count,
            parts.stretches.len(),
            parts.joint_count()
        ),
        (2, 0, 22)
    );
    assert_eq!(parts.parents[..3], [None, Some(0), Some(1)]);
    // shapedirs[v, c, k] = 6v + 2c + k.
    assert_eq!(parts.directions[2 * 3 + 1], Vec3::new(19.0, 21.0, 23.0));
    let mut shape = model.mean_shape();
    shape.components[0] = 2.0;
    // Joint 1 is vertex 1: (3, 4, 5) + 2 · (6, 8, 10).
    assert_eq!(model.joints(&shape)[1], Vec3::new(15.0, 20.0, 25.0));
}

#[test]
fn the_built_in_model_is_good_and_symmetric_in_size() {
    let model = built_in();
    let parts = model.parts();
    assert_eq!((parts.shape_count, parts.stretches.len()), (40, 14));
    assert_eq!(parts.template.positions.len(), 6500);
    let (low, high) = parts.template.bounds();
    // A person's height, soles at 0, and mirrored in x to the millimetre.
    assert!((1.5..1.9).contains(&(high.y - low.y)) && low.y.abs() < 1e-3);
    assert!((low.x + high.x).abs() < 1e-3);
}

#[test]
fn every_array_that_is_wrong_is_named() {
    let mut bad = members();
    bad[2] = ("J_regressor", reals("(4, 22)", &[0.0; 88]));
    bad[3] = ("weights", reals("(4, 22)", &[0.5; 88]));
    bad[5] = ("f", reals("(1, 3)", &[0.0, 1.0, 4.0]));
    let told = complaint(&bad);
    for words in [
        "`J_regressor`: has the shape [4, 22]",
        "`weights`: row 0",
        "`f`: face 0",
    ] {
        assert!(told.contains(words), "{words}: {told}");
    }
    let told = complaint(&members()[1..]);
    assert!(told.contains("`v_template`: is missing"), "{told}");
}

#[test]
fn pickles_and_other_files_are_refused_with_advice() {
    let told = |bytes: &[u8]| parse(Path::new("m.pkl"), bytes).unwrap_err().to_string();
    assert!(told(b"\x80\x02}q\x00").contains("convert_smpl.py"));
    assert!(told(b"v 0 0 0").contains("not an .npz"));
    assert!(told(b"PK\x03\x04 cut").contains("damaged or cut off"));
}
