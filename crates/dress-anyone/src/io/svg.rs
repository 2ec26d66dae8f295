//! A pattern before and after, at true scale, as an SVG drawing.
//!
//! One millimetre of the drawing is one millimetre of cloth: `width` and `height` are in mm and the
//! view box has the same numbers. Panels are y up and SVG is y down, so heights are mirrored and arcs
//! turn the other way. Chains of stitches between the same two panels are one seam with one number,
//! written inside both panels at the middle of its sides.

mod layout;
mod seams;

use crate::geometry::polygon::centroid;
use crate::geometry::{Vec2, signed_area};
use crate::pattern::{Curve, Panel, Pattern};
pub use layout::shelves;
use layout::{box_around, heart, room_to_the_right};
use seams::{Seam, Side, seams};
use std::fmt::Write;

/// Millimetres in a metre: the unit of the drawing.
const MM: f64 = 1e3;
/// Everything below in mm: free between panels, and around the sheet; bands above and below.
const GAP: f64 = 24.0;
const TITLE: f64 = 26.0;
const FOOTER: f64 = 124.0;
/// Radius of the disc that a seam's number stands in, and its distance from the seam.
const DISC: f64 = 4.2;
const INSET: f64 = 8.0;
/// Side of the square to measure a print by.
const TEST_SQUARE: f64 = 100.0;
/// Longest piece by which outlines are measured \[m\].
const SPACING: f64 = 4e-3;

const STYLE: &str = "text{font-family:Helvetica,Arial,sans-serif;fill:#22262e}\
.after{fill:#f4f6f9;stroke:#22262e;stroke-width:.7;stroke-linejoin:round}\
.before{fill:none;stroke:#8a919c;stroke-width:.6;stroke-dasharray:4 3}\
.grain{fill:none;stroke:#5b6675;stroke-width:.4}\
.seam{fill:#fff;stroke:#2f6f9f;stroke-width:.45}\
.odd{fill:#fff;stroke:#b3261e;stroke-width:.9;stroke-dasharray:1.6 1}\
.number{font-size:4.6px;text-anchor:middle}\
.note{fill:#5b6675}";

/// Both patterns \[m\] in one drawing, panel over panel by name: `after` solid, `before` dashed.
pub fn pattern_svg(before: &Pattern, after: &Pattern, title: &str) -> String {
    let sheets: Vec<Sheet> = after
        .panels
        .iter()
        .map(|panel| {
            Sheet::new(
                panel,
                before.panel_named(&panel.name).map(|p| &before.panels[p]),
            )
        })
        .collect();
    let sizes: Vec<Vec2> = sheets.iter().map(|s| (s.high - s.low) * MM).collect();
    let (corners, used) = shelves(&sizes, GAP);
    let width = (used.x + 2.0 * GAP).max(240.0);
    let height = TITLE + used.y + FOOTER + 2.0 * GAP;

    let mut svg = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{width:.3}mm\" height=\"{height:.3}mm\" \
         viewBox=\"0 0 {width:.3} {height:.3}\">\n<title>{title}</title>\n<style>{STYLE}</style>\n\
         <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n\
         <text x=\"{GAP}\" y=\"{GAP}\" font-size=\"9\">{title}</text>\n",
        title = escaped(title),
    );
    let seams = seams(after);
    for (p, sheet) in sheets.iter().enumerate() {
        let corner = corners[p] + Vec2::new(GAP, GAP + TITLE);
        let page = Page {
            low: sheet.low,
            left: corner.x,
            bottom: corner.y + sizes[p].y,
        };
        draw_panel(&mut svg, sheet, &page);
        for (number, seam) in seams.iter().enumerate() {
            for side in seam.sides.iter().filter(|side| side.panel == p) {
                draw_number(&mut svg, number + 1, seam, side, after, &page);
            }
        }
        svg.push_str("</g>\n");
    }
    let odd = seams.iter().any(|seam| seam.right_wrong);
    draw_footer(&mut svg, height - GAP - FOOTER + 20.0, odd);
    svg.push_str("</svg>\n");
    svg
}

