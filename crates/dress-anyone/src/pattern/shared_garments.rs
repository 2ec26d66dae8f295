//! Meshes every garment of the shared data and prints what came out. Test-only.

use super::curve::Curve;
use super::triangulate::mesh;
use super::{Edge, EdgeId, Panel, Pattern, PatternMesh, Placement, Stitch};
use crate::geometry::quality::{QualitySummary, qualities};
use crate::geometry::{Mat3, Vec2, Vec3};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Every `.json` below the shared garments; none, with a word, where there are no shared data.
fn shared_garments() -> Vec<PathBuf> {
    let root = std::env::var_os("DRESS_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"),
        PathBuf::from,
    );
    let mut files = Vec::new();
    let mut folders = vec![root.join("data/garments")];
    while let Some(folder) = folders.pop() {
        for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == "json") {
                files.push(path);
            }
        }
    }
    if files.is_empty() {
        println!("skipped: no shared garments");
    }
    files.sort();
    files
}

/// As much of the format as these files need.
fn read(path: &Path) -> Option<Pattern> {
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).ok()?).ok()?;
    let scale = 1.0 / file["properties"]["units_in_meter"].as_f64()?;
    let vec2 = |v: &Value| Some(Vec2::new(v[0].as_f64()?, v[1].as_f64()?));
    let panels = file["pattern"]["panels"].as_object()?;
    let read_panel = |(name, panel): (&String, &Value)| {
        let vertices: Vec<Vec2> = panel["vertices"]
            .as_array()?
            .iter()
            .map(|v| vec2(v).map(|p| p * scale))
            .collect::<Option<_>>()?;
        let read_edge = |edge: &Value| {
            let start = edge["endpoints"][0].as_u64()? as usize;
            let end = edge["endpoints"][1].as_u64()? as usize;
            let (a, b) = (vertices[start], vertices[end]);
            let control = |v: &Value| {
                let (c, along) = (vec2(v)?, b - a);
                Some(a + along * c.x + Vec2::new(-along.y, along.x) * c.y)
            };
            let curvature = &edge["curvature"];
            let params = &curvature["params"];
            let curve = match curvature["type"].as_str() {
                None if curvature.is_null() => Curve::Line,
                None => Curve::Quadratic(control(curvature)?),
                Some("quadratic") => Curve::Quadratic(control(&params[0])?),
                Some("cubic") => Curve::Cubic([control(&params[0])?, control(&params[1])?]),
                _ => Curve::Arc {
                    radius: params[0].as_f64()? * scale,
                    large: params[1].as_f64()? > 0.5,
                    counter_clockwise: params[2].as_f64()? > 0.5,
                },
            };
            Some(Edge {
                start,
                end,
                curve,
                label: None,
            })
        };
        Some(Panel {
            name: name.clone(),
            edges: panel["edges"]
                .as_array()?
                .iter()
                .map(read_edge)
                .collect::<Option<_>>()?,
            vertices,
            placement: Placement {
                rotation: Mat3::identity(),
                translation: Vec3::zeros(),
            },
            label: None,
        })
    };
    let side = |v: &Value| {
        Some(EdgeId {
            panel: panels
                .keys()
                .position(|name| Some(name.as_str()) == v["panel"].as_str())?,
            edge: v["edge"].as_u64()? as usize,
        })
    };
    let read_stitch = |stitch: &Value| {
        Some(Stitch {
            sides: [side(&stitch[0])?, side(&stitch[1])?],
            right_wrong: stitch[2] == "right_wrong",
        })
    };
    Some(Pattern {
        panels: panels.iter().map(read_panel).collect::<Option<_>>()?,
        stitches: file["pattern"]["stitches"]
            .as_array()?
            .iter()
            .map(read_stitch)
            .collect::<Option<_>>()?,
    })
}

