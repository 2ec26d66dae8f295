//! Every bad input ends with exit status 2, words a designer understands, and nothing written.

use crate::fixtures::{Ran, Workplace, body, garment};
use serde_json::{Value, json};

/// Asserts that a run refused its input in these words, and that `place` is as it was `before`.
#[track_caller]
fn assert_refused(place: &Workplace, before: &[String], ran: &Ran, words: &[&str]) {
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    for word in words {
        assert!(
            ran.stderr.contains(word),
            "`{word}` is not in: {}",
            ran.stderr
        );
    }
    assert_eq!(ran.stdout, "");
    assert!(!ran.stderr.contains("panicked"), "{}", ran.stderr);
    assert_eq!(place.names(), before);
}

/// Refits, drapes and inspects a bad garment.
#[track_caller]
fn assert_bad_garment(name: &str, content: impl AsRef<[u8]>, words: &[&str]) {
    let place = Workplace::new();
    place.file(name, content);
    let before = place.names();
    let named = [&[name], words].concat();
    assert_refused(&place, &before, &place.refit(name, "body.obj", &[]), &named);
    let drape = [
        "drape",
        "--garment",
        name,
        "--body",
        "body.obj",
        "--out",
        "out",
    ];
    assert_refused(&place, &before, &place.dress(&drape), &named);
    let inspect = ["inspect", "--as", "garment", name];
    assert_refused(&place, &before, &place.dress(&inspect), &named);
}

/// Refits to, and inspects, a bad body.
#[track_caller]
fn assert_bad_body(content: &str, words: &[&str]) {
    let place = Workplace::new();
    place.file("bad.obj", content);
    let before = place.names();
    let named = [&["bad.obj"], words].concat();
    let ran = place.refit("tee.json", "bad.obj", &[]);
    assert_refused(&place, &before, &ran, &named);
    let ran = place.dress(&["inspect", "bad.obj"]);
    assert_refused(&place, &before, &ran, &named);
}

/// The good garment after a change to its pattern.
fn changed(change: impl FnOnce(&mut Value)) -> String {
    let mut document = garment();
    change(&mut document["pattern"]);
    document.to_string()
}

#[test]
fn json_that_ends_too_soon() {
    let text = garment().to_string();
    assert_bad_garment("cut.json", &text[..text.len() / 2], &["cut off"]);
}

#[test]
fn an_edge_to_a_corner_that_does_not_exist() {
    let text = changed(|p| p["panels"]["left"]["edges"][2]["endpoints"] = json!([2, 9]));
    assert_bad_garment("bad.json", text, &["panel `left`", "edge 2", "9"]);
}

#[test]
fn a_stitch_to_an_edge_that_does_not_exist() {
    let text = changed(|p| p["stitches"][0][0]["edge"] = json!(7));
    assert_bad_garment("bad.json", text, &["stitch 0", "edge 7", "`left`"]);
}

#[test]
fn a_stitch_to_a_panel_that_does_not_exist() {
    let text = changed(|p| p["stitches"][0][1]["panel"] = json!("sleeve"));
    assert_bad_garment("bad.json", text, &["stitch 0", "`sleeve`"]);
}

#[test]
fn an_edge_in_two_stitches() {
    let twice = json!([{"panel": "left", "edge": 3}, {"panel": "right", "edge": 0}]);
    let text = changed(|p| p["stitches"].as_array_mut().unwrap().push(twice));
    assert_bad_garment("bad.json", text, &["stitch 1", "edge 3", "already"]);
}

#[test]
fn an_outline_that_crosses_itself() {
    let bow = json!([[0, 0], [40, 40], [40, 0], [0, 40]]);
    let text = changed(|p| p["panels"]["right"]["vertices"] = bow);
    assert_bad_garment("bad.json", text, &["panel `right`", "cross"]);
}

#[test]
fn a_panel_without_area() {
    let flat = json!([[0, 0], [40, 0], [80, 0], [60, 0]]);
    let text = changed(|p| p["panels"]["right"]["vertices"] = flat);
    assert_bad_garment("bad.json", text, &["panel `right`"]);
}

#[test]
fn a_coordinate_beyond_all_numbers() {
    let text = garment().to_string().replacen("111", "1e400", 1);
    assert_bad_garment("bad.json", text, &["line 1", "too large"]);
}

#[test]
fn a_pattern_without_panels() {
    let text = changed(|p| p["panels"] = json!({}));
    assert_bad_garment("bad.json", text, &["no panels"]);
}

#[test]
fn all_problems_of_a_garment_are_told() {
    let text = changed(|p| {
        p["panels"]["left"]["edges"][2]["endpoints"] = json!([2, 9]);
        p["panels"]["right"]["vertices"][1] = json!("here");
        p["stitches"][0][0]["edge"] = json!(7);
    });
    assert_bad_garment(
        "bad.json",
        text,
        &["problems", "`left`", "`right`", "stitch 0"],
    );
}

