//! The target shape x*: the source drape carried to the target body (paper §4.2; de Goes, Fong,
//! O'Malley 2020). Geometry only: not physical, no pattern.
//!
//! 1. Carry every cloth vertex from the space around the source body to that around the target
//!    (`bind`), both with parts that overlap drawn apart ([`parted`]).
//! 2. Repeat: give what touches the body its distance to it (`settle`, `ease`), and relax (`relax`), which
//!    keeps the garment's layout, lines and layers (`layout`, `layers`) through affine-invariant stencils.
//!    Along the body cloth is held softly, across it firmly where it touches (`hold`); off the body it
//!    hangs, and bridges (`hang`).
//! 3. Where folds went through each other, hold them less and repeat (`folds`).
//! 4. Take it out of the body (`clear`), and where triangles met it, relax once more.
//!
//! Departures from the original: binding is to a smooth patch of body, not to a closest point, and
//! rebinding restores distances along the normal only; the place along the body stays tied to the
//! first binding, so the loop converges instead of creeping.

mod bind;
mod clear;
mod draped;
mod ease;
mod folds;
mod hang;
mod hold;
mod layers;
mod layout;
mod paint;
mod relax;
mod room;
mod settle;

use crate::body::{Body, parted};
use crate::geometry::{ClosestPoint, Mat3, Vec3, bounds};
use bind::{BodyMap, Carried};
use clear::{Clearing, belongs};
use draped::Draped;
pub use ease::{Ease, EaseAt};
use folds::Folds;
use hold::Rims;
pub use layout::{Layout, Zone};
pub use paint::Paint;
use rayon::prelude::*;
use relax::{Hold, Kept, Relaxation, Slope, Springs, Stencil};
use serde::{Deserialize, Serialize};
use settle::{Ground, Settling};

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
    /// Signed distances to the target body \[m\], `[cloth vertex]`; to its parts drawn apart, where they go
    /// through each other.
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

/// How far a rim that grips may be pulled in, as share of the body's height: 3 cm on an adult.
const GRIP: f64 = 0.02;
/// First step of a triangle that meets the body, as share of its height: half a millimetre.
const STEP: f64 = 3e-4;
/// Times that folds which go through each other are let go.
const LOOSENINGS: usize = 3;
/// Times that a garment which met the body is relaxed again, to even out what was pushed.
const SMOOTHINGS: usize = 2;
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
    let skins = [source, target].map(|body| parted(&body.mesh));
    let surfaces = [0, 1].map(|k| ClosestPoint::new(&skins[k]));
    let [on_source, on_target] = &surfaces;
    let mut draped = Draped::new(drape, &layout.triangles, (source, on_source));
    let map = BodyMap::new(&skins[0], &skins[1]);
    let bound: Vec<Carried> = (0..drape.len())
        .into_par_iter()
        .map(|v| {
            map.carry(
                drape[v],
                draped.facing[v],
                draped.distance[v],
                layout.ease[v],
            )
        })
        .collect();
    let carried: Vec<Vec3> = bound.iter().map(|carried| carried.point).collect();
    draped.meet(&carried, (skins[1].area() / skins[0].area()).sqrt());
    let turns: Vec<Mat3> = drape.par_iter().map(|&x| map.turn(x)).collect();
    let slopes = hang::slopes(&draped, &bound, &turns);
    let grounds = grounds(
        &draped,
        (&bound, &turns),
        &slopes,
        layout,
        &surfaces,
        params,
    );
    let springs = Springs {
        kept: layout.kept.iter().map(|&e| Kept::of(e, drape)).collect(),
        ties: layers::ties(
            drape,
            &layout.triangles,
            &draped.rings,
            &bound,
            draped.height,
        ),
        slopes,
    };
    let ring = |(v, ring): (usize, &Vec<u32>)| Stencil {
        centre: v as u32,
        around: ring.clone(),
    };
    let mut stencils: Vec<Stencil> = draped.rings.iter().enumerate().map(ring).collect();
    stencils.extend(layout.line_stencils());
    let usual: Vec<Hold> = grounds.iter().map(Ground::usual).collect();
    let (low, high) = bounds(drape);
    let mut settling = Settling {
        relaxation: Relaxation::new(drape, &stencils, &usual, springs),
        body: on_target,
        bound: &bound,
        grounds,
        still: params.tolerance * (high - low).norm(),
        rounds: params.iterations,
    };
    let step = STEP * draped.height;
    // Cloth that was in another part's half already may stay there.
    let home = |(carried, x): (&Carried, &Vec3)| {
        let [before, after] = carried.normals;
        let home = belongs(on_source, *x, before);
        if home { after } else { Vec3::zeros() }
    };
    let homes = bound.iter().zip(drape).map(home).collect();
    let clearing = Clearing::new(
        on_target,
        &skins[1],
        &layout.triangles,
        &draped.rings,
        homes,
        step,
    );
    let mut least: Vec<f64> = (settling.grounds.iter())
        .map(|ground| ground.wanted.clamp(0.0, params.thickness))
        .collect();
    let mut x = carried;
    let (mut iterations, mut converged) = settling.settle(&mut x, &least);
    let folds = Folds::new(drape, &layout.triangles, &draped.rings);
    for _ in 0..LOOSENINGS {
        let around = folds.around_meetings(&x);
        if around.is_empty() {
            break;
        }
        for v in around {
            settling.grounds[v as usize].firmness.let_go();
        }
        let (more, settled) = settling.settle(&mut x, &least);
        iterations += more;
        converged = settled;
    }
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

/// How each vertex stands to the target body.
fn grounds(
    draped: &Draped<'_>,
    (bound, turns): (&[Carried], &[Mat3]),
    slopes: &[Slope],
    layout: &Layout,
    surfaces: &[ClosestPoint; 2],
    params: &TransferParams,
) -> Vec<Ground> {
    let touching = hold::touching(draped);
    let across = |v: usize| {
        let free = turns[v] * draped.facing[v];
        let across = free.lerp(&bound[v].normals[1], touching[v]);
        across.try_normalize(1e-9).unwrap_or_else(Vec3::zeros)
    };
    let across: Vec<Vec3> = (0..bound.len()).map(across).collect();
    let rims = Rims::new(draped);
    let lines = (&rims, &layout.lines[..]);
    let firmness = hold::firmness(draped, lines, (bound, &across), params);
    let pressures = hang::pressures(draped, slopes);
    let wanted = room::wanted(draped.x, &draped.distance, bound, surfaces);
    let ground = |v: usize| Ground {
        across: across[v],
        touching: touching[v],
        wanted: wanted[v],
        pressure: pressures[v] * touching[v]
            + rims.grips[v] * firmness[v].touching * GRIP * draped.height,
        firmness: firmness[v],
    };
    (0..bound.len()).map(ground).collect()
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