/// Vertices − edges + faces, and how many triangles each edge has at most.
fn topology(vertex_count: usize, triangles: &[[u32; 3]]) -> (i64, usize) {
    let mut edges: BTreeMap<(u32, u32), usize> = BTreeMap::new();
    for [a, b, c] in triangles {
        for (u, v) in [(a, b), (b, c), (c, a)] {
            *edges.entry((*u.min(v), *u.max(v))).or_default() += 1;
        }
    }
    let most = edges.values().copied().max().unwrap_or(0);
    (
        vertex_count as i64 - edges.len() as i64 + triangles.len() as i64,
        most,
    )
}

fn check(name: &str, pattern: &Pattern, mesh: &PatternMesh) -> QualitySummary {
    for (p, panel) in pattern.panels.iter().enumerate() {
        let (first, count) = (
            mesh.panel_vertices[p].start as u32,
            mesh.panel_vertices[p].len(),
        );
        let triangles: Vec<[u32; 3]> = mesh.triangles[mesh.panel_triangles[p].clone()]
            .iter()
            .map(|t| t.map(|v| v - first))
            .collect();
        // A panel is a disc: Euler characteristic 1, and no edge has three triangles.
        assert_eq!(topology(count, &triangles), (1, 2), "{name} {}", panel.name);
        let area: f64 = mesh.panel_triangles[p]
            .clone()
            .map(|t| mesh.rest_area(t, &mesh.x_bar))
            .sum();
        let outline: Vec<Vec2> = mesh.edge_vertices[p]
            .iter()
            .flat_map(|along| &along[1..])
            .map(|&v| mesh.x_bar[v as usize])
            .collect();
        let enclosed = crate::geometry::signed_area(&outline);
        // Every boundary edge used once and all triangles counter-clockwise: areas agree.
        assert!(
            (area - enclosed.abs()).abs() < 1e-12,
            "{name} {}",
            panel.name
        );
        assert_eq!(enclosed > 0.0, mesh.right_side_up[p]);
    }
    let q = qualities(&mesh.x_bar, &mesh.triangles);
    QualitySummary::of(&q).unwrap()
}

#[test]
fn every_shared_garment_welds_without_a_flipped_triangle() {
    for resolution in [0.02, 0.01] {
        let mut all = Vec::new();
        for file in shared_garments() {
            let name = file.file_stem().unwrap().to_string_lossy().into_owned();
            let pattern = read(&file).unwrap();
            let start = std::time::Instant::now();
            let mesh = mesh(&pattern, resolution)
                .unwrap_or_else(|problems| panic!("{name}: {}", problems[0]));
            let seconds = start.elapsed().as_secs_f64();
            let quality = check(&name, &pattern, &mesh);
            let (euler, most) = topology(mesh.cloth_vertex_count, &mesh.cloth_triangles());
            println!(
                "{name:45} {:6} vertices {:4.2} s  q min {:.3} 1% {:.3} mean {:.3}  Euler {euler} {most}",
                mesh.x_bar.len(),
                seconds,
                quality.min,
                quality.one_percent,
                quality.mean
            );
            let qs = qualities(&mesh.x_bar, &mesh.triangles);
            if quality.min < 0.4 {
                let t = (0..qs.len())
                    .min_by(|a, b| qs[*a].total_cmp(&qs[*b]))
                    .unwrap();
                let p = mesh
                    .panel_triangles
                    .iter()
                    .position(|r| r.contains(&t))
                    .unwrap();
                let bound: Vec<bool> = mesh.triangles[t]
                    .iter()
                    .map(|v| mesh.edge_vertices[p].iter().flatten().any(|w| w == v))
                    .collect();
                println!(
                    "   {} {:?} {:?}",
                    pattern.panels[p].name,
                    mesh.triangles[t]
                        .map(|v| mesh.x_bar[v as usize] * 1000.0)
                        .map(|p| (p.x, p.y)),
                    bound
                );
            }
            all.extend(qualities(&mesh.x_bar, &mesh.triangles));
        }
        println!("{resolution} {:?}", QualitySummary::of(&all));
    }
}
