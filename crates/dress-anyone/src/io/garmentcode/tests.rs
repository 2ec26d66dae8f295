//! Reading and writing together: hand-made mistakes, generated patterns, arbitrary bytes, and the
//! shared garments where they are at hand.

mod generated;

use super::*;
use crate::fixture::{GARMENTS, shared};
use crate::geometry::{Vec2, Vec3};
use crate::pattern::Curve;
use approx::assert_relative_eq;
use serde_json::json;

/// Positions that were scaled to file units and back agree to this \[m\].
const SAME: f64 = 1e-9;

fn parsed(document: &Value) -> Result<Specification, BadInput> {
    let bytes = serde_json::to_vec(document).unwrap();
    parse(Path::new("p.json"), &bytes, &ReadOptions::default())
}

/// Two squares of 20 cm, sewn along one side.
fn two_squares() -> Value {
    let panel = json!({
        "translation": [10.0, 100.0, 20.0],
        "rotation": [0.0, 0.0, 0.0],
        "vertices": [[0, 0], [20, 0], [20, 20], [0, 20]],
        "edges": [
            {"endpoints": [0, 1]}, {"endpoints": [1, 2]},
            {"endpoints": [2, 3]}, {"endpoints": [3, 0]},
        ],
    });
    json!({
        "pattern": {
            "panels": {"front": panel.clone(), "back": panel},
            "stitches": [[{"panel": "front", "edge": 1}, {"panel": "back", "edge": 3}]],
        },
        "properties": {"curvature_coords": "relative", "units_in_meter": 100},
    })
}

/// [`two_squares`] with the value at a JSON pointer replaced.
fn with(pointer: &str, value: Value) -> Value {
    let mut document = two_squares();
    let (parent, key) = pointer.rsplit_once('/').unwrap();
    match document.pointer_mut(parent).unwrap() {
        Value::Array(list) => list[key.parse::<usize>().unwrap()] = value,
        Value::Object(object) => drop(object.insert(key.to_owned(), value)),
        other => panic!("{other} holds nothing"),
    }
    document
}

fn assert_same(a: &Pattern, b: &Pattern) {
    assert_eq!(a.stitches, b.stitches);
    assert_eq!(a.panels.len(), b.panels.len());
    for (p, q) in a.panels.iter().zip(&b.panels) {
        assert_eq!((&p.name, &p.label), (&q.name, &q.label));
        assert_eq!(p.vertices.len(), q.vertices.len());
        for (v, w) in p.vertices.iter().zip(&q.vertices) {
            assert_relative_eq!(v, w, epsilon = SAME);
        }
        let (there, again) = (p.placement, q.placement);
        assert_relative_eq!(there.translation, again.translation, epsilon = SAME);
        assert_relative_eq!(there.rotation, again.rotation, epsilon = SAME);
        for (e, f) in p.edges.iter().zip(&q.edges) {
            assert_eq!((e.start, e.end, &e.label), (f.start, f.end, &f.label));
            assert_same_curve(&e.curve, &f.curve);
        }
    }
}

fn assert_same_curve(a: &Curve, b: &Curve) {
    match (a, b) {
        (Curve::Quadratic(c), Curve::Quadratic(d)) => assert_relative_eq!(c, d, epsilon = SAME),
        (Curve::Cubic([c, e]), Curve::Cubic([d, f])) => {
            assert_relative_eq!(c, d, epsilon = SAME);
            assert_relative_eq!(e, f, epsilon = SAME);
        }
        (Curve::Arc { radius: r, .. }, Curve::Arc { radius: s, .. }) => {
            // A nearly straight arc has a radius of kilometres, so the comparison is relative.
            assert_relative_eq!(r, s, max_relative = 1e-14);
            let with_radius = |curve: &Curve| match *curve {
                Curve::Arc {
                    large,
                    counter_clockwise,
                    ..
                } => (large, counter_clockwise),
                _ => unreachable!("both are arcs"),
            };
            assert_eq!(with_radius(a), with_radius(b));
        }
        (a, b) => assert_eq!(a, b),
    }
}

#[test]
fn a_relative_control_point_lies_left_of_its_edge() {
    let curvature = json!({"type": "quadratic", "params": [[0.5, 0.25]]});
    let read = parsed(&with("/pattern/panels/front/edges/0/curvature", curvature)).unwrap();
    // From (0, 0) to (0.2, 0) m: half way along, a quarter of the edge up.
    let expected = Curve::Quadratic(Vec2::new(0.1, 0.05));
    assert_eq!(read.pattern.panels[0].edges[0].curve, expected);
}

#[test]
fn both_spellings_and_both_coordinates_say_the_same() {
    let pointer = "/pattern/panels/front/edges/0/curvature";
    let modern = json!({"type": "quadratic", "params": [[0.5, 0.25]]});
    let modern = parsed(&with(pointer, modern)).unwrap();
    let list = parsed(&with(pointer, json!([0.5, 0.25]))).unwrap();
    assert_eq!(modern.pattern, list.pattern);
    let mut absolute = with(pointer, json!([10.0, 5.0]));
    absolute["properties"]["curvature_coords"] = json!("absolute");
    assert_same(&modern.pattern, &parsed(&absolute).unwrap().pattern);
}

