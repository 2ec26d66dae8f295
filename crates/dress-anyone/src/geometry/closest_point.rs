//! The exact closest point of a triangle mesh, and the signed distance that follows from it.
//!
//! A foot lies inside a face, inside an edge or on a vertex. Its side is told by the pseudonormal of
//! that feature (Bærentzen, Aanæs 2005): the face's normal, the sum of the unit normals at an edge,
//! the sum of unit normals weighted by angle at a vertex. Right wherever the mesh is closed,
//! oriented and free of self-intersections. Of equally close triangles the lowest index wins, so an
//! answer depends neither on the search order nor on a hint.

use super::bvh::Bvh;
use super::{TriangleMesh, Vec3};
use std::collections::BTreeMap;

/// A mesh prepared for closest-point queries.
#[derive(Clone, Debug)]
pub struct ClosestPoint {
    tree: Bvh,
    /// In the order of the tree's leaves.
    facets: Vec<Facet>,
    /// Place of each triangle in `facets`.
    place_of_triangle: Vec<u32>,
    /// Pseudonormals, `[triangle]`.
    normals: Vec<Pseudonormals>,
}

/// The closest point of a mesh.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Foot {
    /// Index of the triangle.
    pub triangle: u32,
    /// Weights of the triangle's corners: not negative, their sum is 1.
    pub barycentric: [f64; 3],
    /// Where it lies \[m\].
    pub point: Vec3,
    /// What it lies on.
    pub feature: Feature,
    /// Distance from the query point \[m\], not negative.
    pub distance: f64,
}

/// The part of a triangle on which a foot lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Feature {
    /// Its inside.
    Face,
    /// The edge from this corner (0..3) to the next.
    Edge(u8),
    /// This corner (0..3).
    Vertex(u8),
}

/// A triangle as the search wants it.
#[derive(Clone, Copy, Debug)]
struct Facet {
    triangle: u32,
    corners: [Vec3; 3],
    /// Whether edge k is measured from corner k + 1 to corner k: both triangles at an edge walk it
    /// from the vertex of lower index, so they round alike and tie exactly.
    reversed: [bool; 3],
}

/// Outward directions of a triangle's features, not normalised.
#[derive(Clone, Copy, Debug, Default)]
struct Pseudonormals {
    face: Vec3,
    edges: [Vec3; 3],
    corners: [Vec3; 3],
}

impl ClosestPoint {
    /// Prepares `mesh`.
    pub fn new(mesh: &TriangleMesh) -> Self {
        let corners: Vec<[Vec3; 3]> = (0..mesh.triangles.len()).map(|t| mesh.corners(t)).collect();
        let tree = Bvh::new(&corners);
        let mut place_of_triangle = vec![0; corners.len()];
        let facet = |(place, &triangle): (usize, &u32)| {
            place_of_triangle[triangle as usize] = place as u32;
            let [a, b, c] = mesh.triangles[triangle as usize];
            Facet {
                triangle,
                corners: corners[triangle as usize],
                reversed: [b < a, c < b, a < c],
            }
        };
        let facets = tree.order().iter().enumerate().map(facet).collect();
        Self {
            tree,
            facets,
            place_of_triangle,
            normals: pseudonormals(mesh),
        }
    }

    /// The point of the mesh closest to `p`, if one is no farther than `within` \[m\] (infinity for
    /// any). None for a point that is not finite.
    pub fn query(&self, p: Vec3, within: f64) -> Option<Foot> {
        self.search(p, within * within, None)
    }

    /// The same answer as [`Self::query`], found sooner when triangle `hint` is close to `p`.
    pub fn query_near(&self, p: Vec3, within: f64, hint: u32) -> Option<Foot> {
        let place = self.place_of_triangle[hint as usize];
        let start = self.facets[place as usize].foot(p);
        self.search(p, within * within, Some(start))
    }

    /// Unit outward direction of the feature under `foot`; zero on a degenerate triangle.
    pub fn pseudonormal(&self, foot: &Foot) -> Vec3 {
        let normals = &self.normals[foot.triangle as usize];
        let direction = match foot.feature {
            Feature::Face => normals.face,
            Feature::Edge(k) => normals.edges[usize::from(k)],
            Feature::Vertex(k) => normals.corners[usize::from(k)],
        };
        direction.try_normalize(0.0).unwrap_or_else(Vec3::zeros)
    }

    /// Distance of `p` from its `foot` \[m\], negative inside the mesh. Its gradient is the direction
    /// from the foot to `p`, turned outward.
    pub fn signed(&self, p: Vec3, foot: &Foot) -> f64 {
        let outside = (p - foot.point).dot(&self.pseudonormal(foot)) >= 0.0;
        if outside {
            foot.distance
        } else {
            -foot.distance
        }
    }

