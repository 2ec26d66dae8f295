//! Gradients, optimisers and checkpoints, as a user meets them.

use crate::fixtures::Workplace;

/// Columns of the rows of the table that `check-gradient` prints: move \[mm\] and relative difference.
fn rows(table: &str) -> Vec<(f64, f64)> {
    let number = |text: &str| text.parse::<f64>().ok();
    let row = |line: &str| {
        let cells: Vec<&str> = line.split_whitespace().collect();
        let [_, moved, _, _, difference] = cells[..] else {
            return None;
        };
        number(moved).zip(number(difference))
    };
    table.lines().filter_map(row).collect()
}

#[test]
fn the_gradient_of_the_built_in_garment_agrees_with_complete_drapes() {
    let line = ["check-gradient", "--resolution", "60", "--quiet"];
    // The equilibrium's is limited by the polish of the drapes, the trajectory's by its wildness.
    for (gradient, tolerance) in [("equilibrium", 1e-4), ("trajectory", 1e-2)] {
        let more = ["--directions", "1", "--gradient", gradient];
        let ran = Workplace::new().dress(&[&line[..], &more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
        let rows = rows(&ran.stdout);
        assert_eq!(rows.len(), 7, "{}", ran.stdout);
        let best = rows.iter().map(|row| row.1).fold(f64::INFINITY, f64::min);
        assert!(best < tolerance, "{}", ran.stdout);
        assert!(ran.stdout.contains("up to"), "{}", ran.stdout);
    }
}

#[test]
fn an_optimizer_that_needs_more_than_a_gradient_is_refused_without_it() {
    let line = ["refit", "--gradient", "trajectory", "--optimizer", "lm"];
    let ran = Workplace::new().dress(&line);
    assert_eq!(ran.code, 2, "{}", ran.stderr);
    assert!(
        ran.stderr.contains("`lbfgs` or `descent`"),
        "{}",
        ran.stderr
    );
}

#[test]
fn a_resumed_refit_ends_with_the_same_bits() {
    let place = Workplace::new();
    // The search in stiffer cloth before takes at most eight steps, and so the same in all runs.
    for (name, iterations) in [("few.toml", 10), ("fewer.toml", 8)] {
        let text = format!("[descent]\niterations = {iterations}\ntolerance = 0\nleast_step = 0\n");
        place.file(name, text);
    }
    let refit = |params: &str, out: &str, more: &[&str]| {
        let line = ["refit", "--resolution", "60", "--quiet", "--params", params];
        let ran = place.dress(&[&line[..], &["--out", out], more].concat());
        assert_eq!(ran.code, 0, "{}", ran.stderr);
    };
    refit("few.toml", "whole", &["--checkpoint", "notes"]);
    refit("fewer.toml", "part", &["--checkpoint", "notes"]);
    // As if the run of ten steps had been killed after eight.
    let path = place.path("notes/checkpoint.json");
    let state = std::fs::read_to_string(&path).unwrap();
    assert!(state.contains("\"iterations\":8,"));
    let state = state.replace("\"iterations\":8,", "\"iterations\":10,");
    std::fs::write(&path, state).unwrap();
    refit("few.toml", "resumed", &["--resume", "notes"]);
    for name in ["pattern.json", "garment.obj", "initial.obj", "pattern.svg"] {
        let [whole, resumed] =
            ["whole", "resumed"].map(|run| std::fs::read(place.path(run).join(name)).unwrap());
        assert!(whole == resumed, "{name} differs");
    }

    // Another fabric is another refit.
    let line = [
        "refit",
        "--resolution",
        "60",
        "--quiet",
        "--resume",
        "notes",
    ];
    let other = place.dress(&[&line[..], &["--params", "few.toml", "--fabric", "denim"]].concat());
    assert_eq!(other.code, 2, "{}", other.stderr);
    assert!(other.stderr.contains("another refit"), "{}", other.stderr);
    place.file("notes/checkpoint.json", "{}");
    let broken = place.dress(&[&line[..], &["--params", "few.toml"]].concat());
    assert_eq!(broken.code, 2, "{}", broken.stderr);
    assert!(broken.stderr.contains("no checkpoint"), "{}", broken.stderr);
}
