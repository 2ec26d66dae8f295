//! Gradients, optimisers and checkpoints, as a user meets them.

use crate::fixtures::Workplace;
use serde_json::Value;
use std::path::Path;
use std::time::Duration;

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
fn a_known_pattern_is_found_again_from_its_drape() {
    let line = ["check-recovery", "--resolution", "60", "--quiet"];
    let ran = Workplace::new().dress(&line);
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(!ran.stdout.contains("missed"), "{}", ran.stdout);
    // 0.15 changes edges by centimetres.
    let found = ran.stdout.lines().last().unwrap();
    let mut numbers = found
        .split_whitespace()
        .filter_map(|word| word.parse::<usize>().ok());
    let [found, all] = [(); 2].map(|()| numbers.next().unwrap());
    assert!(all > 20 && 10 * found >= 9 * all, "{}", ran.stdout);

    let none = Workplace::new().dress(&["check-recovery", "--gradient", "trajectory"]);
    assert_eq!(none.code, 2, "{}", none.stderr);
}

#[test]
fn a_plot_of_the_loss_along_a_line_is_drawn() {
    let place = Workplace::new();
    let line = ["check-gradient", "--resolution", "60", "--quiet"];
    // Along 0.02 mm the built-in T-shirt's loss is smooth.
    let ran = place.dress(&[&line[..], &["--plot", "line.svg", "--reach", "0.01"]].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    assert!(ran.stdout.contains("in 80 of 80 steps"), "{}", ran.stdout);
    let svg = std::fs::read_to_string(place.path("line.svg")).unwrap();
    assert_eq!(svg.matches("class=\"tangent\"").count(), 81);
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
fn a_trajectory_that_breaks_down_tells_where_on_the_way_there_and_back() {
    let place = Workplace::new();
    let line = ["drape", "--garment", "tee.json", "--body", "body.obj"];
    let coarse = ["--resolution", "35", "--quiet", "--out", "drape"];
    let ran = place.dress(&[&line[..], &coarse].concat());
    assert_eq!(ran.code, 0, "{}", ran.stderr);
    // One step so long that it falls beyond all numbers; a slope so steep that its square is none.
    let broken = [
        ("[sim.step]\ndt = 1e200\n", "in step 0 "),
        (
            "[loss]\ninterior = 1e200\n",
            "walking back through step 179;",
        ),
    ];
    for (params, step) in broken {
        place.file("broken.toml", params);
        let more = ["--gradient", "trajectory", "--params", "broken.toml"];
        let ran = place.refit("drape/garment.obj", "body.obj", &more);
        assert_ne!(ran.code, 0, "{}", ran.stderr);
        for told in [step, "triangle ", "in panel `"] {
            assert!(ran.stderr.contains(told), "{told} in {}", ran.stderr);
        }
    }
}

/// Number of accepted steps and level of the search in a checkpoint, once there is one.
fn noted(path: &Path) -> Option<(usize, u64)> {
    let state: Value =
        serde_json::from_slice(&std::fs::read(path).ok()?).expect("never half written");
    Some((state["notes"].as_array()?.len(), state["level"].as_u64()?))
}

#[test]
fn a_refit_that_was_killed_at_any_moment_and_resumed_ends_with_the_same_bits() {
    let place = Workplace::new();
    let few =
        "coarse = 70\nmedium = 90\n[descent]\niterations = 3\ntolerance = 0\nleast_step = 0\n";
    place.file("few.toml", few);
    let line = [
        "refit",
        "--resolution",
        "60",
        "--quiet",
        "--params",
        "few.toml",
    ];
    let whole = place.dress(&[&line[..], &["--out", "whole"]].concat());
    assert_eq!(whole.code, 0, "{}", whole.stderr);

    // Killed in the coarse mesh, in guided and in free cloth of the next one, or as soon after as this test is served.
    let path = place.path("notes/checkpoint.json");
    let mut killed = 0;
    for (level, folder) in [(0, "--checkpoint"), (1, "--resume"), (3, "--resume")] {
        let mut running = place.start(&[&line[..], &["--out", "part", folder, "notes"]].concat());
        let mut steps = 0;
        while running.try_wait().unwrap().is_none() {
            if let Some((now, at)) = noted(&path) {
                assert!(now >= steps, "a step was lost");
                steps = now;
                if at >= level {
                    running.kill().unwrap();
                    killed += 1;
                    running.wait().unwrap();
                }
            }
            std::thread::sleep(Duration::from_millis(1));
        }
    }
    assert!(killed > 0, "ended before it was killed");
    let resumed = place.dress(&[&line[..], &["--out", "resumed", "--resume", "notes"]].concat());
    assert_eq!(resumed.code, 0, "{}", resumed.stderr);
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
