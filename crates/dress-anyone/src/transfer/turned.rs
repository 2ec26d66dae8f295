//! Triangles that were turned over on the way, slivers most of all: at a crotch that is pressed into a narrow cleft, in
//! an armpit. They are turned back.

use super::bind::rotation_of;
use crate::geometry::{Mat3, Vec3};
use rayon::prelude::*;
use std::collections::BTreeSet;

/// Triangles whose normal is turned by more than a right angle against the rotation that takes the cloth around them
/// closest to where it goes; `[cloth vertex]` before and after.
pub(crate) fn turned_over(triangles: &[[u32; 3]], [before, after]: [&[Vec3]; 2]) -> Vec<usize> {
    let mut around = vec![BTreeSet::new(); before.len()];
    for t in triangles {
        for v in t {
            around[*v as usize].extend(*t);
        }
    }
    let normal = |x: &[Vec3], t: &[u32; 3]| {
        let [a, b, c] = t.map(|v| x[v as usize]);
        (b - a).cross(&(c - a))
    };
    let turned = |t: &[u32; 3]| {
        let patch: BTreeSet<u32> = t
            .iter()
            .flat_map(|v| &around[*v as usize])
            .copied()
            .collect();
        let rotation = rotation(&patch, before, after);
        (rotation * normal(before, t)).dot(&normal(after, t)) < 0.0
    };
    (0..triangles.len())
        .into_par_iter()
        .filter(|t| turned(&triangles[*t]))
        .collect()
}

/// Turns the shortest edge of each of the `turned` triangles to where the cloth around it has gone, and makes it as
/// long: slivers turn over by that edge.
pub(super) fn turn_back(
    x: &mut [Vec3],
    turned: &[usize],
    triangles: &[[u32; 3]],
    (drape, rings): (&[Vec3], &[Vec<u32>]),
) {
    for t in turned {
        let t = triangles[*t];
        let near = t.iter().flat_map(|v| &rings[*v as usize]);
        let patch: BTreeSet<u32> = near.chain(&t).copied().collect();
        let rotation = rotation(&patch, drape, x);
        let scale = spread(&patch, x) / spread(&patch, drape).max(f64::MIN_POSITIVE);
        let along = |[a, b]: [usize; 2]| drape[b] - drape[a];
        let [u, v, w] = t.map(|v| v as usize);
        let longer = |a: &[usize; 2], b: &[usize; 2]| along(*a).norm().total_cmp(&along(*b).norm());
        let sides = [[u, v], [v, w], [w, u]];
        let [a, b] = sides.into_iter().min_by(longer).unwrap_or([u, v]);
        let middle = 0.5 * (x[a] + x[b]);
        let half = 0.5 * scale * (rotation * along([a, b]));
        x[a] = middle - half;
        x[b] = middle + half;
    }
}

/// How far a patch of `x` spreads about its middle \[m\].
fn spread(patch: &BTreeSet<u32>, x: &[Vec3]) -> f64 {
    let middle = middle(patch, x);
    let squared = |v: &u32| (x[*v as usize] - middle).norm_squared();
    patch.iter().map(squared).sum::<f64>().sqrt()
}

fn middle(patch: &BTreeSet<u32>, x: &[Vec3]) -> Vec3 {
    let sum: Vec3 = patch.iter().map(|v| x[*v as usize]).sum();
    sum / patch.len() as f64
}

/// The rotation that takes a patch of `x` closest to that of `y` (Kabsch 1976).
fn rotation(patch: &BTreeSet<u32>, x: &[Vec3], y: &[Vec3]) -> Mat3 {
    let (from, to) = (middle(patch, x), middle(patch, y));
    let spread: Mat3 = (patch.iter())
        .map(|v| (y[*v as usize] - to) * (x[*v as usize] - from).transpose())
        .sum();
    rotation_of(spread)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;

    /// A ball, the same turned and scaled, and one of its vertices.
    fn ball() -> (Vec<[u32; 3]>, [Vec<Vec3>; 2], usize) {
        let ball = sphere(0.1, 3);
        let turn = nalgebra::Rotation3::from_euler_angles(2.0, 1.0, 0.3);
        let after = ball.positions.iter().map(|p| turn * p * 1.3).collect();
        (ball.triangles, [ball.positions, after], 100)
    }

    #[test]
    fn a_vertex_thrown_across_its_ring_turns_triangles_over_and_motions_do_not() {
        let (triangles, [before, mut after], v) = ball();
        assert!(turned_over(&triangles, [&before, &after]).is_empty());
        // Past the far side of its ring.
        let mut around = triangles.iter().filter(|t| t.contains(&(v as u32)));
        let across = around.next().expect("it is used");
        let others = across.iter().filter(|w| **w as usize != v);
        let middle: Vec3 = others.map(|w| after[*w as usize]).sum::<Vec3>() / 2.0;
        after[v] = middle * 1.5 - after[v] * 0.5;
        assert!(!turned_over(&triangles, [&before, &after]).is_empty());
    }

    #[test]
    fn slivers_whose_near_corners_changed_places_are_turned_back() {
        let (triangles, both, v) = ball();
        let rings = rings(both[0].len(), &triangles);
        let w = rings[v][0] as usize;
        let [before, after] = both.map(|mut x| {
            x[v] = x[w].lerp(&x[v], 0.1);
            x
        });
        let mut x = after.clone();
        x.swap(v, w);
        let turned = turned_over(&triangles, [&before, &x]);
        assert!(!turned.is_empty());
        turn_back(&mut x, &turned, &triangles, (&before, &rings));
        assert!(turned_over(&triangles, [&before, &x]).is_empty());
        // An edge of a few millimetres, by what the patch's spread and turn differ for it.
        for v in [v, w] {
            assert!((x[v] - after[v]).norm() < 1e-4);
        }
    }
}
