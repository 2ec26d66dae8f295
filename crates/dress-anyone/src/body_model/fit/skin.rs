//! What of a mesh is the skin to fit: its large components, of a size that can be searched, and of
//! one body.

use crate::geometry::groups::Groups;
use crate::geometry::{TriangleMesh, Vec3, bounds};
use crate::problem::Problem;
use std::collections::BTreeMap;

/// Components below this share of the whole area are eyes, teeth, lashes, buttons.
const SMALL: f64 = 0.02;
/// Meshes of more triangles are thinned out \[–\].
const MANY: usize = 300_000;
/// To about this many.
const ENOUGH: f64 = 150_000.0;

/// The skin of `mesh`; `notes` tells what was left out.
pub(super) fn outer_skin(
    mesh: &TriangleMesh,
    notes: &mut Vec<String>,
) -> Result<TriangleMesh, Vec<Problem>> {
    let refuse = |text: &str| Err(vec![Problem::whole(text)]);
    if mesh
        .positions
        .iter()
        .any(|p| !p.iter().all(|c| c.is_finite()))
    {
        return refuse("a vertex is not at a finite place; export the mesh again");
    }
    let components = components(mesh);
    let total: f64 = components.iter().map(|c| c.area).sum();
    if !(total > 0.0) {
        return refuse("the mesh has no surface: all its triangles are empty");
    }
    let (low, high) = mesh.bounds();
    if are_two(&components, high.y - low.y) {
        return refuse(
            "there are two bodies in this file, side by side; save each in a file of its own",
        );
    }
    let kept: Vec<&Component> = components
        .iter()
        .filter(|c| c.area >= SMALL * total)
        .collect();
    let left_out = components.len() - kept.len();
    if left_out > 0 {
        notes.push(format!(
            "{left_out} small components (eyes, teeth, lashes, …) are not fitted"
        ));
    }
    let triangles: Vec<[u32; 3]> = kept.iter().flat_map(|c| c.triangles.clone()).collect();
    let skin = TriangleMesh {
        positions: mesh.positions.clone(),
        triangles,
    };
    if skin.triangles.len() <= MANY {
        return Ok(skin);
    }
    let thinned = thinned(&skin, (2.0 * total / ENOUGH).sqrt());
    notes.push(format!(
        "thinned from {} to {} triangles for fitting",
        skin.triangles.len(),
        thinned.triangles.len()
    ));
    Ok(thinned)
}

struct Component {
    triangles: Vec<[u32; 3]>,
    area: f64,
    low: Vec3,
    high: Vec3,
}

/// Connected components, in the order of their first vertices.
fn components(mesh: &TriangleMesh) -> Vec<Component> {
    let mut groups = Groups::new(mesh.positions.len());
    for &[a, b, c] in &mesh.triangles {
        groups.join([a, b]);
        groups.join([a, c]);
    }
    let mut by_group: BTreeMap<u32, Vec<[u32; 3]>> = BTreeMap::new();
    for t in &mesh.triangles {
        by_group.entry(groups.first_of(t[0])).or_default().push(*t);
    }
    let component = |triangles: Vec<[u32; 3]>| {
        let corners = |t: &[u32; 3]| t.map(|v| mesh.positions[v as usize]);
        let area = |t: &[u32; 3]| {
            let [a, b, c] = corners(t);
            0.5 * (b - a).cross(&(c - a)).norm()
        };
        let (low, high) = bounds(triangles.iter().flat_map(corners));
        Component {
            area: triangles.iter().map(area).sum(),
            triangles,
            low,
            high,
        }
    };
    by_group.into_values().map(component).collect()
}

/// Whether two large components as tall as the whole stand beside each other.
fn are_two(components: &[Component], height: f64) -> bool {
    let largest = components.iter().map(|c| c.area).fold(0.0, f64::max);
    let tall = |c: &&Component| c.area > 0.4 * largest && c.high.y - c.low.y > 0.6 * height;
    let tall: Vec<&Component> = components.iter().filter(tall).collect();
    let apart = |a: &Component, b: &Component| {
        let overlap = |axis: usize| {
            let shared = a.high[axis].min(b.high[axis]) - a.low[axis].max(b.low[axis]);
            let least = (a.high[axis] - a.low[axis]).min(b.high[axis] - b.low[axis]);
            shared.max(0.0) / least
        };
        overlap(0) * overlap(2) < 0.5
    };
    tall.iter()
        .enumerate()
        .any(|(i, a)| tall[..i].iter().any(|b| apart(a, b)))
}

