//! Body models from `.npz` files in SMPL's layout, and the one that is built in.
//!
//! Counts come from the arrays: `v_template` (V,3), `shapedirs` (V,3,K), `posedirs` (V,3,9(J−1),
//! optional), `J_regressor` (J,V), `weights` (V,J), `kintree_table` (2,J), `f` (F,3); further
//! `propdirs` (V,3,P) with `prop_names` (bone stretches). Directions may be whole numbers with one
//! scale per component beside them (`shapedirs_scale`, `propdirs_scale`).

use super::npz::{Archive, Array};
use super::source;
use crate::body_model::{BodyModel, LEAST_JOINTS, Parts};
use crate::geometry::{TriangleMesh, Vec3};
use crate::problem::{BadInput, Problem};
use std::path::Path;

/// The model that comes with the project: 40 shape components, 14 stretches, made from CC0 data.
pub fn built_in() -> BodyModel {
    let bytes = include_bytes!("../../../../data/body-model/default.npz");
    parse(Path::new("default.npz"), bytes).expect("a test reads the built-in model")
}

/// Reads a model from a file.
pub fn read(path: &Path) -> Result<BodyModel, BadInput> {
    parse(path, &source::bytes(path)?)
}

/// [`read`] of a file's bytes; `file` gives the model its name.
pub fn parse(file: &Path, bytes: &[u8]) -> Result<BodyModel, BadInput> {
    let bad = |problems| BadInput::new(file, problems);
    if !bytes.starts_with(b"PK") {
        let text = if bytes.starts_with(b"\x80") || bytes.starts_with(b"(") {
            "this is a Python pickle, and reading one runs its code: convert it once with \
             tools/convert_smpl.py in your own Python, and give the .npz it writes"
        } else {
            "this is not an .npz archive; a body model is read from one in SMPL's layout"
        };
        return Err(bad(vec![Problem::whole(text)]));
    }
    let archive = Archive::parse(bytes).map_err(|problem| bad(vec![problem]))?;
    let name = source::stem(file);
    parts(&archive, name).map(BodyModel::new).map_err(bad)
}

/// More vertices than any body model has.
const MAX_VERTICES: usize = 1_000_000;
/// More components than a fit can tell apart; further ones are left out.
const MAX_SHAPES: usize = 100;
/// Weights below this are dropped: files round them anyway.
const LEAST_WEIGHT: f64 = 1e-6;

/// The parts of the model, or all that is wrong with its arrays.
fn parts(archive: &Archive<'_>, name: String) -> Result<Parts, Vec<Problem>> {
    let mut reading = Reading {
        archive,
        problems: Vec::new(),
    };
    let template = reading.array("v_template", &[None, Some(3)]);
    let faces = reading.array("f", &[None, Some(3)]);
    let tree = reading.array("kintree_table", &[Some(2), None]);
    let (Some(template), Some(faces), Some(tree)) = (template, faces, tree) else {
        return Err(reading.problems);
    };
    let (vertices, joints) = (template.shape[0], tree.shape[1]);
    if vertices == 0 || vertices > MAX_VERTICES {
        reading.complain("v_template", format!("{vertices} vertices are no body"));
    }
    if joints < LEAST_JOINTS {
        reading.complain(
            "kintree_table",
            format!("{joints} joints; a model needs SMPL's first {LEAST_JOINTS}, in SMPL's order"),
        );
    }
    if !reading.problems.is_empty() {
        return Err(reading.problems);
    }
    let shapes = reading.directions("shapedirs", vertices);
    let stretches = if archive.has("propdirs") {
        reading.directions("propdirs", vertices)
    } else {
        Some((0, Vec::new()))
    };
    let pose = reading.pose_directions(vertices, joints);
    let regressor = reading.sparse("J_regressor", [joints, vertices]);
    let weights = reading.sparse("weights", [vertices, joints]);
    let parents = reading.parents(&tree);
    let triangles = reading.triangles(&faces, vertices);
    let names = reading.stretch_names(stretches.as_ref().map_or(0, |s| s.0));
    let all = (
        shapes, stretches, pose, regressor, weights, parents, triangles,
    );
    let (
        Some(shapes),
        Some(stretches),
        Some(pose),
        Some(regressor),
        Some(weights),
        Some(parents),
        Some(triangles),
    ) = all
    else {
        return Err(reading.problems);
    };
    let shape_count = shapes.0.min(MAX_SHAPES);
    let mut directions = Vec::with_capacity(vertices * (shape_count + stretches.0));
    for v in 0..vertices {
        let row = &shapes.1[v * shapes.0..(v + 1) * shapes.0];
        directions.extend(&row[..shape_count]);
        directions.extend(&stretches.1[v * stretches.0..(v + 1) * stretches.0]);
    }
    Ok(Parts {
        name,
        template: TriangleMesh {
            positions: points(&template.values),
            triangles,
        },
        directions,
        shape_count,
        stretches: names,
        pose_directions: pose,
        regressor,
        weights,
        parents,
    })
}

fn points(values: &[f64]) -> Vec<Vec3> {
    values
        .chunks_exact(3)
        .map(|p| Vec3::new(p[0], p[1], p[2]))
        .collect()
}

/// Arrays taken from an archive, and what was wrong with them.
struct Reading<'a> {
    archive: &'a Archive<'a>,
    problems: Vec<Problem>,
}

