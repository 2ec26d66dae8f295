//! The target shape x*: the source drape carried to the target body (paper §4.2; de Goes, Fong,
//! O'Malley 2020). Geometry only: not physical, no pattern.
//!
//! 1. Carry every cloth vertex from the space around the source body to that around the target
//!    (`bind`).
//! 2. Repeat: give it back its distance to the body (`ease`), and relax (`relax`), which keeps the
//!    garment's layout, lines and layers (`layout`, `layers`) through affine-invariant stencils. Along
//!    the body cloth is held softly, across it firmly (`hold`).
//! 3. Take it out of the body (`clear`), and where triangles met it, relax once more.
//!
//! Departures from the original: binding is to a smooth patch of body, not to a closest point, and
//! rebinding restores distances along the normal only; the place along the body stays tied to the
//! first binding, so the loop converges instead of creeping.

mod bind;
mod clear;
mod ease;
mod hold;
mod layers;
mod layout;
mod paint;
mod relax;
mod room;

use crate::body::Body;
use crate::geometry::mesh::{bounds, vertex_normals};
use crate::geometry::{ClosestPoint, Vec3};
use bind::{BodyMap, Carried, smoothstep};
use clear::{Clearing, at_distance, belongs};
pub use ease::{Ease, EaseAt};
pub use layout::{Layout, Zone};
pub use paint::Paint;
use rayon::prelude::*;
use relax::{Relaxation, Stencil, rings};
use serde::{Deserialize, Serialize};

/// How the drape is carried over.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TransferParams {
    /// Details of the body smaller than this are evened out in the garment's distance to it, as
    /// share of the body's height \[–\]; the original's tightness. 0.005 follows every detail,
    /// 0.03 few. The paper gives none.
    pub spacing: f64,
    /// The same for places along the body: what its surface does over less than this, cloth does not
    /// follow \[–\]. 0.02 follows the body's skin, 0.1 its proportions only.
    pub place: f64,
    /// What becomes of the garment's distance to the body. The paper does not say.
    pub ease: Ease,
    /// Panels of another ease.
    pub zones: Vec<Zone>,
    /// Panels that keep the size they have in the source drape: pockets, badges, cuffs.
    pub keep: Vec<String>,
    /// Edges that keep their length, each as "PANEL:EDGE", by number or by label.
    pub keep_length: Vec<String>,
    /// Least distance to the body \[m\]; where the source drape is closer, its distance, but never
    /// inside the body. 1e-3 to 5e-3; the simulator's contact distance or more saves it a push.
    pub thickness: f64,
    /// Most rounds of the loop \[–\]. 10 usually suffice; original: 25.
    pub iterations: usize,
    /// The loop ends when no vertex moves more than this share of the garment's diagonal \[–\].
    /// 1e-3 hasty to 1e-6 exact; original: 1e-4.
    pub tolerance: f64,
}

