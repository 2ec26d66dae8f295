//! The 2-D design: panels with curved outlines, and the stitches that join their edges.
//!
//! A [`Pattern`] is what the pattern maker drew; [`mesh::PatternMesh`] is the same, meshed and sewn.
//! Lengths are metres in each panel's own plane; y is up along the panel as placed.

mod canonical;
pub mod curve;
mod interior;
pub mod mesh;
pub(crate) mod names;
pub mod outline;
pub mod resample;
mod sew;
#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod shared_garments;
pub mod symmetry;
pub mod triangulate;
pub mod validate;

use crate::geometry::{Mat3, Vec2, Vec3, bounds};
pub use curve::Curve;
pub use mesh::PatternMesh;

/// A garment's panels and the stitches between them.
#[derive(Clone, Debug, PartialEq)]
pub struct Pattern {
    /// Panels, in the file's order.
    pub panels: Vec<Panel>,
    /// Stitches, in the file's order; one seam of the garment is often a chain of several.
    pub stitches: Vec<Stitch>,
}

/// One piece of cloth: a simple closed loop of edges.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// Unique name.
    pub name: String,
    /// Corners \[m\], in the panel's plane.
    pub vertices: Vec<Vec2>,
    /// Edges in loop order: edge i ends where edge i + 1 starts. The loop may be clockwise, which
    /// puts the right side of the cloth on the far side (−z of the panel's plane).
    pub edges: Vec<Edge>,
    /// Where the flat panel waits before draping.
    pub placement: Placement,
    /// The file's body part ("body", "leg", "arm"), if any.
    pub label: Option<String>,
}

/// One side of a panel, from `vertices[start]` to `vertices[end]`.
#[derive(Clone, Debug, PartialEq)]
pub struct Edge {
    /// Index of the first corner.
    pub start: usize,
    /// Index of the last corner.
    pub end: usize,
    /// What runs between them.
    pub curve: Curve,
    /// The file's label ("lower_interface", "left_armhole"), if any.
    pub label: Option<String>,
}

/// Rigid placement of a panel's plane in space: `world = rotation · (x, y, 0) + translation`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Rotation matrix.
    pub rotation: Mat3,
    /// \[m\].
    pub translation: Vec3,
}

/// One edge of one panel.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct EdgeId {
    /// Index into [`Pattern::panels`].
    pub panel: usize,
    /// Index into [`Panel::edges`].
    pub edge: usize,
}

/// Two edges sewn together, whole to whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Stitch {
    /// The edges.
    pub sides: [EdgeId; 2],
    /// `false`: start meets end, the ordinary seam of two panels with the same outside.
    /// `true`: start meets start; the panels' right sides then face opposite ways.
    pub right_wrong: bool,
}

impl Placement {
    /// Where the point `p` of the panel's plane lies in space \[m\].
    pub fn place(&self, p: Vec2) -> Vec3 {
        self.rotation * Vec3::new(p.x, p.y, 0.0) + self.translation
    }

    /// The point of the panel's plane below `p` \[m\].
    pub fn flatten(&self, p: Vec3) -> Vec2 {
        (self.rotation.transpose() * (p - self.translation)).xy()
    }
}

impl Panel {
    /// End points of edge `e` \[m\].
    pub fn ends(&self, e: usize) -> (Vec2, Vec2) {
        let edge = &self.edges[e];
        (self.vertices[edge.start], self.vertices[edge.end])
    }

    /// Length of edge `e` along its curve \[m\].
    pub fn edge_length(&self, e: usize) -> f64 {
        let (a, b) = self.ends(e);
        self.edges[e].curve.length(a, b)
    }

    /// The outline as a polygon, each edge cut into pieces no longer than `spacing` \[m\], in loop
    /// order, without repeated corners.
    pub fn outline(&self, spacing: f64) -> Vec<Vec2> {
        let mut polygon = Vec::new();
        for (e, edge) in self.edges.iter().enumerate() {
            let (a, b) = self.ends(e);
            let pieces = (self.edge_length(e) / spacing).ceil().max(1.0) as usize;
            let mut points = edge.curve.sample(a, b, pieces);
            points.pop();
            polygon.extend(points);
        }
        polygon
    }

    /// Signed area of the outline \[m²\]: negative when the loop is clockwise.
    pub fn signed_area(&self) -> f64 {
        crate::geometry::signed_area(&self.outline(1e-3_f64.max(self.extent() / 500.0)))
    }

    /// Diagonal of the box around the corners \[m\].
    pub fn extent(&self) -> f64 {
        let (low, high) = bounds(&self.vertices);
        (high - low).norm()
    }
}

impl Pattern {
    /// Index of the panel called `name`.
    pub fn panel_named(&self, name: &str) -> Option<usize> {
        self.panels.iter().position(|panel| panel.name == name)
    }

    /// The edge behind `id`.
    pub fn edge(&self, id: EdgeId) -> &Edge {
        &self.panels[id.panel].edges[id.edge]
    }

    /// Length of an edge along its curve \[m\].
    pub fn edge_length(&self, id: EdgeId) -> f64 {
        self.panels[id.panel].edge_length(id.edge)
    }
}
