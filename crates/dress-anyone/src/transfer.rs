//! The target shape x*: the source drape carried to the target body (paper §4.2; de Goes, Fong,
//! O'Malley 2020). Geometry only: not physical, no pattern.
//!
//! 1. Carry every cloth vertex from the space around the source body to that around the target
//!    (`bind`).
//! 2. Repeat: give it back its distance to the body, and relax (`relax`), which keeps the garment's
//!    layout and folds through affine-invariant stencils.
//! 3. Push out what still touches the body.
//!
//! Departures from the original: binding is to a smooth patch of body, not to a closest point, and
//! rebinding restores distances along the normal only; the place along the body stays tied to the
//! first binding, so the loop converges instead of creeping.

mod bind;
mod relax;

use crate::body::Body;
use crate::geometry::mesh::{bounds, vertex_normals};
use crate::geometry::{ClosestPoint, Vec3};
use bind::{BodyMap, Carried, smoothstep};
use rayon::prelude::*;
use relax::{Relaxation, rings};
use serde::{Deserialize, Serialize};

/// How the drape is carried over.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TransferParams {
    /// How firmly vertices are held where the body map puts them, against the stencils that keep
    /// the garment smooth \[–\]; the original's tightness. Raising it follows the body's details,
    /// lowering it evens them out. 0.01 loose to 1 tight; the paper gives none.
    pub tightness: f64,
    /// What becomes of the garment's distance to the body. The paper does not say.
    pub ease: Ease,
    /// Least distance to the body \[m\]; where the source drape is closer, its distance. 1e-3 to
    /// 5e-3; the simulator's contact distance or more saves it a push.
    pub thickness: f64,
    /// Most rounds of the loop \[–\]. 10 usually suffice; original: 25.
    pub iterations: usize,
    /// The loop ends when no vertex moves more than this share of the garment's diagonal \[–\].
    /// 1e-3 hasty to 1e-6 exact; original: 1e-4.
    pub tolerance: f64,
}

/// What becomes of the distance between garment and body on a body of another size.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Ease {
    /// Kept in metres: a coat stays as roomy as it was. For bodies within 15 % of each other's girth.
    Absolute,
    /// Grows with the body around: scaling the body scales the garment.
    Relative,
    /// Grows by the body's local growth to this power, 0 (absolute) to 1 (relative). 0.5 for very
    /// different bodies.
    Blend(f64),
}

impl Default for TransferParams {
    fn default() -> Self {
        Self {
            tightness: 0.1,
            ease: Ease::Absolute,
            thickness: 3e-3,
            iterations: 25,
            tolerance: 1e-4,
        }
    }
}

impl Ease {
    /// The power κ of the local growth by which distances to the body are multiplied.
    pub fn kappa(self) -> f64 {
        match self {
            Self::Absolute => 0.0,
            Self::Relative => 1.0,
            Self::Blend(kappa) => kappa,
        }
    }
}

/// The drape to aim for.
#[derive(Clone, Debug, PartialEq)]
pub struct Target {
    /// Positions on the target body \[m\], `[cloth vertex]`.
    pub x_star: Vec<Vec3>,
    /// Rounds of the loop.
    pub iterations: usize,
    /// Whether the loop ended by its tolerance.
    pub converged: bool,
    /// Signed distances to the target body \[m\], `[cloth vertex]`.
    pub clearance: Vec<f64>,
}

/// Why a drape cannot be carried over.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum TransferError {
    /// Vertex i of one body is not vertex i of the other.
    #[error(
        "the bodies `{source_body}` and `{target_body}` do not share one topology; \
         fit the body model to both first"
    )]
    DifferentTopology {
        /// Name of the source body.
        source_body: String,
        /// Name of the target body.
        target_body: String,
    },
    /// There is nothing to carry, or nowhere to carry it.
    #[error("{0} has no triangles")]
    Empty(String),
    /// A coordinate is not a number.
    #[error("{0} has a vertex whose position is not a number")]
    NotFinite(String),
}

