//! Bending constraints in blocks of [`LANES`] hinges, and the adjoint of their visits.
//!
//! Each visit moves its four vertices by w_a k_a Δλ with Δλ = −(c + α̃λ)/(Σ w k² + α̃), c = Σ k_a x_a. A
//! hinge takes 70 flops and 90 bytes of its own (k, α̃, the quotient, λ, vertices) besides four rows read
//! and written; backwards 170 flops and 170 bytes.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::lanes::{
    Elements, Four, Four3, LANES, Lane, blocks, difference, dot, gather, scaled, scatter, sum,
};
use super::pull_back::RestHat;
use super::taped::{Taped, Undo, Visit};
use crate::sim::cloth::{Cloth, Rest};
use pulp::Simd;

/// Hinges of a part of a cloth, with one rest shape.
#[derive(Default)]
pub(super) struct Turn {
    pub(super) taped: Taped<Block>,
    pub(super) hinges: Vec<Elements>,
    dt: f64,
}

/// [`LANES`] hinges that share no vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    vertices: [[u32; LANES]; 4],
    k: [Four; 4],
    alpha_tilde: Four,
    /// 1/(Σ w k² + α̃).
    per_mass: Four,
    lambda: Four3,
}

/// Gradients by what a block has.
#[derive(Clone, Debug, Default)]
pub(super) struct Hat {
    /// By k of corners 1 to 3. Only what all of k adds up to, 0, is lost if corner 0 has none.
    k: [Four; 3],
    /// α̃ times that by α̃.
    by_alpha: Four,
    lambda: Four3,
}

impl Turn {
    /// `hinges` of a cloth, whose vertices have the places `place` in a part of `len`.
    pub(super) fn new(
        cloth: &Cloth,
        hinges: &[u32],
        place: impl Fn(u32) -> u32,
        len: usize,
        dt: f64,
    ) -> Self {
        let vertices = |e: u32| cloth.hinges[e as usize].vertices.map(&place);
        let hinges = blocks(hinges, vertices, len, |_| 0);
        let block = |elements: &Elements| {
            let at = |corner: usize| elements.map(|e| vertices(e)[corner]);
            Block {
                vertices: [at(0), at(1), at(2), at(3)],
                ..Block::default()
            }
        };
        Self {
            taped: Taped::new(hinges.iter().map(block).collect()),
            hinges,
            dt,
        }
    }

    /// Takes on a rest shape; `w` are inverse masses \[1/kg\], `[place in the part]`.
    pub(super) fn grow(&mut self, rest: &Rest, w: impl Fn(u32) -> f64) {
        for (block, elements) in self.taped.blocks.iter_mut().zip(&self.hinges) {
            let alpha_tilde = |e: u32| {
                let stiffness = rest.hinges[e as usize].stiffness;
                1.0 / (stiffness * self.dt * self.dt)
            };
            block.alpha_tilde = Four(elements.map(alpha_tilde));
            // Lanes left over have no k: nothing moves.
            let mut mass = block.alpha_tilde.0;
            for (l, e) in elements.each() {
                let vertices = block.vertices.map(|v| v[l]);
                let k = merged(vertices, rest.hinges[e].k);
                for (corner, k) in k.into_iter().enumerate() {
                    mass[l] += w(vertices[corner]) * k * k;
                    block.k[corner].0[l] = k;
                }
            }
            block.per_mass = Four(mass.map(|m| 1.0 / m));
        }
    }

    /// Adds the gradients by the rest shape to `all`, and forgets them.
    pub(super) fn hand_over(&mut self, rest: &Rest, all: &mut RestHat) {
        let blocks = self.taped.blocks.iter().zip(self.taped.hats.drain(..));
        for ((block, hat), elements) in blocks.zip(&self.hinges) {
            for (l, e) in elements.each() {
                let vertices = block.vertices.map(|v| v[l]);
                for corner in 0..4 {
                    if let Some(from) = first_of(vertices, corner).checked_sub(1) {
                        all.k[e][corner] += hat.k[from].0[l];
                    }
                }
                // α̃ = Δt⁻²/stiffness.
                all.stiffness[e] -= hat.by_alpha.0[l] / rest.hinges[e].stiffness;
            }
        }
    }
}

