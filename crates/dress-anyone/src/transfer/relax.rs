//! Keeps a garment's shape while it is pulled to new places: affine-invariant stencils (de Goes,
//! Fong, O'Malley 2020).
//!
//! A stencil is a vertex c and its neighbours, E = [x_i − x_c] in the source drape. The projector
//! W = I − Eᵀ(EEᵀ)†E is blind to affine images of it. The relaxed X minimises
//! ½ Σ w/n ‖W [x_i − x_c]‖² + ½ Σ_v (x_v − z_v)ᵀM_v(x_v − z_v) + ½ Σ k ‖x_v − Σ b_i x_i − o‖², the last over
//! edges that keep their length in the direction that they have, and over layers that are tied to one
//! another. M_v is stiffer along the body's
//! normal than along the body, so the three coordinates are coupled; the scalar system with the mean of
//! M_v, factored once, preconditions conjugate gradients for it.

use crate::geometry::Vec3;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMat, Triplet};
use faer::{Conj, Mat, Par, Side, Spec};
use std::collections::BTreeSet;

/// The factored system of a source drape.
pub(super) struct Relaxation {
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    /// Stencils and kept edges, lower triangle.
    stiffness: SparseColMat<usize, f64>,
    holds: Vec<Hold>,
    kept: Vec<Kept>,
    ties: Vec<Tie>,
}

/// A vertex and those whose layout around it is kept.
pub(super) struct Stencil {
    pub(super) centre: u32,
    pub(super) around: Vec<u32>,
}

/// How firmly a vertex is held, \[–\] beside the stencils; M_v = `along` I + (`across` − `along`) n nᵀ.
#[derive(Clone, Copy)]
pub(super) struct Hold {
    /// Unit, or zero where nothing is special.
    pub(super) normal: Vec3,
    pub(super) across: f64,
    pub(super) along: f64,
}

/// An edge that keeps its length \[m\].
#[derive(Clone, Copy)]
pub(super) struct Kept {
    pub(super) ends: [u32; 2],
    pub(super) length: f64,
}

/// A vertex that stays at an offset \[m\] from a point of a triangle.
pub(super) struct Tie {
    pub(super) vertex: u32,
    pub(super) triangle: [u32; 3],
    pub(super) weights: [f64; 3],
    pub(super) offset: Vec3,
}

/// Directions of a stencil below this share of its widest one are rounding.
const FLAT: f64 = 1e-7;
/// Stiffness of an edge that keeps its length \[–\]: far above what holds the vertices.
const KEEP: f64 = 3.0;
/// Stiffness of a tie \[–\]: firm beside what holds the vertices, soft beside the stencils.
const TIE: f64 = 0.3;
/// Most iterations of a solve; some thirty suffice.
const ITERATIONS: usize = 300;

impl Hold {
    /// M_v z.
    pub(super) fn times(&self, z: Vec3) -> Vec3 {
        z * self.along + self.normal * (self.normal.dot(&z) * (self.across - self.along))
    }
}

