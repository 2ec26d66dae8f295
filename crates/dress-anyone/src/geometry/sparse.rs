//! Symmetric sparse matrices of 3×3 blocks, one block row per vertex, and their Cholesky
//! factors. The pattern is fixed, so the symbolic phase is done once and kept.

mod dissection;
mod general;

use crate::geometry::{Mat3, Vec3};
use dissection::dissected;
use faer::dyn_stack::{MemBuffer, MemStack};
use faer::linalg::cholesky::llt::factor::LltRegularization;
use faer::perm::PermRef;
use faer::sparse::linalg::amd;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMatRef};
use faer::{Conj, MatMut, Par, Side};
pub use general::GeneralFactor;
use rayon::prelude::*;
use std::sync::Arc;

/// Right-hand sides solved together: enough to reuse each panel of the factor from cache.
const BLOCK: usize = 16;

/// The fixed sparsity of a block matrix: its lower triangle, by columns.
#[derive(Debug)]
pub struct Structure {
    vertex_count: usize,
    /// Block rows below the diagonal of each block column, sorted.
    rows: Vec<u32>,
    /// Where each block column starts in `rows`.
    starts: Vec<usize>,
    /// The same for single columns and rows, as the factorisation wants it.
    column_starts: Vec<usize>,
    row_indices: Vec<usize>,
    symbolic: SymbolicCholesky<usize>,
}

/// Where the block of a vertex pair lies: resolved once per element.
#[derive(Clone, Copy, Debug)]
pub struct Slot {
    column: u32,
    /// Index of the block below the diagonal; `DIAGONAL` for the diagonal itself.
    below: u32,
}

const DIAGONAL: u32 = u32::MAX;

impl Structure {
    /// The structure in which every two vertices of each of `cliques` are coupled.
    ///
    /// # Panics
    /// When the matrix has more entries than memory can index.
    pub fn new<'a>(vertex_count: usize, cliques: impl Iterator<Item = &'a [u32]>) -> Self {
        let mut pairs: Vec<(u32, u32)> = Vec::new();
        for clique in cliques {
            for &a in clique {
                pairs.extend(clique.iter().filter(|b| **b > a).map(|b| (a, *b)));
            }
        }
        pairs.sort_unstable();
        pairs.dedup();
        let mut starts = vec![0; vertex_count + 1];
        for (column, _) in &pairs {
            starts[*column as usize + 1] += 1;
        }
        for v in 0..vertex_count {
            starts[v + 1] += starts[v];
        }
        let rows: Vec<u32> = pairs.into_iter().map(|(_, row)| row).collect();

        let mut column_starts = vec![0];
        let mut row_indices = Vec::new();
        for v in 0..vertex_count {
            for j in 0..3 {
                row_indices.extend((j..3).map(|i| 3 * v + i));
                for &row in &rows[starts[v]..starts[v + 1]] {
                    row_indices.extend((0..3).map(|i| 3 * row as usize + i));
                }
                column_starts.push(row_indices.len());
            }
        }
        let n = 3 * vertex_count;
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &column_starts, None, &row_indices);
        let factored = |order: Vec<usize>| {
            let (order, inverse) = by_unknowns(&order);
            factorize_symbolic_cholesky(
                pattern,
                Side::Lower,
                SymmetricOrdering::Custom(PermRef::new_checked(&order, &inverse, n)),
                CholeskySymbolicParams::default(),
            )
            .expect("the structure of a mesh fits into memory")
        };
        // Which fills less depends on the garment: of a tube dissection, of a T-shirt the other.
        let by_degree = factored(minimum_degree(vertex_count, &starts, &rows));
        let by_cuts = factored(dissected(vertex_count, &starts, &rows));
        let symbolic = if by_cuts.len_val() < by_degree.len_val() {
            by_cuts
        } else {
            by_degree
        };
        Self {
            vertex_count,
            rows,
            starts,
            column_starts,
            row_indices,
            symbolic,
        }
    }

    /// The slot of the block (row a, column b), a ≥ b; the pair must be coupled.
    pub fn slot(&self, a: u32, b: u32) -> Slot {
        if a == b {
            return Slot {
                column: b,
                below: DIAGONAL,
            };
        }
        let rows = &self.rows[self.starts[b as usize]..self.starts[b as usize + 1]];
        let below = rows.binary_search(&a).expect("the pair is coupled") as u32;
        Slot { column: b, below }
    }

    /// Whether the pair (row a, column b), a > b, is coupled.
    pub fn coupled(&self, a: u32, b: u32) -> bool {
        self.rows[self.starts[b as usize]..self.starts[b as usize + 1]]
            .binary_search(&a)
            .is_ok()
    }

    /// Non-zeros of the Cholesky factor.
    pub fn factor_size(&self) -> usize {
        self.symbolic.len_val()
    }
}

