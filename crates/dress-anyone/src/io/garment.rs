//! Garments from any file that can hold one, told apart by content: a GarmentCode pattern, which is
//! meshed here, or a drape in OBJ whose texture coordinates are its pattern.
//!
//! The edges of an OBJ's pattern come as straight ones along chains of mesh vertices; they are drawn
//! anew as curves ([`crate::pattern::outline`]), while the mesh stays as it is.

use super::garment_obj::{self, UvOptions};
use super::garmentcode::{self, ReadOptions, RotationOrder, Specification};
use super::{kind, source};
use crate::body::FileFrame;
use crate::garment::Garment;
use crate::pattern::outline::{TOLERANCE, refit_outlines};
use crate::pattern::{Curve, triangulate, validate};
use crate::problem::{BadInput, Problem};
use std::path::Path;

/// What a file leaves open.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GarmentOptions {
    /// Length of mesh edges where a pattern has to be meshed \[m\].
    pub resolution: f64,
    /// How the angles of a GarmentCode panel combine.
    pub rotation: RotationOrder,
    /// Unit, axes and texture scale of an OBJ.
    pub uv: UvOptions,
}

/// A garment, and how its file had it.
#[derive(Clone, Debug)]
pub struct Loaded {
    /// The garment, SI.
    pub garment: Garment,
    /// Unit and axes of an OBJ's drape.
    pub frame: Option<FileFrame>,
    /// The GarmentCode document, for writing back.
    pub specification: Option<Specification>,
    /// What was found, guessed and tolerated.
    pub notes: Vec<String>,
}

/// Reads the garment in the file at `path`, or says everything that is wrong with it.
pub fn read(path: &Path, options: &GarmentOptions) -> Result<Loaded, BadInput> {
    parse(path, &source::bytes(path)?, options)
}

/// The garment in `bytes`; `file` gives it its name.
pub fn parse(file: &Path, bytes: &[u8], options: &GarmentOptions) -> Result<Loaded, BadInput> {
    let extension = file.extension().unwrap_or_default().to_ascii_lowercase();
    match kind::of(bytes) {
        Some("an OBJ mesh") => from_obj(file, bytes, &options.uv),
        Some("a JSON document") => from_pattern(file, bytes, options),
        None if extension == "obj" => from_obj(file, bytes, &options.uv),
        None if extension == "json" => from_pattern(file, bytes, options),
        found => {
            let found = found.unwrap_or("nothing that is known here");
            let text = format!(
                "this looks like {found}; a garment is a GarmentCode pattern (JSON), or a drape \
                 in OBJ whose texture coordinates are its pattern"
            );
            Err(BadInput::one(file, Problem::whole(text)))
        }
    }
}

fn from_pattern(file: &Path, bytes: &[u8], options: &GarmentOptions) -> Result<Loaded, BadInput> {
    let rotation = options.rotation;
    let specification = garmentcode::parse(file, bytes, &ReadOptions { rotation })?;
    let mesh = triangulate::mesh(&specification.pattern, options.resolution)
        .map_err(|problems| BadInput::new(file, problems))?;
    let garment = Garment {
        name: source::stem(file),
        pattern: specification.pattern.clone(),
        mesh,
        drape: None,
    };
    Ok(Loaded {
        garment,
        frame: None,
        notes: specification.notes.clone(),
        specification: Some(specification),
    })
}

fn from_obj(file: &Path, bytes: &[u8], options: &UvOptions) -> Result<Loaded, BadInput> {
    let mut read = garment_obj::parse(file, bytes, options)?;
    draw_curves(&mut read.garment, &mut read.notes);
    let problems = validate::problems(&read.garment.pattern);
    if !problems.is_empty() {
        return Err(BadInput::new(file, problems));
    }
    Ok(Loaded {
        garment: read.garment,
        frame: Some(read.frame),
        specification: None,
        notes: read.notes,
    })
}

