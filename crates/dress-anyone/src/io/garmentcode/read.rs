//! From the document to a [`Pattern`]. Everything wrong is gathered before giving up: a part that
//! cannot be read is replaced by a stand-in, so that the parts that lean on it can still be judged.

mod edge;
mod value;

use self::value::{index, label, numbers, show};
use super::{ReadOptions, RotationOrder, Specification};
use crate::geometry::{Mat3, Vec2, Vec3};
use crate::io::{json, kind};
use crate::pattern::{EdgeId, Panel, Pattern, Placement, Stitch, validate};
use crate::problem::{BadInput, Problem};
use nalgebra::Rotation3;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::Path;

/// Nothing of a garment is farther than this from its origin \[m\].
const FARTHEST: f64 = 100.0;

/// An arc of a larger radius \[m\] is a straight edge with a mistake in it.
const LARGEST_RADIUS: f64 = 1e6;

/// Problems listed; more would hide the first ones.
const LISTED: usize = 100;

pub(super) fn parse(
    file: &Path,
    bytes: &[u8],
    options: ReadOptions,
) -> Result<Specification, BadInput> {
    let document = match json::parse(file, bytes) {
        Ok(document) => document,
        Err(error) => return Err(other_kind(file, bytes).unwrap_or(error)),
    };
    let mut reader = Reader::new(options);
    let pattern = reader.document(&document);
    if reader.problems.is_empty() {
        Ok(Specification {
            pattern,
            document,
            units_in_meter: reader.units_in_meter,
            notes: reader.notes,
        })
    } else {
        Err(BadInput::new(file, shortened(reader.problems)))
    }
}

/// A message naming what kind of file this is, when it is recognisably not JSON.
fn other_kind(file: &Path, bytes: &[u8]) -> Option<BadInput> {
    let text = format!(
        "this looks like {}; a garment is a GarmentCode pattern (*_specification.json). \
         Were garment and body swapped?",
        kind::of(bytes).filter(|kind| *kind != kind::JSON)?
    );
    Some(BadInput::one(file, Problem::whole(text)))
}

fn shortened(mut problems: Vec<Problem>) -> Vec<Problem> {
    if problems.len() > LISTED {
        let more = problems.len() - LISTED;
        problems.truncate(LISTED);
        problems.push(Problem::whole(format!("and {more} problems more")));
    }
    problems
}

/// What is known of the file so far.
struct Reader {
    options: ReadOptions,
    units_in_meter: f64,
    /// Whether control points are in the panel's plane rather than relative to their edge.
    absolute: bool,
    problems: Vec<Problem>,
    notes: Vec<String>,
}

impl Reader {
    fn new(options: ReadOptions) -> Self {
        Self {
            options,
            units_in_meter: 100.0,
            absolute: false,
            problems: Vec::new(),
            notes: Vec::new(),
        }
    }

    fn report(&mut self, place: &str, text: impl Into<String>) {
        self.problems.push(Problem::at(place, text));
    }

    fn document(&mut self, document: &Value) -> Pattern {
        let mut pattern = Pattern {
            panels: Vec::new(),
            stitches: Vec::new(),
        };
        let Some(content) = document.get("pattern").and_then(Value::as_object) else {
            self.report(
                "",
                "this JSON file is no GarmentCode specification: it has no `pattern` with `panels` \
                 and `stitches` in it",
            );
            return pattern;
        };
        self.properties(document.get("properties"));
        match content.get("panels").and_then(Value::as_object) {
            Some(panels) if !panels.is_empty() => {
                for (name, value) in panels {
                    pattern.panels.push(self.panel(name, value));
                }
            }
            _ => self.report("`pattern`", "has no panels, so there is nothing to sew"),
        }
        self.stitches(content.get("stitches"), &mut pattern);
        pattern
    }

    fn properties(&mut self, properties: Option<&Value>) {
        let get = |key: &str| properties.and_then(|p| p.get(key)).filter(|v| !v.is_null());
        let place = "`properties`";
        match get("units_in_meter").map(Value::as_f64) {
            None => self
                .notes
                .push("`units_in_meter` is not given; taken for 100 (centimetres)".to_owned()),
            Some(Some(units)) if (0.01..=1e6).contains(&units) => self.units_in_meter = units,
            Some(_) => self.report(
                place,
                "`units_in_meter` must be the number of file units in one metre: 100 for centimetres",
            ),
        }
        match get("curvature_coords").map(Value::as_str) {
            None => self
                .notes
                .push("`curvature_coords` is not given; taken for \"relative\"".to_owned()),
            Some(Some("relative")) => {}
            Some(Some("absolute")) => self.absolute = true,
            Some(_) => self.report(
                place,
                "`curvature_coords` must be \"relative\" or \"absolute\"",
            ),
        }
    }

    fn panel(&mut self, name: &str, value: &Value) -> Panel {
        let place = format!("panel `{name}`");
        let known_problems = self.problems.len();
        let vertices = self.vertices(&place, value.get("vertices"));
        let panel = Panel {
            name: name.to_owned(),
            edges: self.edges(&place, value.get("edges"), &vertices),
            vertices,
            placement: self.placement(&place, value),
            label: label(value),
        };
        if self.problems.len() == known_problems {
            self.problems.extend(validate::panel_problems(&panel));
            self.note_unused_corners(&panel);
        }
        panel
    }

    fn note_unused_corners(&mut self, panel: &Panel) {
        let unused = panel.vertices.len().saturating_sub(panel.edges.len());
        if unused > 0 {
            self.notes.push(format!(
                "panel `{}`: {unused} vertices belong to no edge",
                panel.name
            ));
        }
    }

