//! Membrane constraints swept by colours, [`LANES`] triangles at a time.
//!
//! Each visit is that of [`crate::sim::energy::membrane`]'s constraint form: (∇C M⁻¹ ∇Cᵀ + α̃) Δλ =
//! −C − α̃λ, corner a moves by w_a F S(Δλ) b_a. A triangle takes 170 flops, 3 divisions among them, and
//! 170 bytes of its own (D_m⁻¹, w, Σ w b bᵀ, 1/Ā, λ, corners) besides three positions read and written.
#![expect(
    clippy::inline_always,
    reason = "what is not inlined into the dispatched loop is not compiled for wide registers"
)]

use super::lanes::{
    LANES, Lane, Lane3, blocks, difference, dot, gather, in_place, of_lane, scaled, scatter, sum,
};
use crate::geometry::Vec3;
use crate::sim::cloth::{Cloth, Rest};
use crate::sim::energy::membrane::{Elasticity, Mat3x2};
use crate::sim::material::Material;

/// Compliance 𝔻⁻¹ Δt⁻² per rest area: weft, coupling, warp, shear.
#[derive(Clone, Copy, Debug)]
struct Compliance([f64; 4]);

impl Compliance {
    fn new(d: &Elasticity, dt: f64) -> Self {
        let determinant = d.weft * d.warp - d.coupling * d.coupling;
        let entries = [
            d.warp / determinant,
            -d.coupling / determinant,
            d.weft / determinant,
            1.0 / d.shear,
        ];
        Self(entries.map(|c| c / (dt * dt)))
    }
}

/// F and Δλ of a visit; none where its system could not be solved.
pub(super) type Visit = Option<(Mat3x2, Vec3)>;

/// The triangles of a cloth by colours, with one rest shape.
pub(super) struct Stretch {
    /// Of each material.
    compliances: Vec<Compliance>,
    blocks: Vec<Block>,
    /// Triangles in the order of their visits.
    order: Vec<u32>,
}

/// [`LANES`] triangles of one material that share no vertex.
#[derive(Clone, Debug, Default)]
struct Block {
    triangles: [u32; LANES],
    corners: [[u32; LANES]; 3],
    /// How many of them count; the others repeat the first.
    count: usize,
    material: u16,
    /// Hat functions b of corners 1 and 2: (u, v) of each.
    b: [[Lane; 2]; 2],
    w: Lane3,
    /// Σ w b bᵀ: uu, uv, vv.
    mass: Lane3,
    per_area: Lane,
    lambda: Lane3,
}

impl Stretch {
    pub(super) fn new(cloth: &Cloth, rest: &Rest, w: &[f64], dt: f64) -> Self {
        let block = |(triangles, count): ([u32; LANES], usize)| {
            let at = |corner: usize| triangles.map(|e| cloth.triangles[e as usize][corner]);
            Block {
                triangles,
                count,
                material: cloth.material_of[triangles[0] as usize],
                corners: [at(0), at(1), at(2)],
                ..Block::default()
            }
        };
        let material = |e: u32| cloth.material_of[e as usize];
        let blocks: Vec<Block> = blocks(&cloth.triangles, cloth.vertex_count, material)
            .into_iter()
            .map(block)
            .collect();
        let live = |block: &Block| block.triangles.into_iter().take(block.count);
        let compliance = |material: &Material| Compliance::new(&material.elasticity, dt);
        let mut stretch = Self {
            compliances: cloth.materials.iter().map(compliance).collect(),
            order: blocks.iter().flat_map(live).collect(),
            blocks,
        };
        stretch.grow(rest, w);
        stretch
    }

    /// Takes on another rest shape; `w` are inverse masses \[1/kg\].
    pub(super) fn grow(&mut self, rest: &Rest, w: &[f64]) {
        for block in &mut self.blocks {
            for l in 0..LANES {
                let triangle = &rest.triangles[block.triangles[l] as usize];
                let [_, b1, b2] = triangle.gradients();
                for (lane, b) in block.b.iter_mut().zip([b1, b2]) {
                    (lane[0].0[l], lane[1].0[l]) = (b.x, b.y);
                }
                let w = block.corners.map(|corner| w[corner[l] as usize]);
                let mass = triangle.weighted(w);
                for (k, m) in [mass.m11, mass.m12, mass.m22].into_iter().enumerate() {
                    (block.w[k].0[l], block.mass[k].0[l]) = (w[k], m);
                }
                block.per_area.0[l] = 1.0 / triangle.area;
            }
        }
    }