impl Default for TransferParams {
    fn default() -> Self {
        Self {
            spacing: 0.02,
            place: 0.035,
            ease: Ease::Auto,
            zones: Vec::new(),
            keep: Vec::new(),
            keep_length: Vec::new(),
            thickness: 3e-3,
            iterations: 25,
            tolerance: 1e-4,
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

/// Rounds in full steps; later ones shorten as 1, 1/2, 1/3 …: above a crease of the body the nearest
/// side may change with every round, and short steps settle between.
const FULL_ROUNDS: usize = 4;
/// Distances below which the distance is restored fully, and above which not at all, as shares of the
/// body's height: 1 and 5 cm on an adult.
const CLOSE: (f64, f64) = (0.006, 0.03);
/// Rounds of averaging that free the garment's normals from wrinkles.
const NORMAL_ROUNDS: usize = 10;
/// First step of a triangle that meets the body, as share of its height: half a millimetre.
const STEP: f64 = 3e-4;
/// Times that a garment which met the body is relaxed again, to even out what was pushed.
const SMOOTHINGS: usize = 2;
/// Error of a relaxed vertex, as part of how far one may still move when the loop ends.
const EXACT: f64 = 1e-2;

/// Carries a drape from `source` to `target`, two bodies of one topology.
///
/// `drape` are the positions of the welded cloth \[m\] that `layout` describes. Equal bodies give back
/// the drape; moving the target rigidly moves the result; with [`Ease::Relative`], scaling it scales the
/// result.
pub fn target_shape(
    drape: &[Vec3],
    layout: &Layout,
    source: &Body,
    target: &Body,
    params: &TransferParams,
) -> Result<Target, TransferError> {
    check(drape, &layout.triangles, source, target)?;
    let triangles = &layout.triangles;
    let rings = rings(drape.len(), triangles);
    let on_target = ClosestPoint::new(&target.mesh);
    let on_source = ClosestPoint::new(&source.mesh);
    let distance: Vec<f64> = (drape.par_iter())
        .map(|&x| on_source.signed_distance(x))
        .collect();
    let outward = outward(drape, triangles, &rings, &on_source);
    let map = BodyMap::new(&source.mesh, &target.mesh);
    let bound: Vec<Carried> = (0..drape.len())
        .into_par_iter()
        .map(|v| map.carry(drape[v], outward[v], distance[v], layout.ease[v]))
        .collect();
    let (floor, top) = source.mesh.bounds();
    let height = (top - floor).max();
    let near = (&bound[..], &distance[..]);
    let holds = hold::holds(drape, triangles, &rings, near, height, params);
    let ties = layers::ties(drape, triangles, &rings, &bound, height);
    let ring = |(v, ring): (usize, &Vec<u32>)| Stencil {
        centre: v as u32,
        around: ring.clone(),
    };
    let mut stencils: Vec<Stencil> = rings.iter().enumerate().map(ring).collect();
    stencils.extend(layout.line_stencils());
    let (low, high) = bounds(drape);
    let settling = Settling {
        relaxation: Relaxation::new(drape, &stencils, holds, &layout.kept, ties),
        body: &on_target,
        bound: &bound,
        wanted: room::wanted(drape, &distance, &bound, [&on_source, &on_target]),
        trust: (distance.iter())
            .map(|d| 1.0 - smoothstep((d / height - CLOSE.0) / (CLOSE.1 - CLOSE.0)))
            .collect(),
        still: params.tolerance * (high - low).norm(),
        rounds: params.iterations,
    };
    let step = STEP * height;
    // Cloth that was in another part's half already may stay there.
    let home = |(carried, x): (&Carried, &Vec3)| {
        let [before, after] = carried.normals;
        let home = belongs(&on_source, *x, before);
        if home { after } else { Vec3::zeros() }
    };
    let homes = bound.iter().zip(drape).map(home).collect();
    let clearing = Clearing::new(&on_target, &target.mesh, triangles, &rings, homes, step);
    let mut least: Vec<f64> = (settling.wanted.iter())
        .map(|wanted| wanted.clamp(0.0, params.thickness))
        .collect();
    let mut x: Vec<Vec3> = bound.iter().map(|carried| carried.point).collect();
    let (iterations, converged) = settling.settle(&mut x, &least);
    for _ in 0..SMOOTHINGS {
        let mut cleared = x.clone();
        if !clearing.clear(&mut cleared, &mut least) {
            break;
        }
        settling.settle(&mut x, &least);
    }
    clearing.clear(&mut x, &mut least);
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

/// The loop of relaxing and rebinding.
struct Settling<'a> {
    relaxation: Relaxation,
    body: &'a ClosestPoint,
    bound: &'a [Carried],
    /// Distances to the body \[m\], and how far each is to be restored \[–\].
    wanted: Vec<f64>,
    trust: Vec<f64>,
    /// The loop ends when nothing moves farther \[m\].
    still: f64,
    rounds: usize,
}

impl Settling<'_> {
    /// Moves `x` to where it stays; the rounds that took, and whether they were enough.
    fn settle(&self, x: &mut [Vec3], least: &[f64]) -> (usize, bool) {
        for round in 0..self.rounds {
            let z: Vec<Vec3> = (0..x.len())
                .into_par_iter()
                .map(|v| self.pull(v, x[v], least[v]))
                .collect();
            let relaxed = self.relaxation.relax(&z, x, EXACT * self.still);
            let step = 1.0 / (1 + round.saturating_sub(FULL_ROUNDS)) as f64;
            let mut farthest = 0.0_f64;
            for (x, relaxed) in x.iter_mut().zip(relaxed) {
                let move_ = (relaxed - *x) * step;
                farthest = farthest.max(move_.norm());
                *x += move_;
            }
            if farthest <= self.still {
                return (round + 1, true);
            }
        }
        (self.rounds, false)
    }

    /// Where vertex `v`, now at `x`, is pulled to: along the body to where it is bound, across the body to
    /// its distance.
    fn pull(&self, v: usize, x: Vec3, least: f64) -> Vec3 {
        let (bound, trust, wanted) = (&self.bound[v], self.trust[v], self.wanted[v]);
        let start = bound.point.lerp(&x, trust);
        let restored = at_distance(self.body, start, |now| {
            (now + trust * (wanted - now)).max(least)
        });
        let normal = bound.normals[1];
        bound.point + normal * normal.dot(&(restored - bound.point))
    }
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
