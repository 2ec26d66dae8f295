//! The frame in which a panel is meshed, the same for all its congruent and mirrored copies.
//!
//! A mesh depends on where its outline starts, on the axes and on the last bit of every coordinate.
//! So that a left and a right sleeve get exact mirror images, an outline is meshed from its most
//! distinctive corner, seen from the more distinctive side, with coordinates rounded to nanometres.

use crate::geometry::{Vec2, Vec3, cross2, signed_area};
use std::f64::consts::PI;

/// Rounding of canonical coordinates \[m\] and angles \[rad\]. Not a round number: designers' lengths
/// then do not fall half-way between two multiples, where the last bit would decide.
const GRAIN: f64 = PI * 1e-9;

/// An outline in its canonical frame, and the way back.
pub(super) struct Canonical {
    /// Counter-clockwise outline \[m\], starting at the origin along +x.
    pub(super) outline: Vec<Vec2>,
    /// Where each point of [`Self::outline`] stands in the outline it was made from.
    pub(super) order: Vec<usize>,
    /// Whether the frame is a mirrored one.
    pub(super) mirrored: bool,
    origin: Vec2,
    axis: Vec2,
}

impl Canonical {
    /// The canonical form of the simple polygon `outline`, in either direction. Where a symmetric
    /// outline looks the same from several points, `placed`, its points in space \[m\], decide so
    /// that panels placed as mirror images (by x) are seen as such.
    pub(super) fn of(outline: &[Vec2], placed: &[Vec3]) -> Self {
        let mut forward: Vec<usize> = (0..outline.len()).collect();
        if signed_area(outline) < 0.0 {
            forward.reverse();
        }
        let backward: Vec<usize> = forward.iter().rev().copied().collect();
        let on_the_right = placed.iter().map(|p| p.x).sum::<f64>() < 0.0;
        let views = [(forward, false), (backward, true)].map(|(order, mirrored)| {
            let points: Vec<Vec2> = order.iter().map(|&i| flip(outline[i], mirrored)).collect();
            let (look, starts) = least_rotations(&signature(&points));
            let place = |&start: &usize| {
                let p = placed[order[start]];
                [-p.y, -p.x.abs(), -p.z].map(rounded)
            };
            let start = starts.into_iter().min_by_key(place).unwrap_or(0);
            (look, mirrored != on_the_right, start, order)
        });
        let [plain, turned] = views;
        let mirrored = (&turned.0, turned.1) < (&plain.0, plain.1);
        let (_, _, start, mut order) = if mirrored { turned } else { plain };
        order.rotate_left(start);
        let origin = outline[order[0]];
        let axis = flip(outline[order[1]] - origin, mirrored).normalize();
        let mut canonical = Self {
            outline: Vec::new(),
            order,
            mirrored,
            origin,
            axis,
        };
        canonical.outline = canonical
            .order
            .iter()
            .map(|&i| canonical.enter(outline[i]))
            .collect();
        canonical
    }

    /// From the canonical frame back to the panel's.
    pub(super) fn leave(&self, p: Vec2) -> Vec2 {
        let axis = self.axis;
        let turned = Vec2::new(p.x * axis.x - p.y * axis.y, p.x * axis.y + p.y * axis.x);
        flip(turned, self.mirrored) + self.origin
    }

    /// From the panel's frame to the canonical one, rounded.
    fn enter(&self, p: Vec2) -> Vec2 {
        let offset = flip(p - self.origin, self.mirrored);
        let turned = Vec2::new(self.axis.dot(&offset), cross2(self.axis, offset));
        turned.map(|c| (c / GRAIN).round() * GRAIN)
    }
}

fn flip(p: Vec2, mirrored: bool) -> Vec2 {
    if mirrored { Vec2::new(-p.x, p.y) } else { p }
}

/// What an outline looks like from each of its points, whatever its place and direction: the turn
/// there \[rad\] and the length of the edge that follows \[m\], rounded.
fn signature(points: &[Vec2]) -> Vec<[i64; 2]> {
    let count = points.len();
    (0..count)
        .map(|i| {
            let (before, after) = (points[(i + count - 1) % count], points[(i + 1) % count]);
            let (u, v) = (points[i] - before, after - points[i]);
            let turn = cross2(u, v).atan2(u.dot(&v));
            [turn, v.norm()].map(rounded)
        })
        .collect()
}

/// The least of all rotations of `values`, and everywhere it starts.
fn least_rotations(values: &[[i64; 2]]) -> (Vec<[i64; 2]>, Vec<usize>) {
    let from = |start: usize| values[start..].iter().chain(&values[..start]);
    let least = (0..values.len())
        .min_by(|&a, &b| from(a).cmp(from(b)))
        .unwrap_or(0);
    let starts = (0..values.len()).filter(|&start| from(start).eq(from(least)));
    (from(least).copied().collect(), starts.collect())
}

/// In whole grains.
fn rounded(value: f64) -> i64 {
    (value / GRAIN).round() as i64
}
