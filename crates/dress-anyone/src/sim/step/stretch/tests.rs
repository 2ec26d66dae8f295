use super::back::Hat;
use super::*;
use crate::check::noise;
use crate::geometry::{Mat3, Vec3};
use crate::sim::cloth::fixtures::{patched, tube};
use crate::sim::energy::membrane::{constraint, constraint_gradient, constraint_mass};
use crate::sim::step::lanes::Walk;
use crate::sim::step::lanes::{of_lane, row};
use crate::sim::step::taped::{PullBack, Sweep};

/// The visit as the energy's file defines it.
fn scalar(
    cloth: &Cloth,
    rest: &Rest,
    w: &[f64],
    e: usize,
    lambda: &mut Vec3,
    x: &mut [Vec3],
    dt: f64,
) {
    let (t, d) = (cloth.triangles[e], &cloth.material(e).elasticity);
    let rest = &rest.triangles[e];
    let stiffness = Mat3::new(
        d.weft, d.coupling, 0.0, d.coupling, d.warp, 0.0, 0.0, 0.0, d.shear,
    );
    let alpha_tilde = stiffness.try_inverse().unwrap() / (rest.area * dt * dt);
    let w = t.map(|a| w[a as usize]);
    let f = rest.gradient_of(t.map(|a| x[a as usize]));
    let system = alpha_tilde + constraint_mass(&f, &rest.weighted(w));
    let right = -constraint(&f) - alpha_tilde * *lambda;
    let delta = system.cholesky().unwrap().solve(&right);
    *lambda += delta;
    let y = constraint_gradient(&f, &delta);
    for ((a, b), w) in t.iter().zip(rest.gradients()).zip(w) {
        x[*a as usize] += y * (b * w);
    }
}

#[test]
fn lanes_do_what_the_constraint_says() {
    let mesh = tube(11, 5, 0.05);
    let cloth = patched(&mesh);
    let rest = cloth.at_rest(&mesh.x_bar);
    let w: Vec<f64> = rest.mass.iter().map(|m| 1.0 / m).collect();
    let (dt, count) = (0.01, cloth.vertex_count);
    let mut x: Vec<Vec3> = (0..count)
        .map(|i| Vec3::from_fn(|c, _| 0.3 * noise(3 * i + c)))
        .collect();
    let mut rows: Vec<Four> = x.iter().zip(&w).map(|(x, w)| row(*x, *w)).collect();
    let all: Vec<u32> = (0..cloth.triangles.len() as u32).collect();
    let mut stretch = Stretch::new(&cloth, &all, |v| v, count, dt);
    stretch.grow(&rest);
    let mut lambda = vec![Vec3::zeros(); all.len()];
    for sweep in 0..3 {
        stretch.taped.sweep(&mut rows, sweep == 0, true);
        for (_, e) in stretch.triangles.iter().flat_map(Elements::each) {
            scalar(&cloth, &rest, &w, e, &mut lambda[e], &mut x, dt);
        }
    }
    assert_eq!(stretch.taped.tape.len(), 3 * stretch.taped.blocks.len());
    for (row, x) in rows.iter().zip(&x) {
        // Decimetres, by other roundings over three sweeps of violent moves.
        assert!((row.vector() - x).norm() < 1e-11, "{row:?} {x:?}");
    }
    for (block, elements) in stretch.taped.blocks.iter().zip(&stretch.triangles) {
        for (l, e) in elements.each() {
            let off = of_lane(&block.lambda, l) - lambda[e];
            assert!(off.norm() < 1e-9 * lambda[e].norm().max(1e-6));
        }
    }
}

#[test]
fn wide_registers_change_no_bit() {
    let mesh = tube(11, 5, 0.05);
    let cloth = patched(&mesh);
    let rest = cloth.at_rest(&mesh.x_bar);
    let count = cloth.vertex_count;
    let all: Vec<u32> = (0..cloth.triangles.len() as u32).collect();
    let run = |narrow: bool| {
        let mut rows: Vec<Four> = (0..count)
            .map(|i| {
                row(
                    Vec3::from_fn(|c, _| 0.3 * noise(3 * i + c)),
                    1.0 / rest.mass[i],
                )
            })
            .collect();
        let mut hats = rows.clone();
        let mut stretch = Stretch::new(&cloth, &all, |v| v, count, 0.01);
        stretch.grow(&rest);
        stretch
            .taped
            .hats
            .resize_with(stretch.taped.blocks.len(), Hat::default);
        if narrow {
            let scalar = pulp::Scalar::new();
            let sweep = Sweep {
                blocks: &mut stretch.taped.blocks,
                rows: &mut rows,
                first: true,
                tape: Some(&mut stretch.taped.tape),
            };
            sweep.walk(scalar);
            let back = PullBack {
                blocks: &mut stretch.taped.blocks,
                own: &mut stretch.taped.hats,
                visits: &stretch.taped.tape,
                rows: &mut rows,
                hats: &mut hats,
                last: true,
            };
            back.walk(scalar);
        } else {
            stretch.taped.sweep(&mut rows, true, true);
            stretch.taped.pull_back(&mut rows, &mut hats, true);
        }
        (rows, hats)
    };
    assert_eq!(run(false), run(true));
}
