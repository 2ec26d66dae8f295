//! Whether a pattern can be cut and sewn: every panel one simple loop that encloses cloth, every
//! edge in at most one stitch.
//!
//! Outlines are tested as polygons, 48 chords to a curve, by exact orientation predicates. Crossings
//! that enclose no more than a sliver thinner than [`TOUCH`] are taken for two edges that touch
//! (dart legs, slits), not for a mistake.

use super::{EdgeId, Panel, Pattern};
use crate::geometry::polygon::{Crossing, Polygon, perimeter};
use crate::geometry::{Vec2, signed_area};
use crate::problem::Problem;
use std::collections::{BTreeMap, BTreeSet};

/// An overlap thinner than this \[m\] is two edges touching: a tenth of a pen stroke.
pub const TOUCH: f64 = 1e-4;

/// Ends of an edge closer than this \[m\] are one point; a thousandth of a millimetre.
const SAME_POINT: f64 = 1e-6;

/// Chords to a curved edge; a semicircle 1 m across then deviates 0.3 mm.
const CHORDS: usize = 48;

/// More edges than this is a tracing, not a panel, and would take minutes to test.
const MOST_EDGES: usize = 2000;

/// Crossings after which the rest of a hopeless outline is not looked at.
const MANY: usize = 1000;

/// Everything wrong with the geometry of `pattern` and its stitches.
pub fn problems(pattern: &Pattern) -> Vec<Problem> {
    let mut problems: Vec<_> = pattern.panels.iter().flat_map(panel_problems).collect();
    problems.extend(stitch_problems(pattern));
    problems
}

/// Everything wrong with one panel; the outline is looked at only when its edges form a loop.
pub(crate) fn panel_problems(panel: &Panel) -> Vec<Problem> {
    let mut problems = loop_problems(panel);
    if problems.is_empty() {
        problems = length_problems(panel);
    }
    if problems.is_empty() {
        problems = outline_problems(panel);
    }
    problems
}

/// Stitches that name no edge, or an edge that is already sewn.
pub(crate) fn stitch_problems(pattern: &Pattern) -> Vec<Problem> {
    let mut problems = Vec::new();
    let mut stitch_of: BTreeMap<EdgeId, usize> = BTreeMap::new();
    for (s, stitch) in pattern.stitches.iter().enumerate() {
        let place = format!("stitch {s}");
        for id in stitch.sides {
            let Some(panel) = pattern.panels.get(id.panel) else {
                let text = format!("names panel {}, which does not exist", id.panel);
                problems.push(Problem::at(&place, text));
                continue;
            };
            let (name, count) = (&panel.name, panel.edges.len());
            if id.edge >= count {
                let text = format!(
                    "names edge {} of panel `{name}`, which has {count} edges, counted from 0",
                    id.edge
                );
                problems.push(Problem::at(&place, text));
            } else if let Some(first) = stitch_of.insert(id, s) {
                let text = if first == s {
                    format!("sews edge {} of panel `{name}` to itself", id.edge)
                } else {
                    format!(
                        "sews edge {} of panel `{name}`, which stitch {first} sews already; \
                         split the edge, or remove one of the stitches",
                        id.edge
                    )
                };
                problems.push(Problem::at(&place, text));
            }
        }
    }
    problems
}

fn loop_problems(panel: &Panel) -> Vec<Problem> {
    let name = &panel.name;
    let (edges, corners) = (&panel.edges, panel.vertices.len());
    if !(2..=MOST_EDGES).contains(&edges.len()) {
        let text = format!(
            "has {} edges; a closed outline has 2 to {MOST_EDGES}",
            edges.len()
        );
        return vec![Problem::at(format!("panel `{name}`"), text)];
    }
    let mut problems = Vec::new();
    let mut passed = BTreeSet::new();
    for (e, edge) in edges.iter().enumerate() {
        let mut report = |text: String| problems.push(Problem::at(place(panel, e), text));
        for v in [edge.start, edge.end] {
            if v >= corners {
                report(format!(
                    "ends at corner {v}, but the panel has {corners} corners, counted from 0"
                ));
            }
        }
        let before = (e + edges.len() - 1) % edges.len();
        let arrived = edges[before].end;
        if edge.start != arrived {
            report(format!(
                "starts at corner {}, but edge {before} ends at corner {arrived}; \
                 list the edges in order around the panel, each from where the last one ended",
                edge.start
            ));
        } else if !passed.insert(edge.start) {
            report(format!(
                "passes corner {} a second time; an outline is one simple loop",
                edge.start
            ));
        }
    }
    problems
}

