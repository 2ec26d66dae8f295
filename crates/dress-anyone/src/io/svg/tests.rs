use super::*;
use crate::fixture::{rectangle, stitch};

fn alone(panel: Panel) -> Pattern {
    Pattern {
        panels: vec![panel],
        stitches: vec![],
    }
}

/// The text between `start` and the next `end`.
fn between<'a>(text: &'a str, start: &str, end: &str) -> &'a str {
    let from = text.find(start).expect("its start") + start.len();
    let length = text[from..].find(end).expect("its end");
    &text[from..from + length]
}

fn numbers(path: &str) -> Vec<f64> {
    let split = path.split(|c: char| !(c.is_ascii_digit() || c == '.' || c == '-'));
    split.filter_map(|word| word.parse().ok()).collect()
}

fn path_of<'a>(svg: &'a str, class: &str) -> &'a str {
    between(svg, &format!("class=\"{class}\" d=\""), "\"")
}

#[test]
fn a_millimetre_is_a_millimetre_and_up_is_up() {
    let pattern = alone(rectangle("front", 0.3, 0.2));
    let svg = pattern_svg(&pattern, &pattern, "t");
    let width: f64 = between(&svg, " width=\"", "mm\"").parse().expect("mm");
    let height: f64 = between(&svg, " height=\"", "mm\"").parse().expect("mm");
    assert_eq!(
        numbers(between(&svg, "viewBox=\"", "\"")),
        [0.0, 0.0, width, height]
    );
    let p = numbers(path_of(&svg, "after"));
    let [a, b, c, d] = [0, 2, 4, 6].map(|i| [p[i], p[i + 1]]);
    // 0.3 m to the right is 300 mm to the right; 0.2 m up is 200 mm less y.
    assert!((b[0] - a[0] - 300.0).abs() < 2e-3 && b[1] == a[1]);
    assert!((b[1] - c[1] - 200.0).abs() < 2e-3 && d[0] == a[0]);
}

#[test]
fn curves_stay_curves_and_arcs_turn_with_the_mirror() {
    let mut bent = rectangle("front", 0.2, 0.2);
    bent.edges[0].curve = Curve::Quadratic(Vec2::new(0.1, -0.05));
    bent.edges[1].curve = Curve::Cubic([Vec2::new(0.25, 0.05), Vec2::new(0.25, 0.15)]);
    bent.edges[2].curve = Curve::Arc {
        radius: 0.15,
        large: false,
        counter_clockwise: true,
    };
    let pattern = alone(bent);
    let svg = pattern_svg(&pattern, &pattern, "t");
    let path = path_of(&svg, "after");
    assert!(path.contains(" Q") && path.contains(" C") && path.contains(" L"));
    // Counter-clockwise with y up is sweep 0 with y down.
    assert!(path.contains(" A150.000 150.000 0 0 0 "), "{path}");
    let p = numbers(path);
    // The control point hangs 50 mm below the edge's start.
    assert!((p[3] - p[1] - 50.0).abs() < 2e-3);
}

#[test]
fn before_lies_centred_on_after() {
    let before = alone(rectangle("front", 0.2, 0.1));
    let mut moved = rectangle("front", 0.3, 0.2);
    for v in &mut moved.vertices {
        *v += Vec2::new(5.0, -3.0);
    }
    let svg = pattern_svg(&before, &alone(moved), "t");
    let centre = |class: &str| {
        let p = numbers(path_of(&svg, class));
        [f64::midpoint(p[0], p[4]), f64::midpoint(p[1], p[5])]
    };
    let (a, b) = (centre("after"), centre("before"));
    assert!((a[0] - b[0]).abs() < 2e-3 && (a[1] - b[1]).abs() < 2e-3);
}

#[test]
fn every_panel_appears_and_names_are_escaped() {
    let mut pattern = alone(rectangle("left <&> \"sleeve\"", 0.3, 0.2));
    pattern.panels.push(rectangle("back", 0.3, 0.4));
    let other = alone(rectangle("pocket", 0.1, 0.1));
    let svg = pattern_svg(&other, &pattern, "a < b\u{0}");
    assert!(svg.contains("left &lt;&amp;&gt; &quot;sleeve&quot;</text>"));
    assert!(svg.contains(">back</text>") && svg.contains("a &lt; b?"));
    assert_eq!(svg.matches("class=\"after\"").count(), 2);
    // Neither had a former self.
    assert_eq!(svg.matches("class=\"before\"").count(), 0);
}

#[test]
fn both_sides_of_a_seam_carry_its_number_inside_the_panel() {
    let mut pattern = alone(rectangle("front", 0.3, 0.2));
    pattern.panels.push(rectangle("back", 0.3, 0.4));
    // A clockwise loop has its inside on the other hand.
    pattern.panels[1].vertices.reverse();
    pattern.stitches = vec![stitch((0, 1), (1, 1)), stitch((0, 3), (1, 3))];
    pattern.stitches[1].right_wrong = true;
    let svg = pattern_svg(&pattern, &pattern, "t");
    assert_eq!(svg.matches(">1</text>").count(), 2);
    assert_eq!(svg.matches("class=\"odd\" cx").count(), 2);
    assert!(svg.contains("right side is sewn to wrong side"));
    for part in svg.split("class=\"after\" d=\"").skip(1) {
        let p = numbers(&part[..part.find('"').expect("its end")]);
        let xs = [p[0], p[2], p[4]];
        let (low, high) = xs
            .iter()
            .fold((1e9_f64, 0_f64), |(l, h), x| (l.min(*x), h.max(*x)));
        for disc in part.split(" cx=\"").skip(1) {
            let x = numbers(disc)[0];
            assert!(low + INSET - 0.01 <= x && x <= high - INSET + 0.01);
        }
    }
}

#[test]
fn a_pattern_without_panels_is_a_drawing_still() {
    let empty = Pattern {
        panels: vec![],
        stitches: vec![],
    };
    assert!(pattern_svg(&empty, &empty, "").ends_with("</svg>\n"));
}
