use super::*;
use crate::check::{assert_derivative, noise};
use approx::assert_relative_eq;

const ANISOTROPIC: Elasticity = Elasticity {
    weft: 900.0,
    warp: 1500.0,
    coupling: 300.0,
    shear: 250.0,
};

fn rest_corners() -> [Vec2; 3] {
    [
        Vec2::new(0.1, 0.2),
        Vec2::new(1.0, 0.3),
        Vec2::new(0.4, 1.2),
    ]
}

/// Order-one noise about the rest shape: strains of a few tenths, tension and compression.
fn scene(seed: usize) -> ([Vec3; 3], [Vec3; 3]) {
    let x = std::array::from_fn(|a| {
        let r = rest_corners()[a];
        let n = |c: usize| 0.2 * noise(seed + 7 * a + c);
        Vec3::new(r.x + n(0), r.y + n(1), n(2))
    });
    let d = std::array::from_fn(|a| {
        Vec3::new(
            noise(seed + 31 + a),
            noise(seed + 47 + a),
            noise(seed + 61 + a),
        )
    });
    (x, d)
}

fn moved(x: [Vec3; 3], d: [Vec3; 3], s: f64) -> [Vec3; 3] {
    std::array::from_fn(|a| x[a] + d[a] * s)
}

fn dot(a: [Vec3; 3], b: [Vec3; 3]) -> f64 {
    a.iter().zip(&b).map(|(a, b)| a.dot(b)).sum()
}

#[test]
fn force_is_minus_the_slope_of_the_energy() {
    let rest = RestTriangle::new(rest_corners());
    for seed in 0..10 {
        let (x, d) = scene(100 * seed);
        let slope = -dot(force(&rest, &ANISOTROPIC, x), d);
        let u = |s| energy(&rest, &ANISOTROPIC, moved(x, d, s));
        assert_derivative(u, slope, 1e-5, 1.0, 1e-7);
    }
}

#[test]
fn stiffness_is_minus_the_slope_of_the_force() {
    let rest = RestTriangle::new(rest_corners());
    for seed in 0..10 {
        let (x, d) = scene(100 * seed);
        let (_, q) = scene(100 * seed + 50);
        let k = stiffness(&rest, &ANISOTROPIC, x, 1.0);
        let mut bilinear = 0.0;
        for a in 0..3 {
            for b in 0..3 {
                let block = if b <= a { k[a][b] } else { k[b][a].transpose() };
                bilinear += q[a].dot(&(block * d[b]));
            }
        }
        let f = |s| -dot(force(&rest, &ANISOTROPIC, moved(x, d, s)), q);
        assert_derivative(f, bilinear, 1e-5, 1.0, 1e-7);
    }
}

#[test]
fn the_clamped_stiffness_is_positive_semi_definite() {
    let rest = RestTriangle::new(rest_corners());
    for seed in 0..50 {
        let (x, d) = scene(100 * seed);
        let k = stiffness(&rest, &ANISOTROPIC, x, 0.0);
        let mut bilinear = 0.0;
        for a in 0..3 {
            for b in 0..3 {
                let block = if b <= a { k[a][b] } else { k[b][a].transpose() };
                bilinear += d[a].dot(&(block * d[b]));
            }
        }
        // Round-off of entries of order 1e3.
        assert!(bilinear > -1e-9, "{bilinear}");
    }
}

#[test]
fn the_constraint_form_is_the_same_energy() {
    let rest = RestTriangle::new(rest_corners());
    let (x, d) = scene(3);
    let f = rest.gradient_of(x);
    let c = constraint(&f);
    let stress = ANISOTROPIC.stress(&Mat2::new(c[0], 0.5 * c[2], 0.5 * c[2], c[1]));
    let quadratic = c[0] * stress.m11 + c[1] * stress.m22 + c[2] * stress.m12;
    assert_relative_eq!(
        0.5 * rest.area * quadratic,
        energy(&rest, &ANISOTROPIC, x),
        max_relative = 1e-12
    );
    let j = |row: usize| {
        let y = constraint_gradient(&f, &Vec3::ith(row, 1.0));
        rest.gradients().map(|b| y * b)
    };
    let w = [0.3, 0.8, 0.5];
    let mass = constraint_mass(&f, &rest.weighted(w));
    for row in 0..3 {
        assert_derivative(
            |s| constraint(&rest.gradient_of(moved(x, d, s)))[row],
            dot(j(row), d),
            1e-5,
            1.0,
            1e-8,
        );
        for column in 0..3 {
            let products = j(row).into_iter().zip(j(column)).zip(w);
            let sum: f64 = products.map(|((p, q), w)| w * p.dot(&q)).sum();
            assert_relative_eq!(mass[(row, column)], sum, max_relative = 1e-12);
        }
    }
}

#[test]
fn a_triangle_at_rest_pulls_back_to_its_corners() {
    let hats = (Mat2::new(0.3, -0.7, 0.2, 0.9), 0.4);
    let delta: [Vec2; 3] = std::array::from_fn(|a| Vec2::new(noise(3 * a), noise(9 + 5 * a)));
    let value = |s: f64| {
        let c = rest_corners();
        let rest = RestTriangle::new(std::array::from_fn(|a| c[a] + delta[a] * s));
        rest.inverse.dot(&hats.0) + rest.area * hats.1
    };
    let pulled = RestTriangle::new(rest_corners()).pull_back(&hats.0, hats.1);
    let slope: f64 = pulled.iter().zip(&delta).map(|(g, d)| g.dot(d)).sum();
    assert_derivative(value, slope, 1e-5, 1e-3, 1e-8);
}

