//! What a mesh must be, on patterns small enough to know.

use super::*;
use crate::check::noise;
use crate::fixture::{panel, rectangle, stitch};
use crate::geometry::quality::{QualitySummary, qualities};
use crate::pattern::{Curve, Stitch};

fn pattern(panels: Vec<Panel>, stitches: Vec<Stitch>) -> Pattern {
    Pattern { panels, stitches }
}

/// The points of panel `p` inside its outline \[m\].
pub(crate) fn inner_points(mesh: &PatternMesh, p: usize) -> Vec<Vec2> {
    let along = mesh.edge_vertices[p].iter();
    let outline: usize = along.map(|vertices| vertices.len() - 1).sum();
    mesh.x_bar[mesh.panel_vertices[p].clone()][outline..].to_vec()
}

fn area(mesh: &PatternMesh) -> f64 {
    (0..mesh.triangles.len())
        .map(|t| mesh.rest_area(t, &mesh.x_bar))
        .sum()
}

fn summary(mesh: &PatternMesh) -> QualitySummary {
    QualitySummary::of(&qualities(&mesh.x_bar, &mesh.triangles)).unwrap()
}

#[test]
fn a_rectangle_is_filled_with_nearly_equilateral_triangles() {
    let mesh = mesh(&pattern(vec![rectangle("front", 0.3, 0.5)], vec![]), 0.01).unwrap();
    approx::assert_relative_eq!(area(&mesh), 0.15, epsilon = 1e-12);
    // 30 and 50 pieces: lengths that are multiples of the resolution get no extra piece.
    assert_eq!(mesh.edge_vertices[0][0].len(), 31);
    assert_eq!(mesh.edge_vertices[0][1].len(), 51);
    // Equilateral triangles of 1 cm: 0.15 / (√3/4 · 1e-4) = 3464.
    let count = mesh.triangles.len();
    assert!((3200..3700).contains(&count), "{count} triangles");
    let quality = summary(&mesh);
    assert!(quality.mean > 0.97 && quality.min > 0.6, "{quality:?}");
}

#[test]
fn a_concave_outline_is_filled_and_nothing_else() {
    let corners = [
        (0.0, 0.0),
        (0.3, 0.0),
        (0.3, 0.1),
        (0.1, 0.1),
        (0.1, 0.3),
        (0.0, 0.3),
    ];
    let mesh = mesh(&pattern(vec![panel("yoke", &corners)], vec![]), 0.012).unwrap();
    approx::assert_relative_eq!(area(&mesh), 0.05, epsilon = 1e-12);
    assert!(
        mesh.triangles
            .iter()
            .enumerate()
            .all(|(t, _)| mesh.rest_area(t, &mesh.x_bar) > 0.0)
    );
    assert!(summary(&mesh).mean > 0.93);
}

#[test]
fn a_tiny_edge_keeps_its_two_ends_and_spoils_only_its_neighbours() {
    let corners = [
        (0.0, 0.0),
        (0.2, 0.0),
        (0.2, 0.1),
        (0.1993, 0.1),
        (0.0, 0.1),
    ];
    let mesh = mesh(&pattern(vec![panel("facing", &corners)], vec![]), 0.02).unwrap();
    assert_eq!(mesh.edge_vertices[0][2].len(), 2);
    let quality = summary(&mesh);
    // 0.7 mm beside 20 mm: the best triangle on it has q ≈ √3 √(0.7 / 20) = 0.3.
    assert!(quality.min > 0.25 && quality.mean > 0.9, "{quality:?}");
}

#[test]
fn both_sides_of_a_gathered_seam_take_the_pieces_of_the_longer() {
    let panels = vec![rectangle("ruffle", 0.4, 0.1), rectangle("skirt", 0.2, 0.3)];
    let mesh = mesh(&pattern(panels, vec![stitch((0, 2), (1, 0))]), 0.02).unwrap();
    assert_eq!(mesh.edge_vertices[0][2].len(), 21);
    assert_eq!(mesh.edge_vertices[1][0].len(), 21);
    let quality = summary(&mesh);
    assert!(quality.min > 0.4 && quality.mean > 0.93, "{quality:?}");
}

#[test]
fn a_dart_closes_and_its_tip_stays_one_point() {
    let corners = [
        (0.0, 0.0),
        (0.09, 0.0),
        (0.1, 0.1),
        (0.11, 0.0),
        (0.2, 0.0),
        (0.2, 0.3),
        (0.0, 0.3),
    ];
    let dart = pattern(
        vec![panel("skirt_back", &corners)],
        vec![stitch((0, 1), (0, 2))],
    );
    let mesh = mesh(&dart, 0.01).unwrap();
    let (one, other) = (&mesh.edge_vertices[0][1], &mesh.edge_vertices[0][2]);
    for (a, b) in one.iter().zip(other.iter().rev()) {
        assert_eq!(mesh.sewing[*a as usize], mesh.sewing[*b as usize]);
    }
    assert_eq!(one.last(), other.first());
    // Every vertex of a leg but the tip welds to one of the other leg.
    assert_eq!(mesh.x_bar.len() - mesh.cloth_vertex_count, one.len() - 1);
}

