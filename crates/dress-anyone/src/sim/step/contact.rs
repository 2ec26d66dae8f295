//! Contact with the body in a time step, in blocks of [`LANES`] contact points, and its adjoint.
//!
//! Once a step the distance d of each point p is taken as the plane c = ∇d·x − (∇d·p − d + h) through
//! its place before the step, p = Σ s x being made up of one to three corners. Each visit to it is
//! one-sided: λ ← max(0, λ − (c + α̃λ)/(W |∇d|² + α̃)), W = Σ s² w, and the corners move by the difference.
//! A point takes 20 flops and 20 for each corner, and 60 bytes of its own and 12 for each corner besides
//! the rows read and written; points that are far from the body are not visited.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::lanes::{
    Elements, Four, Four3, LANES, Lane, Walk, blocks, difference, dot, gather, of_lane, parts,
    scaled, scatter, sum, walk,
};
use crate::geometry::Vec3;
use crate::sim::cloth::Cloth;
use crate::sim::energy::contact::{ContactParams, Surface};
use pulp::Simd;
use rayon::prelude::*;

/// Contact points of a part of a cloth: vertices, points of sides, points within triangles.
#[derive(Default)]
pub(super) struct Contacts {
    vertices: Points<1>,
    sides: Points<2>,
    inner: Points<3>,
}

/// What a step looks at to find contact.
pub(super) struct Look<'a, S> {
    pub(super) surface: &'a S,
    pub(super) params: &'a ContactParams,
    /// Distance from the body up to which points are looked at \[m\].
    pub(super) reach: f64,
    /// Positions before the step, `[place]`.
    pub(super) rows: &'a [Four],
    /// How far each vertex may sink in beyond the thickness \[m\], `[place]`.
    pub(super) sinks: &'a [f64],
}

impl<S> Clone for Look<'_, S> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<S> Copy for Look<'_, S> {}

impl<S> Look<'_, S> {
    /// The same for the first `len` places, and for the others.
    pub(super) fn split_at(self, len: usize) -> [Self; 2] {
        let ((low, high), (low_sinks, high_sinks)) =
            (self.rows.split_at(len), self.sinks.split_at(len));
        [(low, low_sinks), (high, high_sinks)].map(|(rows, sinks)| Self {
            rows,
            sinks,
            ..self
        })
    }
}

/// Contact points of `N` corners each.
#[derive(Default)]
pub(super) struct Points<const N: usize> {
    pub(super) blocks: Vec<Block<N>>,
    pub(super) elements: Vec<Elements>,
    /// Blocks of which some point is near the body.
    pub(super) near: Vec<usize>,
    /// λ after every visit that was recorded, as it goes on over the sweeps of a step.
    tape: Vec<Four>,
    /// Of each block that is near.
    pub(super) hats: Vec<Hat>,
    /// How far friction drew the points of each such block back \[m\].
    pub(super) rubbed: Vec<Four3>,
}

/// [`LANES`] points that share no corner.
#[derive(Clone, Debug)]
pub(super) struct Block<const N: usize> {
    pub(super) corners: [[u32; LANES]; N],
    /// s of each corner.
    pub(super) shares: [Four; N],
    alpha_tilde: Four,
    /// Coulomb's coefficient \[–\].
    pub(super) mu: Four,
    /// ∂c/∂p: of length one but for the smoothing of the distance; 0 where nothing is near.
    pub(super) normal: Four3,
    /// By how much ∇d was lengthened for it: more than 1 in creases.
    raised: Four,
    /// c = normal·x − offset.
    offset: Four,
    /// 1/(W |∇d|² + α̃).
    per_mass: Four,
    pub(super) lambda: Four,
}

/// Gradients by what a block has.
#[derive(Clone, Debug, Default)]
pub(super) struct Hat {
    pub(super) normal: Four3,
    offset: Four,
    pub(super) lambda: Four,
}

/// Blocks that a thread looks at in one go at least.
const LOOKS: usize = 64;
/// Slope of the distance below which it is that of a crease deep in the body \[–\].
const CREASE: f64 = 0.5;

/// The gradient of the distance as the contact takes it, and by how much it was lengthened: as it
/// is, so that the rest state is that of the energy; made a unit vector in creases, where it fades; none
/// where there is no direction.
fn slope(gradient: Vec3) -> Option<(Vec3, f64)> {
    let length = gradient.norm();
    if length > CREASE {
        Some((gradient, 1.0))
    } else {
        Some((gradient.try_normalize(1e-3)?, 1.0 / length))
    }
}