#[test]
fn rest_derivatives_agree_with_differences_and_with_each_other() {
    let gravity = Vec3::new(0.3, -9.81, 0.1) * (50.0 / 3.0);
    for seed in 0..10 {
        let (x, lambda) = scene(100 * seed);
        let delta: [Vec2; 3] =
            std::array::from_fn(|a| Vec2::new(noise(seed + 3 * a), noise(seed + 9 + 5 * a)));
        let moved_rest = |s: f64| {
            let c = rest_corners();
            RestTriangle::new(std::array::from_fn(|a| c[a] + delta[a] * s))
        };
        let lambda_dot_force = |s: f64| {
            let rest = moved_rest(s);
            let weight: f64 = lambda.iter().map(|l| l.dot(&gravity) * rest.area).sum();
            dot(force(&rest, &ANISOTROPIC, x), lambda) + weight
        };
        let rest = moved_rest(0.0);
        let per_area = lambda.iter().map(|l| l.dot(&gravity)).sum();
        let hat = rest_pull_back(&rest, &ANISOTROPIC, x, lambda, per_area);
        let pulled: f64 = hat.iter().zip(&delta).map(|(h, d)| h.dot(d)).sum();
        assert_derivative(lambda_dot_force, pulled, 1e-6, 1.0, 1e-7);
        let pushed = rest_push_forward(&rest, &ANISOTROPIC, x, delta, gravity);
        assert_relative_eq!(dot(pushed, lambda), pulled, max_relative = 1e-10);
        // A panel may be moved in its plane without changing anything.
        assert!((hat[0] + hat[1] + hat[2]).norm() < 1e-9 * hat[1].norm());
    }
}

#[test]
fn a_strip_in_uniaxial_stretch_pulls_as_the_closed_form_says() {
    // Isotropic E·h = 1000, ν = 0: tension per width E·h·½(s² − 1)·s at stretch s.
    let fabric = Fabric {
        warp: 1000.0,
        weft: 1000.0,
        poisson: 0.0,
        shear: 500.0,
        ..Fabric::default()
    };
    let rest = RestTriangle::new([Vec2::zeros(), Vec2::new(1.0, 0.0), Vec2::new(0.0, 1.0)]);
    let s = 1.2;
    let x = [
        Vec3::zeros(),
        Vec3::new(s, 0.0, 0.0),
        Vec3::new(0.0, 1.0, 0.0),
    ];
    let f = force(&rest, &Elasticity::from(&fabric), x);
    // Corner 1 carries half the width of the unit square.
    assert_relative_eq!(
        f[1].x,
        -0.5 * 1000.0 * 0.5 * (s * s - 1.0) * s,
        max_relative = 1e-12
    );
}

#[test]
fn the_gradient_by_the_stiffnesses_is_that_of_the_force() {
    let rest = RestTriangle::new(rest_corners());
    for seed in 0..10 {
        let (x, lambda) = scene(100 * seed);
        let hat = elasticity_pull_back(&rest, x, lambda);
        let (by, step) = ([0.7, -0.4, 0.9, 0.3], 1e-3);
        let along = |s: f64| {
            let d = ANISOTROPIC;
            let moved = Elasticity {
                weft: d.weft + s * by[0],
                warp: d.warp + s * by[1],
                coupling: d.coupling + s * by[2],
                shear: d.shear + s * by[3],
            };
            dot(force(&rest, &moved, x), lambda)
        };
        let slope = hat.weft * by[0] + hat.warp * by[1] + hat.coupling * by[2] + hat.shear * by[3];
        // Linear, of values of order 1e3: round-off over the step.
        assert_derivative(along, slope, step, 1.0, 1e-7);
    }
}

#[test]
fn the_stiffnesses_pull_back_to_the_fabrics_numbers() {
    let fabric = Fabric {
        warp: 1500.0,
        weft: 400.0,
        poisson: 0.35,
        shear: 90.0,
        ..Fabric::default()
    };
    let hat = Elasticity {
        weft: 0.3,
        warp: -0.5,
        coupling: 0.8,
        shear: 0.2,
    };
    let by = [130.0, -70.0, 0.1, 20.0];
    let value = |s: f64| {
        let d = Elasticity::from(&Fabric {
            warp: fabric.warp + s * by[0],
            weft: fabric.weft + s * by[1],
            poisson: fabric.poisson + s * by[2],
            shear: fabric.shear + s * by[3],
            ..fabric
        });
        d.weft * hat.weft + d.warp * hat.warp + d.coupling * hat.coupling + d.shear * hat.shear
    };
    let pulled = Elasticity::from(&fabric).pull_back(&hat);
    let slope: f64 = pulled.iter().zip(by).map(|(p, b)| p * b).sum();
    assert_derivative(value, slope, 1e-4, 1.0, 1e-8);
}
