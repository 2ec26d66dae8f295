//! `dress drape`.

use crate::arguments::DrapeArguments;
use crate::failure::Failure;
use crate::frames::Frames;
use crate::inputs::{Gathering, Input, InputReport, note_placement};
use crate::params::Params;
use crate::picture::{View, pattern_png};
use crate::progress::{Progress, stop_on_ctrl_c};
use crate::refit::json;
use crate::show::{Shown, contact_sheet};
use crate::summary;
use anyhow::Context;
use dress_anyone::body::Body;
use dress_anyone::garment::Garment;
use dress_anyone::geometry::Vec3;
use dress_anyone::io::garment::Loaded;
use dress_anyone::io::output::{Output, check_writable};
use dress_anyone::io::{garment_obj, svg};
use dress_anyone::problem::{BadInput, Problem};
use dress_anyone::refit::dress::drape_on;
use dress_anyone::refit::{RefitError, accept, drape_report};
use dress_anyone::report::DrapeReport;
use dress_anyone::sim::equilibrium::RestStatus;
use dress_anyone::sim::{Drape, Solver};
use serde::Serialize;
use std::path::Path;
use std::sync::atomic::Ordering;
use std::time::Instant;

/// What happened.
#[derive(Serialize)]
struct Report<'a> {
    garment: InputReport,
    body: InputReport,
    parameters: &'a Params,
    version: &'static str,
    /// Cloth vertices and triangles.
    size: [usize; 2],
    #[serde(flatten)]
    drape: DrapeReport,
    iterations: usize,
    seconds: f64,
}

/// Drapes; what to say about it in the end.
pub fn run(arguments: &DrapeArguments) -> Result<String, Failure> {
    let (params, loaded, body) = read(arguments)?;
    let garment = &loaded.garment;
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let mut progress = Progress::new(arguments.running.quiet);
    progress.notes(&garment.name, &loaded.notes);
    progress.notes(&body.name, &body.notes);
    progress.stage("drape");
    let start = Instant::now();
    let refit = &params.refit;
    let mut frames = Frames::default();
    let found = drape_on(garment, &body, refit, &mut |event, x| {
        progress.drape(event);
        if arguments.frames.is_some() {
            frames.see(event, x());
        }
        !stop.load(Ordering::SeqCst)
    });
    let seconds = start.elapsed().as_secs_f64();
    progress.close();
    if let Some(folder) = &arguments.frames {
        frames.write(&found.x, garment, &body, folder)?;
    }
    let accepted = accept(&found, garment, &body);
    if found.status == RestStatus::Stopped && accepted.is_err() {
        return Err(RefitError::Stopped.into());
    }

    let mesh = &garment.mesh;
    let report = Report {
        garment: InputReport::of_garment(Input::File(&arguments.garment), &loaded),
        body: InputReport::of_body(Input::File(&arguments.body), &body),
        parameters: &params,
        version: env!("CARGO_PKG_VERSION"),
        size: [mesh.cloth_vertex_count, mesh.triangles.len()],
        drape: drape_report(mesh, &mesh.x_bar, &found.x, &body, Some(&found)),
        iterations: found.iterations,
        seconds,
    };
    // What did not come to rest is worth a look, too.
    results(arguments, &loaded, &body, &found, &report)?.write()?;
    let steps_alone = refit.sim.solver == Solver::Xpbd && found.residual.is_finite();
    if !steps_alone {
        accepted?;
    }
    if arguments.running.quiet {
        return Ok(String::new());
    }
    let ending = if steps_alone {
        format!(
            "stepped, its net force {:.1e} of its weight",
            found.residual
        )
    } else {
        summary::rest(report.drape.status).to_owned()
    };
    let held = if found.friction == refit.sim.contact.friction {
        String::new()
    } else {
        format!("Without friction it slides; {} holds it.\n", found.friction)
    };
    Ok(format!(
        "The drape is {ending} after {seconds:.1} s.\n{held}{}Written to {}\n",
        summary::penetration(&report.drape),
        arguments.out.display()
    ))
}

/// Reads all inputs before complaining of any.
fn read(arguments: &DrapeArguments) -> Result<(Params, Loaded, Body), Failure> {
    let mut gathering = Gathering::default();
    let params = gathering.take(arguments.params());
    let options = arguments
        .reading
        .garment(params.as_ref().unwrap_or(&Params::default()));
    let loaded = gathering.take(Input::File(&arguments.garment).garment(&options));
    let body = gathering.take(Input::File(&arguments.body).body(&arguments.reading.body()));
    let from = arguments.from.as_ref().map(|file| {
        let start = gathering.take(Input::File(file).garment(&options))?;
        Some((file, start.garment))
    });
    gathering.take(check_writable(&arguments.out));
    if let Some(folder) = &arguments.frames {
        gathering.take(check_writable(folder));
    }
    gathering.finish()?;
    let all = params.zip(loaded).zip(body);
    let ((params, mut loaded), body) = all.expect("nothing was wrong with any of them");
    if let Some((file, start)) = from.flatten() {
        loaded.garment.drape = Some(same_mesh(&loaded.garment, file, start)?);
    }
    let problems = params.refit.problems(&loaded.garment.pattern);
    if !problems.is_empty() {
        return Err(BadInput::new(&arguments.garment, problems).into());
    }
    note_placement(&mut loaded, &body);
    Ok((params, loaded, body))
}

/// The drape of `start`, read from `file`, for a garment that must have the same mesh.
pub fn same_mesh(garment: &Garment, file: &Path, start: Garment) -> Result<Vec<Vec3>, Failure> {
    let same = start.mesh.cloth_triangles() == garment.mesh.cloth_triangles();
    let bad = |text: &str| Failure::Inputs(vec![BadInput::one(file, Problem::whole(text))]);
    match start.drape {
        Some(x) if same => Ok(x),
        Some(_) => Err(bad(
            "this is no drape of the same mesh: it must be one of the same garment at the same \
             resolution, as `dress drape` and `dress transfer` write them",
        )),
        None => Err(bad(
            "this has no drape to start from: an OBJ has, a pattern has not",
        )),
    }
}

/// All files of a drape, in the unit and axes of the body's.
fn results(
    arguments: &DrapeArguments,
    loaded: &Loaded,
    body: &Body,
    found: &Drape,
    report: &Report<'_>,
) -> Result<Output, Failure> {
    let (garment, mesh) = (&loaded.garment, &loaded.garment.mesh);
    let title = format!("{} on {}", garment.name, body.name);
    let placed = garment.drape.clone().unwrap_or_else(|| garment.placed());
    let shown = |caption, x| Shown {
        caption,
        body: &body.mesh,
        x,
        aim: None,
    };
    let mut output = Output::new(&arguments.out);
    output.add(
        "garment.obj",
        garment_obj::write(garment, &mesh.x_bar, &found.x, body.frame),
    );
    output.add(
        "pattern.svg",
        svg::pattern_svg(&garment.pattern, &garment.pattern, &garment.name),
    );
    let drapes = [shown("as it came", &placed[..]), shown("draped", &found.x)];
    let views = [View::Front, View::Back, View::ThreeQuarter];
    output.add("preview.png", contact_sheet(&title, mesh, &drapes, &views));
    let panels = garment.pattern.panels.iter();
    let names: Vec<&str> = panels.map(|panel| panel.name.as_str()).collect();
    output.add("mesh.png", pattern_png(mesh, &mesh.x_bar, &names));
    output.add("report.json", json(report)?);
    Ok(output)
}
