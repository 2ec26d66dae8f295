//! Gradients by the field at some points, handed on to the vertices of the body's mesh.
//!
//! d(p) = Σ B(u) c_n with c_n the coefficients, which follow from the distances at the nodes: sharpened,
//! and in a crevice filled from another node's. Of a node's signed distance d_n, ∂d_n/∂y_c = −β_c n for
//! the corners y of the triangle under the node, β its foot's weights and n the direction from the foot
//! to the node, turned outward. That is exact where the nodes around p hold exact distances, as they do
//! within 10 mm of the surface, and as long as the grid stays where it is: it stands on a multiple of its
//! spacing. The distance by a lid on a hole goes to the hole's rim.

use super::{DistanceField, nodes, slopes, values};
use crate::geometry::watertight::watertight;
use crate::geometry::{ClosestPoint, TriangleMesh, Vec3};
use std::collections::BTreeMap;

impl DistanceField {
    /// Gradient by the vertices of `body`, of which this is the field, of a function whose gradients by
    /// the distance and by its gradient at points p are given as (p, by distance, by gradient).
    pub fn pull_back(
        &self,
        body: &TriangleMesh,
        felt: impl Iterator<Item = (Vec3, f64, Vec3)>,
    ) -> Vec<Vec3> {
        let mut by_node = NodeGradient::new();
        for (p, by_distance, by_gradient) in felt {
            let Some((first, t)) = self.place_of(p) else {
                continue;
            };
            let [x, y, z] = t.map(|t| (values(t), slopes(t)));
            let g = by_gradient / self.grid.spacing;
            for n in 0..4 * 4 * 4 {
                let [i, j, k] = [n % 4, n / 4 % 4, n / 16];
                let by = by_distance * x.0[i] * y.0[j] * z.0[k]
                    + g.x * x.1[i] * y.0[j] * z.0[k]
                    + g.y * x.0[i] * y.1[j] * z.0[k]
                    + g.z * x.0[i] * y.0[j] * z.1[k];
                let node = [first[0] + i, first[1] + j, first[2] + k];
                *by_node.entry(node).or_default() += by;
            }
        }
        let solid = watertight(body);
        let closest = ClosestPoint::new(&solid);
        let mut plain = Self {
            grid: self.grid.clone(),
            reach: self.reach,
            values: nodes::distances(&self.grid, &closest, self.reach),
        };
        plain.sink_what_no_air_reaches();
        let mut hat = vec![Vec3::zeros(); solid.positions.len()];
        for (node, by) in plain.distances_pull_back(by_node) {
            let p = self.grid.position(node);
            let (Some(place), Some(foot)) = (plain.place(node), closest.query(p, f64::INFINITY))
            else {
                continue;
            };
            let distance = closest.signed(p, &foot);
            // On the surface itself the direction is the feature's own.
            let outward = if distance.abs() > ON_SURFACE {
                (p - foot.point) / distance
            } else {
                closest.pseudonormal(&foot)
            };
            // What no air reaches was made negative.
            let sign = if plain.values[place] * distance < 0.0 {
                -1.0
            } else {
                1.0
            };
            let corners = solid.triangles[foot.triangle as usize];
            for (corner, weight) in corners.into_iter().zip(foot.barycentric) {
                hat[corner as usize] -= outward * (sign * by * weight);
            }
        }
        lids_to_rims(&solid, body.positions.len(), &mut hat);
        hat
    }

    /// Gradient by the distances that the nodes hold here, given that by the coefficients that they
    /// make.
    fn distances_pull_back(&self, by_coefficient: NodeGradient) -> NodeGradient {
        let filled = |node, place: usize| self.filled(node, self.values[place]);
        let mut by_filled = NodeGradient::new();
        for (node, by) in by_coefficient {
            let Some(place) = self.place(node) else {
                continue;
            };
            *by_filled.entry(node).or_default() += by;
            let (d, _) = filled(node, place);
            let bend = self.bend(node, d, |node, place| filled(node, place).0);
            if bend == 0.0 || bend.abs() > self.sharpest() {
                continue;
            }
            let stored = |(node, place): ([usize; 3], Option<usize>)| place.map(|_| node);
            for neighbour in self.neighbours(node).filter_map(stored) {
                *by_filled.entry(neighbour).or_default() -= by / 6.0;
                *by_filled.entry(node).or_default() += by / 6.0;
            }
        }
        let mut by_distance = NodeGradient::new();
        for (node, by) in by_filled {
            let place = self.place(node).expect("it has a coefficient");
            if let (_, Some(teller)) = filled(node, place) {
                *by_distance.entry(teller).or_default() += by;
            }
        }
        by_distance
    }
}

