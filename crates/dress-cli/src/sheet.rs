//! `dress sheet`: what `dress drape` and `dress transfer` wrote for many garments, in one picture.

use crate::arguments::SheetArguments;
use crate::failure::Failure;
use crate::inputs::{Gathering, Input};
use crate::picture::{Figure, View, panel_of_triangle, seam_edges, tiles};
use dress_anyone::body::Body;
use dress_anyone::garment::Garment;
use dress_anyone::io::body::BodyOptions;
use dress_anyone::io::file::{MEBIBYTE, read_capped};
use dress_anyone::io::garment::GarmentOptions;
use dress_anyone::io::garment_obj::UvOptions;
use dress_anyone::io::garmentcode::RotationOrder;
use dress_anyone::io::json;
use dress_anyone::io::output::{Output, check_writable};
use dress_anyone::problem::{BadInput, Problem};
use std::path::Path;

/// Reports are short.
const LIMIT: u64 = MEBIBYTE;
const NAME: &str = "sheet.png";
/// The program's own drapes leave nothing open; what patterns ask is of no account.
const AS_WRITTEN: GarmentOptions = GarmentOptions {
    resolution: 0.02,
    rotation: RotationOrder::Extrinsic,
    uv: UvOptions {
        uv_scale: None,
        metres_per_unit: None,
        up: None,
    },
};

/// A drape, or a target shape, as its folder has it.
struct Draped {
    name: String,
    note: String,
    garment: Garment,
    body: Body,
}

/// Pictures drapes; what to say about it in the end.
pub fn run(arguments: &SheetArguments) -> Result<String, Failure> {
    let mut gathering = Gathering::default();
    let read: Vec<Option<Draped>> = (arguments.folders.iter())
        .map(|folder| gathering.take(draped(folder)))
        .collect();
    gathering.take(check_writable(&arguments.out));
    gathering.finish()?;
    let drapes: Vec<Draped> = read.into_iter().flatten().collect();
    let lists: Vec<_> = (drapes.iter().map(|drape| &drape.garment.mesh))
        .map(|mesh| {
            (
                mesh.outward_triangles(),
                panel_of_triangle(mesh),
                seam_edges(mesh),
            )
        })
        .collect();
    let figures: Vec<(Figure<'_>, &str)> = (drapes.iter().zip(&lists))
        .map(|(drape, (triangles, panels, seams))| {
            let figure = Figure {
                caption: &drape.name,
                body: &drape.body.mesh,
                cloth_positions: drape.garment.drape.as_deref().unwrap_or_default(),
                cloth_triangles: triangles,
                panel_of_triangle: panels,
                seam_edges: seams,
                scalar: None,
            };
            (figure, drape.note.as_str())
        })
        .collect();
    let views = [View::Front, View::Back];
    let mut output = Output::new(&arguments.out);
    output.add(NAME, tiles(&figures, &views, arguments.columns.get()));
    let written = output.write()?;
    Ok(format!("Picture written to {}\n", written[0].display()))
}

/// Reads a folder that `dress drape` or `dress transfer` wrote.
fn draped(folder: &Path) -> Result<Draped, BadInput> {
    let file = folder.join("report.json");
    let report = json::parse(&file, &read_capped(&file, LIMIT)?)?;
    let foreign = || {
        let text = "this is no report of `dress drape` or `dress transfer`; name the folders that they wrote";
        BadInput::one(&file, Problem::whole(text))
    };
    let text = |value: &serde_json::Value| value.as_str().map(str::to_owned).ok_or_else(foreign);
    let count = |value: &serde_json::Value| value.as_u64().ok_or_else(foreign);
    let through_body = count(&report["through_body"])?;
    let (note, body, cloth) = if report["target_body"].is_object() {
        let through_itself = count(&report["through_itself"][1])?;
        let turned_over = count(&report["turned_over"])?;
        let note = format!("{through_body} / {through_itself}, {turned_over} turned over");
        (note, folder.join("body.obj"), "target.obj")
    } else {
        let through_itself = count(&report["through_itself"])?;
        let status = text(&report["status"])?;
        let note = format!("{status}, {through_body} / {through_itself}");
        let body = text(&report["body"]["file"])?;
        (note, body.into(), "garment.obj")
    };
    let garment = Input::File(&folder.join(cloth))
        .garment(&AS_WRITTEN)?
        .garment;
    Ok(Draped {
        name: folder
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned(),
        note,
        garment,
        body: Input::File(&body).body(&BodyOptions::default())?,
    })
}
