//! Keeps a garment's shape while it is pulled to new places: affine-invariant stencils (de Goes,
//! Fong, O'Malley 2020).
//!
//! A stencil is a vertex c and its neighbours, E = [x_i − x_c] in the source drape. The projector
//! W = I − Eᵀ(EEᵀ)†E is blind to affine images of it. The relaxed X minimises
//! ½ Σ w/n ‖W [x_i − x_c]‖² + ½ Σ_v (x_v − z_v)ᵀM_v(x_v − z_v), and springs: ½ Σ k ‖x_v − Σ b_i x_i − o‖² over
//! edges that keep their length in the direction that they have, and over layers that are tied to one
//! another; ½ Σ s (a·(x_i − x_j) − r)² over edges that keep their slope. M_v is stiffer along the body's
//! normal than along the body, and slopes have one direction, so the three coordinates are coupled. The
//! system with the usual holds, factored once, preconditions conjugate gradients for those of a round.

use crate::geometry::sparse::{BlockMatrix, Factor, Structure};
use crate::geometry::{Mat3, Vec3};
use std::sync::Arc;

/// The factored system of a source drape.
pub(super) struct Relaxation {
    /// Stencils and springs.
    stiffness: BlockMatrix,
    /// Of the same with the usual holds.
    factor: Factor,
    springs: Springs,
}

/// A vertex and those whose layout around it is kept.
pub(super) struct Stencil {
    pub(super) centre: u32,
    pub(super) around: Vec<u32>,
}

/// How firmly a vertex is held in each direction, M_v \[–\] beside the stencils; positive definite.
pub(super) type Hold = Mat3;

/// An edge that keeps its length \[m\].
#[derive(Clone, Copy)]
pub(super) struct Kept {
    pub(super) ends: [u32; 2],
    pub(super) length: f64,
}

/// An edge that keeps its rise \[m\] along a unit direction.
pub(super) struct Slope {
    pub(super) ends: [u32; 2],
    pub(super) across: Vec3,
    pub(super) rise: f64,
    /// \[–\] beside the stencils.
    pub(super) stiffness: f64,
}

/// What holds vertices to each other besides the stencils.
#[derive(Default)]
pub(super) struct Springs {
    pub(super) kept: Vec<Kept>,
    pub(super) ties: Vec<Tie>,
    pub(super) slopes: Vec<Slope>,
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
/// Stiffness of regular stencils of edge length h against a displacement u, over |h² u″|² \[–\].
pub(super) const FLEXIBILITY: f64 = 0.094;
/// Stiffness of an edge that keeps its length \[–\]: far above what holds the vertices.
const KEEP: f64 = 3.0;
/// Stiffness of a tie \[–\]: firm beside what holds the vertices, soft beside the stencils.
const TIE: f64 = 0.3;
/// Most iterations of a solve; some thirty suffice.
const ITERATIONS: usize = 300;

impl Kept {
    /// The edge as long as it is in `x`.
    pub(super) fn of(ends: [u32; 2], x: &[Vec3]) -> Self {
        let [a, b] = ends.map(|v| x[v as usize]);
        let length = (a - b).norm();
        Self { ends, length }
    }
}

impl Relaxation {
    /// Of the drape `x` with these stencils and springs, usually held like this.
    pub(super) fn new(x: &[Vec3], stencils: &[Stencil], usual: &[Hold], springs: Springs) -> Self {
        let members = |s: &Stencil| [&[s.centre], &s.around[..]].concat();
        let mut cliques: Vec<Vec<u32>> = stencils.iter().map(members).collect();
        cliques.extend(springs.kept.iter().map(|kept| kept.ends.to_vec()));
        cliques.extend(springs.slopes.iter().map(|slope| slope.ends.to_vec()));
        cliques.extend(
            springs
                .ties
                .iter()
                .map(|tie| tie.ends().map(|(v, _)| v).to_vec()),
        );
        let structure = Structure::new(x.len(), cliques.iter().map(Vec::as_slice));
        let mut system = System::new(structure);
        for stencil in stencils {
            system.add_stencil(x, stencil);
        }
        for kept in &springs.kept {
            let [a, b] = kept.ends;
            system.add(&[(a, 1.0), (b, -1.0)], &Mat3::from_diagonal_element(KEEP));
        }
        for tie in &springs.ties {
            system.add(&tie.ends(), &Mat3::from_diagonal_element(TIE));
        }
        for slope in &springs.slopes {
            let [a, b] = slope.ends;
            let across = slope.across * slope.across.transpose();
            system.add(&[(a, 1.0), (b, -1.0)], &(across * slope.stiffness));
        }
        let stiffness = system.matrix.clone();
        for (v, hold) in usual.iter().enumerate() {
            system.add(&[(v as u32, 1.0)], hold);
        }
        let factor = system.matrix.factor();
        Self {
            stiffness,
            factor: factor.expect("projectors and positive holds are positive definite"),
            springs,
        }
    }

