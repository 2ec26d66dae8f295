//! The loops a refit spends its time in, on a tube of two panels around an elliptic cylinder, at
//! three sizes: `cargo bench -p dress-anyone`.
//!
//! Times are processor time, all threads together, and the summary takes the least of the samples:
//! other jobs disturb these least. Every time is also given as a multiple of a yardstick measured in
//! the same run, one plainly written XPBD sweep over 20,000 triangles and 29,800 hinges
//! ([`yardstick`]), so that runs on different or busy machines can be compared. The project's aims for
//! speed are for a core on which it takes 1.34 ms ([`yardstick::REFERENCE_MS`]): t milliseconds there
//! are t/1.34 yardsticks here. Work and traffic of each loop, counted in its source, with indices and
//! positions that come from the cache included in the bytes:
//!
//! | loop | flops | bytes |
//! |---|---|---|
//! | yardstick | 190 a triangle, 75 a hinge | 270 and 320 |
//! | `step` | 12 of `sweep`, contact with the body and of layers, searched now and then | |
//! | `step_alone` | the same without layers | |
//! | `sweep` | 305 a triangle: 200 for its membrane, 70 for each of its 1.5 hinges | 280 and 1.5 × 350 |
//! | `pairs` | looks for tangles, and for layers that may touch in a move of 2 mm | |
//! | `stiffness` | 900 a triangle, 40 a hinge | 9 blocks of 72 a triangle, written |
//! | `structure` | the order of elimination and the symbolic phase, once for a cloth | |
//! | `factor` | Σ l² over the columns of L, l their lengths; about n^1.5 | 8 a non-zero of L, at least |
//! | `closest_point` | 60 a triangle visited, 30 a box | 72 and 48; what is visited depends on the point |
//! | `distance_field` | 900 a sample | 512 a sample, in 16 rows of 32 |
//! | `cages` | 150 a vertex and control point, a logarithm included | 16 a vertex and control point |
//! | `pull_back` | 4 a non-zero of L, 300 a triangle, 150 a hinge | 16 a non-zero of L |
//! | `gradient` | `stiffness`, `factor` and `pull_back` at a state of rest | |
//! | `steps` | a trajectory of a few steps, each of 12 sweeps and a look for contacts | |
//! | `steps_back` | the same and its gradient: 900 a triangle and sweep besides | |
//! | `sensitivities` | `pull_back` for every unknown, in blocks of 16 | |
//!
//! Preparing a drape for its derivatives is `stiffness` and `factor` once, or more often where the
//! stiffness is indefinite.

mod cpu_time;
mod summary;
mod tube;
mod yardstick;

use cpu_time::CpuTime;
use criterion::{Criterion, SamplingMode};
use dress_anyone::body::DistanceField;
use dress_anyone::cage::{CageParams, Cages};
use dress_anyone::geometry::{ClosestPoint, Vec2};
use dress_anyone::sim::differentiable::differentiable_at;
use dress_anyone::sim::energy::contact::Nothing;
use dress_anyone::sim::energy::layers::LayerParams;
use dress_anyone::sim::equilibrium::EquilibriumParams;
use dress_anyone::sim::layers::{Layers, Watch};
use dress_anyone::sim::step::{State, StepParams, Stepper};
use dress_anyone::sim::system::System;
use dress_anyone::sim::{Assembly, Scene, SimParams, Start, Trajectory, drape};
use std::hint::black_box;
use std::path::Path;
use std::time::{Duration, Instant};
use tube::Tube;

/// Cloth vertices aimed for.
const SIZES: [usize; 3] = [1_000, 4_000, 10_000];
/// Sweeps in the step that measures them: the rest of the step then hardly counts.
const SWEEPS: usize = 64;
/// Steps of the trajectory that is measured.
const STEPS: usize = 30;
/// Steps of a trajectory whose memory is told.
const LONG: usize = 600;
/// Unknowns whose sensitivities are measured.
const UNKNOWNS: [usize; 3] = [50, 100, 200];
/// Runs of which the shortest tells what two threads bring.
const RUNS: usize = 400;
/// Force residual at which the tube's drape ends [–].
const NEARLY_AT_REST: f64 = 1e-3;