fn length_problems(panel: &Panel) -> Vec<Problem> {
    let short = |e: &usize| {
        let (a, b) = panel.ends(*e);
        let chord = (b - a).norm();
        chord.is_nan() || chord <= SAME_POINT
    };
    (0..panel.edges.len())
        .filter(short)
        .map(|e| {
            Problem::at(
                place(panel, e),
                "starts and ends at the same point; remove it, or move one of its corners",
            )
        })
        .collect()
}

fn outline_problems(panel: &Panel) -> Vec<Problem> {
    let outline = Outline::new(panel);
    let crossing: BTreeSet<_> = outline.deep_crossings();
    if crossing.is_empty() {
        return outline.area_problem(panel).into_iter().collect();
    }
    crossing
        .into_iter()
        .map(|(e, f)| {
            if e == f {
                Problem::at(place(panel, e), "crosses itself; straighten the curve")
            } else {
                Problem::at(
                    format!("panel `{}`", panel.name),
                    format!("edge {e} crosses edge {f}; the outline must not overlap itself"),
                )
            }
        })
        .collect()
}

fn place(panel: &Panel, e: usize) -> String {
    format!("panel `{}`, edge {e}", panel.name)
}

/// A panel's outline as a polygon, and the edge that each of its sides belongs to.
struct Outline {
    points: Vec<Vec2>,
    edges: Vec<usize>,
}

impl Outline {
    fn new(panel: &Panel) -> Self {
        let (mut points, mut edges) = (Vec::new(), Vec::new());
        for (e, edge) in panel.edges.iter().enumerate() {
            let (a, b) = panel.ends(e);
            let chords = match edge.curve {
                super::Curve::Line => 1,
                _ => CHORDS,
            };
            for i in 0..chords {
                let t = i as f64 / chords as f64;
                points.push(edge.curve.point(a, b, t));
                edges.push(e);
            }
        }
        Self { points, edges }
    }

    fn area_problem(&self, panel: &Panel) -> Option<Problem> {
        let area = signed_area(&self.points).abs();
        // A strip as long as the panel and too thin to tell its sides apart encloses nothing.
        (area <= TOUCH * perimeter(&self.points)).then(|| {
            Problem::at(
                format!("panel `{}`", panel.name),
                "encloses no area; its edges lie on top of each other",
            )
        })
    }

    /// Pairs of edges that overlap by more than a sliver.
    fn deep_crossings(&self) -> BTreeSet<(usize, usize)> {
        let crossings = self.crossings();
        let mut deep = vec![true; crossings.len()];
        for (k, crossing) in crossings.iter().enumerate() {
            let (i, j) = crossing.sides;
            let inner = self.between(crossing.point, i, crossing.point, j);
            let outer = self.between(crossing.point, j, crossing.point, i);
            if is_sliver(&inner) || is_sliver(&outer) {
                deep[k] = false;
            } else if k + 1 < crossings.len() {
                let next = crossings[k + 1];
                if is_sliver(&self.lens(crossing, &next)) {
                    deep[k] = false;
                    deep[k + 1] = false;
                }
            }
        }
        let pair = |c: &Crossing| (self.edges[c.sides.0], self.edges[c.sides.1]);
        let found = crossings.iter().zip(&deep).filter(|(_, deep)| **deep);
        found.map(|(crossing, _)| pair(crossing)).collect()
    }

    /// Crossings of the loop with itself, in loop order.
    fn crossings(&self) -> Vec<Crossing> {
        let polygon = Polygon::new(self.points.clone());
        let mut found: Vec<_> = polygon.crossings().take(MANY).collect();
        found.sort_by_key(|crossing| crossing.sides);
        found
    }

    /// The loop's points from `from` on side `i` to `to` on side `j`, both included.
    fn between(&self, from: Vec2, i: usize, to: Vec2, j: usize) -> Vec<Vec2> {
        let n = self.points.len();
        let mut points = vec![from];
        let steps = (j + n - i) % n;
        points.extend((1..=steps).map(|k| self.points[(i + k) % n]));
        points.push(to);
        points
    }

    /// What two strands of the loop enclose between one crossing and the next.
    fn lens(&self, a: &Crossing, b: &Crossing) -> Vec<Vec2> {
        let mut points = self.between(a.point, a.sides.0, b.point, b.sides.0);
        let (from, to) = ((a.point, a.sides.1), (b.point, b.sides.1));
        if from.1 <= to.1 {
            let strand = self.between(from.0, from.1, to.0, to.1);
            points.extend(strand.into_iter().rev());
        } else {
            points.extend(self.between(to.0, to.1, from.0, from.1));
        }
        points
    }
}

