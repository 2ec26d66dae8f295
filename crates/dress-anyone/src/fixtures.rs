//! Patterns for tests: the GarmentCode designs of the shared data, read just well enough to draw
//! cages around, panels made by hand, and meshes without triangles. Test-only.

use crate::geometry::{Mat3, Vec2, Vec3};
use crate::pattern::{Curve, Edge, EdgeId, Panel, Pattern, PatternMesh, Placement, Stitch};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// All designs by name; none, with a note, where the shared data is absent.
pub(crate) fn patterns() -> Vec<(String, Pattern)> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let shared = std::env::var_os("DRESS_SHARED").map_or(beside, PathBuf::from);
    let mut files: Vec<_> = ["named", "random"]
        .iter()
        .filter_map(|kind| std::fs::read_dir(shared.join("data/garments").join(kind)).ok())
        .flatten()
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == "json"))
        .collect();
    files.sort();
    if files.is_empty() {
        println!("skipped: no garments under {}", shared.display());
    }
    let name = |path: &Path| path.file_stem().unwrap().to_string_lossy().into_owned();
    files.iter().map(|path| (name(path), read(path))).collect()
}

/// The outline's points, and a grid of points inside, for every panel; no triangles, nothing sewn.
pub(crate) fn sampled(pattern: &Pattern, spacing: f64) -> PatternMesh {
    let mut x_bar = Vec::new();
    let mut panel_vertices = Vec::new();
    for panel in &pattern.panels {
        let start = x_bar.len();
        let outline = panel.outline(spacing);
        let high = outline.iter().fold(outline[0], |high, p| high.sup(p));
        let low = outline.iter().fold(outline[0], |low, p| low.inf(p));
        let steps = ((high - low) / spacing).map(|s| s as usize);
        x_bar.extend(&outline);
        for i in 1..=steps.x {
            let column = (1..=steps.y).map(|j| low + Vec2::new(i as f64, j as f64) * spacing);
            x_bar.extend(column.filter(|p| crate::geometry::plane::contains(&outline, *p)));
        }
        panel_vertices.push(start..x_bar.len());
    }
    PatternMesh {
        triangles: Vec::new(),
        panel_triangles: vec![0..0; pattern.panels.len()],
        right_side_up: pattern
            .panels
            .iter()
            .map(|p| p.signed_area() > 0.0)
            .collect(),
        edge_vertices: vec![Vec::new(); pattern.panels.len()],
        sewing: (0..x_bar.len() as u32).collect(),
        cloth_vertex_count: x_bar.len(),
        x_bar,
        panel_vertices,
    }
}

/// A panel of straight edges, `at` its place in space, facing +z.
pub(crate) fn panel(name: &str, corners: &[(f64, f64)], at: Vec3) -> Panel {
    let n = corners.len();
    let edge = |start| Edge {
        start,
        end: (start + 1) % n,
        curve: Curve::Line,
        label: None,
    };
    Panel {
        name: name.to_owned(),
        vertices: corners.iter().map(|&(x, y)| Vec2::new(x, y)).collect(),
        edges: (0..n).map(edge).collect(),
        placement: Placement {
            rotation: Mat3::identity(),
            translation: at,
        },
        label: None,
    }
}

fn read(path: &Path) -> Pattern {
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let panels = file["pattern"]["panels"].as_object().unwrap();
    let index = |name: &Value| panels.keys().position(|key| key == name.as_str().unwrap());
    let side = |side: &Value| EdgeId {
        panel: index(&side["panel"]).unwrap(),
        edge: side["edge"].as_u64().unwrap() as usize,
    };
    let stitch = |stitch: &Value| Stitch {
        sides: [side(&stitch[0]), side(&stitch[1])],
        right_wrong: stitch.get(2).is_some(),
    };
    let stitches = file["pattern"]["stitches"].as_array().unwrap();
    Pattern {
        panels: panels
            .iter()
            .map(|(name, panel)| read_panel(name, panel))
            .collect(),
        stitches: stitches.iter().map(stitch).collect(),
    }
}

fn read_panel(name: &str, panel: &Value) -> Panel {
    let number = |v: &Value| v.as_f64().unwrap();
    let list = |v: &Value| v.as_array().unwrap().iter().map(number).collect::<Vec<_>>();
    let point = |v: &Value| Vec2::new(number(&v[0]), number(&v[1]));
    let points = panel["vertices"].as_array().unwrap();
    let vertices: Vec<_> = points.iter().map(|v| point(v) / 100.0).collect();
    let edge = |edge: &Value| {
        let [start, end] = [0, 1].map(|i| edge["endpoints"][i].as_u64().unwrap() as usize);
        let along = vertices[end] - vertices[start];
        let control = |c: &Value| {
            let c = point(c);
            vertices[start] + along * c.x + Vec2::new(-along.y, along.x) * c.y
        };
        let curvature = &edge["curvature"];
        let params = &curvature["params"];
        let curve = match curvature["type"].as_str() {
            None => Curve::Line,
            Some("quadratic") => Curve::Quadratic(control(&params[0])),
            Some("cubic") => Curve::Cubic([control(&params[0]), control(&params[1])]),
            Some(_) => Curve::Arc {
                radius: number(&params[0]) / 100.0,
                large: number(&params[1]) != 0.0,
                counter_clockwise: number(&params[2]) != 0.0,
            },
        };
        Edge {
            start,
            end,
            curve,
            label: None,
        }
    };
    let angles: Vec<_> = list(&panel["rotation"])
        .iter()
        .map(|a| a.to_radians())
        .collect();
    let rotation = nalgebra::Rotation3::from_euler_angles(angles[0], angles[1], angles[2]);
    Panel {
        name: name.to_owned(),
        edges: panel["edges"]
            .as_array()
            .unwrap()
            .iter()
            .map(edge)
            .collect(),
        vertices,
        placement: Placement {
            rotation: *rotation.matrix(),
            translation: Vec3::from_vec(list(&panel["translation"])) / 100.0,
        },
        label: None,
    }
}
