//! Free-form offsets: the model's surface moved onto the scan's, as rigidly as the scan allows.
//!
//! Minimises Σ w (n · (x − y))² + ρ Σ_edges ‖(x_i − x_j) − R_i (x⁰_i − x⁰_j)‖² (Sorkine, Alexa 2007)
//! with the pairs of [`super::pairs`] and best rotations R_i of each vertex' edges, in alternation;
//! ρ falls from round to round. Faces that turn over lose their pairs and are smoothed.

use super::Part;
use super::pairs::{Row, Search, pairs};
use super::scan::Scan;
use crate::geometry::sparse::{BlockMatrix, Structure};
use crate::geometry::{Mat3, TriangleMesh, Vec3};
use rayon::prelude::*;
use std::collections::BTreeSet;
use std::sync::Arc;

/// A surface moved onto the scan.
pub(super) struct Moved {
    /// \[m\], `[vertex]`.
    pub(super) positions: Vec<Vec3>,
    /// Faces still turned over in clothed parts.
    pub(super) flipped: usize,
}

/// Stiffness ρ \[–\] and reach σ \[m\] of each round.
const ROUNDS: [(f64, f64); 6] = [
    (3.0, 0.04),
    (1.0, 0.03),
    (0.3, 0.02),
    (0.1, 0.015),
    (0.03, 0.01),
    (0.01, 0.01),
];
/// Steps in a round.
const STEPS: usize = 4;
/// Pairs whose normals differ more do not belong together.
const COSINE: f64 = 0.5;
/// Rounds of mending turned faces.
const MENDINGS: usize = 6;

/// Moves `body` onto `scan`.
pub(super) fn conform(body: &TriangleMesh, parts: &[Part], scan: &Scan) -> Moved {
    let elastic = Elastic::new(body);
    let all_pairs = |now: &TriangleMesh, sigma| {
        let search = Search {
            sigma,
            cosine: COSINE,
            points: usize::MAX,
        };
        pairs(now, parts, scan, search)
    };
    let mut now = body.clone();
    for (stiffness, sigma) in ROUNDS {
        for _ in 0..STEPS {
            let rows = all_pairs(&now, sigma);
            elastic.step(&mut now.positions, &rows, stiffness);
        }
    }
    let (stiffness, sigma) = ROUNDS[ROUNDS.len() - 1];
    let mut loose = BTreeSet::new();
    let mut flipped = elastic.flipped(&now.positions);
    for _ in 0..MENDINGS {
        if flipped.is_empty() {
            break;
        }
        loose.extend(elastic.around(&flipped));
        let mut rows = all_pairs(&now, sigma);
        rows.retain(|row| !row.corners.iter().any(|v| loose.contains(v)));
        elastic.step(&mut now.positions, &rows, stiffness);
        flipped = elastic.flipped(&now.positions);
    }
    let clothed = |t: &&usize| {
        body.triangles[**t]
            .iter()
            .all(|v| parts[*v as usize].is_clothed())
    };
    Moved {
        flipped: flipped.iter().filter(clothed).count(),
        positions: now.positions,
    }
}

/// A surface that resists being bent and stretched.
struct Elastic<'a> {
    rest: &'a TriangleMesh,
    neighbours: Vec<Vec<u32>>,
    structure: Arc<Structure>,
}

impl<'a> Elastic<'a> {
    fn new(rest: &'a TriangleMesh) -> Self {
        let mut neighbours = vec![Vec::new(); rest.positions.len()];
        for &[a, b, c] in &rest.triangles {
            for [a, b] in [[a, b], [b, c], [c, a]] {
                neighbours[a as usize].push(b);
                neighbours[b as usize].push(a);
            }
        }
        for ring in &mut neighbours {
            ring.sort_unstable();
            ring.dedup();
        }
        let cliques = rest.triangles.iter().map(<[u32; 3]>::as_slice);
        let structure = Arc::new(Structure::new(rest.positions.len(), cliques));
        Self {
            rest,
            neighbours,
            structure,
        }
    }