#[test]
fn lengths_and_radii_are_in_the_unit_of_the_file() {
    let arc = json!({"type": "circle", "params": [15.0, 0, 1]});
    let mut document = with("/pattern/panels/front/edges/0/curvature", arc);
    document["properties"]["units_in_meter"] = json!(300);
    let panel = &parsed(&document).unwrap().pattern.panels[0];
    assert_relative_eq!(panel.vertices[1].x, 20.0 / 300.0);
    assert_relative_eq!(panel.placement.translation.y, 100.0 / 300.0);
    let expected = Curve::Arc {
        radius: 15.0 / 300.0,
        large: false,
        counter_clockwise: true,
    };
    assert_eq!(panel.edges[0].curve, expected);
}

#[test]
fn the_two_rotation_orders_differ_only_with_two_angles() {
    let read_as = |angles: Value, rotation: RotationOrder| {
        let document = with("/pattern/panels/front/rotation", angles);
        let bytes = serde_json::to_vec(&document).unwrap();
        let read = parse(Path::new("p"), &bytes, &ReadOptions { rotation }).unwrap();
        read.pattern.panels[0].placement.rotation
    };
    let (extrinsic, intrinsic) = (RotationOrder::Extrinsic, RotationOrder::Intrinsic);
    let one = json!([0, 40, 0]);
    assert_eq!(read_as(one.clone(), extrinsic), read_as(one, intrinsic));
    let two = json!([90, 90, 0]);
    // A quarter turn about x brings y to z; a quarter turn about y then brings z to x.
    let y = Vec3::y();
    assert_relative_eq!(
        read_as(two.clone(), extrinsic) * y,
        Vec3::x(),
        epsilon = 1e-15
    );
    // The other way round, y first: y stays, then goes to z.
    assert_relative_eq!(read_as(two, intrinsic) * y, Vec3::z(), epsilon = 1e-15);
}

#[test]
fn a_right_wrong_stitch_and_a_clockwise_panel_are_kept() {
    let stitch =
        json!([{"panel": "front", "edge": 1}, {"panel": "back", "edge": 3}, "right_wrong"]);
    let mut document = with("/pattern/stitches/0", stitch);
    document["pattern"]["panels"]["back"]["vertices"] = json!([[20, 0], [0, 0], [0, 20], [20, 20]]);
    let read = parsed(&document).unwrap();
    assert!(read.pattern.stitches[0].right_wrong);
    assert!(read.pattern.panels[1].signed_area() < 0.0);
}

#[test]
fn each_mistake_is_told_with_its_place() {
    let front = "/pattern/panels/front";
    let at = |pointer: &str, value: Value| with(&format!("{front}{pointer}"), value);
    let radius = json!({"type": "circle", "params": [-1, 0, 1]});
    let cubic = json!({"type": "cubic", "params": [[0.1, 0.2]]});
    let far = json!({"type": "quadratic", "params": [[0.5, 1e9]]});
    let twice = json!([[{"panel": "front", "edge": 1}, {"panel": "back", "edge": 3}],
                       [{"panel": "front", "edge": 1}, {"panel": "back", "edge": 2}]]);
    let itself = json!([[{"panel": "front", "edge": 1}, {"panel": "front", "edge": 1}]]);
    let no_panel = json!([{"panel": "fornt", "edge": 1}, {"panel": "back", "edge": 3}]);
    let no_edge = json!([{"panel": "front", "edge": 4}, {"panel": "back", "edge": 3}]);
    for (document, told) in [
        (json!([1, 2]), "no GarmentCode specification"),
        (json!({"pattern": {"panels": {}}}), "has no panels"),
        (
            at("/vertices/2", json!([20])),
            "panel `front`: vertex 2 must be two numbers",
        ),
        (at("/vertices/2", json!([20, null])), "found [20,null]"),
        (
            at("/vertices/2", json!([1e9, 0])),
            "vertex 2 is 10000000 m away",
        ),
        (
            at("/vertices", json!("none")),
            "panel `front`: has no list of `vertices`",
        ),
        (
            at("/edges", json!({})),
            "panel `front`: has no list of `edges`",
        ),
        (at("/edges", json!([])), "has 0 edges"),
        (
            at("/edges/1/endpoints", json!([1, 9])),
            "edge 1: ends at corner 9",
        ),
        (
            at("/edges/1/endpoints", json!([1, -2])),
            "edge 1: has no `endpoints`",
        ),
        (
            at("/edges/1/endpoints", json!([2, 1])),
            "edge 1: starts at corner 2, but edge 0",
        ),
        (
            at("/edges/1/curvature", radius),
            "edge 1: an arc has a radius above zero",
        ),
        (
            at("/edges/1/curvature", cubic),
            "a cubic curve has two control points",
        ),
        (
            at("/edges/1/curvature", json!({"type": "nurbs"})),
            "the type of a curve",
        ),
        (
            at("/edges/1/curvature", far),
            "a control point is 200000000 m away",
        ),
        (
            at("/rotation", json!([0, 0])),
            "`rotation` must be three numbers",
        ),
        (
            at("/vertices/1", json!([0, 0])),
            "edge 0: starts and ends at the same point",
        ),
        (
            at("/vertices", json!([[0, 0], [20, 0], [10, 0], [5, 0]])),
            "encloses no area",
        ),
        (
            at("/vertices", json!([[0, 0], [20, 20], [20, 0], [0, 20]])),
            "edge 0 crosses edge 2",
        ),
        (
            with("/pattern/stitches", twice),
            "stitch 1: sews edge 1 of panel `front`, which stitch 0",
        ),
        (with("/pattern/stitches", itself), "to itself"),
        (
            with("/pattern/stitches/0", no_panel),
            "stitch 0: names panel `fornt`",
        ),
        (
            with("/pattern/stitches/0", no_edge),
            "stitch 0: names edge 4 of panel `front`, which has 4",
        ),
        (
            with("/pattern/stitches/0", json!([1])),
            "stitch 0: must be two sides",
        ),
        (
            with("/properties/units_in_meter", json!(0)),
            "`units_in_meter` must be",
        ),
        (
            with("/properties/curvature_coords", json!("polar")),
            "`curvature_coords` must be",
        ),
    ] {
        let error = parsed(&document).unwrap_err().to_string();
        assert!(error.contains(told), "expected: {told}\nfound: {error}");
    }
}