impl Contacts {
    /// Contact `points` of a cloth, whose vertices have the places `place` in a part of `len`.
    pub(super) fn new(
        cloth: &Cloth,
        points: &[u32],
        place: impl Fn(u32) -> u32,
        len: usize,
        params: &ContactParams,
        dt: f64,
    ) -> Self {
        Self {
            vertices: Points::new(cloth, points, &place, len, params, dt),
            sides: Points::new(cloth, points, &place, len, params, dt),
            inner: Points::new(cloth, points, &place, len, params, dt),
        }
    }

    /// Takes the planes of all points that are close enough to the body: a point outside thin parts (toes,
    /// fingers) then stays on its side of them. Forgets what was recorded.
    pub(super) fn look(&mut self, look: Look<'_, impl Surface>) {
        self.vertices.look(look);
        self.sides.look(look);
        self.inner.look(look);
    }

    /// Visits every point that is near once.
    pub(super) fn sweep(&mut self, rows: &mut [Four], record: bool) {
        self.vertices.sweep(rows, record);
        self.sides.sweep(rows, record);
        self.inner.sweep(rows, record);
    }

    /// Draws back what the body carries.
    pub(super) fn rub(&mut self, before: &[Four], rows: &mut [Four]) {
        self.vertices.rub(before, rows);
        self.sides.rub(before, rows);
        self.inner.rub(before, rows);
    }

    /// Undoes [`Self::rub`] on `rows`, and hands the gradients `hats` on.
    pub(super) fn pull_back_rub(
        &mut self,
        before: &[Four],
        rows: &mut [Four],
        hats: &mut [Four],
        before_hat: &mut [Four],
    ) {
        (self.inner).pull_back_rub(before, rows, hats, before_hat);
        (self.sides).pull_back_rub(before, rows, hats, before_hat);
        (self.vertices).pull_back_rub(before, rows, hats, before_hat);
    }

    /// Walks back through the last sweep that was recorded.
    pub(super) fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four]) {
        self.inner.pull_back(rows, hats);
        self.sides.pull_back(rows, hats);
        self.vertices.pull_back(rows, hats);
    }

    /// Through the planes, to the positions `before` the step.
    pub(super) fn pull_back_look(
        &self,
        surface: &impl Surface,
        before: &[Four],
        before_hat: &mut [Four],
    ) {
        self.vertices.pull_back_look(surface, before, before_hat);
        self.sides.pull_back_look(surface, before, before_hat);
        self.inner.pull_back_look(surface, before, before_hat);
    }
}

impl<const N: usize> Points<N> {
    /// Those of `points` that have `N` corners.
    fn new(
        cloth: &Cloth,
        points: &[u32],
        place: impl Fn(u32) -> u32,
        len: usize,
        params: &ContactParams,
        dt: f64,
    ) -> Self {
        let point = |e: u32| &cloth.contacts[e as usize];
        let of_n = |e: &u32| point(*e).parts().count() == N;
        let points: Vec<u32> = points.iter().copied().filter(of_n).collect();
        let part = |e: u32, k: usize| point(e).parts().nth(k).expect("N of them");
        let corners = |e: u32| std::array::from_fn(|k| place(part(e, k).0 as u32));
        let elements = blocks::<N>(&points, corners, len, |_| 0);
        let block = |elements: &Elements| {
            let alpha_tilde = |e: u32| 1.0 / (params.stiffness * point(e).area * dt * dt);
            let mu = |e: u32| params.friction.or(point(e).friction);
            Block {
                corners: std::array::from_fn(|k| elements.map(|e| corners(e)[k])),
                shares: std::array::from_fn(|k| Four(elements.map(|e| part(e, k).1))),
                alpha_tilde: Four(elements.map(alpha_tilde)),
                mu: Four(elements.map(mu)),
                normal: Four3::default(),
                raised: Four::default(),
                offset: Four::default(),
                per_mass: Four::default(),
                lambda: Four::default(),
            }
        };
        Self {
            blocks: elements.iter().map(block).collect(),
            elements,
            ..Self::default()
        }
    }

    fn look(&mut self, look: Look<'_, impl Surface>) {
        self.tape.clear();
        let blocks = self.blocks.par_iter_mut().zip(&self.elements);
        let blocks = blocks.enumerate().with_min_len(LOOKS);
        let near = blocks.filter_map(|(i, (block, points))| block.look(points, look).then_some(i));
        self.near = near.collect();
        self.rubbed.clear();
        self.hats.clear();
        self.hats.resize(self.near.len(), Hat::default());
    }

    fn sweep(&mut self, rows: &mut [Four], record: bool) {
        walk(Sweep {
            rows,
            blocks: &mut self.blocks,
            near: &self.near,
            tape: record.then_some(&mut self.tape),
        });
    }