/// Share of the way back to the first binding on which each round starts: 0 creeps along the body,
/// 1 never slides.
const RETURN: f64 = 0.5;
/// Distances \[m\] below which the distance is restored fully, and above which not at all.
const CLOSE: (f64, f64) = (0.01, 0.05);
/// Beyond this distance \[m\] cloth hangs: it is held a fifth as firmly.
const HANGING: f64 = 0.06;
/// Rims this close \[m\] to the body grip it (waistbands, cuffs, collars) and are held ten times as
/// firmly.
const GRIP: f64 = 0.015;
/// Rounds of averaging that free the garment's normals from wrinkles.
const NORMAL_ROUNDS: usize = 10;
/// Rounds of pushing out at the end, and of spreading each push.
const PUSHES: usize = 5;

/// Carries a drape from `source` to `target`, two bodies of one topology.
///
/// `triangles` index `drape`, the welded cloth \[m\], right side in front
/// ([`crate::pattern::PatternMesh::outward_triangles`]). Equal bodies give back the drape; moving
/// the target rigidly moves the result; with [`Ease::Relative`], scaling it scales the result.
pub fn target_shape(
    drape: &[Vec3],
    triangles: &[[u32; 3]],
    source: &Body,
    target: &Body,
    params: &TransferParams,
) -> Result<Target, TransferError> {
    check(drape, triangles, source, target)?;
    let rings = rings(drape.len(), triangles);
    let (on_source, on_target) = (
        ClosestPoint::new(&source.mesh),
        ClosestPoint::new(&target.mesh),
    );
    let distance: Vec<f64> = (drape.par_iter())
        .map(|&x| on_source.signed_distance(x))
        .collect();
    let outward = outward(drape, triangles, &rings, &on_source);
    let map = BodyMap::new(&source.mesh, &target.mesh, params.ease.kappa());
    let bound: Vec<Carried> = (0..drape.len())
        .into_par_iter()
        .map(|v| map.carry(drape[v], outward[v], distance[v]))
        .collect();

    let anchoring = anchoring(drape, triangles, &distance, params.tightness);
    let relaxation = Relaxation::new(drape, &rings, anchoring);
    let (low, high) = bounds(drape);
    let still = params.tolerance * (high - low).norm();
    let mut x: Vec<Vec3> = bound.iter().map(|carried| carried.point).collect();
    let mut iterations = 0;
    let mut converged = false;
    while iterations < params.iterations && !converged {
        let z: Vec<Vec3> = (0..x.len())
            .into_par_iter()
            .map(|v| {
                let start = x[v].lerp(&bound[v].point, RETURN);
                let wanted = distance[v] * bound[v].ease;
                let trust = 1.0 - smoothstep((distance[v] - CLOSE.0) / (CLOSE.1 - CLOSE.0));
                at_distance(&on_target, start, |now| {
                    let restored = now + trust * (wanted - now);
                    restored.max(params.thickness.min(wanted))
                })
            })
            .collect();
        let relaxed = relaxation.relax(&z);
        let moves = relaxed.iter().zip(&x).map(|(a, b)| (a - b).norm());
        converged = moves.fold(0.0, f64::max) <= still;
        x = relaxed;
        iterations += 1;
    }
    let least: Vec<f64> = (distance.iter().zip(&bound))
        .map(|(distance, carried)| params.thickness.min(distance * carried.ease))
        .collect();
    push_out(&mut x, &on_target, &rings, &least);
    let clearance = (x.par_iter())
        .map(|&x| on_target.signed_distance(x))
        .collect();
    Ok(Target {
        x_star: x,
        iterations,
        converged,
        clearance,
    })
}

