//! Meshes a pattern: samples the edges, fills the panels, sews them.
//!
//! An edge gets ⌈length / resolution⌉ pieces of equal length, both sides of a stitch as many as the
//! longer one, so that seams weld one to one and a gathered side is simply sampled more finely. No
//! vertex is added on an edge when its panel is filled. Congruent panels, mirrored or not, get
//! congruent meshes.

use super::canonical::Canonical;
use super::interior::{Filling, fill};
use super::sew::{centimetres, place, sew, sewing_problems};
use super::{EdgeId, Panel, Pattern, PatternMesh};
use crate::geometry::groups::Groups;
use crate::geometry::polygon::Polygon;
use crate::geometry::quality::quality;
use crate::geometry::{Vec2, Vec3, signed_area};
use crate::problem::Problem;
use rayon::prelude::*;

/// Triangles worse than this cannot be simulated: their rest shape has no usable inverse.
const DEGENERATE: f64 = 1e-3;
/// A mesh beyond this many vertices is a mistyped resolution.
const MOST_VERTICES: f64 = 5e6;
/// An edge is cut into one more piece only when it is longer by more than this fraction of the
/// resolution, so that round-off does not part mirrored panels.
const ROUND_OFF: f64 = 1e-6;

/// Meshes and sews `pattern` with edges of about `resolution` \[m\], or says all that prevents it.
pub fn mesh(pattern: &Pattern, resolution: f64) -> Result<PatternMesh, Vec<Problem>> {
    let problems = drawing_problems(pattern, resolution);
    if !problems.is_empty() {
        return Err(problems);
    }
    let pieces = pieces(pattern, resolution);
    let meshed: Vec<Result<PanelMesh, Problem>> = pattern
        .panels
        .par_iter()
        .zip(&pieces)
        .map(|(panel, pieces)| mesh_panel(panel, pieces, resolution))
        .collect();
    let (panels, problems) = meshed.into_iter().fold(
        (Vec::new(), Vec::new()),
        |(mut panels, mut problems), meshed| {
            match meshed {
                Ok(panel) => panels.push(panel),
                Err(problem) => problems.push(problem),
            }
            (panels, problems)
        },
    );
    if !problems.is_empty() {
        return Err(problems);
    }
    let mesh = assemble(pattern, panels);
    let problems = sewing_problems(pattern, &mesh);
    if problems.is_empty() {
        Ok(mesh)
    } else {
        Err(problems)
    }
}

/// What no mesh could mend: open loops, missing corners, numbers out of bounds.
fn drawing_problems(pattern: &Pattern, resolution: f64) -> Vec<Problem> {
    if !(resolution.is_finite() && resolution > 0.0) {
        let text = format!("the mesh's edge length must be positive, not {resolution} m");
        return vec![Problem::whole(text)];
    }
    let mut problems = Vec::new();
    for (p, panel) in pattern.panels.iter().enumerate() {
        for (e, edge) in panel.edges.iter().enumerate() {
            let mut report = |text: &str| {
                let place = place(pattern, EdgeId { panel: p, edge: e });
                problems.push(Problem::at(place, text));
            };
            let next = &panel.edges[(e + 1) % panel.edges.len()];
            if edge.start.max(edge.end) >= panel.vertices.len() {
                report("ends at a corner that the panel does not have");
            } else if edge.end != next.start {
                report(
                    "the next edge does not start where this one ends; an outline is one closed loop",
                );
            } else if !panel.edge_length(e).is_finite() {
                report("its length is not a finite number");
            } else if panel.edge_length(e) == 0.0 {
                report("has no length; remove it");
            }
        }
    }
    for (s, stitch) in pattern.stitches.iter().enumerate() {
        let known = |side: &EdgeId| {
            let panel = pattern.panels.get(side.panel);
            panel.is_some_and(|panel| side.edge < panel.edges.len())
        };
        if !stitch.sides.iter().all(known) {
            let text = "joins an edge that the pattern does not have";
            problems.push(Problem::at(format!("stitch {s}"), text));
        } else if stitch.sides[0] == stitch.sides[1] {
            let text = "joins an edge with itself; sew two different edges";
            problems.push(Problem::at(format!("stitch {s}"), text));
        }
    }
    if problems.is_empty() {
        let area: f64 = pattern.panels.iter().map(|p| p.signed_area().abs()).sum();
        let vertices = area / (0.75_f64.sqrt() * resolution * resolution);
        if vertices > MOST_VERTICES {
            problems.push(Problem::whole(format!(
                "an edge length of {} mm would make about {vertices:.0} vertices; ask for a coarser mesh",
                1e3 * resolution
            )));
        }
    }
    problems
}