/// Vertices in one cell of a grid become one, at their mean; what collapses is dropped.
fn thinned(mesh: &TriangleMesh, cell: f64) -> TriangleMesh {
    let (index, count) = clusters(mesh, cell);
    let mut sums = vec![(Vec3::zeros(), 0.0); count];
    for (p, i) in mesh.positions.iter().zip(&index) {
        if let Some((sum, weight)) = sums.get_mut(*i as usize) {
            *sum += p;
            *weight += 1.0;
        }
    }
    TriangleMesh {
        positions: sums.into_iter().map(|(sum, weight)| sum / weight).collect(),
        triangles: collapsed(&mesh.triangles, &index),
    }
}

/// The cluster of each vertex by cells of a grid, numbered as they first occur in the triangles, and
/// how many there are; `u32::MAX` for vertices in no triangle.
pub(super) fn clusters(mesh: &TriangleMesh, cell: f64) -> (Vec<u32>, usize) {
    let mut index_of_cell: BTreeMap<[i64; 3], u32> = BTreeMap::new();
    let mut index = vec![u32::MAX; mesh.positions.len()];
    for &v in mesh.triangles.as_flattened() {
        if index[v as usize] != u32::MAX {
            continue;
        }
        let p = mesh.positions[v as usize];
        let key = [p.x, p.y, p.z].map(|c| (c / cell).floor() as i64);
        let next = index_of_cell.len() as u32;
        index[v as usize] = *index_of_cell.entry(key).or_insert(next);
    }
    (index, index_of_cell.len())
}

/// Triangles between clusters: those of three different ones, each once.
pub(super) fn collapsed(triangles: &[[u32; 3]], index: &[u32]) -> Vec<[u32; 3]> {
    let from_least = |[a, b, c]: [u32; 3]| {
        if a < b && a < c {
            [a, b, c]
        } else if b < c {
            [b, c, a]
        } else {
            [c, a, b]
        }
    };
    let mut triangles: Vec<[u32; 3]> = triangles
        .iter()
        .map(|t| t.map(|v| index[v as usize]))
        .filter(|[a, b, c]| a != b && b != c && c != a)
        .map(from_least)
        .collect();
    triangles.sort_unstable();
    triangles.dedup();
    triangles
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::closest_point::tests::sphere;

    fn moved(mesh: &TriangleMesh, by: Vec3) -> TriangleMesh {
        TriangleMesh {
            positions: mesh.positions.iter().map(|p| p + by).collect(),
            triangles: mesh.triangles.clone(),
        }
    }

    fn together(meshes: &[TriangleMesh]) -> TriangleMesh {
        let mut all = TriangleMesh::default();
        for mesh in meshes {
            let first = all.positions.len() as u32;
            all.positions.extend(&mesh.positions);
            all.triangles
                .extend(mesh.triangles.iter().map(|t| t.map(|v| v + first)));
        }
        all
    }

    #[test]
    fn two_bodies_are_refused_and_an_eye_in_a_head_is_left_out() {
        let (body, eye) = (sphere(1.0, 3), sphere(0.1, 2));
        let pair = together(&[body.clone(), moved(&body, Vec3::new(2.5, 0.0, 0.0))]);
        let told = outer_skin(&pair, &mut Vec::new()).unwrap_err();
        assert!(told[0].text.contains("two bodies"), "{told:?}");
        let mut notes = Vec::new();
        let skin = outer_skin(&together(&[body.clone(), eye]), &mut notes).unwrap();
        assert_eq!(skin.triangles, body.triangles);
        assert!(notes[0].starts_with("1 small"), "{notes:?}");
    }

    #[test]
    fn a_thinned_sphere_keeps_its_area() {
        let dense = sphere(1.0, 6);
        let thin = thinned(&dense, 0.1);
        assert!(thin.triangles.len() < dense.triangles.len() / 4);
        let area = |mesh: &TriangleMesh| components(mesh).iter().map(|c| c.area).sum::<f64>();
        // Chords of 0.1 on a unit sphere, and corners of cells that average inwards.
        assert!((area(&thin) / area(&dense) - 1.0).abs() < 0.05);
    }

    #[test]
    fn nothing_and_nonsense_are_refused() {
        let told = outer_skin(&TriangleMesh::default(), &mut Vec::new()).unwrap_err();
        assert!(told[0].text.contains("no surface"), "{told:?}");
        let mut nan = sphere(1.0, 1);
        nan.positions[0].x = f64::NAN;
        assert!(outer_skin(&nan, &mut Vec::new()).is_err());
    }
}
