use super::*;
use crate::check::{assert_derivative, noise};
use crate::fixture::add_box;
use crate::geometry::closest_point::tests::sphere;

fn direction(i: usize) -> Vec3 {
    Vec3::new(noise(5 * i), noise(7 * i + 1), noise(11 * i + 2)).normalize()
}

#[test]
fn the_field_of_a_sphere_is_its_distance() {
    let (radius, h) = (0.12, 5e-3);
    let field = DistanceField::new(&sphere(radius, 6), h, 0.03);
    for i in 0..500 {
        let n = direction(i);
        // From 4 cm inside to the end of the band.
        let d = 0.035 * noise(i + 77) - 0.005;
        let p = n * (radius + d);
        let sample = field.sample(p).unwrap();
        // Circumcircles of 2.6 mm sag by 2.6²/(2·120) mm.
        let error = sample.distance - d;
        // Farther off the spline is h²/6 2/r too high, and nodes that are means ½ h² 2/r at most; every
        // second one is, so the slope goes up and down by half of that per spacing.
        let means = if d.abs() < 10e-3 {
            0.0
        } else {
            h * h / (radius + d)
        };
        assert!(
            -29e-6 < error && error < 29e-6 + 4.0 / 3.0 * means,
            "{error:e} at {d}"
        );
        // Facets tilt by up to 1 degree; the spline averages over a few of them.
        let tilt = sample.gradient.normalize().angle(&n);
        assert!(
            tilt < 0.2_f64.to_radians() + 0.5 * means / h,
            "{tilt:e} at {d}"
        );
    }
    assert_eq!(field.sample(Vec3::x() * 0.4), None);
    assert_eq!(field.sample(Vec3::repeat(f64::NAN)), None);
}

#[test]
fn small_limbs_are_as_thick_as_they_are() {
    // A finger's tip. Unsharpened, the spline would be h²/3r = 0.8 mm off.
    let (radius, h) = (10e-3, 5e-3);
    let field = DistanceField::new(&sphere(radius, 5), h, 0.03);
    for i in 0..200 {
        let d = 5e-3 * noise(i + 77).abs();
        let sample = field.sample(direction(i) * (radius + d)).unwrap();
        // What is left is of the order of h⁴/r³ / 72.
        assert!(
            (sample.distance - d).abs() < 0.1e-3,
            "{} at {d}",
            sample.distance
        );
    }
}

/// Two plates, 40 mm thick and 120 mm high, `gap` apart at the bottom and `gap` + `wedge` at the top.
fn wedge(gap: f64, wedge: f64) -> DistanceField {
    let mut body = TriangleMesh::default();
    for side in [-1.0, 1.0] {
        let mut plate = TriangleMesh::default();
        add_box(&mut plate, [0.0, -0.06, -0.06], [0.04, 0.06, 0.06]);
        for p in &mut plate.positions {
            p.x += 0.5 * gap + 0.5 * wedge * (p.y / 0.12 + 0.5);
            p.x *= side;
        }
        let first = body.positions.len() as u32;
        let turn = |t: &[u32; 3]| if side < 0.0 { [t[0], t[2], t[1]] } else { *t };
        let triangles = plate.triangles.iter().map(|t| turn(t).map(|v| v + first));
        body.triangles.extend(triangles);
        body.positions.extend(plate.positions);
    }
    DistanceField::new(&body, 5e-3, 0.03)
}

