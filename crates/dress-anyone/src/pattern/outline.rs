//! From a deformed mesh back to a drawing: outlines as curves that can be cut.
//!
//! Corners go where their vertices went. Each edge keeps its kind of curve when that follows the
//! deformed edge within a tolerance; otherwise it becomes the next more flexible one: line or arc →
//! quadratic → cubic. The fit is the same run from either end, and mirrored points give the mirrored
//! curve.

mod conform;
mod fit;

use super::{Curve, Pattern, PatternMesh, curve};
use crate::geometry::Vec2;
use crate::geometry::polygon::distance_to_segment;
pub use conform::conform;

/// How far a written curve may leave the deformed edge before its kind is changed \[m\]; half a
/// millimetre, the width of a pencil line.
pub const TOLERANCE: f64 = 5e-4;

/// A curve that misses no point by more than this \[m\] needs no fitting.
const UNCHANGED: f64 = 1e-10;

/// Corners closer than this \[m\] leave no room for a curve.
const SAME_POINT: f64 = 1e-9;

/// A pattern drawn anew, and how well it follows the mesh.
#[derive(Clone, Debug, PartialEq)]
pub struct Outlines {
    /// The pattern with new corners and curves; all else as it was.
    pub pattern: Pattern,
    /// Largest distance of the deformed edge points from the written curve \[m\], `[panel][edge]`.
    /// Counts as well how far the curve strays between two points beyond what their bend explains.
    /// Infinite where the mesh had a position that is not a number.
    pub residuals: Vec<Vec<f64>>,
}

/// The outlines of `pattern` drawn through the deformed positions `x_bar` \[m\] of its `mesh`.
pub fn refit_outlines(
    pattern: &Pattern,
    mesh: &PatternMesh,
    x_bar: &[Vec2],
    tolerance: f64,
) -> Outlines {
    let mut drawn = pattern.clone();
    let mut residuals = Vec::new();
    for (p, panel) in drawn.panels.iter_mut().enumerate() {
        let source = &pattern.panels[p];
        let mut missed = Vec::new();
        for (e, edge) in panel.edges.iter_mut().enumerate() {
            let along = &mesh.edge_vertices[p][e];
            let points: Vec<_> = along.iter().map(|&v| x_bar[v as usize]).collect();
            let (curve, residual) = redraw(&edge.curve, source.ends(e), &points, tolerance);
            edge.curve = curve;
            missed.push(residual);
            for (corner, point) in [(edge.start, points.first()), (edge.end, points.last())] {
                if let Some(point) = point.filter(|p| is_finite(p)) {
                    panel.vertices[corner] = *point;
                }
            }
        }
        residuals.push(missed);
    }
    Outlines {
        pattern: drawn,
        residuals,
    }
}

/// The curve for an edge whose points were on `source` between `ends` and now are `points`, and its
/// residual.
fn redraw(source: &Curve, ends: (Vec2, Vec2), points: &[Vec2], tolerance: f64) -> (Curve, f64) {
    if points.len() < 2 || !points.iter().all(is_finite) {
        return (Curve::Line, f64::INFINITY);
    }
    let bulges = bulges(source, ends, points);
    let residual = |curve: &Curve| fit::residual(curve, points, &bulges);
    let new_ends = (points[0], points[points.len() - 1]);
    let moved = moved(source, ends, new_ends);
    let missed = residual(&moved);
    let no_room = (new_ends.1 - new_ends.0).norm() <= SAME_POINT;
    if missed <= UNCHANGED || no_room {
        return (moved, missed);
    }
    let mut best = (moved, missed);
    let mut kind = fit::refined(&moved, points);
    loop {
        let missed = residual(&kind);
        if missed < best.1 {
            best = (kind, missed);
        }
        match fit::promoted(&kind, points) {
            Some(start) if best.1 > tolerance => kind = fit::refined(&start, points),
            _ => return best,
        }
    }
}

/// `source` carried along by the similarity that moves its ends; a line where either has no length.
fn moved(source: &Curve, from: (Vec2, Vec2), to: (Vec2, Vec2)) -> Curve {
    let (before, after) = ((from.1 - from.0).norm(), (to.1 - to.0).norm());
    if before <= SAME_POINT || after <= SAME_POINT {
        return Curve::Line;
    }
    let control = |c| curve::from_edge(curve::relative_to_edge(c, from.0, from.1), to.0, to.1);
    match *source {
        Curve::Line => Curve::Line,
        Curve::Quadratic(c) => Curve::Quadratic(control(c)),
        Curve::Cubic(controls) => Curve::Cubic(controls.map(control)),
        Curve::Arc {
            radius,
            large,
            counter_clockwise,
        } => Curve::Arc {
            radius: radius * (after / before),
            large,
            counter_clockwise,
        },
    }
}

/// How far a curve may stand off the chord from each point to the next \[m\]: what the source did,
/// in proportion, or twice what the bend of the points explains.
fn bulges(source: &Curve, (a, b): (Vec2, Vec2), points: &[Vec2]) -> Vec<f64> {
    let pieces = points.len() - 1;
    let halves = source.sample(a, b, 2 * pieces);
    let sagitta = |j: usize| {
        let inside = (1..pieces).contains(&j);
        // A circle of curvature κ stands κ h²/8 off a chord of length h, and bends by κ h².
        inside.then(|| (points[j - 1] - 2.0 * points[j] + points[j + 1]).norm() / 8.0)
    };
    let bulge = |k: usize| {
        let (from, middle, to) = (halves[2 * k], halves[2 * k + 1], halves[2 * k + 2]);
        let before = distance_to_segment(middle, (from, to));
        let growth = (points[k + 1] - points[k]).norm() / (to - from).norm();
        let scaled = if growth.is_finite() {
            before * growth.max(1.0)
        } else {
            0.0
        };
        let bend = [sagitta(k), sagitta(k + 1)].into_iter().flatten();
        2.0 * bend.fold(scaled, f64::max)
    };
    (0..pieces).map(bulge).collect()
}

fn is_finite(p: &Vec2) -> bool {
    p.iter().all(|c| c.is_finite())
}

#[cfg(test)]
mod tests;
