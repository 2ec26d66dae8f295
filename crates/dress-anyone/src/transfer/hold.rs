//! How firmly each vertex is held to its place around the body.
//!
//! Stencils of edge length h that carry a displacement u cost about ½ · 0.094 |h² u″|² a vertex (regular
//! rings of six), a hold ½ m |u|². Together they let through what is longer than ℓ = h (0.094/m)^¼ and
//! even out what is shorter, so holds are given as lengths ℓ and are the same for any mesh. Across
//! the body ℓ is short: the garment's distance to it is the fit. Along the body it is long: the places of
//! cloth follow the body's proportions, not how its surface slides, which no cloth follows. Rims are
//! where the design says, and are held closer.

use super::TransferParams;
use super::bind::{Carried, smoothstep};
use super::relax::Hold;
use crate::geometry::Vec3;

/// Share of the body's height beyond which cloth hangs: 6 cm on an adult.
const HANGING: f64 = 0.035;
/// ℓ across, of hanging cloth, as share of the body's height.
const LOOSE: f64 = 0.12;
/// Rims this close, as share of the body's height, grip it: waistbands, cuffs, collars. 1.5 cm.
const GRIP: f64 = 0.009;
/// ℓ along, of a rim that hangs, as part of other cloth's.
const RIM: f64 = 0.5;
/// ℓ along and across, of a rim that grips, as part of other cloth's.
const GRIPPING: f64 = 0.3;

/// The holds of cloth `x` \[m\] that is `distance` \[m\] away from a body of this `height` \[m\].
pub(super) fn holds(
    x: &[Vec3],
    triangles: &[[u32; 3]],
    rings: &[Vec<u32>],
    (bound, distance): (&[Carried], &[f64]),
    height: f64,
    params: &TransferParams,
) -> Vec<Hold> {
    let sizes = sizes(x, rings);
    let on_rim = on_rim(x.len(), triangles);
    let held = |v: usize| {
        let blend = |from: f64, to: f64, t: f64| from + (to - from) * t;
        let hanging = smoothstep(distance[v] / (HANGING * height));
        let grips = 1.0 - smoothstep(distance[v] / (GRIP * height));
        let (rim, grip) = if on_rim[v] {
            (blend(RIM, GRIPPING, grips), blend(1.0, GRIPPING, grips))
        } else {
            (1.0, 1.0)
        };
        let firmness = |share: f64| 0.094 * (sizes[v] / (share * height)).powi(4);
        Hold {
            normal: bound[v].normals[1],
            across: firmness(grip * blend(params.spacing, LOOSE.max(params.spacing), hanging)),
            along: firmness(rim * params.place),
        }
    };
    (0..x.len()).map(held).collect()
}

/// Mean length of the edges around each vertex \[m\]; never far below the usual, for slivers and
/// loose vertices must be held too.
fn sizes(x: &[Vec3], rings: &[Vec<u32>]) -> Vec<f64> {
    let size = |(v, ring): (usize, &Vec<u32>)| {
        let sum: f64 = ring.iter().map(|&i| (x[i as usize] - x[v]).norm()).sum();
        sum / ring.len().max(1) as f64
    };
    let sizes: Vec<f64> = rings.iter().enumerate().map(size).collect();
    let mean = sizes.iter().sum::<f64>() / sizes.len().max(1) as f64;
    sizes.iter().map(|size| size.max(0.5 * mean)).collect()
}

/// Whether each vertex is on an edge that has one triangle only.
fn on_rim(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<bool> {
    let sides_of = |&[a, b, c]: &[u32; 3]| [[a, b], [b, c], [c, a]];
    let mut sides: Vec<[u32; 2]> = triangles.iter().flat_map(sides_of).collect();
    for side in &mut sides {
        side.sort_unstable();
    }
    sides.sort_unstable();
    let mut on_rim = vec![false; vertex_count];
    for run in sides.chunk_by(|a, b| a == b).filter(|run| run.len() == 1) {
        for v in run[0] {
            on_rim[v as usize] = true;
        }
    }
    on_rim
}

#[cfg(test)]
mod tests {
    use super::super::relax::{Relaxation, Stencil, rings};
    use super::*;

    /// How much of a displacement of a flat cloth with this wavelength is left \[–\].
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
        let rings = rings(x.len(), &triangles);
        let bound = |p: &Vec3| Carried {
            point: *p,
            ease: 1.0,
            normals: [Vec3::y(); 2],
            map: crate::geometry::Mat3::identity(),
        };
        let bound: Vec<Carried> = x.iter().map(bound).collect();
        let distance = vec![0.0; x.len()];
        let holds = holds(&x, &triangles, &rings, (&bound, &distance), 1.0, params);
        let stencil = |(v, ring): (usize, &Vec<u32>)| Stencil {
            centre: v as u32,
            around: ring.clone(),
        };
        let stencils: Vec<Stencil> = rings.iter().enumerate().map(stencil).collect();
        let wave = |p: &Vec3| 1e-3 * (std::f64::consts::TAU * p.x / wavelength).cos();
        let z: Vec<Vec3> = x.iter().map(|p| p + Vec3::x() * wave(p)).collect();
        let relaxed = Relaxation::new(&x, &stencils, holds, &[], vec![]).relax(&z, &x, 1e-9);
        // By the crest in the middle, whose rim is far away.
        let middle = (0..x.len()).filter(|&v| {
            let p = x[v];
            (p.x - 0.5).abs() < 0.25 && (p.z - 0.2).abs() < 0.1
        });
        let (mut moved, mut asked) = (0.0, 0.0);
        for v in middle {
            moved += (relaxed[v] - x[v]).x * wave(&x[v]);
            asked += wave(&x[v]).powi(2);
        }
        moved / asked
    }

    #[test]
    fn lengths_are_what_is_let_through_at_any_mesh_size() {
        let params = TransferParams {
            place: 0.05,
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
}