#[test]
fn what_a_ball_does_not_reach_is_filled() {
    // 20 mm a side over 120 mm of height: between the walls' middle at height y and each wall there
    // are (y + 60 mm) / 6 · cos 9.5°, so that a ball of radius r comes down to y = 6.08 r − 60 mm, and its
    // lowest point to 5.08 r − 60 mm.
    let field = wedge(0.0, 0.04);
    for y in [-0.047, -0.042] {
        let sample = field.sample(Vec3::new(0.0, y, 0.0)).unwrap();
        // As far below the ball; r is 4 to 6.5 mm.
        let [least, most] = [4e-3, 6.5e-3].map(|r| y + 0.06 - 5.08 * r);
        let found = sample.distance;
        assert!(
            (most..=least + 1e-3).contains(&found),
            "{most} {found} {least} at {y}"
        );
        assert!(sample.gradient.y > 0.8, "{} at {y}", sample.gradient);
    }
    // Above, the walls' distances are as they were.
    let (y, x) = (0.04, 8e-3);
    let wall = ((y + 0.06) / 6.0 - x) * (1.0_f64 / 6.0).atan().cos();
    let sample = field.sample(Vec3::new(x, y, 0.0)).unwrap();
    assert!(
        (sample.distance - wall).abs() < 0.1e-3,
        "{} {wall}",
        sample.distance
    );
}

#[test]
fn a_gap_for_two_layers_stays_open() {
    let field = wedge(13e-3, 0.0);
    let sample = field.sample(Vec3::zeros()).unwrap();
    // The spline rounds the crease between the walls by a fraction of the spacing.
    assert!(sample.distance > 5e-3, "{}", sample.distance);
    let sample = field.sample(Vec3::x() * 5e-3).unwrap();
    assert!(
        (sample.distance - 1.5e-3).abs() < 0.3e-3,
        "{}",
        sample.distance
    );
    assert!(wedge(6e-3, 0.0).sample(Vec3::zeros()).unwrap().distance < 0.0);
}

#[test]
fn every_point_within_the_band_has_a_sample() {
    let field = DistanceField::new(&sphere(0.1, 3), 7e-3, 0.02);
    for i in 0..2000 {
        let p = direction(i) * (0.12 * noise(i + 5).abs().cbrt() - 1e-9);
        assert!(field.sample(p).is_some());
    }
}

#[test]
fn gradient_and_hessian_are_those_of_the_spline() {
    let field = DistanceField::new(&sphere(0.05, 2), 5e-3, 0.03);
    for i in 0..100 {
        let p = direction(i) * (0.05 + 0.025 * noise(i + 3));
        let along = direction(i + 500);
        let at = |s: f64| field.sample_with_hessian(p + along * s).unwrap();
        let (sample, hessian) = at(0.0);
        let slope = sample.gradient.dot(&along);
        assert_derivative(|s| at(s).0.distance, slope, 1e-6, 1.0, 1e-6);
        for axis in 0..3 {
            let slope = hessian.row(axis).transpose().dot(&along);
            // Hessians are of the order of 1/radius = 20 per metre.
            assert_derivative(|s| at(s).0.gradient[axis], slope, 1e-7, 20.0, 1e-6);
        }
    }
}

#[test]
fn second_derivatives_do_not_jump_between_cells() {
    let field = DistanceField::new(&sphere(0.05, 2), 5e-3, 0.03);
    for i in 0..20 {
        let cell = (
            field.grid.position([20, 11 + i % 8, 13]) - Vec3::x() * 1e-9,
            2e-9,
        );
        let before = field.sample_with_hessian(cell.0).unwrap().1;
        let after = field
            .sample_with_hessian(cell.0 + Vec3::x() * cell.1)
            .unwrap()
            .1;
        // Third derivatives below 1e5 per square metre.
        assert!((after - before).norm() < 1e-3);
    }
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let build = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build();
        let body = sphere(0.05, 3);
        pool.unwrap()
            .install(|| DistanceField::new(&body, 5e-3, 0.03))
    };
    assert_eq!(build(1), build(2));
}

