//! `dress transfer`.

use crate::arguments::TransferArguments;
use crate::correspond::How;
use crate::failure::Failure;
use crate::fitting::Inputs;
use crate::inputs::InputReport;
use crate::params::Params;
use crate::picture::View;
use crate::progress::{Progress, stop_on_ctrl_c};
use crate::refit::json;
use crate::show::{Shown, contact_sheet};
use anyhow::Context;
use dress_anyone::io::output::Output;
use dress_anyone::io::{body, garment_obj, paint};
use dress_anyone::refit::transfer::{Transfer, TransferReport, transfer};
use dress_anyone::transfer::Paint;
use serde::Serialize;
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::Ordering;

/// The report with what led to it.
#[derive(Serialize)]
struct Report<'a> {
    garment: InputReport,
    source_body: InputReport,
    target_body: InputReport,
    correspondence: &'a How,
    parameters: &'a Params,
    version: &'static str,
    #[serde(flatten)]
    transfer: &'a TransferReport,
}

/// Carries the garment over; what to say about it in the end.
pub fn run(arguments: &TransferArguments) -> Result<String, Failure> {
    let quiet = arguments.pair.running.quiet;
    let mut progress = Progress::new(quiet);
    let inputs = Inputs::read(
        &arguments.pair,
        arguments.design.over(arguments.pair.reading.params()),
        Some(&arguments.out),
        &mut progress,
    )?;
    let paint = match &arguments.ease_paint {
        Some(file) => {
            let (points, kappa) = paint::read(file)?;
            Some(Paint { points, kappa })
        }
        None => None,
    };
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let carried = transfer(
        &inputs.loaded.garment,
        paint.as_ref(),
        [&inputs.source, &inputs.target],
        &inputs.params.refit,
        &mut |event| {
            progress.event(event);
            !stop.load(Ordering::SeqCst)
        },
    );
    progress.close();
    let carried = carried.map_err(|error| inputs.failure(error))?;
    results(&arguments.out, &inputs, &carried)?.write()?;
    if quiet {
        return Ok(String::new());
    }
    let names = [&inputs.source.name, &inputs.target.name];
    let (garment, out) = (&inputs.loaded.garment.name, arguments.out.display());
    let [from, to] = names;
    Ok(format!(
        "{garment}: carried from {from} to {to}\n{}Written to {out}\n",
        summary(&carried.report)
    ))
}

/// All files of a transfer, in the unit and axes of the target body's.
fn results(out: &Path, inputs: &Inputs<'_>, carried: &Transfer) -> Result<Output, Failure> {
    let garment = &inputs.loaded.garment;
    let (mesh, frame) = (&garment.mesh, inputs.target.frame);
    let title = format!("{}, carried to {}", garment.name, inputs.target.name);
    let shown = |caption, body, x| Shown {
        caption,
        body,
        x,
        aim: None,
    };
    let [on_source, on_target] = [&inputs.source.mesh, &inputs.target.mesh];
    let drapes = [
        shown("on the source body", on_source, &carried.source_drape[..]),
        shown("target shape", on_target, &carried.x_star),
    ];
    let [name, source, target] = inputs.names;
    let report = Report {
        garment: InputReport::of_garment(name, &inputs.loaded),
        source_body: InputReport::of_body(source, &inputs.source),
        target_body: InputReport::of_body(target, &inputs.target),
        correspondence: &inputs.how,
        parameters: &inputs.params,
        version: env!("CARGO_PKG_VERSION"),
        transfer: &carried.report,
    };
    let mut output = Output::new(out);
    output.add(
        "target.obj",
        garment_obj::write(garment, &mesh.x_bar, &carried.x_star, frame),
    );
    output.add("body.obj", body::write(&inputs.target));
    let views = [View::Front, View::Back, View::ThreeQuarter];
    output.add("preview.png", contact_sheet(&title, mesh, &drapes, &views));
    output.add("report.json", json(&report)?);
    Ok(output)
}

/// How well the design was kept, in a few lines.
fn summary(report: &TransferReport) -> String {
    let mut text = String::new();
    let mut line = |label: &str, value: String| {
        let _ = writeln!(text, "  {label:<16} {value}");
    };
    let [low, high] = report.stretch;
    line(
        "stretch",
        format!(
            "{:.2} to {:.2} for most, {:.2} to {:.2} at worst",
            low.low, high.high, low.least, high.most
        ),
    );
    let [before, after] = report.through_itself;
    line(
        "intersections",
        format!(
            "{} pairs of triangles of cloth and body, {after} of cloth and cloth (before: {before})",
            report.through_body
        ),
    );
    line("turned over", format!("{} triangles", report.turned_over));
    let [seams, rims] = [report.seam_curvature, report.rim_curvature]
        .map(|[before, after]| format!("{after:.1} (before: {before:.1})"));
    line("curvature [1/m]", format!("seams {seams}, rims {rims}"));
    if report.kept > 0.0 {
        line("kept lengths", format!("within {:.1} %", 1e2 * report.kept));
    }
    let [before, after] = report.asymmetry.map(|metres| 1e3 * metres);
    line(
        "mirrored panels",
        format!("{after:.1} mm apart at most (before: {before:.1})"),
    );
    let seconds: f64 = (report.stages.iter())
        .filter(|stage| stage.stage == "target shape")
        .map(|stage| stage.seconds)
        .sum();
    line(
        "rounds",
        format!(
            "{}{}, {seconds:.1} s",
            report.iterations,
            if report.converged {
                ""
            } else {
                ", not converged"
            }
        ),
    );
    let _ = writeln!(
        text,
        "  {:<24} {:>26}  {:>26}",
        "panel", "distance before [mm]", "after"
    );
    for spacing in &report.spacing {
        let spread = [spacing.before, spacing.after].map(|s| {
            let [low, median, high] = [s.low, s.median, s.high].map(|metres| 1e3 * metres);
            format!("{low:.1} / {median:.1} / {high:.1}")
        });
        let _ = writeln!(
            text,
            "  {:<24} {:>26}  {:>26}",
            spacing.panel, spread[0], spread[1]
        );
    }
    text
}
