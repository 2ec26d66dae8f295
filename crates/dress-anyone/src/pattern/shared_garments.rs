//! Meshes the project's own garment and every one of the shared data. Test-only.
//!
//! The qualities reached are printed (`cargo test shared_garments -- --nocapture`).

use super::curve::Curve;
use super::triangulate::mesh;
use super::{Edge, EdgeId, Panel, Pattern, PatternMesh, Placement, Stitch};
use crate::geometry::quality::{QualitySummary, qualities};
use crate::geometry::{TriangleMesh, Vec2, Vec3};
use nalgebra::Rotation3;
use serde_json::Value;
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
    let vec3 = |v: &Value| Some(Vec3::new(v[0].as_f64()?, v[1].as_f64()?, v[2].as_f64()?));
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
                rotation: {
                    let [x, y, z] = vec3(&panel["rotation"])?.into();
                    *Rotation3::from_euler_angles(
                        f64::to_radians(x),
                        f64::to_radians(y),
                        f64::to_radians(z),
                    )
                    .matrix()
                },
                translation: vec3(&panel["translation"])? * scale,
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
fn topology(vertex_count: usize, triangles: &[[u32; 3]]) -> (isize, usize) {
    let mut edges: Vec<(u32, u32)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(u, v)| (u.min(v), u.max(v)))
        .collect();
    edges.sort_unstable();
    let uses: Vec<usize> = edges.chunk_by(|a, b| a == b).map(<[_]>::len).collect();
    let euler = (vertex_count + triangles.len())
        .checked_signed_diff(uses.len())
        .unwrap();
    (euler, uses.into_iter().max().unwrap_or(0))
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
    weld_all(0.02);
}

#[test]
#[ignore = "most of a minute"]
fn every_shared_garment_welds_at_ten_millimetres() {
    weld_all(0.01);
}

fn weld_all(resolution: f64) {
    let mut all = Vec::new();
    for file in shared_garments() {
        let name = file.file_stem().unwrap().to_string_lossy().into_owned();
        let pattern = read(&file).unwrap();
        let start = std::time::Instant::now();
        let mesh =
            mesh(&pattern, resolution).unwrap_or_else(|problems| panic!("{name}: {}", problems[0]));
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
        all.extend(qualities(&mesh.x_bar, &mesh.triangles));
    }
    if let Some(quality) = QualitySummary::of(&all) {
        println!("all at {resolution} m: {quality:?}");
        // Worse than 0.25 only beside edges of a few millimetres: one triangle in ten thousand.
        let poor = all.iter().filter(|q| **q < 0.25).count();
        assert!(quality.min > 0.1 && quality.mean > 0.97 && poor * 10_000 < all.len());
    }
}

/// A file of the project's own data.
fn own(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../data")
        .join(path)
}

#[test]
fn the_embedded_t_shirt_has_four_openings_and_seams_of_equal_length() {
    let pattern = read(&own("garments/tshirt.json")).unwrap();
    let mesh = mesh(&pattern, 0.012).unwrap();
    let quality = check("tshirt", &pattern, &mesh);
    println!("{} vertices, {quality:?}", mesh.x_bar.len());
    assert!(quality.min > 0.5 && quality.mean > 0.97, "{quality:?}");
    // A sphere with four openings (neck, hem, two sleeves): 2 − 4, and edges have two sides.
    let topology = topology(mesh.cloth_vertex_count, &mesh.cloth_triangles());
    assert_eq!(topology, (-2, 2));
    for stitch in &pattern.stitches {
        let [a, b] = stitch.sides.map(|side| pattern.edge_length(side));
        // The cap is 5 mm longer than its armhole in each half; all other seams are equal.
        assert!((a - b).abs() < 1e-5 || ((b - a).abs() - 5e-3).abs() < 1e-5);
    }
}