/// Gradients by what nodes hold.
type NodeGradient = BTreeMap<[usize; 3], f64>;

/// Nearer the surface \[m\] round-off tells the direction from the foot.
const ON_SURFACE: f64 = 1e-9;

/// A lid's centre is the mean of its rim.
fn lids_to_rims(solid: &TriangleMesh, count: usize, hat: &mut Vec<Vec3>) {
    let mut rims: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for triangle in &solid.triangles {
        // The first corner of each triangle of a lid is another vertex of its rim.
        if let Some(centre) = triangle.iter().find(|v| **v as usize >= count) {
            rims.entry(*centre).or_default().push(triangle[0]);
        }
    }
    for (centre, rim) in rims {
        let share = hat[centre as usize] / rim.len() as f64;
        for v in rim {
            hat[v as usize] += share;
        }
    }
    hat.truncate(count);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};
    use crate::geometry::closest_point::tests::sphere;

    /// A ball with dents, so that no vertex is a node and no two nodes are equally far from it, where
    /// the field would have a kink.
    fn ball() -> TriangleMesh {
        let mut mesh = sphere(0.05, 3);
        for (i, p) in mesh.positions.iter_mut().enumerate() {
            *p += Vec3::from_fn(|c, _| 3e-4 * noise(300 + 3 * i + c));
        }
        mesh
    }

    /// The points where the field is felt, with gradients by its distance and by its slope.
    fn felt(at: impl Fn(usize) -> Vec3) -> Vec<(Vec3, f64, Vec3)> {
        let by = |i| Vec3::from_fn(|c, _| 1e-2 * noise(50 + 3 * i + c));
        (0..12).map(|i| (at(i), noise(40 + i), by(i))).collect()
    }

    fn around(i: usize) -> Vec3 {
        let direction = Vec3::from_fn(|c, _| noise(3 * i + c)).normalize();
        direction * (0.05 + 2e-3 * noise(90 + i))
    }

    fn assert_agrees_with_differences(mesh: &TriangleMesh, felt: &[(Vec3, f64, Vec3)]) {
        let field = DistanceField::new(mesh, 5e-3, 0.02);
        let hat = field.pull_back(mesh, felt.iter().copied());
        let direction: Vec<Vec3> = (0..mesh.positions.len())
            .map(|i| Vec3::from_fn(|c, _| noise(500 + 3 * i + c)))
            .collect();
        let value = |s: f64| -> f64 {
            let moved = mesh.positions.iter().zip(&direction);
            let moved = TriangleMesh {
                positions: moved.map(|(p, d)| p + d * s).collect(),
                triangles: mesh.triangles.clone(),
            };
            let field = DistanceField::new(&moved, 5e-3, 0.02);
            let at = |(p, by_distance, by_gradient): &(Vec3, f64, Vec3)| {
                let sample = field.sample(*p).expect("near the surface");
                by_distance * sample.distance + by_gradient.dot(&sample.gradient)
            };
            felt.iter().map(at).sum()
        };
        let slope: f64 = hat.iter().zip(&direction).map(|(h, d)| h.dot(d)).sum();
        assert_derivative(value, slope, 1e-7, 1e-3, 1e-6);
    }

    #[test]
    fn gradients_reach_the_vertices_of_the_mesh() {
        assert_agrees_with_differences(&ball(), &felt(around));
    }

    #[test]
    fn gradients_by_a_lid_reach_the_rim_of_its_hole() {
        let mut mesh = ball();
        // Where no point is felt.
        mesh.triangles.drain(200..202);
        assert_agrees_with_differences(&mesh, &felt(around));
    }

    #[test]
    fn gradients_in_a_crevice_reach_its_walls() {
        // Two balls 2 mm apart. Points in the mouth of what is between them, 13 to 21 mm from its middle:
        // a ball of 4 mm fits in 18 mm from it.
        let mut mesh = ball();
        let axis = Vec3::new(0.3, 0.9, 0.2).normalize();
        let other = ball();
        let count = mesh.positions.len() as u32;
        let moved = other.positions.iter().map(|p| p + axis * 0.102);
        mesh.positions.extend(moved);
        let triangles = other.triangles.iter().map(|t| t.map(|v| v + count));
        mesh.triangles.extend(triangles);
        let mouth = |i: usize| {
            let direction = Vec3::from_fn(|c, _| noise(3 * i + c))
                .cross(&axis)
                .normalize();
            axis * (0.051 + 1e-3 * noise(130 + i)) + direction * (0.017 + 4e-3 * noise(90 + i))
        };
        assert_agrees_with_differences(&mesh, &felt(mouth));
    }
}