#[test]
fn two_panels_close_into_a_ring() {
    let panels = vec![rectangle("front", 0.2, 0.3), rectangle("back", 0.2, 0.3)];
    let ring = pattern(panels, vec![stitch((0, 1), (1, 3)), stitch((1, 1), (0, 3))]);
    let mesh = mesh(&ring, 0.02).unwrap();
    // 16 vertices along each seam.
    assert_eq!(mesh.x_bar.len() - mesh.cloth_vertex_count, 32);
    assert_eq!(mesh.sewing[0], 0);
    let corner = |panel: usize, edge: usize| mesh.edge_vertices[panel][edge][0] as usize;
    // The front's lower right corner is the back's lower left one.
    assert_eq!(mesh.sewing[corner(0, 1)], mesh.sewing[corner(1, 0)]);
}

#[test]
fn a_one_piece_sleeve_closes_although_its_hem_ends_meet() {
    let sleeve = pattern(
        vec![rectangle("sleeve", 0.3, 0.2)],
        vec![stitch((0, 1), (0, 3))],
    );
    assert!(mesh(&sleeve, 0.02).is_ok());
}

#[test]
fn a_right_wrong_seam_joins_start_to_start() {
    let panels = vec![rectangle("collar", 0.2, 0.1), rectangle("stand", 0.2, 0.1)];
    let mut lapel = pattern(panels, vec![stitch((0, 0), (1, 0))]);
    lapel.stitches[0].right_wrong = true;
    let mesh = mesh(&lapel, 0.02).unwrap();
    for (a, b) in mesh.edge_vertices[0][0]
        .iter()
        .zip(&mesh.edge_vertices[1][0])
    {
        assert_eq!(mesh.sewing[*a as usize], mesh.sewing[*b as usize]);
    }
}

#[test]
fn stitches_that_join_the_two_ends_of_an_edge_are_named() {
    let panels = vec![rectangle("front", 0.2, 0.3), rectangle("back", 0.2, 0.3)];
    // The shoulders run the wrong way; the side seam then closes one of them into a loop.
    let mut twisted = pattern(panels, vec![stitch((0, 1), (1, 3)), stitch((0, 2), (1, 2))]);
    twisted.stitches[1].right_wrong = true;
    let problems = mesh(&twisted, 0.02).unwrap_err();
    assert!(problems[0].place.contains("edge 2"), "{problems:?}");
    assert!(problems[0].text.contains("stitch 1"), "{problems:?}");
}

#[test]
fn mirrored_and_turned_copies_of_a_panel_get_mirrored_and_turned_meshes() {
    let left = vec![
        (0.0, 0.0),
        (0.21, 0.013),
        (0.27, 0.31),
        (0.11, 0.4),
        (0.02, 0.33),
    ];
    let (sin, cos) = 0.7_f64.sin_cos();
    let turn = |(x, y): (f64, f64)| (0.3 - x * cos + y * sin, 0.1 + x * sin + y * cos);
    let mut right: Vec<(f64, f64)> = left.iter().map(|&p| turn(p)).collect();
    right.reverse();
    let clockwise: Vec<(f64, f64)> = left.iter().rev().copied().collect();
    let panels = vec![
        panel("l", &left),
        panel("r", &right),
        panel("c", &clockwise),
    ];
    let mesh = mesh(&pattern(panels, vec![]), 0.01).unwrap();
    assert_eq!(mesh.right_side_up, [true, true, false]);
    let inner = |p: usize| inner_points(&mesh, p);
    assert_eq!(inner(0).len(), inner(1).len());
    for ((a, b), c) in inner(0).into_iter().zip(inner(1)).zip(inner(2)) {
        let (x, y) = turn((a.x, a.y));
        assert!((b - Vec2::new(x, y)).norm() < 1e-9 && (c - a).norm() < 1e-9);
    }
}

#[test]
fn everything_wrong_with_a_drawing_is_said_at_once() {
    let mut open = rectangle("front", 0.2, 0.3);
    open.edges[1].end = 0;
    let mut broken = rectangle("back", 0.2, 0.3);
    broken.vertices[2].x = f64::NAN;
    broken.edges[0].end = 9;
    let problems = mesh(
        &pattern(vec![open, broken], vec![stitch((0, 0), (4, 0))]),
        0.02,
    )
    .unwrap_err();
    for place in [
        "`front`, edge 1",
        "`back`, edge 0",
        "`back`, edge 1",
        "stitch 0",
    ] {
        let named = problems.iter().any(|problem| problem.place.contains(place));
        assert!(named, "{place} is not in {problems:?}");
    }
}

