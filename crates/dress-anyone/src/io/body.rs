//! Bodies from OBJ, PLY and STL: which unit, which axis is up, which side is out.
//!
//! A file says none of these. The unit is the one that makes the body as tall as a person; up is
//! the axis along which it is long and not mirror-symmetric (x only where it clearly lies along it); out is where the enclosed volume is
//! positive. What was found is told in [`Body::notes`], and both guesses can be overruled.
//!
//! Vertices are kept, unused ones too, in the file's order, and polygons are cut into triangles by
//! their topology alone: bodies that correspond vertex by vertex in their files still do.

mod surface;

use super::source::{self, Surface};
use super::{kind, obj, ply, stl};
use crate::body::{Body, FileFrame, UpAxis};
use crate::geometry::{TriangleMesh, Vec3, bounds};
use crate::problem::{BadInput, Problem};
use std::fmt::Write as _;
use std::path::Path;

/// What the user knows better than the guesses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyOptions {
    /// Metres in one unit of the file.
    pub metres_per_unit: Option<f64>,
    /// The file's up axis.
    pub up: Option<UpAxis>,
}

/// Reads a body from an OBJ, PLY or STL file.
pub fn read(path: &Path, options: &BodyOptions) -> Result<Body, BadInput> {
    parse(path, &source::bytes(path)?, options)
}

/// [`read`] of a file's bytes; `file` gives the body its name.
pub fn parse(file: &Path, bytes: &[u8], options: &BodyOptions) -> Result<Body, BadInput> {
    let bad = |problems| BadInput::new(file, problems);
    let surface = surface_of(bytes, file).map_err(bad)?;
    let (mesh, frame, notes) = stand_up(&surface, options).map_err(|p| bad(vec![p]))?;
    Ok(Body {
        name: source::stem(file),
        mesh,
        frame,
        notes,
    })
}

/// A body's surface as OBJ text, in the frame of its file.
pub fn write(body: &Body) -> String {
    obj::mesh_text(&format!("body {}", body.name), &body.mesh, body.frame)
}

/// Units a body may come in, likeliest first: metres in one, and its name.
const UNITS: [(f64, &str); 5] = [
    (1.0, "metres"),
    (0.01, "centimetres"),
    (0.001, "millimetres"),
    (0.0254, "inches"),
    (0.1, "decimetres"),
];

/// Heights of people \[m\]; one unit at most makes a number one of these.
const USUAL_HEIGHT: std::ops::RangeInclusive<f64> = 1.0..=2.2;

/// Heights of anything that wears clothes \[m\].
const POSSIBLE_HEIGHT: std::ops::RangeInclusive<f64> = 0.4..=3.0;

/// Reads by what the content is; the extension only helps to say what is wrong with it.
fn surface_of(bytes: &[u8], path: &Path) -> Result<Surface, Vec<Problem>> {
    let named_stl = path
        .extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("stl"));
    match kind::of(bytes) {
        Some(kind::PLY) => ply::parse(bytes),
        Some(kind::STL) => stl::parse(bytes),
        None if named_stl => stl::parse(bytes),
        None | Some(kind::OBJ) => obj::parse(bytes).map(obj::Document::into_surface),
        Some(other) => {
            let swapped = match other {
                kind::JSON | kind::XML => ", perhaps a garment's pattern given in the body's place",
                _ => "",
            };
            Err(vec![Problem::whole(format!(
                "this looks like {other}{swapped}; a body is read from an OBJ, PLY or STL mesh"
            ))])
        }
    }
}

/// Brings a surface to metres, y up, outside out; with notes on how.
fn stand_up(
    surface: &Surface,
    options: &BodyOptions,
) -> Result<(TriangleMesh, FileFrame, Vec<String>), Problem> {
    let mut notes = Vec::new();
    let triangles = surface::triangulate(&surface.polygons, &mut notes);
    if triangles.is_empty() {
        return Err(Problem::whole(
            "holds vertices but no faces: a point cloud has to be meshed first",
        ));
    }
    let mut is_used = vec![false; surface.positions.len()];
    for v in triangles.as_flattened() {
        is_used[*v as usize] = true;
    }
    let pairs = surface.positions.iter().zip(&is_used);
    let used: Vec<Vec3> = pairs.filter(|(_, used)| **used).map(|(p, _)| *p).collect();
    let up = match options.up {
        Some(up) => up,
        None => up_axis(&used, &mut notes)?,
    };
    let (low, high) = bounds(&used);
    let height = match up {
        UpAxis::X => high.x - low.x,
        UpAxis::Y => high.y - low.y,
        UpAxis::Z => high.z - low.z,
    };
    let metres_per_unit = metres_per_unit(height, options.metres_per_unit, &mut notes)?;
    let frame = FileFrame {
        metres_per_unit,
        up,
    };
    let positions = surface.positions.iter().map(|p| frame.to_si(*p)).collect();
    let mut mesh = TriangleMesh {
        positions,
        triangles,
    };
    let edges = surface::Edges::of(&mesh.triangles);
    surface::turn_outward(&mut mesh, &edges, &mut notes);
    surface::describe(&mesh, &edges, &mut notes);
    Ok((mesh, frame, notes))
}

