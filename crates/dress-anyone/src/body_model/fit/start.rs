//! Where to begin: which way the scan stands, how large it is, and how it holds its arms.
//!
//! The principal axes of the surface are height, breadth and depth of whoever stands roughly
//! upright, whatever way the file is turned; which end is the head, and which side the face, only
//! trying tells. Every way to stand is tried with arms half down, level and down, and a few steps of
//! place, size and pose on a coarse surface. The best of them, each standing another way, go on.

use super::scan::Scan;
use super::solve::{Freedom, Round, State, Surface, refine};
use crate::body_model::BodyModel;
use crate::geometry::{Mat3, Vec3, bounds};
use rayon::prelude::*;

/// Angles of the arms below the horizontal that are tried \[rad\].
const ARMS: [f64; 3] = [0.785, 0.0, 1.3];

/// A few coarse steps; only poses are free.
const TRY: Round = Round {
    sigma: 0.12,
    steps: 6,
    points: 500,
    shapes: 0,
    freedom: Freedom {
        pose: 1e-3,
        shape: 1.0,
        stretch: 1.0,
    },
};
/// What is near enough to speak for a try \[m\].
const NEAR: f64 = 0.05;
/// How many ways to stand go on.
const KEPT: usize = 4;

/// The best starts, best first, each standing another way.
pub(super) fn starts(surface: &Surface<'_>, scan: &Scan) -> Vec<State> {
    let ways = ways_to_stand(scan);
    let best_of_way = |way: &Mat3| {
        let tried = ARMS.map(|arms| {
            let mut state = placed(surface.model, scan, *way, arms);
            refine(surface, scan, &mut state, &TRY);
            (surface.misfit(scan, &state, NEAR), state)
        });
        let better = |a: (f64, State), b: (f64, State)| if b.0 < a.0 { b } else { a };
        tried.into_iter().reduce(better)
    };
    let mut starts: Vec<(f64, State)> = ways.par_iter().filter_map(best_of_way).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    starts.truncate(KEPT);
    starts.into_iter().map(|(_, state)| state).collect()
}

/// Turns that bring the model's axes (left, up, front) to the scan's principal ones: both ends up,
/// both sides front. Any axis may be the height when none is clearly the longest.
fn ways_to_stand(scan: &Scan) -> Vec<Mat3> {
    let count = scan.samples.len() as f64;
    let mean = scan.samples.iter().map(|s| s.point).sum::<Vec3>() / count;
    let scatter: Mat3 = scan
        .samples
        .iter()
        .map(|s| (s.point - mean) * (s.point - mean).transpose() / count)
        .sum();
    let eigen = scatter.symmetric_eigen();
    let mut order = [0, 1, 2];
    order.sort_by(|a, b| eigen.eigenvalues[*b].total_cmp(&eigen.eigenvalues[*a]));
    let [longest, second, least] = order.map(|i| eigen.eigenvectors.column(i).into_owned());
    let [l1, l2, _] = order.map(|i| eigen.eigenvalues[i]);
    let mut frames = vec![(longest, second)];
    if l1 < CLEARLY * l2 {
        frames.extend([(second, longest), (longest, least), (second, least)]);
    }
    let mut ways = Vec::new();
    for (up, left) in frames {
        for up in [up, -up] {
            for left in [left, -left] {
                ways.push(Mat3::from_columns(&[left, up, left.cross(&up)]));
            }
        }
    }
    ways
}

/// Scatter along the longest axis this many times that along the next is height.
const CLEARLY: f64 = 2.0;

/// The mean body turned this way, as tall as the scan and in its middle.
fn placed(model: &BodyModel, scan: &Scan, way: Mat3, arms: f64) -> State {
    let mut state = State {
        shape: model.mean_shape(),
        pose: model.arms_at(arms),
    };
    let turn = nalgebra::Rotation3::from_matrix_unchecked(way);
    state.pose.rotations[0] = turn.scaled_axis();
    let extent = |points: &mut dyn Iterator<Item = Vec3>| bounds(points.map(|p| way.tr_mul(&p)));
    let aim = extent(&mut scan.samples.iter().map(|s| s.point));
    let own = |state: &State| {
        let posed = model.posed(&state.shape, &state.pose, &[]);
        extent(&mut posed.positions.into_iter())
    };
    let (low, high) = own(&state);
    state.shape.scale = (aim.1.y - aim.0.y) / (high.y - low.y);
    let (low, high) = own(&state);
    state.pose.translation = way * ((aim.0 + aim.1) - (low + high)) * 0.5;
    state
}
