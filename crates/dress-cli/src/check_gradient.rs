//! `dress check-gradient`.

use crate::arguments::CheckGradientArguments;
use crate::failure::Failure;
use crate::fitting::Inputs;
use crate::progress::{Progress, stop_on_ctrl_c};
use anyhow::Context;
use dress_anyone::refit::gradient_check::{GradientCheck, TRUSTED, check_gradient};
use std::fmt::Write;
use std::sync::atomic::Ordering;

/// Compares; the table.
pub fn run(arguments: &CheckGradientArguments) -> Result<String, Failure> {
    let mut progress = Progress::new(arguments.fitting.pair.running.quiet);
    let inputs = Inputs::read(
        &arguments.fitting.pair,
        arguments.fitting.params(),
        None,
        &mut progress,
    )?;
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let checked = check_gradient(
        &inputs.loaded.garment,
        &inputs.source,
        &inputs.target,
        &inputs.params.refit,
        arguments.directions.get(),
        &mut |event| {
            progress.event(event);
            !stop.load(Ordering::SeqCst)
        },
    );
    progress.close();
    let checked = checked.map_err(|error| inputs.failure(error))?;
    Ok(table(&inputs.loaded.garment.name, &checked))
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
