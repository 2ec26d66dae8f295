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
                nodes.map(|(node, d)| self.filled(node, *d)).collect()
            })
            .collect();
        self.values = filled.concat();
    }

    /// The distance from the filled body at a node of distance `d`.
    fn filled(&self, node: [usize; 3], d: f64) -> f64 {
        if !(-DEPTH..BALL).contains(&d) || self.open_above(node, d) {
            return d;
        }
        let mut most = BALL - FAR as f64 * self.grid.spacing;
        for z in -FAR..=FAR {
            for y in -FAR..=FAR {
                for x in -FAR..=FAR {
                    most = most.max(self.room_at(node, [x, y, z]).unwrap_or(most));
                }
            }
        }
        d.min(most + SLACK * self.grid.spacing)
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
        let room = self.room_at(node, [step.x, step.y, step.z].map(|s| s.round() as isize));
        room.is_some_and(|room| d <= room + SLACK * self.grid.spacing)
    }

    /// d_k − |p − p_k| for the node k that is `off` from `node`; none where the ball does not fit.
    fn room_at(&self, node: [usize; 3], off: [isize; 3]) -> Option<f64> {
        let at: [usize; 3] = std::array::from_fn(|i| node[i].wrapping_add_signed(off[i]));
        let away = Vec3::from(off.map(|o| o as f64)).norm() * self.grid.spacing;
        let d = self.values[self.place(at)?];
        (d >= BALL).then_some(d - away)
    }
}
