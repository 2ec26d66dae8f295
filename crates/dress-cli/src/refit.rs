//! `dress refit`.

use crate::arguments::{PoseChoice, RefitArguments};
use crate::checkpoint;
use crate::correspond::How;
use crate::drape::same_mesh;
use crate::failure::Failure;
use crate::fitting::Inputs;
use crate::inputs::{Input, InputReport};
use crate::params::Params;
use crate::picture::View;
use crate::progress::{Progress, stop_on_ctrl_c};
use crate::show::{Shown, contact_sheet};
use crate::summary;
use anyhow::Context;
use dress_anyone::body::Body;
use dress_anyone::garment::Garment;
use dress_anyone::geometry::{TriangleMesh, Vec3};
use dress_anyone::io::output::Output;
use dress_anyone::io::{body, garment_obj, garmentcode, obj, svg};
use dress_anyone::refit::dress::drape_on;
use dress_anyone::refit::{self, Given, Refit, RefitError, accept, refit_from};
use dress_anyone::report::Report;
use dress_anyone::transfer::{Layout, target_shape};
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::Ordering;

/// Refits; what to say about it in the end.
pub fn run(arguments: &RefitArguments) -> Result<String, Failure> {
    let quiet = arguments.fitting.pair.running.quiet;
    let mut progress = Progress::new(quiet);
    let inputs = Inputs::read(
        &arguments.fitting.pair,
        arguments.fitting.params(),
        Some(&arguments.out),
        &mut progress,
    )?;
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let folder = arguments.resume.as_ref().or(arguments.checkpoint.as_ref());
    let from = arguments.resume.as_deref().map(checkpoint::read);
    let x_star = match &arguments.target_shape {
        Some(file) => Some(shape(file, arguments, &inputs)?),
        None => None,
    };
    let given = Given {
        x_star,
        checkpoint: from.transpose()?,
    };
    let refitted = refit_from(
        &inputs.loaded.garment,
        &inputs.source,
        &inputs.target,
        &inputs.params.refit,
        given,
        &mut |event| {
            progress.event(event);
            if let (refit::Progress::Checkpoint(state), Some(folder)) = (event, folder)
                && let Err(failure) = checkpoint::write(folder, state)
            {
                progress.notes("checkpoint", &[failure.to_string()]);
            }
            !stop.load(Ordering::SeqCst)
        },
    );
    progress.close();
    let refitted = refitted.map_err(|error| inputs.failure(error))?;
    results(arguments, &inputs, &refitted)?.write()?;
    if quiet {
        return Ok(String::new());
    }
    Ok(summary::of(&refitted.report, &arguments.out))
}

/// The shape to aim for that `file` holds.
fn shape(
    file: &Path,
    arguments: &RefitArguments,
    inputs: &Inputs<'_>,
) -> Result<Vec<Vec3>, Failure> {
    let options = arguments.fitting.pair.reading.garment(&inputs.params);
    let read = Input::File(file).garment(&options)?;
    same_mesh(&inputs.loaded.garment, file, read.garment)
}

/// All files of a refit, in the unit and axes of the target body's.
fn results(
    arguments: &RefitArguments,
    inputs: &Inputs<'_>,
    refitted: &Refit,
) -> Result<Output, Failure> {
    let frame = inputs.target.frame;
    let before = &inputs.loaded.garment;
    let mut after = Garment {
        pattern: refitted.pattern.clone(),
        ..before.clone()
    };
    after.mesh.x_bar.clone_from(&refitted.x_bar);
    let triangles = before.mesh.outward_triangles();
    let shape = |title: &str, x: &[Vec3]| {
        let mesh = TriangleMesh {
            positions: x.to_vec(),
            triangles: triangles.clone(),
        };
        obj::mesh_text(&format!("{title} {}", before.name), &mesh, frame)
    };
    let specification = inputs.loaded.specification.as_ref();
    let pattern = garmentcode::write(&after.pattern, specification);
    let garment = garment_obj::write(&after, &refitted.x_bar, &refitted.x, frame);
    let title = format!("{}, refitted to {}", before.name, inputs.target.name);

    let mut output = Output::new(&arguments.out);
    output.add("pattern.json", json(&pattern)?);
    output.add("garment.obj", garment);
    output.add("target.obj", shape("target shape of", &refitted.x_star));
    output.add("initial.obj", shape("initial guess of", &refitted.initial));
    output.add("body.obj", body::write(&inputs.target));
    if arguments.pose == PoseChoice::Own {
        let (drape, body) = in_own_pose(inputs, &after, refitted)?;
        let garment = garment_obj::write(&after, &refitted.x_bar, &drape, frame);
        output.add("own_pose_garment.obj", garment);
        output.add("own_pose_body.obj", body::write(&body));
    }
    output.add(
        "pattern.svg",
        svg::pattern_svg(&before.pattern, &after.pattern, &title),
    );
    output.add("preview.png", picture(&title, inputs, refitted));
    output.add("report.json", json(&full_report(inputs, &refitted.report))?);
    Ok(output)
}

/// The refitted garment on the target as it stands in its file: carried over and draped there.
fn in_own_pose(
    inputs: &Inputs<'_>,
    garment: &Garment,
    refitted: &Refit,
) -> Result<(Vec<Vec3>, Body), Failure> {
    let body = Body {
        mesh: inputs.target_own.clone(),
        ..inputs.target.clone()
    };
    let params = &inputs.params.refit;
    let layout = Layout::of(garment, &params.transfer).map_err(RefitError::Garment)?;
    let carried = target_shape(
        &refitted.x,
        &layout,
        &inputs.target,
        &body,
        &params.transfer,
    )
    .map_err(RefitError::from)?;
    let there = Garment {
        drape: Some(carried.x_star),
        ..garment.clone()
    };
    let found = drape_on(&there, &body, params, &mut |_, _| true);
    accept(&found, &there, &body)?;
    Ok((found.x, body))
}

/// Pretty JSON with a line end.
pub fn json(value: &impl Serialize) -> anyhow::Result<String> {
    let text = serde_json::to_string_pretty(value).context("a result cannot be told as JSON")?;
    Ok(text + "\n")
}

fn picture(title: &str, inputs: &Inputs<'_>, refitted: &Refit) -> Vec<u8> {
    let [source, target] = [&inputs.source.mesh, &inputs.target.mesh];
    let aim = Some(refitted.x_star.as_slice());
    let shown = |caption, body, x, aim| Shown {
        caption,
        body,
        x,
        aim,
    };
    contact_sheet(
        title,
        &inputs.loaded.garment.mesh,
        &[
            shown("on the source body", source, &refitted.source_drape, None),
            shown("target shape", target, &refitted.x_star, None),
            shown("initial guess", target, &refitted.initial, aim),
            shown("refitted", target, &refitted.x, aim),
        ],
        &[View::Front, View::Back],
    )
}

/// The report with what led to it.
#[derive(Serialize)]
struct FullReport<'a> {
    garment: InputReport,
    source_body: InputReport,
    target_body: InputReport,
    correspondence: &'a How,
    parameters: &'a Params,
    #[serde(flatten)]
    report: &'a Report,
}

fn full_report<'a>(inputs: &'a Inputs<'_>, report: &'a Report) -> FullReport<'a> {
    let [garment, source, target] = inputs.names;
    FullReport {
        garment: InputReport::of_garment(garment, &inputs.loaded),
        source_body: InputReport::of_body(source, &inputs.source),
        target_body: InputReport::of_body(target, &inputs.target),
        correspondence: &inputs.how,
        parameters: &inputs.params,
        report,
    }
}