fn check(
    drape: &[Vec3],
    triangles: &[[u32; 3]],
    source: &Body,
    target: &Body,
) -> Result<(), TransferError> {
    if !source.shares_topology(target) {
        return Err(TransferError::DifferentTopology {
            source_body: source.name.clone(),
            target_body: target.name.clone(),
        });
    }
    let body = |body: &Body| format!("the body `{}`", body.name);
    let garment = || "the drape".to_owned();
    for (positions, triangles, name) in [
        (drape, triangles, garment()),
        (&source.mesh.positions, &source.mesh.triangles, body(source)),
        (&target.mesh.positions, &target.mesh.triangles, body(target)),
    ] {
        if triangles.is_empty() {
            return Err(TransferError::Empty(name));
        }
        if !positions.iter().flatten().all(|x| x.is_finite()) {
            return Err(TransferError::NotFinite(name));
        }
    }
    Ok(())
}

/// Unit directions the cloth looks, freed from wrinkles, away from the body on the whole.
fn outward(
    drape: &[Vec3],
    triangles: &[[u32; 3]],
    rings: &[Vec<u32>],
    body: &ClosestPoint,
) -> Vec<Vec3> {
    let mut normals = vertex_normals(drape, triangles);
    for _ in 0..NORMAL_ROUNDS {
        normals = (rings.iter().zip(&normals))
            .map(|(ring, own)| own + ring.iter().map(|&i| normals[i as usize]).sum::<Vec3>())
            .map(|sum| sum.try_normalize(0.0).unwrap_or_else(Vec3::zeros))
            .collect();
    }
    // The winding of a whole garment may be inside out.
    let agreement: f64 = (drape.iter().zip(&normals))
        .filter_map(|(&x, n)| Some(body.pseudonormal(&body.query(x, f64::INFINITY)?).dot(n)))
        .sum();
    normals.iter().map(|n| n * agreement.signum()).collect()
}

/// How firmly each vertex is held: by its share of cloth, by how close the body is, and by whether
/// it lies on a rim that grips.
fn anchoring(drape: &[Vec3], triangles: &[[u32; 3]], distance: &[f64], tightness: f64) -> Vec<f64> {
    let mut areas = vec![0.0; drape.len()];
    let mut sides: Vec<[u32; 2]> = Vec::new();
    for &[a, b, c] in triangles {
        let [p, q, r] = [a, b, c].map(|v| drape[v as usize]);
        let third = (q - p).cross(&(r - p)).norm() / 6.0;
        for v in [a, b, c] {
            areas[v as usize] += third;
        }
        sides.extend([[a, b], [b, c], [c, a]].map(|[i, j]| [i.min(j), i.max(j)]));
    }
    let mean = areas.iter().sum::<f64>() / areas.len() as f64;
    let mut on_rim = vec![false; drape.len()];
    sides.sort_unstable();
    for run in sides.chunk_by(|a, b| a == b).filter(|run| run.len() == 1) {
        for v in run[0] {
            on_rim[v as usize] = true;
        }
    }
    let held = |v: usize| {
        let hanging = smoothstep(distance[v] / HANGING);
        let grip = if on_rim[v] {
            1.0 - smoothstep(distance[v] / GRIP)
        } else {
            0.0
        };
        // Slivers and loose vertices must be held a little too.
        let share = (areas[v] / mean).max(0.05);
        tightness * share * (1.0 - 0.8 * hanging) * (1.0 + 9.0 * grip)
    };
    (0..drape.len()).map(held).collect()
}

/// `x` moved along the body's normal to the signed distance `wanted(its distance now)`.
fn at_distance(body: &ClosestPoint, x: Vec3, wanted: impl Fn(f64) -> f64) -> Vec3 {
    let Some(foot) = body.query(x, f64::INFINITY) else {
        return x;
    };
    let now = body.signed(x, &foot);
    // On the surface the offset has no direction.
    let normal = (x - foot.point)
        .try_normalize(1e-9)
        .map_or_else(|| body.pseudonormal(&foot), |n| n * now.signum());
    x + normal * (wanted(now) - now)
}