fn main() {
    let one = rayon::ThreadPoolBuilder::new().num_threads(1);
    one.build_global()
        .expect("no thread has been asked for yet");
    let results = Path::new(env!("CARGO_TARGET_TMPDIR")).join("hot_loops");
    let mut criterion = Criterion::default()
        .with_measurement(CpuTime::new())
        .output_directory(&results)
        .sample_size(10)
        .warm_up_time(Duration::from_millis(200))
        .measurement_time(Duration::from_secs(1))
        .configure_from_args();
    let mut grid = yardstick::Grid::new();
    criterion.bench_function(summary::YARDSTICK, |b| b.iter(|| grid.sweep()));
    let mut rows = Vec::new();
    for size in SIZES {
        rows.extend(of_size(&mut criterion, size));
    }
    criterion.final_summary();
    summary::print(&results, &rows);
}

/// Least time that went by in many runs on so many threads \[s\].
fn least_with(threads: usize, run: &mut (impl FnMut() + Send)) -> f64 {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
    let time = || {
        let start = Instant::now();
        run();
        start.elapsed().as_secs_f64()
    };
    let mut times = std::iter::repeat_with(time).take(RUNS);
    pool.expect("a few threads can be had")
        .install(|| times.by_ref().fold(f64::INFINITY, f64::min))
}