/// Whether a loop is nowhere much wider than [`TOUCH`], judged by area over half the perimeter.
fn is_sliver(polygon: &[Vec2]) -> bool {
    signed_area(polygon).abs() <= TOUCH * 0.5 * perimeter(polygon)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{panel, stitch};
    use crate::pattern::Curve;

    fn told(panel: &Panel) -> String {
        let told: Vec<_> = panel_problems(panel)
            .iter()
            .map(ToString::to_string)
            .collect();
        told.join("\n")
    }

    const SQUARE: [[f64; 2]; 4] = [[0.0, 0.0], [0.3, 0.0], [0.3, 0.3], [0.0, 0.3]];

    #[test]
    fn a_square_with_a_dart_is_sound_either_way_round() {
        let mut dart = vec![[0.1, 0.0], [0.15, 0.1], [0.2, 0.0]];
        dart.extend([[0.3, 0.0], [0.3, 0.3], [0.0, 0.3], [0.0, 0.0]]);
        assert_eq!(told(&panel("p", &dart)), "");
        dart.reverse();
        assert_eq!(told(&panel("p", &dart)), "");
    }

    #[test]
    fn a_crossing_is_told_by_its_two_edges() {
        let mut panel = panel("p", &SQUARE);
        // Both curves reach 10 cm past the middle.
        panel.edges[0].curve = Curve::Quadratic(Vec2::new(0.15, 0.5));
        panel.edges[2].curve = Curve::Quadratic(Vec2::new(0.15, -0.2));
        let told = told(&panel);
        assert!(told.contains("edge 0 crosses edge 2"), "{told}");
        assert_eq!(told.lines().count(), 1);
    }

    #[test]
    fn a_loop_within_one_edge_is_told() {
        let mut panel = panel("p", &SQUARE);
        panel.edges[0].curve = Curve::Cubic([Vec2::new(0.9, -0.4), Vec2::new(-0.6, -0.4)]);
        assert_eq!(
            told(&panel),
            "panel `p`, edge 0: crosses itself; straighten the curve"
        );
    }

    #[test]
    fn edges_that_overlap_by_less_than_a_pen_stroke_only_touch() {
        let overlapping_by = |depth: f64| {
            let mut panel = panel("p", &SQUARE);
            // A parabola with its control point at height 2 h rises to h.
            panel.edges[0].curve = Curve::Quadratic(Vec2::new(0.15, 0.3 + depth));
            panel.edges[2].curve = Curve::Quadratic(Vec2::new(0.15, -depth));
            told(&panel)
        };
        assert!(overlapping_by(10.0 * TOUCH).contains("crosses"));
        assert_eq!(overlapping_by(0.2 * TOUCH), "");
        assert_eq!(overlapping_by(-TOUCH), "");
    }

    #[test]
    fn a_slit_of_no_width_is_allowed_and_a_panel_of_no_width_is_not() {
        let mut slit = vec![[0.15, 0.0], [0.15, 0.1], [0.15 + 1e-5, 0.0]];
        slit.extend([[0.3, 0.0], [0.3, 0.3], [0.0, 0.3], [0.0, 0.0]]);
        assert_eq!(told(&panel("p", &slit)), "");
        let strip = panel("p", &[[0.0, 0.0], [0.3, 0.0], [0.3, 1e-5], [0.0, 1e-5]]);
        assert!(told(&strip).contains("encloses no area"));
    }

    #[test]
    fn a_corner_passed_twice_and_a_position_that_is_no_number_are_told() {
        let mut eight = panel("p", &[[0.0, 0.0], [0.1, 0.1], [0.2, 0.0], [0.2, 0.2]]);
        eight.edges[2].end = 1;
        eight.edges[3].start = 1;
        assert!(told(&eight).contains("passes corner 1 a second time"));
        let mut nowhere = panel("p", &SQUARE);
        nowhere.vertices[2].x = f64::NAN;
        assert!(told(&nowhere).contains("edge 1: starts and ends at the same point"));
    }

    #[test]
    fn a_stitch_that_names_nothing_or_something_sewn_is_told() {
        let pattern = Pattern {
            panels: vec![panel("p", &SQUARE)],
            stitches: vec![
                stitch((0, 0), (0, 1)),
                stitch((0, 1), (0, 4)),
                stitch((1, 0), (0, 2)),
            ],
        };
        let told: Vec<_> = problems(&pattern).iter().map(|p| p.place.clone()).collect();
        assert_eq!(told, ["stitch 1", "stitch 1", "stitch 2"]);
    }
}
