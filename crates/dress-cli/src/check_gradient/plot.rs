//! A loss along a line, as an SVG drawing: its values joined, and a tangent through each, as the gradient
//! there has it. Where the loss is smooth, tangents and values run into each other.

use dress_anyone::refit::gradient_check::Line;
use std::fmt::Write;

/// Size of the drawing, and its margins, in px.
const SIZE: [f64; 2] = [900.0, 480.0];
const MARGIN: [f64; 2] = [90.0, 50.0];
/// Half the length of a tangent, in steps of the line.
const HALF: f64 = 0.45;

const STYLE: &str = "text{font-family:Helvetica,Arial,sans-serif;font-size:14px;fill:#22262e}\
.loss{fill:none;stroke:#8a919c;stroke-width:1.2}\
.at{fill:#22262e}\
.tangent{stroke:#b3261e;stroke-width:2.2}\
.frame{fill:none;stroke:#22262e;stroke-width:.8}";

/// The drawing.
pub fn svg(title: &str, line: &Line) -> String {
    let known = || line.points.iter().flatten().map(|point| point.0);
    let [low, high] = [
        known().fold(f64::INFINITY, f64::min),
        known().fold(f64::NEG_INFINITY, f64::max),
    ];
    let room = 0.05 * (high - low).max(1e-9 * high.abs());
    let (low, high) = (low - room, high + room);
    let [first, last] = [0, line.moves.len() - 1].map(|i| line.moves[i]);
    let inner = [0, 1].map(|k| SIZE[k] - 2.0 * MARGIN[k]);
    let place = |s: f64, loss: f64| {
        let x = MARGIN[0] + inner[0] * (s - first) / (last - first);
        let y = MARGIN[1] + inner[1] * (high - loss) / (high - low);
        (x, y)
    };
    let [width, height] = SIZE;
    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width}\" height=\"{height}\">\
         <style>{STYLE}</style><rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"/>\n",
        MARGIN[0], MARGIN[1], inner[0], inner[1]
    );
    let mut text = |x: f64, y: f64, anchor: &str, words: &str| {
        let words = words.replace('&', "&amp;").replace('<', "&lt;");
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<text x=\"{x}\" y=\"{y}\" text-anchor=\"{anchor}\">{words}</text>"
        );
    };
    let below = height - MARGIN[1] + 20.0;
    text(MARGIN[0], MARGIN[1] - 16.0, "start", title);
    for (s, anchor) in [(first, "start"), (0.0, "middle"), (last, "end")] {
        text(
            place(s, low).0,
            below,
            anchor,
            &format!("{} mm", super::millimetres(s)),
        );
    }
    for loss in [low, high] {
        text(
            MARGIN[0] - 8.0,
            place(0.0, loss).1 + 5.0,
            "end",
            &format!("{loss:.4}"),
        );
    }
    let step = (last - first) / (line.moves.len() - 1) as f64;
    let each = || line.moves.iter().zip(&line.points);
    for ((s, from), (t, to)) in each().zip(each().skip(1)) {
        if let (Some((a, _)), Some((b, _))) = (from, to) {
            let ((x, y), (u, v)) = (place(*s, *a), place(*t, *b));
            let _ = writeln!(
                svg,
                "<path class=\"loss\" d=\"M{x:.2} {y:.2}L{u:.2} {v:.2}\"/>"
            );
        }
    }
    for (s, point) in each() {
        let Some((loss, slope)) = point else { continue };
        let half = HALF * step;
        let ((x, y), (u, v)) = (
            place(s - half, loss - slope * half),
            place(s + half, loss + slope * half),
        );
        let (cx, cy) = place(*s, *loss);
        let _ = writeln!(
            svg,
            "<line class=\"tangent\" x1=\"{x:.2}\" y1=\"{y:.2}\" x2=\"{u:.2}\" y2=\"{v:.2}\"/>\
             <circle class=\"at\" cx=\"{cx:.2}\" cy=\"{cy:.2}\" r=\"1.8\"/>"
        );
    }
    svg + "</svg>\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_drape_leaves_a_gap_and_tangents_keep_to_their_points() {
        let line = Line {
            moves: vec![-1e-3, 0.0, 1e-3, 2e-3],
            points: vec![Some((1.0, -1e3)), Some((0.0, 0.0)), None, Some((4.0, 4e3))],
        };
        let svg = svg("a < b", &line);
        assert_eq!(svg.matches("class=\"loss\"").count(), 1);
        assert_eq!(svg.matches("class=\"tangent\"").count(), 3);
        assert!(svg.contains("a &lt; b") && svg.contains("-1 mm"));
        // The level tangent at zero is level.
        let level = svg
            .lines()
            .filter(|line| line.contains("class=\"tangent\""))
            .nth(1);
        let level = level.expect("three tangents");
        let y: Vec<&str> = level.split('"').skip(5).step_by(4).take(2).collect();
        assert_eq!(y[0], y[1], "{level}");
    }
}
