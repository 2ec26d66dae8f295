//! Takes a garment out of the body: its vertices, and its triangles by the exact test.
//!
//! Vertices go along the gradient of the distance to the least distance they may have. Where the body
//! comes through between vertices, the cloth's triangle moves by small steps along the mean normal of
//! the body's triangles that it meets, its surroundings half as far, until nothing meets. Where two
//! parts of the body face each other, cloth stays on the side of the middle where it belongs: the legs of
//! trousers do not go through each other.

use super::bind::smoothstep;
use crate::geometry::box_tree::{BoxTree, around};
use crate::geometry::intersections::intersect;
use crate::geometry::{ClosestPoint, TriangleMesh, Vec3};
use rayon::prelude::*;

/// A body that nothing may go through, and the mesh of the cloth.
pub(super) struct Clearing<'a> {
    pub(super) body: &'a ClosestPoint,
    pub(super) skin: &'a TriangleMesh,
    pub(super) tree: BoxTree,
    pub(super) triangles: &'a [[u32; 3]],
    pub(super) rings: &'a [Vec<u32>],
    /// Outward directions of the body where vertices belong; zero where they may be anywhere.
    pub(super) homes: Vec<Vec3>,
    /// First step of a triangle that meets the body \[m\].
    pub(super) step: f64,
}

/// Rounds of pushing vertices out, and of spreading each push.
const PUSHES: usize = 5;
/// Most rounds of moving triangles.
const ROUNDS: usize = 40;
/// Rounds after which steps have doubled: what is stuck needs longer ones.
const PATIENCE: usize = 8;
/// Cosine of the angle from which on two parts of the body face each other.
const OPPOSITE: f64 = -0.3;
/// Halvings of the way to the middle between them: a hundredth.
const BISECTIONS: usize = 7;
/// Farthest a triangle moves, in first steps: where two parts of a body touch nothing helps, and cloth that
/// is thrown about hurts.
const FARTHEST: f64 = 40.0;
/// Mean of unit normals that is shorter than this has no direction.
const UNDECIDED: f64 = 0.2;

impl<'a> Clearing<'a> {
    pub(super) fn new(
        body: &'a ClosestPoint,
        skin: &'a TriangleMesh,
        triangles: &'a [[u32; 3]],
        rings: &'a [Vec<u32>],
        homes: Vec<Vec3>,
        step: f64,
    ) -> Self {
        let boxes: Vec<_> = (0..skin.triangles.len())
            .map(|t| around(&skin.corners(t), 0.0))
            .collect();
        Self {
            body,
            skin,
            tree: BoxTree::new(&boxes),
            triangles,
            rings,
            homes,
            step,
        }
    }

    /// Moves `x` until no vertex is closer to the body than `least` \[m\] and no triangle meets it;
    /// `least` rises to where triangles needed more. Whether any did.
    pub(super) fn clear(&self, x: &mut [Vec3], least: &mut [f64]) -> bool {
        for _ in 0..PUSHES {
            let pushes: Vec<Vec3> = (0..x.len())
                .into_par_iter()
                .map(|v| self.push(v, x[v], least[v]))
                .collect();
            self.spread(x, &pushes, 1.0);
        }
        let mut moved = vec![false; x.len()];
        let start = x.to_vec();
        for round in 0..ROUNDS {
            x.par_iter_mut()
                .zip(&*least)
                .enumerate()
                .for_each(|(v, (x, &least))| *x += self.push(v, *x, least));
            let met = self.met(x);
            if met.is_empty() {
                break;
            }
            let step = self.step * (1 + round / PATIENCE) as f64;
            let mut pushes = vec![(Vec3::zeros(), 0.0); x.len()];
            for (t, direction) in met {
                for v in self.triangles[t] {
                    let (sum, count) = &mut pushes[v as usize];
                    *sum += direction * step;
                    *count += 1.0;
                    moved[v as usize] = true;
                }
            }
            let mean = |(sum, count): &(Vec3, f64)| sum / f64::max(*count, 1.0);
            let pushes: Vec<Vec3> = pushes.iter().map(mean).collect();
            self.spread(x, &pushes, 0.5);
            for (x, start) in x.iter_mut().zip(&start) {
                *x = start + (*x - start).cap_magnitude(FARTHEST * self.step);
            }
        }
        for (v, least) in least.iter_mut().enumerate().filter(|(v, _)| moved[*v]) {
            *least = least.max(self.body.signed_distance(x[v]));
        }
        moved.contains(&true)
    }

    /// The way of vertex `v`, at `x`, home and out to the distance `least`, or to the middle where another part of the
    /// body leaves less room.
    fn push(&self, v: usize, x: Vec3, least: f64) -> Vec3 {
        let home = self.homeward(x, self.homes[v]);
        let now = self.body.signed_distance(home);
        if now >= least {
            return home - x;
        }
        let out = home + self.out(home) * (least - now);
        self.homeward(out, self.homes[v]) - x
    }

