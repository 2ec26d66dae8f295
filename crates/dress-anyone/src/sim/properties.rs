//! What holds for any small cloth: random meshes of random fabrics, crumpled at random.

use super::cloth::fixtures::{self, SOFT};
use super::drape::{Scene, SimParams, Start, drape};
use super::energy::contact::{ContactParams, Nothing, Surface};
use super::equilibrium::RestStatus;
use super::layers::Watch;
use super::step::{State, StepParams, Stepper};
use super::system::{Assembly, System};
use super::{Cloth, Rest};
use crate::check::{assert_derivative, noise};
use crate::garment::{Cut, Fabric};
use crate::geometry::{Mat3, Vec2, Vec3};
use crate::pattern::PatternMesh;
use crate::sim::material::Material;
use approx::assert_relative_eq;
use nalgebra::Rotation3;
use proptest::prelude::*;

/// A cloth and where it is.
#[derive(Clone, Debug)]
struct Crumpled {
    mesh: PatternMesh,
    cloth: Cloth,
    /// Positions \[m\], `[cloth vertex]`.
    x: Vec<Vec3>,
    seed: usize,
}

impl Crumpled {
    fn rest(&self) -> Rest {
        self.cloth.at_rest(&self.mesh.x_bar)
    }

    /// A direction of order one.
    fn direction(&self, which: usize) -> Vec<Vec3> {
        let at = |i: usize| Vec3::from_fn(|c, _| noise(self.seed + 1000 * which + 3 * i + c));
        (0..self.x.len()).map(at).collect()
    }
}

/// Sheets and tubes of 2 to 60 triangles of about 4 cm, with corners out of place, of two fabrics off
/// the grain; strains of up to a half.
fn crumpled() -> impl Strategy<Value = Crumpled> {
    let fabric = (1.0..3.5_f64, 1.0..3.5_f64, -0.4..0.7_f64, 0.5..3.0_f64)
        .prop_flat_map(|stiff| (Just(stiff), -6.0..-3.0_f64, 0.05..0.6_f64))
        .prop_map(|((warp, weft, poisson, shear), bending, density)| Fabric {
            warp: 10_f64.powf(warp),
            weft: 10_f64.powf(weft),
            poisson,
            shear: 10_f64.powf(shear),
            bending: 10_f64.powf(bending),
            density,
            ..SOFT
        });
    let size = (1_usize..6, 1_usize..6, any::<bool>());
    (size, fabric, -90.0..90.0_f64, 0.0..0.5_f64, 0_usize..10_000).prop_map(
        |((columns, rows, closed), fabric, grain, strain, seed)| {
            let h = 0.04;
            // A tube needs three columns to go around.
            let mut mesh = if closed && columns > 2 {
                fixtures::tube(columns, rows, h)
            } else {
                fixtures::sheet(columns, rows, h)
            };
            for (i, p) in mesh.x_bar.iter_mut().enumerate() {
                *p += Vec2::from_fn(|c, _| 0.2 * h * noise(seed + 2 * i + c));
            }
            let mut cloth = Cloth::new(&mesh, &SOFT);
            cloth.materials.push(Material::from(&Cut { fabric, grain }));
            for of in cloth.material_of.iter_mut().step_by(2) {
                *of = 1;
            }
            let flat = |(i, p): (usize, &Vec2)| {
                let off = Vec3::from_fn(|c, _| 0.5 * strain * h * noise(seed + 500 + 3 * i + c));
                Vec3::new(p.x, 0.1 * (p.x / 0.1).sin(), p.y) + off
            };
            let flat: Vec<Vec3> = mesh.x_bar.iter().enumerate().map(flat).collect();
            let x = mesh.sew(&flat);
            Crumpled {
                mesh,
                cloth,
                x,
                seed,
            }
        },
    )
}

