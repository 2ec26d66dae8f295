//! `dress check-gradient`.

mod plot;

use crate::arguments::CheckGradientArguments;
use crate::failure::Failure;
use crate::fitting::Inputs;
use crate::progress::{Progress, stop_on_ctrl_c};
use anyhow::Context;
use dress_anyone::io::output::Output;
use dress_anyone::refit::gradient_check::{
    GradientCheck, Line, TRUSTED, check_gradient, loss_along,
};
use std::fmt::Write;
use std::path::Path;
use std::sync::atomic::Ordering;

/// Part of a change of the loss to which the slopes at both ends must tell it.
const PLOT_TRUSTED: f64 = 0.05;
/// Points of a plot on either side.
const POINTS: usize = 40;

/// Compares; the table, or where the plot is.
pub fn run(arguments: &CheckGradientArguments) -> Result<String, Failure> {
    let mut progress = Progress::new(arguments.fitting.pair.running.quiet);
    let inputs = Inputs::read(
        &arguments.fitting.pair,
        arguments.fitting.params(),
        None,
        &mut progress,
    )?;
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let garment = &inputs.loaded.garment;
    let bodies = [&inputs.source, &inputs.target];
    let params = &inputs.params.refit;
    let mut observe = |event: &_| {
        progress.event(event);
        !stop.load(Ordering::SeqCst)
    };
    if let Some(plot) = &arguments.plot {
        let reach = (1e-3 * arguments.reach, POINTS);
        let line = loss_along(garment, bodies, params, reach, &mut observe);
        progress.close();
        let line = line.map_err(|error| inputs.failure(error))?;
        let title = format!("{}: loss by farthest move of the pattern", garment.name);
        let mut output = Output::new(plot.parent().unwrap_or(Path::new("")));
        let name = plot.file_name().context("a plot is a file")?;
        output.add(name.to_string_lossy(), plot::svg(&title, &line));
        output.write()?;
        return Ok(told(&line, plot));
    }
    let count = arguments.directions.get();
    let checked = check_gradient(garment, bodies, params, count, &mut observe);
    progress.close();
    let checked = checked.map_err(|error| inputs.failure(error))?;
    Ok(table(&garment.name, &checked))
}

/// How far loss and slopes go together, in a sentence.
fn told(line: &Line, plot: &Path) -> String {
    let all = line.steps().count();
    let agreeing = line.steps().filter(|off| *off < PLOT_TRUSTED).count();
    format!(
        "From point to point the loss changes as the slopes say, to {PLOT_TRUSTED} of it, in {agreeing} of {all} \
         steps of {} mm.\nWritten to {}\n",
        millimetres(line.moves[1] - line.moves[0]),
        plot.display()
    )
}

/// A row for each direction and step.
fn table(garment: &str, checked: &GradientCheck) -> String {
    let mut text = format!(
        "{garment}: loss {:.6}, force residual {:.1e}, {} unknowns\n\n\
         direction  farthest move    predicted     measured   difference\n\
        \x20                      [mm]        [1/m]        [1/m]          [-]\n",
        checked.loss, checked.residual, checked.unknowns
    );
    for (number, direction) in checked.directions.iter().enumerate() {
        let measured = checked.steps.iter().zip(&direction.measured);
        for ((step, slope), difference) in measured.zip(direction.differences()) {
            let or_none = |value: Option<String>| value.unwrap_or_else(|| "no drape".to_owned());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{:>9}  {:>13}  {:>11.5}  {:>11}  {:>11}",
                number + 1,
                millimetres(*step),
                direction.predicted,
                or_none(slope.map(|slope| format!("{slope:.5}"))),
                or_none(difference.map(|difference| format!("{difference:.1e}"))),
            );
        }
    }
    let trust = match checked.trust {
        Some(step) => format!(
            "All agree to {TRUSTED} for moves of the pattern up to {} mm.",
            millimetres(step)
        ),
        None => format!("At no step do all agree to {TRUSTED}."),
    };
    text + "\n" + &trust + "\n"
}

/// To the nanometre, so that what is short in metres is short in millimetres.
fn millimetres(metres: f64) -> f64 {
    (metres * 1e9).round() / 1e6
}
