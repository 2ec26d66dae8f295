//! What the program makes of good inputs.

use crate::fixtures::Workplace;
use serde_json::Value;
use std::path::Path;

fn shipped(name: &str) -> String {
    let data = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../data");
    data.join(name).to_str().unwrap().to_owned()
}

fn report(place: &Workplace) -> Value {
    let text = std::fs::read(place.path("out/report.json")).unwrap();
    serde_json::from_slice(&text).unwrap()
}

#[test]
fn printed_parameters_are_the_defaults_when_read_back() {
    let place = Workplace::new();
    let printed = place.dress(&["params"]);
    assert_eq!(printed.code, 0);
    place.file("printed.toml", &printed.stdout);
    for (folder, more) in [
        ("with", &["--params", "printed.toml"][..]),
        ("without", &[]),
    ] {
        let line = ["drape", "--garment", "tee.json", "--body", "body.obj"];
        let coarse = ["--resolution", "35", "--quiet", "--out", folder];
        let ran = place.dress(&[&line, &coarse, more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        assert_eq!((ran.stdout, ran.stderr), (String::new(), String::new()));
    }
    let parameters = |folder: &str| -> Value {
        let text = std::fs::read(place.path(folder).join("report.json")).unwrap();
        serde_json::from_slice::<Value>(&text).unwrap()["parameters"].take()
    };
    assert!(parameters("with").is_object());
    assert_eq!(parameters("with"), parameters("without"));
}

#[test]
fn a_cloth_laid_on_a_box_is_draped_and_told_of() {
    let place = Workplace::new();
    let line = [
        "drape",
        "--garment",
        "tee.json",
        "--body",
        "body.obj",
        "--out",
        "out",
    ];
    // What a longer film left.
    std::fs::create_dir(place.path("film")).unwrap();
    for n in 0..300 {
        std::fs::write(place.path(&format!("film/frame_{n:04}.obj")), "old").unwrap();
    }
    let coarse = ["--resolution", "35", "--threads", "1"];
    let ran = place.dress(&[&line[..], &coarse, &["--frames", "film"]].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("at rest"), "{}", ran.stdout);
    let report = report(&place);
    assert_eq!(report["status"], "at-rest");
    assert_eq!(report["garment"]["unit"], "cm");
    assert_eq!(report["body"]["unit"], "m");
    for name in ["garment.obj", "pattern.svg", "preview.png", "mesh.png"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
    // The film ends with the drape, and each of its frames is a garment to start from.
    let frames = std::fs::read_dir(place.path("film")).unwrap().count() / 2;
    assert!((3..300).contains(&frames), "{frames}");
    let read = |file: &str| std::fs::read(place.path(file)).unwrap();
    let last = frames - 1;
    assert_eq!(
        read(&format!("film/frame_{last:04}.obj")),
        read("out/garment.obj")
    );
    let half = format!("film/frame_{:04}.obj", frames / 2);
    assert!(place.path(&half.replace("obj", "png")).is_file());
    let again = [&coarse[..], &["--from", &half]].concat();
    let ran = place.dress(&[&line[..6], &["again"], &again[..]].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    // What was written goes into a sheet, and is a garment again.
    let ran = place.dress(&["sheet", "out", "out", "--columns", "1", "--out", "both"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(place.path("both/sheet.png").is_file());
    let ran = place.dress(&["inspect", "out/garment.obj"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(
        ran.stdout.contains("2 panels, 1 stitches"),
        "{}",
        ran.stdout
    );
}

#[test]
fn two_threads_refit_as_one_does() {
    let place = Workplace::new();
    let written = |threads| {
        let line = [
            "refit",
            "--resolution",
            "40",
            "--out",
            threads,
            "--threads",
            threads,
        ];
        let ran = place.dress(&line);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let read = |name| std::fs::read(place.path(threads).join(name)).unwrap();
        ["pattern.json", "garment.obj", "initial.obj"].map(read)
    };
    assert!(written("1") == written("2"), "what is written differs");
}

#[test]
fn panels_are_draped_in_fabrics_of_their_own() {
    let place = Workplace::new();
    place.file(
        "zone.toml",
        "[[fabric_zones]]\npanels = [\"left\"]\ngrain = 45\n",
    );
    place.file("fold.toml", "[[folds]]\nedge = \"left:3\"\nangle = 60\n");
    let garment_with = |params, fabrics: &[&str]| {
        let line = ["drape", "--garment", "tee.json", "--body", "body.obj"];
        let more = ["--resolution", "35", "--out", "out", "--params", params];
        let ran = place.dress(&[&line[..], &more, fabrics].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        std::fs::read(place.path("out/garment.obj")).unwrap()
    };
    let garment = |fabrics: &[&str]| garment_with("zone.toml", fabrics);
    let plain = garment(&[]);
    let denim = garment(&["--fabric", "denim"]);
    let folded = garment_with("fold.toml", &[]);
    assert!(folded != plain && folded != denim);
    let both = garment(&["--fabric", "denim", "--fabric", "left:rib-knit"]);
    assert!(plain != denim && denim != both && plain != both);
    let zones = &report(&place)["parameters"]["fabric_zones"];
    // As the library of fabrics has rib-knit.
    assert_eq!(zones[1]["fabric"]["density"], 0.276);
    assert_eq!(
        (&zones[0]["grain"], &zones[1]["panels"][0]),
        (&45.0.into(), &"left".into())
    );
}

#[test]
fn a_garment_carried_to_the_body_it_fits_stays_as_it_was() {
    let place = Workplace::new();
    let bodies = ["--source-body", "body.obj", "--target-body", "body.obj"];
    let line = ["transfer", "--garment", "tee.json", "--resolution", "35"];
    let ran = place.dress(&[&line[..], &bodies, &["--out", "out"]].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("0 triangles"), "{}", ran.stdout);
    let report = report(&place);
    for side in [0, 1] {
        for part in ["least", "most"] {
            let stretch = report["stretch"][side][part].as_f64().unwrap();
            // A tenth of a millimetre on edges of 35 mm.
            assert!((stretch - 1.0).abs() < 3e-3, "{part} {stretch}");
        }
    }
    assert_eq!(report["turned_over"], 0);
    for panel in report["spacing"].as_array().unwrap() {
        let [before, after] = ["before", "after"].map(|k| panel[k]["median"].as_f64().unwrap());
        assert!((before - after).abs() < 1e-4, "{before} {after}");
    }
    for name in ["target.obj", "body.obj", "preview.png"] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
}

#[test]
fn a_pattern_is_told_by_panels_seams_and_free_edges() {
    let ran = Workplace::new().dress(&["inspect", &shipped("garments/tshirt.json")]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for words in [
        "tshirt: a garment",
        "6 panels",
        "left_sleeve_f",
        "front:2 - back:6",
        "free edges",
        "itself",
        "it has to rest on shoulders",
    ] {
        assert!(
            ran.stdout.contains(words),
            "`{words}` is not in: {}",
            ran.stdout
        );
    }
}

#[test]
fn a_body_is_told_by_size_unit_and_axis() {
    let ran = Workplace::new().dress(&["inspect", &shipped("bodies/f_average.obj")]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    // As data/README.md has it.
    for words in ["a body", "12996 triangles", "1.69", "unit m, y up"] {
        assert!(
            ran.stdout.contains(words),
            "`{words}` is not in: {}",
            ran.stdout
        );
    }
}

#[test]
fn fabrics_are_listed_and_told_with_their_sources() {
    let place = Workplace::new();
    let all = place.dress(&["fabrics"]);
    assert_eq!(all.code, 0);
    for name in ["cotton-poplin", "denim", "tulle", "leather"] {
        assert!(all.stdout.contains(name), "{name}");
    }
    let one = place.dress(&["fabrics", "denim"]);
    assert!(one.stdout.contains("Wang et al. 2011"), "{}", one.stdout);
    let none = place.dress(&["fabrics", "felt"]);
    assert_eq!(none.code, 2);
    assert!(
        none.stderr.contains("there are shirting"),
        "{}",
        none.stderr
    );
}

/// Minutes: `cargo test --release -p dress-cli -- --ignored`.
#[test]
#[ignore = "takes minutes"]
fn the_built_in_refit_writes_everything() {
    let place = Workplace::new();
    let ran = place.dress(&["refit", "--resolution", "35", "--out", "out"]);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    for name in [
        "pattern.json",
        "garment.obj",
        "target.obj",
        "initial.obj",
        "body.obj",
        "pattern.svg",
        "preview.png",
    ] {
        assert!(place.path("out").join(name).is_file(), "{name}");
    }
    let report = report(&place);
    let loss = |i: usize| report["iterations"][i]["shape_matching"].as_f64().unwrap();
    let last = report["iterations"].as_array().unwrap().len() - 1;
    assert!(loss(last) < loss(0), "{} -> {}", loss(0), loss(last));
    for file in ["out/pattern.json", "out/garment.obj"] {
        let ran = place.dress(&["inspect", file]);
        assert_eq!(ran.code, 0, "{}", ran.stderr);
    }
}