    /// One step of all vertices at once, the vertices' rotations as they are now.
    fn step(&self, x: &mut [Vec3], rows: &[Row], stiffness: f64) {
        let turns = self.turns(x);
        let mut matrix = BlockMatrix::zeros(Arc::clone(&self.structure));
        let mut force = vec![Vec3::zeros(); x.len()];
        let r = &self.rest.positions;
        for (i, ring) in self.neighbours.iter().enumerate() {
            let own = self.structure.slot(i as u32, i as u32);
            for &j in ring {
                let k = j as usize;
                let mean = (turns[i] + turns[k]) * 0.5;
                force[i] -= ((x[i] - x[k]) - mean * (r[i] - r[k])) * (2.0 * stiffness);
                matrix.add_scalar(own, 2.0 * stiffness);
                if k < i {
                    matrix.add_scalar(self.structure.slot(i as u32, j), -2.0 * stiffness);
                }
            }
            // Far below every stiffness: only there for vertices in no triangle.
            matrix.add_scalar(own, 1e-9);
        }
        for row in rows {
            let n = row.aim.normal;
            let outer = n * n.transpose();
            let alone = row.shares[1] == 0.0 && row.shares[2] == 0.0;
            let count = if alone { 1 } else { 3 };
            for a in 0..count {
                let weight = row.weight * row.shares[a];
                force[row.corners[a] as usize] -= n * (weight * row.residual);
                for b in 0..count {
                    if row.corners[b] <= row.corners[a] {
                        let slot = self.structure.slot(row.corners[a], row.corners[b]);
                        matrix.add(slot, &(outer * (weight * row.shares[b])));
                    }
                }
            }
        }
        if let Some(factor) = matrix.factor() {
            for (x, step) in x.iter_mut().zip(factor.solve(&force)) {
                *x += step;
            }
        }
    }

    /// The rotation that best takes each vertex' edges at rest to those at `x`.
    fn turns(&self, x: &[Vec3]) -> Vec<Mat3> {
        let r = &self.rest.positions;
        let turn = |(i, ring): (usize, &Vec<u32>)| {
            let edge = |j: &u32| {
                let j = *j as usize;
                (x[i] - x[j]) * (r[i] - r[j]).transpose()
            };
            closest_rotation(ring.iter().map(edge).sum())
        };
        self.neighbours.par_iter().enumerate().map(turn).collect()
    }

    /// Faces turned more than a right angle against what their corners did.
    fn flipped(&self, x: &[Vec3]) -> Vec<usize> {
        let turns = self.turns(x);
        let normal = |t: &[u32; 3], p: &[Vec3]| {
            let [a, b, c] = t.map(|v| p[v as usize]);
            (b - a).cross(&(c - a))
        };
        let is_flipped = |t: &usize| {
            let triangle = &self.rest.triangles[*t];
            let rest = normal(triangle, &self.rest.positions);
            let turned: Vec3 = triangle.iter().map(|v| turns[*v as usize] * rest).sum();
            normal(triangle, x).dot(&turned) <= 0.0
        };
        (0..self.rest.triangles.len()).filter(is_flipped).collect()
    }

    /// The vertices of these faces and those around them.
    fn around(&self, faces: &[usize]) -> BTreeSet<u32> {
        let corners = faces.iter().flat_map(|t| self.rest.triangles[*t]);
        let rings = corners.flat_map(|v| self.neighbours[v as usize].clone());
        rings.collect()
    }
}

/// The rotation closest to `m`.
fn closest_rotation(m: Mat3) -> Mat3 {
    let svd = m.svd(true, true);
    let (Some(u), Some(v)) = (svd.u, svd.v_t) else {
        return Mat3::identity();
    };
    let mut turn = u * v;
    if turn.determinant() < 0.0 {
        let mut u = u;
        let least = svd.singular_values.imin();
        u.column_mut(least).neg_mut();
        turn = u * v;
    }
    turn
}
