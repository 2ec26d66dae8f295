//! Which triangles of a mesh go through each other, or through those of another mesh.
//!
//! Two triangles intersect when an edge of one pierces the other: its ends lie strictly on either
//! side of the other's plane, and it passes the three sides of the other on the same hand. All of
//! it is signs of tetrahedra, found by exact predicates (Shewchuk 1997, crate `robust`), so no
//! tolerance decides. Touching is no intersection; neither is sharing a vertex.

use super::Vec3;
use super::box_tree::{Aabb, BoxTree, around};
use rayon::prelude::*;
use robust::{Coord3D, orient3d};

/// Pairs (i, j), i < j, of triangles of one mesh that intersect and share no vertex; sorted.
pub fn within(x: &[Vec3], triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let boxes = boxes(x, triangles);
    let tree = BoxTree::new(&boxes);
    collect(&boxes, &tree, |i, j| {
        let (s, t) = (triangles[i as usize], triangles[j as usize]);
        i < j && s.iter().all(|a| !t.contains(a)) && intersect(corners(x, s), corners(x, t))
    })
}

/// Pairs (triangle of the first mesh, triangle of the second) that intersect; sorted.
pub fn between(
    x: &[Vec3],
    triangles: &[[u32; 3]],
    y: &[Vec3],
    others: &[[u32; 3]],
) -> Vec<[u32; 2]> {
    let tree = BoxTree::new(&boxes(y, others));
    collect(&boxes(x, triangles), &tree, |i, j| {
        let (s, t) = (triangles[i as usize], others[j as usize]);
        intersect(corners(x, s), corners(y, t))
    })
}

/// Whether an edge of one triangle pierces the other.
pub fn intersect(s: [Vec3; 3], t: [Vec3; 3]) -> bool {
    let edges = |t: [Vec3; 3]| [[t[0], t[1]], [t[1], t[2]], [t[2], t[0]]];
    edges(s).into_iter().any(|e| pierces(e, t)) || edges(t).into_iter().any(|e| pierces(e, s))
}

/// Whether the inside of a segment meets the inside of a triangle in one point.
pub fn pierces([p, q]: [Vec3; 2], [a, b, c]: [Vec3; 3]) -> bool {
    let (above, below) = (side(a, b, c, p), side(a, b, c, q));
    if above * below >= 0.0 {
        return false;
    }
    let hands = [side(p, q, a, b), side(p, q, b, c), side(p, q, c, a)];
    hands.iter().all(|h| *h > 0.0) || hands.iter().all(|h| *h < 0.0)
}

/// −1, 0 or 1: the exact sign of the volume of a tetrahedron.
fn side(a: Vec3, b: Vec3, c: Vec3, d: Vec3) -> f64 {
    let coord = |p: Vec3| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    let volume = orient3d(coord(a), coord(b), coord(c), coord(d));
    if volume == 0.0 { 0.0 } else { volume.signum() }
}

fn corners(x: &[Vec3], t: [u32; 3]) -> [Vec3; 3] {
    t.map(|v| x[v as usize])
}

fn boxes(x: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Aabb> {
    let boxed = |t: &[u32; 3]| around(&corners(x, *t), 0.0);
    triangles.iter().map(boxed).collect()
}

/// Pairs of overlapping boxes that pass `test`, sorted.
fn collect(
    boxes: &[Aabb],
    tree: &BoxTree,
    test: impl Fn(u32, u32) -> bool + Sync,
) -> Vec<[u32; 2]> {
    let of_one = |(i, query): (usize, &Aabb)| {
        let mut found = Vec::new();
        tree.overlapping(query, |j| {
            if test(i as u32, j) {
                found.push([i as u32, j]);
            }
        });
        found.sort_unstable();
        found
    };
    boxes.par_iter().enumerate().flat_map_iter(of_one).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    fn flat(points: [[f64; 3]; 3]) -> [Vec3; 3] {
        points.map(Vec3::from)
    }

    #[test]
    fn crossing_triangles_intersect_and_touching_ones_do_not() {
        let floor = flat([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
        let wall = |bottom: f64| flat([[0.2, bottom, 0.2], [0.3, 1.0, 0.2], [0.2, 1.0, 0.3]]);
        assert!(intersect(floor, wall(-0.1)));
        assert!(intersect(wall(-0.1), floor));
        assert!(!intersect(floor, wall(0.1)));
        // Standing on it, to the last bit.
        assert!(!intersect(floor, wall(0.0)));
        assert!(intersect(floor, wall(-f64::MIN_POSITIVE)));
    }

    #[test]
    fn triangles_linked_like_rings_intersect_by_two_edges() {
        // Neither has a corner near the other.
        let s = flat([[-1.0, 0.0, -0.1], [1.0, 0.0, -0.1], [0.0, 0.0, 2.0]]);
        let t = flat([[0.0, -1.0, 0.1], [0.0, 1.0, 0.1], [0.0, 0.0, -2.0]]);
        assert!(intersect(s, t));
    }

    #[test]
    fn two_crossing_sheets_intersect_along_a_line() {
        // Strips of 2 × 8 triangles along x and along z, crossing in the middle.
        let strip = |along: fn(f64, f64) -> Vec3| -> Vec<Vec3> {
            (0..18)
                .map(|v| along(f64::from(v / 2) - 4.0, f64::from(v % 2) - 0.5))
                .collect()
        };
        let x = strip(|u, w| Vec3::new(u + 0.21, w, 0.13));
        let y = strip(|u, w| Vec3::new(0.3 * w, w, u + 0.17));
        let quads = (0..8_u32).map(|i| 2 * i);
        let triangles: Vec<[u32; 3]> = quads
            .flat_map(|i| [[i, i + 1, i + 2], [i + 1, i + 3, i + 2]])
            .collect();
        let brute: Vec<[u32; 2]> = (0..16)
            .flat_map(|i| (0..16).map(move |j| [i, j]))
            .filter(|[i, j]| {
                let (s, t) = (triangles[*i as usize], triangles[*j as usize]);
                intersect(corners(&x, s), corners(&y, t))
            })
            .collect();
        assert!(!brute.is_empty());
        assert_eq!(between(&x, &triangles, &y, &triangles), brute);
        // As one mesh they intersect in the same places.
        let both: Vec<Vec3> = x.iter().chain(&y).copied().collect();
        let moved = triangles.iter().map(|t| t.map(|v| v + 18));
        let all: Vec<[u32; 3]> = triangles.iter().copied().chain(moved).collect();
        let shifted: Vec<[u32; 2]> = brute.iter().map(|[i, j]| [*i, j + 16]).collect();
        assert_eq!(within(&both, &all), shifted);
    }

    #[test]
    fn neighbours_in_a_crumpled_mesh_do_not_count() {
        let x: Vec<Vec3> = (0..4)
            .map(|i| Vec3::from_fn(|c, _| noise(5 * i + c)))
            .collect();
        assert!(within(&x, &[[0, 1, 2], [2, 1, 3]]).is_empty());
    }
}