/// Number of pieces of every edge, `[panel][edge]`.
fn pieces(pattern: &Pattern, resolution: f64) -> Vec<Vec<usize>> {
    let starts: Vec<usize> = pattern
        .panels
        .iter()
        .scan(0, |sum, panel| {
            *sum += panel.edges.len();
            Some(*sum - panel.edges.len())
        })
        .collect();
    let number = |id: EdgeId| (starts[id.panel] + id.edge) as u32;
    let edge_count = pattern.panels.iter().map(|panel| panel.edges.len()).sum();
    let mut sewn = Groups::new(edge_count);
    for stitch in &pattern.stitches {
        sewn.join(stitch.sides.map(number));
    }
    let ids =
        pattern.panels.iter().enumerate().flat_map(|(p, panel)| {
            (0..panel.edges.len()).map(move |e| EdgeId { panel: p, edge: e })
        });
    let mut most = vec![1; edge_count];
    for id in ids {
        let wanted = (pattern.edge_length(id) / resolution - ROUND_OFF).ceil();
        let group = sewn.first_of(number(id)) as usize;
        most[group] = most[group].max(wanted as usize);
    }
    let of_panel = |(p, panel): (usize, &Panel)| {
        let edges = 0..panel.edges.len();
        edges
            .map(|edge| most[sewn.first_of(number(EdgeId { panel: p, edge })) as usize])
            .collect()
    };
    pattern.panels.iter().enumerate().map(of_panel).collect()
}

/// One panel, meshed: its outline's vertices first, in loop order.
struct PanelMesh {
    points: Vec<Vec2>,
    triangles: Vec<[u32; 3]>,
    edge_vertices: Vec<Vec<u32>>,
    counter_clockwise: bool,
}

fn mesh_panel(panel: &Panel, pieces: &[usize], resolution: f64) -> Result<PanelMesh, Problem> {
    let mut outline = Vec::new();
    let mut edge_of = Vec::new();
    let mut edge_vertices: Vec<Vec<u32>> = Vec::new();
    for (e, edge) in panel.edges.iter().enumerate() {
        let (a, b) = panel.ends(e);
        let first = outline.len();
        outline.extend(&edge.curve.sample(a, b, pieces[e])[..pieces[e]]);
        edge_of.resize(outline.len(), e);
        edge_vertices.push((first as u32..=outline.len() as u32).collect());
    }
    if let Some(last) = edge_vertices.last_mut().and_then(|along| along.last_mut()) {
        *last = 0;
    }
    let here = |text: String| Problem::at(format!("panel `{}`", panel.name), text);
    if outline.len() < 3 {
        return Err(here(
            "its outline encloses nothing; draw at least three edges".into(),
        ));
    }
    if let Some((i, j)) = Polygon::new(outline.clone()).first_meeting() {
        return Err(here(format!(
            "its outline meets itself: edge {} and edge {} near {}; redraw it, or mesh more finely if the curves only pass close by",
            edge_of[i],
            edge_of[j],
            centimetres(outline[i])
        )));
    }
    let (points, triangles) = fill_canonically(panel, &outline, resolution)
        .ok_or_else(|| here("its outline cannot be filled with triangles; redraw it".into()))?;
    let corners = |t: &[u32; 3]| t.map(|v| points[v as usize]);
    if let Some(t) = triangles.iter().find(|t| quality(corners(t)) < DEGENERATE) {
        return Err(here(format!(
            "is too narrow to mesh near {}; widen it there, or remove the corner",
            centimetres(corners(t)[0])
        )));
    }
    Ok(PanelMesh {
        counter_clockwise: signed_area(&outline) > 0.0,
        points,
        triangles,
        edge_vertices,
    })
}

/// Fills the outline in its canonical frame; the outline itself comes back untouched and first.
fn fill_canonically(
    panel: &Panel,
    outline: &[Vec2],
    resolution: f64,
) -> Option<(Vec<Vec2>, Vec<[u32; 3]>)> {
    let placed: Vec<Vec3> = outline.iter().map(|p| panel.placement.place(*p)).collect();
    let canonical = Canonical::of(outline, &placed);
    let Filling {
        points,
        mut triangles,
    } = fill(&canonical.outline, resolution)?;
    let mut filled = outline.to_vec();
    filled.extend(points[outline.len()..].iter().map(|p| canonical.leave(*p)));
    for triangle in &mut triangles {
        for v in triangle.iter_mut() {
            *v = canonical.order.get(*v as usize).map_or(*v, |&i| i as u32);
        }
        if canonical.mirrored {
            triangle.swap(1, 2);
        }
    }
    Some((filled, triangles))
}

/// Puts the panels one after another and sews them.
fn assemble(pattern: &Pattern, panels: Vec<PanelMesh>) -> PatternMesh {
    let mut mesh = PatternMesh {
        x_bar: Vec::new(),
        triangles: Vec::new(),
        panel_vertices: Vec::new(),
        panel_triangles: Vec::new(),
        right_side_up: Vec::new(),
        edge_vertices: Vec::new(),
        sewing: Vec::new(),
        cloth_vertex_count: 0,
    };
    for panel in panels {
        let (first, first_triangle) = (mesh.x_bar.len(), mesh.triangles.len());
        let shift = |v: u32| v + first as u32;
        mesh.x_bar.extend(panel.points);
        let triangles = panel.triangles.iter().map(|t| t.map(shift));
        mesh.triangles.extend(triangles);
        mesh.panel_vertices.push(first..mesh.x_bar.len());
        mesh.panel_triangles
            .push(first_triangle..mesh.triangles.len());
        mesh.right_side_up.push(panel.counter_clockwise);
        let along = panel.edge_vertices.into_iter();
        mesh.edge_vertices.push(
            along
                .map(|vs| vs.into_iter().map(shift).collect())
                .collect(),
        );
    }
    (mesh.sewing, mesh.cloth_vertex_count) = sew(pattern, &mesh.edge_vertices, mesh.x_bar.len());
    mesh
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
pub(super) mod tests;
