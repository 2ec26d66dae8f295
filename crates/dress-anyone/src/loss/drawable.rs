//! Outlines that can be drawn: each edge of a panel should stay within reach of one cubic curve,
//! the most that a pattern file holds.
//!
//! At fixed parameters t_i, the chord lengths of the reference edge, the cubics through an edge's
//! ends are a linear space; with N its two inner Bernstein columns, what of the edge lies outside
//! is r = (I − N(NᵀN)⁻¹Nᵀ)(x̄ − (1−t)³x̄₀ − t³x̄ₙ). The term is Σ over edges of the mean of
//! |r − r̄ Δ/Δ̄|²/mm²; r̄, the reference's own, keeps arcs and odd curves from being pulled straight,
//! and turns and grows with the edge's chord Δ = x̄ₙ − x̄₀ (a product of complex numbers, linear in
//! x̄). Not in the paper.

use super::Row;
use crate::geometry::{Vec2, complex, point};
use crate::pattern::PatternMesh;
use nalgebra::{DMatrix, Matrix2};
use num_complex::Complex64;

/// Off the cubic by this \[m\] counts 1.
const UNIT: f64 = 1e-3;
/// A chord of less than this part of the edge's length has no direction to speak of.
const CLOSED: f64 = 0.01;
/// At most this many vertices of an edge are looked at: more tell nothing new of a smooth edge.
const SAMPLES: usize = 24;

/// The linear residuals of all edges.
#[derive(Clone, Debug)]
pub struct Drawable {
    stencils: Vec<Stencil>,
}

/// One vertex of one edge: Σ aᵥ x̄ᵥ with complex aᵥ, in units of the term.
#[derive(Clone, Debug)]
struct Stencil {
    weights: Vec<(u32, Complex64)>,
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
            let off = point(weighted(&stencil.weights, x_bar));
            [0, 1].map(|c| {
                // Rows of the matrix that multiplies by a.
                let by = |(v, a): &(u32, Complex64)| {
                    let slope = [Vec2::new(a.re, -a.im), Vec2::new(a.im, a.re)][c];
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

fn weighted(weights: &[(u32, Complex64)], x_bar: &[Vec2]) -> Complex64 {
    let each = weights.iter().map(|(v, a)| a * complex(x_bar[*v as usize]));
    each.sum()
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
    let [first, end] = [chain[0], chain[last]];
    let chord = complex(x_bar[end as usize] - x_bar[first as usize]);
    if inner <= 2 || !(chord.norm() > CLOSED * t[last]) {
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
        let own = |j: usize| (chain[sampled[j]], Complex64::from(scale * outside[(k, j)]));
        let at_end = |c: usize| -> Complex64 {
            let each = (0..count).map(|j| outside[(k, j)] * bernstein(sampled[j])[c]);
            Complex64::from(-scale * each.sum::<f64>())
        };
        let mut weights: Vec<(u32, Complex64)> = (0..count).map(own).collect();
        weights.extend([(first, at_end(0)), (end, at_end(3))]);
        let reference = weighted(&weights, x_bar) / chord;
        weights.extend([(first, reference), (end, -reference)]);
        Stencil { weights }
    };
    (0..count).map(stencil).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::loss::fixtures;

    /// Edges that no cubic draws.
    fn wavy() -> PatternMesh {
        let (_, mut mesh) = fixtures::two_panels();
        for p in &mut mesh.x_bar {
            let (x, y) = (p.x, p.y);
            *p += 5e-3 * Vec2::new((40.0 * y).sin(), (40.0 * x).sin());
        }
        mesh
    }

    #[test]
    fn what_the_reference_has_may_turn_and_grow_with_it() {
        let mesh = wavy();
        let term = Drawable::new(&mesh);
        let similar = |p: &Vec2| 1.1 * Vec2::new(0.8 * p.x - 0.6 * p.y, 0.6 * p.x + 0.8 * p.y);
        for row in term.rows(&mesh.x_bar.iter().map(similar).collect::<Vec<_>>()) {
            // Round-off of some millimetres in units of one.
            assert!(row.value.abs() < 1e-12, "{}", row.value);
        }
    }

    #[test]
    fn rows_are_derivatives() {
        let mesh = wavy();
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
