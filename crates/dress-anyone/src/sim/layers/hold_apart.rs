//! Moves that pass through nothing: each pair of convex pieces is parted by a plane half way between its
//! closest points, and no vertex reaches that plane (cf. Chen et al. 2025, Offset Geometric Contact, whose
//! bounds are balls instead).

use super::{first_side, without_mean};
use crate::geometry::Vec3;
use crate::sim::energy::layers::{Kind, Pair};

/// Part of the way to the parting plane that a vertex may go.
const SHARE: f64 = 0.9;
/// Passes in which the parting planes may move along with the cloth.
const MOVING_PASSES: usize = 3;

/// Shortens the move `d` from `x` of single vertices, so that no layer passes through another: what it has
/// beyond the mean of all, for only by that do pieces come closer.
/// `pairs` are all that the move could bring together; none comes closer than the part `least` of the distance
/// at which it begins to feel the other. Whether anything was shortened.
///
/// The parting planes move along with the mean of their pair, so that layers fall together. Where
/// that does not work out, because a vertex is held back elsewhere, planes stand still in the end.
pub(super) fn hold_apart(pairs: &[Pair], x: &[Vec3], d: &mut [Vec3], least: f64) -> bool {
    let mean = d.iter().sum::<Vec3>() / d.len() as f64;
    let mut own = without_mean(d);
    let shortened = hold_own_moves_apart(pairs, x, &mut own, least);
    if shortened {
        for (d, own) in d.iter_mut().zip(own) {
            *d = mean + own;
        }
    }
    shortened
}

/// The same for moves `d` less the mean of all.
fn hold_own_moves_apart(pairs: &[Pair], x: &[Vec3], d: &mut [Vec3], least: f64) -> bool {
    let planes: Vec<Plane> = (pairs.iter())
        .filter_map(|pair| Plane::between(pair, x, d, least))
        .collect();
    let mut any = false;
    for pass in 0..=MOVING_PASSES {
        let mut parts = vec![1.0_f64; d.len()];
        let mut parted = true;
        for plane in &planes {
            let Plane {
                vertices,
                n,
                rooms,
                signs,
            } = plane;
            let moves = vertices.map(|v| n.dot(&d[v]));
            let plane = if pass < MOVING_PASSES {
                0.25 * moves.iter().sum::<f64>()
            } else {
                0.0
            };
            for k in 0..4 {
                let (room, sign) = (rooms[k], signs[k]);
                if (moves[k] - plane) * sign > room {
                    // The plane's own move is given; what is left of the room is the vertex's.
                    let own = moves[k] * sign;
                    let allowed = room + plane * sign;
                    // One that flees too slowly is passed by the plane: that takes a still one.
                    let part = if own > 0.0 {
                        (allowed / own).max(0.0)
                    } else {
                        1.0
                    };
                    parts[vertices[k]] = parts[vertices[k]].min(part);
                    parted = false;
                }
            }
        }
        if parted {
            break;
        }
        any = true;
        for (d, part) in d.iter_mut().zip(parts) {
            *d *= part;
        }
    }
    any
}

/// The plane half way between the closest points of a pair.
struct Plane {
    vertices: [usize; 4],
    n: Vec3,
    /// Which way along n each vertex comes to the plane, and how far it may go \[m\].
    signs: [f64; 4],
    rooms: [f64; 4],
}

impl Plane {
    /// None where the moves `d` are too short to reach it, whatever part of them is taken: they then
    /// stay within a share of half the distance, even where the plane moves as far.
    fn between(pair: &Pair, x: &[Vec3], d: &[Vec3], least: f64) -> Option<Self> {
        let vertices = pair.vertices.map(|v| v as usize);
        let at = vertices.map(|v| x[v]);
        let closest = pair.closest(at);
        let delta = closest.r.norm();
        let farthest = vertices.map(|v| d[v].norm_squared());
        let farthest = farthest.into_iter().fold(0.0, f64::max).sqrt();
        let gap = least * pair.h;
        if !(0.0 < delta && SHARE * (delta - gap) < 4.0 * farthest) {
            return None;
        }
        let n = closest.r / delta;
        let heights = at.map(|p| n.dot(&p));
        let middle = middle(pair.kind, &closest.beta, &heights);
        let sign = |k| if first_side(pair.kind, k) { -1.0 } else { 1.0 };
        let signs: [f64; 4] = std::array::from_fn(sign);
        let room = |k: usize| (middle - heights[k]) * signs[k] - 0.5 * gap;
        Some(Self {
            vertices,
            n,
            signs,
            rooms: std::array::from_fn(|k| SHARE * room(k).max(0.0)),
        })
    }
}

/// Height half way between the closest points.
fn middle(kind: Kind, beta: &[f64; 4], heights: &[f64; 4]) -> f64 {
    let mean = |k: usize| {
        let sign = if first_side(kind, k) { 0.5 } else { -0.5 };
        sign * beta[k] * heights[k]
    };
    (0..4).map(mean).sum()
}