    fn pull_back(&mut self, rows: &mut [Four], hats: &mut [Four]) {
        let visits = self.tape.len() - self.near.len();
        self.tape.truncate(visits);
        let first = visits.saturating_sub(self.near.len());
        walk(PullBack {
            rows,
            hats,
            blocks: &mut self.blocks,
            near: &self.near,
            own: &mut self.hats,
            before: &self.tape[first..],
        });
    }

    fn pull_back_look(&self, surface: &impl Surface, before: &[Four], before_hat: &mut [Four]) {
        for (&i, hat) in self.near.iter().zip(&self.hats) {
            let block = &self.blocks[i];
            for (l, _) in self.elements[i].each() {
                let (n_hat, offset_hat) = (of_lane(&hat.normal, l), hat.offset.0[l]);
                if offset_hat == 0.0 && n_hat == Vec3::zeros() {
                    continue;
                }
                let p = block.point(l, before);
                let (normal, raised) = (of_lane(&block.normal, l), block.raised.0[l]);
                let n_hat = n_hat + p * offset_hat;
                let (mut by_gradient, mut p_hat) = (n_hat, Vec3::zeros());
                if raised > 1.0 {
                    by_gradient = (n_hat - normal * normal.dot(&n_hat)) * raised;
                    p_hat = normal * (offset_hat * (1.0 - 1.0 / raised));
                }
                p_hat += surface.curvature(p) * by_gradient;
                for (a, share) in block.corners_of(l) {
                    before_hat[a].shift(p_hat * share);
                }
            }
        }
    }
}

impl<const N: usize> Block<N> {
    /// Takes the planes of its points, and tells whether any is near.
    fn look(&mut self, points: &Elements, look: Look<'_, impl Surface>) -> bool {
        let mut planes = [None; LANES];
        for (l, _) in points.each() {
            let p = self.point(l, look.rows);
            let found = look.surface.distance_below(p, look.reach);
            let shares = self.corners_of(l).into_iter();
            let sinks: f64 = shares.map(|(a, share)| look.sinks[a] * share).sum();
            let least = look.params.thickness - sinks;
            planes[l] = found.ok().and_then(|(d, gradient)| {
                let (normal, raised) = slope(gradient)?;
                Some((normal, raised, normal.dot(&p) - (d - least)))
            });
        }
        let is_near = planes.iter().any(Option::is_some);
        if is_near {
            for (l, plane) in planes.into_iter().enumerate() {
                // What is nowhere near, and lanes left over, never push: c = 1.
                let nowhere = (Vec3::zeros(), 1.0, -1.0);
                self.set(l, plane.unwrap_or(nowhere), look.rows);
            }
        }
        is_near
    }

    /// The corners of point `l`, with their shares.
    pub(super) fn corners_of(&self, l: usize) -> [(usize, f64); N] {
        std::array::from_fn(|k| (self.corners[k][l] as usize, self.shares[k].0[l]))
    }

    /// Point `l` \[m\].
    pub(super) fn point(&self, l: usize, rows: &[Four]) -> Vec3 {
        let corners = self.corners_of(l).into_iter();
        corners.map(|(a, share)| rows[a].vector() * share).sum()
    }

    /// Inverse mass W of point `l` \[1/kg\].
    pub(super) fn inverse_mass(&self, l: usize, rows: &[Four]) -> f64 {
        let corners = self.corners_of(l).into_iter();
        corners.map(|(a, share)| share * share * rows[a].0[3]).sum()
    }

    fn set(&mut self, l: usize, (normal, raised, offset): (Vec3, f64, f64), rows: &[Four]) {
        self.raised.0[l] = raised;
        for (lanes, n) in self.normal.iter_mut().zip(normal.iter()) {
            lanes.0[l] = *n;
        }
        self.offset.0[l] = offset;
        let mass = self.inverse_mass(l, rows) * normal.norm_squared();
        self.per_mass.0[l] = 1.0 / (mass + self.alpha_tilde.0[l]);
        self.lambda.0[l] = 0.0;
    }
}

struct Sweep<'a, const N: usize> {
    rows: &'a mut [Four],
    blocks: &'a mut [Block<N>],
    near: &'a [usize],
    tape: Option<&'a mut Vec<Four>>,
}

impl<const N: usize> Walk for Sweep<'_, N> {
    #[inline(always)]
    fn walk<S: Simd>(mut self, simd: S) {
        for &i in self.near {
            let block = &mut self.blocks[i];
            for part in 0..parts::<S>() {
                block.visit(simd, part, self.rows);
            }
            if let Some(tape) = &mut self.tape {
                tape.push(block.lambda);
            }
        }
    }
}

