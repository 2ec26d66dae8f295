//! Membrane constraints in blocks of [`LANES`] triangles, and the adjoint of their visits.
//!
//! Each visit is that of [`crate::sim::energy::membrane`]'s constraint form: (∇C M⁻¹ ∇Cᵀ + α̃) Δλ =
//! −C − α̃λ, corner a moves by w_a F S(Δλ) b_a, with S(y) = [[y₀, y₂], [y₂, y₁]]. A triangle takes 200
//! flops, 3 divisions among them, and 90 bytes of its own (D_m⁻¹, 1/Ā, λ, corners) besides three rows
//! read and written; backwards 640 flops and 200 bytes.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

mod back;

use super::lanes::{
    Elements, Four, Four3, LANES, Lane, Lane3, blocks, difference, dot, gather, scaled, scatter,
    sum,
};
use super::pull_back::RestHat;
use super::taped::{Taped, Visit};
use crate::geometry::Mat2;
use crate::sim::cloth::{Cloth, Rest};
use crate::sim::energy::membrane::Elasticity;
use pulp::Simd;

/// Triangles of a part of a cloth, with one rest shape.
#[derive(Default)]
pub(super) struct Stretch {
    pub(super) taped: Taped<Block>,
    pub(super) triangles: Vec<Elements>,
}

/// [`LANES`] triangles of one material that share no vertex.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    corners: [[u32; LANES]; 3],
    /// Compliance 𝔻⁻¹ Δt⁻² per rest area: weft, coupling, warp, shear.
    compliance: [f64; 4],
    /// Hat functions b of corners 1 and 2: u and v of the one, then of the other.
    b: [Four; 4],
    per_area: Four,
    lambda: Four3,
}

impl Stretch {
    /// `triangles` of a cloth, whose vertices have the places `place` in a part of `len`.
    pub(super) fn new(
        cloth: &Cloth,
        triangles: &[u32],
        place: impl Fn(u32) -> u32,
        len: usize,
        dt: f64,
    ) -> Self {
        let corners = |e: u32| cloth.triangles[e as usize].map(&place);
        let material = |e: u32| cloth.material_of[e as usize];
        let triangles = blocks(triangles, corners, len, material);
        let block = |elements: &Elements| {
            let at = |corner: usize| elements.map(|e| corners(e)[corner]);
            let [material, ..] = elements.map(|e| cloth.material(e as usize));
            Block {
                corners: [at(0), at(1), at(2)],
                compliance: compliance(&material.elasticity, dt),
                ..Block::default()
            }
        };
        Self {
            taped: Taped::new(triangles.iter().map(block).collect()),
            triangles,
        }
    }

    /// Takes on a rest shape.
    pub(super) fn grow(&mut self, rest: &Rest) {
        for (block, elements) in self.taped.blocks.iter_mut().zip(&self.triangles) {
            // Lanes left over have no b: nothing moves.
            let per_area = |e: u32| 1.0 / rest.triangles[e as usize].area;
            block.per_area = Four(elements.map(per_area));
            for (l, e) in elements.each() {
                let [_, b1, b2] = rest.triangles[e].gradients();
                for (lanes, b) in block.b.iter_mut().zip([b1.x, b1.y, b2.x, b2.y]) {
                    lanes.0[l] = b;
                }
            }
        }
    }

    /// Adds the gradients by the rest shape to `all`, and forgets them.
    pub(super) fn hand_over(&mut self, all: &mut RestHat) {
        for (hat, elements) in self.taped.hats.drain(..).zip(&self.triangles) {
            for (l, e) in elements.each() {
                let [a, b, c, d] = hat.b.map(|lanes| lanes.0[l]);
                all.inverse[e] += Mat2::new(a, b, c, d);
                all.area[e] += hat.area.0[l];
            }
        }
    }
}

/// 𝔻⁻¹ Δt⁻²: weft, coupling, warp, shear.
fn compliance(d: &Elasticity, dt: f64) -> [f64; 4] {
    let determinant = d.weft * d.warp - d.coupling * d.coupling;
    let entries = [
        d.warp / determinant,
        -d.coupling / determinant,
        d.weft / determinant,
        1.0 / d.shear,
    ];
    entries.map(|c| c / (dt * dt))
}

/// A symmetric matrix of each triangle: 00, 10, 11.
type Symmetric<S> = [Lane<S>; 3];

/// F S(y), by columns.
#[inline(always)]
fn times<S: Simd>(f: [Lane3<S>; 2], y: Lane3<S>) -> [Lane3<S>; 2] {
    [
        sum(scaled(f[0], y[0]), scaled(f[1], y[2])),
        sum(scaled(f[0], y[2]), scaled(f[1], y[1])),
    ]
}

/// F b.
#[inline(always)]
fn along<S: Simd>(f: [Lane3<S>; 2], b: [Lane<S>; 2]) -> Lane3<S> {
    sum(scaled(f[0], b[0]), scaled(f[1], b[1]))
}

/// What a block has, in registers.
struct Loaded<S: Simd> {
    /// Gradients of the hat functions of the three corners; that of corner 0 turned round.
    b: [[Lane<S>; 2]; 3],
    /// α̃: weft, coupling, warp, shear.
    alpha: [Lane<S>; 4],
}

/// The system of a visit: A = Σ w ∇C ∇Cᵀ + α̃, by LDLᵀ.
struct System<S: Simd> {
    per_d: [Lane<S>; 3],
    l10: Lane<S>,
    l20: Lane<S>,
    l21: Lane<S>,
    least_pivot: Lane<S>,
}