/// Measures every loop on a tube of about `size` vertices; what the summary should show.
fn of_size(criterion: &mut Criterion<CpuTime>, size: usize) -> Vec<summary::Row> {
    let tube = Tube::new(size);
    let body = tube::body();
    let surface = DistanceField::new(&body, DistanceField::SPACING, DistanceField::OUTER);
    let closest = ClosestPoint::new(&body);
    let cloth = tube.cloth();
    let params = SimParams {
        // What is measured takes as long at a tube that is only nearly at rest.
        equilibrium: EquilibriumParams {
            tolerance: NEARLY_AT_REST,
            polished: NEARLY_AT_REST,
            ..EquilibriumParams::default()
        },
        ..SimParams::default()
    };
    let assembly = Assembly::new(&cloth);
    let scene = Scene {
        cloth: &cloth,
        assembly: &assembly,
        surface: &surface,
        params: &params,
    };
    let x_bar = &tube.mesh.x_bar;
    let rest = cloth.at_rest(x_bar);
    let found = drape(&scene, x_bar, tube.x.clone(), Start::Near, &mut |_, _| true);
    let at_rest = found.x.clone();
    let vertices = cloth.vertex_count;
    println!(
        "\n{vertices} cloth vertices: {:?} after {} factorisations of {} non-zeros",
        found.status,
        found.iterations,
        assembly.structure().factor_size(),
    );

    let name = format!("{size}");
    let mut group = criterion.benchmark_group(&name);
    group.sampling_mode(SamplingMode::Flat);

    let alone = LayerParams {
        on: false,
        ..params.layers
    };
    for (name, layers) in [("step", params.layers), ("step_alone", alone)] {
        let watch = Watch::new(&cloth, layers, &at_rest);
        let contact = params.contact;
        let mut stepper = Stepper::new(&cloth, &rest, &surface, contact, params.step, watch);
        let mut state = State {
            x: at_rest.clone(),
            v: vec![nalgebra::zero(); vertices],
        };
        group.bench_function(name, |b| b.iter(|| stepper.step(&mut state, 0.0)));
    }
    let many_sweeps = StepParams {
        sweeps: SWEEPS,
        ..params.step
    };
    let watch = Watch::new(&cloth, alone, &at_rest);
    let mut stepper = Stepper::new(&cloth, &rest, &Nothing, params.contact, many_sweeps, watch);
    let mut state = State {
        x: at_rest.clone(),
        v: vec![nalgebra::zero(); vertices],
    };
    group.bench_function("sweep", |b| {
        b.iter(|| {
            state.x.clone_from(&at_rest);
            stepper.step(&mut state, 0.0);
        });
    });
    // So short that other jobs leave both cores alone for some of them.
    let watch = Watch::new(&cloth, alone, &at_rest);
    let mut stepper = Stepper::new(&cloth, &rest, &Nothing, params.contact, params.step, watch);
    let mut step = || {
        state.x.clone_from(&at_rest);
        stepper.step(&mut state, 0.0);
    };
    let [one, two] = [1, 2].map(|threads| least_with(threads, &mut step));
    println!(
        "{vertices} cloth vertices: a step of {} sweeps on two threads {:.2} times as fast",
        params.step.sweeps,
        one / two
    );
    let mut layers = Layers::new(&cloth, params.layers, &at_rest);
    // Every other vertex moves, so that no search serves for the next.
    let moves: Vec<_> = (0..vertices)
        .map(|v| nalgebra::Vector3::new(0.0, 0.0, if v % 2 == 0 { 2e-3 } else { 0.0 }))
        .collect();
    group.bench_function("pairs", |b| {
        b.iter(|| {
            layers.find_tangles(&at_rest);
            layers.pairs(&at_rest, &moves, 0.0)
        });
    });

    let system = System::new(&cloth, &rest, &surface, params.contact, &[]);
    group.bench_function("stiffness", |b| {
        b.iter(|| system.stiffness(&assembly, &at_rest, &[], 1.0));
    });
    group.bench_function("structure", |b| b.iter(|| Assembly::new(&cloth)));
    let stiffness = system.stiffness(&assembly, &at_rest, &[], 0.0);
    group.bench_function("factor", |b| b.iter(|| stiffness.factor()));

    group.bench_function("closest_point", |b| {
        b.iter(|| {
            at_rest
                .iter()
                .map(|p| closest.signed_distance(*p))
                .sum::<f64>()
        });
    });
    group.bench_function("distance_field", |b| {
        b.iter(|| {
            for p in &at_rest {
                black_box(surface.sample_with_hessian(*p));
            }
        });
    });
    group.bench_function("cages", |b| {
        b.iter(|| Cages::enclose(&tube.pattern, &tube.mesh, None, &CageParams::default()));
    });

    let run = |steps: usize| {
        Trajectory::run(&scene, x_bar, at_rest.clone(), steps, &mut |_| true)
            .expect("nobody asks it to stop")
    };
    group.bench_function("steps", |b| b.iter(|| run(STEPS)));
    group.bench_function("steps_back", |b| b.iter(|| run(STEPS).pull_back(&at_rest)));
    println!("{LONG} steps keep {} MB", run(LONG).kept() / 1_000_000);

    let state = found
        .differentiable(&scene)
        .expect("a shift makes any stiffness definite");
    println!("stiffness shifted by {} 1/s²", state.shift);
    group.bench_function("pull_back", |b| b.iter(|| state.pull_back(&at_rest)));
    group.bench_function("gradient", |b| {
        b.iter(|| {
            let polished = state.drape.x.clone();
            let state = differentiable_at(&scene, x_bar, polished, Vec::new())
                .expect("a shift makes any stiffness definite");
            state.pull_back(&at_rest)
        });
    });
    for unknowns in UNKNOWNS {
        // Every unknown moves the whole pattern, as a cage does.
        let motion = |k: usize| {
            let wave = move |p: &Vec2| Vec2::new((k as f64 * p.x).sin(), (k as f64 * p.y).cos());
            x_bar.iter().map(wave).collect::<Vec<_>>()
        };
        group.bench_function(format!("sensitivities_{unknowns}"), |b| {
            b.iter(|| state.sensitivities((0..unknowns).map(motion)));
        });
    }
    group.finish();

    let row = |(loop_name, items, unit)| summary::Row {
        group: name.clone(),
        loop_name,
        runs: if loop_name == "sweep" { SWEEPS } else { 1 },
        items,
        unit,
    };
    let triangles = cloth.triangles.len();
    let rows = [
        ("step", triangles, "triangle"),
        ("step_alone", triangles, "triangle"),
        ("sweep", triangles, "triangle"),
        ("pairs", triangles, "triangle"),
        ("stiffness", triangles, "triangle"),
        ("structure", vertices, "vertex"),
        ("factor", vertices, "vertex"),
        ("closest_point", vertices, "point"),
        ("distance_field", vertices, "point"),
        ("cages", x_bar.len(), "vertex"),
        ("steps", STEPS * triangles, "triangle"),
        ("steps_back", STEPS * triangles, "triangle"),
        ("pull_back", vertices, "vertex"),
        ("gradient", vertices, "vertex"),
        ("sensitivities_50", vertices, "vertex"),
        ("sensitivities_100", vertices, "vertex"),
        ("sensitivities_200", vertices, "vertex"),
    ];
    rows.into_iter().map(row).collect()
}
