//! `dress sheet`: what `dress drape` wrote for many garments, in one picture.

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

/// A drape as its folder has it.
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

/// Reads a folder that `dress drape` wrote.
fn draped(folder: &Path) -> Result<Draped, BadInput> {
    let file = folder.join("report.json");
    let report = json::parse(&file, &read_capped(&file, LIMIT)?)?;
    let foreign = || {
        let text = "this is no report of `dress drape`; name the folders that it wrote";
        BadInput::one(&file, Problem::whole(text))
    };
    let text = |name: &str, value: &serde_json::Value| {
        value[name].as_str().map(str::to_owned).ok_or_else(foreign)
    };
    let count = |name: &str| report[name].as_u64().ok_or_else(foreign);
    let [through_body, through_itself] = [count("through_body")?, count("through_itself")?];
    let note = format!(
        "{}, {through_body} / {through_itself}",
        text("status", &report)?
    );
    let body = text("file", &report["body"])?;
    let garment = Input::File(&folder.join("garment.obj"))
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
        body: Input::File(Path::new(&body)).body(&BodyOptions::default())?,
    })
}
