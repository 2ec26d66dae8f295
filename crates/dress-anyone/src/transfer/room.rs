//! How far from the body cloth may want to be where two parts of it are near each other: thighs, an arm and
//! the side. Either part's cloth has half of the gap; on a heavier body that is less than on the source.

use super::bind::Carried;
use crate::geometry::{ClosestPoint, Vec3};
use rayon::prelude::*;

/// Distances to the target body \[m\]: those of the drape `x`, times what becomes of the ease, and no
/// more than their share of the gap, unless they took more of it on the source body too.
pub(super) fn wanted(
    x: &[Vec3],
    distance: &[f64],
    bound: &[Carried],
    [source, target]: [&ClosestPoint; 2],
) -> Vec<f64> {
    let of_one = |v: usize| {
        let (before, carried) = (distance[v], &bound[v]);
        let wanted = before * carried.ease;
        if !(before > 0.0) {
            return wanted;
        }
        let room_before = half_gap(source, x[v], carried.normals[0], before) / before;
        let room_after = half_gap(target, carried.point, carried.normals[1], wanted) / wanted;
        // Cloth that was pressed together as much before is so after.
        let part = room_after.max(0.0) / room_before.clamp(1e-3, 1.0);
        wanted * part.min(1.0)
    };
    (0..x.len()).into_par_iter().map(of_one).collect()
}

/// Half of the gap between the body below `x` and what is opposite; as much as `distance` or more where
/// nothing is \[m\]. Negative where parts of the body overlap.
fn half_gap(body: &ClosestPoint, x: Vec3, outward: Vec3, distance: f64) -> f64 {
    let Some(foot) = body.query(x - outward * distance, f64::INFINITY) else {
        return distance;
    };
    let far = 2.0 * distance;
    0.5 * (far + body.signed_distance(foot.point + outward * far))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::add_box;
    use crate::geometry::TriangleMesh;

    /// Two walls, and a point above the right side of the left one.
    fn walls(gap: f64) -> ClosestPoint {
        let mut mesh = TriangleMesh::default();
        add_box(&mut mesh, [-1.0, -1.0, -1.0], [0.0, 1.0, 1.0]);
        add_box(&mut mesh, [gap, -1.0, -1.0], [1.0 + gap, 1.0, 1.0]);
        ClosestPoint::new(&mesh)
    }

    #[test]
    fn cloth_has_half_of_a_gap_that_narrows() {
        let at = |from: f64, to: f64, distance: f64| {
            let x = Vec3::x() * distance;
            let carried = Carried {
                point: x,
                ease: 1.0,
                normals: [Vec3::x(); 2],
                map: crate::geometry::Mat3::identity(),
            };
            wanted(&[x], &[distance], &[carried], [&walls(from), &walls(to)])[0]
        };
        // Room enough; half of 4 mm; as on the source.
        for (from, to, distance, expected) in [
            (0.1, 0.1, 0.005, 0.005),
            (0.1, 0.004, 0.005, 0.002),
            (0.008, 0.008, 0.005, 0.005),
        ] {
            let found = at(from, to, distance);
            assert!((found - expected).abs() < 1e-12, "{found}");
        }
    }
}
