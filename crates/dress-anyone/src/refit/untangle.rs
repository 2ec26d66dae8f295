//! A last drape in which layers go through each other, brought apart. Drapes of a search start where a step is
//! predicted to lead, or from a shape that was carried over; where that goes through itself, cloth does not feel it.

use crate::body::DistanceField;
use crate::garment::Garment;
use crate::geometry::{Vec2, Vec3, intersections};
use crate::sim::drape::Observer;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Drape, Scene, Start, drape};

/// Up to this distance from what goes through itself cloth is taken over as time steps leave it \[m\], and from the
/// other on it stays where it was: a skirt need not fall into other folds for the hem of a sleeve.
const TAKEN: f64 = 0.05;
const KEPT: f64 = 0.12;

/// The drape `found` of a rest shape, or one near it in which nothing goes through itself, if there is one. Time
/// steps bring all of the cloth apart; then the surroundings of what was through itself settle in `found`.
pub(super) fn untangled(
    garment: &Garment,
    scene: &Scene<'_, DistanceField>,
    x_bar: &[Vec2],
    found: Drape,
    observe: &mut Observer<'_>,
) -> Drape {
    let triangles = garment.mesh.cloth_triangles();
    let pairs = intersections::within(&found.x, &triangles);
    if pairs.is_empty() {
        return found;
    }
    let is_apart = |drape: &Drape| {
        drape.status == RestStatus::AtRest && intersections::within(&drape.x, &triangles).is_empty()
    };
    let stepped = drape(scene, x_bar, found.x.clone(), Start::Tangled, observe);
    if !is_apart(&stepped) {
        return found;
    }
    let through = pairs
        .as_flattened()
        .iter()
        .flat_map(|t| triangles[*t as usize]);
    let places: Vec<Vec3> = through.map(|v| found.x[v as usize]).collect();
    let x = blended(&found.x, &stepped.x, &places);
    let settled = drape(scene, x_bar, x, Start::Near, observe);
    if is_apart(&settled) { settled } else { stepped }
}

/// `new` near some `places`, of which there are few, and `old` far from them \[m\].
fn blended(old: &[Vec3], new: &[Vec3], places: &[Vec3]) -> Vec<Vec3> {
    let blend = |(old, new): (&Vec3, &Vec3)| {
        let squares = places.iter().map(|place| (old - place).norm_squared());
        let near = squares.fold(f64::INFINITY, f64::min).sqrt();
        let part = ((KEPT - near) / (KEPT - TAKEN)).clamp(0.0, 1.0);
        old + (new - old) * part
    };
    old.iter().zip(new).map(blend).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn cloth_is_new_near_what_went_through_itself_and_old_far_from_it() {
        let old: Vec<Vec3> = (0..30).map(|i| Vec3::x() * (0.01 * f64::from(i))).collect();
        let new: Vec<Vec3> = old.iter().map(|p| p + Vec3::y()).collect();
        let moved = blended(&old, &new, &[old[0], old[1]]);
        let by: Vec<f64> = moved.iter().map(|p| p.y).collect();
        // 1 cm apart, the second place at 1 cm: up to 6 cm all of it, from 13 cm on nothing.
        assert!(by[..=6].iter().all(|y| *y == 1.0) && by[13..].iter().all(|y| *y == 0.0));
        assert!(by.is_sorted_by(|a, b| a >= b));
        assert_relative_eq!(by[8], 5.0 / 7.0, epsilon = 1e-12);
    }
}
