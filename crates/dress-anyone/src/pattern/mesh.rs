//! The meshed, sewn rest shape of a pattern.
//!
//! Two numberings meet here: *pattern vertices* (each panel has its own, positions `x_bar` in the
//! plane) and *cloth vertices* (positions `x` in space). [`PatternMesh::sewing`] maps the first onto
//! the second; stitched pattern vertices share one cloth vertex, so seams are exact.

use super::EdgeId;
use crate::geometry::Vec2;
use std::ops::Range;

/// The rest shape: a triangulation of every panel, and how its vertices are sewn.
#[derive(Clone, Debug, PartialEq)]
pub struct PatternMesh {
    /// Rest positions in each panel's plane \[m\], `[pattern vertex]`.
    pub x_bar: Vec<Vec2>,
    /// Pattern vertices, counter-clockwise in the plane, `[triangle][corner]`.
    pub triangles: Vec<[u32; 3]>,
    /// Pattern vertices of each panel, `[panel]`.
    pub panel_vertices: Vec<Range<usize>>,
    /// Triangles of each panel, `[panel]`.
    pub panel_triangles: Vec<Range<usize>>,
    /// Whether the panel's right side is its +z side, `[panel]` (its loop is counter-clockwise).
    pub right_side_up: Vec<bool>,
    /// Pattern vertices along each edge from its start to its end, both included, `[panel][edge]`.
    pub edge_vertices: Vec<Vec<Vec<u32>>>,
    /// The cloth vertex of each pattern vertex, `[pattern vertex]`.
    pub sewing: Vec<u32>,
    /// Number of cloth vertices.
    pub cloth_vertex_count: usize,
}

impl PatternMesh {
    /// Pattern vertices along an edge, start to end.
    pub fn along(&self, id: EdgeId) -> &[u32] {
        &self.edge_vertices[id.panel][id.edge]
    }

    /// Triangles in cloth vertices, with the pattern's winding.
    pub fn cloth_triangles(&self) -> Vec<[u32; 3]> {
        let sewn = |v: u32| self.sewing[v as usize];
        self.triangles.iter().map(|t| t.map(sewn)).collect()
    }

    /// Triangles in cloth vertices, wound so that the right side of the cloth is in front.
    pub fn outward_triangles(&self) -> Vec<[u32; 3]> {
        let mut triangles = self.cloth_triangles();
        for (range, up) in self.panel_triangles.iter().zip(&self.right_side_up) {
            if !up {
                for triangle in &mut triangles[range.clone()] {
                    triangle.swap(1, 2);
                }
            }
        }
        triangles
    }

    /// Rest area of triangle `t` under rest positions `x_bar` \[m²\]; negative when flipped.
    pub fn rest_area(&self, t: usize, x_bar: &[Vec2]) -> f64 {
        let [a, b, c] = self.triangles[t].map(|v| x_bar[v as usize]);
        0.5 * crate::geometry::cross2(b - a, c - a)
    }

    /// Mean of the `values` that sewn pattern vertices bring to each cloth vertex.
    pub fn sew(&self, values: &[crate::geometry::Vec3]) -> Vec<crate::geometry::Vec3> {
        let mut sums = vec![(crate::geometry::Vec3::zeros(), 0.0); self.cloth_vertex_count];
        for (value, &a) in values.iter().zip(&self.sewing) {
            sums[a as usize].0 += value;
            sums[a as usize].1 += 1.0;
        }
        sums.into_iter().map(|(sum, count)| sum / count).collect()
    }
}