    /// Triangles in the order of their visits.
    pub(super) fn order(&self) -> &[u32] {
        &self.order
    }

    /// Forgets all λ.
    pub(super) fn reset(&mut self) {
        for block in &mut self.blocks {
            block.lambda = Lane3::default();
        }
    }

    /// λ of each triangle.
    pub(super) fn lambda(&self) -> Vec<Vec3> {
        let lanes = self
            .blocks
            .iter()
            .map(|b| (b.lambda, &b.triangles[..b.count]));
        in_place(self.order.len(), lanes)
    }

    /// Visits every triangle once, and notes the visits on `tape`.
    pub(super) fn sweep(&mut self, x: &mut [Vec3], mut tape: Option<&mut Vec<Visit>>) {
        pulp::Arch::new().dispatch(
            #[inline(always)]
            || {
                for block in &mut self.blocks {
                    let compliance = &self.compliances[usize::from(block.material)];
                    let visit = block.visit(compliance, x);
                    if let Some(tape) = &mut tape {
                        tape.extend((0..block.count).map(|l| visit.of_lane(l)));
                    }
                }
            },
        );
    }
}

/// What a visit found.
struct BlockVisit {
    f: [Lane3; 2],
    delta: Lane3,
    /// Positive where the system could be solved.
    least_pivot: Lane,
}

impl BlockVisit {
    fn of_lane(&self, l: usize) -> Visit {
        let f = Mat3x2::from_columns(&self.f.map(|column| of_lane(column, l)));
        (self.least_pivot.0[l] > 0.0).then(|| (f, of_lane(self.delta, l)))
    }
}

