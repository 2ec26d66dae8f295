//! The adjoint of visits to membrane constraints.
//!
//! With A Δλ = r = −C − α̃λ and corner a moved by w_a Y b_a, Y = F S(Δλ), gradients x̂ and λ̂ after a visit
//! give Δλ̂ = λ̂ + Σ w ∇C x̂ and r̂ = A⁻¹ Δλ̂; no derivative of A⁻¹ is formed. F itself is not on the tape:
//! the visit left F′ = F (I + S(Δλ) Σ w b bᵀ).
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::{Block, Loaded, System, along, complied, masses, metric, times};
use crate::sim::step::lanes::{
    Four, Four3, Lane, Lane3, difference, dot, gather, scaled, scatter, sum,
};
use crate::sim::step::taped::Undo;
use pulp::Simd;

/// Gradients by what a block has.
#[derive(Clone, Debug, Default)]
pub(in crate::sim::step) struct Hat {
    /// By b of corners 1 and 2.
    pub(super) b: [Four; 4],
    /// By Ā.
    pub(super) area: Four,
    lambda: Four3,
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
        let (p, w0) = gather(simd, rows, &self.corners[0], part);
        let (q, w1) = gather(simd, rows, &self.corners[1], part);
        let (r, w2) = gather(simd, rows, &self.corners[2], part);
        let (p_hat, w0_hat) = gather(simd, hats, &self.corners[0], part);
        let (q_hat, w1_hat) = gather(simd, hats, &self.corners[1], part);
        let (r_hat, w2_hat) = gather(simd, hats, &self.corners[2], part);
        let Loaded { b, alpha } = self.load(simd, part);
        let (wb, m) = masses(&b, [w0, w1, w2]);
        let delta = Lane::load3(simd, visit, part);

        // Undo the visit.
        let one = Lane::all(simd, 1.0);
        let [s00, s11, s01] = delta;
        let n00 = one + (s00 * m[0] + s01 * m[1]);
        let n01 = s00 * m[1] + s01 * m[2];
        let n10 = s01 * m[0] + s11 * m[1];
        let n11 = one + (s01 * m[1] + s11 * m[2]);
        let per = one / (n00 * n11 - n01 * n10);
        let (e1, e2) = (difference(q, p), difference(r, p));
        let after = [
            sum(scaled(e1, b[1][0]), scaled(e2, b[2][0])),
            sum(scaled(e1, b[1][1]), scaled(e2, b[2][1])),
        ];
        let f = [
            scaled(
                difference(scaled(after[0], n11), scaled(after[1], n10)),
                per,
            ),
            scaled(
                difference(scaled(after[1], n00), scaled(after[0], n01)),
                per,
            ),
        ];
        let moves = times(f, delta);
        let per_mass = [along(moves, b[0]), along(moves, b[1]), along(moves, b[2])];
        let shift0 = scaled(per_mass[0], w0);
        let shift1 = scaled(per_mass[1], w1);
        let shift2 = scaled(per_mass[2], w2);
        let p = sum(p, shift0);
        let q = difference(q, shift1);
        let r = difference(r, shift2);
        scatter(rows, &self.corners[0], part, (p, w0));
        scatter(rows, &self.corners[1], part, (q, w1));
        scatter(rows, &self.corners[2], part, (r, w2));

        // Gradients by Δλ, and on by the right side.
        let pulled = [
            difference(
                sum(scaled(q_hat, wb[1][0]), scaled(r_hat, wb[2][0])),
                scaled(p_hat, wb[0][0]),
            ),
            difference(
                sum(scaled(q_hat, wb[1][1]), scaled(r_hat, wb[2][1])),
                scaled(p_hat, wb[0][1]),
            ),
        ];
        let by_moves = [
            dot(f[0], pulled[0]),
            dot(f[1], pulled[1]),
            dot(f[0], pulled[1]) + dot(f[1], pulled[0]),
        ];
        let lambda_hat = if last {
            [Lane::all(simd, 0.0); 3]
        } else {
            Lane::load3(simd, &hat.lambda, part)
        };
        let g = metric(f);
        let system = System::new(simd, &alpha, g, m);
        let delta_hat = sum(lambda_hat, by_moves);
        let right_hat = system.solve(delta_hat);
        let complied = complied(&alpha, right_hat);
        let answered = difference(lambda_hat, complied);
        for k in 0..3 {
            answered[k].store(&mut hat.lambda[k], part);
        }
        // r̂·α̃λ before the visit is −r̂·C − Δλ̂·Δλ; λ itself need not be known.
        let half = Lane::all(simd, 0.5);
        let c = [half * (g[0] - one), half * (g[2] - one), g[1]];
        let by_alpha = dot(complied, delta) - dot(right_hat, c) - dot(delta_hat, delta);
        (by_alpha * Lane::load(simd, &self.per_area, part)).add_to(&mut hat.area, part);

        // By F, w, positions and b.
        let turns = times(f, right_hat);
        let by_delta = times(difference2(pulled, weighted(turns, m)), delta);
        let by_right = times(after, right_hat);
        let f_hat = difference2(by_delta, by_right);
        let against0 = sum(p_hat, along(turns, b[0]));
        let against1 = difference(q_hat, along(turns, b[1]));
        let against2 = difference(r_hat, along(turns, b[2]));
        let w0_hat = w0_hat - dot(against0, per_mass[0]);
        let w1_hat = w1_hat + dot(against1, per_mass[1]);
        let w2_hat = w2_hat + dot(against2, per_mass[2]);
        let p_hat = difference(p_hat, along(f_hat, b[0]));
        let q_hat = sum(q_hat, along(f_hat, b[1]));
        let r_hat = sum(r_hat, along(f_hat, b[2]));
        scatter(hats, &self.corners[0], part, (p_hat, w0_hat));
        scatter(hats, &self.corners[1], part, (q_hat, w1_hat));
        scatter(hats, &self.corners[2], part, (r_hat, w2_hat));
        let from = scaled(against0, w0);
        let edges = [
            (difference(q, p), scaled(against1, w1), shift1),
            (difference(r, p), scaled(against2, w2), shift2),
        ];
        for i in 0..2 {
            let (edge, against, shift) = edges[i];
            let (against, shift) = (difference(against, from), sum(shift, shift0));
            for k in 0..2 {
                let by_b = dot(moves[k], against) - dot(turns[k], shift) + dot(f_hat[k], edge);
                by_b.add_to(&mut hat.b[2 * i + k], part);
            }
        }
    }
}

/// F M, by columns, with M symmetric: 00, 10, 11.
#[inline(always)]
fn weighted<S: Simd>(f: [Lane3<S>; 2], m: Lane3<S>) -> [Lane3<S>; 2] {
    times(f, [m[0], m[2], m[1]])
}

/// `a − b` of 3 × 2 matrices.
#[inline(always)]
fn difference2<S: Simd>(a: [Lane3<S>; 2], b: [Lane3<S>; 2]) -> [Lane3<S>; 2] {
    [difference(a[0], b[0]), difference(a[1], b[1])]
}
