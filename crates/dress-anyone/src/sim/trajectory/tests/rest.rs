//! The trajectory's adjoint beside the equilibrium's, which it tends to where the steps end at rest.
//!
//! However many its sweeps, XPBD's state of rest is not quite the energy's: λ begins at zero in every
//! step, and Δx adds up gradients of the shapes between. The gap falls with Δt² E/(ρ h²) times the
//! strain.

use super::*;
use crate::geometry::Mat3;
use crate::sim::drape;
use crate::sim::drape::Start;
use crate::sim::equilibrium::RestStatus;
use crate::sim::material::OrFabric;
use crate::sim::step::StepParams;

/// The outside of an ellipsoid, hollow: |D p| = radius, wider along x than along z.
struct Bowl {
    radius: f64,
}

impl Bowl {
    const SQUARED: Vec3 = Vec3::new(1.0, 1.0, 1.44);
}

impl Surface for Bowl {
    fn distance(&self, p: Vec3) -> Option<(f64, Vec3)> {
        let by = Self::SQUARED.component_mul(&p);
        let r = by.dot(&p).sqrt();
        Some((self.radius - r, -by / r))
    }

    fn curvature(&self, p: Vec3) -> Mat3 {
        let by = Self::SQUARED.component_mul(&p);
        let r = by.dot(&p).sqrt();
        (by * by.transpose() / (r * r) - Mat3::from_diagonal(&Self::SQUARED)) / r
    }
}

/// How a trajectory that starts at rest, or near, ends.
struct Ending {
    residual: f64,
    /// Farthest from rest \[m\].
    moved: f64,
    /// Relative difference of the adjoints.
    apart: f64,
}

/// A trajectory from the equilibrium near `x`, or from `off` \[m\] beside it, and the adjoints of both.
fn from_rest<S: Surface>(
    mesh: &PatternMesh,
    surface: &S,
    x: Vec<Vec3>,
    off: f64,
    step: StepParams,
) -> Ending {
    let cloth = Cloth::new(mesh, &SOFT);
    let mut params = SimParams {
        step,
        contact: ContactParams {
            thickness: 0.003,
            stiffness: 1e5,
            friction: OrFabric::Number(0.0),
        },
        ..SimParams::default()
    };
    params.layers.on = false;
    let scene = Scene {
        cloth: &cloth,
        assembly: &Assembly::new(&cloth),
        surface,
        params: &params,
    };
    let found = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_, _| true);
    assert_eq!(found.status, RestStatus::AtRest);
    let rest = found.differentiable(&scene).expect("a minimum");
    assert_eq!(rest.shift, 0.0);
    let weights: Vec<Vec3> = (0..cloth.vertex_count)
        .map(|i| Vec3::from_fn(|c, _| noise(11 * i + c)))
        .collect();
    let (expected, _) = rest.pull_back(&weights);
    let start = (weights.iter().zip(&rest.drape.x)).map(|(n, p)| p + n * off);
    let run = Trajectory::run(
        &scene,
        &mesh.x_bar,
        start.collect(),
        step.steps(),
        &mut |_| true,
    )
    .expect("not stopped");
    let moves = run.x().iter().zip(&rest.drape.x);
    let hat = run.pull_back(&weights).x_bar;
    let length = |v: &mut dyn Iterator<Item = Vec2>| v.map(|g| g.norm_squared()).sum::<f64>();
    let gap = length(&mut hat.iter().zip(&expected).map(|(a, b)| a - b));
    Ending {
        residual: run.residual(),
        moved: moves.map(|(a, b)| (a - b).norm()).fold(0.0, f64::max),
        apart: (gap / length(&mut expected.iter().copied())).sqrt(),
    }
}

/// A strip of 30 × 10 cm in a bowl, let go `off` \[m\] beside its rest.
fn strip_in_a_bowl(off: f64, step: StepParams) -> Ending {
    let mesh = fixtures::sheet(3, 1, 0.1);
    let x = mesh.x_bar.iter();
    let x = x
        .map(|p| Vec3::new(p.x - 0.15, -0.45, p.y - 0.05))
        .collect();
    from_rest(&mesh, &Bowl { radius: 0.5 }, x, off, step)
}

/// A tight tube on a leaning cone, which nothing but its tension keeps from sliding down.
fn tube_on_a_cone(step: StepParams) -> Ending {
    let mut mesh = fixtures::tube(12, 3, 0.05);
    for p in &mut mesh.x_bar {
        p.y *= 1.0 + 0.2 * (std::f64::consts::TAU * p.x / 0.6).sin();
    }
    let cone = Cone {
        radius: 0.1,
        slope: 0.3,
        flat: 1.1,
        lean: 0.2,
    };
    let x = fixtures::rolled(&mesh, 0.6, 0.11);
    from_rest(&mesh, &cone, x, 0.0, step)
}

fn steps(frames: u32, sweeps: usize, time: f64, drag: f64) -> StepParams {
    StepParams {
        dt: 1.0 / f64::from(frames),
        sweeps,
        drag,
        time,
        speed: 1e3,
        ..StepParams::default()
    }
}

#[test]
fn both_adjoints_agree_at_rest() {
    let end = strip_in_a_bowl(0.0, steps(3000, 10, 8.0, 4.0));
    // Round-off and the steps' own error, which is below what counts as rest.
    assert!(end.residual < 1e-6, "{:e}", end.residual);
    // The memory of the start has faded by exp(−η t/2).
    assert!(end.apart < 1e-4, "{:e}", end.apart);
}

#[test]
fn steps_that_come_to_rest_do_so_where_the_static_solve_does() {
    // Let go crumpled, each vertex up to 5 mm off: from 3 cm it slides to another place in the bowl.
    let end = strip_in_a_bowl(5e-3, steps(960, 10, 11.0, 4.0));
    assert!(end.residual < 1e-4, "{:e}", end.residual);
    // A tenth of a millimetre.
    assert!(end.moved < 1e-4, "{:e}", end.moved);
}

/// `cargo test -p dress-anyone --lib -- --ignored --nocapture both_adjoints_by`.
#[test]
#[ignore = "prints a table of docs/validation.md"]
fn both_adjoints_by_steps_and_sweeps() {
    println!("| cloth | Δt, s | sweeps | time, s | η, 1/s | residual | off, mm | adjoints apart |");
    for (frames, sweeps, time, drag) in [
        (60, 20, 1.5, 3.1),
        (120, 12, 1.5, 3.1),
        (120, 12, 8.0, 4.0),
        (960, 20, 8.0, 4.0),
        (4000, 10, 8.0, 4.0),
    ] {
        let step = steps(frames, sweeps, time, drag);
        for (name, end) in [
            ("strip in a bowl", strip_in_a_bowl(0.0, step)),
            (
                "tube on a cone",
                tube_on_a_cone(StepParams {
                    time: time.min(2.0),
                    ..step
                }),
            ),
        ] {
            let time = if name == "tube on a cone" {
                time.min(2.0)
            } else {
                time
            };
            println!(
                "| {name} | 1/{frames} | {sweeps} | {time} | {drag} | {:.1e} | {:.1e} | {:.1e} |",
                end.residual,
                1e3 * end.moved,
                end.apart
            );
        }
    }
}
