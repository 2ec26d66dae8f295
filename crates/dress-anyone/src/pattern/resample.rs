//! A drape carried from one mesh of a pattern to another: every vertex goes where its place on its
//! panel is draped.

use super::PatternMesh;
use crate::geometry::{ClosestPoint, TriangleMesh, Vec3};

/// The positions `x` \[m\] of `from`'s cloth vertices, at the cloth vertices of `to`, a mesh of the
/// same panels. Places beyond a mesh, as chords of curved edges leave, count as its nearest.
pub fn resample(from: &PatternMesh, x: &[Vec3], to: &PatternMesh) -> Vec<Vec3> {
    let flat = |mesh: &PatternMesh, v: usize| Vec3::new(mesh.x_bar[v].x, mesh.x_bar[v].y, 0.0);
    let mut carried = vec![Vec3::zeros(); to.x_bar.len()];
    for (panel, vertices) in to.panel_vertices.iter().enumerate() {
        let own = from.panel_vertices[panel].clone();
        let triangles = &from.triangles[from.panel_triangles[panel].clone()];
        let sheet = TriangleMesh {
            positions: own.clone().map(|v| flat(from, v)).collect(),
            triangles: triangles
                .iter()
                .map(|t| t.map(|v| v - own.start as u32))
                .collect(),
        };
        let nearest = ClosestPoint::new(&sheet);
        for v in vertices.clone() {
            let foot = nearest
                .query(flat(to, v), f64::INFINITY)
                .expect("a panel has triangles");
            let corners = triangles[foot.triangle as usize];
            carried[v] = corners
                .iter()
                .zip(foot.barycentric)
                .map(|(corner, weight)| x[from.sewing[*corner as usize] as usize] * weight)
                .sum();
        }
    }
    to.sew(&carried)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{rectangle, stitch};
    use crate::pattern::{Pattern, triangulate};

    /// Two sheets sewn side to side, and draped over a smooth hill.
    fn over_a_hill(mesh: &PatternMesh) -> Vec<Vec3> {
        let width = 0.4;
        let mut x = vec![Vec3::zeros(); mesh.x_bar.len()];
        for (panel, range) in mesh.panel_vertices.iter().enumerate() {
            for v in range.clone() {
                let p = mesh.x_bar[v];
                let along = p.x + width * panel as f64;
                x[v] = Vec3::new(along, p.y, 0.3 * along * p.y);
            }
        }
        mesh.sew(&x)
    }

    #[test]
    fn a_smooth_drape_is_the_same_on_another_mesh() {
        let pattern = Pattern {
            panels: vec![rectangle("left", 0.4, 0.3), rectangle("right", 0.4, 0.3)],
            // The right side of the first, the left side of the second.
            stitches: vec![stitch((0, 1), (1, 3))],
        };
        let fine = triangulate::mesh(&pattern, 0.02).unwrap();
        let coarse = triangulate::mesh(&pattern, 0.05).unwrap();
        let carried = resample(&fine, &over_a_hill(&fine), &coarse);
        let expected = over_a_hill(&coarse);
        assert!(expected.len() > 50);
        for (a, b) in carried.iter().zip(&expected) {
            // Chords of 2 cm leave a surface twisted by 0.3/m by 0.3 · 0.02² / 4 = 30 µm at most.
            assert!((a - b).norm() < 3e-5, "{a} for {b}");
        }
        let same = resample(&coarse, &expected, &coarse);
        for (a, b) in same.iter().zip(&expected) {
            assert!((a - b).norm() < 1e-12, "{a} for {b}");
        }
    }
}