struct PullBack<'a, const N: usize> {
    rows: &'a mut [Four],
    hats: &'a mut [Four],
    blocks: &'a mut [Block<N>],
    near: &'a [usize],
    own: &'a mut [Hat],
    /// λ before the visits; none in the first sweep of a step.
    before: &'a [Four],
}

impl<const N: usize> Walk for PullBack<'_, N> {
    #[inline(always)]
    fn walk<S: Simd>(self, simd: S) {
        for (n, &i) in self.near.iter().enumerate().rev() {
            let before = self.before.get(n).copied().unwrap_or_default();
            for part in 0..parts::<S>() {
                self.blocks[i].pull_back(
                    simd,
                    part,
                    &before,
                    &mut self.own[n],
                    self.rows,
                    self.hats,
                );
            }
        }
    }
}

impl<const N: usize> Block<N> {
    #[inline(always)]
    fn visit<S: Simd>(&mut self, simd: S, part: usize, rows: &mut [Four]) {
        let zero = Lane::all(simd, 0.0);
        let mut at = [([zero; 3], zero); N];
        let mut point = [zero; 3];
        for k in 0..N {
            at[k] = gather(simd, rows, &self.corners[k], part);
            let share = Lane::load(simd, &self.shares[k], part);
            point = sum(point, scaled(at[k].0, share));
        }
        let normal = Lane::load3(simd, &self.normal, part);
        let lambda = Lane::load(simd, &self.lambda, part);
        let alpha_tilde = Lane::load(simd, &self.alpha_tilde, part);
        let per_mass = Lane::load(simd, &self.per_mass, part);
        let c = dot(normal, point) - Lane::load(simd, &self.offset, part);
        let wanted = lambda - (c + alpha_tilde * lambda) * per_mass;
        let after = wanted.where_positive(wanted);
        after.store(&mut self.lambda, part);
        let delta = after - lambda;
        for k in 0..N {
            let (p, w) = at[k];
            let by = Lane::load(simd, &self.shares[k], part) * w * delta;
            let p = sum(p, scaled(normal, by));
            scatter(rows, &self.corners[k], part, (p, w));
        }
    }

    #[inline(always)]
    fn pull_back<S: Simd>(
        &mut self,
        simd: S,
        part: usize,
        before: &Four,
        hat: &mut Hat,
        rows: &mut [Four],
        hats: &mut [Four],
    ) {
        let normal = Lane::load3(simd, &self.normal, part);
        let after = Lane::load(simd, &self.lambda, part);
        let before = Lane::load(simd, before, part);
        before.store(&mut self.lambda, part);
        let delta = after - before;

        // Undo the visit; x̂ along and by the normal.
        let zero = Lane::all(simd, 0.0);
        let mut at_hat = [([zero; 3], zero); N];
        let (mut along, mut delta_hat, mut inverse_mass) = ([zero; N], zero, zero);
        let (mut point, mut normal_hat) = ([zero; 3], [zero; 3]);
        for k in 0..N {
            let (p, w) = gather(simd, rows, &self.corners[k], part);
            at_hat[k] = gather(simd, hats, &self.corners[k], part);
            let share = Lane::load(simd, &self.shares[k], part);
            let by = share * w;
            let p = difference(p, scaled(normal, by * delta));
            scatter(rows, &self.corners[k], part, (p, w));
            point = sum(point, scaled(p, share));
            inverse_mass = inverse_mass + share * by;
            along[k] = share * dot(normal, at_hat[k].0);
            delta_hat = delta_hat + w * along[k];
            normal_hat = sum(normal_hat, scaled(at_hat[k].0, by * delta));
        }

        // Only what still pushes answers to where it was.
        let alpha_tilde = Lane::load(simd, &self.alpha_tilde, part);
        let after_hat = Lane::load(simd, &hat.lambda, part) + delta_hat;
        let after_hat = after_hat.where_positive(after);
        let right_hat = after_hat * Lane::load(simd, &self.per_mass, part);
        (after_hat - alpha_tilde * right_hat - delta_hat).store(&mut hat.lambda, part);
        right_hat.add_to(&mut hat.offset, part);
        let by_mass = right_hat * delta;
        let turned = by_mass * (inverse_mass + inverse_mass);
        for c in 0..3 {
            let by_normal = normal_hat[c] - point[c] * right_hat - normal[c] * turned;
            by_normal.add_to(&mut hat.normal[c], part);
        }
        let lost = by_mass * dot(normal, normal);
        for k in 0..N {
            let share = Lane::load(simd, &self.shares[k], part);
            let (p_hat, w_hat) = at_hat[k];
            let w_hat = w_hat + (along[k] * delta - share * share * lost);
            let p_hat = difference(p_hat, scaled(normal, share * right_hat));
            scatter(hats, &self.corners[k], part, (p_hat, w_hat));
        }
    }
}
