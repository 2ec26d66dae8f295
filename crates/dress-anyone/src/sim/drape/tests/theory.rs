//! Cloth at rest against what closed forms say.

use super::*;
use crate::sim::energy::contact::{Contact, Nothing};

#[test]
fn a_tight_tube_presses_as_laplace_says() {
    // p = N/R: hoop tension over radius, on a smooth cylinder without weight to speak of.
    let mesh = fixtures::tube(60, 6, 0.01);
    let fabric = Fabric {
        density: 1e-4,
        bending: 1e-9,
        poisson: 0.0,
        ..SOFT
    };
    let mut cloth = Cloth::new(&mesh, &fabric);
    // Nothing else keeps it from sliding down.
    cloth.holds = (0..60)
        .map(|vertex| Hold {
            vertex,
            height: 0.0,
            stiffness: 1.0,
        })
        .collect();
    let assembly = Assembly::new(&cloth);
    let radius = 0.1;
    let cylinder = Cone {
        radius,
        slope: 0.0,
        flat: 1.0,
        lean: 0.0,
    };
    let params = SimParams {
        contact: ContactParams {
            thickness: 0.0,
            stiffness: 1e8,
            friction: OrFabric::Number(0.0),
        },
        equilibrium: EquilibriumParams {
            tolerance: 1e-4,
            ..Default::default()
        },
        ..SimParams::default()
    };
    let scene = scene(&cloth, &assembly, &cylinder, &params);
    let x = fixtures::rolled(&mesh, 0.6, 0.1001);
    let rest = cloth.at_rest(&mesh.x_bar);
    let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_, _| true);
    let system = system(&scene, &rest, &[]);
    assert_eq!(drape.status, RestStatus::AtRest);
    let push: f64 = cloth
        .contacts
        .iter()
        .map(|point| {
            let p = point.at(&drape.x);
            Contact::at(&cylinder, system.kappa(point), 0.0, p).map_or(0.0, |c| c.force().norm())
        })
        .sum();
    // The polygon of 60 sides that touches with their middles stretches to its own length, not 2πR.
    let stretch = 60.0 * 2.0 * radius * (std::f64::consts::PI / 60.0).tan() / 0.6;
    let tension = 80.0 * 0.5 * (stretch * stretch - 1.0) * stretch;
    let expected = tension / radius * (std::f64::consts::TAU * radius * 0.06);
    // The rims draw in a little where nothing pulls along the axis; 1 % covers it.
    assert_relative_eq!(push, expected, max_relative = 1e-2);
}

#[test]
fn a_sheet_on_the_floor_sinks_in_by_its_weight() {
    let mesh = fixtures::sheet(6, 6, 0.05);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let floor = Floor { height: 0.0 };
    let params = SimParams::default();
    let scene = scene(&cloth, &assembly, &floor, &params);
    let x = mesh
        .x_bar
        .iter()
        .map(|p| Vec3::new(p.x, 0.004, p.y))
        .collect();
    let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_, _| true);
    let depth = 0.2 * 9.81 / params.contact.stiffness;
    for p in &drape.x {
        assert_relative_eq!(p.y, params.contact.thickness - depth, max_relative = 1e-6);
    }
}

#[test]
fn what_nothing_holds_falls_and_is_reported() {
    let mesh = fixtures::sheet(3, 3, 0.05);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let params = SimParams::default();
    let scene = scene(&cloth, &assembly, &Nothing, &params);
    let x = mesh
        .x_bar
        .iter()
        .map(|p| Vec3::new(p.x, p.y, 0.0))
        .collect();
    let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_, _| true);
    assert_eq!(drape.status, RestStatus::Sliding);
}

/// A plane through the origin that rises along x by `slope`.
struct Incline {
    slope: f64,
}

impl Surface for Incline {
    fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
        let n = Vec3::new(-self.slope, 1.0, 0.0).normalize();
        Some((n.dot(&p), n))
    }

    fn curvature(&self, _: Vec3) -> crate::geometry::Mat3 {
        crate::geometry::Mat3::zeros()
    }
}

#[test]
fn a_sheet_on_an_incline_sticks_iff_it_is_less_steep_than_the_friction() {
    let mesh = fixtures::sheet(6, 4, 0.03);
    let cloth = Cloth::new(&mesh, &SOFT);
    let assembly = Assembly::new(&cloth);
    let mut params = firm_contact();
    params.contact.friction = OrFabric::Number(0.4);
    for (slope, sticks) in [(0.39, true), (0.41, false)] {
        let incline = Incline { slope };
        let scene = scene(&cloth, &assembly, &incline, &params);
        let x: Vec<Vec3> = (mesh.x_bar.iter())
            .map(|p| Vec3::new(p.x, slope * p.x, 0.0) / slope.hypot(1.0) + Vec3::z() * p.y)
            .map(|p| p + Vec3::y() * 2e-3)
            .collect();
        let found = drape(&scene, &mesh.x_bar, x.clone(), Start::Near, &mut |_, _| {
            true
        });
        assert_eq!(
            found.status == RestStatus::AtRest,
            sticks,
            "{:?}",
            found.status
        );
        let moved = (x.iter().zip(&found.x)).map(|(a, b)| (b - a).norm());
        let farthest = moved.fold(0.0, f64::max);
        // A weight of 2 N/m² on ties of 0.2 · 1e5 N/m³ gives by 0.04 mm, and sinks in by 0.02 mm;
        // what slips slides until it is told to.
        assert_eq!(farthest < 2e-3, sticks, "{farthest}");
    }
}