impl<S: Simd> System<S> {
    /// From α̃, FᵀF and Σ w b bᵀ.
    #[inline(always)]
    fn new(simd: S, alpha: &[Lane<S>; 4], g: Symmetric<S>, m: Symmetric<S>) -> Self {
        let one = Lane::all(simd, 1.0);
        let [uu, uv, vv] = g;
        let [muu, muv, mvv] = m;
        let mixed = muv * uv;
        let a00 = muu * uu + alpha[0];
        let a10 = mixed + alpha[1];
        let a11 = mvv * vv + alpha[2];
        let a20 = muu * uv + muv * uu;
        let a21 = muv * vv + mvv * uv;
        let a22 = muu * vv + (mixed + mixed) + mvv * uu + alpha[3];
        let per_d0 = one / a00;
        let (l10, l20) = (a10 * per_d0, a20 * per_d0);
        let d1 = a11 - l10 * a10;
        let below = a21 - l20 * a10;
        let per_d1 = one / d1;
        let l21 = below * per_d1;
        let d2 = a22 - l20 * a20 - l21 * below;
        Self {
            per_d: [per_d0, per_d1, one / d2],
            l10,
            l20,
            l21,
            least_pivot: a00.min(d1).min(d2),
        }
    }

    /// A⁻¹ b; nothing where a pivot is not positive.
    #[inline(always)]
    fn solve(&self, b: Lane3<S>) -> Lane3<S> {
        let y1 = b[1] - self.l10 * b[0];
        let y2 = b[2] - self.l20 * b[0] - self.l21 * y1;
        let z = y2 * self.per_d[2];
        let y = y1 * self.per_d[1] - self.l21 * z;
        let x = b[0] * self.per_d[0] - self.l10 * y - self.l20 * z;
        [
            x.where_positive(self.least_pivot),
            y.where_positive(self.least_pivot),
            z.where_positive(self.least_pivot),
        ]
    }
}

/// α̃ y.
#[inline(always)]
fn complied<S: Simd>(alpha: &[Lane<S>; 4], y: Lane3<S>) -> Lane3<S> {
    [
        alpha[0] * y[0] + alpha[1] * y[1],
        alpha[1] * y[0] + alpha[2] * y[1],
        alpha[3] * y[2],
    ]
}

/// FᵀF.
#[inline(always)]
fn metric<S: Simd>(f: [Lane3<S>; 2]) -> Symmetric<S> {
    [dot(f[0], f[0]), dot(f[0], f[1]), dot(f[1], f[1])]
}

/// w b of each corner, and Σ w b bᵀ.
#[inline(always)]
fn masses<S: Simd>(b: &[[Lane<S>; 2]; 3], w: Lane3<S>) -> ([[Lane<S>; 2]; 3], Symmetric<S>) {
    let wb = [
        [w[0] * b[0][0], w[0] * b[0][1]],
        [w[1] * b[1][0], w[1] * b[1][1]],
        [w[2] * b[2][0], w[2] * b[2][1]],
    ];
    let m = [
        wb[0][0] * b[0][0] + wb[1][0] * b[1][0] + wb[2][0] * b[2][0],
        wb[0][0] * b[0][1] + wb[1][0] * b[1][1] + wb[2][0] * b[2][1],
        wb[0][1] * b[0][1] + wb[1][1] * b[1][1] + wb[2][1] * b[2][1],
    ];
    (wb, m)
}

impl Block {
    #[inline(always)]
    fn load<S: Simd>(&self, simd: S, part: usize) -> Loaded<S> {
        let per_area = Lane::load(simd, &self.per_area, part);
        let b1 = [
            Lane::load(simd, &self.b[0], part),
            Lane::load(simd, &self.b[1], part),
        ];
        let b2 = [
            Lane::load(simd, &self.b[2], part),
            Lane::load(simd, &self.b[3], part),
        ];
        let c = &self.compliance;
        Loaded {
            b: [[b1[0] + b2[0], b1[1] + b2[1]], b1, b2],
            alpha: [
                Lane::all(simd, c[0]) * per_area,
                Lane::all(simd, c[1]) * per_area,
                Lane::all(simd, c[2]) * per_area,
                Lane::all(simd, c[3]) * per_area,
            ],
        }
    }
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
        let (p, w0) = gather(simd, rows, &self.corners[0], part);
        let (q, w1) = gather(simd, rows, &self.corners[1], part);
        let (r, w2) = gather(simd, rows, &self.corners[2], part);
        let Loaded { b, alpha } = self.load(simd, part);
        let (e1, e2) = (difference(q, p), difference(r, p));
        let f = [
            sum(scaled(e1, b[1][0]), scaled(e2, b[2][0])),
            sum(scaled(e1, b[1][1]), scaled(e2, b[2][1])),
        ];
        let g = metric(f);
        let (wb, m) = masses(&b, [w0, w1, w2]);
        let system = System::new(simd, &alpha, g, m);

        // −C − α̃λ.
        let lambda = if first {
            [Lane::all(simd, 0.0); 3]
        } else {
            Lane::load3(simd, &self.lambda, part)
        };
        let (half, one) = (Lane::all(simd, 0.5), Lane::all(simd, 1.0));
        let right = difference(
            [half * (one - g[0]), half * (one - g[2]), -g[1]],
            complied(&alpha, lambda),
        );
        let delta = system.solve(right);
        for k in 0..3 {
            (lambda[k] + delta[k]).store(&mut self.lambda[k], part);
            delta[k].store(&mut visit[k], part);
        }

        // b of corner 0 is turned round.
        let y = times(f, delta);
        let p = difference(p, along(y, wb[0]));
        let q = sum(q, along(y, wb[1]));
        let r = sum(r, along(y, wb[2]));
        scatter(rows, &self.corners[0], part, (p, w0));
        scatter(rows, &self.corners[1], part, (q, w1));
        scatter(rows, &self.corners[2], part, (r, w2));
    }
}

#[cfg(test)]
mod tests;
