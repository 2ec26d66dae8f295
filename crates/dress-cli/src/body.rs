//! `dress body`: bodies drawn at random, shown, fitted, posed and measured.

pub mod arguments;
mod fit;
mod pose;
mod sample;
mod show;
mod table;

use crate::failure::Failure;
use crate::picture::Figure;
use arguments::{BodyCommand, ModelArguments, SubjectArguments};
use dress_anyone::body::Body;
use dress_anyone::body_model::BodyModel;
use dress_anyone::body_model::fit::{Fit, Landmarks};
use dress_anyone::body_model::measure::Measurement;
use dress_anyone::geometry::{TriangleMesh, Vec3};
use dress_anyone::io::{self, body_model};
use dress_anyone::problem::{BadInput, Problem};
use std::fmt::Write;
use std::path::Path;

/// Does what was asked; what to say about it in the end.
pub fn run(command: &BodyCommand) -> Result<String, Failure> {
    match command {
        BodyCommand::Sample(arguments) => sample::run(arguments),
        BodyCommand::Show(arguments) => show::run(arguments),
        BodyCommand::Pose(arguments) => pose::run(arguments),
        BodyCommand::Measure(arguments) => {
            let subject = &arguments.subject;
            crate::set_threads(&subject.running)?;
            let (model, body) = read(subject)?;
            let fit = fitted(&model, &body, subject)?;
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

/// The model and the body it is to be fitted to.
fn read(subject: &SubjectArguments) -> Result<(BodyModel, Body), Failure> {
    let body = io::body::read(&subject.file.file, &subject.file.options())?;
    Ok((model(&subject.model)?, body))
}

/// The model fitted to the file's body.
fn fitted(model: &BodyModel, body: &Body, subject: &SubjectArguments) -> Result<Fit, Failure> {
    let landmarks = landmarks(model, body, subject.landmarks.as_deref())?;
    let fit = dress_anyone::body_model::fit::fit(model, &body.mesh, &landmarks);
    Ok(fit.map_err(|problems| BadInput::new(&subject.file.file, problems))?)
}

/// The landmarks in a TOML file, which has them in the unit and axes of the body's file; none
/// without a file.
pub fn landmarks(
    model: &BodyModel,
    body: &Body,
    path: Option<&Path>,
) -> Result<Landmarks, BadInput> {
    let Some(path) = path else {
        return Ok(Landmarks::default());
    };
    let no_place = Vec3::repeat(f64::NAN);
    let named: Vec<(String, Vec3)> = table::vectors(path, "landmarks")?
        .into_iter()
        .map(|(name, point)| (name, point.map_or(no_place, |p| body.frame.to_si(p))))
        .collect();
    if named.is_empty() {
        let problem = Problem::at("table `[landmarks]`", "there is no landmark in it");
        return Err(BadInput::one(path, problem));
    }
    Landmarks::new(model, &body.mesh, &named).map_err(|problems| BadInput::new(path, problems))
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
