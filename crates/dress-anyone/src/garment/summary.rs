//! A garment in a few numbers, for a person who asks what is in a file.

use super::Garment;
use serde::Serialize;
use std::collections::BTreeSet;

/// A garment in a few numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Panels.
    pub panels: usize,
    /// Stitches.
    pub stitches: usize,
    /// Corners of the flat mesh, copies at seams counted.
    pub pattern_vertices: usize,
    /// Corners of the sewn mesh.
    pub cloth_vertices: usize,
    /// Triangles.
    pub triangles: usize,
    /// Cloth in all panels together \[m²\].
    pub area: f64,
    /// Length of all edges that no stitch names: hems, neck, openings \[m\].
    pub free_edges: f64,
}

impl Garment {
    /// This garment in a few numbers.
    pub fn summary(&self) -> Summary {
        let (pattern, mesh) = (&self.pattern, &self.mesh);
        let sewn: BTreeSet<_> = pattern.stitches.iter().flat_map(|s| s.sides).collect();
        let edges = pattern.panels.iter().enumerate().flat_map(|(panel, p)| {
            (0..p.edges.len()).map(move |edge| crate::pattern::EdgeId { panel, edge })
        });
        Summary {
            panels: pattern.panels.len(),
            stitches: pattern.stitches.len(),
            pattern_vertices: mesh.x_bar.len(),
            cloth_vertices: mesh.cloth_vertex_count,
            triangles: mesh.triangles.len(),
            area: (0..mesh.triangles.len())
                .map(|t| mesh.rest_area(t, &mesh.x_bar))
                .sum(),
            free_edges: edges
                .filter(|id| !sewn.contains(id))
                .map(|id| pattern.edge_length(id))
                .sum(),
        }
    }
}