    /// The way out of the body, as mean of those a step from `x` to both sides, along the edges of the body's triangle
    /// below: at the bottom of a crease, where either side is as near, it is neither's own.
    fn out(&self, x: Vec3) -> Vec3 {
        let Some(foot) = self.body.query(x, f64::INFINITY) else {
            return Vec3::zeros();
        };
        let [a, b, c] = self.skin.corners(foot.triangle as usize);
        let sides = [b - a, c - b, a - c].map(|side| side.cap_magnitude(self.step));
        let places = sides.into_iter().flat_map(|side| [x + side, x - side]);
        let ways = places.filter_map(|place| above(self.body, place));
        let mean: Vec3 = ways.map(|(_, outward)| outward).sum();
        mean.try_normalize(1e-9).unwrap_or_else(Vec3::zeros)
    }

    /// `x`, moved back towards where it belongs until the body below it is what it should be: some way
    /// past the middle of the gap.
    fn homeward(&self, x: Vec3, home: Vec3) -> Vec3 {
        let reach = FARTHEST * self.step;
        let near = self.body.signed_distance(x) < reach;
        if !near || belongs(self.body, x, home) {
            return x;
        }
        let mut way = self.step;
        while !belongs(self.body, x - home * way, home) {
            way *= 2.0;
            if way > reach {
                return x;
            }
        }
        let (mut near, mut far) = (0.5 * way, way);
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (near + far);
            if belongs(self.body, x - home * middle, home) {
                far = middle;
            } else {
                near = middle;
            }
        }
        let away = self.body.signed_distance(x) / reach;
        let share = 1.0 - smoothstep(2.0 * away - 1.0);
        x - home * ((far + self.step) * share)
    }

    /// Applies `pushes`; where the mean of those around, times `share`, is larger, that.
    pub(super) fn spread(&self, x: &mut [Vec3], pushes: &[Vec3], share: f64) {
        for (v, ring) in self.rings.iter().enumerate() {
            let around: Vec3 = ring.iter().map(|&i| pushes[i as usize]).sum();
            let around = around * (share / ring.len().max(1) as f64);
            x[v] += if around.norm() > pushes[v].norm() {
                around
            } else {
                pushes[v]
            };
        }
    }

    /// How many triangles of the cloth at `x` meet the body.
    pub(super) fn meetings(&self, x: &[Vec3]) -> usize {
        self.met(x).len()
    }

    /// Triangles of the cloth that meet the body, each with the way out.
    fn met(&self, x: &[Vec3]) -> Vec<(usize, Vec3)> {
        let of_one = |(t, triangle): (usize, &[u32; 3])| {
            let corners = triangle.map(|v| x[v as usize]);
            let (mut sum, mut count) = (Vec3::zeros(), 0.0);
            let mut found = Vec::new();
            self.tree
                .overlapping(&around(&corners, 0.0), |b| found.push(b));
            found.sort_unstable();
            for b in found {
                let skin = self.skin.corners(b as usize);
                if intersect(corners, skin) {
                    let normal = (skin[1] - skin[0]).cross(&(skin[2] - skin[0]));
                    sum += normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
                    count += 1.0;
                }
            }
            if count == 0.0 {
                return None;
            }
            let mut way = sum / count;
            if way.norm() < UNDECIDED {
                // In a crease of the body its sides cancel: out is where the corners are.
                way = corners.iter().map(|&p| self.pseudonormal(p)).sum();
            }
            Some((t, way.try_normalize(0.0).unwrap_or_else(Vec3::y)))
        };
        let triangles = self.triangles.par_iter().enumerate();
        triangles.filter_map(of_one).collect()
    }

    fn pseudonormal(&self, p: Vec3) -> Vec3 {
        let foot = self.body.query(p, f64::INFINITY);
        foot.map_or_else(Vec3::zeros, |foot| self.body.pseudonormal(&foot))
    }
}

/// Whether the body closest to `x` does not face the direction `home` of where `x` belongs.
pub(super) fn belongs(body: &ClosestPoint, x: Vec3, home: Vec3) -> bool {
    let foot = body.query(x, f64::INFINITY);
    foot.is_none_or(|foot| body.pseudonormal(&foot).dot(&home) > OPPOSITE)
}