    /// The relaxed positions when every vertex v is held by M_v = `holds[v]` and pulled by M_v z_v = `pulls[v]`,
    /// sought from `start` to about `still` \[m\]; kept edges take their directions from `start`.
    pub(super) fn relax(
        &self,
        pulls: &[Vec3],
        holds: &[Hold],
        start: &[Vec3],
        still: f64,
    ) -> Vec<Vec3> {
        let mut x = start.to_vec();
        let mut r = pulls.to_vec();
        self.add_springs(start, &mut r);
        for (r, ax) in r.iter_mut().zip(self.times(holds, &x)) {
            *r -= ax;
        }
        let mut q = self.factor.solve(&r);
        let mut direction = q.clone();
        let mut slope = dot(&r, &q);
        for _ in 0..ITERATIONS {
            // The preconditioned residual is about how far there is to go.
            if q.iter().all(|q| q.norm() <= still) {
                break;
            }
            let pushed = self.times(holds, &direction);
            let step = slope / dot(&direction, &pushed);
            for v in 0..x.len() {
                x[v] += direction[v] * step;
                r[v] -= pushed[v] * step;
            }
            q = self.factor.solve(&r);
            let next = dot(&r, &q);
            let keep = next / slope;
            slope = next;
            for (direction, q) in direction.iter_mut().zip(&q) {
                *direction = q + *direction * keep;
            }
        }
        x
    }

    /// Adds what the springs ask for to `pulls`.
    fn add_springs(&self, directions: &[Vec3], pulls: &mut [Vec3]) {
        for kept in &self.springs.kept {
            let [a, b] = kept.ends.map(|v| v as usize);
            let edge = directions[a] - directions[b];
            let wanted = edge.try_normalize(0.0).unwrap_or_else(Vec3::zeros) * kept.length;
            pulls[a] += wanted * KEEP;
            pulls[b] -= wanted * KEEP;
        }
        for tie in &self.springs.ties {
            for (v, weight) in tie.ends() {
                pulls[v as usize] += tie.offset * (TIE * weight);
            }
        }
        for slope in &self.springs.slopes {
            let [a, b] = slope.ends.map(|v| v as usize);
            let force = slope.across * (slope.stiffness * slope.rise);
            pulls[a] += force;
            pulls[b] -= force;
        }
    }

    /// The whole matrix times `x`.
    fn times(&self, holds: &[Hold], x: &[Vec3]) -> Vec<Vec3> {
        let mut product = self.stiffness.multiply(x);
        for ((product, hold), x) in product.iter_mut().zip(holds).zip(x) {
            *product += hold * x;
        }
        product
    }
}

impl Tie {
    /// Vertices and their weights in what is kept: 1, and minus those of the triangle.
    fn ends(&self) -> [(u32, f64); 4] {
        let [a, b, c] = self.triangle;
        let [u, v, w] = self.weights.map(|weight| -weight);
        [(self.vertex, 1.0), (a, u), (b, v), (c, w)]
    }
}

fn dot(a: &[Vec3], b: &[Vec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(b)).sum()
}

/// A matrix in the making.
struct System {
    structure: Arc<Structure>,
    matrix: BlockMatrix,
}

impl System {
    fn new(structure: Structure) -> Self {
        let structure = Arc::new(structure);
        let matrix = BlockMatrix::zeros(Arc::clone(&structure));
        Self { structure, matrix }
    }

    /// Adds w wᵀ ⊗ `stiffness`, where w has these weights at these vertices.
    fn add(&mut self, weights: &[(u32, f64)], stiffness: &Mat3) {
        for &(row, first) in weights {
            for &(column, second) in weights.iter().filter(|(column, _)| *column <= row) {
                let slot = self.structure.slot(row, column);
                self.matrix.add(slot, &(stiffness * (first * second)));
            }
        }
    }

    /// Adds BᵀWB / n, where (B X)_i = x_i − x_c.
    fn add_stencil(&mut self, x: &[Vec3], stencil: &Stencil) {
        let centre = stencil.centre;
        let from = |i: &u32| x[*i as usize] - x[centre as usize];
        let edges: Vec<Vec3> = stencil.around.iter().map(from).collect();
        let basis = affine_basis(&edges);
        let share = 1.0 / edges.len() as f64;
        let mut add = |row: u32, column: u32, value: f64| {
            if row >= column {
                let slot = self.structure.slot(row, column);
                self.matrix.add_scalar(slot, value);
            }
        };
        for (i, &row) in stencil.around.iter().enumerate() {
            for (j, &column) in stencil.around.iter().enumerate() {
                let seen: f64 = basis.iter().map(|q| q[i] * q[j]).sum();
                let w = share * (f64::from(u8::from(i == j)) - seen);
                add(row, column, w);
                add(row, centre, -w);
                add(centre, column, -w);
                add(centre, centre, w);
            }
        }
    }
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
    use crate::geometry::mesh::rings;