/// An order of elimination of the blocks by approximate minimum degree (Amestoy, Davis & Duff 1996).
fn minimum_degree(count: usize, starts: &[usize], rows: &[u32]) -> Vec<usize> {
    let rows: Vec<usize> = rows.iter().map(|row| *row as usize).collect();
    let graph = SymbolicSparseColMatRef::new_checked(count, count, starts, None, &rows);
    let (mut order, mut inverse) = (vec![0; count], vec![0; count]);
    let scratch = amd::order_scratch::<usize>(count, rows.len());
    amd::order(
        &mut order,
        &mut inverse,
        graph,
        amd::Control::default(),
        MemStack::new(&mut MemBuffer::new(scratch)),
    )
    .expect("the structure of a mesh fits into memory");
    order
}

/// The order of unknowns from that of blocks, the three of a vertex one after the other: a graph of a third
/// of the nodes and a ninth of the edges is ordered in less than half the time. Old index of each new one,
/// and the reverse.
fn by_unknowns(blocks: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let threefold = |v: &usize| [3 * v, 3 * v + 1, 3 * v + 2];
    let order: Vec<usize> = blocks.iter().flat_map(threefold).collect();
    let mut inverse = vec![0; order.len()];
    for (new, old) in order.iter().enumerate() {
        inverse[*old] = new;
    }
    (order, inverse)
}

/// A symmetric matrix of 3×3 blocks.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    structure: Arc<Structure>,
    values: Vec<f64>,
}

impl BlockMatrix {
    /// The zero matrix.
    pub fn zeros(structure: Arc<Structure>) -> Self {
        let values = vec![0.0; structure.row_indices.len()];
        Self { structure, values }
    }

    /// Adds `block` at `slot`. Of a diagonal block the lower triangle counts.
    pub fn add(&mut self, slot: Slot, block: &Mat3) {
        let column = 3 * slot.column as usize;
        for j in 0..3 {
            let start = self.structure.column_starts[column + j];
            if slot.below == DIAGONAL {
                for i in j..3 {
                    self.values[start + i - j] += block[(i, j)];
                }
            } else {
                let start = start + 3 - j + 3 * slot.below as usize;
                for i in 0..3 {
                    self.values[start + i] += block[(i, j)];
                }
            }
        }
    }

    /// Adds `factor · I` at `slot`.
    pub fn add_scalar(&mut self, slot: Slot, factor: f64) {
        let column = 3 * slot.column as usize;
        for j in 0..3 {
            let start = self.structure.column_starts[column + j];
            let offset = if slot.below == DIAGONAL {
                0
            } else {
                3 + 3 * slot.below as usize
            };
            self.values[start + offset] += factor;
        }
    }

    /// Adds `factor · diag` with one entry per vertex.
    pub fn add_diagonal(&mut self, factor: f64, diagonal: &[f64]) {
        for (v, d) in diagonal.iter().enumerate() {
            self.add_scalar(
                Slot {
                    column: v as u32,
                    below: DIAGONAL,
                },
                factor * d,
            );
        }
    }

    /// Matrix times vector.
    pub fn multiply(&self, x: &[Vec3]) -> Vec<Vec3> {
        let mut y = vec![Vec3::zeros(); x.len()];
        for (row, column, value) in self.entries() {
            y[row / 3][row % 3] += value * x[column / 3][column % 3];
            if row != column {
                y[column / 3][column % 3] += value * x[row / 3][row % 3];
            }
        }
        y
    }

    /// (row, column, value) of the lower triangle, column by column.
    fn entries(&self) -> impl Iterator<Item = (usize, usize, f64)> {
        let s = &self.structure;
        (0..3 * s.vertex_count).flat_map(move |column| {
            let range = s.column_starts[column]..s.column_starts[column + 1];
            range.map(move |at| (s.row_indices[at], column, self.values[at]))
        })
    }

    /// Cholesky factor; none when the matrix is not positive definite.
    pub fn factor(&self) -> Option<Factor> {
        self.factor_in(&mut Workspace::default())
    }

    /// The same in memory that an earlier one has left behind: at thousands of vertices fresh pages
    /// cost as much as a tenth of the arithmetic.
    pub fn factor_in(&self, workspace: &mut Workspace) -> Option<Factor> {
        let s = &self.structure;
        let n = 3 * s.vertex_count;
        let pattern =
            SymbolicSparseColMatRef::new_checked(n, n, &s.column_starts, None, &s.row_indices);
        let matrix = SparseColMatRef::new(pattern, &self.values);
        let scratch = s
            .symbolic
            .factorize_numeric_llt_scratch::<f64>(Par::Seq, faer::Spec::default());
        let mut values = std::mem::take(&mut workspace.values);
        values.resize(s.symbolic.len_val(), 0.0);
        let buffer = workspace
            .buffer
            .take_if(|buffer| buffer.len() >= scratch.unaligned_bytes_required())
            .unwrap_or_else(|| MemBuffer::new(scratch));
        let buffer = workspace.buffer.insert(buffer);
        // One thread: the order of sums, and so every bit, stays the same on any machine.
        let result = s.symbolic.factorize_numeric_llt(
            &mut values,
            matrix,
            Side::Lower,
            LltRegularization::default(),
            Par::Seq,
            MemStack::new(buffer),
            faer::Spec::default(),
        );
        if result.is_err() {
            workspace.values = values;
            return None;
        }
        Some(Factor {
            structure: Arc::clone(s),
            values,
        })
    }
}