/// The signed distance of `x` to the body, and the direction in which it grows.
pub(super) fn above(body: &ClosestPoint, x: Vec3) -> Option<(f64, Vec3)> {
    let foot = body.query(x, f64::INFINITY)?;
    let now = body.signed(x, &foot);
    // On the surface the offset has no direction.
    let outward = (x - foot.point)
        .try_normalize(1e-9)
        .map_or_else(|| body.pseudonormal(&foot), |n| n * now.signum());
    Some((now, outward))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::add_box;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::intersections::between;
    use crate::geometry::mesh::rings;

    #[test]
    fn a_body_that_comes_through_between_vertices_is_cleared() {
        // A coarse ball whose corners are 3 mm off a fine one: its faces cut some 5 cm deep.
        let (skin, mut cloth) = (sphere(0.3, 4), sphere(0.303, 2));
        let body = ClosestPoint::new(&skin);
        let rings = rings(cloth.positions.len(), &cloth.triangles);
        let homes = vec![Vec3::zeros(); cloth.positions.len()];
        let clearing = Clearing::new(&body, &skin, &cloth.triangles, &rings, homes, 5e-4);
        let mut least = vec![3e-3; cloth.positions.len()];
        let meet = |x: &[Vec3]| between(x, &cloth.triangles, &skin.positions, &skin.triangles);
        assert!(!meet(&cloth.positions).is_empty());
        assert!(clearing.clear(&mut cloth.positions, &mut least));
        assert!(meet(&cloth.positions).is_empty());
        // Nothing goes farther than it must: an edge of 0.39 radians sags by 0.303 (1 − cos 0.2).
        let farthest = cloth.positions.iter().map(Vec3::norm).fold(0.0, f64::max);
        assert!(farthest < 0.303 + 0.03, "{farthest}");
    }

    /// Where a vertex of the left of two legs, whose faces are at x = 0 and `gap` \[m\], goes from `start` when it shall be
    /// `least` away from both.
    fn cleared_between_legs(gap: f64, start: f64, least: f64) -> f64 {
        let mut skin = TriangleMesh::default();
        add_box(&mut skin, [-1.0, -1.0, -1.0], [0.0, 1.0, 1.0]);
        add_box(&mut skin, [gap, -1.0, -1.0], [1.0, 1.0, 1.0]);
        let body = ClosestPoint::new(&skin);
        let mut x = vec![Vec3::new(start, 0.0, 0.0)];
        let rings = [Vec::new()];
        let clearing = Clearing::new(&body, &skin, &[], &rings, vec![Vec3::x()], 5e-4);
        clearing.clear(&mut x, &mut [least]);
        x[0].x
    }

    #[test]
    fn the_legs_of_trousers_stay_on_their_sides() {
        // 8 mm away from its own leg and 2 mm from the other: the middle is at 5 mm; a step before it.
        let x = cleared_between_legs(0.01, 8e-3, 1e-3);
        assert!((x - 4.5e-3).abs() < 1e-4, "{x}");
        // Where there is no room for both layers at their least distance, each keeps its half.
        let x = cleared_between_legs(4e-3, 1e-3, 3e-3);
        assert!((x - 1.5e-3).abs() < 1e-4, "{x}");
        // Far from either, cloth may be where it is.
        let x = cleared_between_legs(0.2, 0.15, 3e-3);
        assert!((x - 0.15).abs() < 1e-12, "{x}");
    }

    #[test]
    fn a_vertex_at_the_bottom_of_a_crease_stays_in_the_middle() {
        // Two balls that are each other's mirror images and overlap.
        let mut skin = sphere(0.11, 3);
        let count = skin.positions.len() as u32;
        for p in &mut skin.positions {
            p.x += 0.1;
        }
        let mirrored = |p: &Vec3| Vec3::new(-p.x, p.y, p.z);
        let other: Vec<Vec3> = skin.positions.iter().map(mirrored).collect();
        let turned = |&[a, b, c]: &[u32; 3]| [a + count, c + count, b + count];
        let triangles: Vec<[u32; 3]> = skin.triangles.iter().map(turned).collect();
        skin.positions.extend(other);
        skin.triangles.extend(triangles);
        let body = ClosestPoint::new(&skin);
        let start = Vec3::new(0.0, 0.0, 0.047);
        let mut x = vec![start];
        let rings = [Vec::new()];
        let clearing = Clearing::new(&body, &skin, &[], &rings, vec![Vec3::zeros()], 5e-4);
        assert!(body.signed_distance(start) < 1e-3);
        clearing.clear(&mut x, &mut [3e-3]);
        // Along one side's normal it would go 2 mm aside. The places around it are not the crease's mirror images, but
        // as many are on either side, half a millimetre off, where a ball of 11 cm lies turned by 1/200.
        assert!(x[0].x.abs() < 2e-5, "{:e}", x[0].x);
        // Each of the six pushes leaves about half of what is missing.
        let distance = body.signed_distance(x[0]);
        assert!(distance > 2.8e-3, "{distance:e}");
    }
}
