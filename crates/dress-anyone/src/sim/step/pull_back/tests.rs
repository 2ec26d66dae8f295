use super::*;
use crate::check::{assert_derivative, noise};
use crate::garment::Fabric;
use crate::geometry::Vec3;
use crate::pattern::PatternMesh;
use crate::sim::cloth::Hold;
use crate::sim::cloth::fixtures::{self, SOFT};
use crate::sim::energy::contact::fixtures::Cone;
use crate::sim::energy::contact::{ContactParams, Nothing};
use crate::sim::energy::layers::LayerParams;
use crate::sim::layers::Watch;
use crate::sim::material::OrFabric;
use crate::sim::step::StepParams;

const CONE: Cone = Cone {
    radius: 0.12,
    slope: 0.2,
    flat: 1.1,
    lean: 0.2,
};

/// Vertices of a part: so few that there are several parts.
const FEW: usize = 8;

/// One step of a cloth: the derivative of a fixed linear function of the state after it, along one
/// direction of positions, of velocities and of the rest shape each.
fn check<S: Surface>(
    mesh: &PatternMesh,
    cloth: &Cloth,
    surface: &S,
    params: StepParams,
    start: &State,
) {
    check_with(mesh, cloth, surface, params, start, OrFabric::Number(0.0));
}

/// The same with friction.
fn check_with<S: Surface>(
    mesh: &PatternMesh,
    cloth: &Cloth,
    surface: &S,
    params: StepParams,
    start: &State,
    friction: OrFabric,
) {
    let contact = ContactParams {
        thickness: 0.01,
        stiffness: 1e5,
        friction,
    };
    let off = LayerParams {
        on: false,
        ..LayerParams::default()
    };
    let vectors = |seed: usize, size: f64| -> Vec<Vec3> {
        let each = 0..cloth.vertex_count;
        each.map(|i| Vec3::from_fn(|c, _| size * noise(seed + 3 * i + c)))
            .collect()
    };
    let moved = |x: &[Vec3], d: &[Vec3], s: f64| -> Vec<Vec3> {
        x.iter().zip(d).map(|(x, d)| x + d * s).collect()
    };
    let dot = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
    let (weights, speeds) = (vectors(500, 1.0), vectors(900, 0.01));
    // A millimetre; a velocity that makes as much of it; a part of the pattern's edges.
    let directions = [vectors(40, 1e-3), vectors(70, 0.1)];
    let rest_direction: Vec<Vec2> = (0..mesh.x_bar.len())
        .map(|i| Vec2::new(1e-3 * noise(7 * i), 1e-3 * noise(7 * i + 3)))
        .collect();

    let x_bar_at = |s: f64| -> Vec<Vec2> {
        let each = mesh.x_bar.iter().zip(&rest_direction);
        each.map(|(p, d)| p + d * s).collect()
    };
    let value = |state: &State, x_bar: &[Vec2]| -> f64 {
        let rest = cloth.at_rest(x_bar);
        let watch = Watch::new(cloth, off, &state.x);
        let mut stepper = Stepper::in_parts(cloth, &rest, surface, contact, params, watch, FEW);
        let mut state = state.clone();
        stepper.step(&mut state, 0.0);
        dot(&state.x, &weights) + dot(&state.v, &speeds)
    };

    let rest = cloth.at_rest(&mesh.x_bar);
    let watch = Watch::new(cloth, off, &start.x);
    let mut stepper = Stepper::in_parts(cloth, &rest, surface, contact, params, watch, FEW);
    let mut state = start.clone();
    stepper.record(&mut state);
    let mut hat = State {
        x: weights.clone(),
        v: speeds.clone(),
    };
    stepper.pull_back(&mut hat);
    let x_bar_hat = stepper.by_rest_shape(&mesh.x_bar);

    // Steps of a tenth of a micrometre keep contacts as they are; differences then know the slope to
    // some 1e-8.
    let step = 1e-4;
    let by_x = |s: f64| {
        let x = moved(&start.x, &directions[0], s);
        let v = start.v.clone();
        value(&State { x, v }, &mesh.x_bar)
    };
    let by_v = |s: f64| {
        let v = moved(&start.v, &directions[1], s);
        let x = start.x.clone();
        value(&State { x, v }, &mesh.x_bar)
    };
    let by_rest = |s: f64| value(start, &x_bar_at(s));
    let rest_slope: f64 = x_bar_hat
        .iter()
        .zip(&rest_direction)
        .map(|(h, d)| h.dot(d))
        .sum();
    assert_derivative(by_x, dot(&hat.x, &directions[0]), step, 1e-6, 1e-6);
    assert_derivative(by_v, dot(&hat.v, &directions[1]), step, 1e-6, 1e-6);
    assert_derivative(by_rest, rest_slope, step, 1e-6, 1e-6);
}

