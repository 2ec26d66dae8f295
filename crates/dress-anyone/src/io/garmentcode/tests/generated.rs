//! Generated patterns, mutilated documents, arbitrary bytes.

use super::*;
use crate::geometry::{Vec2, Vec3};
use crate::pattern::curve::from_edge;
use crate::pattern::{Edge, EdgeId, Panel, Placement, Stitch, validate};
use nalgebra::Rotation3;
use proptest::prelude::*;

fn curve() -> impl Strategy<Value = [f64; 5]> {
    [0.0..4.0, 0.2..0.4, -0.15..0.15, 0.6..0.8, -0.15..0.15]
}

/// A star-shaped panel with curved edges, either way round.
fn panel() -> impl Strategy<Value = Panel> {
    let corners = prop::collection::vec((0.25..0.5, curve(), any::<Option<bool>>()), 3..9);
    (corners, any::<bool>(), prop::array::uniform6(-3.0..3.0)).prop_map(
        |(corners, clockwise, pose)| {
            let n = corners.len();
            let turn = std::f64::consts::TAU / n as f64 * if clockwise { -1.0 } else { 1.0 };
            let corner = |i: usize| {
                let angle = turn * i as f64;
                Vec2::new(angle.cos(), angle.sin()) * corners[i % n].0
            };
            let edge = |i: usize| Edge {
                start: i,
                end: (i + 1) % n,
                curve: curve_between(corner(i), corner((i + 1) % n), corners[i].1),
                label: corners[i]
                    .2
                    .map(|collar| if collar { "left_collar" } else { "hem" }.to_owned()),
            };
            let [x, y, z, roll, pitch, yaw] = pose;
            Panel {
                name: String::new(),
                vertices: (0..n).map(corner).collect(),
                edges: (0..n).map(edge).collect(),
                placement: Placement {
                    rotation: *Rotation3::from_euler_angles(roll, pitch, yaw).matrix(),
                    translation: Vec3::new(x, y, z),
                },
                label: None,
            }
        },
    )
}

fn curve_between(a: Vec2, b: Vec2, [kind, x, y, z, w]: [f64; 5]) -> Curve {
    let control = |x, y| from_edge(Vec2::new(x, y), a, b);
    match kind as usize {
        0 => Curve::Line,
        1 => Curve::Quadratic(control(x, y)),
        2 => Curve::Cubic([control(x, y), control(z, w)]),
        _ => Curve::Arc {
            radius: (b - a).norm() / (4.0 * y.abs()).max(1e-6),
            large: false,
            counter_clockwise: w > 0.0,
        },
    }
}

fn pattern() -> impl Strategy<Value = Pattern> {
    (prop::collection::vec(panel(), 1..4), any::<bool>()).prop_map(|(mut panels, right_wrong)| {
        for (p, panel) in panels.iter_mut().enumerate() {
            panel.name = format!("panel {p}");
        }
        let side = |panel, edge| EdgeId { panel, edge };
        let stitches = (1..panels.len()).map(|p| Stitch {
            sides: [side(p - 1, 0), side(p, 1)],
            right_wrong,
        });
        Pattern {
            stitches: stitches.collect(),
            panels,
        }
    })
}

/// Every path to a value in a document.
fn pointers(value: &Value, here: &str, found: &mut Vec<String>) {
    let children: Vec<(String, &Value)> = match value {
        Value::Array(list) => list
            .iter()
            .enumerate()
            .map(|(i, v)| (i.to_string(), v))
            .collect(),
        Value::Object(object) => object.iter().map(|(k, v)| (k.clone(), v)).collect(),
        _ => Vec::new(),
    };
    for (key, child) in children {
        let pointer = format!("{here}/{key}");
        pointers(child, &pointer, found);
        found.push(pointer);
    }
}

proptest! {
    #[test]
    fn a_fresh_document_reads_as_the_pattern_it_was_written_from(pattern in pattern()) {
        prop_assume!(validate::problems(&pattern).is_empty());
        let read = parsed(&write(&pattern, None)).unwrap();
        assert_same(&pattern, &read.pattern);
        assert_same(&pattern, &parsed(&write(&pattern, Some(&read))).unwrap().pattern);
    }

    #[test]
    fn arbitrary_bytes_never_panic(bytes in prop::collection::vec(any::<u8>(), 0..200)) {
        let _ = parse(Path::new("p"), &bytes, &ReadOptions::default());
    }

    #[test]
    fn a_document_with_anything_replaced_never_panics(
        which in prop::collection::vec((any::<prop::sample::Index>(), 0..12_usize), 1..4)
    ) {
        let mut document = with("/pattern/panels/front/edges/2/curvature",
            json!({"type": "cubic", "params": [[0.2, 0.1], [0.7, -0.1]]}));
        for (index, kind) in which {
            let mut paths = Vec::new();
            pointers(&document, "", &mut paths);
            if paths.is_empty() {
                break;
            }
            let odd = [json!(null), json!([]), json!({}), json!(-1), json!(1e308), json!(u64::MAX),
                json!("front"), json!([0, 0]), json!(2), json!({"type": "circle"}), json!(true),
                json!([[0.5, 9.0], [0.1, -3.0]])];
            *document.pointer_mut(&paths[index.index(paths.len())]).unwrap() = odd[kind].clone();
        }
        if let Ok(read) = parsed(&document) {
            assert_same(&read.pattern, &parsed(&write(&read.pattern, Some(&read))).unwrap().pattern);
        }
    }

    #[test]
    fn a_document_cut_off_anywhere_never_panics(share in 0.0..1.0) {
        let bytes = serde_json::to_vec_pretty(&two_squares()).unwrap();
        let cut = (share * bytes.len() as f64) as usize;
        let error = parse(Path::new("p"), &bytes[..cut], &ReadOptions::default()).unwrap_err();
        prop_assert!(error.to_string().contains("cut off") || cut == 0);
    }
}