/// Moves vertices closer than `least` \[m\] out to it, and their surroundings along.
fn push_out(x: &mut [Vec3], body: &ClosestPoint, rings: &[Vec<u32>], least: &[f64]) {
    let push = |v: usize, x: Vec3| at_distance(body, x, |now| now.max(least[v])) - x;
    for _ in 0..PUSHES {
        let pushes: Vec<Vec3> = (x.par_iter().enumerate())
            .map(|(v, &x)| push(v, x))
            .collect();
        for (v, ring) in rings.iter().enumerate() {
            let around: Vec3 = ring.iter().map(|&i| pushes[i as usize]).sum();
            let around = around / ring.len().max(1) as f64;
            x[v] += if around.norm() > pushes[v].norm() {
                around
            } else {
                pushes[v]
            };
        }
    }
    x.par_iter_mut()
        .enumerate()
        .for_each(|(v, x)| *x += push(v, *x));
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::FileFrame;
    use crate::check::noise;
    use crate::geometry::TriangleMesh;
    use crate::geometry::closest_point::tests::sphere;

    fn body(mesh: TriangleMesh) -> Body {
        Body {
            name: "ball".to_owned(),
            mesh,
            frame: FileFrame::SI,
            notes: Vec::new(),
        }
    }

    fn moved(body: &Body, f: impl Fn(Vec3) -> Vec3) -> Body {
        let mut body = body.clone();
        for p in &mut body.mesh.positions {
            *p = f(*p);
        }
        body
    }

    /// An uneven body and an open, wavy cloth around it.
    fn dressed() -> (Body, Vec<Vec3>, Vec<[u32; 3]>) {
        let bulge = |p: Vec3| p + Vec3::new(0.1, 0.7, 0.05) * p.x * p.y;
        let cloth = sphere(0.5, 4);
        let wave = |(i, p): (usize, &Vec3)| bulge(*p) * (1.06 + 0.01 * noise(i));
        let drape: Vec<Vec3> = cloth.positions.iter().enumerate().map(wave).collect();
        let mut triangles = cloth.triangles;
        triangles.retain(|t| t.iter().all(|&v| drape[v as usize].y.abs() < 0.3));
        (moved(&body(sphere(0.5, 4)), bulge), drape, triangles)
    }

    fn farthest(a: &[Vec3], b: &[Vec3]) -> f64 {
        (a.iter().zip(b))
            .map(|(a, b)| (a - b).norm())
            .fold(0.0, f64::max)
    }

    fn transfer(target: impl Fn(Vec3) -> Vec3, ease: Ease) -> (Vec<Vec3>, Target) {
        let (source, drape, triangles) = dressed();
        let params = TransferParams {
            ease,
            ..Default::default()
        };
        let target = moved(&source, target);
        let result = target_shape(&drape, &triangles, &source, &target, &params).unwrap();
        (drape, result)
    }

    #[test]
    fn the_source_body_gives_back_the_drape() {
        for ease in [Ease::Absolute, Ease::Blend(0.5), Ease::Relative] {
            let (drape, target) = transfer(|p| p, ease);
            // Rounding of a system of condition about 1e4.
            assert!(farthest(&target.x_star, &drape) < 1e-11);
            assert!(target.converged);
        }
    }

    #[test]
    fn a_scaled_body_gives_the_scaled_drape_with_relative_ease() {
        for scale in [0.6, 1.7] {
            let (drape, target) = transfer(|p| p * scale, Ease::Relative);
            let scaled: Vec<Vec3> = drape.iter().map(|x| x * scale).collect();
            assert!(farthest(&target.x_star, &scaled) < 1e-9);
        }
    }

    #[test]
    fn a_larger_body_keeps_the_ease_in_metres() {
        let (drape, target) = transfer(|p| p * 1.2, Ease::Absolute);
        let (source, ..) = dressed();
        let before = ClosestPoint::new(&source.mesh);
        let gaps = |v: usize| before.signed_distance(drape[v]);
        let mean =
            |f: &dyn Fn(usize) -> f64| (0..drape.len()).map(f).sum::<f64>() / drape.len() as f64;
        // A fifth more of a gap of 3 cm would be 6 mm.
        assert!((mean(&|v| target.clearance[v]) - mean(&gaps)).abs() < 2e-3);
    }

    #[test]
    fn moving_the_target_moves_the_result() {
        let grow = |p: Vec3| Vec3::new(p.x * 1.1, p.y * 0.95 + 0.1 * p.x * p.x, p.z * 1.3);
        let turn = nalgebra::Rotation3::from_euler_angles(0.4, -1.0, 2.0);
        let move_ = |p: Vec3| turn * p + Vec3::new(0.3, -1.0, 2.0);
        let (_, still) = transfer(grow, Ease::Absolute);
        let (_, turned) = transfer(|p| move_(grow(p)), Ease::Absolute);
        let expected: Vec<Vec3> = still.x_star.iter().map(|&x| move_(x)).collect();
        assert!(farthest(&turned.x_star, &expected) < 1e-9);
        assert_eq!(still.iterations, turned.iterations);
    }

    #[test]
    fn mirrored_in_is_mirrored_out() {
        let grow = |p: Vec3| Vec3::new(p.x * 1.1 + 0.05 * p.y, p.y * 0.95, p.z * 1.3);
        let mirror = |p: Vec3| Vec3::new(-p.x, p.y, p.z);
        let flip = |ts: &[[u32; 3]]| ts.iter().map(|&[a, b, c]| [a, c, b]).collect::<Vec<_>>();
        let (source, drape, triangles) = dressed();
        let mirrored = |b: &Body| {
            let mut body = moved(b, mirror);
            body.mesh.triangles = flip(&body.mesh.triangles);
            body
        };
        let target = moved(&source, grow);
        let params = TransferParams::default();
        let one = target_shape(&drape, &triangles, &source, &target, &params).unwrap();
        let drape: Vec<Vec3> = drape.iter().map(|&x| mirror(x)).collect();
        let [source, target] = [&source, &target].map(mirrored);
        let other = target_shape(&drape, &flip(&triangles), &source, &target, &params).unwrap();
        let back: Vec<Vec3> = other.x_star.iter().map(|&x| mirror(x)).collect();
        assert!(farthest(&back, &one.x_star) < 1e-9);
    }

    #[test]
    fn no_vertex_is_left_in_the_body() {
        // A bulge of 12 cm under a gap of 3 cm, narrower than the binding's patch.
        let dent = |p: Vec3| {
            let near = (-(p - Vec3::z() * 0.5).norm_squared() / 0.005).exp();
            p + p.normalize() * 0.12 * near
        };
        let (_, target) = transfer(dent, Ease::Absolute);
        let least = target
            .clearance
            .iter()
            .copied()
            .fold(f64::INFINITY, f64::min);
        // The thickness, less rounding.
        assert!(least > 3e-3 - 1e-4, "{least}");
    }

    #[test]
    fn what_cannot_be_carried_says_why() {
        let (source, mut drape, triangles) = dressed();
        let params = TransferParams::default();
        let other = body(sphere(0.5, 2));
        let error = target_shape(&drape, &triangles, &source, &other, &params).unwrap_err();
        assert!(matches!(error, TransferError::DifferentTopology { .. }));
        let error = target_shape(&drape, &[], &source, &source, &params).unwrap_err();
        assert_eq!(error, TransferError::Empty("the drape".to_owned()));
        drape[5].y = f64::NAN;
        let error = target_shape(&drape, &triangles, &source, &source, &params).unwrap_err();
        assert_eq!(error, TransferError::NotFinite("the drape".to_owned()));
    }
}
