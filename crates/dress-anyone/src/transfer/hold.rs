//! How firmly each vertex is held to its place around the body.
//!
//! Stencils of edge length h that carry a displacement u cost about ½ · 0.094 |h² u″|² a vertex (regular
//! rings of six), a hold ½ m |u|². Together they let through what is longer than ℓ = h (0.094/m)^¼ and
//! even out what is shorter, so holds are given as lengths ℓ and are the same for any mesh. Across
//! the body ℓ is short where cloth touches it: the distance to the body is the fit. Elsewhere cloth is held by
//! its slopes ([`super::hang`]), and to its place by next to nothing. Along the body, lines are where the
//! design says: hems, seams and necklines are held at right angles to themselves. Between them cloth is
//! stretched as evenly as the stencils will; it does not follow how the skin slides.

use super::TransferParams;
use super::bind::{Carried, smoothstep};
use super::draped::Draped;
use super::relax::{FLEXIBILITY, Hold};
use crate::geometry::groups::Groups;
use crate::geometry::{Mat3, Vec3};

/// Cloth this close to the body touches it, and from the second distance on does not, as shares of the body's
/// height: 4 and 15 mm on an adult.
const TOUCHING: (f64, f64) = (0.0024, 0.009);
/// ℓ across, of cloth that does not touch, as share of the body's height.
const LOOSE: f64 = 0.25;
/// ℓ along, off the lines, of cloth that touches, as share of the body's height: 6 cm. Longer ones even cloth out
/// more, and lose more of its place on the way there and back.
const DRIFT: f64 = 0.035;
/// ℓ along of cloth that does not touch: 9 cm.
const SWING: f64 = 0.05;
/// Part of the hold along the body that is left where cloth is let go: ℓ grows by 3/5.
const LEFT: f64 = 0.15;
/// Rims this close, as share of the body's height, grip it if most of the rim does: waistbands, cuffs, collars.
/// 1.5 cm.
const GRIP: f64 = 0.009;
/// Shares of a rim that are near below which it does not grip, and from which on it does.
const MOST: (f64, f64) = (0.5, 0.8);
/// ℓ of a rim, as part of a seam's.
const RIM: f64 = 0.5;
/// ℓ of a rim that grips, as part of other cloth's.
const GRIPPING: f64 = 0.3;

/// How firmly a vertex is held, beside the stencils \[–\].
#[derive(Clone, Copy)]
pub(super) struct Firmness {
    /// Across the body, of what touches it.
    pub(super) touching: f64,
    /// Across the body, of all.
    loose: f64,
    /// Along the body.
    along: f64,
    /// At right angles to lines, along the body.
    line: Hold,
}

impl Firmness {
    /// Holds less firmly along the body.
    pub(super) fn let_go(&mut self) {
        self.along *= LEFT;
    }

    /// The hold of a vertex that does not touch the body, where `across` points away from it.
    pub(super) fn loose(&self, across: Vec3) -> Hold {
        Hold::from_diagonal_element(self.along)
            + across * across.transpose() * (self.loose - self.along)
            + self.line
    }
}

/// The share by which each vertex touches the body.
pub(super) fn touching(draped: &Draped<'_>) -> Vec<f64> {
    let share = |d: &f64| {
        let d = d / draped.height;
        1.0 - smoothstep((d - TOUCHING.0) / (TOUCHING.1 - TOUCHING.0))
    };
    draped.distance.iter().map(share).collect()
}

