//! Writing a garment as OBJ: the sewn drape, its pattern as texture coordinates of the same unit,
//! one group per panel, faces with the right side of the cloth in front.

use super::tags::{CurveTag, EdgeTag, MARK, PanelTag, StitchTag};
use crate::body::FileFrame;
use crate::garment::Garment;
use crate::geometry::{Vec2, Vec3, bounds};
use crate::io::obj::ObjText;
use crate::pattern::{Curve, EdgeId};
use std::ops::Range;

/// Room between panels in the layout \[m\].
const GAP: f64 = 0.05;

/// An edge whose mesh is further from its curve is written as a straight one, to be fitted again
/// when read \[m\].
const ON_THE_CURVE: f64 = 1e-4;

/// The garment with rest positions `x_bar` and the drape `x` \[m\] as OBJ text in `frame`.
///
/// Panels lie side by side, moved but not turned. Comments keep what OBJ cannot say, so that
/// [`super::read`] gives the same pattern back.
pub fn write(garment: &Garment, x_bar: &[Vec2], x: &[Vec3], frame: FileFrame) -> String {
    let mut obj = ObjText::new(&format!("garment {}", garment.name), frame);
    let offsets = layout(&garment.mesh.panel_vertices, x_bar);
    write_tags(&mut obj, garment, x_bar, &offsets, frame);
    for p in x {
        obj.position(*p);
    }
    let mesh = &garment.mesh;
    for (range, offset) in mesh.panel_vertices.iter().zip(&offsets) {
        for p in &x_bar[range.clone()] {
            obj.uv(p + offset);
        }
    }
    for (k, panel) in garment.pattern.panels.iter().enumerate() {
        obj.group(&panel.name);
        for triangle in &mesh.triangles[mesh.panel_triangles[k].clone()] {
            let mut uvs = *triangle;
            if !mesh.right_side_up[k] {
                uvs.swap(1, 2);
            }
            obj.triangle_with_uvs(uvs.map(|v| mesh.sewing[v as usize]), uvs);
        }
    }
    obj.finish()
}

/// How far each panel is moved, for all to stand side by side on the u axis.
fn layout(panels: &[Range<usize>], x_bar: &[Vec2]) -> Vec<Vec2> {
    let mut at = 0.0;
    let offset = |range: &Range<usize>| {
        let (low, high) = bounds(&x_bar[range.clone()]);
        let offset = Vec2::new(at - low.x, -low.y);
        at += high.x - low.x + GAP;
        offset
    };
    panels.iter().map(offset).collect()
}

fn write_tags(
    obj: &mut ObjText,
    garment: &Garment,
    x_bar: &[Vec2],
    offsets: &[Vec2],
    frame: FileFrame,
) {
    let json = |value: &dyn Fn() -> serde_json::Result<String>| {
        value().expect("numbers and strings are always JSON")
    };
    let unit = json(&|| serde_json::to_string(&frame));
    obj.comment(&format!("{MARK}uv in {} {unit}", frame.unit_name()));
    for (k, offset) in offsets.iter().enumerate() {
        let tag = panel_tag(garment, x_bar, k, *offset);
        let tag = json(&|| serde_json::to_string(&tag));
        obj.comment(&format!("{MARK}panel {tag}"));
    }
    let id = |id: EdgeId| [id.panel, id.edge];
    let stitches = garment.pattern.stitches.iter();
    let stitches: Vec<StitchTag> = stitches
        .map(|s| (id(s.sides[0]), id(s.sides[1]), s.right_wrong))
        .collect();
    let stitches = json(&|| serde_json::to_string(&stitches));
    obj.comment(&format!("{MARK}stitches {stitches}"));
}

fn panel_tag(garment: &Garment, x_bar: &[Vec2], k: usize, offset: Vec2) -> PanelTag {
    let panel = &garment.pattern.panels[k];
    let chains = &garment.mesh.edge_vertices[k];
    let mut corners = vec![0; panel.vertices.len()];
    let mut edges = Vec::new();
    for (edge, chain) in panel.edges.iter().zip(chains) {
        if let (Some(first), Some(last)) = (chain.first(), chain.last()) {
            corners[edge.start] = first + 1;
            corners[edge.end] = last + 1;
        }
        let points: Vec<Vec2> = chain.iter().map(|v| x_bar[*v as usize]).collect();
        edges.push(EdgeTag {
            ends: [edge.start, edge.end],
            curve: if follows(&points, edge.curve) {
                edge.curve.into()
            } else {
                CurveTag::Line
            },
            label: edge.label.clone(),
        });
    }
    PanelTag {
        name: panel.name.clone(),
        label: panel.label.clone(),
        offset,
        rotation: panel.placement.rotation,
        translation: panel.placement.translation,
        corners,
        edges,
    }
}

/// Whether all points lie on the curve between the first and the last of them.
fn follows(points: &[Vec2], curve: Curve) -> bool {
    let (Some(&a), Some(&b)) = (points.first(), points.last()) else {
        return false;
    };
    let fine = curve.sample(a, b, 8 * points.len());
    let distance = |p: &Vec2, piece: &[Vec2]| {
        let along = piece[1] - piece[0];
        let t = (p - piece[0]).dot(&along) / along.norm_squared().max(f64::MIN_POSITIVE);
        (piece[0] + along * t.clamp(0.0, 1.0) - p).norm()
    };
    points.iter().all(|p| {
        fine.windows(2)
            .any(|piece| distance(p, piece) < ON_THE_CURVE)
    })
}