impl Relaxation {
    /// Of the drape `x` with these stencils; every vertex is held.
    pub(super) fn new(
        x: &[Vec3],
        stencils: &[Stencil],
        holds: Vec<Hold>,
        kept: &[[u32; 2]],
        ties: Vec<Tie>,
    ) -> Self {
        let kept: Vec<Kept> = (kept.iter())
            .map(|&ends| {
                let [a, b] = ends.map(|v| x[v as usize]);
                let length = (a - b).norm();
                Kept { ends, length }
            })
            .collect();
        let mean: Vec<f64> = holds.iter().map(|h| (h.across * h.along).sqrt()).collect();
        let stiffness = system(x, stencils, (&kept, &ties), &vec![0.0; x.len()]);
        let system = system(x, stencils, (&kept, &ties), &mean);
        let symbolic = factorize_symbolic_cholesky(
            system.symbolic(),
            Side::Lower,
            SymmetricOrdering::default(),
            CholeskySymbolicParams::default(),
        )
        .expect("a garment's system fits in memory");
        let mut factor = vec![0.0; symbolic.len_val()];
        let scratch = symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default());
        symbolic
            .factorize_numeric_llt(
                &mut factor,
                system.as_ref(),
                Side::Lower,
                LltRegularization::default(),
                // One thread: its count must not change a bit of the result.
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
                Spec::default(),
            )
            .expect("projectors plus a positive diagonal are positive definite");
        Self {
            symbolic,
            factor,
            stiffness,
            holds,
            kept,
            ties,
        }
    }

    /// The relaxed positions when every vertex v is pulled to `z[v]` \[m\], sought from `start` to
    /// about `still` \[m\]; kept edges take their directions from `start`.
    pub(super) fn relax(&self, z: &[Vec3], start: &[Vec3], still: f64) -> Vec<Vec3> {
        let mut x = start.to_vec();
        let mut r = self.pulls(z, start);
        for (r, ax) in r.iter_mut().zip(self.times(&x)) {
            *r -= ax;
        }
        let mut q = self.precondition(&r);
        let mut direction = q.clone();
        let mut slope = dot(&r, &q);
        for _ in 0..ITERATIONS {
            // The preconditioned residual is about how far there is to go.
            if q.iter().all(|q| q.norm() <= still) {
                break;
            }
            let pushed = self.times(&direction);
            let step = slope / dot(&direction, &pushed);
            for v in 0..x.len() {
                x[v] += direction[v] * step;
                r[v] -= pushed[v] * step;
            }
            q = self.precondition(&r);
            let next = dot(&r, &q);
            let keep = next / slope;
            slope = next;
            for (direction, q) in direction.iter_mut().zip(&q) {
                *direction = q + *direction * keep;
            }
        }
        x
    }

    /// M z, and what kept edges and ties ask for.
    fn pulls(&self, z: &[Vec3], directions: &[Vec3]) -> Vec<Vec3> {
        let mut pulls: Vec<Vec3> = (self.holds.iter().zip(z))
            .map(|(hold, &z)| hold.times(z))
            .collect();
        for kept in &self.kept {
            let [a, b] = kept.ends.map(|v| v as usize);
            let edge = directions[a] - directions[b];
            let wanted = edge.try_normalize(0.0).unwrap_or_else(Vec3::zeros) * kept.length;
            pulls[a] += wanted * KEEP;
            pulls[b] -= wanted * KEEP;
        }
        for tie in &self.ties {
            for (v, weight) in tie.ends() {
                pulls[v] += tie.offset * (TIE * weight);
            }
        }
        pulls
    }

    /// The whole matrix times `x`.
    fn times(&self, x: &[Vec3]) -> Vec<Vec3> {
        let mut product: Vec<Vec3> = (self.holds.iter().zip(x))
            .map(|(hold, &x)| hold.times(x))
            .collect();
        let (starts, rows) = (self.stiffness.col_ptr(), self.stiffness.row_idx());
        let values = self.stiffness.val();
        for column in 0..x.len() {
            for at in starts[column]..starts[column + 1] {
                let (row, value) = (rows[at], values[at]);
                product[row] += x[column] * value;
                if row != column {
                    product[column] += x[row] * value;
                }
            }
        }
        product
    }

    /// The factored matrix's inverse times `r`.
    fn precondition(&self, r: &[Vec3]) -> Vec<Vec3> {
        let mut q = Mat::from_fn(r.len(), 3, |v, axis| r[v][axis]);
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(3, Par::Seq);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            q.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        let row = |v| Vec3::new(q[(v, 0)], q[(v, 1)], q[(v, 2)]);
        (0..r.len()).map(row).collect()
    }
}

