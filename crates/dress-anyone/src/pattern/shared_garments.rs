//! Meshes the project's own garment and every one of the shared data. Test-only.
//!
//! The qualities reached are printed (`cargo test shared_garments -- --nocapture`).

use super::triangulate::mesh;
use super::triangulate::tests::inner_points;
use super::{Pattern, PatternMesh};
use crate::fixture::{GARMENTS, named_pattern, own, shared};
use crate::geometry::quality::{QualitySummary, qualities};
use crate::geometry::{ClosestPoint, Vec2};
use crate::io::{self, body::BodyOptions};

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
    for file in shared(&GARMENTS, "json") {
        let (name, pattern) = named_pattern(&file);
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

#[test]
fn the_embedded_t_shirt_has_four_openings_and_seams_of_equal_length() {
    let (_, pattern) = named_pattern(&own("garments/tshirt.json"));
    let mesh = mesh(&pattern, 0.012).unwrap();
    let quality = check("tshirt", &pattern, &mesh);
    println!("{} vertices, {quality:?}", mesh.x_bar.len());
    assert!(quality.min > 0.5 && quality.mean > 0.97, "{quality:?}");
    // A sphere with four openings (neck, hem, two sleeves): 2 − 4, and edges have two sides.
    let topology = topology(mesh.cloth_vertex_count, &mesh.cloth_triangles());
    assert_eq!(topology, (-2, 2));
    for stitch in &pattern.stitches {
        let [a, b] = stitch.sides.map(|side| pattern.edge_length(side));
        // The cap is 2 mm longer than its armhole in each half; all other seams are equal.
        assert!((a - b).abs() < 1e-5 || ((b - a).abs() - 2e-3).abs() < 1e-5);
    }
}

#[test]
fn the_flat_t_shirt_surrounds_its_body_without_touching_it() {
    let file = own("bodies/f_average.obj");
    let body = io::body::read(&file, &BodyOptions::default()).unwrap().mesh;
    let (_, pattern) = named_pattern(&own("garments/tshirt.json"));
    let mesh = mesh(&pattern, 0.03).unwrap();
    let garment = crate::garment::Garment {
        name: "tshirt".into(),
        pattern,
        mesh,
        drape: None,
    };
    let closest = ClosestPoint::new(&body);
    let gaps = garment
        .placed()
        .into_iter()
        .map(|x| closest.signed_distance(x));
    // Positive outside. The draped cloth keeps 2 mm.
    let gap = gaps.fold(f64::INFINITY, f64::min);
    assert!(gap > 0.008, "closest {gap} m");
}

#[test]
fn left_and_right_panels_of_shared_garments_mesh_as_mirror_images() {
    let (mut pairs, mut alike) = (0, 0);
    for file in shared(&["garments/named"], "json") {
        let (_, pattern) = named_pattern(&file);
        let mesh = mesh(&pattern, 0.025).unwrap();
        let inner = |p: usize| inner_points(&mesh, p);
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