/// The firmness of cloth that is carried to `bound`, where `across` points away from the body, with these seams.
pub(super) fn firmness(
    draped: &Draped<'_>,
    (rims, seams): (&Rims, &[Vec<u32>]),
    (bound, across): (&[Carried], &[Vec3]),
    params: &TransferParams,
) -> Vec<Firmness> {
    let pairs = seams.iter().flat_map(|line| line.windows(2));
    let along_seams = along(bound, pairs.map(|pair| [pair[0], pair[1]]));
    let along_rims = along(bound, rims.sides.iter().copied());
    let touching = touching(draped);
    let of_one = |v: usize| {
        let blend = |from: f64, to: f64, t: f64| from + (to - from) * t;
        let firmness =
            |share: f64| FLEXIBILITY * (draped.sizes[v] / (share * draped.height)).powi(4);
        let on_rim = along_rims[v].trace() > 0.0;
        let (lines, part) = if on_rim {
            (along_rims[v], RIM)
        } else {
            (along_seams[v], 1.0)
        };
        let turned = across[v].cross_matrix();
        let grip = blend(1.0, GRIPPING, rims.grips[v]);
        let drift = blend(SWING, DRIFT, touching[v]);
        Firmness {
            touching: firmness(grip * params.spacing),
            loose: firmness(LOOSE),
            along: firmness(grip * blend(drift.max(params.place), params.place, rims.grips[v])),
            line: turned * lines * turned.transpose() * firmness(part * params.place),
        }
    };
    (0..bound.len()).map(of_one).collect()
}

/// Directions d of these edges at each vertex, where it is carried to, as mean of d dᵀ: which end an edge begins at
/// does not count, and where lines cross both do. Zero at vertices without one.
fn along(bound: &[Carried], edges: impl Iterator<Item = [u32; 2]>) -> Vec<Mat3> {
    let mut along = vec![Mat3::zeros(); bound.len()];
    for edge in edges {
        let [a, b] = edge.map(|v| v as usize);
        let side = bound[b].point - bound[a].point;
        for v in [a, b] {
            along[v] += side * side.transpose();
        }
    }
    let mean = |sum: Mat3| sum / sum.trace().max(f64::MIN_POSITIVE);
    along.into_iter().map(mean).collect()
}

/// The rims of a cloth: edges that have one triangle only.
pub(super) struct Rims {
    sides: Vec<[u32; 2]>,
    /// How far each vertex is on a rim that grips the body \[–\].
    pub(super) grips: Vec<f64>,
}

impl Rims {
    /// Of a draped cloth. A rim grips where it is near the body, if most of it is.
    pub(super) fn new(draped: &Draped<'_>) -> Self {
        let Draped {
            triangles,
            distance,
            height,
            ..
        } = draped;
        let sides_of = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
        let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(sides_of).collect();
        sides.sort_unstable_by_key(|&[a, b]| [a.min(b), a.max(b)]);
        let same = |[a, b]: &[u32; 2], [c, d]: &[u32; 2]| (a, b) == (d, c) || (a, b) == (c, d);
        let runs = sides.chunk_by(same).filter(|run| run.len() == 1);
        let sides: Vec<[u32; 2]> = runs.map(|run| run[0]).collect();
        let near = |v: u32| 1.0 - smoothstep(distance[v as usize] / (GRIP * height));
        let mut rims = Groups::new(distance.len());
        for side in &sides {
            rims.join(*side);
        }
        // Per rim, under its least vertex.
        let mut sums = vec![(0.0, 0.0); distance.len()];
        for side in &sides {
            let (sum, count) = &mut sums[rims.first_of(side[0]) as usize];
            *sum += near(side[0]) + near(side[1]);
            *count += 2.0;
        }
        let mut grips = vec![0.0; distance.len()];
        for v in sides.iter().flatten() {
            let (sum, count) = sums[rims.first_of(*v) as usize];
            let most = smoothstep((sum / count - MOST.0) / (MOST.1 - MOST.0));
            grips[*v as usize] = near(*v) * most;
        }
        Self { sides, grips }
    }
}

#[cfg(test)]
mod tests {
    use super::super::relax::{Relaxation, Springs, Stencil};
    use super::*;
    use crate::geometry::mesh::rings;

