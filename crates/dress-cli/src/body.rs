//! `dress body`: bodies drawn at random, shown, fitted, posed and measured.

pub mod arguments;
mod fit;
mod pose;
mod sample;
mod show;

use crate::failure::Failure;
use crate::picture::Figure;
use arguments::{BodyCommand, FileArguments, ModelArguments};
use dress_anyone::body::Body;
use dress_anyone::body_model::BodyModel;
use dress_anyone::body_model::fit::Fit;
use dress_anyone::body_model::measure::Measurement;
use dress_anyone::geometry::TriangleMesh;
use dress_anyone::io::{self, body_model};
use dress_anyone::problem::BadInput;
use std::fmt::Write;

/// Does what was asked; what to say about it in the end.
pub fn run(command: &BodyCommand) -> Result<String, Failure> {
    match command {
        BodyCommand::Sample(arguments) => sample::run(arguments),
        BodyCommand::Show(arguments) => show::run(arguments),
        BodyCommand::Pose(arguments) => pose::run(arguments),
        BodyCommand::Measure(arguments) => {
            crate::set_threads(&arguments.running)?;
            let (model, body) = read(&arguments.model, &arguments.file)?;
            let fit = fitted(&model, &body, &arguments.file)?;
            Ok(measurements_text(&fit.measurements(&model)))
        }
        BodyCommand::Fit(arguments) => fit::run(arguments),
    }
}

/// The model that was asked for.
pub fn model(arguments: &ModelArguments) -> Result<BodyModel, BadInput> {
    let file = arguments.model.as_deref();
    file.map_or_else(|| Ok(body_model::built_in()), body_model::read)
}

fn read(arguments: &ModelArguments, file: &FileArguments) -> Result<(BodyModel, Body), Failure> {
    let body = io::body::read(&file.file, &file.options())?;
    Ok((model(arguments)?, body))
}

/// The model fitted to the file's body.
fn fitted(model: &BodyModel, body: &Body, file: &FileArguments) -> Result<Fit, Failure> {
    let fit = dress_anyone::body_model::fit::fit(model, &body.mesh);
    Ok(fit.map_err(|problems| BadInput::new(&file.file, problems))?)
}

/// A table in centimetres.
fn measurements_text(measurements: &[Measurement]) -> String {
    let mut text = String::new();
    for m in measurements {
        let _ = writeln!(text, "{:10} {:6.1} cm  {}", m.name, 100.0 * m.length, m.how);
    }
    text
}

/// A body without clothes.
fn bare<'a>(caption: &'a str, body: &'a TriangleMesh) -> Figure<'a> {
    Figure {
        caption,
        body,
        cloth_positions: &[],
        cloth_triangles: &[],
        panel_of_triangle: &[],
        seam_edges: &[],
        scalar: None,
    }
}
