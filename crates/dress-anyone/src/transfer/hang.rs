//! Cloth off the body: what hangs keeps its slopes, what is stretched between two places bridges them.
//!
//! Where the body presses on cloth it decides how far out cloth is. Elsewhere tension does: a taut cloth over a
//! hollow is as straight as it was, however deep the hollow is now, and a skirt keeps the angle at which it
//! leaves the hips. So a garment is a membrane as well, whose edges keep their rise away from the body,
//!
//! ½ Σ s (o'·(x_i − x_j) − e o·(x̄_i − x̄_j))²,
//!
//! with o the direction in which the cloth faces, o' = R o that on the target, R how the body turns at large, and
//! e what becomes of the ease. What must change between two places that are held changes evenly, and what hangs
//! freely moves with what it hangs from. Nothing of this is in de Goes et al. 2020, who simulate the cloth in the
//! end instead.
//!
//! The body presses, but does not pull: how hard it may hold cloth to itself is what the source drape proves.
//! A cloth that is bent along its hang by curvature κ where it touches is pressed with up to c T |κ|, where T is
//! the membrane's tension and c T that around the body; where it hangs straight past the body, nothing
//! presses, and on another body it may hang off.

use super::bind::Carried;
use super::draped::Draped;
use super::relax::{FLEXIBILITY, Slope};
use crate::geometry::Mat3;

/// Length below which the stencils decide, and above which tension does, as share of the body's height: 9 cm.
const STIFF: f64 = 0.05;
/// c: tension around the body over that along the hang. Less lets go of the body what has little to hold on to on
/// its way there, and it does not find back.
const TAUT: f64 = 20.0;

/// Slopes of a cloth that is carried to `bound`, about a body that turns by `turns` at large.
pub(super) fn slopes(draped: &Draped<'_>, bound: &[Carried], turns: &[Mat3]) -> Vec<Slope> {
    let Draped {
        x, facing, sizes, ..
    } = draped;
    let mut slopes = Vec::new();
    for (i, ring) in draped.rings.iter().enumerate() {
        for j in ring.iter().map(|&j| j as usize).filter(|&j| j < i) {
            let Some(out) = (facing[i] + facing[j]).try_normalize(1e-9) else {
                continue;
            };
            let ease = 0.5 * (bound[i].ease + bound[j].ease);
            let size = 0.5 * (sizes[i] + sizes[j]) / (STIFF * draped.height);
            slopes.push(Slope {
                ends: [i as u32, j as u32],
                across: ((turns[i] + turns[j]) * out).normalize(),
                rise: ease * out.dot(&(x[i] - x[j])),
                stiffness: FLEXIBILITY * size * size,
            });
        }
    }
    slopes
}

/// How hard the body may press on each vertex where it touches, in the unit of the relaxation's forces.
pub(super) fn pressures(draped: &Draped<'_>, slopes: &[Slope]) -> Vec<f64> {
    let Draped { x, facing, up, .. } = draped;
    let mut pressures = vec![0.0; x.len()];
    for slope in slopes {
        let [i, j] = slope.ends.map(|v| v as usize);
        let (edge, bend) = (x[i] - x[j], facing[i] - facing[j]);
        let out = (facing[i] + facing[j]) * 0.5;
        // Along the hang; where cloth lies on top of the body it hangs to all sides.
        let (down, top) = (out * out.dot(up) - up, out.dot(up).max(0.0));
        let depth = edge.dot(&down) * bend.dot(&down) + 0.5 * top * top * edge.dot(&bend);
        for v in [i, j] {
            pressures[v] += 0.5 * TAUT * slope.stiffness * depth;
        }
    }
    let pressures = draped.averaged(pressures, STIFF);
    pressures.into_iter().map(f64::abs).collect()
}

#[cfg(test)]
mod tests {
    use super::super::tests::revolved;
    use super::*;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;
    use crate::geometry::{ClosestPoint, Vec3};

    fn pressed(radius: impl Fn(f64) -> f64) -> f64 {
        let cloth = revolved(radius, false);
        let surface = ClosestPoint::new(&sphere(0.1, 3));
        let rings = rings(cloth.positions.len(), &cloth.triangles);
        let mesh = (&cloth.triangles[..], &rings[..]);
        let draped = Draped::new(&cloth.positions, mesh, &surface, (Vec3::y(), 1.0));
        let carried = |p: &Vec3| Carried {
            point: *p,
            ease: 1.0,
            normals: [Vec3::y(); 2],
            map: Mat3::identity(),
        };
        let bound: Vec<Carried> = cloth.positions.iter().map(carried).collect();
        let slopes = slopes(&draped, &bound, &vec![Mat3::identity(); bound.len()]);
        pressures(&draped, &slopes)[20 * 60]
    }

    #[test]
    fn what_is_bent_along_its_hang_is_pressed_and_what_hangs_straight_is_not() {
        let straight = pressed(|_| 0.2);
        let waist = pressed(|y| 0.2 + 0.5 * y * y);
        let belly = pressed(|y| 0.2 - 0.5 * y * y);
        // Curvatures of 0 and ±1 per metre, at the same radius.
        assert!(straight < 1e-3 * waist, "{straight:e} {waist:e}");
        assert!((waist / belly - 1.0).abs() < 0.2, "{waist:e} {belly:e}");
    }
}