/// A panel, its former self moved onto it, and the box around both.
struct Sheet<'a> {
    after: &'a Panel,
    before: Option<(&'a Panel, Vec2)>,
    low: Vec2,
    high: Vec2,
}

impl<'a> Sheet<'a> {
    fn new(after: &'a Panel, before: Option<&'a Panel>) -> Self {
        let mut points = after.outline(SPACING);
        let centre = centroid(&points);
        let before = before.map(|panel| {
            let outline = panel.outline(SPACING);
            let shift = centre - centroid(&outline);
            points.extend(outline.iter().map(|p| p + shift));
            (panel, shift)
        });
        let (low, high) = box_around(&points);
        Self {
            after,
            before,
            low,
            high,
        }
    }
}

/// Where a panel's plane lies on the drawing.
struct Page {
    /// The point of the plane \[m\] that comes to the lower left corner.
    low: Vec2,
    /// That corner \[mm\].
    left: f64,
    bottom: f64,
}

impl Page {
    fn place(&self, p: Vec2) -> Vec2 {
        let d = (p - self.low) * MM;
        Vec2::new(self.left + d.x, self.bottom - d.y)
    }

    /// The outline of a panel moved by `shift` \[m\], as path data.
    fn path(&self, panel: &Panel, shift: Vec2) -> String {
        let point = |p: Vec2| {
            let q = self.place(p + shift);
            format!("{:.3} {:.3}", q.x, q.y)
        };
        let mut data = String::new();
        for (e, edge) in panel.edges.iter().enumerate() {
            let (a, b) = panel.ends(e);
            if e == 0 {
                data = format!("M{}", point(a));
            }
            let piece = match edge.curve {
                Curve::Line => format!(" L{}", point(b)),
                Curve::Quadratic(c) => format!(" Q{} {}", point(c), point(b)),
                Curve::Cubic([c, d]) => format!(" C{} {} {}", point(c), point(d), point(b)),
                Curve::Arc {
                    radius,
                    large,
                    counter_clockwise,
                } => {
                    let (radius, large) = (radius * MM, u8::from(large));
                    let sweep = u8::from(!counter_clockwise);
                    format!(" A{radius:.3} {radius:.3} 0 {large} {sweep} {}", point(b))
                }
            };
            data.push_str(&piece);
        }
        data + " Z"
    }
}

/// Opens the panel's group: outlines, grain line and name. Numbers follow; the caller closes it.
fn draw_panel(svg: &mut String, sheet: &Sheet, page: &Page) {
    let panel = sheet.after;
    let name = escaped(&panel.name);
    append(svg, &format!("<g><title>{name}</title>"));
    let path = page.path(panel, Vec2::zeros());
    append(svg, &format!("<path class=\"after\" d=\"{path}\"/>"));
    if let Some((before, shift)) = sheet.before {
        let path = page.path(before, shift);
        append(svg, &format!("<path class=\"before\" d=\"{path}\"/>"));
    }
    let outline = panel.outline(SPACING);
    let (heart, clearance) = heart(&outline);
    let (at, reach) = (page.place(heart), 0.7 * clearance * MM);
    let (x, up, down) = (at.x, at.y - reach, at.y + reach);
    let tip = (0.2 * reach).min(3.0);
    let half = 0.4 * tip;
    append(
        svg,
        &format!(
            "<path class=\"grain\" d=\"M{x:.3} {up:.3} V{down:.3} \
             M{:.3} {:.3} L{x:.3} {up:.3} L{:.3} {:.3} M{:.3} {:.3} L{x:.3} {down:.3} L{:.3} {:.3}\"/>",
            x - half,
            up + tip,
            x + half,
            up + tip,
            x - half,
            down - tip,
            x + half,
            down - tip,
        ),
    );
    let room = room_to_the_right(&outline, heart);
    let size = name_size(&panel.name, room * MM, clearance * MM);
    let from_wrong = if signed_area(&outline) < 0.0 {
        "wrong side up"
    } else {
        "right side up"
    };
    append(
        svg,
        &format!(
            "<text x=\"{0:.3}\" y=\"{1:.3}\" font-size=\"{size:.2}\">{name}</text>\
             <text x=\"{0:.3}\" y=\"{2:.3}\" font-size=\"{3:.2}\" class=\"note\">{from_wrong}</text>",
            x + 0.4 * size,
            at.y,
            at.y + 0.95 * size,
            0.7 * size,
        ),
    );
}

