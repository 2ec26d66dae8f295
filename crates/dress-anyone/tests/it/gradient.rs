//! The gradient a refit descends by: the whole loss by the cage's unknowns, through a complete
//! drape on a meshed body.

use dress_anyone::body::distance_field::DistanceField;
use dress_anyone::cage::{CageKind, CageParams, Cages};
use dress_anyone::garment::{Fabric, Garment};
use dress_anyone::geometry::{Mat3, TriangleMesh, Vec2, Vec3};
use dress_anyone::loss::{LossParams, Losses};
use dress_anyone::pattern::{Curve, Edge, EdgeId, Panel, Pattern, Placement, Stitch, triangulate};
use dress_anyone::refit::dress::{HoldParams, holds};
use dress_anyone::sim::Differentiable;
use dress_anyone::sim::{Assembly, Cloth, Scene, SimParams, Start, drape};

/// A closed, tapered, flattened body of 0.7 m about the y axis, wider below.
fn hips() -> TriangleMesh {
    let (around, up) = (48, 28);
    let mut positions = Vec::new();
    for j in 0..=up {
        let y = -0.6 + 0.7 * f64::from(j) / f64::from(up);
        let radius = 0.13 - 0.12 * y;
        for i in 0..around {
            let angle = std::f64::consts::TAU * f64::from(i) / f64::from(around);
            // Leaning and flattened, so that nothing can turn on it freely.
            let x = radius * angle.sin() + 0.15 * y;
            positions.push(Vec3::new(x, y, 0.8 * radius * angle.cos()));
        }
    }
    let mut triangles = Vec::new();
    for j in 0..up as u32 {
        for i in 0..around as u32 {
            let next = (i + 1) % around as u32;
            let at = |i: u32, j: u32| j * around as u32 + i;
            triangles.push([at(i, j), at(next, j), at(next, j + 1)]);
            triangles.push([at(i, j), at(next, j + 1), at(i, j + 1)]);
        }
    }
    for (row, flip) in [(0, true), (up as u32, false)] {
        let centre = positions.len() as u32;
        let y = -0.6 + 0.7 * f64::from(row) / f64::from(up);
        positions.push(Vec3::new(0.15 * y, y, 0.0));
        for i in 0..around as u32 {
            let (a, b) = (
                row * around as u32 + i,
                row * around as u32 + (i + 1) % around as u32,
            );
            triangles.push(if flip { [b, a, centre] } else { [a, b, centre] });
        }
    }
    TriangleMesh {
        positions,
        triangles,
    }
}

/// A tight skirt of two panels, held at its waist: it has no wrinkles that could jump.
fn skirt() -> Garment {
    let panel = |name: &str, z: f64, flare: f64| {
        let corners = [
            (-0.235 - flare, -0.4),
            (0.235 + flare, -0.42),
            (0.18, 0.0),
            (-0.18, 0.0),
        ];
        let edge = |i: usize| Edge {
            start: i,
            end: (i + 1) % 4,
            curve: Curve::Line,
            label: (i == 2).then(|| "lower_interface".to_owned()),
        };
        Panel {
            name: name.to_owned(),
            vertices: corners.iter().map(|(x, y)| Vec2::new(*x, *y)).collect(),
            edges: (0..4).map(edge).collect(),
            placement: Placement {
                rotation: Mat3::identity(),
                translation: Vec3::new(0.0, 0.0, z),
            },
            label: None,
        }
    };
    let stitch = |edge: usize| Stitch {
        sides: [EdgeId { panel: 0, edge }, EdgeId { panel: 1, edge }],
        right_wrong: true,
    };
    let pattern = Pattern {
        panels: vec![panel("front", 0.2, 0.01), panel("back", -0.2, 0.0)],
        stitches: vec![stitch(1), stitch(3)],
    };
    let mesh = triangulate::mesh(&pattern, 0.05).expect("a valid pattern");
    Garment {
        name: "skirt".to_owned(),
        pattern,
        mesh,
        drape: None,
    }
}

#[test]
fn the_gradient_of_the_whole_loss_by_the_cages_agrees_with_complete_drapes() {
    let garment = skirt();
    let mesh = &garment.mesh;
    let surface = DistanceField::new(&hips(), DistanceField::SPACING, DistanceField::OUTER);
    let fabric = Fabric {
        bending: 1e-4,
        ..Fabric::default()
    };
    let mut cloth = Cloth::new(mesh, &fabric);
    cloth.holds = holds(&garment, &garment.placed(), &HoldParams::default());
    let assembly = Assembly::new(&cloth);
    let params = SimParams::default();
    let scene = Scene {
        cloth: &cloth,
        assembly: &assembly,
        surface: &surface,
        params: &params,
    };
    let first = drape(
        &scene,
        &mesh.x_bar,
        garment.placed(),
        Start::Placed {
            short: mesh.x_bar.clone(),
        },
        &mut |_, _| true,
    );

    for kind in [CageKind::Green, CageKind::GreenAffine] {
        let cage = CageParams {
            kind,
            ..CageParams::default()
        };
        let cages = Cages::enclose(&garment.pattern, mesh, None, &cage).expect("a cage");
        // A target that nothing reaches: the drape, wider and lower.
        let stretch = Mat3::from_diagonal(&Vec3::new(1.05, 1.03, 1.08));
        let x_star: Vec<Vec3> = first.x.iter().map(|p| stretch * p).collect();
        let losses = Losses::new(&garment.pattern, mesh, &x_star, &LossParams::default());
        let rest = cages.rest_unknowns();
        let direction: Vec<f64> = (0..rest.len())
            .map(|j| (1.7 * j as f64 + 0.3).sin())
            .collect();
        let at = |s: f64, start: &[Vec3]| -> (f64, Differentiable<'_>) {
            let zeta: Vec<f64> = rest
                .iter()
                .zip(&direction)
                .map(|(z, d)| z + s * d)
                .collect();
            let x_bar = cages.deform(&zeta);
            let found = drape(&scene, &x_bar, start.to_vec(), Start::Near, &mut |_, _| {
                true
            });
            let state = found.differentiable(&scene).expect("at rest");
            (losses.evaluate(&state.drape.x, &x_bar).total, state)
        };
        let (_, here) = at(0.0, &first.x);
        assert_eq!(here.shift, 0.0, "a minimum");
        let loss = losses.evaluate(&here.drape.x, &here.drape.x_bar);
        let (through_drape, _) = here.pull_back(&loss.x_hat);
        let hat: Vec<Vec2> = through_drape
            .iter()
            .zip(&loss.x_bar_hat)
            .map(|(a, b)| a + b)
            .collect();
        let gradient = cages.pull_back(&hat);
        let slope: f64 = gradient.iter().zip(&direction).map(|(g, d)| g * d).sum();
        // Far above the polish of the drapes (1e-9), far below where wrinkles move.
        let h = 1e-6;
        let near = &here.drape.x;
        let difference = (at(h, near).0 - at(-h, near).0) / (2.0 * h);
        let error = ((slope - difference) / difference).abs();
        assert!(
            error < 1e-4,
            "{kind:?}: adjoint {slope}, difference {difference}, relative {error:e}"
        );
    }
}