/// Replaces straight edges by curves where the mesh is not straight; a curve that is known stays.
fn draw_curves(garment: &mut Garment, notes: &mut Vec<String>) {
    let mesh = &garment.mesh;
    let drawn = refit_outlines(&garment.pattern, mesh, &mesh.x_bar, TOLERANCE);
    let panels = garment.pattern.panels.iter_mut();
    for ((panel, new), missed) in panels.zip(drawn.pattern.panels).zip(drawn.residuals) {
        panel.vertices = new.vertices;
        let edges = panel.edges.iter_mut().zip(new.edges).zip(missed);
        for (e, ((edge, new), missed)) in edges.enumerate() {
            if edge.curve != Curve::Line {
                continue;
            }
            edge.curve = new.curve;
            if missed > TOLERANCE {
                notes.push(format!(
                    "panel `{}`, edge {e}: no curve follows the outline closer than {:.1} mm",
                    panel.name,
                    1e3 * missed
                ));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::{Mat3, Vec2, Vec3};
    use crate::pattern::{Edge, Panel, Pattern, Placement};

    const OPTIONS: GarmentOptions = GarmentOptions {
        resolution: 0.05,
        rotation: RotationOrder::Extrinsic,
        uv: UvOptions {
            uv_scale: None,
            metres_per_unit: None,
            up: None,
        },
    };

    /// A square apron of 0.5 m with a rounded hem, meshed, hanging flat.
    fn apron() -> Garment {
        let corners = [(0.0, 0.5), (0.0, 0.0), (0.5, 0.0), (0.5, 0.5)];
        let edge = |start: usize| Edge {
            start,
            end: (start + 1) % 4,
            curve: if start == 1 {
                Curve::Quadratic(Vec2::new(0.25, -0.1))
            } else {
                Curve::Line
            },
            label: None,
        };
        let pattern = Pattern {
            panels: vec![Panel {
                name: "apron".into(),
                vertices: corners.map(|(x, y)| Vec2::new(x, y)).to_vec(),
                edges: (0..4).map(edge).collect(),
                placement: Placement {
                    rotation: Mat3::identity(),
                    translation: Vec3::new(-0.25, 0.6, 0.2),
                },
                label: None,
            }],
            stitches: vec![],
        };
        let mesh = triangulate::mesh(&pattern, 0.05).unwrap();
        let mut garment = Garment {
            name: "apron".into(),
            pattern,
            mesh,
            drape: None,
        };
        garment.drape = Some(garment.placed());
        garment
    }

    fn obj_text(garment: &Garment) -> String {
        let drape = garment.drape.as_deref().unwrap();
        garment_obj::write(garment, &garment.mesh.x_bar, drape, FileFrame::SI)
    }

    #[test]
    fn the_content_decides_and_not_the_extension() {
        let garment = apron();
        let text = garmentcode::write(&garment.pattern, None).to_string();
        let pattern = parse(Path::new("a.obj"), text.as_bytes(), &OPTIONS).unwrap();
        assert!(pattern.specification.is_some() && pattern.garment.drape.is_none());
        let drape = parse(Path::new("b.json"), obj_text(&garment).as_bytes(), &OPTIONS).unwrap();
        assert!(drape.specification.is_none() && drape.garment.drape.is_some());
        let error = parse(Path::new("c.obj"), b"ply\nformat ascii 1.0\n", &OPTIONS).unwrap_err();
        assert!(error.to_string().contains("looks like a PLY mesh"));
    }

    #[test]
    fn a_rounded_hem_is_a_curve_again_though_the_obj_has_only_points() {
        let garment = apron();
        let bare: String = obj_text(&garment)
            .lines()
            .filter(|line| !line.starts_with('#'))
            .flat_map(|line| [line, "\n"])
            .collect();
        let read = parse(Path::new("apron.obj"), bare.as_bytes(), &OPTIONS).unwrap();
        let panel = &read.garment.pattern.panels[0];
        assert!(panel.edges.iter().any(|edge| edge.curve != Curve::Line));
        // The parabola's segment has two thirds of its triangle, 0.05 m high as drawn.
        let area = 0.25 + 0.5 * 0.05 * 2.0 / 3.0;
        // Half a millimetre along the hem of half a metre.
        assert!((panel.signed_area().abs() - area).abs() < 2.5e-4);
    }
}