/// A kind of direction: how many, and \[m\], `[vertex][component]`.
type Directions = (usize, Vec<Vec3>);

impl Reading<'_> {
    fn complain(&mut self, array: &str, text: String) {
        self.problems
            .push(Problem::at(format!("array `{array}`"), text));
    }

    /// The array called `name` if it has this shape, where none is any length.
    fn array(&mut self, name: &str, shape: &[Option<usize>]) -> Option<Array> {
        let array = match self.archive.numbers(name) {
            Ok(array) => array,
            Err(problem) => {
                self.problems.push(problem);
                return None;
            }
        };
        let same_rank = array.shape.len() == shape.len();
        let fits = |(n, wanted): (&usize, &Option<usize>)| wanted.is_none_or(|wanted| wanted == *n);
        if same_rank && array.shape.iter().zip(shape).all(fits) {
            return Some(array);
        }
        let wanted: Vec<String> = shape
            .iter()
            .map(|n| n.map_or("any".to_owned(), |n| n.to_string()))
            .collect();
        let text = format!(
            "has the shape {:?}; it should be ({})",
            array.shape,
            wanted.join(", ")
        );
        self.complain(name, text);
        None
    }

    /// (V, 3, K) as directions `[vertex][component]`, times their scales where there are any.
    fn directions(&mut self, name: &str, vertices: usize) -> Option<Directions> {
        let array = self.array(name, &[Some(vertices), Some(3), None])?;
        let count = array.shape[2];
        let scale_name = format!("{name}_scale");
        let scale = if self.archive.has(&scale_name) {
            self.array(&scale_name, &[Some(count)])?.values
        } else {
            vec![1.0; count]
        };
        let at = |v: usize, c: usize, k: usize| array.values[(3 * v + c) * count + k] * scale[k];
        let direction = |i: usize| Vec3::from_fn(|c, _| at(i / count, c, i % count));
        Some((count, (0..vertices * count).map(direction).collect()))
    }

    /// SMPL's pose directions; STAR's, of another feature, are refused.
    fn pose_directions(&mut self, vertices: usize, joints: usize) -> Option<Vec<Vec3>> {
        if !self.archive.has("posedirs") {
            return Some(Vec::new());
        }
        let width = 9 * (joints - 1);
        let array = self.array("posedirs", &[Some(vertices), Some(3), Some(width)])?;
        let at = |v: usize, c: usize, k: usize| array.values[(3 * v + c) * width + k];
        let direction = |i: usize| Vec3::from_fn(|c, _| at(i / width, c, i % width));
        Some((0..vertices * width).map(direction).collect())
    }

    /// A matrix by its rows' entries that are not zero, each row made to sum to 1.
    fn sparse(&mut self, name: &str, [rows, columns]: [usize; 2]) -> Option<Vec<Vec<(u32, f64)>>> {
        let array = self.array(name, &[Some(rows), Some(columns)])?;
        let entries = |row: &[f64]| -> Vec<(u32, f64)> {
            let sum: f64 = row.iter().sum();
            let kept = row
                .iter()
                .enumerate()
                .filter(|(_, w)| w.abs() > LEAST_WEIGHT);
            kept.map(|(i, w)| (i as u32, w / sum)).collect()
        };
        let off = |row: &[f64]| (row.iter().sum::<f64>() - 1.0).abs() > 0.05;
        if let Some(row) = array.values.chunks_exact(columns).position(off) {
            self.complain(name, format!("row {row} does not sum to 1"));
            return None;
        }
        let rows = array.values.chunks_exact(columns).map(entries);
        Some(rows.map(normalised).collect())
    }

    fn parents(&mut self, tree: &Array) -> Option<Vec<Option<usize>>> {
        let joints = tree.shape[1];
        let above = |j: usize| tree.values[j];
        let mut parents = vec![None];
        for j in 1..joints {
            let parent = above(j);
            if !(0.0..j as f64).contains(&parent) {
                let text = format!("joint {j} hangs on {parent}; it must hang on an earlier joint");
                self.complain("kintree_table", text);
                return None;
            }
            parents.push(Some(parent as usize));
        }
        Some(parents)
    }

    fn triangles(&mut self, faces: &Array, vertices: usize) -> Option<Vec<[u32; 3]>> {
        let range = 0.0..vertices as f64;
        if let Some(at) = faces.values.iter().position(|v| !range.contains(v)) {
            let text = format!("face {} names a vertex that does not exist", at / 3);
            self.complain("f", text);
            return None;
        }
        let face = |f: &[f64]| [f[0] as u32, f[1] as u32, f[2] as u32];
        Some(faces.values.chunks_exact(3).map(face).collect())
    }

    fn stretch_names(&mut self, count: usize) -> Vec<String> {
        let told = if self.archive.has("prop_names") {
            self.archive.texts("prop_names").unwrap_or_default()
        } else {
            Vec::new()
        };
        let name = |k: usize| {
            told.get(k)
                .cloned()
                .unwrap_or_else(|| format!("stretch_{k}"))
        };
        (0..count).map(name).collect()
    }
}

/// Entries that sum to 1, after small ones were dropped.
fn normalised(row: Vec<(u32, f64)>) -> Vec<(u32, f64)> {
    let sum: f64 = row.iter().map(|(_, w)| w).sum();
    row.into_iter().map(|(i, w)| (i, w / sum)).collect()
}

#[cfg(test)]
mod tests;
