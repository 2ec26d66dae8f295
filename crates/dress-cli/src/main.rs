//! `dress`: refits sewing patterns and their drapes to any body.
//!
//! Results go to files and a summary to stdout; progress and problems go to stderr. The program
//! ends with 0 when results are written, 2 when an input or the command line is bad, 130 when it
//! was interrupted with nothing to write, and 1 when it failed by its own fault.
#![expect(
    unreachable_pub,
    reason = "nothing of a program can be reached from outside"
)]

mod arguments;
mod body;
mod check_gradient;
mod check_recovery;
mod checkpoint;
mod correspond;
mod drape;
mod fabrics;
mod failure;
mod fitting;
mod frames;
mod inputs;
mod inspect;
mod params;
mod picture;
mod progress;
mod refit;
mod sheet;
mod show;
mod summary;
mod transfer;

use anyhow::Context;
use arguments::{Arguments, Command, RunningArguments};
use clap::Parser;
use failure::Failure;
use std::io::Write;
use std::process::ExitCode;

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    // A panic has told on stderr what and where; its exit status is that of any internal failure.
    let done = std::panic::catch_unwind(|| run(&arguments.command)).unwrap_or_else(|_| {
        let text = "this is a mistake of the program, not of your files; please report it";
        Err(Failure::Internal(anyhow::anyhow!(text)))
    });
    match done {
        Ok(text) => {
            // Nobody may be there to read it, as with `| head`.
            let _ = std::io::stdout().write_all(text.as_bytes());
            ExitCode::SUCCESS
        }
        Err(failure) => {
            let _ = writeln!(std::io::stderr(), "error: {failure}");
            ExitCode::from(failure.code())
        }
    }
}

/// Does what was asked; what to say about it in the end.
fn run(command: &Command) -> Result<String, Failure> {
    match command {
        Command::Refit(arguments) => {
            set_threads(&arguments.fitting.pair.running)?;
            refit::run(arguments)
        }
        Command::CheckGradient(arguments) => {
            set_threads(&arguments.fitting.pair.running)?;
            check_gradient::run(arguments)
        }
        Command::CheckRecovery(arguments) => {
            set_threads(&arguments.fitting.pair.running)?;
            check_recovery::run(arguments)
        }
        Command::Transfer(arguments) => {
            set_threads(&arguments.pair.running)?;
            transfer::run(arguments)
        }
        Command::Drape(arguments) => {
            set_threads(&arguments.running)?;
            drape::run(arguments)
        }
        Command::Body(command) => body::run(command),
        Command::Sheet(arguments) => sheet::run(arguments),
        Command::Inspect(arguments) => inspect::run(arguments),
        Command::Fabrics(arguments) => fabrics::run(arguments),
        Command::Params => Ok(params::TEMPLATE.to_owned()),
    }
}

fn set_threads(running: &RunningArguments) -> anyhow::Result<()> {
    let Some(threads) = running.threads else {
        return Ok(());
    };
    rayon::ThreadPoolBuilder::new()
        .num_threads(threads.get())
        .build_global()
        .context("the threads cannot be started")
}
