//! Lengths of sewn edges (paper §4.4, pattern matching): both sides of a seam must stay as long as
//! each other, up to the ease the designer gave them.
//!
//! Pieces: Σ_k (l_k − ρ_k l'_k)²/(l̄_k Σl̄) with ρ_k = l̄_k/l̄'_k; whole stitches: (Σl − ρ Σl')²/(Σl̄)²,
//! because many small mismatches may add up. The printed loss lacks the square, which makes it
//! unbounded below (METHOD E1).

use super::Row;
use crate::geometry::Vec2;
use crate::pattern::{Pattern, PatternMesh};

/// The sewn pieces of every stitch.
#[derive(Clone, Debug)]
pub struct SeamLength {
    stitches: Vec<Vec<Piece>>,
    /// Σl̄ over all stitches, first sides \[m\].
    total: f64,
}

/// One mesh edge on either side of a stitch.
#[derive(Clone, Copy, Debug)]
struct Piece {
    sides: [[u32; 2]; 2],
    /// Reference lengths \[m\].
    reference: [f64; 2],
}

impl SeamLength {
    /// Pairs up the mesh edges of every stitch.
    pub fn new(pattern: &Pattern, mesh: &PatternMesh) -> Self {
        let stitches: Vec<Vec<Piece>> = pattern
            .stitches
            .iter()
            .map(|stitch| {
                let first = mesh.along(stitch.sides[0]);
                let mut second = mesh.along(stitch.sides[1]).to_vec();
                if !stitch.right_wrong {
                    second.reverse();
                }
                let pairs = first.windows(2).zip(second.windows(2));
                let piece = |(a, b): (&[u32], &[u32])| {
                    let sides = [[a[0], a[1]], [b[0], b[1]]];
                    let length =
                        |[p, q]: [u32; 2]| (mesh.x_bar[q as usize] - mesh.x_bar[p as usize]).norm();
                    Piece {
                        sides,
                        reference: sides.map(length),
                    }
                };
                pairs
                    .map(piece)
                    .filter(|p| p.reference[0] > 0.0 && p.reference[1] > 0.0)
                    .collect()
            })
            .collect();
        let total = stitches.iter().flatten().map(|p| p.reference[0]).sum();
        Self { stitches, total }
    }

    /// Residuals of the pieces and of the whole stitches.
    pub fn rows(&self, x_bar: &[Vec2]) -> (Vec<Row>, Vec<Row>) {
        let mut pieces = Vec::new();
        let mut whole = Vec::new();
        for stitch in &self.stitches {
            let sums: [f64; 2] =
                std::array::from_fn(|i| stitch.iter().map(|p| p.reference[i]).sum());
            let mut sum = Row {
                value: 0.0,
                x: Vec::new(),
                x_bar: Vec::new(),
            };
            for piece in stitch {
                let ratio = piece.reference[0] / piece.reference[1];
                let mut row = Row {
                    value: 0.0,
                    x: Vec::new(),
                    x_bar: Vec::new(),
                };
                let scale = 1.0 / (piece.reference[0] * self.total).sqrt();
                add_length(&mut row, piece.sides[0], x_bar, scale);
                add_length(&mut row, piece.sides[1], x_bar, -scale * ratio);
                pieces.push(row);
                add_length(&mut sum, piece.sides[0], x_bar, 1.0 / sums[0]);
                add_length(&mut sum, piece.sides[1], x_bar, -1.0 / sums[1]);
            }
            whole.push(sum);
        }
        (pieces, whole)
    }
}

/// Adds `factor` times the length of a mesh edge to `row`.
fn add_length(row: &mut Row, [a, b]: [u32; 2], x_bar: &[Vec2], factor: f64) {
    let edge = x_bar[b as usize] - x_bar[a as usize];
    let length = edge.norm();
    let direction = edge.try_normalize(0.0).unwrap_or_else(Vec2::zeros) * factor;
    row.value += factor * length;
    row.x_bar.extend([(b, direction), (a, -direction)]);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::fixtures;

    #[test]
    fn rows_are_derivatives() {
        let (pattern, mesh) = fixtures::two_panels();
        let term = SeamLength::new(&pattern, &mesh);
        let still = fixtures::positions(mesh.cloth_vertex_count, 1);
        let motion: Vec<Vec2> = fixtures::rest(&mesh, 0.1, 40);
        let rows = |x_bar: &[Vec2]| {
            let (pieces, whole) = term.rows(x_bar);
            [pieces, whole].concat()
        };
        fixtures::check_rows(
            |_, x_bar| rows(x_bar),
            (&still, &still),
            (&fixtures::rest(&mesh, 0.005, 3), &motion),
        );
    }

    #[test]
    fn designed_ease_costs_nothing_and_scales_with_the_pattern() {
        let (pattern, mut mesh) = fixtures::two_panels();
        // The back is eased: 4 % longer everywhere.
        for v in mesh.panel_vertices[1].clone() {
            mesh.x_bar[v] *= 1.04;
        }
        let term = SeamLength::new(&pattern, &mesh);
        let larger: Vec<Vec2> = mesh.x_bar.iter().map(|p| p * 1.1).collect();
        let (pieces, whole) = term.rows(&larger);
        // Round-off.
        assert!(pieces.iter().chain(&whole).all(|r| r.value.abs() < 1e-13));
    }

    #[test]
    fn a_side_one_percent_longer_is_a_whole_seam_mismatch_of_one_percent() {
        let (pattern, mesh) = fixtures::two_panels();
        let term = SeamLength::new(&pattern, &mesh);
        let mut longer = mesh.x_bar.clone();
        for v in mesh.panel_vertices[0].clone() {
            longer[v] *= 1.01;
        }
        for row in term.rows(&longer).1 {
            assert!((row.value - 0.01).abs() < 1e-12, "{}", row.value);
        }
    }
}