/// A crumpled sheet in motion.
fn crumpled(mesh: &PatternMesh) -> State {
    let each = mesh.x_bar.iter().enumerate();
    let x = each
        .map(|(i, p)| Vec3::new(p.x, p.y, 0.0) + Vec3::from_fn(|c, _| 0.01 * noise(3 * i + c)))
        .collect();
    let v = (0..mesh.x_bar.len())
        .map(|i| Vec3::from_fn(|c, _| 0.2 * noise(200 + 3 * i + c)))
        .collect();
    State { x, v }
}

fn three_sweeps() -> StepParams {
    StepParams {
        sweeps: 3,
        ..StepParams::default()
    }
}

#[test]
fn a_step_that_stretches_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(1, 1, 0.1);
    let rigidless = Fabric {
        bending: 1e-12,
        ..SOFT
    };
    let cloth = Cloth::new(&mesh, &rigidless);
    check(&mesh, &cloth, &Nothing, three_sweeps(), &crumpled(&mesh));
}

#[test]
fn a_step_of_two_fabrics_off_the_grain_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(2, 2, 0.1);
    let cloth = fixtures::patched(&mesh);
    check(&mesh, &cloth, &Nothing, three_sweeps(), &crumpled(&mesh));
}

#[test]
fn a_step_with_a_pressed_fold_has_an_exact_adjoint() {
    let mesh = fixtures::tube(5, 2, 0.1);
    let cloth = fixtures::creased(&mesh);
    assert_eq!(cloth.folds.len(), 2);
    check(&mesh, &cloth, &Nothing, three_sweeps(), &rubbing(&mesh));
}

#[test]
fn a_step_that_bends_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(1, 1, 0.1);
    let mut cloth = Cloth::new(&mesh, &SOFT);
    let material = &mut cloth.materials[0];
    material.bending = 0.1;
    material.elasticity.weft *= 1e-6;
    material.elasticity.warp *= 1e-6;
    material.elasticity.coupling *= 1e-6;
    material.elasticity.shear *= 1e-6;
    check(&mesh, &cloth, &Nothing, three_sweeps(), &crumpled(&mesh));
}

#[test]
fn a_step_that_is_held_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(2, 2, 0.1);
    let mut cloth = Cloth::new(&mesh, &SOFT);
    cloth.holds = (0..4)
        .map(|vertex| Hold {
            vertex,
            height: 0.02,
            stiffness: 30.0 * f64::from(vertex + 1),
        })
        .collect();
    check(&mesh, &cloth, &Nothing, three_sweeps(), &crumpled(&mesh));
}

/// A tube that rubs against the cone.
fn rubbing(mesh: &PatternMesh) -> State {
    let mut x = fixtures::rolled(mesh, 0.72, 0.115);
    for (i, p) in x.iter_mut().enumerate() {
        *p += Vec3::from_fn(|c, _| 0.002 * noise(3 * i + c));
    }
    let v = (0..x.len())
        .map(|i| Vec3::from_fn(|c, _| 0.1 * noise(200 + 3 * i + c)))
        .collect();
    State { x, v }
}

#[test]
fn a_step_against_a_body_has_an_exact_adjoint() {
    let mesh = fixtures::tube(12, 4, 0.06);
    let cloth = Cloth::new(&mesh, &SOFT);
    check(&mesh, &cloth, &CONE, three_sweeps(), &rubbing(&mesh));
}

#[test]
fn a_step_with_friction_has_an_exact_adjoint() {
    let mesh = fixtures::tube(12, 4, 0.06);
    let cloth = fixtures::patched(&mesh);
    // Little slips with much friction, and much with little.
    let told = [0.05, 3.0].map(OrFabric::Number);
    for friction in [told[0], told[1], OrFabric::Fabric] {
        check_with(
            &mesh,
            &cloth,
            &CONE,
            three_sweeps(),
            &rubbing(&mesh),
            friction,
        );
    }
}

#[test]
fn a_step_at_the_speed_limit_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(2, 2, 0.1);
    let cloth = Cloth::new(&mesh, &SOFT);
    let slow = StepParams {
        speed: 0.2,
        ..three_sweeps()
    };
    check(&mesh, &cloth, &Nothing, slow, &crumpled(&mesh));
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let mesh = fixtures::tube(24, 12, 0.03);
    let cloth = fixtures::patched(&mesh);
    let rest = cloth.at_rest(&mesh.x_bar);
    let contact = ContactParams {
        thickness: 0.01,
        stiffness: 1e5,
        friction: OrFabric::Fabric,
    };
    let run = || {
        let mut state = rubbing(&mesh);
        let watch = Watch::new(&cloth, LayerParams::default(), &state.x);
        let params = three_sweeps();
        let mut stepper = Stepper::in_parts(&cloth, &rest, &CONE, contact, params, watch, FEW);
        for _ in 0..5 {
            stepper.step(&mut state, 1.0);
        }
        stepper.record(&mut state);
        let mut hat = state.clone();
        stepper.pull_back(&mut hat);
        (state.x, hat.x, stepper.by_rest_shape(&mesh.x_bar))
    };
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        pool.expect("threads").install(run)
    };
    assert_eq!(with(1), with(3));
}