impl Block {
    #[inline(always)]
    fn visit(&mut self, Compliance(c): &Compliance, x: &mut [Vec3]) -> BlockVisit {
        let [p, q, r] = [
            gather(x, &self.corners[0]),
            gather(x, &self.corners[1]),
            gather(x, &self.corners[2]),
        ];
        let (e, f) = (difference(q, p), difference(r, p));
        let [[b1u, b1v], [b2u, b2v]] = self.b;
        let fu = sum(scaled(e, b1u), scaled(f, b2u));
        let fv = sum(scaled(e, b1v), scaled(f, b2v));
        let (guu, guv, gvv) = (dot(fu, fu), dot(fu, fv), dot(fv, fv));

        // A = Σ w ∇C ∇Cᵀ + α̃, its lower triangle.
        let [muu, muv, mvv] = self.mass;
        let alpha = [
            Lane::all(c[0]) * self.per_area,
            Lane::all(c[1]) * self.per_area,
            Lane::all(c[2]) * self.per_area,
            Lane::all(c[3]) * self.per_area,
        ];
        let a00 = muu * guu + alpha[0];
        let a10 = muv * guv + alpha[1];
        let a11 = mvv * gvv + alpha[2];
        let a20 = muu * guv + muv * guu;
        let a21 = muv * gvv + mvv * guv;
        let a22 = muu * gvv + (muv * guv + muv * guv) + mvv * guu + alpha[3];

        // −C − α̃λ.
        let [l0, l1, l2] = self.lambda;
        let half = Lane::all(0.5);
        let one = Lane::all(1.0);
        let r0 = half * (one - guu) - (alpha[0] * l0 + alpha[1] * l1);
        let r1 = half * (one - gvv) - (alpha[1] * l0 + alpha[2] * l1);
        let r2 = -guv - alpha[3] * l2;

        // By LDLᵀ; nothing where a pivot is not positive.
        let per_d0 = one / a00;
        let (l10, l20) = (a10 * per_d0, a20 * per_d0);
        let d1 = a11 - l10 * a10;
        let below = a21 - l20 * a10;
        let per_d1 = one / d1;
        let l21 = below * per_d1;
        let d2 = a22 - l20 * a20 - l21 * below;
        let y1 = r1 - l10 * r0;
        let y2 = r2 - l20 * r0 - l21 * y1;
        let delta2 = y2 / d2;
        let delta1 = y1 * per_d1 - l21 * delta2;
        let delta0 = r0 * per_d0 - l10 * delta1 - l20 * delta2;
        let least_pivot = a00.min(d1).min(d2);
        let delta = [
            delta0.where_positive(least_pivot),
            delta1.where_positive(least_pivot),
            delta2.where_positive(least_pivot),
        ];
        for k in 0..3 {
            self.lambda[k] += delta[k];
        }

        // Corner a moves by w_a Y b_a, Y = F S(Δλ); the b sum to zero.
        let yu = sum(scaled(fu, delta[0]), scaled(fv, delta[2]));
        let yv = sum(scaled(fu, delta[2]), scaled(fv, delta[1]));
        let push1 = sum(scaled(yu, b1u), scaled(yv, b1v));
        let push2 = sum(scaled(yu, b2u), scaled(yv, b2v));
        let push0 = sum(push1, push2);
        scatter(x, &self.corners[0], self.count, scaled(push0, -self.w[0]));
        scatter(x, &self.corners[1], self.count, scaled(push1, self.w[1]));
        scatter(x, &self.corners[2], self.count, scaled(push2, self.w[2]));
        BlockVisit {
            f: [fu, fv],
            delta,
            least_pivot,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use crate::geometry::Mat3;
    use crate::sim::cloth::fixtures::{patched, tube};
    use crate::sim::energy::membrane::{constraint, constraint_gradient, constraint_mass};
    use crate::sim::step::solve_symmetric;

    /// The visit as the energy's file defines it.
    fn scalar(
        cloth: &Cloth,
        rest: &Rest,
        w: &[f64],
        e: usize,
        lambda: &mut Vec3,
        x: &mut [Vec3],
        dt: f64,
    ) {
        let (t, d) = (cloth.triangles[e], &cloth.material(e).elasticity);
        let rest = &rest.triangles[e];
        let stiffness = Mat3::new(
            d.weft, d.coupling, 0.0, d.coupling, d.warp, 0.0, 0.0, 0.0, d.shear,
        );
        let alpha_tilde = stiffness.try_inverse().unwrap() / (rest.area * dt * dt);
        let w = t.map(|a| w[a as usize]);
        let f = rest.gradient_of(t.map(|a| x[a as usize]));
        let system = alpha_tilde + constraint_mass(&f, &rest.weighted(w));
        let right = -constraint(&f) - alpha_tilde * *lambda;
        let delta = solve_symmetric(&system, &right).unwrap();
        *lambda += delta;
        let y = constraint_gradient(&f, &delta);
        for ((a, b), w) in t.iter().zip(rest.gradients()).zip(w) {
            x[*a as usize] += y * (b * w);
        }
    }

    #[test]
    fn lanes_do_what_the_constraint_says() {
        let mesh = tube(11, 5, 0.05);
        let cloth = patched(&mesh);
        let rest = cloth.at_rest(&mesh.x_bar);
        let w: Vec<f64> = rest.mass.iter().map(|m| 1.0 / m).collect();
        let dt = 0.01;
        let mut x: Vec<Vec3> = (0..cloth.vertex_count)
            .map(|i| Vec3::from_fn(|c, _| 0.3 * noise(3 * i + c)))
            .collect();
        let mut expected = x.clone();
        let mut stretch = Stretch::new(&cloth, &rest, &w, dt);
        let mut lambda = vec![Vec3::zeros(); cloth.triangles.len()];
        let mut tape = Vec::new();
        for _ in 0..3 {
            stretch.sweep(&mut x, Some(&mut tape));
            for &e in stretch.order() {
                let e = e as usize;
                scalar(&cloth, &rest, &w, e, &mut lambda[e], &mut expected, dt);
            }
        }
        assert_eq!(tape.len(), 3 * cloth.triangles.len());
        for (x, expected) in x.iter().zip(&expected) {
            // Decimetres, by other roundings over three sweeps of violent moves.
            assert!((x - expected).norm() < 1e-11, "{x:?} {expected:?}");
        }
        for (own, expected) in stretch.lambda().iter().zip(&lambda) {
            assert!((own - expected).norm() < 1e-9 * expected.norm().max(1e-6));
        }
    }
}
