//! Makes a mesh a solid: lids on its holes, every component with its outside out.
//!
//! A lid is a fan around the mean of its rim. Rims are the directed edges walked once more often
//! forth than back; at every vertex as many of them leave as arrive, so following them always closes.

use super::groups::Groups;
use super::{TriangleMesh, Vec3};
use std::collections::BTreeMap;

/// `mesh` with its holes lidded and its inside-out components turned. Vertices and triangles keep
/// their indices; the lids' come behind them.
pub fn watertight(mesh: &TriangleMesh) -> TriangleMesh {
    let mut solid = mesh.clone();
    for rim in rims(&mesh.triangles) {
        let sum: Vec3 = rim.iter().map(|&v| mesh.positions[v as usize]).sum();
        let centre = solid.positions.len() as u32;
        solid.positions.push(sum / rim.len() as f64);
        let next = rim.iter().cycle().skip(1);
        let lid = rim.iter().zip(next).map(|(&a, &b)| [b, a, centre]);
        solid.triangles.extend(lid);
    }
    turn_outside_out(&mut solid);
    solid
}

/// Closed walks along the open edges, in the direction of the triangles beside them.
fn rims(triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut surplus: BTreeMap<[u32; 2], i32> = BTreeMap::new();
    for &[a, b, c] in triangles {
        for edge in [[a, b], [b, c], [c, a]] {
            *surplus.entry(edge).or_default() += 1;
            *surplus.entry([edge[1], edge[0]]).or_default() -= 1;
        }
    }
    let mut leaving: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ([a, b], count) in surplus {
        for _ in 0..count {
            leaving.entry(a).or_default().push(b);
        }
    }
    let mut rims = Vec::new();
    while let Some((&start, _)) = leaving.first_key_value() {
        let mut rim = vec![];
        let mut here = start;
        while let Some(ends) = leaving.get_mut(&here) {
            rim.push(here);
            let next = ends.pop().expect("vertices without ends are removed");
            if ends.is_empty() {
                leaving.remove(&here);
            }
            here = next;
            if here == start {
                break;
            }
        }
        rims.push(rim);
    }
    rims
}

/// Flips the triangles of every component of negative volume.
fn turn_outside_out(solid: &mut TriangleMesh) {
    let component = components(solid.positions.len(), &solid.triangles);
    let component_of = |t: &[u32; 3]| component[t[0] as usize] as usize;
    let mut volumes = vec![0.0; solid.positions.len()];
    for (t, triangle) in solid.triangles.iter().enumerate() {
        // About a point of the component, where rounding is least.
        let origin = solid.positions[component_of(triangle)];
        let [a, b, c] = solid.corners(t).map(|p| p - origin);
        volumes[component_of(triangle)] += a.dot(&b.cross(&c));
    }
    for triangle in &mut solid.triangles {
        if volumes[component_of(triangle)] < 0.0 {
            triangle.swap(1, 2);
        }
    }
}

/// The lowest vertex connected to each vertex.
fn components(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut groups = Groups::new(vertex_count);
    for &[a, b, c] in triangles {
        groups.join([a, b]);
        groups.join([a, c]);
    }
    (0..vertex_count as u32)
        .map(|v| groups.first_of(v))
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;

    #[test]
    fn a_closed_mesh_is_left_alone() {
        assert_eq!(watertight(&sphere(1.0, 2)), sphere(1.0, 2));
    }

    #[test]
    fn holes_get_lids_and_inside_out_components_are_turned() {
        let whole = sphere(1.0, 3);
        let mut open = whole.clone();
        open.triangles.drain(100..104);
        open.triangles.drain(10..11);
        for triangle in &mut open.triangles {
            triangle.swap(0, 1);
        }
        let solid = watertight(&open);
        assert!(rims(&solid.triangles).is_empty());
        let volume = |mesh: &TriangleMesh| -> f64 {
            (0..mesh.triangles.len())
                .map(|t| mesh.corners(t))
                .map(|[a, b, c]| a.dot(&b.cross(&c)) / 6.0)
                .sum()
        };
        // Five of 512 triangles became flat: their caps are about a thousandth of the volume.
        assert!((volume(&solid) / volume(&whole) - 1.0).abs() < 3e-3);
    }
}
