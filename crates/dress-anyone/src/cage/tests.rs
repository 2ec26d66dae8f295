//! What the cages of a whole pattern promise.

use super::*;
use crate::check::noise;
use crate::fixture::{SLEEVE, named_pattern, panel, panel_at, sampled, shared};
use crate::geometry::Vec3;
use crate::geometry::polygon::{Polygon, is_simple};
use nalgebra::{DMatrix, DVector};

const FRONT: [(f64, f64); 6] = [
    (-0.25, 0.0),
    (0.25, 0.0),
    (0.2, 0.5),
    (0.1, 0.55),
    (-0.1, 0.55),
    (-0.2, 0.5),
];

/// A front that mirrors itself about a slanted axis, a pair of sleeves, and a patch.
fn garment() -> (Pattern, PatternMesh, Symmetry) {
    let turned = |(x, y): &(f64, f64)| (0.8 * x - 0.6 * y + 0.3, 0.6 * x + 0.8 * y);
    let mut front = panel_at(
        "front",
        &FRONT.map(|p| turned(&p)),
        Vec3::new(-0.24, 1.0, 0.1),
    );
    front.placement.rotation =
        *nalgebra::Rotation3::from_euler_angles(0.0, 0.0, -(0.6_f64.atan2(0.8))).matrix();
    let mirrored: Vec<_> = SLEEVE.iter().rev().map(|(x, y)| (0.7 - x, *y)).collect();
    let pattern = Pattern {
        panels: vec![
            front,
            panel_at("left", &SLEEVE, Vec3::new(0.4, 1.0, 0.0)),
            panel_at("right", &mirrored, Vec3::new(-1.1, 1.0, 0.0)),
            panel_at(
                "patch",
                &[(0.0, 0.0), (0.1, 0.0), (0.05, 0.12)],
                Vec3::new(0.1, 1.2, 0.2),
            ),
        ],
        stitches: vec![],
    };
    let mesh = sampled(&pattern, 0.03);
    let symmetry = Symmetry::detect(&pattern, &mesh, None);
    let pairs: Vec<_> = symmetry.mirrors.iter().map(|m| m.panels).collect();
    assert_eq!(pairs, [[0, 0], [1, 2]], "the fixture is what it says");
    (pattern, mesh, symmetry)
}

fn cages(kind: CageKind) -> (Cages, PatternMesh, Symmetry) {
    let (pattern, mesh, symmetry) = garment();
    let params = CageParams {
        kind,
        ..CageParams::default()
    };
    let cages = Cages::enclose(&pattern, &mesh, Some(&symmetry), &params).unwrap();
    (cages, mesh, symmetry)
}

