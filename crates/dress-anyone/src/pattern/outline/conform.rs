//! The mesh of a pattern as written: what a cutter would get, for draping once more.
//!
//! Boundary vertices lie at equal arc length on the written curves, as a mesher puts them. Interior
//! vertices move by the harmonic extension of the boundary's displacement d: Σ_j w_ij (d_i − d_j) = 0
//! with cotangent weights w, solved by conjugate gradients. The weights are kept positive, so no
//! interior vertex moves farther than the boundary does.

use crate::geometry::{Vec2, cross2};
use crate::pattern::{Pattern, PatternMesh};
use std::collections::BTreeMap;

/// Least and greatest weight of a mesh edge; triangles outside 1° to 179° would exceed them.
const WEIGHTS: (f64, f64) = (0.01, 100.0);

/// The system is solved when its residual has fallen to this share.
const SOLVED: f64 = 1e-13;

/// Rest positions \[m\] of the mesh of the written `pattern`, `[pattern vertex]`; `x_bar` is the
/// deformed mesh it was drawn from.
pub fn conform(pattern: &Pattern, mesh: &PatternMesh, x_bar: &[Vec2]) -> Vec<Vec2> {
    let mut displacement = vec![Vec2::zeros(); x_bar.len()];
    let mut on_boundary = vec![false; x_bar.len()];
    for (panel, edges) in pattern.panels.iter().zip(&mesh.edge_vertices) {
        for (e, along) in edges.iter().enumerate() {
            let (a, b) = panel.ends(e);
            let samples = panel.edges[e].curve.sample(a, b, along.len() - 1);
            for (&v, p) in along.iter().zip(samples) {
                displacement[v as usize] = p - x_bar[v as usize];
                on_boundary[v as usize] = true;
            }
        }
    }
    for panel in 0..mesh.panel_vertices.len() {
        extend(mesh, panel, x_bar, &on_boundary, &mut displacement);
    }
    x_bar.iter().zip(displacement).map(|(x, d)| x + d).collect()
}

/// Fills in the displacement of the panel's interior vertices.
fn extend(
    mesh: &PatternMesh,
    panel: usize,
    x_bar: &[Vec2],
    on_boundary: &[bool],
    displacement: &mut [Vec2],
) {
    let interior: Vec<usize> = mesh.panel_vertices[panel]
        .clone()
        .filter(|&v| !on_boundary[v])
        .collect();
    let unknown = |v: usize| interior.binary_search(&v).ok();
    let mut system = Laplacian::new(interior.len());
    let mut right = vec![Vec2::zeros(); interior.len()];
    for ((v, w), weight) in weights(mesh, panel, x_bar) {
        match (unknown(v), unknown(w)) {
            (Some(i), Some(j)) => system.join(i, j, weight),
            (Some(i), None) => {
                system.diagonal[i] += weight;
                right[i] += displacement[w] * weight;
            }
            (None, Some(j)) => {
                system.diagonal[j] += weight;
                right[j] += displacement[v] * weight;
            }
            (None, None) => {}
        }
    }
    for (v, d) in interior.iter().zip(system.solve(&right)) {
        displacement[*v] = d;
    }
}

/// Cotangent weight of each mesh edge of a panel, by its two vertices in order.
fn weights(mesh: &PatternMesh, panel: usize, x_bar: &[Vec2]) -> BTreeMap<(usize, usize), f64> {
    let mut weights = BTreeMap::new();
    for triangle in &mesh.triangles[mesh.panel_triangles[panel].clone()] {
        for corner in 0..3 {
            let [o, v, w] = [0, 1, 2].map(|k| triangle[(corner + k) % 3] as usize);
            let (to_v, to_w) = (x_bar[v] - x_bar[o], x_bar[w] - x_bar[o]);
            let cotangent = to_v.dot(&to_w) / cross2(to_v, to_w);
            *weights.entry((v.min(w), v.max(w))).or_insert(0.0) += 0.5 * cotangent;
        }
    }
    for weight in weights.values_mut() {
        // In this order, a weight that is not a number becomes the least one.
        *weight = weight.max(WEIGHTS.0).min(WEIGHTS.1);
    }
    weights
}

/// Graph Laplacian of the interior vertices; the boundary is in the diagonal only.
struct Laplacian {
    diagonal: Vec<f64>,
    neighbours: Vec<Vec<(usize, f64)>>,
}

impl Laplacian {
    fn new(size: usize) -> Self {
        Self {
            diagonal: vec![0.0; size],
            neighbours: vec![Vec::new(); size],
        }
    }

    fn join(&mut self, i: usize, j: usize, weight: f64) {
        for (here, there) in [(i, j), (j, i)] {
            self.diagonal[here] += weight;
            self.neighbours[here].push((there, weight));
        }
    }

    fn times(&self, x: &[Vec2]) -> Vec<Vec2> {
        let row = |i: usize| {
            let others = self.neighbours[i].iter().map(|&(j, w)| x[j] * w);
            x[i] * self.diagonal[i] - others.sum::<Vec2>()
        };
        (0..x.len()).map(row).collect()
    }

    /// Conjugate gradients, preconditioned by the diagonal; both coordinates at once.
    fn solve(&self, right: &[Vec2]) -> Vec<Vec2> {
        let dot = |a: &[Vec2], b: &[Vec2]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();
        let precondition = |r: &[Vec2]| -> Vec<Vec2> {
            let rows = r.iter().zip(&self.diagonal);
            rows.map(|(r, d)| r / d.max(f64::MIN_POSITIVE)).collect()
        };
        let mut x = vec![Vec2::zeros(); right.len()];
        let mut r = right.to_vec();
        let mut z = precondition(&r);
        let mut direction = z.clone();
        let mut size = dot(&r, &z);
        let enough = size * SOLVED * SOLVED;
        // Exact arithmetic needs as many steps as unknowns.
        for _ in 0..2 * right.len() {
            if size <= enough {
                break;
            }
            let image = self.times(&direction);
            let length = size / dot(&direction, &image);
            for i in 0..x.len() {
                x[i] += direction[i] * length;
                r[i] -= image[i] * length;
            }
            z = precondition(&r);
            let next = dot(&r, &z);
            for (d, z) in direction.iter_mut().zip(&z) {
                *d = z + *d * (next / size);
            }
            size = next;
        }
        x
    }
}
