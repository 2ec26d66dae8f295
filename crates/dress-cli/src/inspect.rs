//! `dress inspect`: what is in a garment or body file, and what is wrong with it.

use crate::arguments::{InspectArguments, Kind};
use crate::failure::Failure;
use dress_anyone::body::{Body, FileFrame};
use dress_anyone::garment::Garment;
use dress_anyone::geometry::Vec2;
use dress_anyone::io::file::{MEBIBYTE, read_capped};
use dress_anyone::io::garment::Loaded;
use dress_anyone::io::{body, garment, kind, obj};
use dress_anyone::pattern::symmetry::Symmetry;
use dress_anyone::pattern::{EdgeId, Panel, Pattern};
use dress_anyone::refit::dress::HoldParams;
use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;
use std::path::Path;

/// Larger files are refused.
const LIMIT: u64 = 1024 * MEBIBYTE;

/// What is in the file, as text.
pub fn run(arguments: &InspectArguments) -> Result<String, Failure> {
    let params = arguments.reading.params()?;
    let file = &arguments.file;
    let bytes = read_capped(file, LIMIT)?;
    match arguments.kind.unwrap_or_else(|| guess(file, &bytes)) {
        Kind::Garment => {
            let options = arguments.reading.garment(&params);
            let loaded = garment::parse(file, &bytes, &options)?;
            Ok(garment_text(&loaded, &params.refit.hold))
        }
        Kind::Body => {
            let body = body::parse(file, &bytes, &arguments.reading.body())?;
            Ok(body_text(&body))
        }
    }
}

/// Patterns are garments, and so are textured surfaces with a rim; other meshes are bodies.
fn guess(file: &Path, bytes: &[u8]) -> Kind {
    let is_garment = match kind::of(bytes) {
        Some("a JSON document") => true,
        Some("an OBJ mesh") => obj::parse(bytes).is_ok_and(|mesh| is_textured_and_open(&mesh)),
        _ => file.extension().is_some_and(|e| e == "json"),
    };
    if is_garment {
        Kind::Garment
    } else {
        Kind::Body
    }
}

fn is_textured_and_open(mesh: &obj::Document) -> bool {
    let mut sides: BTreeMap<[u32; 2], usize> = BTreeMap::new();
    for face in &mesh.faces {
        let next = face.corners.iter().cycle().skip(1);
        for (a, b) in face.corners.iter().zip(next) {
            *sides.entry([a.v.min(b.v), a.v.max(b.v)]).or_default() += 1;
        }
    }
    let mut corners = mesh.faces.iter().flat_map(|face| &face.corners);
    corners.any(|corner| corner.vt.is_some()) && sides.values().any(|count| *count == 1)
}

fn body_text(body: &Body) -> String {
    let mesh = &body.mesh;
    let (low, high) = mesh.bounds();
    let mut text = format!(
        "{}: a body\n  {} vertices, {} triangles, {:.3} m tall\n  {}\n",
        body.name,
        mesh.positions.len(),
        mesh.triangles.len(),
        high.y - low.y,
        frame_words(body.frame)
    );
    notes(&mut text, &body.notes);
    text
}

fn frame_words(frame: FileFrame) -> String {
    format!("unit {}, {} up", frame.unit_name(), frame.up.name())
}

fn notes(text: &mut String, notes: &[String]) {
    if !notes.is_empty() {
        text.push_str("\nnotes\n");
    }
    for note in notes {
        let _ = writeln!(text, "  {note}");
    }
}

fn garment_text(loaded: &Loaded, hold: &HoldParams) -> String {
    let garment = &loaded.garment;
    let pattern = &garment.pattern;
    let source = match (&loaded.specification, loaded.frame) {
        (Some(s), _) => format!("GarmentCode pattern, {} units in a metre", s.units_in_meter),
        (None, Some(frame)) => format!("drape with its pattern, {}", frame_words(frame)),
        (None, None) => String::new(),
    };
    let sum = garment.summary();
    let mut text = format!(
        "{}: a garment ({source})\n  {} panels, {} stitches, {:.3} m2 of cloth\n  \
         {} mesh vertices, {} when sewn, {} triangles\n\n",
        garment.name,
        sum.panels,
        sum.stitches,
        sum.area,
        sum.pattern_vertices,
        sum.cloth_vertices,
        sum.triangles
    );
    panels(&mut text, garment);
    seams(&mut text, pattern);
    free_edges(&mut text, pattern, sum.free_edges);
    labels(&mut text, pattern, hold);
    notes(&mut text, &loaded.notes);
    text
}