    fn vertices(&mut self, place: &str, value: Option<&Value>) -> Vec<Vec2> {
        let Some(list) = value.and_then(Value::as_array) else {
            self.report(place, "has no list of `vertices`");
            return Vec::new();
        };
        let mut vertices = Vec::with_capacity(list.len());
        for (v, value) in list.iter().enumerate() {
            let found = numbers::<2>(value).map(|xy| Vec2::from(xy) / self.units_in_meter);
            match found {
                Some(p) if p.amax() <= FARTHEST => {}
                Some(p) => self.too_far(place, &format!("vertex {v}"), p.amax()),
                None => self.report(
                    place,
                    format!(
                        "vertex {v} must be two numbers, [x, y]; found {}",
                        show(value)
                    ),
                ),
            }
            vertices.push(found.unwrap_or_else(Vec2::zeros));
        }
        vertices
    }

    fn too_far(&mut self, place: &str, what: &str, metres: f64) {
        self.report(
            place,
            format!("{what} is {metres:.0} m away; check it and `units_in_meter`"),
        );
    }

    fn placement(&mut self, place: &str, panel: &Value) -> Placement {
        let mut triple = |key: &str| {
            let value = panel.get(key).filter(|v| !v.is_null());
            let Some(value) = value else {
                self.notes
                    .push(format!("{place}: `{key}` is not given; taken for zero"));
                return Vec3::zeros();
            };
            let found = numbers::<3>(value).map(Vec3::from);
            if found.is_none() {
                let text = format!("`{key}` must be three numbers; found {}", show(value));
                self.report(place, text);
            }
            found.unwrap_or_else(Vec3::zeros)
        };
        let degrees = triple("rotation");
        let translation = triple("translation") / self.units_in_meter;
        if translation.amax() > FARTHEST {
            self.too_far(place, "the panel's `translation`", translation.amax());
        }
        Placement {
            rotation: rotation(degrees, self.options.rotation),
            translation,
        }
    }

    fn stitches(&mut self, value: Option<&Value>, pattern: &mut Pattern) {
        let panel_of: BTreeMap<String, usize> = pattern
            .panels
            .iter()
            .enumerate()
            .map(|(i, panel)| (panel.name.clone(), i))
            .collect();
        let list = match value {
            None | Some(Value::Null) => &[],
            Some(Value::Array(list)) => list.as_slice(),
            Some(_) => return self.report("`stitches`", "must be a list"),
        };
        if list.is_empty() {
            self.notes
                .push("there are no stitches: nothing is sewn to anything".to_owned());
        }
        for (s, value) in list.iter().enumerate() {
            if let Some(stitch) = self.stitch(&format!("stitch {s}"), value, &panel_of) {
                self.note_labels(s, stitch, pattern);
                pattern.stitches.push(stitch);
            }
        }
        if pattern.stitches.len() == list.len() {
            self.problems.extend(validate::stitch_problems(pattern));
        }
    }

    fn stitch(
        &mut self,
        place: &str,
        value: &Value,
        panel_of: &BTreeMap<String, usize>,
    ) -> Option<Stitch> {
        let (sides, right_wrong) = match value.as_array().map(Vec::as_slice) {
            Some([one, other]) => ([one, other], false),
            Some([one, other, tag]) if tag == "right_wrong" => ([one, other], true),
            _ => {
                self.report(
                    place,
                    format!(
                        "must be two sides, and \"right_wrong\" where the right side of one meets \
                         the wrong side of the other; found {}",
                        show(value)
                    ),
                );
                return None;
            }
        };
        let [one, other] = sides.map(|side| self.side(place, side, panel_of));
        Some(Stitch {
            sides: [one?, other?],
            right_wrong,
        })
    }

    fn side(
        &mut self,
        place: &str,
        side: &Value,
        panel_of: &BTreeMap<String, usize>,
    ) -> Option<EdgeId> {
        let name = side.get("panel").and_then(Value::as_str);
        let edge = side.get("edge").and_then(index);
        let (Some(name), Some(edge)) = (name, edge) else {
            let text = format!("each side needs `panel` and `edge`; found {}", show(side));
            self.report(place, text);
            return None;
        };
        let panel = panel_of.get(name).copied();
        if panel.is_none() {
            let text = format!("names panel `{name}`, which does not exist");
            self.report(place, text);
        }
        Some(EdgeId {
            panel: panel?,
            edge,
        })
    }

    fn note_labels(&mut self, s: usize, stitch: Stitch, pattern: &Pattern) {
        let label = |id: EdgeId| {
            let edge = pattern.panels[id.panel].edges.get(id.edge)?;
            edge.label.as_deref()
        };
        let [one, other] = stitch.sides.map(label);
        if let (Some(one), Some(other)) = (one, other)
            && one != other
        {
            self.notes.push(format!(
                "stitch {s} joins edges labelled `{one}` and `{other}`"
            ));
        }
    }
}

/// Rotation by angles in degrees about x, y and z.
fn rotation(degrees: Vec3, order: RotationOrder) -> Mat3 {
    let [x, y, z] = [Vec3::x_axis(), Vec3::y_axis(), Vec3::z_axis()];
    let [x, y, z] = [(x, degrees.x), (y, degrees.y), (z, degrees.z)]
        .map(|(axis, angle)| *Rotation3::from_axis_angle(&axis, angle.to_radians()).matrix());
    match order {
        RotationOrder::Extrinsic => z * y * x,
        RotationOrder::Intrinsic => x * y * z,
    }
}
