//! Folds that are pushed through each other: where the body shrinks more than a skirt's folds have room for,
//! holding cloth to its place along the body takes layers through one another that were apart. There it is let go
//! ([`super::hold::Firmness::let_go`]), again and again, until they are.

use crate::geometry::Vec3;
use crate::geometry::intersections::within;
use std::collections::BTreeSet;

/// What goes through itself in the source drape already, and the mesh of the cloth.
pub(super) struct Folds<'a> {
    triangles: &'a [[u32; 3]],
    rings: &'a [Vec<u32>],
    before: BTreeSet<[u32; 2]>,
}

/// Edges around two triangles that meet over which cloth is let go: as wide as a fold is deep.
const AROUND: usize = 4;

impl<'a> Folds<'a> {
    /// Of the cloth `drape`.
    pub(super) fn new(drape: &[Vec3], triangles: &'a [[u32; 3]], rings: &'a [Vec<u32>]) -> Self {
        Self {
            triangles,
            rings,
            before: within(drape, triangles).into_iter().collect(),
        }
    }

    /// Vertices around the triangles that meet in `x` and did not in the drape.
    pub(super) fn around_meetings(&self, x: &[Vec3]) -> BTreeSet<u32> {
        let pairs = within(x, self.triangles);
        let new = pairs.iter().filter(|pair| !self.before.contains(*pair));
        let meeting = new.flatten().flat_map(|t| self.triangles[*t as usize]);
        let mut around: BTreeSet<u32> = meeting.collect();
        for _ in 0..AROUND {
            let rings = around.iter().flat_map(|v| &self.rings[*v as usize]);
            let wider: Vec<u32> = rings.copied().collect();
            around.extend(wider);
        }
        around
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;

    #[test]
    fn what_meets_is_found_with_what_is_around_it_unless_it_met_before() {
        // Two balls beside each other, no mirror images, the second one put into the first from the side.
        let ball = sphere(0.1, 4);
        let count = ball.positions.len();
        let apart = |way: f64| -> Vec<Vec3> {
            let moved = ball
                .positions
                .iter()
                .map(|p| p + Vec3::new(way, 3e-3, 1e-3));
            ball.positions.iter().copied().chain(moved).collect()
        };
        let other = ball.triangles.iter().map(|t| t.map(|v| v + count as u32));
        let triangles: Vec<[u32; 3]> = ball.triangles.iter().copied().chain(other).collect();
        let rings = rings(2 * count, &triangles);
        let folds = Folds::new(&apart(0.21), &triangles, &rings);
        assert!(folds.around_meetings(&apart(0.205)).is_empty());
        let x = apart(0.198);
        let found = folds.around_meetings(&x);
        assert!(found.iter().any(|v| (*v as usize) < count));
        assert!(found.iter().any(|v| (*v as usize) >= count));
        // They meet in a circle of 1.4 cm; edges are up to 9 mm long, five of them 4.5 cm.
        let farthest = |v: &u32| x[*v as usize].yz().norm();
        let farthest = found.iter().map(farthest).fold(0.0, f64::max);
        assert!((0.02..0.065).contains(&farthest), "{farthest}");
        let folds = Folds::new(&x, &triangles, &rings);
        assert!(folds.around_meetings(&x).is_empty());
    }
}