/// Metres in one unit of a file whose body is `height` units tall.
fn metres_per_unit(
    height: f64,
    told: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<f64, Problem> {
    if height <= 0.0 {
        return Err(Problem::whole("the body is flat: it has no height"));
    }
    if let Some(metres) = told {
        if !(metres.is_finite() && metres > 0.0) {
            let text = format!("one unit of the file cannot be {metres} m");
            return Err(Problem::whole(text));
        }
        if !POSSIBLE_HEIGHT.contains(&(height * metres)) {
            notes.push(format!(
                "unit as told: the body is {:.3} m tall",
                height * metres
            ));
        }
        return Ok(metres);
    }
    let fits = |range: &std::ops::RangeInclusive<f64>| -> Vec<(f64, &str)> {
        let fit = |unit: &&(f64, &str)| range.contains(&(height * unit.0));
        UNITS.iter().filter(fit).copied().collect()
    };
    let possible = fits(&POSSIBLE_HEIGHT);
    let usual = fits(&USUAL_HEIGHT);
    let Some((metres, name)) = usual.first().or(possible.first()).copied() else {
        return Err(Problem::whole(format!(
            "the body is {height:.4} units tall, which is no person's height in m, dm, cm, mm or \
             inches: say how many metres a unit is"
        )));
    };
    let mut note = format!("unit: {name} (the body is {:.3} m tall)", height * metres);
    for (other, name) in possible.iter().filter(|(other, _)| *other != metres) {
        let height = height * other;
        write!(note, "; it would be {height:.2} m in {name}").expect("a string takes all");
    }
    notes.push(note);
    Ok(metres)
}

/// Slices by which the two ends of an axis are compared.
const SLICES: usize = 48;

/// An axis this much longer than the other is the height, whatever the pose: only spread arms can
/// compete, and they do not reach that far.
const CLEARLY_LONGER: f64 = 1.6;

/// Which axis is up, of `points` on the surface. Arms spread along x mostly, so it has to be the
/// longest, and clearly or without mirror symmetry.
fn up_axis(points: &[Vec3], notes: &mut Vec<String>) -> Result<UpAxis, Problem> {
    let (low, high) = bounds(points);
    let extent = high - low;
    if extent.max() <= 0.0 {
        return Err(Problem::whole("all vertices are at the same point"));
    }
    let next = if extent.y >= extent.z { 1 } else { 2 };
    let asymmetric = || asymmetry(points, 0) > 1.5 * asymmetry(points, next);
    if extent.x > CLEARLY_LONGER * extent[next] || extent.x > extent[next] && asymmetric() {
        notes.push("up axis: x".to_owned());
        return Ok(UpAxis::X);
    }
    let longer = if extent.y >= extent.z {
        UpAxis::Y
    } else {
        UpAxis::Z
    };
    if extent.y.max(extent.z) > CLEARLY_LONGER * extent.y.min(extent.z) {
        notes.push(format!("up axis: {}", longer.name()));
        return Ok(longer);
    }
    // Arms spread along the other axis. Left mirrors right, but head does not mirror feet.
    let (y, z) = (asymmetry(points, 1), asymmetry(points, 2));
    let up = if y > 1.5 * z {
        UpAxis::Y
    } else if z > 1.5 * y {
        UpAxis::Z
    } else {
        longer
    };
    notes.push(format!(
        "up axis: {}, though y and z are of similar extent ({:.3} and {:.3} units)",
        up.name(),
        extent.y,
        extent.z
    ));
    Ok(up)
}

/// How far the points' distribution along an axis is from its mirror image: 0 for the same, 2 for
/// no overlap.
fn asymmetry(points: &[Vec3], axis: usize) -> f64 {
    let (low, high) = bounds(points);
    let slice = |p: &Vec3| {
        let along = (p[axis] - low[axis]) / (high[axis] - low[axis]);
        ((along * SLICES as f64) as usize).min(SLICES - 1)
    };
    let mut share = [0.0; SLICES];
    for p in points {
        share[slice(p)] += 1.0 / points.len() as f64;
    }
    let mirrored = share.iter().rev();
    share.iter().zip(mirrored).map(|(a, b)| (a - b).abs()).sum()
}

#[cfg(test)]
mod tests;
