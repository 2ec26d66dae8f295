//! Least-squares curves through points, with fixed ends.
//!
//! Béziers: minimise Σ |C(t_k) − p_k|² over control points and parameters. Each round puts t_k at
//! the foot of p_k and takes a Gauss–Newton step of the distances along the normals; movement along
//! the curve, which only slides the parameters, is damped (Wang, Pottmann, Liu 2006, tangent distance
//! minimisation). Arcs: the same for their one unknown, the bulge tan(sweep/4).

use crate::geometry::polygon::distance_to_segment;
use crate::geometry::{Mat2, Vec2, cross2};
use crate::pattern::Curve;
use nalgebra::{DMatrix, DVector};

/// Gauss–Newton rounds; a smooth edge takes 3 to 6.
const ROUNDS: usize = 40;

/// Weight of movement along the curve against movement across it.
const ALONG: f64 = 1e-2;

/// Least damping, relative to the diagonal: below it points too few for a cubic leave it singular.
const LEAST_DAMPING: f64 = 1e-7;

/// Steps towards the foot of a point; each shrinks the error by distance × curvature.
const FOOT_STEPS: usize = 8;

/// A bulge less than this is a straight line: a micron on a metre.
const STRAIGHT: f64 = 1e-6;

/// The curve of the kind of `start` that follows `points` best, searched from `start`.
pub(super) fn refined(start: &Curve, points: &[Vec2]) -> Curve {
    match *start {
        Curve::Line => Curve::Line,
        Curve::Arc { .. } => arc_through(points).unwrap_or(*start),
        _ => refined_bezier(start, points),
    }
}

/// The next more flexible kind of curve, through `points` at parameters in proportion to their
/// distance along the edge; none beyond cubics.
pub(super) fn promoted(curve: &Curve, points: &[Vec2]) -> Option<Curve> {
    let (a, b) = ends(points);
    let start = match curve {
        Curve::Line | Curve::Arc { .. } => Curve::Quadratic((a + b) * 0.5),
        Curve::Quadratic(_) => Curve::Cubic([(2.0 * a + b) / 3.0, (a + 2.0 * b) / 3.0]),
        Curve::Cubic(_) => return None,
    };
    let fractions = fractions(points);
    Some(bezier_step(&start, points, &fractions, 1.0, LEAST_DAMPING).unwrap_or(start))
}

/// Largest distance of `points` from `curve` \[m\], or of the curve from the chord of two
/// neighbours beyond the `bulges` allowed there.
pub(super) fn residual(curve: &Curve, points: &[Vec2], bulges: &[f64]) -> f64 {
    let (a, b) = ends(points);
    let t = feet(curve, points, first_parameters(curve, points));
    let mut largest: f64 = 0.0;
    for (p, t) in points.iter().zip(&t) {
        largest = largest.max((curve.point(a, b, *t) - p).norm());
    }
    for k in 0..bulges.len() {
        for share in [0.25, 0.5, 0.75] {
            let between = curve.point(a, b, t[k] + share * (t[k + 1] - t[k]));
            let off = distance_to_segment(between, (points[k], points[k + 1]));
            largest = largest.max(off - bulges[k]);
        }
    }
    largest
}

fn refined_bezier(start: &Curve, points: &[Vec2]) -> Curve {
    let cost = |curve: &Curve, t: &[f64]| -> f64 {
        let (a, b) = ends(points);
        let off = |(p, t): (&Vec2, &f64)| (curve.point(a, b, *t) - p).norm_squared();
        points.iter().zip(t).map(off).sum()
    };
    let mut curve = *start;
    let mut t = feet(&curve, points, first_parameters(&curve, points));
    let mut least = cost(&curve, &t);
    let mut damping = LEAST_DAMPING;
    for _ in 0..ROUNDS {
        let Some(trial) = bezier_step(&curve, points, &t, ALONG, damping) else {
            break;
        };
        let trial_t = feet(&trial, points, t.clone());
        let trial_cost = cost(&trial, &trial_t);
        if trial_cost <= least {
            (curve, t, least) = (trial, trial_t, trial_cost);
            damping = (0.1 * damping).max(LEAST_DAMPING);
        } else {
            damping *= 100.0;
        }
    }
    curve
}

