//! Layers in the time stepper: constraints n·Σ β_k x_k ≥ h along the normals before the step.
//!
//! Finding pairs costs about as much as a few sweeps, so they are found with room to spare, and
//! found anew when the cloth has used up that room. Nothing moves farther than the room that is
//! left, and what it could meet on the way is held apart, so layers that start apart stay apart.
//! All moves are counted against the mean of all: what falls as one piece uses up no room.

use super::untangle::Piercing;
use super::{Layers, hold_apart, without_mean};
use crate::geometry::Vec3;
use crate::sim::cloth::Cloth;
use crate::sim::energy::layers::{LayerParams, Pair};
use crate::sim::step::Apart;

/// Watches over the layers of a cloth that moves.
#[derive(Clone, Debug)]
pub struct Watch {
    layers: Layers,
    pairs: Vec<Pair>,
    /// Positions for which the pairs were found \[m\].
    from: Vec<Vec3>,
    /// How far any vertex may go from there, against the mean \[m\].
    room: f64,
    /// The farthest `room` that is ever given \[m\].
    most: f64,
    /// How far the last step would have moved any vertex, against the mean \[m\]: seams that close pull from
    /// rest farther than speeds tell.
    wanted: f64,
    /// Steps until tangles are looked for again.
    countdown: usize,
    /// Edges that went through triangles before the last step.
    piercings: usize,
}

/// Room as part of the mean move of a step, so that pairs last for a few steps.
const STEPS_OF_ROOM: f64 = 4.0;
/// Part of the distance at which layers begin to feel each other to which no step brings them closer: steps
/// that press on would cut what is left to a tenth again and again, until nothing could tell that they are
/// apart. In the static solve their energy, which has no bound, keeps them from it.
pub(super) const LEAST_GAP: f64 = 1e-2;
/// Steps between looks for tangles.
const LOOK: usize = 10;
/// Farthest that a step pushes tangled layers back, in thicknesses. By half as much armpits go round in circles, now
/// more and now less tangled; by twice as much a hoody ended with cloth through cloth.
const PUSH: f64 = 1.0;

impl Watch {
    /// Watches `cloth`, now at `x` \[m\].
    pub fn new(cloth: &Cloth, params: LayerParams, x: &[Vec3]) -> Self {
        let layers = Layers::new(cloth, params, x);
        Self {
            most: layers.most_room().max(layers.thickness()),
            layers,
            pairs: Vec::new(),
            from: Vec::new(),
            room: 0.0,
            wanted: f64::INFINITY,
            countdown: LOOK,
            piercings: 0,
        }
    }

    /// Whether layers went through each other when last looked at.
    pub fn tangled(&self) -> bool {
        self.layers.tangled()
    }

    /// Whether a vertex was among them, or beside.
    pub(in crate::sim) fn is_tangled(&self, v: u32) -> bool {
        self.layers.tangled[v as usize]
    }

    /// Constraints for a step from `x` that wants to move by `wish` \[m\].
    pub(in crate::sim) fn constraints(
        &mut self,
        x: &[Vec3],
        wish: &[Vec3],
        per_time: f64,
    ) -> Vec<Apart> {
        if !self.layers.params.on {
            return Vec::new();
        }
        let mut untangling = self.untangling(x);
        self.countdown -= 1;
        // What has just come apart must not go through itself again.
        let look = self.countdown == 0 || untangling.len() < self.piercings;
        if look {
            self.countdown = LOOK;
            self.layers.find_tangles(x);
            untangling = self.untangling(x);
        }
        self.piercings = untangling.len();
        let farthest = farthest(&without_mean(wish)).max(self.wanted);
        if look || self.from.len() != x.len() || self.left(x) < farthest.min(0.25 * self.most) {
            self.room = (STEPS_OF_ROOM * farthest).min(self.most);
            let still = vec![Vec3::zeros(); x.len()];
            let reach = self.layers.thickness() + 2.0 * self.room;
            self.pairs = self.layers.search(x, &still, reach);
            self.from = x.to_vec();
        }
        let room = 2.0 * farthest.min(self.room);
        let apart = |pair: &Pair| {
            let [a, b, c, d] = pair.vertices;
            let closest = pair.closest(pair.vertices.map(|v| x[v as usize]));
            let delta = closest.r.norm();
            let [p, q, r, s] = closest.beta.map(|b| closest.r * (b / delta));
            (0.0 < delta && delta < pair.h + room).then_some(Apart {
                vertices: [a, b, c, d, d],
                gradient: [p, q, r, s, Vec3::zeros()],
                gap: pair.h,
                alpha_tilde: per_time / pair.kappa,
            })
        };
        let mut all: Vec<Apart> = self.pairs.iter().filter_map(apart).collect();
        all.extend(untangling);
        all
    }

    /// Constraints that pull layers back which go through each other at `x`.
    fn untangling(&self, x: &[Vec3]) -> Vec<Apart> {
        if !self.layers.tangled() {
            return Vec::new();
        }
        let push = PUSH * self.layers.thickness();
        let constraint = |p: Piercing| {
            let direction = p.push.try_normalize(1e-6)?;
            let gradient = p.weights.map(|w| direction * w);
            let now: f64 = (0..5)
                .map(|k| gradient[k].dot(&x[p.vertices[k] as usize]))
                .sum();
            Some(Apart {
                vertices: p.vertices,
                gradient,
                gap: now + push * p.push.norm(),
                alpha_tilde: 0.0,
            })
        };
        (self.layers.piercings(x).into_iter())
            .filter_map(constraint)
            .collect()
    }

    /// Shortens the step from `before` to `x` so that no layer passes another.
    pub(in crate::sim) fn restrain(&mut self, before: &[Vec3], x: &mut [Vec3]) {
        if !self.layers.params.on {
            return;
        }
        let left = self.left(before);
        let moves: Vec<Vec3> = x.iter().zip(before).map(|(x, b)| x - b).collect();
        let mut moves_of_own = without_mean(&moves);
        let mean = moves[0] - moves_of_own[0];
        self.wanted = farthest(&moves_of_own);
        for d in &mut moves_of_own {
            let length = d.norm();
            if length > left {
                *d *= left / length;
            }
        }
        hold_apart(&self.pairs, before, &mut moves_of_own, LEAST_GAP);
        for ((x, b), d) in x.iter_mut().zip(before).zip(moves_of_own) {
            *x = b + mean + d;
        }
    }

    /// How far any vertex may still go \[m\].
    fn left(&self, x: &[Vec3]) -> f64 {
        let gone: Vec<Vec3> = x.iter().zip(&self.from).map(|(x, f)| x - f).collect();
        (self.room - farthest(&without_mean(&gone))).max(0.0)
    }
}

/// The longest of some moves \[m\].
fn farthest(moves: &[Vec3]) -> f64 {
    moves.iter().map(Vec3::norm).fold(0.0, f64::max)
}