/// Font size that fits the name between the grain line and the outline \[mm\]; `room` is what is
/// free to the right, `clearance` in every direction.
fn name_size(name: &str, room: f64, clearance: f64) -> f64 {
    // A letter of these faces is about 0.6 of its size wide; the note below the name needs ten.
    let letters = name.chars().count().max(10) as f64;
    let fitting = (0.85 * room / (0.6 * letters)).min(0.6 * clearance);
    fitting.clamp(2.2, 11.0)
}

/// A seam's number in its disc, a little inside the panel, lengths as its tool tip.
fn draw_number(
    svg: &mut String,
    number: usize,
    seam: &Seam,
    side: &Side,
    pattern: &Pattern,
    page: &Page,
) {
    let panel = &pattern.panels[side.panel];
    let (middle, tangent) = side.middle(panel);
    let left = Vec2::new(-tangent.y, tangent.x);
    let inwards = left * panel.signed_area().signum();
    let at = page.place(middle);
    let disc = page.place(middle + inwards * (INSET / MM));
    let class = if seam.right_wrong { "odd" } else { "seam" };
    let lengths = seam.sides.each_ref().map(|side| {
        let panel = &pattern.panels[side.panel];
        format!("{} {:.1} mm", escaped(&panel.name), side.length(panel) * MM)
    });
    let lengths = lengths.join(" to ");
    append(
        svg,
        &format!(
            "<g><title>seam {number}: {lengths}</title>\
             <path class=\"{class}\" d=\"M{:.3} {:.3} L{x:.3} {y:.3}\"/>\
             <circle class=\"{class}\" cx=\"{x:.3}\" cy=\"{y:.3}\" r=\"{DISC}\"/>\
             <text class=\"number\" x=\"{x:.3}\" y=\"{:.3}\">{number}</text></g>",
            at.x,
            at.y,
            disc.y + 1.6,
            x = disc.x,
            y = disc.y,
        ),
    );
}

/// The square to check a print by, and what the lines mean.
fn draw_footer(svg: &mut String, top: f64, odd: bool) {
    let right = GAP + TEST_SQUARE + 8.0;
    append(
        svg,
        &format!(
            "<rect class=\"grain\" x=\"{GAP}\" y=\"{top:.3}\" width=\"{TEST_SQUARE}\" height=\"{TEST_SQUARE}\"/>\
             <text class=\"note\" font-size=\"5\" x=\"{:.3}\" y=\"{:.3}\">{TEST_SQUARE} mm</text>",
            GAP + 3.0,
            top + TEST_SQUARE - 3.5,
        ),
    );
    let mut lines = vec![
        "dashed: before, solid: after; scale 1:1, mm",
        "equal numbers are sewn together; arrows: grain line",
        "no seam allowance; measure the square after printing",
    ];
    if odd {
        lines.push("red, dashed number: right side is sewn to wrong side");
    }
    for (i, line) in lines.iter().enumerate() {
        let y = top + 6.0 + 8.0 * i as f64;
        append(
            svg,
            &format!(
                "<text class=\"note\" font-size=\"5\" x=\"{right}\" y=\"{y:.3}\">{line}</text>"
            ),
        );
    }
}

fn append(svg: &mut String, line: &str) {
    writeln!(svg, "{line}").expect("a string takes every line");
}

/// Text as XML takes it; characters that XML forbids become question marks.
fn escaped(text: &str) -> String {
    let mut safe = String::new();
    for c in text.chars() {
        match c {
            '&' => safe += "&amp;",
            '<' => safe += "&lt;",
            '>' => safe += "&gt;",
            '"' => safe += "&quot;",
            '\'' => safe += "&apos;",
            '\u{fffe}' | '\u{ffff}' => safe.push('?'),
            c if c.is_control() => safe.push('?'),
            c => safe.push(c),
        }
    }
    safe
}

#[cfg(test)]
mod tests;
