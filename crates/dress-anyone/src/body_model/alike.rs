//! Two bodies made to correspond: one topology, one pose (paper §4.1).
//!
//! Where both have the same triangles and stand alike there is nothing to do. Otherwise the model is
//! fitted to both; the source stays where and as it stands, for its garment does too, and the target
//! takes on the source's pose on the same floor, its own surface carried along. Thighs that go through each
//! other there, and do not in its own pose, are drawn apart: flesh would give way.

use super::fit::{Fit, Landmarks, fit};
use super::skeleton::PELVIS;
use super::{BodyModel, Pose};
use crate::body::{Body, parted};
use crate::geometry::{Mat3, TriangleMesh, Vec3, bounds};
use crate::problem::Problem;

/// Two bodies that correspond vertex by vertex and stand alike.
#[derive(Clone, Debug)]
pub struct Alike {
    /// The source, in its own pose and place.
    pub source: Body,
    /// The target, in the source's pose, with parts that go through each other there drawn apart.
    pub target: Body,
    /// The target's surface in its own pose, corresponding too.
    pub target_own: TriangleMesh,
    /// The fits of source and target.
    pub fits: [Fit; 2],
}

/// What is wrong with the source, and with the target.
pub type Refusal = [Vec<Problem>; 2];

/// Fits `model` to both bodies, with what landmarks there are on each, and gives the target the
/// source's pose.
pub fn make_alike(
    model: &BodyModel,
    [source, target]: [&Body; 2],
    landmarks: &[Landmarks; 2],
) -> Result<Alike, Refusal> {
    let fits = [
        fit(model, &source.mesh, &landmarks[0]),
        fit(model, &target.mesh, &landmarks[1]),
    ];
    let [source_fit, target_fit] = match fits {
        [Ok(source), Ok(target)] => [source, target],
        refused => return Err(refused.map(|fit| fit.err().unwrap_or_default())),
    };
    let place = |body: &Body, mesh: &TriangleMesh| Body {
        mesh: mesh.clone(),
        ..body.clone()
    };
    let posed = TriangleMesh {
        positions: as_source(model, &source_fit, &target_fit),
        triangles: target_fit.mesh.triangles.clone(),
    };
    Ok(Alike {
        source: place(source, &source_fit.mesh),
        target: place(target, &parted(&posed)),
        target_own: target_fit.mesh.clone(),
        fits: [source_fit, target_fit],
    })
}

/// The target in the source's pose, its pelvis over the same spot and its soles on the same floor.
fn as_source(model: &BodyModel, source: &Fit, target: &Fit) -> Vec<Vec3> {
    let pelvis =
        |fit: &Fit, pose: &Pose| model.posed(&fit.shape, pose, &fit.offsets).heads()[PELVIS];
    let mut pose = source.pose.clone();
    let floor = |positions: &[Vec3]| bounds(positions).0.y;
    let now = target.posed(model, &pose).positions;
    let mut shift = pelvis(source, &source.pose) - pelvis(target, &pose);
    shift.y = floor(&source.mesh.positions) - floor(&now);
    pose.translation += shift;
    target.posed(model, &pose).positions
}

/// A face turned more than this \[rad\] against its partner is posed otherwise: shapes alone turn few
/// so far, and an arm let down from a T-pose turns by 0.8.
const TURNED: f64 = 0.35;
/// Share of the surface that may be turned.
const MOST_TURNED: f64 = 0.1;

/// Whether two meshes with the same triangles hold the same pose.
pub fn stand_alike(source: &TriangleMesh, target: &TriangleMesh) -> bool {
    let (mut turned, mut all) = (0.0, 0.0);
    for t in 0..source.triangles.len() {
        let [a, b] = [source, target].map(|mesh| frame(mesh.corners(t)));
        let ((Some(from), area), (Some(to), _)) = (a, b) else {
            continue;
        };
        let cosine = 0.5 * ((to * from.transpose()).trace() - 1.0);
        all += area;
        if cosine < TURNED.cos() {
            turned += area;
        }
    }
    turned <= MOST_TURNED * all
}

/// Right-handed axes of a triangle, the third its normal, and its doubled area.
fn frame([a, b, c]: [Vec3; 3]) -> (Option<Mat3>, f64) {
    let normal = (b - a).cross(&(c - a));
    let area = normal.norm();
    let axes = normal.try_normalize(0.0).zip((b - a).try_normalize(0.0));
    let axes = axes.map(|(n, e)| Mat3::from_columns(&[e, n.cross(&e), n]));
    (axes, area)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body_model::sample::Random;
    use crate::io::body_model::built_in;

    fn surface(model: &BodyModel, seed: u64, pose: &Pose) -> TriangleMesh {
        let shape = model.sample(&mut Random::new(seed));
        TriangleMesh {
            positions: model.posed(&shape, pose, &[]).positions,
            triangles: model.parts().template.triangles.clone(),
        }
    }

    #[test]
    fn other_shapes_stand_alike_and_other_poses_do_not() {
        let model = built_in();
        let half = model.arms_at(std::f64::consts::FRAC_PI_4);
        let one = surface(&model, 1, &half);
        assert!(stand_alike(&one, &surface(&model, 2, &half)));
        // Both arms are 16 % of the surface.
        assert!(!stand_alike(&one, &surface(&model, 1, &model.arms_at(0.0))));
    }
}
