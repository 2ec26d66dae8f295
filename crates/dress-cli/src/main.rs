//! harness
#![allow(dead_code, unreachable_pub)]
mod params;
mod picture;
mod progress;
use dress_anyone::*;
use std::path::Path;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let spec = io::garmentcode::read(Path::new(&a[1]), &Default::default()).unwrap();
    let body = io::body::read(Path::new(&a[2]), &Default::default()).unwrap();
    let res: f64 = a[3].parse::<f64>().unwrap() / 1000.0;
    let mesh = pattern::triangulate::mesh(&spec.pattern, res).unwrap();
    println!(
        "{} cloth vertices {} triangles; {:?}",
        mesh.cloth_vertex_count,
        mesh.triangles.len(),
        body.notes
    );
    let garment = garment::Garment {
        name: "g".into(),
        pattern: spec.pattern,
        mesh,
        drape: None,
    };
    let t = std::time::Instant::now();
    let mut sim = sim::SimParams::default();
    let get = |k: &str, d: f64| std::env::var(k).ok().map_or(d, |v| v.parse().unwrap());
    sim.step.time = get("TIME", sim.step.time);
    sim.step.dt = 1.0 / get("RATE", 1.0 / sim.step.dt);
    sim.step.sweeps = get("SWEEPS", sim.step.sweeps as f64) as usize;
    sim.step.drag = get("DRAG", sim.step.drag);
    sim.equilibrium.cold = get("COLD", sim.equilibrium.cold);
    sim.equilibrium.iterations = get("ITER", sim.equilibrium.iterations as f64) as usize;
    let d = refit::dress::drape_on(
        &garment,
        &body,
        &Default::default(),
        &Default::default(),
        &sim,
        &mut |p| {
            match p {
                sim::drape::DrapeProgress::Gathering { step, steps } => {
                    if step % 60 == 0 {
                        println!("{:.1}s gather {step}/{steps}", t.elapsed().as_secs_f64())
                    }
                }
                sim::drape::DrapeProgress::Settling {
                    iteration,
                    residual,
                } => {
                    if iteration % 10 == 0 {
                        println!(
                            "{:.1}s settle {iteration} {residual:.3e}",
                            t.elapsed().as_secs_f64()
                        )
                    }
                }
            }
            true
        },
    );
    println!(
        "{:.1}s {:?} residual {:.2e} iterations {}",
        t.elapsed().as_secs_f64(),
        d.status,
        d.residual,
        d.iterations
    );
    let tri = garment.mesh.outward_triangles();
    let pot = picture::panel_of_triangle(&garment.mesh);
    let se = picture::seam_edges(&garment.mesh);
    let placed = garment.placed();
    let fig = |c, x| picture::Figure {
        caption: c,
        body: &body.mesh,
        cloth_positions: x,
        cloth_triangles: &tri,
        panel_of_triangle: &pot,
        seam_edges: &se,
        scalar: None,
    };
    std::fs::write(
        &a[4],
        picture::preview(
            "drape",
            &[fig("placed", &placed), fig("drape", &d.x)],
            &[
                picture::View::Front,
                picture::View::Back,
                picture::View::ThreeQuarter,
            ],
        ),
    )
    .unwrap();
}
