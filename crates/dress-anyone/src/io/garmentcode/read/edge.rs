//! Edges and their curvature, in all spellings.

use super::value::{flag, indices, label, numbers, show};
use super::{FARTHEST, LARGEST_RADIUS, Reader};
use crate::geometry::Vec2;
use crate::pattern::{Curve, Edge, curve};
use serde_json::Value;

impl Reader {
    pub(super) fn edges(
        &mut self,
        place: &str,
        value: Option<&Value>,
        vertices: &[Vec2],
    ) -> Vec<Edge> {
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
            curve::from_edge(given, a, b)
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
}
