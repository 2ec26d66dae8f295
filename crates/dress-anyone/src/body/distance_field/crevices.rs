//! Crevices too narrow for cloth are filled: armpits, folds of skin, between toes and touching thighs.
//!
//! A ball of radius r rolled over the body does not reach the bottom of a crevice. What it does not
//! reach counts as body (the morphological closing of the body). Cloth that is drawn into a crevice
//! would otherwise rest where the two walls' distances cancel, inside the skin.
//!
//! At a node the distance from the filled body is r less the distance to the nearest place where the
//! ball's centre may be. Around a node at distance d_k ≥ r there is a ball of such places, of radius
//! d_k − r, so that d ≥ d_k − |p − p_k| for every k, and the largest of these is the filled distance:
//! not quite, for no node lies exactly above another, so that [`SLACK`] is allowed for; and where the
//! ball just fits, it may be between nodes.

use super::DistanceField;
use super::nodes::BRICK;
use crate::geometry::Vec3;
use rayon::prelude::*;

/// Radius of the ball \[m\], or up to half a spacing more where its centre is between nodes: two layers of
/// cloth with their thicknesses need twice as much.
const BALL: f64 = 4e-3;
/// Depth inside the body \[m\] to which distances follow the filled surface.
const DEPTH: f64 = 10e-3;
/// What the largest d_k − |p − p_k| lacks where nothing is filled, in spacings.
const SLACK: f64 = 0.15;
/// How far nodes are looked for, in spacings.
const FAR: isize = 6;
/// How far above a node, in spacings, the open air tells that nothing is filled there.
const ABOVE: f64 = 4.0;

impl DistanceField {
    /// Lowers the distances in crevices to those from the filled body.
    pub(super) fn fill_crevices(&mut self) {
        let filled: Vec<Vec<f64>> = (self.grid.stored.par_iter().enumerate())
            .map(|(ordinal, &brick)| {
                let values = &self.values[ordinal * BRICK..(ordinal + 1) * BRICK];
                let nodes = self.grid.nodes(brick).zip(values);
                nodes.map(|(node, d)| self.filled(node, *d).0).collect()
            })
            .collect();
        self.values = filled.concat();
    }

    /// The distance from the filled body at a node of distance `d`, and the node whose distance tells it:
    /// its own, that of the ball that comes nearest, or none.
    pub(super) fn filled(&self, node: [usize; 3], d: f64) -> (f64, Option<[usize; 3]>) {
        if !(-DEPTH..BALL).contains(&d) || self.open_above(node, d) {
            return (d, Some(node));
        }
        let slack = SLACK * self.grid.spacing;
        let reaches = |room: f64| d <= room + slack;
        let mut most = (BALL - FAR as f64 * self.grid.spacing, None);
        if reaches(most.0) {
            return (d, Some(node));
        }
        for z in -FAR..=FAR {
            for y in -FAR..=FAR {
                for x in -FAR..=FAR {
                    let at = neighbour(node, [x, y, z]);
                    if let Some(room) = self.room_at(node, at).filter(|room| *room > most.0) {
                        if reaches(room) {
                            return (d, Some(node));
                        }
                        most = (room, Some(at));
                    }
                }
            }
        }
        (most.0 + slack, most.1)
    }

    /// Whether the node is as far below the open air above it as it seems.
    fn open_above(&self, node: [usize; 3], d: f64) -> bool {
        let mut up = Vec3::zeros();
        for (i, (_, place)) in self.neighbours(node).enumerate() {
            let Some(place) = place else {
                return false;
            };
            up[i / 2] += (self.values[place] - d) * if i % 2 == 0 { 1.0 } else { -1.0 };
        }
        let Some(up) = up.try_normalize(0.0) else {
            return false;
        };
        let step = up * ABOVE;
        let at = neighbour(node, [step.x, step.y, step.z].map(|s| s.round() as isize));
        let room = self.room_at(node, at);
        room.is_some_and(|room| d <= room + SLACK * self.grid.spacing)
    }

    /// d_k − |p − p_k| for the node p and a node k; none where the ball does not fit.
    fn room_at(&self, node: [usize; 3], k: [usize; 3]) -> Option<f64> {
        let d = self.values[self.place(k)?];
        let away = Vec3::from_fn(|i, _| k[i] as f64 - node[i] as f64).norm() * self.grid.spacing;
        (d >= BALL).then_some(d - away)
    }
}

/// The node that is `off` from `node`; beyond every brick where that is below zero.
fn neighbour(node: [usize; 3], off: [isize; 3]) -> [usize; 3] {
    std::array::from_fn(|i| node[i].wrapping_add_signed(off[i]))
}
