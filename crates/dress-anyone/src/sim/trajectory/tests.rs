use super::*;
use crate::check::{assert_derivative, noise};
use crate::garment::Fabric;
use crate::pattern::PatternMesh;
use crate::sim::Assembly;
use crate::sim::cloth::Hold;
use crate::sim::cloth::fixtures::{self, SOFT};
use crate::sim::energy::contact::fixtures::Cone;
use crate::sim::energy::contact::{ContactParams, Nothing};
use crate::sim::material::OrFabric;

/// Derivative by the rest shape of a fixed linear function of the end, against two more trajectories.
fn check<S: Surface>(
    cloth: &Cloth,
    (surface, friction): (&S, f64),
    mesh: &PatternMesh,
    x: &[Vec3],
    steps: usize,
) {
    let params = SimParams {
        contact: ContactParams {
            thickness: 0.003,
            stiffness: 1e5,
            friction: OrFabric::Number(friction),
        },
        ..SimParams::default()
    };
    let scene = Scene {
        cloth,
        assembly: &Assembly::new(cloth),
        surface,
        params: &params,
    };
    let run = |x_bar: &[Vec2]| {
        Trajectory::run(&scene, x_bar, x.to_vec(), steps, &mut |_| true).expect("not stopped")
    };
    let weights: Vec<Vec3> = (0..x.len())
        .map(|i| Vec3::from_fn(|c, _| noise(11 * i + c)))
        .collect();
    let direction: Vec<Vec2> = (0..mesh.x_bar.len())
        .map(|i| Vec2::new(noise(7 * i), noise(7 * i + 3)))
        .collect();
    let at = run(&mesh.x_bar);
    let hat = at.pull_back(&weights);
    let slope: f64 = hat
        .x_bar
        .iter()
        .zip(&direction)
        .map(|(h, d)| h.dot(d))
        .sum();
    let value = |s: f64| {
        let each = mesh.x_bar.iter().zip(&direction);
        let moved: Vec<Vec2> = each.map(|(p, d)| p + d * s).collect();
        let x = run(&moved).last.x;
        x.iter().zip(&weights).map(|(x, w)| x.dot(w)).sum::<f64>()
    };
    // 5 nm: so little that no contact switches, and still far above round-off.
    assert_derivative(value, slope, 5e-9, 1e-3, 1e-6);
}

#[test]
fn a_hanging_cloth_has_an_exact_adjoint() {
    let mesh = fixtures::sheet(6, 6, 0.05);
    let mut cloth = Cloth::new(&mesh, &SOFT);
    // Held at its upper corners, in height alone: it swings about.
    cloth.holds = [42, 48]
        .map(|vertex| Hold {
            vertex,
            height: 0.3,
            stiffness: 200.0,
        })
        .to_vec();
    let x: Vec<Vec3> = mesh
        .x_bar
        .iter()
        .enumerate()
        .map(|(i, p)| Vec3::new(p.x, p.y, 0.01 * noise(i)))
        .collect();
    check(&cloth, (&Nothing, 0.0), &mesh, &x, 60);
}

#[test]
fn a_tube_on_a_cone_has_an_exact_adjoint_with_friction_and_without() {
    let mesh = fixtures::tube(24, 6, 0.025);
    let cloth = Cloth::new(&mesh, &SOFT);
    let cone = Cone {
        radius: 0.1,
        slope: 0.3,
        flat: 1.1,
        lean: 0.2,
    };
    let mut x = fixtures::rolled(&mesh, 0.6, 0.11);
    for (i, p) in x.iter_mut().enumerate() {
        *p += Vec3::from_fn(|c, _| 1e-3 * noise(3 * i + c));
    }
    for friction in [0.0, 0.2] {
        check(&cloth, (&cone, friction), &mesh, &x, 40);
    }
}

#[test]
fn steps_that_are_run_again_change_nothing() {
    let mesh = fixtures::tube(12, 4, 0.06);
    let cloth = Cloth::new(&mesh, &SOFT);
    let params = SimParams::default();
    let scene = Scene {
        cloth: &cloth,
        assembly: &Assembly::new(&cloth),
        surface: &Nothing,
        params: &params,
    };
    let x = fixtures::rolled(&mesh, 0.72, 0.1);
    let run = |stride: usize| {
        let mut all = Trajectory::run(&scene, &mesh.x_bar, x.clone(), 11, &mut |_| true)
            .expect("not stopped");
        let states = (0..11).step_by(stride);
        let states = states.map(|at| all.kept.state(at, params.step.kept()));
        all.kept = Kept {
            states: states.collect(),
            stride,
        };
        all.pull_back(&vec![Vec3::new(1.0, 2.0, 3.0); x.len()])
    };
    let (every, some) = (run(1), run(4));
    assert_eq!(every.x_bar, some.x_bar);
    assert_eq!(every.start.x, some.start.x);
}

#[test]
fn what_breaks_down_tells_the_step_and_the_triangle_both_ways() {
    let mesh = fixtures::sheet(4, 4, 0.05);
    let cloth = Cloth::new(&mesh, &SOFT);
    let params = SimParams::default();
    let scene = Scene {
        cloth: &cloth,
        assembly: &Assembly::new(&cloth),
        surface: &Nothing,
        params: &params,
    };
    let flat = |p: &Vec2| Vec3::new(p.x, p.y, 0.0);
    let x: Vec<Vec3> = mesh.x_bar.iter().map(flat).collect();
    let run = |x: Vec<Vec3>| {
        Trajectory::run(&scene, &mesh.x_bar, x, 5, &mut |_| true).expect("not stopped")
    };
    let at_12 = |broken: Option<Broken>| {
        let broken = broken.expect("it broke");
        assert!(cloth.triangles[broken.triangle].contains(&12));
        broken.stage
    };
    let mut far = x.clone();
    far[12].z = 1e200;
    let broken = run(far.clone());
    assert_eq!(at_12(broken.broken()), Stage::Step(0));
    assert_eq!(broken.x(), far);
    // The trajectory is sound; what is asked of it is not.
    let sound = run(x.clone());
    assert!(sound.broken().is_none());
    let mut x_hat = vec![Vec3::zeros(); x.len()];
    assert!(sound.pull_back(&x_hat).broken.is_none());
    x_hat[12].z = f64::NAN;
    assert_eq!(at_12(sound.pull_back(&x_hat).broken), Stage::StepBack(4));
}

mod implicit;
mod rest;
