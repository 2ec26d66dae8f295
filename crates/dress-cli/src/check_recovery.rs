//! `dress check-recovery`.

use crate::arguments::CheckRecoveryArguments;
use crate::failure::Failure;
use crate::fitting::Inputs;
use crate::progress::{Progress, stop_on_ctrl_c};
use crate::summary::ending;
use anyhow::Context;
use dress_anyone::refit::recovery::{Change, Recovery, recover};
use std::fmt::Write;
use std::sync::atomic::Ordering;

/// Searches; the table of edges.
pub fn run(arguments: &CheckRecoveryArguments) -> Result<String, Failure> {
    let mut progress = Progress::new(arguments.fitting.pair.running.quiet);
    let inputs = Inputs::read(
        &arguments.fitting.pair,
        arguments.fitting.params(),
        None,
        &mut progress,
    )?;
    let stop = stop_on_ctrl_c().context("Ctrl-C cannot be listened to")?;
    let change = Change {
        seed: arguments.seed,
        size: arguments.change,
    };
    let recovery = recover(
        &inputs.loaded.garment,
        [&inputs.source, &inputs.target],
        &inputs.params.refit,
        change,
        &mut |event| {
            progress.event(event);
            !stop.load(Ordering::SeqCst)
        },
    );
    progress.close();
    let recovery = recovery.map_err(|error| inputs.failure(error))?;
    Ok(table(&inputs.loaded.garment.name, &recovery))
}

/// A row for each edge.
fn table(garment: &str, recovery: &Recovery) -> String {
    let mut text = format!(
        "{garment}: loss {:.6} of the known pattern, {}; {}\n\n\
         {:24} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n\
         {:24} {:>9} {:>9} {:>9} {:>9} {:>9} {:>9}\n",
        recovery.known,
        match recovery.iterations.last() {
            Some(last) => format!("{:.6} of the one found", last.loss),
            None => "none found".to_owned(),
        },
        ending(recovery.ending),
        "edge",
        "first",
        "known",
        "found",
        "off",
        "slack",
        "pull",
        "",
        "[mm]",
        "[mm]",
        "[mm]",
        "[mm]",
        "[mm]",
        "[mm]",
    );
    for edge in &recovery.edges {
        let [first, known, found] = edge.lengths.map(|length| 1e3 * length);
        let remark = match (edge.is_found(), edge.is_determined()) {
            (true, _) => "",
            (false, true) => "  missed",
            (false, false) => "  not determined",
        };
        // Writing to a string cannot fail.
        let _ = writeln!(
            text,
            "{:24} {first:9.1} {known:9.1} {found:9.1} {:9.2} {:9.2} {:9.2}{remark}",
            edge.edge,
            found - known,
            1e3 * edge.slack,
            1e3 * edge.pull,
        );
    }
    let count = recovery.edges.len();
    let found = recovery.edges.iter().filter(|edge| edge.is_found()).count();
    let _ = writeln!(text, "\n{found} of {count} edges found to 0.5 mm or 0.5 %.");
    text
}
