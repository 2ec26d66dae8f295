//! The target shape x*: the source drape carried to the target body (paper §4.2; de Goes, Fong,
//! O'Malley 2020). Geometry only: not physical, no pattern.
//!
//! 1. Carry every cloth vertex from the space around the source body to that around the target
//!    (`bind`), both with parts that overlap drawn apart ([`crate::body::parted`]).
//! 2. Repeat: give what touches the body its distance to it (`settle`, `ease`), and relax (`relax`), which
//!    keeps the garment's layout, lines and layers (`layout`, `layers`) through affine-invariant stencils.
//!    Along the body cloth is held softly, across it firmly where it touches (`hold`); off the body it
//!    hangs, and bridges (`hang`).
//! 3. Where folds went through each other, hold them less and repeat (`folds`).
//! 4. Where triangles meet the body (`clear`), relax once more.
//! 5. Carry the result back to the source body in the same way, and take back half of what that misses the
//!    drape by: relaxing loses some of each change, and half of the loss is either way's. To first order
//!    the way there and the way back are each other's inverse then (what Christensen & Johnson 2001 ask
//!    of registrations of images).
//! 6. Take it out of the body, draw apart layers that met on the way (`folds`), and turn back what was turned
//!    over (`turned`).
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
mod turned;
mod way;

use crate::body::Body;
use crate::geometry::Vec3;
use crate::geometry::mesh::rings;
pub use ease::{Ease, EaseAt};
pub use layout::{Layout, Zone};
pub use paint::Paint;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
pub(crate) use turned::turned_over;
use way::{Skin, Way};

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
    let skins = rayon::join(|| Skin::of(source), || Skin::of(target));
    let skins = <[Skin; 2]>::from(skins);
    let rings = rings(drape.len(), &layout.triangles);
    let cloth = (layout, &rings[..]);
    let mut there = Way::new((drape, Vec3::y()), cloth, [&skins[0], &skins[1]], params);
    let mut settled = there.settled();
    let mut back = Way::new(
        (&settled.x, there.up),
        cloth,
        [&skins[1], &skins[0]],
        params,
    );
    let missed = back.settled();
    let missed: Vec<Vec3> = (missed.x.iter().zip(drape)).map(|(x, y)| x - y).collect();
    there.take_back(&mut settled.x, missed);
    there.clear(&mut settled.x);
    let clearance = |&x: &Vec3| skins[1].surface.signed_distance(x);
    Ok(Target {
        clearance: settled.x.par_iter().map(clearance).collect(),
        x_star: settled.x,
        iterations: settled.rounds,
        converged: settled.converged,
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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests;