    /// Distance of `p` from the mesh \[m\], negative inside; infinite for a mesh without triangles.
    pub fn signed_distance(&self, p: Vec3) -> f64 {
        self.query(p, f64::INFINITY)
            .map_or(f64::INFINITY, |foot| self.signed(p, &foot))
    }

    /// The lowest (squared distance, triangle) of `start` and all facets within the bound.
    fn search(&self, p: Vec3, bound: f64, start: Option<Nearest>) -> Option<Foot> {
        if !p.iter().all(|x| x.is_finite()) {
            return None;
        }
        let mut best = start.filter(|nearest| nearest.squared_distance <= bound);
        let bound = best.map_or(bound, |nearest| nearest.squared_distance);
        self.tree.nearest(p, bound, |place, bound| {
            let found = self.facets[place].foot(p);
            let squared = found.squared_distance;
            let closer = best.map_or(squared <= bound, |best| {
                squared < best.squared_distance
                    || squared == best.squared_distance && found.triangle < best.triangle
            });
            if closer {
                best = Some(found);
            }
            best.map_or(bound, |best| best.squared_distance)
        });
        best.map(Nearest::foot)
    }
}

/// A foot during the search.
#[derive(Clone, Copy)]
struct Nearest {
    triangle: u32,
    barycentric: [f64; 3],
    point: Vec3,
    squared_distance: f64,
}

impl Nearest {
    fn foot(self) -> Foot {
        let [a, b, c] = self.barycentric.map(|weight| weight > 0.0);
        let feature = match (a, b, c) {
            (true, true, true) => Feature::Face,
            (true, true, false) => Feature::Edge(0),
            (false, true, true) => Feature::Edge(1),
            (true, false, true) => Feature::Edge(2),
            (true, ..) => Feature::Vertex(0),
            (_, true, _) => Feature::Vertex(1),
            _ => Feature::Vertex(2),
        };
        Foot {
            triangle: self.triangle,
            barycentric: self.barycentric,
            point: self.point,
            feature,
            distance: self.squared_distance.sqrt(),
        }
    }
}

impl Facet {
    /// The closest point of the facet: straight below `p` when that is inside, else the closest of
    /// the three edges.
    fn foot(&self, p: Vec3) -> Nearest {
        let [a, b, c] = self.corners;
        let normal = (b - a).cross(&(c - a));
        let weights = [
            normal.dot(&(c - b).cross(&(p - b))),
            normal.dot(&(a - c).cross(&(p - c))),
            normal.dot(&(b - a).cross(&(p - a))),
        ];
        if weights.iter().all(|&weight| weight > 0.0) {
            let sum: f64 = weights.iter().sum();
            let [u, v, w] = weights.map(|weight| weight / sum);
            return self.nearest(p, [u, v, w], a * u + b * v + c * w);
        }
        (0..3)
            .map(|k| self.foot_on_edge(p, k))
            .reduce(|best, other| {
                if other.squared_distance < best.squared_distance {
                    other
                } else {
                    best
                }
            })
            .expect("a triangle has three edges")
    }

    fn foot_on_edge(&self, p: Vec3, edge: usize) -> Nearest {
        let (mut i, mut j) = (edge, (edge + 1) % 3);
        if self.reversed[edge] {
            (i, j) = (j, i);
        }
        let (start, end) = (self.corners[i], self.corners[j]);
        let along = end - start;
        let projection = (p - start).dot(&along);
        let squared_length = along.norm_squared();
        let mut barycentric = [0.0; 3];
        // The ends first and without arithmetic: all triangles at a vertex then tie exactly.
        let point = if projection <= 0.0 {
            barycentric[i] = 1.0;
            start
        } else if projection >= squared_length {
            barycentric[j] = 1.0;
            end
        } else {
            let t = projection / squared_length;
            barycentric[i] = 1.0 - t;
            barycentric[j] = t;
            start + along * t
        };
        self.nearest(p, barycentric, point)
    }

    fn nearest(&self, p: Vec3, barycentric: [f64; 3], point: Vec3) -> Nearest {
        Nearest {
            triangle: self.triangle,
            barycentric,
            point,
            squared_distance: (p - point).norm_squared(),
        }
    }
}

