//! From a [`Pattern`] to a document: the one it was read from with new vertices and curvatures, or a
//! fresh one in centimetres.

use super::Specification;
use crate::geometry::{Mat3, Vec2, Vec3};
use crate::pattern::{Curve, Edge, EdgeId, Panel, Pattern, Placement, Stitch, curve};
use serde_json::{Map, Value, json};

/// File units in a metre of a fresh document: centimetres, as GarmentCode writes.
const CENTIMETRES: f64 = 100.0;

/// `pattern` as a GarmentCode specification.
///
/// With the `original` it was read from, everything there is kept but vertices and curvatures; they
/// are written in its unit and its coordinates.
///
/// # Panics
///
/// Panics when `pattern` has other panels or edges than `original`.
pub fn write(pattern: &Pattern, original: Option<&Specification>) -> Value {
    let mut document = match original {
        Some(original) => original.document.clone(),
        None => skeleton(pattern),
    };
    let format = Format {
        units_in_meter: original.map_or(CENTIMETRES, |o| o.units_in_meter),
        absolute: document["properties"]["curvature_coords"] == "absolute",
    };
    let panels = &mut document["pattern"]["panels"];
    for panel in &pattern.panels {
        let written = panels
            .get_mut(&panel.name)
            .expect("the original has the pattern's panels");
        written["vertices"] = panel.vertices.iter().map(|v| format.point(*v)).collect();
        let edges = written["edges"]
            .as_array_mut()
            .filter(|edges| edges.len() == panel.edges.len())
            .expect("the original has the panel's edges");
        for (e, written) in edges.iter_mut().enumerate() {
            format.write_curvature(panel, e, written);
        }
    }
    document
}

/// A document with everything but vertices and curvatures.
fn skeleton(pattern: &Pattern) -> Value {
    let panels: Map<_, _> = pattern
        .panels
        .iter()
        .map(|panel| (panel.name.clone(), panel_skeleton(panel)))
        .collect();
    let names: Vec<_> = pattern.panels.iter().map(|p| p.name.as_str()).collect();
    let stitch = |stitch: &Stitch| {
        let side = |id: EdgeId| json!({"panel": names[id.panel], "edge": id.edge});
        let [one, other] = stitch.sides.map(side);
        if stitch.right_wrong {
            json!([one, other, "right_wrong"])
        } else {
            json!([one, other])
        }
    };
    let stitches: Vec<_> = pattern.stitches.iter().map(stitch).collect();
    json!({
        "pattern": { "panels": panels, "stitches": stitches, "panel_order": names },
        "parameters": {},
        "parameter_order": [],
        "properties": {
            "curvature_coords": "relative",
            "normalize_panel_translation": false,
            "normalized_edge_loops": true,
            "units_in_meter": CENTIMETRES as u32,
        },
    })
}

fn panel_skeleton(panel: &Panel) -> Value {
    let Placement {
        rotation,
        translation,
    } = panel.placement;
    let edges: Vec<_> = panel.edges.iter().map(edge_skeleton).collect();
    let mut written = json!({
        "translation": (translation * CENTIMETRES).as_slice(),
        "rotation": extrinsic_angles(rotation).as_slice(),
        "vertices": [],
        "edges": edges,
    });
    if let Some(label) = &panel.label {
        written["label"] = json!(label);
    }
    written
}

fn edge_skeleton(edge: &Edge) -> Value {
    let mut written = json!({ "endpoints": [edge.start, edge.end] });
    if let Some(label) = &edge.label {
        written["label"] = json!(label);
    }
    written
}

/// Angles x, y, z in degrees with `rotation` = R_z R_y R_x, whether or not y is a right angle.
fn extrinsic_angles(rotation: Mat3) -> Vec3 {
    let r = rotation;
    let z = r.m21.atan2(r.m11);
    let y = (-r.m31).atan2(r.m11.hypot(r.m21));
    // What is left after R_z has been undone is R_y R_x, whose second row is (0, cos x, −sin x).
    let (sin_z, cos_z) = z.sin_cos();
    let cos_x = cos_z * r.m22 - sin_z * r.m12;
    let minus_sin_x = cos_z * r.m23 - sin_z * r.m13;
    let x = (-minus_sin_x).atan2(cos_x);
    Vec3::new(x.to_degrees(), y.to_degrees(), z.to_degrees())
}

/// Unit and coordinates of a document.
struct Format {
    units_in_meter: f64,
    absolute: bool,
}

impl Format {
    fn point(&self, p: Vec2) -> Value {
        json!([p.x * self.units_in_meter, p.y * self.units_in_meter])
    }

    /// Replaces the curvature of edge `e`, in the spelling it has where that can say it.
    fn write_curvature(&self, panel: &Panel, e: usize, written: &mut Value) {
        let (a, b) = panel.ends(e);
        let control = |c: Vec2| {
            if self.absolute {
                self.point(c)
            } else {
                json!(curve::relative_to_edge(c, a, b).as_slice())
            }
        };
        let bare = written["curvature"].is_array();
        let curvature = match panel.edges[e].curve {
            _ if a == b => Value::Null,
            Curve::Line => Value::Null,
            Curve::Quadratic(c) if bare => control(c),
            Curve::Quadratic(c) => json!({ "type": "quadratic", "params": [control(c)] }),
            Curve::Cubic(c) => json!({ "type": "cubic", "params": c.map(control) }),
            Curve::Arc {
                radius,
                large,
                counter_clockwise,
            } => json!({ "type": "circle", "params": [
                radius * self.units_in_meter,
                u8::from(large),
                u8::from(counter_clockwise),
            ]}),
        };
        let edge = written.as_object_mut().expect("an edge is an object");
        if curvature.is_null() {
            edge.shift_remove("curvature");
        } else {
            edge.insert("curvature".to_owned(), curvature);
        }
    }
}
