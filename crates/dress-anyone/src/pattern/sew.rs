//! Joins the meshed panels along their stitches.
//!
//! Stitched edges carry equally many vertices and are welded one to one, start to end (or start to
//! start for `right_wrong`). Union–find makes it transitive, so chains of stitches, darts and
//! corners where three or more panels meet need no special care.

use super::{EdgeId, Pattern, PatternMesh};
use crate::geometry::Vec2;
use crate::geometry::groups::Groups;
use crate::problem::Problem;
use std::collections::{BTreeMap, BTreeSet};

/// Cloth vertex of each pattern vertex and their number, numbered in the order of their first
/// pattern vertex.
pub(super) fn sew(
    pattern: &Pattern,
    edge_vertices: &[Vec<Vec<u32>>],
    vertex_count: usize,
) -> (Vec<u32>, usize) {
    let mut groups = Groups::new(vertex_count);
    for pair in pattern
        .stitches
        .iter()
        .flat_map(|stitch| welds(stitch, edge_vertices))
    {
        groups.join(pair);
    }
    let mut number = BTreeMap::new();
    let sewing = (0..vertex_count as u32)
        .map(|v| {
            let next = number.len() as u32;
            *number.entry(groups.first_of(v)).or_insert(next)
        })
        .collect();
    (sewing, number.len())
}

/// The pairs of pattern vertices a stitch welds.
fn welds(stitch: &super::Stitch, edge_vertices: &[Vec<Vec<u32>>]) -> Vec<[u32; 2]> {
    let [a, b] = stitch
        .sides
        .map(|side| edge_vertices[side.panel][side.edge].clone());
    let pairs = a.into_iter();
    if stitch.right_wrong {
        pairs.zip(b).map(<[u32; 2]>::from).collect()
    } else {
        pairs
            .zip(b.into_iter().rev())
            .map(<[u32; 2]>::from)
            .collect()
    }
}

/// What the stitches weld that cannot be meant: points of one panel that no stitch of the panel
/// with itself joins, and triangles that lose a corner.
pub(super) fn sewing_problems(pattern: &Pattern, mesh: &PatternMesh) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut meant = Groups::new(mesh.x_bar.len());
    for stitch in &pattern.stitches {
        if stitch.sides[0].panel == stitch.sides[1].panel {
            for pair in welds(stitch, &mesh.edge_vertices) {
                meant.join(pair);
            }
        }
    }
    for (p, panel) in pattern.panels.iter().enumerate() {
        let mut seen: BTreeMap<u32, u32> = BTreeMap::new();
        let mut reported = BTreeSet::new();
        for (e, along) in mesh.edge_vertices[p].iter().enumerate() {
            let (first, last) = (along[0], along[along.len() - 1]);
            let closed = mesh.sewing[first as usize] == mesh.sewing[last as usize];
            if closed && meant.first_of(first) != meant.first_of(last) {
                problems.push(Problem::at(
                    place(pattern, EdgeId { panel: p, edge: e }),
                    format!(
                        "its two ends are sewn together{}; check which edges these stitches join and in which direction",
                        guilty(pattern, p, e)
                    ),
                ));
                reported.insert(mesh.sewing[first as usize]);
            }
            for &v in along {
                let cloth = mesh.sewing[v as usize];
                let other = *seen.entry(cloth).or_insert(v);
                if meant.first_of(v) != meant.first_of(other) && reported.insert(cloth) {
                    let [a, b] = [v, other].map(|v| centimetres(mesh.x_bar[v as usize]));
                    problems.push(Problem::at(
                        format!("panel `{}`", panel.name),
                        format!(
                            "its points {a} and {b} are sewn together, by way of other panels; check the stitches of edge {e}"
                        ),
                    ));
                }
            }
        }
    }
    if problems.is_empty() {
        problems = collapsed(pattern, mesh);
    }
    problems
}

/// Triangles of which two corners are sewn together, one report per panel.
fn collapsed(pattern: &Pattern, mesh: &PatternMesh) -> Vec<Problem> {
    let cloth = mesh.cloth_triangles();
    let mut problems = Vec::new();
    for (panel, range) in pattern.panels.iter().zip(&mesh.panel_triangles) {
        let is_collapsed = |&t: &usize| {
            let [a, b, c] = cloth[t];
            a == b || b == c || c == a
        };
        if let Some(t) = range.clone().find(is_collapsed) {
            let place = centimetres(mesh.x_bar[mesh.triangles[t][0] as usize]);
            problems.push(Problem::at(
                format!("panel `{}`", panel.name),
                format!(
                    "sewing closes a triangle at {place} onto itself; check the stitches there, or mesh more finely"
                ),
            ));
        }
    }
    problems
}

/// " (stitch 3, stitch 7)": the stitches at and next to an edge.
fn guilty(pattern: &Pattern, panel: usize, edge: usize) -> String {
    let count = pattern.panels[panel].edges.len();
    let near = [(edge + count - 1) % count, edge, (edge + 1) % count];
    let names: Vec<String> = pattern
        .stitches
        .iter()
        .enumerate()
        .filter(|(_, stitch)| {
            let touches = |side: &EdgeId| side.panel == panel && near.contains(&side.edge);
            stitch.sides.iter().any(touches)
        })
        .map(|(s, _)| format!("stitch {s}"))
        .collect();
    format!(" ({})", names.join(", "))
}

/// "panel `left_sleeve`, edge 3".
pub(super) fn place(pattern: &Pattern, id: EdgeId) -> String {
    format!(
        "panel `{}`, edge {}",
        pattern.panels[id.panel].name, id.edge
    )
}

/// "(12.3, 4.0) cm".
pub(super) fn centimetres(p: Vec2) -> String {
    format!("({:.1}, {:.1}) cm", 100.0 * p.x, 100.0 * p.y)
}