fn pseudonormals(mesh: &TriangleMesh) -> Vec<Pseudonormals> {
    let mut at_vertex = vec![Vec3::zeros(); mesh.positions.len()];
    let mut at_edge: BTreeMap<[u32; 2], Vec3> = BTreeMap::new();
    let key = |a: u32, b: u32| [a.min(b), a.max(b)];
    let mut normals = vec![Pseudonormals::default(); mesh.triangles.len()];
    for (t, triangle) in mesh.triangles.iter().enumerate() {
        let corners = mesh.corners(t);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
        normals[t].face = normal;
        for k in 0..3 {
            let [here, next, last] = [corners[k], corners[(k + 1) % 3], corners[(k + 2) % 3]];
            at_vertex[triangle[k] as usize] += normal * (next - here).angle(&(last - here));
            let edge = key(triangle[k], triangle[(k + 1) % 3]);
            *at_edge.entry(edge).or_insert_with(Vec3::zeros) += normal;
        }
    }
    for (triangle, normals) in mesh.triangles.iter().zip(&mut normals) {
        for k in 0..3 {
            normals.edges[k] = at_edge[&key(triangle[k], triangle[(k + 1) % 3])];
            normals.corners[k] = at_vertex[triangle[k] as usize];
        }
    }
    normals
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::check::{STEP, assert_derivative, noise};
    use std::f64::consts::TAU;

    fn point(i: usize) -> Vec3 {
        Vec3::new(noise(5 * i), noise(7 * i + 1), noise(11 * i + 2))
    }

    /// A sphere about the origin: an octahedron, each triangle cut into four `rounds` times.
    pub(crate) fn sphere(radius: f64, rounds: usize) -> TriangleMesh {
        let mut positions: Vec<Vec3> = [1.0, -1.0]
            .into_iter()
            .flat_map(|s| [Vec3::x() * s, Vec3::y() * s, Vec3::z() * s])
            .collect();
        let mut triangles: Vec<[u32; 3]> = vec![
            [0, 1, 2],
            [3, 2, 1],
            [0, 2, 4],
            [0, 5, 1],
            [3, 4, 2],
            [3, 1, 5],
            [0, 4, 5],
            [3, 5, 4],
        ];
        for _ in 0..rounds {
            let mut middles = BTreeMap::new();
            let mut middle = |a: u32, b: u32| {
                *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                    let sum = positions[a as usize] + positions[b as usize];
                    positions.push(sum.normalize());
                    positions.len() as u32 - 1
                })
            };
            triangles = triangles
                .iter()
                .flat_map(|&[a, b, c]| {
                    let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        for p in &mut positions {
            *p *= radius;
        }
        TriangleMesh {
            positions,
            triangles,
        }
    }

    /// A closed, oriented, dented mesh.
    fn bumpy() -> TriangleMesh {
        let mut mesh = sphere(0.5, 3);
        for (i, p) in mesh.positions.iter_mut().enumerate() {
            *p *= 1.0 + 0.15 * noise(i);
        }
        mesh
    }

    /// Generalised winding number: 1 inside, 0 outside (van Oosterom, Strackee 1983).
    fn winding_number(mesh: &TriangleMesh, p: Vec3) -> f64 {
        let solid_angle = |t: usize| {
            let [a, b, c] = mesh.corners(t).map(|q| q - p);
            let [la, lb, lc] = [a, b, c].map(|q| q.norm());
            let bottom = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
            2.0 * a.dot(&b.cross(&c)).atan2(bottom)
        };
        (0..mesh.triangles.len()).map(solid_angle).sum::<f64>() / (2.0 * TAU)
    }

    #[test]
    fn the_foot_is_the_one_brute_force_finds() {
        // Unconnected triangles of every shape, and the ties of a closed mesh.
        let soup = TriangleMesh {
            positions: (0..600).map(point).collect(),
            triangles: (0..200).map(|t| [3 * t, 3 * t + 1, 3 * t + 2]).collect(),
        };
        for mesh in [soup, bumpy()] {
            let closest = ClosestPoint::new(&mesh);
            for i in 0..300 {
                let p = point(1000 + i);
                let expected = (closest.facets.iter().map(|facet| facet.foot(p)))
                    .min_by(|a, b| {
                        (a.squared_distance.total_cmp(&b.squared_distance))
                            .then(a.triangle.cmp(&b.triangle))
                    })
                    .map(Nearest::foot);
                assert_eq!(closest.query(p, f64::INFINITY), expected);
                let hint = (i * 7 % mesh.triangles.len()) as u32;
                assert_eq!(closest.query_near(p, f64::INFINITY, hint), expected);
                let distance = expected.unwrap().distance;
                assert_eq!(closest.query(p, distance * 1.001), expected);
                assert_eq!(closest.query_near(p, distance * 0.999, hint), None);
            }
        }
    }

    #[test]
    fn a_foot_is_no_farther_than_any_point_of_the_triangle() {
        let mesh = TriangleMesh {
            positions: (0..3).map(point).collect(),
            triangles: vec![[0, 1, 2]],
        };
        let closest = ClosestPoint::new(&mesh);
        let [a, b, c] = mesh.corners(0);
        for i in 0..200 {
            let p = point(10 + i) * 2.0;
            let foot = closest.query(p, f64::INFINITY).unwrap();
            let [u, v, w] = foot.barycentric;
            assert!(
                (u + v + w - 1.0).abs() < 1e-15,
                "weights are a partition of one"
            );
            assert!((a * u + b * v + c * w - foot.point).norm() < 1e-15);
            let sampled = (0..=60_u32)
                .flat_map(|i| (0..=60 - i).map(move |j| (f64::from(i) / 60.0, f64::from(j) / 60.0)))
                .map(|(u, v)| (a * u + b * v + c * (1.0 - u - v) - p).norm())
                .fold(f64::INFINITY, f64::min);
            // A sample lies within 1/60 of the longest edge (< 3.5 m) of any point.
            assert!(foot.distance <= sampled + 1e-15 && sampled < foot.distance + 0.06);
        }
    }

    #[test]
    fn the_sign_agrees_with_the_winding_number() {
        let mesh = bumpy();
        let closest = ClosestPoint::new(&mesh);
        let inside = (0..1500)
            .filter(|&i| {
                let inside = winding_number(&mesh, point(i)) > 0.5;
                assert_eq!(closest.signed_distance(point(i)) < 0.0, inside, "point {i}");
                inside
            })
            .count();
        // The unit cube around holds the body 15 times: both sides are sampled.
        assert!((30..1400).contains(&inside), "{inside} inside");
    }

    #[test]
    fn the_gradient_points_from_the_foot_to_the_point() {
        let closest = ClosestPoint::new(&bumpy());
        for i in 0..50 {
            let (p, along) = (point(i), point(i + 99));
            let foot = closest.query(p, f64::INFINITY).unwrap();
            let gradient = (p - foot.point) / closest.signed(p, &foot);
            let distance = |s: f64| closest.signed_distance(p + along * s);
            // One-sided kinks where the feature changes within the step would show as 1e-1.
            assert_derivative(distance, gradient.dot(&along), STEP * 1e-2, 1.0, 1e-5);
        }
    }

    #[test]
    fn distances_to_a_fine_sphere_are_those_of_the_sphere() {
        let closest = ClosestPoint::new(&sphere(0.3, 5));
        for i in 0..100 {
            let p = point(i);
            // Edges of 21 mm at most: circumcircles of radius 13 mm, which sag by 13²/(2·300).
            assert!((closest.signed_distance(p) - (p.norm() - 0.3)).abs() < 2.9e-4);
        }
    }

    #[test]
    fn ties_go_to_the_lowest_triangle() {
        let mesh = sphere(1.0, 2);
        let closest = ClosestPoint::new(&mesh);
        for (v, &p) in mesh.positions.iter().enumerate() {
            let lowest = (mesh.triangles.iter()).position(|t| t.contains(&(v as u32)));
            for p in [p, p * 1.5] {
                let foot = closest.query(p, f64::INFINITY).unwrap();
                assert_eq!(Some(foot.triangle as usize), lowest);
                assert!(matches!(foot.feature, Feature::Vertex(_)));
            }
        }
    }

    #[test]
    fn degenerate_triangles_and_points_are_answered() {
        let mesh = TriangleMesh {
            positions: vec![Vec3::zeros(), Vec3::x(), Vec3::x() * 2.0, Vec3::y()],
            triangles: vec![[0, 1, 2], [3, 3, 3]],
        };
        let closest = ClosestPoint::new(&mesh);
        let foot = closest.query(Vec3::new(1.5, -1.0, 0.0), 2.0).unwrap();
        assert_eq!((foot.triangle, foot.distance), (0, 1.0));
        let foot = closest
            .query(Vec3::new(0.0, 3.0, 0.0), f64::INFINITY)
            .unwrap();
        assert_eq!((foot.triangle, foot.distance), (1, 2.0));
        assert_eq!(closest.query(Vec3::repeat(f64::NAN), f64::INFINITY), None);
        let nothing = ClosestPoint::new(&TriangleMesh::default());
        assert_eq!(nothing.signed_distance(Vec3::zeros()), f64::INFINITY);
    }
}