    fn stencils(rings: Vec<Vec<u32>>) -> Vec<Stencil> {
        let stencil = |(v, around)| Stencil {
            centre: v as u32,
            around,
        };
        rings.into_iter().enumerate().map(stencil).collect()
    }

    /// M z.
    fn pulls(z: &[Vec3], holds: &[Hold]) -> Vec<Vec3> {
        holds.iter().zip(z).map(|(m, z)| m * z).collect()
    }

    fn bumpy() -> (Vec<Vec3>, Vec<Stencil>) {
        let mesh = sphere(0.3, 2);
        let bump = |(i, p): (usize, &Vec3)| p * (1.0 + 0.1 * noise(i));
        let x = mesh.positions.iter().enumerate().map(bump).collect();
        (x, stencils(rings(mesh.positions.len(), &mesh.triangles)))
    }

    /// Held a hundred times as firmly along the normal as along the sphere.
    fn holds(x: &[Vec3]) -> Vec<Hold> {
        let hold = |p: &Vec3| {
            let n = p.normalize();
            Hold::from_diagonal_element(1e-3) + n * n.transpose() * (0.1 - 1e-3)
        };
        x.iter().map(hold).collect()
    }

    #[test]
    fn affine_images_of_the_drape_need_no_relaxing() {
        let (x, stencils) = bumpy();
        let stretch = Mat3::from_fn(|i, j| noise(3 * i + j) + f64::from(u8::from(i == j)));
        let image: Vec<Vec3> = x.iter().map(|p| stretch * p + Vec3::repeat(0.7)).collect();
        let relaxation = Relaxation::new(&x, &stencils, &holds(&x), Springs::default());
        let forces = relaxation.times(&holds(&x), &image);
        // Nothing but the holds: positions of the order of 1 m.
        for (force, (hold, image)) in forces.iter().zip(holds(&x).iter().zip(&image)) {
            assert!((force - hold * image).norm() < 1e-12);
        }
        let relaxed = relaxation.relax(&pulls(&image, &holds(&x)), &holds(&x), &image, 1e-10);
        let mut both = relaxed.iter().zip(&image);
        assert!(both.all(|(a, b)| (a - b).norm() < 1e-12));
    }

    #[test]
    fn the_relaxed_shape_solves_the_coupled_system() {
        let (x, stencils) = bumpy();
        let holds = holds(&x);
        let relaxation = Relaxation::new(&x, &stencils, &holds, Springs::default());
        let z: Vec<Vec3> = (x.iter().enumerate())
            .map(|(i, p)| p + Vec3::from_fn(|c, _| 0.02 * noise(3 * i + c)))
            .collect();
        let relaxed = relaxation.relax(&pulls(&z, &holds), &holds, &x, 1e-12);
        let (left, right) = (relaxation.times(&holds, &relaxed), pulls(&z, &holds));
        // Forces are of the order of 0.1 · 0.3; a thousandth of that moves nothing by a micrometre.
        let mut both = left.iter().zip(&right);
        assert!(both.all(|(a, b)| (a - b).norm() < 1e-9));
    }

    #[test]
    fn a_spike_is_relaxed_away() {
        let (x, stencils) = bumpy();
        let mut z = x.clone();
        z[50] *= 1.3;
        let relaxation = Relaxation::new(&x, &stencils, &holds(&x), Springs::default());
        let relaxed = relaxation.relax(&pulls(&z, &holds(&x)), &holds(&x), &z, 1e-10);
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
        let springs = Springs {
            kept: vec![Kept::of(edge, &x)],
            ..Springs::default()
        };
        let relaxation = Relaxation::new(&x, &stencils, &holds(&x), springs);
        let relaxed = relaxation.relax(&pulls(&larger, &holds(&x)), &holds(&x), &larger, 1e-10);
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
        let holds = holds(&x[1..2].repeat(5));
        let relaxation = Relaxation::new(&x, &stencils, &holds, Springs::default());
        let relaxed = relaxation.relax(&pulls(&x, &holds), &holds, &x, 1e-12);
        assert!(relaxed.iter().zip(&x).all(|(a, b)| (a - b).norm() < 1e-14));
    }
}
