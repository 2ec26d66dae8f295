//! Outlines that can be drawn: each edge of a panel should stay within reach of one cubic curve,
//! the most that a pattern file holds.
//!
//! At fixed parameters t_i, the chord lengths of the reference edge, the cubics through an edge's
//! ends are a linear space; with N its two inner Bernstein columns, what of the edge lies outside
//! is r = (I − N(NᵀN)⁻¹Nᵀ)(x̄ − (1−t)³x̄₀ − t³x̄ₙ). The term is Σ over edges of the mean of
//! |r − r̄|²/mm²; r̄, the reference's own, keeps arcs and odd curves from being pulled straight. Not
//! in the paper.

use super::Row;
use crate::geometry::Vec2;
use crate::pattern::PatternMesh;
use nalgebra::{DMatrix, Matrix2};

/// Off the cubic by this \[m\] counts 1.
const UNIT: f64 = 1e-3;
/// At most this many vertices of an edge are looked at: more tell nothing new of a smooth edge.
const SAMPLES: usize = 24;

/// The linear residuals of all edges.
#[derive(Clone, Debug)]
pub struct Drawable {
    stencils: Vec<Stencil>,
}

/// One vertex of one edge: r − r̄ = Σ aᵥ x̄ᵥ − r̄, in units of the term.
#[derive(Clone, Debug)]
struct Stencil {
    weights: Vec<(u32, f64)>,
    reference: Vec2,
}

impl Drawable {
    /// Residuals of the edges in `mesh`, zero at its rest positions.
    pub fn new(mesh: &PatternMesh) -> Self {
        let chains = mesh.edge_vertices.iter().flatten();
        let stencils = chains.flat_map(|chain| stencils(chain, &mesh.x_bar));
        Self {
            stencils: stencils.collect(),
        }
    }

    /// Two residuals for each vertex looked at.
    pub fn rows(&self, x_bar: &[Vec2]) -> Vec<Row> {
        let rows = |stencil: &Stencil| {
            let off = weighted(&stencil.weights, x_bar) - stencil.reference;
            [0, 1].map(|c| {
                let by = |(v, a): &(u32, f64)| {
                    let mut slope = Vec2::zeros();
                    slope[c] = *a;
                    (*v, slope)
                };
                Row {
                    value: off[c],
                    x: Vec::new(),
                    x_bar: stencil.weights.iter().map(by).collect(),
                }
            })
        };
        self.stencils.iter().flat_map(rows).collect()
    }
}

fn weighted(weights: &[(u32, f64)], x_bar: &[Vec2]) -> Vec2 {
    weights.iter().map(|(v, a)| x_bar[*v as usize] * *a).sum()
}

/// Those of one edge; none where two inner vertices or fewer can always be met.
fn stencils(chain: &[u32], x_bar: &[Vec2]) -> Vec<Stencil> {
    let mut t = vec![0.0];
    for pair in chain.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|v| x_bar[v as usize]);
        t.push(t[t.len() - 1] + (b - a).norm());
    }
    let last = chain.len() - 1;
    let inner = last.saturating_sub(1);
    if inner <= 2 || !(t[last] > 0.0) {
        return Vec::new();
    }
    let count = inner.min(SAMPLES);
    let sampled: Vec<usize> = (0..count)
        .map(|k| 1 + k * (inner - 1) / (count - 1))
        .collect();
    let bernstein = |i: usize| {
        let (t, s) = (t[i] / t[last], 1.0 - t[i] / t[last]);
        [s * s * s, 3.0 * s * s * t, 3.0 * s * t * t, t * t * t]
    };
    let n = DMatrix::from_fn(count, 2, |k, c| bernstein(sampled[k])[1 + c]);
    let normal = n.tr_mul(&n);
    let Some(inverse) = Matrix2::from_fn(|i, j| normal[(i, j)]).try_inverse() else {
        return Vec::new();
    };
    let inverse = DMatrix::from_fn(2, 2, |i, j| inverse[(i, j)]);
    let outside = DMatrix::identity(count, count) - &n * inverse * n.transpose();
    let scale = 1.0 / (UNIT * (count as f64).sqrt());
    let stencil = |k: usize| {
        let own = |j: usize| (chain[sampled[j]], scale * outside[(k, j)]);
        let end = |c: usize| -> f64 {
            let each = (0..count).map(|j| outside[(k, j)] * bernstein(sampled[j])[c]);
            -scale * each.sum::<f64>()
        };
        let mut weights: Vec<(u32, f64)> = (0..count).map(own).collect();
        weights.extend([(chain[0], end(0)), (chain[last], end(3))]);
        let reference = weighted(&weights, x_bar);
        Stencil { weights, reference }
    };
    (0..count).map(stencil).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::loss::fixtures;

    #[test]
    fn rows_are_derivatives() {
        let (_, mesh) = fixtures::two_panels();
        let term = Drawable::new(&mesh);
        let x = vec![Vec3::zeros(); mesh.cloth_vertex_count];
        fixtures::check_rows(
            |_, x_bar| term.rows(x_bar),
            (&x, &x),
            (
                &fixtures::rest(&mesh, 0.005, 3),
                &fixtures::rest(&mesh, 0.01, 40),
            ),
        );
    }

    #[test]
    fn edges_bent_into_cubics_lose_nothing_and_waves_their_mean_square() {
        let (_, mesh) = fixtures::two_panels();
        let term = Drawable::new(&mesh);
        let loss = |x_bar: &[Vec2]| -> f64 {
            term.rows(x_bar)
                .iter()
                .map(|row| row.value * row.value)
                .sum()
        };
        // A cubic map of the plane takes straight edges to cubics of the same parameter.
        let cubic = |p: &Vec2| p + Vec2::new(0.4 * p.y * p.y, 0.9 * p.x * p.x * p.x);
        let bent: Vec<Vec2> = mesh.x_bar.iter().map(cubic).collect();
        assert!(loss(&bent) < 1e-20);
        // The bottom edge, 0.3 m long, with five waves of 1 mm; waves are nearly orthogonal to
        // cubics, and their mean square is ½. The other edges keep straight.
        let wave = |p: &Vec2| {
            let on_bottom = p.y == 0.0;
            let height = 1e-3 * (p.x * 10.0 / 0.3 * std::f64::consts::PI).sin();
            p + Vec2::y() * if on_bottom { height } else { 0.0 }
        };
        let fine = crate::pattern::triangulate::mesh(&fixtures::two_panels().0, 0.01)
            .expect("a valid pattern");
        let term = Drawable::new(&fine);
        let waved: Vec<Vec2> = fine.x_bar.iter().map(wave).collect();
        let loss: f64 = (term.rows(&waved).iter().map(|row| row.value * row.value)).sum();
        // Two panels; sampling at 24 of 29 vertices and the small part a cubic follows shift it.
        assert!((0.8..1.2).contains(&loss), "{loss}");
    }
}
