//! Factors of a matrix that is symmetric but for some blocks: stiffness with sliding friction.

use super::BlockMatrix;
use crate::geometry::{Mat3, Vec3};
use faer::linalg::solvers::Solve;
use faer::sparse::linalg::solvers::Lu;
use faer::sparse::{SparseColMat, Triplet};
use faer::{MatMut, Par};

/// L and U of a general sparse matrix.
#[derive(Clone, Debug)]
pub struct GeneralFactor {
    lu: Lu<usize, f64>,
    rows: usize,
}

impl GeneralFactor {
    /// Factors `symmetric` plus blocks at (row vertex, column vertex); none if that is singular.
    pub fn new(symmetric: &BlockMatrix, blocks: &[(u32, u32, Mat3)]) -> Option<Self> {
        // One thread: the order of sums, and so every bit, stays the same on any machine.
        faer::set_global_parallelism(Par::Seq);
        let rows = 3 * symmetric.structure.vertex_count;
        let mut entries: Vec<Triplet<usize, usize, f64>> = Vec::new();
        for (row, column, value) in symmetric.entries() {
            entries.push(Triplet::new(row, column, value));
            if row != column {
                entries.push(Triplet::new(column, row, value));
            }
        }
        for (a, b, block) in blocks {
            let (row, column) = (3 * *a as usize, 3 * *b as usize);
            for i in 0..3 {
                for j in 0..3 {
                    entries.push(Triplet::new(row + i, column + j, block[(i, j)]));
                }
            }
        }
        let matrix = SparseColMat::try_new_from_triplets(rows, rows, &entries).ok()?;
        let lu = matrix.as_ref().sp_lu().ok()?;
        Some(Self { lu, rows })
    }

    /// A⁻ᵀ b.
    pub fn solve_transposed(&self, b: &[Vec3]) -> Vec<Vec3> {
        let mut flat: Vec<f64> = b.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        let column = MatMut::from_column_major_slice_mut(&mut flat, self.rows, 1);
        self.lu.solve_transpose_in_place(column);
        flat.chunks_exact(3).map(Vec3::from_column_slice).collect()
    }

    /// A⁻¹ B in place, `columns` holding the columns of B one after the other.
    pub fn solve_columns(&self, columns: &mut [f64]) {
        let count = columns.len() / self.rows;
        let columns = MatMut::from_column_major_slice_mut(columns, self.rows, count);
        self.lu.solve_in_place(columns);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Structure;
    use super::*;
    use crate::check::noise;
    use std::sync::Arc;

    #[test]
    fn solving_undoes_multiplying_by_the_matrix_and_by_its_transpose() {
        let triangles: Vec<[u32; 3]> = (0..38).map(|i| [i, i + 1, i + 2]).collect();
        let structure = Structure::new(40, triangles.iter().map(<[u32; 3]>::as_slice));
        let mut symmetric = BlockMatrix::zeros(Arc::new(structure));
        for (t, [a, b, _]) in triangles.iter().enumerate() {
            let slot = symmetric.structure.slot(*b, *a);
            symmetric.add(slot, &Mat3::from_fn(|r, c| noise(17 * t + 3 * r + c)));
        }
        symmetric.add_diagonal(9.0, &[1.0; 40]);
        let block = |k: usize| Mat3::from_fn(|r, c| noise(900 + 11 * k + 3 * r + c));
        let blocks = [(5, 5, block(0)), (5, 6, block(1)), (30, 2, block(2))];
        let factor = GeneralFactor::new(&symmetric, &blocks).expect("dominant diagonal");
        let x: Vec<Vec3> = (0..40)
            .map(|i| Vec3::from_fn(|c, _| noise(3 * i + c)))
            .collect();
        let times = |transposed: bool| {
            let mut y = symmetric.multiply(&x);
            for (a, b, block) in &blocks {
                if transposed {
                    y[*b as usize] += block.transpose() * x[*a as usize];
                } else {
                    y[*a as usize] += block * x[*b as usize];
                }
            }
            y
        };
        let off = |back: &[Vec3]| {
            (x.iter().zip(back))
                .map(|(a, b)| (a - b).norm())
                .sum::<f64>()
        };
        // Condition number below 10, 120 numbers.
        assert!(off(&factor.solve_transposed(&times(true))) < 1e-12);
        let mut columns: Vec<f64> = times(false).iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        factor.solve_columns(&mut columns);
        let back: Vec<Vec3> = columns
            .chunks_exact(3)
            .map(Vec3::from_column_slice)
            .collect();
        assert!(off(&back) < 1e-12);
    }
}