/// Unknowns some centimetres from rest.
fn shaken(cages: &Cages, by: f64) -> Vec<f64> {
    let rest = cages.rest_unknowns();
    rest.iter()
        .enumerate()
        .map(|(j, z)| z + by * noise(j))
        .collect()
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

#[test]
fn at_rest_the_pattern_is_the_input_to_the_last_bit() {
    let (cages, mesh, _) = cages(CageKind::GreenAffine);
    assert_eq!(cages.deform(&cages.rest_unknowns()), mesh.x_bar);
    assert_eq!(cages.check(&cages.rest_unknowns()), Ok(()));
}

#[test]
fn pull_back_is_the_transpose_and_columns_are_its_rows() {
    let (cages, mesh, _) = cages(CageKind::GreenAffine);
    let zeta = shaken(&cages, 0.05);
    let rest = cages.rest_unknowns();
    let change: Vec<_> = zeta.iter().zip(&rest).map(|(a, b)| a - b).collect();
    let hat: Vec<_> = (0..mesh.x_bar.len())
        .map(|v| Vec2::new(noise(v), noise(v + 7)))
        .collect();
    let moved = cages.deform(&zeta);
    let work: f64 = (0..hat.len())
        .map(|v| hat[v].dot(&(moved[v] - mesh.x_bar[v])))
        .sum();
    let pulled = cages.pull_back(&hat);
    // Round-off of a sum of hundreds of terms of order 0.1.
    approx::assert_relative_eq!(work, dot(&change, &pulled), epsilon = 1e-12);
    for (j, pulled) in pulled.iter().enumerate() {
        let column = cages.column(j);
        let along: f64 = column.iter().map(|(v, d)| d.dot(&hat[*v as usize])).sum();
        approx::assert_relative_eq!(along, *pulled, epsilon = 1e-12);
    }
}

#[test]
fn columns_are_differences_of_the_map() {
    let (cages, mesh, _) = cages(CageKind::GreenAffine);
    let zeta = shaken(&cages, 0.02);
    let base = cages.deform(&zeta);
    for j in 0..cages.unknown_count() {
        let mut further = zeta.clone();
        further[j] += 1.0;
        let mut difference: Vec<_> = cages
            .deform(&further)
            .iter()
            .zip(&base)
            .map(|(a, b)| a - b)
            .collect();
        for (v, d) in cages.column(j) {
            difference[v as usize] -= d;
        }
        // The map is linear, so a step of 1 m has no truncation error.
        assert!(difference.iter().all(|d| d.norm() < 1e-12), "unknown {j}");
    }
    // The last unknowns belong to the patch alone.
    let patch = mesh.panel_vertices[3].clone();
    let last = cages.column(cages.unknown_count() - 1);
    assert!(last.iter().all(|(v, _)| patch.contains(&(*v as usize))));
}

#[test]
fn scaling_scales_every_panel_about_its_middle() {
    let (cages, mesh, _) = cages(CageKind::GreenAffine);
    let scaled = cages.deform(&cages.scaled(1.3));
    for range in &mesh.panel_vertices {
        let [a, b] = [range.start, range.end - 1];
        let (before, after) = (mesh.x_bar[b] - mesh.x_bar[a], scaled[b] - scaled[a]);
        assert!((after - before * 1.3).norm() < 1e-12);
    }
    // The patch is a triangle: its centroid is the mean of its corners.
    let middle = Vec2::new(0.05, 0.04);
    let corner = mesh.panel_vertices[3].start;
    let expected = middle + (mesh.x_bar[corner] - middle) * 1.3;
    assert!((scaled[corner] - expected).norm() < 1e-12);
    assert_eq!(cages.check(&cages.scaled(0.3)), Ok(()));
}

#[test]
fn rigid_modes_are_orthonormal_and_keep_all_lengths() {
    let (cages, mesh, _) = cages(CageKind::GreenAffine);
    let zeta = shaken(&cages, 0.02);
    let x_bar = cages.deform(&zeta);
    let modes = cages.rigid_modes(&zeta);
    // One along the front's axis, three each for the pair of sleeves and the patch.
    assert_eq!(modes.len(), 7);
    for (i, mode) in modes.iter().enumerate() {
        for (j, other) in modes.iter().enumerate() {
            let expected = if i == j { 1.0 } else { 0.0 };
            assert!((dot(mode, other) - expected).abs() < 1e-12);
        }
        let further: Vec<_> = zeta.iter().zip(mode).map(|(z, m)| z + m).collect();
        let moved = cages.deform(&further);
        let speed: Vec<_> = moved.iter().zip(&x_bar).map(|(a, b)| a - b).collect();
        assert!(
            speed.iter().any(|v| v.norm() > 0.1),
            "mode {i} moves something"
        );
        for range in &mesh.panel_vertices {
            for (v, w) in range.clone().zip(range.clone().skip(3)) {
                let rate = (x_bar[v] - x_bar[w]).dot(&(speed[v] - speed[w]));
                assert!(rate.abs() < 1e-12, "mode {i} changes a length");
            }
        }
    }
}

#[test]
fn any_unknowns_give_a_symmetric_pattern() {
    let (cages, mut mesh, symmetry) = cages(CageKind::GreenAffine);
    // Make (most of) the right sleeve's mesh the mirror image of the left's, and the front's symmetric.
    let [left, right] = [1, 2].map(|p| mesh.panel_vertices[p].clone());
    let pair = symmetry.mirrors[1].reflection;
    for (v, w) in left.clone().zip(right.clone()) {
        mesh.x_bar[w] = pair.apply(mesh.x_bar[v]);
    }
    let own = symmetry.mirrors[0].reflection;
    let front = mesh.panel_vertices[0].clone();
    let half = front.len() / 2;
    for v in front.start..front.start + half {
        mesh.x_bar[v + half] = own.apply(mesh.x_bar[v]);
    }
    let (pattern, ..) = garment();
    let symmetric =
        Cages::enclose(&pattern, &mesh, Some(&symmetry), &CageParams::default()).unwrap();
    assert_eq!(symmetric.unknown_count(), cages.unknown_count());
    let x_bar = symmetric.deform(&shaken(&symmetric, 0.05));
    for (v, w) in left.zip(right) {
        assert!((pair.apply(x_bar[v]) - x_bar[w]).norm() < 1e-12);
    }
    for v in front.start..front.start + half {
        assert!((own.apply(x_bar[v]) - x_bar[v + half]).norm() < 1e-12);
    }
    let drawn = symmetric.control_points(&shaken(&symmetric, 0.05));
    let n = drawn[0].len();
    for j in 0..n {
        assert!((own.apply(drawn[0][j]) - drawn[0][(n - j) % n]).norm() < 1e-12);
        assert!(
            drawn[1]
                .iter()
                .zip(&drawn[2])
                .all(|(a, b)| (pair.apply(*a) - b).norm() < 1e-12)
        );
    }
}

#[test]
fn only_an_affine_part_widens_a_panel_at_equal_length() {
    let corners = [(0.0, 0.0), (0.5, 0.0), (0.5, 0.7), (0.0, 0.7)];
    let pattern = Pattern {
        panels: vec![panel("rectangle", &corners)],
        stitches: vec![],
    };
    let mesh = sampled(&pattern, 0.0199);
    let best_fit = |kind| {
        let params = CageParams {
            kind,
            ..CageParams::default()
        };
        let cages = Cages::enclose(&pattern, &mesh, None, &params).unwrap();
        let mut w = DMatrix::zeros(2 * mesh.x_bar.len(), cages.unknown_count());
        for j in 0..cages.unknown_count() {
            for (v, d) in cages.column(j) {
                w[(2 * v as usize, j)] = d.x;
                w[(2 * v as usize + 1, j)] = d.y;
            }
        }
        let wider = mesh.x_bar.iter().flat_map(|p| [0.2 * p.x, 0.0]);
        let wider = DVector::from_iterator(w.nrows(), wider);
        let change = w.clone().svd(true, true).solve(&wider, 1e-9).unwrap();
        (w * change - wider).norm() / (mesh.x_bar.len() as f64).sqrt()
    };
    // 22.0 mm by an independent computation with 16 points on a 1 cm grid.
    let conformal = best_fit(CageKind::Green);
    assert!((0.021..0.023).contains(&conformal), "{conformal}");
    assert!(best_fit(CageKind::GreenAffine) < 1e-9);
}

/// The unknown that stretches the first panel unevenly, and its size ρ \[m\].
fn first_affine_unknown(cages: &Cages) -> (usize, f64) {
    let priors = cages.priors(&cages.rest_unknowns(), 1.0, 0.0);
    let mut slopes = priors.iter().flat_map(|p| &p.by).filter(|(_, d)| *d != 0.0);
    let (j, real) = *slopes.next().expect("an affine part");
    // A panel whose axis is oblique has β along it: a real and an imaginary part.
    let imaginary: f64 = slopes.filter(|(k, _)| *k == j).map(|(_, d)| d).sum();
    (j, 1.0 / real.hypot(imaginary))
}

#[test]
fn priors_lose_nothing_at_rest_and_scaled_and_are_derivatives() {
    for kind in [CageKind::Green, CageKind::GreenAffine] {
        let (cages, ..) = cages(kind);
        let loss = |zeta: &[f64]| -> f64 {
            let priors = cages.priors(zeta, 0.7, 0.3);
            priors.iter().map(|p| p.value * p.value).sum()
        };
        assert!(loss(&cages.rest_unknowns()) < 1e-24);
        assert!(loss(&cages.scaled(1.3)) < 1e-24);
        let zeta: Vec<f64> = (cages.rest_unknowns().iter().enumerate())
            .map(|(j, z)| z + 0.02 * noise(j))
            .collect();
        let here = cages.priors(&zeta, 0.7, 0.3);
        for j in [0, 3, zeta.len() - 1] {
            let mut moved = zeta.clone();
            moved[j] += 0.01;
            for (now, then) in here.iter().zip(cages.priors(&moved, 0.7, 0.3)) {
                let slope: f64 = now.by.iter().filter(|(k, _)| *k == j).map(|(_, d)| d).sum();
                // Linear: the difference is the derivative.
                assert!((then.value - now.value - 0.01 * slope).abs() < 1e-12);
            }
        }
    }
}

#[test]
fn an_uneven_stretch_costs_its_square() {
    let (cages, ..) = cages(CageKind::GreenAffine);
    let (j, size) = first_affine_unknown(&cages);
    let mut zeta = cages.rest_unknowns();
    assert_eq!(zeta[j], 0.0);
    zeta[j] = 0.1 * size;
    let loss: f64 = (cages.priors(&zeta, 2.0, 1.0).iter())
        .map(|p| p.value * p.value)
        .sum();
    // 2 |β|², and no side changes beside another by the control points.
    assert!((loss - 2.0 * 0.01).abs() < 1e-12, "{loss}");
}

#[test]
fn a_folded_or_crossing_pattern_is_rejected() {
    let (cages, ..) = cages(CageKind::GreenAffine);
    let rest = cages.rest_unknowns();
    let (j, size) = first_affine_unknown(&cages);
    let mut zeta = rest.clone();
    // |β| = 0.7 leaves stretch 0.3, |β| = 0.9 leaves 0.1, below the 0.2 of the parameters.
    zeta[j] = 0.7 * size;
    assert_eq!(cages.check(&zeta), Ok(()));
    zeta[j] = -0.9 * size;
    assert_eq!(cages.check(&zeta), Err(Rejection::Squeezed { panel: 0 }));
    let mut inside_out = rest.clone();
    inside_out[4] += 0.6;
    assert!(cages.check(&inside_out).is_err());
    let mut unknown = rest;
    unknown[2] = f64::NAN;
    assert_eq!(
        cages.check(&unknown),
        Err(Rejection::NotFinite { unknown: 2 })
    );
}

#[test]
fn all_problems_are_told_at_once() {
    let flat = [(0.0, 0.0), (0.1, 0.0), (0.2, 0.0)];
    let pattern = Pattern {
        panels: vec![panel("a", &flat), panel("b", &flat)],
        stitches: vec![],
    };
    let mesh = sampled(&pattern, 0.05);
    let problems = Cages::enclose(&pattern, &mesh, None, &CageParams::default()).unwrap_err();
    let places: Vec<_> = problems.iter().map(|p| p.place.as_str()).collect();
    assert_eq!(places, ["panel `a`", "panel `b`"]);
    let params = CageParams {
        max_control_points: 3,
        margin: f64::NAN,
        ..CageParams::default()
    };
    assert_eq!(
        Cages::enclose(&pattern, &mesh, None, &params)
            .unwrap_err()
            .len(),
        2
    );
}

#[test]
fn a_mesh_outside_its_outline_is_a_problem() {
    let (pattern, mut mesh, _) = garment();
    let last = mesh.x_bar.len() - 1;
    mesh.x_bar[last].x += 1.0;
    let problems = Cages::enclose(&pattern, &mesh, None, &CageParams::default()).unwrap_err();
    assert_eq!(problems[0].place, "panel `patch`");
}

#[test]
fn parameters_are_spelt_in_kebab_case_and_misspelt_ones_refused() {
    let params: CageParams = toml::from_str("kind = \"green\"\nmargin = 0.4").unwrap();
    assert_eq!((params.kind, params.margin), (CageKind::Green, 0.4));
    assert!(toml::from_str::<CageParams>("margins = 0.4").is_err());
}

#[test]
fn garmentcode_designs_deform_symmetrically_and_can_be_cut() {
    for path in shared(&["garments/named", "garments/random"], "json") {
        let (name, pattern) = named_pattern(&path);
        let mesh = sampled(&pattern, 0.03);
        let symmetry = Symmetry::detect(&pattern, &mesh, None);
        let cages = Cages::enclose(&pattern, &mesh, Some(&symmetry), &CageParams::default());
        let cages = cages.unwrap_or_else(|problems| panic!("{name}: {problems:?}"));
        let rest = cages.rest_unknowns();
        assert_eq!(cages.deform(&rest), mesh.x_bar, "{name}");
        assert_eq!(cages.check(&rest), Ok(()), "{name}");
        assert_eq!(cages.check(&cages.scaled(1.7)), Ok(()), "{name}");
        let drawn = cages.control_points(&rest);
        for ((cage, range), panel) in drawn.iter().zip(&mesh.panel_vertices).zip(&pattern.panels) {
            assert!(is_simple(cage), "{name} {}", panel.name);
            let cage = Polygon::new(cage.clone());
            let held = range.clone().all(|v| cage.contains(mesh.x_bar[v]));
            assert!(held, "{name} {}", panel.name);
        }
        let points: usize = drawn.iter().map(Vec::len).sum();
        println!(
            "{name}: {} panels, {points} control points, {} unknowns",
            drawn.len(),
            rest.len()
        );
        // Similarities are reproduced: a rotation of every panel keeps its outline's diagonal.
        let scaled = cages.deform(&cages.scaled(1.7));
        for range in &mesh.panel_vertices {
            let (a, b) = (range.start, range.start + range.len() / 2);
            let error = (scaled[b] - scaled[a]) - (mesh.x_bar[b] - mesh.x_bar[a]) * 1.7;
            assert!(error.norm() < 1e-11, "{name}: {}", error.norm());
        }
    }
}
