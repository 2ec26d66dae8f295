//! Bending constraints swept by colours, [`LANES`] hinges at a time.
//!
//! Each visit moves its four vertices by w_a k_a Δλ with Δλ = −(c + α̃λ)/(Σ w k² + α̃), c = Σ k_a x_a. A
//! hinge takes 60 flops and 120 bytes of its own (k, w k, α̃, the quotient, λ, vertices) besides four
//! positions read and written.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::lanes::{LANES, Lane, Lane3, blocks, gather, in_place, of_lane, scaled, scatter, sum};
use crate::geometry::Vec3;
use crate::sim::cloth::{Cloth, Rest};

/// The hinges of a cloth by colours, with one rest shape.
pub(super) struct Turn {
    blocks: Vec<Block>,
    /// Hinges in the order of their visits.
    order: Vec<u32>,
}

/// [`LANES`] hinges that share no vertex.
#[derive(Clone, Debug, Default)]
struct Block {
    hinges: [u32; LANES],
    vertices: [[u32; LANES]; 4],
    /// How many of them count; the others repeat the first.
    count: usize,
    k: [Lane; 4],
    wk: [Lane; 4],
    alpha_tilde: Lane,
    /// 1/(Σ w k² + α̃).
    per_mass: Lane,
    lambda: Lane3,
}

impl Turn {
    pub(super) fn new(cloth: &Cloth, rest: &Rest, w: &[f64], dt: f64) -> Self {
        let vertices: Vec<[u32; 4]> = cloth.hinges.iter().map(|h| h.vertices).collect();
        let block = |(hinges, count): ([u32; LANES], usize)| {
            let at = |corner: usize| hinges.map(|e| vertices[e as usize][corner]);
            Block {
                hinges,
                count,
                vertices: [at(0), at(1), at(2), at(3)],
                ..Block::default()
            }
        };
        let blocks: Vec<Block> = blocks(&vertices, cloth.vertex_count, |_| 0)
            .into_iter()
            .map(block)
            .collect();
        let live = |block: &Block| block.hinges.into_iter().take(block.count);
        let mut turn = Self {
            order: blocks.iter().flat_map(live).collect(),
            blocks,
        };
        turn.grow(rest, w, dt);
        turn
    }

    /// Takes on another rest shape; `w` are inverse masses \[1/kg\].
    pub(super) fn grow(&mut self, rest: &Rest, w: &[f64], dt: f64) {
        for block in &mut self.blocks {
            for l in 0..LANES {
                let hinge = &rest.hinges[block.hinges[l] as usize];
                let alpha_tilde = 1.0 / (hinge.stiffness * dt * dt);
                let mut mass = alpha_tilde;
                for (corner, k) in hinge.k.into_iter().enumerate() {
                    let w = w[block.vertices[corner][l] as usize];
                    mass += w * k * k;
                    (block.k[corner].0[l], block.wk[corner].0[l]) = (k, w * k);
                }
                (block.alpha_tilde.0[l], block.per_mass.0[l]) = (alpha_tilde, 1.0 / mass);
            }
        }
    }

    /// Hinges in the order of their visits.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Forgets all λ.
    pub(super) fn reset(&mut self) {
        for block in &mut self.blocks {
            block.lambda = Lane3::default();
        }
    }

    /// λ of each hinge.
    pub(super) fn lambda(&self) -> Vec<Vec3> {
        let lanes = self.blocks.iter().map(|b| (b.lambda, &b.hinges[..b.count]));
        in_place(self.order.len(), lanes)
    }

    /// Visits every hinge once, and notes Δλ on `tape`.
    pub(super) fn sweep(&mut self, x: &mut [Vec3], mut tape: Option<&mut Vec<Vec3>>) {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                for block in &mut self.blocks {
                    let delta = block.visit(x);
                    if let Some(tape) = &mut tape {
                        tape.extend((0..block.count).map(|l| of_lane(delta, l)));
                    }
                }
            },
        );
    }
}

impl Block {
    #[inline(always)]
    fn visit(&mut self, x: &mut [Vec3]) -> Lane3 {
        let [p, q, r, s] = [
            scaled(gather(x, &self.vertices[0]), self.k[0]),
            scaled(gather(x, &self.vertices[1]), self.k[1]),
            scaled(gather(x, &self.vertices[2]), self.k[2]),
            scaled(gather(x, &self.vertices[3]), self.k[3]),
        ];
        let c = sum(sum(p, q), sum(r, s));
        let right = sum(c, scaled(self.lambda, self.alpha_tilde));
        let delta = scaled(right, -self.per_mass);
        self.lambda = sum(self.lambda, delta);
        for corner in 0..4 {
            let push = scaled(delta, self.wk[corner]);
            scatter(x, &self.vertices[corner], self.count, push);
        }
        delta
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use crate::sim::cloth::fixtures::{SOFT, tube};

    #[test]
    fn lanes_do_what_the_constraint_says() {
        let mesh = tube(11, 5, 0.05);
        let mut cloth = Cloth::new(&mesh, &SOFT);
        // The corners opposite to a seam may be one vertex.
        cloth.hinges[7].vertices[3] = cloth.hinges[7].vertices[2];
        let rest = cloth.at_rest(&mesh.x_bar);
        let w: Vec<f64> = rest.mass.iter().map(|m| 1.0 / m).collect();
        let dt = 0.01;
        let mut x: Vec<Vec3> = (0..cloth.vertex_count)
            .map(|i| Vec3::from_fn(|c, _| 0.3 * noise(3 * i + c)))
            .collect();
        let mut expected = x.clone();
        let mut turn = Turn::new(&cloth, &rest, &w, dt);
        let mut lambda = vec![Vec3::zeros(); cloth.hinges.len()];
        let mut tape = Vec::new();
        for _ in 0..3 {
            turn.sweep(&mut x, Some(&mut tape));
            for e in turn.order().iter().map(|e| *e as usize) {
                let (hinge, vertices) = (&rest.hinges[e], cloth.hinges[e].vertices);
                let alpha_tilde = 1.0 / (hinge.stiffness * dt * dt);
                let c = hinge.curvature_vector(vertices.map(|a| expected[a as usize]));
                let each = vertices.iter().zip(hinge.k);
                let mass: f64 = each.map(|(a, k)| w[*a as usize] * k * k).sum();
                let delta = -(c + lambda[e] * alpha_tilde) / (mass + alpha_tilde);
                lambda[e] += delta;
                for (a, k) in vertices.iter().zip(hinge.k) {
                    expected[*a as usize] += delta * (w[*a as usize] * k);
                }
            }
        }
        assert_eq!(tape.len(), 3 * cloth.hinges.len());
        for (x, expected) in x.iter().zip(&expected) {
            assert!((x - expected).norm() < 1e-12, "{x:?} {expected:?}");
        }
        for (own, expected) in turn.lambda().iter().zip(&lambda) {
            assert!((own - expected).norm() < 1e-9 * expected.norm().max(1e-9));
        }
    }
}
