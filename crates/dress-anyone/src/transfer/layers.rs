//! Layers of cloth: pockets, lapels, fold-overs, facings, trouser legs that touch.
//!
//! Where another part of the garment lies close, a vertex is tied to the nearest point of it: the way from
//! there to here stays as it is, turned and stretched as the body's surroundings are there. What is over
//! stays over. (De Goes et al. 2020 extend stencils across layers; an affine-invariant stencil is blind to
//! which of two flat layers is above, so ties are used here.)

use super::bind::Carried;
use super::relax::Tie;
use crate::geometry::Vec3;
use crate::geometry::box_tree::{BoxTree, around};
use rayon::prelude::*;

/// Layers at the same part of the body are closer than this share of its height: 1 cm on an adult.
const CLOSE: f64 = 0.006;
/// Layers that are closer than this touch, wherever they are: 5 mm.
const TOUCHING: f64 = 0.003;
/// Cosine of the angle of the body's normals above which two vertices are at the same part of it: a
/// sleeve and the side it hangs beside are not.
const SAME_SIDE: f64 = 0.5;
/// Cloth this many edges away is no other layer.
const APART: usize = 4;

/// The ties of the cloth `x` \[m\] about a body of this `height` \[m\].
pub(super) fn ties(
    x: &[Vec3],
    triangles: &[[u32; 3]],
    rings: &[Vec<u32>],
    bound: &[Carried],
    height: f64,
) -> Vec<Tie> {
    let corners = |t: &[u32; 3]| t.map(|v| x[v as usize]);
    let boxes: Vec<_> = triangles.iter().map(|t| around(&corners(t), 0.0)).collect();
    let tree = BoxTree::new(&boxes);
    let tie = |v: usize| -> Option<Tie> {
        let mut candidates = Vec::new();
        let reach = around(&x[v..=v], CLOSE * height);
        tree.overlapping(&reach, |t| candidates.push(t));
        if candidates.is_empty() {
            return None;
        }
        candidates.sort_unstable();
        let near = neighbourhood(v as u32, rings);
        let nearest = candidates.into_iter().filter_map(|t| {
            let triangle = triangles[t as usize];
            if triangle.iter().any(|w| near.binary_search(w).is_ok()) {
                return None;
            }
            let weights = foot(x[v], corners(&triangle))?;
            let offset = x[v] - weighted(corners(&triangle), weights);
            let below = weighted(triangle.map(|w| bound[w as usize].normals[0]), weights);
            let alike = bound[v].normals[0].dot(&below) > SAME_SIDE * below.norm();
            let limit = if alike { CLOSE } else { TOUCHING };
            (offset.norm() < limit * height).then_some((offset, triangle, weights))
        });
        let (offset, triangle, weights) =
            nearest.min_by(|a, b| a.0.norm_squared().total_cmp(&b.0.norm_squared()))?;
        let turned = (bound[v].map * offset).try_normalize(0.0)?;
        Some(Tie {
            vertex: v as u32,
            triangle,
            weights,
            offset: turned * (offset.norm() * bound[v].ease),
        })
    };
    (0..x.len()).into_par_iter().filter_map(tie).collect()
}

/// Weights of the corners at the foot of `p`: where it is outside the triangle, about the closest.
fn foot(p: Vec3, [a, b, c]: [Vec3; 3]) -> Option<[f64; 3]> {
    let normal = (b - a).cross(&(c - a));
    let part = |from: Vec3, to: Vec3| normal.dot(&(to - from).cross(&(p - from))).max(0.0);
    let weights = [part(b, c), part(c, a), part(a, b)];
    let sum: f64 = weights.iter().sum();
    (sum > 0.0).then(|| weights.map(|weight| weight / sum))
}

fn weighted(corners: [Vec3; 3], weights: [f64; 3]) -> Vec3 {
    (0..3).map(|k| corners[k] * weights[k]).sum()
}

/// Vertices within a few edges of `v`, ascending.
fn neighbourhood(v: u32, rings: &[Vec<u32>]) -> Vec<u32> {
    let mut near = vec![v];
    for _ in 0..APART {
        let next: Vec<u32> = (near.iter())
            .flat_map(|&i| rings[i as usize].iter().copied())
            .collect();
        near.extend(next);
        near.sort_unstable();
        near.dedup();
    }
    near
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Mat3;
    use crate::geometry::closest_point::tests::sphere;
    use crate::geometry::mesh::rings;

    /// Two balls, one in the other, this far apart, and the ties of both.
    fn shells(gap: f64, facing: f64) -> (usize, Vec<Tie>) {
        let (inner, outer) = (sphere(0.3, 3), sphere(0.3 + gap, 3));
        let count = inner.positions.len();
        let x: Vec<Vec3> = inner
            .positions
            .iter()
            .chain(&outer.positions)
            .copied()
            .collect();
        let shifted = outer.triangles.iter().map(|t| t.map(|v| v + count as u32));
        let triangles: Vec<[u32; 3]> = inner.triangles.iter().copied().chain(shifted).collect();
        let bound = |(v, p): (usize, &Vec3)| Carried {
            point: *p,
            ease: 1.0,
            normals: [p.normalize() * if v < count { 1.0 } else { facing }; 2],
            map: Mat3::identity() * 2.0,
        };
        let bound: Vec<Carried> = x.iter().enumerate().map(bound).collect();
        let found = ties(&x, &triangles, &rings(x.len(), &triangles), &bound, 1.0);
        (count, found)
    }

    #[test]
    fn layers_are_tied_to_each_other_at_their_distance() {
        let (count, ties) = shells(0.004, 1.0);
        assert_eq!(ties.len(), 2 * count);
        for tie in &ties {
            let outside = tie.vertex as usize >= count;
            assert!(tie.triangle.iter().all(|w| (*w as usize) < count) == outside);
            // Faces sag between corners by 0.3 (1 − cos 0.1) at most.
            assert!((tie.offset.norm() - 0.004).abs() < 2e-3);
        }
    }

    #[test]
    fn what_faces_another_part_of_the_body_is_tied_where_it_touches_only() {
        assert!(shells(0.0045, -1.0).1.is_empty());
        assert!(!shells(0.0025, -1.0).1.is_empty());
    }
}
