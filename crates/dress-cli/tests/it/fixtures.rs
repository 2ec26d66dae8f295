//! Files made in a folder of their own, and runs of the program on them.

use serde_json::{Value, json};
use std::fmt::Write;
use std::path::PathBuf;
use std::process::{Child, Command};
use tempfile::TempDir;

/// A folder with a good garment and a good body in it.
pub(crate) struct Workplace(TempDir);

/// What a run left behind.
pub(crate) struct Ran {
    pub(crate) code: i32,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
}

impl Workplace {
    pub(crate) fn new() -> Self {
        let place = Self(tempfile::tempdir().unwrap());
        place.file("tee.json", garment().to_string());
        place.file("body.obj", body());
        place
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    pub(crate) fn file(&self, name: &str, content: impl AsRef<[u8]>) {
        std::fs::write(self.path(name), content).unwrap();
    }

    /// Runs `dress` here.
    pub(crate) fn dress(&self, arguments: &[&str]) -> Ran {
        let output = Command::new(env!("CARGO_BIN_EXE_dress"))
            .args(arguments)
            .current_dir(self.0.path())
            .output()
            .unwrap();
        let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
        Ran {
            code: output.status.code().unwrap(),
            stdout: text(output.stdout),
            stderr: text(output.stderr),
        }
    }

    /// Starts `dress` here.
    pub(crate) fn start(&self, arguments: &[&str]) -> Child {
        Command::new(env!("CARGO_BIN_EXE_dress"))
            .args(arguments)
            .current_dir(self.0.path())
            .spawn()
            .unwrap()
    }

    /// Runs `dress refit` from one body file to the same one, into `out`.
    pub(crate) fn refit(&self, garment: &str, body: &str, more: &[&str]) -> Ran {
        let mut arguments = vec!["refit", "--garment", garment, "--out", "out"];
        arguments.extend(["--source-body", "body.obj", "--target-body", body]);
        arguments.extend(more);
        self.dress(&arguments)
    }

    /// Names of all that lies here.
    pub(crate) fn names(&self) -> Vec<String> {
        let entries = std::fs::read_dir(self.0.path()).unwrap();
        let mut names: Vec<String> = entries
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }
}

/// Two squares of 14 cm, sewn at one side, waiting above the body's top.
pub(crate) fn garment() -> Value {
    let square = |x: f64| {
        json!({
            "vertices": [[0, 0], [14, 0], [14, 14], [0, 14]],
            "edges": [
                {"endpoints": [0, 1]}, {"endpoints": [1, 2]},
                {"endpoints": [2, 3]}, {"endpoints": [3, 0]},
            ],
            "translation": [x, 111, 7],
            "rotation": [-90, 0, 0],
        })
    };
    json!({
        "pattern": {
            "panels": {"left": square(0.0), "right": square(-14.0)},
            "stitches": [[{"panel": "left", "edge": 3}, {"panel": "right", "edge": 1}]],
        },
        "properties": {"units_in_meter": 100, "curvature_coords": "relative"},
    })
}

/// A box 1.1 m tall and 0.3 m wide and deep, as OBJ in metres.
pub(crate) fn body() -> String {
    let mut text = String::new();
    for i in 0..8 {
        let side = |bit: i32| f64::from((i >> bit) & 1);
        let (x, y, z) = (0.3 * side(0) - 0.15, 1.1 * side(1), 0.3 * side(2) - 0.15);
        writeln!(text, "v {x} {y} {z}").unwrap();
    }
    text + "f 1 3 4 2\nf 5 6 8 7\nf 1 2 6 5\nf 3 7 8 4\nf 1 5 7 3\nf 2 4 8 6\n"
}