/// The first corner at the same vertex: the corners opposite to a seam may be one.
fn first_of(vertices: [u32; 4], corner: usize) -> usize {
    (0..corner)
        .find(|c| vertices[*c] == vertices[corner])
        .unwrap_or(corner)
}

/// k with all of a vertex at the first of its corners.
fn merged(vertices: [u32; 4], k: [f64; 4]) -> [f64; 4] {
    let mut merged = [0.0; 4];
    for corner in 0..4 {
        merged[first_of(vertices, corner)] += k[corner];
    }
    merged
}

impl Visit for Block {
    #[inline(always)]
    fn visit<S: Simd>(
        &mut self,
        simd: S,
        part: usize,
        rows: &mut [Four],
        first: bool,
        visit: &mut Four3,
    ) {
        let at = [
            gather(simd, rows, &self.vertices[0], part),
            gather(simd, rows, &self.vertices[1], part),
            gather(simd, rows, &self.vertices[2], part),
            gather(simd, rows, &self.vertices[3], part),
        ];
        let k = [
            Lane::load(simd, &self.k[0], part),
            Lane::load(simd, &self.k[1], part),
            Lane::load(simd, &self.k[2], part),
            Lane::load(simd, &self.k[3], part),
        ];
        let c = sum(
            sum(scaled(at[0].0, k[0]), scaled(at[1].0, k[1])),
            sum(scaled(at[2].0, k[2]), scaled(at[3].0, k[3])),
        );
        let lambda = if first {
            [Lane::all(simd, 0.0); 3]
        } else {
            Lane::load3(simd, &self.lambda, part)
        };
        let right = sum(c, scaled(lambda, Lane::load(simd, &self.alpha_tilde, part)));
        let delta = scaled(right, -Lane::load(simd, &self.per_mass, part));
        for c in 0..3 {
            (lambda[c] + delta[c]).store(&mut self.lambda[c], part);
            delta[c].store(&mut visit[c], part);
        }
        // Backwards: what the first corner at a vertex stores is what stays.
        for corner in 0..4 {
            let corner = 3 - corner;
            let (p, w) = at[corner];
            let p = sum(p, scaled(delta, k[corner] * w));
            scatter(rows, &self.vertices[corner], part, (p, w));
        }
    }
}

impl Undo for Block {
    type Hat = Hat;

