//! Distance to the target shape x* (paper §4.4, shape matching): mean squared distance, in units of
//! 1 cm, of free boundaries (by length), of seams (by length), and of all cloth (by area).

use super::Row;
use crate::geometry::Vec3;
use crate::pattern::PatternMesh;
use std::collections::BTreeMap;

/// The length that makes the loss a number: 1 cm \[m\].
const UNIT: f64 = 0.01;

/// Target positions and what share of each sum a vertex has.
#[derive(Clone, Debug)]
pub struct ShapeMatch {
    x_star: Vec<Vec3>,
    boundary: Vec<(u32, f64)>,
    seam: Vec<(u32, f64)>,
    interior: Vec<(u32, f64)>,
}

impl ShapeMatch {
    /// Shares by lengths and areas of the target shape.
    pub fn new(mesh: &PatternMesh, x_star: &[Vec3]) -> Self {
        let mut lengths = [BTreeMap::new(), BTreeMap::new()];
        for ((a, b), sewn) in outline_edges(mesh) {
            let length = (x_star[a as usize] - x_star[b as usize]).norm();
            for v in [a, b] {
                *lengths[usize::from(sewn)].entry(v).or_insert(0.0) += 0.5 * length;
            }
        }
        let mut areas = BTreeMap::new();
        for [a, b, c] in mesh.cloth_triangles() {
            let [p, q, r] = [a, b, c].map(|v| x_star[v as usize]);
            let area = 0.5 * (q - p).cross(&(r - p)).norm();
            for v in [a, b, c] {
                *areas.entry(v).or_insert(0.0) += area / 3.0;
            }
        }
        let [boundary, seam] = lengths.map(shares);
        Self {
            x_star: x_star.to_vec(),
            boundary,
            seam,
            interior: shares(areas),
        }
    }

    /// Residuals √share (x − x*)/1 cm of boundary, seams, and all cloth.
    pub fn rows(&self, x: &[Vec3]) -> [Vec<Row>; 3] {
        [&self.boundary, &self.seam, &self.interior].map(|shares| {
            let row = |&(v, share): &(u32, f64), axis: usize| {
                let scale = share.sqrt() / UNIT;
                let mut gradient = Vec3::zeros();
                gradient[axis] = scale;
                Row {
                    value: scale * (x[v as usize] - self.x_star[v as usize])[axis],
                    x: vec![(v, gradient)],
                    x_bar: Vec::new(),
                }
            };
            shares
                .iter()
                .flat_map(|s| (0..3).map(move |axis| row(s, axis)))
                .collect()
        })
    }
}

/// Each vertex's part of the sum; empty when the sum is zero (a garment without seams, say).
fn shares(sizes: BTreeMap<u32, f64>) -> Vec<(u32, f64)> {
    let sum: f64 = sizes.values().sum();
    let share = |(v, size): (u32, f64)| (v, size / sum);
    sizes.into_iter().filter(|_| sum > 0.0).map(share).collect()
}

/// The edges of all panel outlines as cloth edges, each once, and whether they are sewn.
pub fn outline_edges(mesh: &PatternMesh) -> BTreeMap<(u32, u32), bool> {
    let mut outline: BTreeMap<(u32, u32), bool> = BTreeMap::new();
    for chain in mesh.edge_vertices.iter().flatten() {
        for pair in chain.windows(2) {
            let [a, b] = [pair[0], pair[1]].map(|v| mesh.sewing[v as usize]);
            // Seen a second time, from the other side of a seam, it is sewn.
            let seen = outline.contains_key(&(a.min(b), a.max(b)));
            outline.insert((a.min(b), a.max(b)), seen);
        }
    }
    outline
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::fixtures;
    use approx::assert_relative_eq;

    #[test]
    fn rows_are_derivatives() {
        let (_, mesh) = fixtures::two_panels();
        let n = mesh.cloth_vertex_count;
        let term = ShapeMatch::new(&mesh, &fixtures::positions(n, 1));
        let motion = vec![crate::geometry::Vec2::zeros(); mesh.x_bar.len()];
        fixtures::check_rows(
            |x, _| term.rows(x).into_iter().flatten().collect(),
            (&fixtures::positions(n, 9), &fixtures::positions(n, 70)),
            (&mesh.x_bar, &motion),
        );
    }

    #[test]
    fn one_centimetre_everywhere_is_a_loss_of_one() {
        let (_, mesh) = fixtures::two_panels();
        let x_star = fixtures::positions(mesh.cloth_vertex_count, 1);
        let x: Vec<Vec3> = x_star
            .iter()
            .map(|p| p + Vec3::new(0.006, 0.008, 0.0))
            .collect();
        for rows in ShapeMatch::new(&mesh, &x_star).rows(&x) {
            let sum: f64 = rows.iter().map(|r| r.value * r.value).sum();
            assert_relative_eq!(sum, 1.0, max_relative = 1e-12);
        }
    }
}
