//! From the document to a [`Pattern`]. Everything wrong is gathered before giving up: a part that
//! cannot be read is replaced by a stand-in, so that the parts that lean on it can still be judged.

use super::{ReadOptions, RotationOrder, Specification, from_relative};
use crate::geometry::{Mat3, Vec2, Vec3};
use crate::io::json;
use crate::pattern::{Curve, Edge, EdgeId, Panel, Pattern, Placement, Stitch, validate};
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
    options: &ReadOptions,
) -> Result<Specification, BadInput> {
    let document = match json::parse(file, bytes) {
        Ok(document) => document,
        Err(error) => return Err(other_kind(file, bytes).unwrap_or(error)),
    };
    let mut reader = Reader::new(*options);
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
    let text = bytes.trim_ascii_start();
    let lines = || text.split(|&b| b == b'\n').take(200);
    let obj_line = |line: &[u8]| {
        [&b"v "[..], b"vt ", b"f ", b"mtllib "]
            .iter()
            .any(|tag| line.starts_with(tag))
    };
    let signatures: [(&[u8], &str); 9] = [
        (b"ply", "a PLY mesh"),
        (b"solid", "an STL mesh"),
        (b"glTF", "a glTF scene"),
        (b"Kaydara", "an FBX scene"),
        (b"<", "an SVG or other XML file"),
        (b"%PDF", "a PDF document"),
        (b"\x89PNG", "a picture"),
        (b"\xff\xd8", "a picture"),
        (b"PK\x03\x04", "a zip archive; unpack it first"),
    ];
    let kind = signatures
        .iter()
        .find(|(signature, _)| text.starts_with(signature))
        .map(|(_, kind)| *kind)
        .or_else(|| lines().any(obj_line).then_some("an OBJ mesh"))?;
    let text = format!(
        "this looks like {kind}; a garment is a GarmentCode pattern (*_specification.json). \
         Were garment and body swapped?"
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
        let mut panel = Panel {
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
        panel.vertices.shrink_to_fit();
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

    fn edges(&mut self, place: &str, value: Option<&Value>, vertices: &[Vec2]) -> Vec<Edge> {
        let Some(list) = value.and_then(Value::as_array) else {
            self.report(place, "has no list of `edges`");
            return Vec::new();
        };
        let edge = |(e, value)| self.edge(&format!("{place}, edge {e}"), value, vertices);
        list.iter().enumerate().map(edge).collect()
    }

    fn edge(&mut self, place: &str, value: &Value, vertices: &[Vec2]) -> Edge {
        let ends = value.get("endpoints").and_then(indices);
        if ends.is_none() {
            self.report(
                place,
                "has no `endpoints`: two numbers of vertices, counted from 0",
            );
        }
        let [start, end] = ends.unwrap_or([0, 0]);
        let curvature = value.get("curvature").filter(|c| !c.is_null());
        let curve = match (curvature, vertices.get(start), vertices.get(end)) {
            (Some(curvature), Some(&a), Some(&b)) => self.curve(place, curvature, a, b),
            // An end that does not exist is reported with the loop.
            _ => Curve::Line,
        };
        Edge {
            start,
            end,
            curve,
            label: label(value),
        }
    }

    fn curve(&mut self, place: &str, curvature: &Value, a: Vec2, b: Vec2) -> Curve {
        let kind = curvature.get("type").and_then(Value::as_str);
        let params = curvature.get("params");
        let curve = match kind {
            // Files of 2021 give the control point alone.
            None if curvature.is_array() => self
                .control_point(curvature, a, b)
                .map(Curve::Quadratic)
                .ok_or("`curvature` must be one control point, [x, y]"),
            Some("quadratic") => self
                .control_points(params, a, b)
                .map(|[c]| Curve::Quadratic(c))
                .ok_or("a quadratic curve has one control point: `params` is [[x, y]]"),
            Some("cubic") => self
                .control_points(params, a, b)
                .map(Curve::Cubic)
                .ok_or("a cubic curve has two control points: `params` is [[x, y], [x, y]]"),
            Some("circle") => self.arc(params).ok_or(
                "an arc has a radius above zero and two flags, each 0 or 1: `params` is \
                 [radius, large, right]",
            ),
            _ => Err("the type of a curve is \"quadratic\", \"cubic\" or \"circle\""),
        };
        match curve {
            Ok(curve) => {
                self.check_reach(place, &curve);
                curve
            }
            Err(rule) => {
                self.report(place, format!("{rule}; found {}", show(curvature)));
                Curve::Line
            }
        }
    }

    fn check_reach(&mut self, place: &str, curve: &Curve) {
        let controls = match *curve {
            Curve::Line => vec![],
            Curve::Quadratic(c) => vec![c],
            Curve::Cubic(controls) => controls.to_vec(),
            Curve::Arc { radius, large, .. } => {
                let most = if large { FARTHEST } else { LARGEST_RADIUS };
                if radius > most {
                    self.report(
                        place,
                        format!("has a radius of {radius:.0} m; make it a straight edge"),
                    );
                }
                vec![]
            }
        };
        for c in controls {
            if c.amax() > FARTHEST {
                self.too_far(place, "a control point", c.amax());
            }
        }
    }

    fn control_points<const N: usize>(
        &self,
        params: Option<&Value>,
        a: Vec2,
        b: Vec2,
    ) -> Option<[Vec2; N]> {
        let list: &[Value; N] = params?.as_array()?.as_slice().try_into().ok()?;
        let mut points = [Vec2::zeros(); N];
        for (point, value) in points.iter_mut().zip(list) {
            *point = self.control_point(value, a, b)?;
        }
        Some(points)
    }

    fn control_point(&self, value: &Value, a: Vec2, b: Vec2) -> Option<Vec2> {
        let given = Vec2::from(numbers::<2>(value)?);
        Some(if self.absolute {
            given / self.units_in_meter
        } else {
            from_relative(given, a, b)
        })
    }

    fn arc(&self, params: Option<&Value>) -> Option<Curve> {
        let [radius, large, right] = params?.as_array()?.as_slice() else {
            return None;
        };
        let radius = radius.as_f64()? / self.units_in_meter;
        (radius > 0.0).then_some(())?;
        Some(Curve::Arc {
            radius,
            large: flag(large)?,
            counter_clockwise: flag(right)?,
        })
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

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list: &[Value; N] = value.as_array()?.as_slice().try_into().ok()?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}

fn indices(value: &Value) -> Option<[usize; 2]> {
    let [one, other] = value.as_array()?.as_slice() else {
        return None;
    };
    Some([index(one)?, index(other)?])
}

fn index(value: &Value) -> Option<usize> {
    usize::try_from(value.as_u64()?).ok()
}

/// `0`, `1`, `false` or `true`.
fn flag(value: &Value) -> Option<bool> {
    match value.as_f64() {
        Some(0.0) => Some(false),
        Some(1.0) => Some(true),
        _ => value.as_bool(),
    }
}

fn label(value: &Value) -> Option<String> {
    let label = value.get("label")?.as_str()?;
    (!label.is_empty()).then(|| label.to_owned())
}

/// The beginning of a value, for a message.
fn show(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
