//! Keeps a garment's shape while it is pulled to new places: affine-invariant stencils (de Goes,
//! Fong, O'Malley 2020).
//!
//! The one-ring of vertex v, E_v = [x_i − x_v] in the source drape, has the projector
//! W_v = I − E_vᵀ(E_vE_vᵀ)†E_v, which is blind to affine images of the ring. The relaxed X minimises
//! ½ Σ_v 1/n_v ‖W_v [x_i − x_v]‖² + ½ Σ_v m_v ‖x_v − z_v‖², a positive definite system factored once.

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
    anchoring: Vec<f64>,
}

/// Directions of a ring below this share of its widest one are rounding.
const FLAT: f64 = 1e-7;

impl Relaxation {
    /// Stencils of the drape `x`; `anchoring` is m_v \[–\], positive.
    pub(super) fn new(x: &[Vec3], rings: &[Vec<u32>], anchoring: Vec<f64>) -> Self {
        let system = system(x, rings, &anchoring);
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
            anchoring,
        }
    }

    /// The relaxed positions when every vertex v is pulled to `z[v]` \[m\].
    pub(super) fn relax(&self, z: &[Vec3]) -> Vec<Vec3> {
        let mut x = Mat::from_fn(z.len(), 3, |v, axis| self.anchoring[v] * z[v][axis]);
        let scratch = self.symbolic.solve_in_place_scratch::<f64>(3, Par::Seq);
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            x.as_mut(),
            Par::Seq,
            MemStack::new(&mut MemBuffer::new(scratch)),
        );
        let row = |v| Vec3::new(x[(v, 0)], x[(v, 1)], x[(v, 2)]);
        (0..z.len()).map(row).collect()
    }
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

/// Lower triangle of Σ_v B_vᵀW_vB_v / n_v + diag(m), where (B_v X)_i = x_i − x_v.
fn system(x: &[Vec3], rings: &[Vec<u32>], anchoring: &[f64]) -> SparseColMat<usize, f64> {
    let mut entries = Vec::new();
    let mut add = |row: usize, col: usize, val: f64| {
        if row >= col {
            entries.push(Triplet { row, col, val });
        }
    };
    for (v, ring) in rings.iter().enumerate() {
        add(v, v, anchoring[v]);
        let edges: Vec<Vec3> = ring.iter().map(|&i| x[i as usize] - x[v]).collect();
        let basis = affine_basis(&edges);
        let share = 1.0 / ring.len() as f64;
        for (i, &row) in ring.iter().enumerate() {
            for (j, &col) in ring.iter().enumerate() {
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
        .expect("rings index the vertices")
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

    fn bumpy() -> (Vec<Vec3>, Vec<Vec<u32>>) {
        let mesh = sphere(0.3, 2);
        let bump = |(i, p): (usize, &Vec3)| p * (1.0 + 0.1 * noise(i));
        let x = mesh.positions.iter().enumerate().map(bump).collect();
        (x, rings(mesh.positions.len(), &mesh.triangles))
    }

    #[test]
    fn affine_images_of_the_drape_need_no_relaxing() {
        let (x, rings) = bumpy();
        let stretch = Mat3::from_fn(|i, j| noise(3 * i + j) + f64::from(u8::from(i == j)));
        let image: Vec<Vec3> = x.iter().map(|p| stretch * p + Vec3::repeat(0.7)).collect();
        // The energy's gradient, S X, without the anchors.
        let stencils = system(&x, &rings, &vec![0.0; x.len()]);
        for axis in 0..3 {
            let mut gradient = vec![0.0; x.len()];
            for entry in stencils.triplet_iter() {
                gradient[entry.row] += entry.val * image[entry.col][axis];
                if entry.row != entry.col {
                    gradient[entry.col] += entry.val * image[entry.row][axis];
                }
            }
            // Positions of the order of 1 m.
            assert!(gradient.iter().all(|g| g.abs() < 1e-12));
        }
        let relaxed = Relaxation::new(&x, &rings, vec![0.1; x.len()]).relax(&image);
        assert!(
            relaxed
                .iter()
                .zip(&image)
                .all(|(a, b)| (a - b).norm() < 1e-12)
        );
    }

    #[test]
    fn a_spike_is_relaxed_away() {
        let (x, rings) = bumpy();
        let mut z = x.clone();
        z[50] *= 1.3;
        let relaxed = Relaxation::new(&x, &rings, vec![0.1; x.len()]).relax(&z);
        // Its own ring takes it for an affine image (on a sphere all neighbours lie equally deep);
        // those of its neighbours do not.
        assert!((relaxed[50] - x[50]).norm() < 0.6 * (z[50] - x[50]).norm());
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
        let rings = rings(5, &[[0, 1, 2], [1, 3, 2]]);
        let relaxed = Relaxation::new(&x, &rings, vec![0.1; 5]).relax(&x);
        assert!(relaxed.iter().zip(&x).all(|(a, b)| (a - b).norm() < 1e-14));
    }
}