#[test]
fn a_strip_lengthens_by_its_load_over_its_stiffness() {
    // Hung by its upper edge: half its weight over E h, along its length.
    let (columns, rows, h) = (4, 20, 0.01);
    let mesh = fixtures::sheet(columns, rows, h);
    let fabric = Fabric {
        poisson: 0.0,
        ..SOFT
    };
    let mut cloth = Cloth::new(&mesh, &fabric);
    for i in 0..=columns {
        cloth.holds.push(Hold {
            vertex: (rows * (columns + 1) + i) as u32,
            height: 0.2,
            stiffness: 1e6,
        });
    }
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &Nothing, &params);
    let x = mesh.x_bar.iter().map(|p| Vec3::new(p.x, p.y, 0.0));
    let found = settle(&scene, &mesh.x_bar, x.collect());
    let middle = |j: usize| found.x[j * (columns + 1) + columns / 2].y;
    let longer = middle(rows) - middle(0) - 0.2;
    // 0.2 kg/m² · g · (0.2 m)² / (2 · 50 N/m); StVK differs by the strain itself, 0.4 %.
    assert_relative_eq!(longer, 0.2 * 9.81 * 0.04 / 100.0, max_relative = 1e-2);
}

/// Sag of a strip of ten centimetres and `rows` rows of equilateral triangles, clamped at one end.
fn sag(rows: usize) -> f64 {
    let columns = rows;
    let height = 0.1 / rows as f64;
    let h = height * 2.0 / 3.0_f64.sqrt();
    // The row before the clamp keeps the slope there.
    let mut mesh = fixtures::sheet(columns, rows + 1, h);
    let at = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    mesh.triangles.clear();
    for j in 0..=rows {
        for i in 0..=columns {
            let aside = if j.is_multiple_of(2) { 0.0 } else { 0.5 };
            mesh.x_bar[at(i, j) as usize] = Vec2::new(h * (i as f64 + aside), height * j as f64);
        }
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            mesh.triangles.extend(if j % 2 == 0 {
                [[a, b, d], [b, c, d]]
            } else {
                [[a, b, c], [a, c, d]]
            });
        }
    }
    let aside = if rows.is_multiple_of(2) { 0.5 } else { 0.0 };
    for i in 0..=columns {
        let end = at(i, rows + 1) as usize;
        mesh.x_bar[end] = Vec2::new(h * (i as f64 + aside), height * (rows + 1) as f64);
    }
    let fabric = Fabric {
        bending: 1e-2,
        poisson: 0.0,
        ..SOFT
    };
    let mut cloth = Cloth::new(&mesh, &fabric);
    let clamped = |vertex: u32| Hold {
        vertex,
        height: 0.0,
        stiffness: 1e4,
    };
    cloth.holds = (0..at(0, 2)).map(clamped).collect();
    let assembly = Assembly::new(&cloth);
    let params = firm_contact();
    let scene = scene(&cloth, &assembly, &Nothing, &params);
    let x = mesh.x_bar.iter().map(|p| Vec3::new(p.x, 0.0, p.y));
    let found = drape(
        &scene,
        &mesh.x_bar,
        x.collect(),
        Start::Near,
        &mut |_, _| true,
    );
    assert!(found.residual < 1e-4, "{}", found.residual);
    -found.x[at(columns / 2, rows + 1) as usize].y
}

#[test]
fn a_cantilever_sags_as_beam_theory_says_and_refinement_converges() {
    // w L⁴ / 8B(1 − ν²): hinges in three directions store Σ(nᵀSn)², which is that of a plate of
    // Poisson's ratio 1/3, and the sides are free to curl up. A cylinder stores ½Bκ² all the same.
    let rigidity = 1e-2 * (1.0 - 1.0 / 9.0);
    let expected = 0.2 * 9.81 * 0.1_f64.powi(4) / (8.0 * rigidity);
    let errors = [6, 12, 24].map(|rows| sag(rows) / expected - 1.0);
    assert!(errors[2].abs() < 0.02, "{errors:?}");
    assert!(errors[1].abs() < 0.6 * errors[0].abs(), "{errors:?}");
    assert!(errors[2].abs() < 0.6 * errors[1].abs(), "{errors:?}");
}

#[test]
fn without_drag_the_centre_of_a_crumpled_sheet_falls_freely() {
    let mesh = fixtures::sheet(5, 5, 0.05);
    let cloth = Cloth::new(&mesh, &SOFT);
    let rest = cloth.at_rest(&mesh.x_bar);
    let params = StepParams {
        drag: 0.0,
        speed: 100.0,
        ..StepParams::default()
    };
    let off = firm_contact().layers;
    let x: Vec<Vec3> = (mesh.x_bar.iter().enumerate())
        .map(|(i, p)| Vec3::new(p.x, p.y, 0.0) + Vec3::from_fn(|c, _| 0.01 * noise(3 * i + c)))
        .collect();
    let centre = |x: &[Vec3]| -> Vec3 {
        let weighted = x.iter().zip(&rest.mass).map(|(x, m)| x * *m);
        weighted.sum::<Vec3>() / rest.mass.iter().sum::<f64>()
    };
    let before = centre(&x);
    let contact = ContactParams::default();
    let watch = Watch::new(&cloth, off, &x);
    let mut stepper = Stepper::new(&cloth, &rest, &Nothing, contact, params, watch);
    let v = vec![Vec3::zeros(); x.len()];
    let mut state = State { x, v };
    for _ in 0..50 {
        stepper.step(&mut state, 0.0);
    }
    // g Δt² (1 + 2 + … + 50); momentum is kept to round-off.
    let fallen = crate::sim::cloth::GRAVITY * (params.dt * params.dt * 1275.0);
    assert_relative_eq!(centre(&state.x) - before, fallen, epsilon = 1e-12);
}