#[test]
fn outlines_that_cross_and_absurd_resolutions_are_refused() {
    let bow_tie = panel("tie", &[(0.0, 0.0), (0.2, 0.2), (0.2, 0.0), (0.0, 0.2)]);
    let problems = mesh(&pattern(vec![bow_tie], vec![]), 0.02).unwrap_err();
    assert!(
        problems[0].text.contains("edge 0 and edge 2"),
        "{problems:?}"
    );
    let plain = pattern(vec![rectangle("front", 1.0, 1.0)], vec![]);
    for resolution in [0.0, -1.0, f64::NAN, 1e-6] {
        assert!(mesh(&plain, resolution).is_err());
    }
}

#[test]
fn a_panel_too_narrow_for_any_triangle_is_named() {
    // A wedge 10 µm high: triangles of 20 mm on it have q of about 10 µm / 20 mm, below 1e-3.
    let wedge = panel("tie", &[(0.0, 0.0), (0.2, 0.0), (0.1, 1e-5)]);
    let problems = mesh(&pattern(vec![wedge], vec![]), 0.02).unwrap_err();
    assert_eq!(problems[0].place, "panel `tie`");
    assert!(problems[0].text.contains("too narrow"), "{problems:?}");
}

#[test]
fn points_of_a_panel_that_another_panel_sews_together_are_named() {
    // Hem and shoulder of the front are both sewn to the back's hem.
    let panels = vec![rectangle("front", 0.2, 0.3), rectangle("back", 0.2, 0.3)];
    let doubled = pattern(panels, vec![stitch((0, 0), (1, 0)), stitch((0, 2), (1, 0))]);
    let problems = mesh(&doubled, 0.02).unwrap_err();
    assert_eq!(problems[0].place, "panel `front`");
    // The hem's start meets the shoulder's: the corners (0, 0) and (20, 30) cm.
    for told in ["(0.0, 0.0) cm", "(20.0, 30.0) cm", "by way of other panels"] {
        assert!(problems[0].text.contains(told), "{problems:?}");
    }
}

#[test]
fn a_triangle_that_sewing_closes_onto_itself_is_named() {
    // A cone of a single triangle: sewing its two sides joins the ends of its base.
    let cone = panel("cone", &[(0.0, 0.0), (0.2, 0.0), (0.1, 0.04)]);
    let cone = pattern(vec![cone], vec![stitch((0, 1), (0, 2))]);
    let problems = mesh(&cone, 0.3).unwrap_err();
    assert_eq!(problems[0].place, "panel `cone`");
    let told = "closes a triangle";
    assert!(problems[0].text.contains(told), "{problems:?}");
    // More finely, its blunt tip has a fan of triangles and can be sewn.
    assert!(mesh(&cone, 0.02).is_ok());
}

#[test]
fn any_star_is_meshed_or_told_what_is_wrong() {
    let mut meshed = 0;
    for seed in 0..200 {
        let star = pattern(vec![star(seed)], vec![]);
        match mesh(&star, 0.02) {
            Ok(mesh) => {
                let positive = |t| mesh.rest_area(t, &mesh.x_bar) > 0.0;
                assert!((0..mesh.triangles.len()).all(positive), "star {seed}");
                meshed += 1;
            }
            Err(problems) => assert!(!problems.is_empty() && seed % 2 == 1, "{problems:?}"),
        }
    }
    // Straight stars are simple, so all are meshed; curved ones often cross themselves.
    assert!((100..200).contains(&meshed), "{meshed}");
}

/// A panel with 5 to 23 corners around a centre, 5 mm to 25 cm away; every other has curved edges.
fn star(seed: usize) -> Panel {
    let count = 5 + seed % 19;
    let random = |i: usize| 0.5 + 0.5 * noise(1000 * seed + i);
    let corner = |i: usize| {
        let angle = std::f64::consts::TAU * (i as f64 + 0.8 * random(count + i)) / count as f64;
        let radius = 0.005 + 0.245 * random(i).powi(2);
        (radius * angle.cos(), radius * angle.sin())
    };
    let mut star = panel("star", &(0..count).map(corner).collect::<Vec<_>>());
    if seed % 2 == 1 {
        for e in 0..count {
            let (a, b) = star.ends(e);
            let bulge = Vec2::new(noise(3 * e + seed), noise(5 * e + seed));
            star.edges[e].curve = Curve::Quadratic((a + b) * 0.5 + 0.3 * (b - a).norm() * bulge);
        }
    }
    star
}