    #[inline(always)]
    fn undo<S: Simd>(
        &mut self,
        simd: S,
        part: usize,
        visit: &Four3,
        hat: &mut Hat,
        rows: &mut [Four],
        hats: &mut [Four],
        last: bool,
    ) {
        let k = [
            Lane::load(simd, &self.k[0], part),
            Lane::load(simd, &self.k[1], part),
            Lane::load(simd, &self.k[2], part),
            Lane::load(simd, &self.k[3], part),
        ];
        let mut at = [
            gather(simd, rows, &self.vertices[0], part),
            gather(simd, rows, &self.vertices[1], part),
            gather(simd, rows, &self.vertices[2], part),
            gather(simd, rows, &self.vertices[3], part),
        ];
        let mut at_hat = [
            gather(simd, hats, &self.vertices[0], part),
            gather(simd, hats, &self.vertices[1], part),
            gather(simd, hats, &self.vertices[2], part),
            gather(simd, hats, &self.vertices[3], part),
        ];
        let delta = Lane::load3(simd, visit, part);
        let lambda_hat = if last {
            [Lane::all(simd, 0.0); 3]
        } else {
            Lane::load3(simd, &hat.lambda, part)
        };
        let mut delta_hat = lambda_hat;
        for corner in 0..4 {
            let by = at[corner].1 * k[corner];
            delta_hat = sum(delta_hat, scaled(at_hat[corner].0, by));
        }
        let right_hat = scaled(delta_hat, Lane::load(simd, &self.per_mass, part));
        let alpha_tilde = Lane::load(simd, &self.alpha_tilde, part);
        let answered = difference(lambda_hat, scaled(right_hat, alpha_tilde));
        for c in 0..3 {
            answered[c].store(&mut hat.lambda[c], part);
        }
        // Both from the mass and from the right side.
        let by_mass = -dot(right_hat, delta);
        // The visit left c = −α̃λ.
        let mut by_alpha = Lane::all(simd, 0.0);
        let mut by_first = by_alpha;
        for corner in 0..4 {
            let ((p, w), (p_hat, w_hat), k) = (at[corner], at_hat[corner], k[corner]);
            let turned = dot(right_hat, p);
            by_alpha = by_alpha + k * turned;
            let lost = dot(delta, p_hat) + by_mass * k;
            let by_k = w * lost - turned;
            if corner == 0 {
                by_first = by_k;
            } else {
                (by_k - by_first).add_to(&mut hat.k[corner - 1], part);
            }
            let p_hat = difference(p_hat, scaled(right_hat, k));
            at[corner] = (difference(p, scaled(delta, w * k)), w);
            at_hat[corner] = (p_hat, w_hat + k * lost);
        }
        by_alpha.add_to(&mut hat.by_alpha, part);
        // Backwards: what the first corner at a vertex stores is what stays.
        for corner in 0..4 {
            let corner = 3 - corner;
            scatter(rows, &self.vertices[corner], part, at[corner]);
            scatter(hats, &self.vertices[corner], part, at_hat[corner]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use crate::geometry::Vec3;
    use crate::sim::cloth::fixtures::{SOFT, tube};
    use crate::sim::step::lanes::{of_lane, row};

    #[test]
    fn lanes_do_what_the_constraint_says() {
        let mesh = tube(11, 5, 0.05);
        let mut cloth = Cloth::new(&mesh, &SOFT);
        // The corners opposite to a seam may be one vertex.
        cloth.hinges[7].vertices[3] = cloth.hinges[7].vertices[2];
        let rest = cloth.at_rest(&mesh.x_bar);
        let w: Vec<f64> = rest.mass.iter().map(|m| 1.0 / m).collect();
        let (dt, count) = (0.01, cloth.vertex_count);
        let mut x: Vec<Vec3> = (0..count)
            .map(|i| Vec3::from_fn(|c, _| 0.3 * noise(3 * i + c)))
            .collect();
        let mut rows: Vec<Four> = x.iter().zip(&w).map(|(x, w)| row(*x, *w)).collect();
        let all: Vec<u32> = (0..cloth.hinges.len() as u32).collect();
        let mut turn = Turn::new(&cloth, &all, |v| v, count, dt);
        turn.grow(&rest, |v| w[v as usize]);
        let mut lambda = vec![Vec3::zeros(); all.len()];
        for sweep in 0..3 {
            turn.taped.sweep(&mut rows, sweep == 0, true);
            for (_, e) in turn.hinges.iter().flat_map(Elements::each) {
                let (hinge, vertices) = (&rest.hinges[e], cloth.hinges[e].vertices);
                let alpha_tilde = 1.0 / (hinge.stiffness * dt * dt);
                let c = hinge.curvature_vector(vertices.map(|a| x[a as usize]));
                // ∂c/∂x of a vertex is the sum over its corners.
                let mut by_vertex = std::collections::BTreeMap::new();
                for (a, k) in vertices.iter().zip(hinge.k) {
                    *by_vertex.entry(*a as usize).or_insert(0.0) += k;
                }
                let mass: f64 = by_vertex.iter().map(|(a, k)| w[*a] * k * k).sum();
                let delta = -(c + lambda[e] * alpha_tilde) / (mass + alpha_tilde);
                lambda[e] += delta;
                for (a, k) in by_vertex {
                    x[a] += delta * (w[a] * k);
                }
            }
        }
        assert_eq!(turn.taped.tape.len(), 3 * turn.taped.blocks.len());
        for (row, x) in rows.iter().zip(&x) {
            assert!((row.vector() - x).norm() < 1e-12, "{row:?} {x:?}");
        }
        for (block, elements) in turn.taped.blocks.iter().zip(&turn.hinges) {
            for (l, e) in elements.each() {
                let off = of_lane(&block.lambda, l) - lambda[e];
                assert!(off.norm() < 1e-9 * lambda[e].norm().max(1e-9));
            }
        }
    }
}
