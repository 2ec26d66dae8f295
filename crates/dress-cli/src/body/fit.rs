//! `dress body fit`.

use super::arguments::FitArguments;
use super::{bare, fitted, measurements_text, read};
use crate::failure::Failure;
use crate::inputs::{Input, InputReport};
use crate::picture::{Figure, View, preview};
use crate::progress::Progress;
use crate::refit::json;
use dress_anyone::body::{Body, FileFrame};
use dress_anyone::body_model::fit::{Fit, FitReport};
use dress_anyone::body_model::measure::Measurement;
use dress_anyone::body_model::{BodyModel, Pose, Shape};
use dress_anyone::geometry::{ClosestPoint, TriangleMesh};
use dress_anyone::io::obj;
use dress_anyone::io::output::{Output, check_writable};
use serde::Serialize;

/// What was found, for `fit.json`.
#[derive(Serialize)]
struct Report<'a> {
    body: InputReport,
    model: &'a str,
    #[serde(flatten)]
    fit: &'a FitReport,
    measurements: &'a [Measurement],
    shape: &'a Shape,
    pose: &'a Pose,
}

/// Fits and writes; what to say about it in the end.
pub fn run(arguments: &FitArguments) -> Result<String, Failure> {
    let subject = &arguments.subject;
    crate::set_threads(&subject.running)?;
    let (model, body) = read(subject)?;
    check_writable(&arguments.out)?;
    let mut progress = Progress::new(subject.running.quiet);
    progress.notes(&body.name, &body.notes);
    let fit = fitted(&model, &body, subject)?;
    progress.notes(&body.name, &fit.report.notes);
    let measurements = fit.measurements(&model);
    let report = Report {
        body: InputReport::of_body(Input::File(&subject.file.file), &body),
        model: &model.parts().name,
        fit: &fit.report,
        measurements: &measurements,
        shape: &fit.shape,
        pose: &fit.pose,
    };
    let posed = fit.a_pose(&model);
    let title = |what: &str| format!("{}, {what}", body.name);
    let mut output = Output::new(&arguments.out);
    output.add(
        "fitted.obj",
        obj::mesh_text(&title("fitted"), &fit.mesh, body.frame),
    );
    output.add(
        "posed.obj",
        obj::mesh_text(&title("A-pose"), &posed, FileFrame::SI),
    );
    output.add("fit.json", json(&report)?);
    output.add("fit.png", picture(&model, &body, &fit, &posed));
    output.write()?;
    if subject.running.quiet {
        return Ok(String::new());
    }
    Ok(summary(&body.name, &fit) + &measurements_text(&measurements))
}

/// The scan, shape and pose alone, the fitted surface, and that in the A-pose.
fn picture(model: &BodyModel, body: &Body, fit: &Fit, posed: &TriangleMesh) -> Vec<u8> {
    let scan = ClosestPoint::new(&fit.skin);
    let distances = |mesh: &TriangleMesh| -> Vec<f64> {
        let distance = |p| {
            scan.query(p, f64::INFINITY)
                .map_or(f64::NAN, |foot| foot.distance)
        };
        mesh.positions.iter().map(|p| distance(*p)).collect()
    };
    let (plain, fitted) = (distances(&fit.plain), distances(&fit.mesh));
    let parts = vec![0; model.parts().template.triangles.len()];
    let nobody = TriangleMesh::default();
    let figures = [
        bare("what was fitted", &fit.skin),
        coloured("shape and pose alone", &fit.plain, &plain, &nobody, &parts),
        coloured("fitted", &fit.mesh, &fitted, &nobody, &parts),
        bare("fitted, in the A-pose", posed),
    ];
    preview(&body.name, &figures, &[View::Front, View::Side, View::Back])
}

/// A surface coloured by distances.
fn coloured<'a>(
    caption: &'a str,
    mesh: &'a TriangleMesh,
    scalar: &'a [f64],
    nobody: &'a TriangleMesh,
    parts: &'a [usize],
) -> Figure<'a> {
    Figure {
        caption,
        body: nobody,
        cloth_positions: &mesh.positions,
        cloth_triangles: &mesh.triangles,
        panel_of_triangle: parts,
        seam_edges: &[],
        scalar: Some(scalar),
    }
}

/// How well it fits, in a few lines.
pub fn summary(name: &str, fit: &Fit) -> String {
    let report = &fit.report;
    let line = |f: dress_anyone::body_model::fit::Figures| {
        format!(
            "{:.2} mm on average, 95 % below {:.2}, at most {:.1}",
            1e3 * f.mean,
            1e3 * f.p95,
            1e3 * f.max
        )
    };
    let worst = report.distances.parts.first();
    let worst = worst.map_or(String::new(), |p| {
        format!(
            "  worst part        {}, {:.2} mm\n",
            p.part.in_words(),
            1e3 * p.figures.mean
        )
    });
    format!(
        "{name}: fitted in {:.1} s\n  body to fit       {}\n  fit to body       {}\n  \
         without offsets   {}\n{worst}  flipped faces     {}\n",
        report.seconds,
        line(report.distances.scan_to_fit),
        line(report.distances.fit_to_scan),
        line(report.without_offsets.scan_to_fit),
        report.flipped_faces,
    )
}