/// Memory for factors, kept between them.
#[derive(Default)]
pub struct Workspace {
    values: Vec<f64>,
    buffer: Option<MemBuffer>,
}

impl Workspace {
    /// Takes over the memory of a factor that has done its work.
    pub fn recycle(&mut self, factor: Factor) {
        self.values = factor.values;
    }
}

/// L of K = L Lᵀ.
#[derive(Clone, Debug)]
pub struct Factor {
    structure: Arc<Structure>,
    values: Vec<f64>,
}

impl Factor {
    /// K⁻¹ b.
    pub fn solve(&self, b: &[Vec3]) -> Vec<Vec3> {
        let mut flat: Vec<f64> = b.iter().flat_map(|v| [v.x, v.y, v.z]).collect();
        self.solve_columns(&mut flat);
        flat.chunks_exact(3)
            .map(|c| Vec3::new(c[0], c[1], c[2]))
            .collect()
    }

    /// K⁻¹ B in place, `columns` holding the columns of B one after the other. Blocks of columns
    /// are solved in parallel, each always by the same operations.
    pub fn solve_columns(&self, columns: &mut [f64]) {
        let n = 3 * self.structure.vertex_count;
        columns.par_chunks_mut(n * BLOCK).for_each(|block| {
            let count = block.len() / n;
            let symbolic = &self.structure.symbolic;
            let scratch = symbolic.solve_in_place_scratch::<f64>(count, Par::Seq);
            LltRef::new(symbolic, &self.values).solve_in_place_with_conj(
                Conj::No,
                MatMut::from_column_major_slice_mut(block, n, count),
                Par::Seq,
                MemStack::new(&mut MemBuffer::new(scratch)),
            );
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    /// A diagonally dominant matrix over a strip of triangles.
    fn strip(count: usize) -> BlockMatrix {
        let triangles: Vec<[u32; 3]> = (0..count as u32 - 2).map(|i| [i, i + 1, i + 2]).collect();
        let structure = Structure::new(count, triangles.iter().map(<[u32; 3]>::as_slice));
        let mut matrix = BlockMatrix::zeros(Arc::new(structure));
        for (t, triangle) in triangles.iter().enumerate() {
            for (i, &a) in triangle.iter().enumerate() {
                for &b in &triangle[..i] {
                    let block = Mat3::from_fn(|r, c| noise(17 * t + 3 * r + c + i));
                    let slot = matrix.structure.slot(a, b);
                    matrix.add(slot, &block);
                }
            }
        }
        matrix.add_diagonal(20.0, &vec![1.0; count]);
        matrix
    }

    fn vectors(count: usize, seed: usize) -> Vec<Vec3> {
        (0..count)
            .map(|i| Vec3::from_fn(|c, _| noise(seed + 3 * i + c)))
            .collect()
    }

    #[test]
    fn solving_undoes_multiplying() {
        for count in [3, 40, 400] {
            let matrix = strip(count);
            let x = vectors(count, 5);
            let back = matrix
                .factor()
                .expect("dominant diagonal")
                .solve(&matrix.multiply(&x));
            let worst = x
                .iter()
                .zip(&back)
                .map(|(a, b)| (a - b).norm())
                .fold(0.0, f64::max);
            // Condition number below 10.
            assert!(worst < 1e-13, "{worst}");
        }
    }

    #[test]
    fn many_right_hand_sides_are_solved_as_one_by_one() {
        let factor = strip(50).factor().expect("dominant diagonal");
        let sides: Vec<Vec<Vec3>> = (0..40).map(|k| vectors(50, 1000 * k)).collect();
        let mut columns: Vec<f64> = sides
            .iter()
            .flatten()
            .flat_map(|v| [v.x, v.y, v.z])
            .collect();
        factor.solve_columns(&mut columns);
        for (side, column) in sides.iter().zip(columns.chunks_exact(150)) {
            for (a, b) in factor.solve(side).iter().zip(column.chunks_exact(3)) {
                // Blocked and single solves may round differently.
                assert!((a - Vec3::new(b[0], b[1], b[2])).norm() < 1e-14);
            }
        }
    }

    #[test]
    fn an_indefinite_matrix_has_no_factor() {
        let mut matrix = strip(40);
        matrix.add_diagonal(-25.0, &vec![1.0; 40]);
        assert!(matrix.factor().is_none());
    }
}