/// `curve` after one Gauss–Newton step at fixed parameters `t`; with `along` = 1, the linear least
/// squares solution. None when the system cannot be solved.
fn bezier_step(
    curve: &Curve,
    points: &[Vec2],
    t: &[f64],
    along: f64,
    damping: f64,
) -> Option<Curve> {
    let (a, b) = ends(points);
    let unknowns = 2 * controls(curve).len();
    let mut matrix = DMatrix::zeros(unknowns, unknowns);
    let mut right = DVector::zeros(unknowns);
    for (p, &t) in points.iter().zip(t) {
        let weights = weights(curve, t);
        let tangent = curve.velocity(a, b, t).try_normalize(0.0);
        let tangent = tangent.unwrap_or_else(Vec2::zeros);
        let metric = Mat2::identity() - tangent * tangent.transpose() * (1.0 - along);
        let pull = metric * (p - curve.point(a, b, t));
        for (i, u) in weights.iter().enumerate() {
            let mut entry = right.fixed_rows_mut::<2>(2 * i);
            entry += pull * *u;
            for (j, w) in weights.iter().enumerate() {
                let mut block = matrix.fixed_view_mut::<2, 2>(2 * i, 2 * j);
                block += metric * (u * w);
            }
        }
    }
    let diagonal = damping * matrix.trace() / unknowns as f64;
    for i in 0..unknowns {
        matrix[(i, i)] += diagonal;
    }
    let step = matrix.cholesky()?.solve(&right);
    let mut moved = controls(curve);
    for (i, control) in moved.iter_mut().enumerate() {
        *control += step.fixed_rows::<2>(2 * i);
    }
    let finite = step.iter().all(|s| s.is_finite());
    finite.then(|| match moved.as_slice() {
        &[c, d] => Curve::Cubic([c, d]),
        _ => Curve::Quadratic(moved[0]),
    })
}

/// The inner control points of a Bézier.
fn controls(curve: &Curve) -> Vec<Vec2> {
    match *curve {
        Curve::Quadratic(c) => vec![c],
        Curve::Cubic(controls) => controls.to_vec(),
        _ => unreachable!("asked only of Béziers"),
    }
}

/// Weights of the inner control points at `t`.
fn weights(curve: &Curve, t: f64) -> Vec<f64> {
    let s = 1.0 - t;
    match curve {
        Curve::Cubic(_) => vec![3.0 * s * s * t, 3.0 * s * t * t],
        _ => vec![2.0 * s * t],
    }
}

/// Parameters of the points of `curve` nearest to `points`, searched from `t`.
fn feet(curve: &Curve, points: &[Vec2], mut t: Vec<f64>) -> Vec<f64> {
    let (a, b) = ends(points);
    let last = points.len() - 1;
    for k in 1..last {
        let off = |t: f64| curve.point(a, b, t) - points[k];
        let mut foot = t[k];
        for _ in 0..FOOT_STEPS {
            let velocity = curve.velocity(a, b, foot);
            let step = off(foot).dot(&velocity) / velocity.norm_squared();
            if step.is_finite() {
                foot = (foot - step).clamp(0.0, 1.0);
            }
        }
        if off(foot).norm_squared() <= off(t[k]).norm_squared() {
            t[k] = foot;
        }
    }
    t
}

