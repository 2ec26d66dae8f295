//! Parts of a body that go through each other are drawn apart: thighs that overlap in a pose that is not
//! their own leave no place for the cloth between them, and a closest point in there says nothing.

use crate::geometry::groups::Groups;
use crate::geometry::intersections::within;
use crate::geometry::mesh::rings;
use crate::geometry::{TriangleMesh, Vec3};
use std::collections::BTreeSet;

/// How far skin moves in a round, as share of the body's height: half a millimetre on an adult.
const STEP: f64 = 3e-4;
/// Most rounds: half a centimetre on an adult.
const ROUNDS: usize = 10;
/// Rounds that what met goes on: the gap is some eight millimetres wide then, room for the cloth of either side.
const MORE: usize = 8;

/// `body` with skin that meets other skin moved inward until it does not, and a little further. Folds and toes
/// that still meet then are as they were.
pub fn parted(body: &TriangleMesh) -> TriangleMesh {
    let mut pairs = within(&body.positions, &body.triangles);
    if pairs.is_empty() {
        return body.clone();
    }
    let (low, high) = body.bounds();
    let step = STEP * (high - low).max();
    let rings = rings(body.positions.len(), &body.triangles);
    let inward: Vec<Vec3> = body.vertex_normals().iter().map(|n| n * -step).collect();
    let mut x = body.positions.clone();
    let mut met = vec![0.0_f64; x.len()];
    for _ in 0..ROUNDS {
        let mut meets = vec![0.0_f64; x.len()];
        for t in pairs.iter().flatten() {
            for v in body.triangles[*t as usize] {
                meets[v as usize] = 1.0;
            }
        }
        move_by(&mut x, &meets, &rings, &inward);
        for (met, meets) in met.iter_mut().zip(meets) {
            *met = met.max(meets);
        }
        pairs = within(&x, &body.triangles);
        if pairs.is_empty() {
            break;
        }
    }
    for _ in 0..MORE {
        move_by(&mut x, &met, &rings, &inward);
    }
    put_back(&mut x, body);
    TriangleMesh {
        positions: x,
        triangles: body.triangles.clone(),
    }
}

/// Moves what `meets` by its step `inward` \[m\], and what is around it by the mean of that.
fn move_by(x: &mut [Vec3], meets: &[f64], rings: &[Vec<u32>], inward: &[Vec3]) {
    for (v, ring) in rings.iter().enumerate() {
        let around: f64 = ring.iter().map(|&w| meets[w as usize]).sum();
        x[v] += inward[v] * meets[v].max(around / ring.len().max(1) as f64);
    }
}

/// Puts patches of moved skin that meet other skin all the same back to where they are on `body`.
fn put_back(x: &mut [Vec3], body: &TriangleMesh) {
    let moved: Vec<bool> = (x.iter().zip(&body.positions))
        .map(|(x, p)| x != p)
        .collect();
    let mut patches = Groups::new(x.len());
    for &[a, b, c] in &body.triangles {
        for side in [[a, b], [b, c], [c, a]] {
            if side.iter().all(|v| moved[*v as usize]) {
                patches.join(side);
            }
        }
    }
    let pairs = within(x, &body.triangles);
    let met = pairs.iter().flatten();
    let met = met.flat_map(|t| body.triangles[*t as usize]);
    let stuck: BTreeSet<u32> = met.map(|v| patches.first_of(v)).collect();
    for (v, x) in x.iter_mut().enumerate() {
        if moved[v] && stuck.contains(&patches.first_of(v as u32)) {
            *x = body.positions[v];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;

    /// Two balls, whose centres are this far apart.
    fn pair(apart: f64) -> TriangleMesh {
        let mut mesh = sphere(0.1, 4);
        let count = mesh.positions.len() as u32;
        let other = mesh.triangles.iter().map(|t| t.map(|v| v + count));
        mesh.triangles.extend(other.collect::<Vec<_>>());
        let moved = mesh.positions.iter().map(|p| p + Vec3::x() * apart);
        mesh.positions.extend(moved.collect::<Vec<_>>());
        mesh
    }

    #[test]
    fn thighs_that_overlap_are_drawn_apart_and_others_are_left_alone() {
        let body = pair(0.1985);
        let found = parted(&body);
        assert!(within(&found.positions, &found.triangles).is_empty());
        let moves = body.positions.iter().zip(&found.positions);
        let farthest = moves.map(|(a, b)| (b - a).norm()).fold(0.0, f64::max);
        // Half of the 1.5 mm that they overlap, the further steps, and the last one may go past.
        let steps = MORE as f64 + 2.0;
        assert!(farthest < 0.75e-3 + steps * STEP * 0.396, "{farthest}");
        let apart = pair(0.202);
        assert_eq!(parted(&apart), apart);
    }
}
