//! Garments as OBJ: a drape whose texture coordinates are its pattern.
//!
//! Such a file has two numberings, `v` for the sewn cloth and `vt` for the flat pattern. Panels are
//! the islands of the second, seams are where the first joins what the second keeps apart. Unit and
//! size of the pattern are measured against the drape, unless the file is one that [`write()`] made:
//! its comments say what OBJ cannot hold.

mod border;
mod islands;
mod scale;
mod tags;
mod write;

use super::{obj, source};
use crate::body::{FileFrame, UpAxis};
use crate::garment::Garment;
use crate::geometry::{Mat3, Vec2, Vec3, cross2};
use crate::pattern::{Pattern, PatternMesh, Placement};
use crate::problem::{BadInput, Problem};
use islands::Islands;
use std::path::Path;
pub use write::write;

/// What the user knows better than the guesses.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UvOptions {
    /// Metres in one unit of the texture coordinates.
    pub uv_scale: Option<f64>,
    /// Metres in one unit of the drape.
    pub metres_per_unit: Option<f64>,
    /// The drape's up axis.
    pub up: Option<UpAxis>,
}

/// A garment read from an OBJ file, and how the file had it.
#[derive(Clone, Debug)]
pub struct ObjGarment {
    /// Pattern, mesh and drape.
    pub garment: Garment,
    /// The drape's unit and up axis.
    pub frame: FileFrame,
    /// Metres in one unit of the texture coordinates.
    pub uv_scale: f64,
    /// What was found, guessed and tolerated.
    pub notes: Vec<String>,
}

/// Reads a drape whose texture coordinates are its pattern.
pub fn read(path: &Path, options: &UvOptions) -> Result<ObjGarment, BadInput> {
    parse(path, &source::bytes(path)?, options)
}

/// [`read`] of a file's bytes; `file` gives the garment its name.
pub fn parse(file: &Path, bytes: &[u8], options: &UvOptions) -> Result<ObjGarment, BadInput> {
    obj::parse(bytes)
        .and_then(|document| assemble(document, source::stem(file), options))
        .map_err(|problems| BadInput::new(file, problems))
}

fn assemble(
    mut document: obj::Document,
    name: String,
    options: &UvOptions,
) -> Result<ObjGarment, Vec<Problem>> {
    let mut notes = Vec::new();
    let islands = islands::cut(&mut document, &mut notes)?;
    border::check_open(&islands)?;
    let border = border::trace(&islands)?;
    let tags = tags::parse(&document.comments, &mut notes);
    let (frame, uv_scale) = match &tags {
        Some(tags) => {
            if *options != UvOptions::default() {
                let text = "its comments (`# dress:`) tell unit, up axis and scale: what was told of them \
                            besides is not used";
                notes.push(text.to_owned());
            }
            (tags.frame(), tags.frame().metres_per_unit)
        }
        None => scale::find(&document, &islands, options, &mut notes)?,
    };
    let x_bar: Vec<Vec2> = islands
        .uvs
        .iter()
        .map(|vt| document.uvs[*vt as usize] * uv_scale)
        .collect();
    let mut garment = Garment {
        name,
        pattern: Pattern {
            panels: Vec::new(),
            stitches: Vec::new(),
        },
        mesh: mesh(&islands, x_bar),
        drape: Some(
            islands
                .cloth
                .iter()
                .map(|v| frame.to_si(document.positions[*v as usize]))
                .collect(),
        ),
    };
    let restored =
        tags.is_some_and(|tags| tags.restore(&islands, &border, &mut garment, &mut notes));
    if !restored {
        border::outline(&islands, &border, &mut garment, &mut notes);
        let drape = garment.drape.as_deref().unwrap_or_default();
        for (k, panel) in garment.pattern.panels.iter_mut().enumerate() {
            panel.placement = beside_the_drape(&garment.mesh, drape, k);
        }
    }
    // Curves are fitted by pattern::outline: straight edges to the chains in `mesh.edge_vertices`.
    Ok(ObjGarment {
        garment,
        frame,
        uv_scale,
        notes,
    })
}

/// The rest shape, still without edges. A panel whose island is mirrored lies with its right side
/// down; its triangles are turned over so that all are counter-clockwise.
fn mesh(islands: &Islands, x_bar: Vec<Vec2>) -> PatternMesh {
    let mut triangles = islands.triangles.clone();
    let mut right_side_up = Vec::new();
    for range in &islands.panel_triangles {
        let doubled_area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| x_bar[v as usize]);
            cross2(b - a, c - a)
        };
        let up = triangles[range.clone()]
            .iter()
            .map(doubled_area)
            .sum::<f64>()
            > 0.0;
        if !up {
            for triangle in &mut triangles[range.clone()] {
                triangle.swap(1, 2);
            }
        }
        right_side_up.push(up);
    }
    PatternMesh {
        x_bar,
        triangles,
        panel_vertices: islands.panel_vertices.clone(),
        panel_triangles: islands.panel_triangles.clone(),
        right_side_up,
        edge_vertices: Vec::new(),
        sewing: islands.sewing.clone(),
        cloth_vertex_count: islands.cloth.len(),
    }
}

/// The rigid placement of panel `k` nearest to its drape, in the least squares (Kabsch 1976).
fn beside_the_drape(mesh: &PatternMesh, drape: &[Vec3], k: usize) -> Placement {
    let range = mesh.panel_vertices[k].clone();
    let count = range.len() as f64;
    let flat = |v: usize| Vec3::new(mesh.x_bar[v].x, mesh.x_bar[v].y, 0.0);
    let draped = |v: usize| drape[mesh.sewing[v] as usize];
    let flat_mean = range.clone().map(flat).sum::<Vec3>() / count;
    let draped_mean = range.clone().map(draped).sum::<Vec3>() / count;
    let covariance: Mat3 = range
        .map(|v| (draped(v) - draped_mean) * (flat(v) - flat_mean).transpose())
        .sum();
    let svd = covariance.svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        unreachable!("both were asked for");
    };
    let handed = Mat3::from_diagonal(&Vec3::new(1.0, 1.0, (u * v_t).determinant()));
    let rotation = u * handed * v_t;
    Placement {
        rotation,
        translation: draped_mean - rotation * flat_mean,
    }
}

#[cfg(test)]
mod tests;