#[test]
fn independent_mistakes_are_told_together() {
    let mut document = with("/pattern/panels/front/vertices/2", json!([20]));
    document["pattern"]["panels"]["back"]["edges"][1]["endpoints"] = json!([1, 9]);
    document["pattern"]["stitches"][0][0]["panel"] = json!("fornt");
    // The broken vertex; the end that does not exist and the loop it breaks; the stitch.
    assert_eq!(parsed(&document).unwrap_err().problems.len(), 4);
}

#[test]
fn what_can_be_tolerated_is_noted() {
    let mut document = two_squares();
    document.as_object_mut().unwrap().remove("properties");
    let panels = &mut document["pattern"]["panels"];
    panels["front"].as_object_mut().unwrap().remove("rotation");
    panels["front"]["edges"][1]["label"] = json!("left_collar");
    panels["back"]["edges"][3]["label"] = json!("my_own_label");
    let notes = parsed(&document).unwrap().notes.join("\n");
    for noted in [
        "`units_in_meter`",
        "`curvature_coords`",
        "panel `front`: `rotation`",
        "stitch 0 joins edges labelled `left_collar` and `my_own_label`",
    ] {
        assert!(notes.contains(noted), "{noted} is not in: {notes}");
    }
}

#[test]
fn a_mesh_given_as_a_garment_is_recognised() {
    let told = |bytes: &[u8]| {
        let error = parse(Path::new("body.obj"), bytes, &ReadOptions::default());
        error.unwrap_err().to_string()
    };
    let obj = told(b"# made by hand\nv 0 0 0\nv 1 0 0\nf 1 2 3\n");
    assert!(obj.contains("looks like an OBJ mesh"), "{obj}");
    assert!(told(b"ply\nformat ascii 1.0\n").contains("a PLY mesh"));
    assert!(told(b"\xff\xfe\x00").contains("not valid JSON"));
}

#[test]
fn writing_back_keeps_what_is_not_understood() {
    let mut document = with(
        "/pattern/panels/front/edges/0/curvature",
        json!([0.5, 0.25]),
    );
    document["parameters"] = json!({"length": 3});
    document["pattern"]["panels"]["front"]["edges"][2]["note"] = json!("fold here");
    let read = parsed(&document).unwrap();
    let mut pattern = read.pattern.clone();
    pattern.panels[0].vertices[0] = Vec2::new(-0.01, 0.0);
    pattern.panels[0].edges[3].curve = Curve::Cubic([Vec2::new(0.0, 0.15), Vec2::new(-0.02, 0.05)]);
    let written = write(&pattern, Some(&read));
    assert_eq!(written["parameters"], document["parameters"]);
    let front = &written["pattern"]["panels"]["front"];
    assert_eq!(front["edges"][2]["note"], "fold here");
    assert_eq!(front["vertices"][0], json!([-1.0, 0.0]));
    assert!(front["edges"][0]["curvature"].is_array());
    assert_eq!(front["edges"][3]["curvature"]["type"], "cubic");
    assert_same(&pattern, &parsed(&written).unwrap().pattern);
}

#[test]
fn every_shared_garment_is_accepted_and_survives_writing() {
    for path in shared(&GARMENTS, "json") {
        let read = read(&path, &ReadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
        let back = write(&read.pattern, Some(&read));
        assert_same(&read.pattern, &parsed(&back).unwrap().pattern);
        let fresh = write(&read.pattern, None);
        assert_same(&read.pattern, &parsed(&fresh).unwrap().pattern);
    }
}