#[test]
fn the_flat_t_shirt_surrounds_its_body_without_touching_it() {
    let text = std::fs::read_to_string(own("bodies/f_average.obj")).unwrap();
    let rows = |kind: &'static str| {
        let lines = text.lines().filter_map(move |line| line.strip_prefix(kind));
        lines.map(|line| {
            line.split(' ')
                .map(|n| n.parse::<f64>().unwrap())
                .collect::<Vec<_>>()
        })
    };
    let body = TriangleMesh {
        positions: rows("v ").map(|v| Vec3::from_row_slice(&v)).collect(),
        triangles: rows("f ")
            .map(|f| [0, 1, 2].map(|k| f[k] as u32 - 1))
            .collect(),
    };
    let pattern = read(&own("garments/tshirt.json")).unwrap();
    let mesh = mesh(&pattern, 0.03).unwrap();
    let garment = crate::garment::Garment {
        name: "tshirt".into(),
        pattern,
        mesh,
        drape: None,
    };
    let placed = garment.placed();
    let nearest = |x: &Vec3| {
        let distances = body.positions.iter().map(|p| (p - x).norm());
        distances.fold(f64::INFINITY, f64::min)
    };
    let gap = placed.iter().map(nearest).fold(f64::INFINITY, f64::min);
    // Body vertices are up to 2 cm apart, so that this is not far from the true distance.
    assert!(gap > 0.008, "closest {gap} m");
    let inside = placed
        .iter()
        .filter(|x| winding(**x, &body).abs() > 0.5)
        .count();
    assert_eq!(inside, 0);
}

/// How often a closed surface winds around `x` (van Oosterom & Strackee 1983).
fn winding(x: Vec3, body: &TriangleMesh) -> f64 {
    let solid_angle = |t: usize| {
        let [a, b, c] = body.corners(t).map(|p| p - x);
        let (l, m, n) = (a.norm(), b.norm(), c.norm());
        let below = l * m * n + a.dot(&b) * n + b.dot(&c) * l + c.dot(&a) * m;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    };
    (0..body.triangles.len()).map(solid_angle).sum::<f64>() / (4.0 * std::f64::consts::PI)
}

#[test]
fn left_and_right_panels_of_shared_garments_mesh_as_mirror_images() {
    let (mut pairs, mut alike) = (0, 0);
    for file in shared_garments()
        .iter()
        .filter(|file| file.parent().unwrap().ends_with("named"))
    {
        let pattern = read(file).unwrap();
        let mesh = mesh(&pattern, 0.015).unwrap();
        let inner = |p: usize| {
            let outline: usize = mesh.edge_vertices[p]
                .iter()
                .map(|along| along.len() - 1)
                .sum();
            mesh.x_bar[mesh.panel_vertices[p].clone()][outline..].to_vec()
        };
        for (left, panel) in pattern.panels.iter().enumerate() {
            let mut mirrored: Vec<Vec2> = panel
                .vertices
                .iter()
                .map(|p| Vec2::new(-p.x, p.y))
                .collect();
            let Some(right) = pattern.panel_named(&panel.name.replace("left", "right")) else {
                continue;
            };
            let mut other = pattern.panels[right].vertices.clone();
            let by_place = |a: &Vec2, b: &Vec2| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y));
            mirrored.sort_by(by_place);
            other.sort_by(by_place);
            let twins = mirrored.len() == other.len()
                && mirrored
                    .iter()
                    .zip(&other)
                    .all(|(a, b)| (a - b).norm() < 1e-9);
            if left == right || !twins {
                continue;
            }
            pairs += 1;
            let (a, b) = (inner(left), inner(right));
            let same = |(a, b): (&Vec2, &Vec2)| (Vec2::new(-a.x, a.y) - b).norm() < 1e-9;
            if a.len() == b.len() && a.iter().zip(&b).all(same) {
                alike += 1;
            } else {
                println!("{} of {} differs from its twin", panel.name, file.display());
            }
        }
    }
    println!("{alike} of {pairs} pairs are mirror images");
    assert_eq!(alike, pairs);
}