#[test]
fn holes_are_closed_and_what_lies_inside_is_inside() {
    // A head with a hole in its crown, an eye within, wound inside out.
    let mut head = sphere(0.1, 4);
    head.triangles
        .retain(|t| t.iter().any(|&v| head.positions[v as usize].y < 0.09));
    let eye = sphere(0.02, 2);
    let offset = head.positions.len() as u32;
    head.positions
        .extend(eye.positions.iter().map(|p| p + Vec3::z() * 0.05));
    let flipped = |t: &[u32; 3]| [t[0] + offset, t[2] + offset, t[1] + offset];
    head.triangles.extend(eye.triangles.iter().map(flipped));
    let field = DistanceField::new(&head, 5e-3, 0.03);
    for i in 0..500 {
        let p = direction(i) * 0.12 * noise(i + 9).abs();
        let deep = p.norm() < 0.08 && (p - Vec3::z() * 0.05).norm() > 0.028;
        let sample = field.sample(p).unwrap();
        // On the eye itself the distance vanishes; the spline overshoots a little.
        assert!(sample.distance < 1e-3 || p.norm() > 0.085);
        assert!(!deep || sample.distance < -5e-3);
        assert!(p.norm() < 0.105 || sample.distance > 2e-3);
    }
}

#[test]
fn a_sample_below_a_limit_is_the_sample_wherever_it_is_below_it() {
    let field = DistanceField::new(&sphere(0.05, 3), 5e-3, 0.03);
    let mut counts = [0, 0];
    for i in 0..3000 {
        let p = direction(i) * (0.09 * noise(i + 5).abs());
        for limit in [-0.01, 0.0, 3e-3, 0.02] {
            let sample = field.sample(p);
            let below = sample.filter(|s| s.distance < limit);
            let found = field.sample_below(p, limit);
            assert_eq!(found.ok(), below);
            // As far as it tells, nothing is below the limit.
            let way = direction(i + 7) * (0.999 * found.err().unwrap_or(0.0));
            let there = field.sample(p + way).filter(|s| s.distance < limit);
            assert!(below.is_some() || there.is_none(), "{p} {way}");
            assert_eq!(field.sample_with_hessian(p).map(|(s, _)| s), sample);
            counts[usize::from(below.is_some())] += 1;
        }
    }
    assert!(counts.iter().all(|n| *n > 1000), "{counts:?}");
    assert_eq!(field.sample_below(Vec3::repeat(f64::NAN), 1.0), Err(0.0));
    assert_eq!(field.sample_below(Vec3::repeat(9.0), 1.0), Err(0.0));
}

#[test]
fn nothing_has_no_distance() {
    let field = DistanceField::new(&TriangleMesh::default(), 5e-3, 0.03);
    assert_eq!(field.sample(Vec3::zeros()), None);
}

/// `DRESS_BODY=….obj cargo test -p dress-anyone build_time -- --ignored --nocapture`
#[test]
#[ignore = "measures; needs a body"]
fn build_time_and_memory_of_a_real_body() {
    let Some(path) = std::env::var_os("DRESS_BODY") else {
        println!("skipped: DRESS_BODY names no .obj file");
        return;
    };
    let text = std::fs::read_to_string(path).unwrap();
    let mut body = TriangleMesh::default();
    for line in text.lines() {
        let mut words = line.split_whitespace();
        let kind = words.next();
        if kind == Some("v") {
            let numbers = words.take(3).map(|x| x.parse::<f64>().unwrap());
            body.positions.push(Vec3::from_iterator(numbers));
        } else if kind == Some("f") {
            let index = |word: &str| word.split('/').next().unwrap().parse::<u32>().unwrap() - 1;
            let corners: Vec<u32> = words.map(index).collect();
            let fan = corners[1..]
                .windows(2)
                .map(|pair| [corners[0], pair[0], pair[1]]);
            body.triangles.extend(fan);
        }
    }
    let start = std::time::Instant::now();
    let field = DistanceField::new(&body, DistanceField::SPACING, DistanceField::OUTER);
    println!(
        "{} triangles, {} nodes, {:.1} MB, {:.2} s",
        body.triangles.len(),
        field.values.len(),
        field.memory() as f64 * 1e-6,
        start.elapsed().as_secs_f64()
    );
    let sunk = field.values.iter().filter(|v| **v < 0.0).count();
    println!(
        "{:.4} m³ inside",
        sunk as f64 * DistanceField::SPACING.powi(3)
    );
}
