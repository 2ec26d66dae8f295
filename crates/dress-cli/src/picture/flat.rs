//! A meshed pattern laid flat: panels in their colours, mesh lines, names; flipped triangles alarm.

use super::canvas::Canvas;
use super::colour::{self, INK, hex, mix, scaled};
use super::text;
use dress_anyone::geometry::Vec2;
use dress_anyone::io::svg::shelves;
use dress_anyone::pattern::PatternMesh;

/// Length of the picture's longer side \[px\], about.
const SIZE: f64 = 1600.0;
/// Free between panels, for their names \[px\].
const GAP: f64 = 34.0;

/// The rest positions `x_bar` \[m\] of a mesh, `names` by panel, as the bytes of a PNG file.
pub fn pattern_png(mesh: &PatternMesh, x_bar: &[Vec2], names: &[&str]) -> Vec<u8> {
    let boxes: Vec<(Vec2, Vec2)> = mesh
        .panel_vertices
        .iter()
        .map(|range| box_around(&x_bar[range.clone()]))
        .collect();
    let sizes: Vec<Vec2> = boxes.iter().map(|(low, high)| high - low).collect();
    // The gap in metres follows from the scale, which follows from the sheet: once without.
    let (_, bare) = shelves(&sizes, 0.0);
    let scale = SIZE / bare.max().max(1e-3);
    let (corners, sheet) = shelves(&sizes, GAP / scale);
    let [width, height] = [sheet.x, sheet.y].map(|size| (size * scale + 2.0 * GAP) as usize);
    let mut canvas = Canvas::new(width, height, hex(0x00ff_ffff));

    for (panel, (low, _)) in boxes.iter().enumerate() {
        let (corner, top) = (corners[panel], corners[panel].y + sizes[panel].y);
        let place = |v: u32| {
            let p = x_bar[v as usize] - low;
            let (x, y) = (corner.x + p.x, top - p.y);
            [x, y].map(|at| (at * scale + GAP) as f32)
        };
        let triangles = &mesh.triangles[mesh.panel_triangles[panel].clone()];
        for triangle in triangles {
            let corners = triangle.map(place);
            canvas.triangle(corners, fill(panel, corners));
        }
        for triangle in triangles {
            let [a, b, c] = triangle.map(place);
            for (from, to) in [(a, b), (b, c), (c, a)] {
                canvas.stroke(from, to, 0.7, scaled(colour::panel(panel), 0.45));
            }
        }
        for along in &mesh.edge_vertices[panel] {
            for pair in along.windows(2) {
                canvas.stroke(place(pair[0]), place(pair[1]), 1.8, INK);
            }
        }
        if let Some(name) = names.get(panel) {
            let at = [corner.x, corner.y].map(|at| (at * scale + GAP) as f32);
            text::write(&mut canvas, name, [at[0], at[1] - 8.0], 1.7, INK);
        }
    }
    canvas.to_png()
}

/// The panel's colour, or the alarm for a triangle that is clockwise in the pattern.
fn fill(panel: usize, [a, b, c]: [[f32; 2]; 3]) -> colour::Rgb {
    let on_screen = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
    if on_screen < 0.0 {
        mix(colour::panel(panel), [1.0; 3], 0.45)
    } else {
        colour::ALARM
    }
}

/// Smallest and largest corner of the box around the finite points; zero without any.
fn box_around(points: &[Vec2]) -> (Vec2, Vec2) {
    points
        .iter()
        .filter(|p| p.iter().all(|v| v.is_finite()))
        .map(|p| (*p, *p))
        .reduce(|a, b| (a.0.inf(&b.0), a.1.sup(&b.1)))
        .unwrap_or_default()
}