fn system<'a>(cloth: &'a Cloth, rest: &'a Rest) -> System<'a, Nothing> {
    System::new(cloth, rest, &Nothing, ContactParams::default(), &[])
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

fn size(a: &[Vec3]) -> f64 {
    dot(a, a).sqrt()
}

/// A ball of 5 cm, all of it.
struct Ball;

impl Surface for Ball {
    fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
        Some((p.norm() - 0.05, p.try_normalize(0.0).unwrap_or(Vec3::y())))
    }

    fn curvature(&self, p: Vec3) -> Mat3 {
        let n = p.try_normalize(0.0).unwrap_or(Vec3::y());
        (Mat3::identity() - n * n.transpose()) / p.norm().max(1e-6)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn turned_about_the_vertical_and_moved_it_has_the_same_energy_and_forces(
        crumpled in crumpled(), angle in -3.0..3.0_f64, by in (-2.0..2.0_f64, -2.0..2.0_f64),
    ) {
        let rest = crumpled.rest();
        let system = system(&crumpled.cloth, &rest);
        let turn = Rotation3::from_axis_angle(&Vec3::y_axis(), angle);
        let moved: Vec<Vec3> = (crumpled.x.iter())
            .map(|p| turn * p + Vec3::new(by.0, 0.0, by.1))
            .collect();
        let (here, there) = (system.energy(&crumpled.x, &[]), system.energy(&moved, &[]));
        assert_relative_eq!(here, there, max_relative = 1e-9, epsilon = 1e-12);
        let forces = system.force(&crumpled.x, &[]);
        let scale = size(&forces);
        for (f, g) in forces.iter().zip(system.force(&moved, &[])) {
            prop_assert!((turn * f - g).norm() < 1e-9 * scale);
        }
    }

    #[test]
    fn inner_forces_have_neither_a_sum_nor_a_moment(crumpled in crumpled()) {
        let rest = crumpled.rest();
        let forces = system(&crumpled.cloth, &rest).force(&crumpled.x, &[]);
        let weight = |m: &f64| super::cloth::GRAVITY * *m;
        let inner: Vec<Vec3> = (forces.iter().zip(&rest.mass)).map(|(f, m)| f - weight(m)).collect();
        let scale: f64 = inner.iter().map(Vec3::norm).sum();
        let sum: Vec3 = inner.iter().sum();
        let moment: Vec3 = crumpled.x.iter().zip(&inner).map(|(x, f)| x.cross(f)).sum();
        // Round-off of forces whose arms are tenths of metres.
        prop_assert!(sum.norm() < 1e-11 * scale && moment.norm() < 1e-11 * scale);
    }

    #[test]
    fn force_is_minus_the_slope_of_the_energy_and_stiffness_of_the_force(crumpled in crumpled()) {
        let rest = crumpled.rest();
        let system = system(&crumpled.cloth, &rest);
        let assembly = Assembly::new(&crumpled.cloth);
        let [d, q] = [1, 2].map(|which| crumpled.direction(which));
        let at = |s: f64| -> Vec<Vec3> {
            crumpled.x.iter().zip(&d).map(|(p, d)| p + d * s).collect()
        };
        let force = system.force(&crumpled.x, &[]);
        let k = system.stiffness(&assembly, &crumpled.x, &[], 1.0);
        let kd = k.multiply(&d);
        // Relative to what the slopes would be if all summands had one sign.
        let (scale, stiff) = (size(&force) * size(&d), size(&kd) * size(&q));
        assert_derivative(|s| system.energy(&at(s), &[]), -dot(&force, &d), 1e-6, scale, 1e-5);
        assert_derivative(|s| -dot(&system.force(&at(s), &[]), &q), dot(&kd, &q), 1e-7, stiff, 1e-5);
        // Symmetric.
        assert_relative_eq!(dot(&kd, &q), dot(&k.multiply(&q), &d), epsilon = 1e-11 * stiff);
    }

    #[test]
    fn steps_without_contact_and_drag_keep_the_momentum(crumpled in crumpled(), sweeps in 1_usize..6) {
        let rest = crumpled.rest();
        let params = StepParams { drag: 0.0, speed: 1e3, sweeps, ..StepParams::default() };
        let mut sim = SimParams::default();
        sim.layers.on = false;
        let watch = Watch::new(&crumpled.cloth, sim.layers, &crumpled.x);
        let cloth = &crumpled.cloth;
        let mut stepper = Stepper::new(cloth, &rest, &Nothing, sim.contact, params, watch);
        let mut state = State { x: crumpled.x.clone(), v: crumpled.direction(3) };
        let momentum = |state: &State| -> Vec3 {
            state.v.iter().zip(&rest.mass).map(|(v, m)| v * *m).sum()
        };
        let mass: f64 = rest.mass.iter().sum();
        let before = momentum(&state);
        for _ in 0..3 {
            stepper.step(&mut state, 0.0);
        }
        let gained = super::cloth::GRAVITY * (mass * 3.0 * params.dt);
        // Round-off of speeds of a metre per second and more.
        prop_assert!((momentum(&state) - before - gained).norm() < 1e-9 * mass);
    }

    #[test]
    fn a_drape_ends_with_a_status_and_numbers(crumpled in crumpled(), above in -0.05..0.1_f64, placed: bool) {
        let mut params = SimParams::default();
        params.step.time = 0.1;
        params.equilibrium.iterations = 30;
        let scene = Scene {
            cloth: &crumpled.cloth,
            assembly: &Assembly::new(&crumpled.cloth),
            surface: &Ball,
            params: &params,
        };
        // Part of it begins inside the ball.
        let x = crumpled.x.iter().map(|p| p + Vec3::new(-0.08, above, -0.08)).collect();
        let x_bar = &crumpled.mesh.x_bar;
        let start = if placed {
            Start::Placed { short: x_bar.iter().map(|p| p * 0.9).collect() }
        } else {
            Start::Near
        };
        let found = drape(&scene, x_bar, x, start, &mut |_, _| true);
        prop_assert!(found.status != RestStatus::NotFinite && found.residual.is_finite());
        prop_assert!(found.x.iter().flat_map(|p| p.iter()).all(|c| c.is_finite()));
    }
}