impl Tie {
    /// Vertices and their weights in what is kept: 1, and minus those of the triangle.
    fn ends(&self) -> [(usize, f64); 4] {
        let [a, b, c] = self.triangle.map(|v| v as usize);
        let [u, v, w] = self.weights.map(|weight| -weight);
        [(self.vertex as usize, 1.0), (a, u), (b, v), (c, w)]
    }
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// The neighbours of every vertex along the triangles' edges, ascending.
pub(super) fn rings(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut rings = vec![BTreeSet::new(); vertex_count];
    for &[a, b, c] in triangles {
        rings[a as usize].extend([b, c]);
        rings[b as usize].extend([c, a]);
        rings[c as usize].extend([a, b]);
    }
    let ascending = rings.into_iter().map(|ring| ring.into_iter().collect());
    ascending.collect()
}

/// Lower triangle of Σ BᵀWB / n over the stencils, where (B X)_i = x_i − x_c, with kept edges and
/// ties, and `diagonal`.
fn system(
    x: &[Vec3],
    stencils: &[Stencil],
    (kept, ties): (&[Kept], &[Tie]),
    diagonal: &[f64],
) -> SparseColMat<usize, f64> {
    let mut entries = Vec::new();
    let mut add = |row: usize, col: usize, val: f64| {
        if row >= col {
            entries.push(Triplet { row, col, val });
        }
    };
    for (v, &m) in diagonal.iter().enumerate() {
        add(v, v, m);
    }
    for kept in kept {
        let [a, b] = kept.ends.map(|v| v as usize);
        for (row, col, sign) in [(a, a, 1.0), (b, b, 1.0), (a, b, -1.0), (b, a, -1.0)] {
            add(row, col, sign * KEEP);
        }
    }
    for tie in ties {
        for (row, first) in tie.ends() {
            for (col, second) in tie.ends() {
                add(row, col, TIE * first * second);
            }
        }
    }
    for stencil in stencils {
        let (v, around) = (stencil.centre as usize, &stencil.around);
        let edges: Vec<Vec3> = around.iter().map(|&i| x[i as usize] - x[v]).collect();
        let basis = affine_basis(&edges);
        let share = 1.0 / around.len() as f64;
        for (i, &row) in around.iter().enumerate() {
            for (j, &col) in around.iter().enumerate() {
                let seen: f64 = basis.iter().map(|q| q[i] * q[j]).sum();
                let w = share * (f64::from(u8::from(i == j)) - seen);
                add(row as usize, col as usize, w);
                add(row as usize, v, -w);
                add(v, col as usize, -w);
                add(v, v, w);
            }
        }
    }
    SparseColMat::try_new_from_triplets(x.len(), x.len(), &entries)
        .expect("stencils index the vertices")
}

/// Orthonormal basis of what affine images of a ring look like along its edges, `[≤ 3][edge]`:
/// the row space of E, by Gram–Schmidt with the largest row first.
fn affine_basis(edges: &[Vec3]) -> Vec<Vec<f64>> {
    let norm = |row: &[f64]| row.iter().map(|x| x * x).sum::<f64>().sqrt();
    let mut rows: Vec<Vec<f64>> = (0..3)
        .map(|axis| edges.iter().map(|e| e[axis]).collect())
        .collect();
    let widest = rows.iter().map(|row| norm(row)).fold(0.0, f64::max);
    let mut basis: Vec<Vec<f64>> = Vec::new();
    while let Some(longest) =
        (0..rows.len()).max_by(|&i, &j| norm(&rows[i]).total_cmp(&norm(&rows[j])))
    {
        let mut row = rows.swap_remove(longest);
        if norm(&row) <= FLAT * widest {
            break;
        }
        // Once more, lest rounding of a nearly flat ring leaves the basis askew.
        remove(&basis, &mut row);
        let length = norm(&row);
        basis.push(row.iter().map(|x| x / length).collect());
        for row in &mut rows {
            remove(&basis, row);
        }
    }
    basis
}

/// Removes from `row` its parts along `basis`.
fn remove(basis: &[Vec<f64>], row: &mut [f64]) {
    for q in basis {
        let along: f64 = q.iter().zip(&*row).map(|(a, b)| a * b).sum();
        for (x, q) in row.iter_mut().zip(q) {
            *x -= along * q;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;
    use crate::geometry::Mat3;
    use crate::geometry::closest_point::tests::sphere;

    fn stencils(rings: Vec<Vec<u32>>) -> Vec<Stencil> {
        let stencil = |(v, around)| Stencil {
            centre: v as u32,
            around,
        };
        rings.into_iter().enumerate().map(stencil).collect()
    }

    fn bumpy() -> (Vec<Vec3>, Vec<Stencil>) {
        let mesh = sphere(0.3, 2);
        let bump = |(i, p): (usize, &Vec3)| p * (1.0 + 0.1 * noise(i));
        let x = mesh.positions.iter().enumerate().map(bump).collect();
        (x, stencils(rings(mesh.positions.len(), &mesh.triangles)))
    }

    /// Held a hundred times as firmly along the normal as along the sphere.
    fn holds(x: &[Vec3]) -> Vec<Hold> {
        let hold = |p: &Vec3| Hold {
            normal: p.normalize(),
            across: 0.1,
            along: 1e-3,
        };
        x.iter().map(hold).collect()
    }

    #[test]
    fn affine_images_of_the_drape_need_no_relaxing() {
        let (x, stencils) = bumpy();
        let stretch = Mat3::from_fn(|i, j| noise(3 * i + j) + f64::from(u8::from(i == j)));
        let image: Vec<Vec3> = x.iter().map(|p| stretch * p + Vec3::repeat(0.7)).collect();
        let relaxation = Relaxation::new(&x, &stencils, holds(&x), &[], vec![]);
        let forces = relaxation.times(&image);
        // Nothing but the holds: positions of the order of 1 m.
        for (force, (hold, image)) in forces.iter().zip(relaxation.holds.iter().zip(&image)) {
            assert!((force - hold.times(*image)).norm() < 1e-12);
        }
        let relaxed = relaxation.relax(&image, &image, 1e-10);
        let mut both = relaxed.iter().zip(&image);
        assert!(both.all(|(a, b)| (a - b).norm() < 1e-12));
    }

    #[test]
    fn the_relaxed_shape_solves_the_coupled_system() {
        let (x, stencils) = bumpy();
        let relaxation = Relaxation::new(&x, &stencils, holds(&x), &[], vec![]);
        let z: Vec<Vec3> = (x.iter().enumerate())
            .map(|(i, p)| p + Vec3::from_fn(|c, _| 0.02 * noise(3 * i + c)))
            .collect();
        let relaxed = relaxation.relax(&z, &x, 1e-12);
        let (left, right) = (relaxation.times(&relaxed), relaxation.pulls(&z, &x));
        // Forces are of the order of 0.1 · 0.3; a thousandth of that moves nothing by a micrometre.
        let mut both = left.iter().zip(&right);
        assert!(both.all(|(a, b)| (a - b).norm() < 1e-9));
    }

    #[test]
    fn a_spike_is_relaxed_away() {
        let (x, stencils) = bumpy();
        let mut z = x.clone();
        z[50] *= 1.3;
        let relaxed = Relaxation::new(&x, &stencils, holds(&x), &[], vec![]).relax(&z, &z, 1e-10);
        // Its own ring takes it for an affine image (on a sphere all neighbours lie equally deep);
        // those of its neighbours do not.
        assert!((relaxed[50] - x[50]).norm() < 0.6 * (z[50] - x[50]).norm());
    }

    #[test]
    fn kept_edges_keep_their_length() {
        let (x, stencils) = bumpy();
        let edge = [stencils[50].centre, stencils[50].around[0]];
        let length = |x: &[Vec3]| (x[edge[0] as usize] - x[edge[1] as usize]).norm();
        let larger: Vec<Vec3> = x.iter().map(|p| p * 1.5).collect();
        let relaxation = Relaxation::new(&x, &stencils, holds(&x), &[edge], vec![]);
        let relaxed = relaxation.relax(&larger, &larger, 1e-10);
        // Holds of 0.1 against 3, and stencils that yield.
        assert!((length(&relaxed) / length(&x) - 1.0).abs() < 0.1);
    }

    #[test]
    fn flat_rings_and_lonely_vertices_stay_solvable() {
        let x = [
            Vec3::zeros(),
            Vec3::x(),
            Vec3::y(),
            Vec3::new(1.0, 1.0, 0.0),
            Vec3::z(),
        ];
        let stencils = stencils(rings(5, &[[0, 1, 2], [1, 3, 2]]));
        let relaxed = Relaxation::new(&x, &stencils, holds(&x[1..2].repeat(5)), &[], vec![]);
        let relaxed = relaxed.relax(&x, &x, 1e-12);
        assert!(relaxed.iter().zip(&x).all(|(a, b)| (a - b).norm() < 1e-14));
    }
}