    /// How much of a displacement across a flat cloth with this wavelength is left \[–\].
    fn left_of_a_wave(edge: f64, wavelength: f64, params: &TransferParams) -> f64 {
        let (columns, rows) = ((1.0 / edge) as u32, (0.5 / edge) as u32);
        let mut x = Vec::new();
        let mut triangles = Vec::new();
        for j in 0..=rows {
            for i in 0..=columns {
                let shift = 0.5 * f64::from(j % 2);
                let row = f64::from(j) * 0.75_f64.sqrt();
                x.push(Vec3::new(f64::from(i) + shift, 0.0, row) * edge);
                if i < columns && j < rows {
                    let (a, c) = (j * (columns + 1) + i, (j + 1) * (columns + 1) + i);
                    triangles.extend(if j % 2 == 0 {
                        [[a, c, a + 1], [a + 1, c, c + 1]]
                    } else {
                        [[a, c, c + 1], [a, c + 1, a + 1]]
                    });
                }
            }
        }
        let draped = Draped {
            x: &x,
            triangles: &triangles,
            sizes: vec![edge; x.len()],
            distance: vec![0.0; x.len()],
            facing: vec![Vec3::y(); x.len()],
            up: Vec3::y(),
            height: 1.0,
            rings: &rings(x.len(), &triangles),
        };
        let bound = |p: &Vec3| Carried {
            point: *p,
            ease: 1.0,
            normals: [Vec3::y(); 2],
            map: crate::geometry::Mat3::identity(),
        };
        let bound: Vec<Carried> = x.iter().map(bound).collect();
        let rims = Rims {
            sides: Vec::new(),
            grips: vec![0.0; x.len()],
        };
        let firmness = firmness(&draped, (&rims, &[]), (&bound, &draped.facing), params);
        let across = Vec3::y() * Vec3::y().transpose();
        let hold = |f: &Firmness| f.loose(Vec3::y()) + across * f.touching;
        let holds: Vec<Hold> = firmness.iter().map(hold).collect();
        let stencil = |(v, ring): (usize, &Vec<u32>)| Stencil {
            centre: v as u32,
            around: ring.clone(),
        };
        let stencils: Vec<Stencil> = draped.rings.iter().enumerate().map(stencil).collect();
        let wave = |p: &Vec3| 1e-3 * (std::f64::consts::TAU * p.x / wavelength).cos();
        let z: Vec<Vec3> = x.iter().map(|p| p + Vec3::y() * wave(p)).collect();
        let relaxation = Relaxation::new(&x, &stencils, &holds, Springs::default());
        let pulls: Vec<Vec3> = holds.iter().zip(&z).map(|(m, z)| m * z).collect();
        let relaxed = relaxation.relax(&pulls, &holds, &x, 1e-9);
        // By the crest in the middle, whose rim is far away.
        let middle = (0..x.len()).filter(|&v| {
            let p = x[v];
            (p.x - 0.5).abs() < 0.25 && (p.z - 0.2).abs() < 0.1
        });
        let (mut moved, mut asked) = (0.0, 0.0);
        for v in middle {
            moved += (relaxed[v] - x[v]).y * wave(&x[v]);
            asked += wave(&x[v]).powi(2);
        }
        moved / asked
    }

    #[test]
    fn lengths_are_what_is_let_through_at_any_mesh_size() {
        let params = TransferParams {
            spacing: 0.05,
            ..TransferParams::default()
        };
        for edge in [0.02, 0.01] {
            // 1/(1 + (kℓ)⁴): k ℓ = 1 is the half, k ℓ = 2 the 17th part; wide tolerances for the
            // nearness of the rims.
            let half = left_of_a_wave(edge, std::f64::consts::TAU * 0.05, &params);
            assert!((half - 0.5).abs() < 0.12, "{edge} {half}");
            let little = left_of_a_wave(edge, std::f64::consts::TAU * 0.025, &params);
            assert!((little - 1.0 / 17.0).abs() < 0.05, "{edge} {little}");
        }
    }

    #[test]
    fn lines_count_alike_whichever_way_they_run_and_both_where_they_cross() {
        let bound = |p: Vec3| Carried {
            point: p,
            ease: 1.0,
            normals: [Vec3::y(); 2],
            map: Mat3::identity(),
        };
        let ends = [Vec3::x(), -Vec3::x(), Vec3::z(), -Vec3::z()];
        let bound: Vec<Carried> = [Vec3::zeros()].into_iter().chain(ends).map(bound).collect();
        for edges in [
            [[1, 0], [0, 2], [3, 0], [0, 4]],
            [[1, 0], [2, 0], [4, 0], [3, 0]],
        ] {
            let along = along(&bound, edges.into_iter());
            assert_eq!(along[0], Mat3::from_diagonal(&Vec3::new(0.5, 0.0, 0.5)));
            assert_eq!(along[1], Vec3::x() * Vec3::x().transpose());
        }
    }
}