#[test]
fn an_obj_without_texture_coordinates_or_a_body_for_a_garment() {
    assert_bad_garment("body2.obj", body(), &["no texture coordinates"]);
}

#[test]
fn a_mesh_that_cannot_be_a_garment() {
    assert_bad_garment(
        "body.ply",
        "ply\nformat ascii 1.0\n",
        &["PLY", "GarmentCode"],
    );
}

#[test]
fn an_empty_obj_for_a_garment() {
    assert_bad_garment("empty.obj", "", &["empty"]);
}

#[test]
fn a_body_with_a_position_that_is_no_number() {
    let text = body().replacen("-0.15", "nan", 1);
    assert_bad_body(&text, &["line 1", "not a finite number"]);
}

#[test]
fn an_empty_body() {
    assert_bad_body("", &["empty"]);
}

#[test]
fn a_face_with_a_vertex_that_does_not_exist() {
    let text = body() + "f 1 2 99\n";
    // Eight vertices and six faces come first.
    assert_bad_body(&text, &["line 15", "99"]);
}

#[test]
fn a_garment_for_a_body() {
    let place = Workplace::new();
    let before = place.names();
    let ran = place.refit("tee.json", "tee.json", &[]);
    assert_refused(&place, &before, &ran, &["tee.json", "JSON", "body's place"]);
}

#[test]
fn bodies_of_different_meshes_that_are_no_bodies() {
    let place = Workplace::new();
    place.file("other.obj", body() + "v 0 0.8 0\n");
    let before = place.names();
    let ran = place.refit("tee.json", "other.obj", &["--quiet"]);
    let words = ["body.obj", "other.obj", "no body was recognised"];
    assert_refused(&place, &before, &ran, &words);
}

#[test]
fn what_cannot_be_fitted() {
    let place = Workplace::new();
    place.file("beside.obj", two_boxes());
    place.file("small.obj", body().replace("1.1", "0.02"));
    place.file("nan.obj", body().replace("1.1", "nan"));
    place.file("empty.obj", "");
    place.file("model.npz", "\u{80}\u{2}a pickle");
    let before = place.names();
    for (arguments, words) in [
        (&["body.obj"][..], ["body.obj", "no body was recognised"]),
        (&["beside.obj"], ["beside.obj", "two bodies"]),
        (&["small.obj"], ["small.obj", "no person's height"]),
        (&["nan.obj"], ["nan.obj", "not a"]),
        (&["empty.obj"], ["empty.obj", "empty"]),
        (
            &["body.obj", "--model", "model.npz"],
            ["model.npz", "not an .npz archive"],
        ),
    ] {
        let ran = place.dress(&[&["body", "fit", "--out", "out"], arguments].concat());
        assert_refused(&place, &before, &ran, &words);
    }
}

/// Two of the boxes, a metre apart.
fn two_boxes() -> String {
    let moved = |line: &str| match line.split(' ').collect::<Vec<_>>()[..] {
        ["v", x, y, z] => format!("v {} {y} {z}\n", x.parse::<f64>().unwrap() + 1.0),
        ["f", a, b, c, d] => {
            let next = [a, b, c, d].map(|v| v.parse::<usize>().unwrap() + 8);
            format!("f {} {} {} {}\n", next[0], next[1], next[2], next[3])
        }
        _ => String::new(),
    };
    body()
        .lines()
        .map(moved)
        .fold(body(), |all, line| all + &line)
}

#[test]
fn a_pose_that_is_none() {
    let place = Workplace::new();
    place.file(
        "pose.toml",
        "[rotations]\nleft_elbw = [0, 0, 0]\nneck = [1, 2]\n",
    );
    let before = place.names();
    let ran = place.dress(&[
        "body",
        "pose",
        "body.obj",
        "--pose",
        "pose.toml",
        "--out",
        "out",
    ]);
    assert_refused(
        &place,
        &before,
        &ran,
        &["`left_elbw`", "left_elbow", "`neck`", "three numbers"],
    );
}

#[test]
fn landmarks_that_are_none() {
    let place = Workplace::new();
    place.file(
        "known.toml",
        "[landmarks]\nleft_elbw = [0, 1, 0]\nneck = [1, 2]\nnose = [0, nan, 0]\ncrown = [0, 110, 0]\n",
    );
    place.file(
        "twice.toml",
        "[landmarks]\nneck = [0, 1, 0]\nneck = [0, 1, 0]\n",
    );
    place.file("empty.toml", "[landmarks]\n");
    let before = place.names();
    let all = [
        "`left_elbw`",
        "left_elbow",
        "`neck`",
        "`nose`",
        "`crown`",
        "outside the body",
    ];
    for (file, words) in [
        ("known.toml", &all[..]),
        ("twice.toml", &["duplicate key"]),
        ("empty.toml", &["no landmark"]),
    ] {
        let arguments = [
            "body",
            "fit",
            "body.obj",
            "--out",
            "out",
            "--landmarks",
            file,
        ];
        assert_refused(&place, &before, &place.dress(&arguments), words);
    }
}