/// Parameters that cut `curve` in the proportions in which `points` cut their polygon.
fn first_parameters(curve: &Curve, points: &[Vec2]) -> Vec<f64> {
    const STEPS: usize = 256;
    let (a, b) = ends(points);
    let along: Vec<_> = (0..=STEPS)
        .map(|i| curve.point(a, b, i as f64 / STEPS as f64))
        .collect();
    let lengths = fractions(&along);
    let parameter = |fraction: f64| {
        let i = lengths.partition_point(|l| *l < fraction).clamp(1, STEPS) - 1;
        let share = (fraction - lengths[i]) / (lengths[i + 1] - lengths[i]);
        let share = if share.is_finite() {
            share.clamp(0.0, 1.0)
        } else {
            0.0
        };
        (i as f64 + share) / STEPS as f64
    };
    fractions(points).into_iter().map(parameter).collect()
}

/// How far along their polygon the points lie, from 0 to 1.
fn fractions(points: &[Vec2]) -> Vec<f64> {
    let mut sums = vec![0.0];
    for pair in points.windows(2) {
        sums.push(sums[sums.len() - 1] + (pair[1] - pair[0]).norm());
    }
    let total = sums[sums.len() - 1].max(f64::MIN_POSITIVE);
    sums.into_iter().map(|s| s / total).collect()
}

/// The arc that follows `points` best; none when all lie at its ends.
fn arc_through(points: &[Vec2]) -> Option<Curve> {
    let (a, b) = ends(points);
    let (middle, half) = ((a + b) * 0.5, 0.5 * (b - a).norm());
    let left = Vec2::new(a.y - b.y, b.x - a.x) / (2.0 * half);
    // Centre at `middle + left · offset`, where offset = half (1 − β²) / 2β and, with the sign of
    // the sweep, radius = half (1 + β²) / 2β; the signed distance of a point and its slope by β.
    let distance = |bulge: f64, p: &Vec2| {
        let (square, sign) = (bulge * bulge, bulge.signum());
        let from_centre = p - middle - left * (half * (1.0 - square) / (2.0 * bulge));
        let length = from_centre.norm().max(f64::MIN_POSITIVE);
        let offset_slope = -half * (1.0 + square) / (2.0 * square);
        let radius_slope = half * (square - 1.0) / (2.0 * square);
        let value = sign * length - half * (1.0 + square) / (2.0 * bulge);
        let slope = -sign * from_centre.dot(&left) / length * offset_slope - radius_slope;
        (value, slope)
    };
    let mut bulge = first_bulge(points)?;
    for _ in 0..ROUNDS {
        let (mut gradient, mut curvature) = (0.0, 0.0);
        for p in &points[1..points.len() - 1] {
            let (value, slope) = distance(bulge, p);
            gradient += value * slope;
            curvature += slope * slope;
        }
        // Between half and double in a round, so that a bad step does not turn the arc inside out.
        let growth = 1.0 - gradient / (curvature * bulge);
        if !growth.is_finite() || bulge.abs() < STRAIGHT {
            break;
        }
        bulge *= growth.clamp(0.5, 2.0);
    }
    let radius = half * (1.0 + bulge * bulge) / (2.0 * bulge.abs());
    Some(if bulge.abs() < STRAIGHT {
        Curve::Line
    } else {
        Curve::Arc {
            radius,
            large: bulge.abs() > 1.0,
            counter_clockwise: bulge > 0.0,
        }
    })
}

/// The bulge on which `points` agree in the mean: seen from any point of an arc, the way from the
/// start turns by half the sweep into the way to the end.
fn first_bulge(points: &[Vec2]) -> Option<f64> {
    let (a, b) = ends(points);
    let inner = &points[1..points.len() - 1];
    let turn = |p: &Vec2| cross2(p - a, b - p).atan2((p - a).dot(&(b - p)));
    let mean = inner.iter().map(turn).sum::<f64>() / inner.len() as f64;
    Some((0.5 * mean).tan()).filter(|bulge| bulge.is_finite())
}

/// First and last point.
fn ends(points: &[Vec2]) -> (Vec2, Vec2) {
    (points[0], points[points.len() - 1])
}
