//! A triangle mesh in space and its vertex normals.

use super::Vec3;
pub use super::bounds;
use std::collections::BTreeSet;

/// Positions and triangles; triangles are counter-clockwise seen from outside.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TriangleMesh {
    /// Vertex positions \[m\], `[vertex]`.
    pub positions: Vec<Vec3>,
    /// Vertex indices, `[triangle][corner]`.
    pub triangles: Vec<[u32; 3]>,
}

impl TriangleMesh {
    /// The corners of triangle `t`.
    pub fn corners(&self, t: usize) -> [Vec3; 3] {
        self.triangles[t].map(|v| self.positions[v as usize])
    }

    /// The area of all triangles \[m²\].
    pub fn area(&self) -> f64 {
        let doubled = |[a, b, c]: [Vec3; 3]| (b - a).cross(&(c - a)).norm();
        let all = (0..self.triangles.len()).map(|t| 0.5 * doubled(self.corners(t)));
        all.sum()
    }

    /// Smallest and largest corner of the box around all vertices \[m\].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds(&self.positions)
    }

    /// Unit normals per vertex, area-weighted; zero where a vertex has no triangle.
    pub fn vertex_normals(&self) -> Vec<Vec3> {
        vertex_normals(&self.positions, &self.triangles)
    }
}

/// Unit normals per vertex, area-weighted; zero where a vertex has no triangle.
pub fn vertex_normals(positions: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut normals = vec![Vec3::zeros(); positions.len()];
    for triangle in triangles {
        let [a, b, c] = triangle.map(|v| positions[v as usize]);
        let doubled_area = (b - a).cross(&(c - a));
        for &v in triangle {
            normals[v as usize] += doubled_area;
        }
    }
    for normal in &mut normals {
        *normal = normal.try_normalize(0.0).unwrap_or_else(Vec3::zeros);
    }
    normals
}

/// The neighbours of every vertex along the triangles' edges, ascending.
pub fn rings(vertex_count: usize, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
    let mut rings = vec![BTreeSet::new(); vertex_count];
    for &[a, b, c] in triangles {
        rings[a as usize].extend([b, c]);
        rings[b as usize].extend([c, a]);
        rings[c as usize].extend([a, b]);
    }
    let ascending = rings.into_iter().map(|ring| ring.into_iter().collect());
    ascending.collect()
}