#[test]
fn a_folder_for_a_file() {
    let place = Workplace::new();
    std::fs::create_dir(place.path("folder")).unwrap();
    let before = place.names();
    let ran = place.refit("folder", "folder", &["--params", "folder"]);
    assert_refused(&place, &before, &ran, &["this is a folder"]);
    // The parameters, the garment and the body.
    assert_eq!(ran.stderr.matches("this is a folder").count(), 3);
    let ran = place.dress(&["inspect", "folder"]);
    assert_refused(&place, &before, &ran, &["this is a folder"]);
}

#[test]
fn files_that_do_not_exist_are_all_named() {
    let place = Workplace::new();
    let before = place.names();
    let ran = place.refit("none.json", "none.obj", &["--params", "none.toml"]);
    let words = ["none.json", "none.obj", "none.toml", "no such file"];
    assert_refused(&place, &before, &ran, &words);
    let ran = place.dress(&["inspect", "none.obj"]);
    assert_refused(&place, &before, &ran, &["none.obj", "no such file"]);
}

#[test]
fn a_file_where_results_should_go() {
    let place = Workplace::new();
    place.file("out", "mine");
    let before = place.names();
    let ran = place.refit("tee.json", "body.obj", &[]);
    assert_refused(&place, &before, &ran, &["out: this is a file"]);
    assert_eq!(std::fs::read(place.path("out")).unwrap(), b"mine");
}

#[test]
fn a_misspelt_parameter() {
    let place = Workplace::new();
    place.file("mine.toml", "[fabric]\nbendign = 1e-5\n");
    let before = place.names();
    let ran = place.refit("tee.json", "body.obj", &["--params", "mine.toml"]);
    let words = ["mine.toml", "`fabric.bendign`", "did you mean `bending`"];
    assert_refused(&place, &before, &ran, &words);
}

#[test]
fn a_fabric_or_a_panel_that_is_not_there() {
    let place = Workplace::new();
    let before = place.names();
    let drape = |fabric| {
        let line = ["drape", "--garment", "tee.json", "--body", "body.obj"];
        place.dress(&[&line[..], &["--out", "out", "--fabric", fabric]].concat())
    };
    let words = ["felt", "there is no fabric of this name", "denim"];
    assert_refused(&place, &before, &drape("felt"), &words);
    assert_refused(&place, &before, &drape("left:felt"), &words);
    let words = ["tee.json", "no panel `lft`", "`left`, `right`"];
    assert_refused(&place, &before, &drape("lft:denim"), &words);
    let refit = place.refit("tee.json", "body.obj", &["--fabric", "lft:denim"]);
    assert_refused(&place, &before, &refit, &words);
    let zone = "[[fabric_zones]]\npanels = [\"lft\"]\ngrain = 45\n";
    place.file("zone.toml", zone);
    let before = place.names();
    let bodies = ["--source-body", "body.obj", "--target-body", "body.obj"];
    let line = ["transfer", "--garment", "tee.json", "--params", "zone.toml"];
    let transfer = place.dress(&[&line[..], &bodies, &["--out", "out"]].concat());
    assert_refused(&place, &before, &transfer, &words);
}

#[test]
fn folds_that_cannot_be() {
    let place = Workplace::new();
    let folds = "[[folds]]\nedge = \"left:0\"\nangle = 170\n\
                 [[folds]]\nedge = \"left:3\"\nangle = 300\n\
                 [[folds]]\nedge = \"lft:3\"\nangle = 90\n";
    place.file("folds.toml", folds);
    let before = place.names();
    let ran = place.refit("tee.json", "body.obj", &["--params", "folds.toml"]);
    let words = [
        "folds, `left:0`: nothing is sewn to this edge",
        "`300` must be an angle",
        "no panel `lft`",
    ];
    assert_refused(&place, &before, &ran, &words);
    place.file("folds.toml", "[[folds]]\nedge = \"left:3\"\nangel = 170\n");
    let ran = place.refit("tee.json", "body.obj", &["--params", "folds.toml"]);
    assert_refused(&place, &before, &ran, &["folds.toml: line 3", "`angel`"]);
}

#[test]
fn a_command_line_that_makes_no_sense() {
    let place = Workplace::new();
    for line in [
        &["refit", "--resolution", "-3"][..],
        &["refit", "--garment", "tee.json"],
        &["refit", "--threads", "0"],
        &["drape"],
        &["sew"],
        &[],
    ] {
        assert_eq!(place.dress(line).code, 2, "{line:?}");
    }
}

#[test]
fn folders_without_a_drape_make_no_sheet() {
    let place = Workplace::new();
    place.file("report.json", r#"{"status": "converged"}"#);
    let before = place.names();
    for (folder, words) in [
        (".", "no report of `dress drape`"),
        ("none", "no such file"),
    ] {
        let ran = place.dress(&["sheet", folder, "--out", "out"]);
        assert_refused(&place, &before, &ran, &[words]);
    }
}