fn panels(text: &mut String, garment: &Garment) {
    let pattern = &garment.pattern;
    let symmetry = Symmetry::detect(pattern, &garment.mesh, garment.drape.as_deref());
    let names = pattern
        .panels
        .iter()
        .map(|panel| panel.name.chars().count());
    let width = names.max().unwrap_or(0).max("panel".len());
    let _ = writeln!(
        text,
        "{:width$}  edges  area [cm2]     size [cm]  mirrors",
        "panel"
    );
    for (p, panel) in pattern.panels.iter().enumerate() {
        let size = size(panel) * 100.0;
        let size = format!("{:.1} x {:.1}", size.x, size.y);
        let _ = writeln!(
            text,
            "{:width$}  {:5}  {:10.0}  {size:>12}  {}",
            panel.name,
            panel.edges.len(),
            1e4 * panel.signed_area().abs(),
            mirror(pattern, &symmetry, p)
        );
    }
}

/// Width and height of a panel as drawn \[m\].
fn size(panel: &Panel) -> Vec2 {
    let start = (Vec2::repeat(f64::INFINITY), Vec2::repeat(f64::NEG_INFINITY));
    let (low, high) = panel
        .outline(2e-3)
        .iter()
        .fold(start, |(low, high), p| (low.inf(p), high.sup(p)));
    high - low
}

/// The name of the panel that mirrors panel `p`.
fn mirror<'a>(pattern: &'a Pattern, symmetry: &Symmetry, p: usize) -> &'a str {
    let found = symmetry.mirrors.iter().find(|m| m.panels.contains(&p));
    match found.map(|mirror| mirror.panels) {
        None => "-",
        Some([a, b]) if a == b => "itself",
        Some([a, b]) => &pattern.panels[if a == p { b } else { a }].name,
    }
}

fn edge_name(pattern: &Pattern, id: EdgeId) -> String {
    format!("{}:{}", pattern.panels[id.panel].name, id.edge)
}

fn seams(text: &mut String, pattern: &Pattern) {
    text.push_str("\nstitches (panel:edge, counted from 0) and lengths of their sides [cm]\n");
    for stitch in &pattern.stitches {
        let [a, b] = stitch.sides.map(|id| edge_name(pattern, id));
        let [la, lb] = stitch.sides.map(|id| 100.0 * pattern.edge_length(id));
        let turned = if stitch.right_wrong {
            ", right to wrong"
        } else {
            ""
        };
        let _ = writeln!(text, "  {a} - {b}: {la:.1}, {lb:.1}{turned}");
    }
}

fn free_edges(text: &mut String, pattern: &Pattern, total: f64) {
    let sewn: BTreeSet<EdgeId> = pattern.stitches.iter().flat_map(|s| s.sides).collect();
    let _ = writeln!(
        text,
        "\nfree edges (hems, neck, openings), {:.1} cm in all",
        100.0 * total
    );
    for (p, panel) in pattern.panels.iter().enumerate() {
        let free =
            (0..panel.edges.len()).filter(|&edge| !sewn.contains(&EdgeId { panel: p, edge }));
        let free: Vec<String> = free
            .map(|e| format!("{e} ({:.1} cm)", 100.0 * panel.edge_length(e)))
            .collect();
        if !free.is_empty() {
            let _ = writeln!(text, "  {}: {}", panel.name, free.join(", "));
        }
    }
}

fn labels(text: &mut String, pattern: &Pattern, hold: &HoldParams) {
    let mut edges_of: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    for (p, panel) in pattern.panels.iter().enumerate() {
        for (edge, e) in panel.edges.iter().enumerate() {
            if let Some(label) = &e.label {
                let name = edge_name(pattern, EdgeId { panel: p, edge });
                edges_of.entry(label).or_default().push(name);
            }
        }
    }
    text.push_str("\nedge labels\n");
    let mut held = false;
    for (label, edges) in &edges_of {
        let holds = hold.labels.iter().any(|held| held == label);
        held |= holds;
        let note = if holds { " (held at its height)" } else { "" };
        let _ = writeln!(text, "  {label}{note}: {}", edges.join(", "));
    }
    if !held {
        text.push_str("  none that holds it: it has to rest on shoulders or hips by its shape\n");
    }
}
