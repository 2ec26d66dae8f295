//! What is going on, on stderr, and a polite end on Ctrl-C.
//!
//! On a terminal one line is rewritten in place; in a log every event is a line of its own.

use dress_anyone::refit;
use dress_anyone::sim::drape::DrapeProgress;
use std::io::{self, IsTerminal, Write};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::{Duration, Instant};

/// Tells stages and iterations to a human.
pub struct Progress<W = io::Stderr> {
    out: W,
    manner: Manner,
    start: Instant,
    stage: String,
    /// Whether an unfinished line stands on the terminal.
    open: bool,
    /// When something passing was last told.
    passed: Instant,
}

/// How events are told.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Manner {
    /// Not at all.
    Quiet,
    /// One line each.
    Lines,
    /// One line, rewritten.
    Terminal,
}

impl Progress {
    /// Progress on stderr, as fits what stderr is.
    pub fn new(quiet: bool) -> Self {
        let manner = if quiet {
            Manner::Quiet
        } else if io::stderr().is_terminal() {
            Manner::Terminal
        } else {
            Manner::Lines
        };
        Self::to(io::stderr(), manner)
    }
}

impl<W: Write> Progress<W> {
    /// Progress written to `out`.
    pub fn to(out: W, manner: Manner) -> Self {
        Self {
            out,
            manner,
            start: Instant::now(),
            stage: String::new(),
            open: false,
            passed: Instant::now(),
        }
    }

    /// What a refit tells.
    pub fn event(&mut self, event: &refit::Progress) {
        match event {
            refit::Progress::Stage(name) => self.stage(name),
            refit::Progress::Drape(drape) => self.drape(*drape),
            refit::Progress::Iteration {
                iteration, loss, ..
            } => self.iteration(*iteration, *loss),
            refit::Progress::Checkpoint(_) => {}
        }
    }

    /// How far a drape is, now and then.
    pub fn drape(&mut self, drape: DrapeProgress) {
        let pause = match self.manner {
            Manner::Quiet => return,
            Manner::Lines => Duration::from_secs(10),
            Manner::Terminal => Duration::from_millis(100),
        };
        if self.passed.elapsed() < pause {
            return;
        }
        self.passed = Instant::now();
        let text = line(&self.stage, &doing(drape), self.start.elapsed());
        self.tell(&text);
    }

    /// A stage of the work begins.
    pub fn stage(&mut self, name: &str) {
        self.close();
        name.clone_into(&mut self.stage);
        self.tell(&line(name, "", self.start.elapsed()));
    }

    /// An iteration of the current stage ended at this loss.
    pub fn iteration(&mut self, iteration: usize, loss: f64) {
        let doing = format!("iteration {iteration}, loss {loss:.4e}");
        let text = line(&self.stage, &doing, self.start.elapsed());
        self.tell(&text);
    }

    /// What was noticed when reading the input called `name`; this stays on the screen.
    pub fn notes(&mut self, name: &str, notes: &[String]) {
        for note in notes {
            self.close();
            self.tell(&format!("{name}: {note}"));
            self.close();
        }
    }

    /// Ends the line that was being rewritten.
    pub fn close(&mut self) {
        if self.open {
            self.put("\n");
            self.open = false;
        }
    }

    fn tell(&mut self, text: &str) {
        match self.manner {
            Manner::Quiet => {}
            Manner::Lines => self.put(&format!("{text}\n")),
            Manner::Terminal => {
                // Back to the first column; clear to the end of the line.
                self.put(&format!("\r{text}\x1b[K"));
                self.open = true;
            }
        }
    }

    /// Progress that nobody can read any more must not end the work: errors are dropped.
    fn put(&mut self, text: &str) {
        let _ = self.out.write_all(text.as_bytes());
        let _ = self.out.flush();
    }
}

/// How far a drape is, in words.
pub fn doing(drape: DrapeProgress) -> String {
    match drape {
        DrapeProgress::Gathering { step, steps } => format!("gathering, {step} of {steps}"),
        DrapeProgress::Settling {
            iteration,
            residual,
        } => format!("settling, {iteration}: net force {residual:.1e} of the weight"),
    }
}

/// "   12.3 s  search: iteration 7, loss 1.234e-3".
fn line(stage: &str, doing: &str, elapsed: Duration) -> String {
    let colon = if doing.is_empty() { "" } else { ": " };
    format!("{:7.1} s  {stage}{colon}{doing}", elapsed.as_secs_f64())
}

/// A flag that the first Ctrl-C raises; the second ends the program at once.
pub fn stop_on_ctrl_c() -> Result<Arc<AtomicBool>, ctrlc::Error> {
    let stop = Arc::new(AtomicBool::new(false));
    let raised = Arc::clone(&stop);
    ctrlc::set_handler(move || {
        if is_second(&raised) {
            // What shells report of a program ended by Ctrl-C: 128 + SIGINT.
            std::process::exit(130);
        }
        let text =
            "\nstopping; what was found so far will be written (Ctrl-C again: stop at once)\n";
        let _ = io::stderr().write_all(text.as_bytes());
    })?;
    Ok(stop)
}

/// Raises the flag; whether it was up already.
fn is_second(flag: &AtomicBool) -> bool {
    flag.swap(true, Ordering::SeqCst)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn told(manner: Manner) -> String {
        let mut out = Vec::new();
        let mut progress = Progress::to(&mut out, manner);
        progress.stage("refit");
        progress.iteration(1, 0.5);
        progress.notes("tee", &["unit: cm".to_owned()]);
        progress.close();
        String::from_utf8(out).expect("text")
    }

    #[test]
    fn a_log_has_a_line_per_event_and_no_control_characters() {
        let log = told(Manner::Lines);
        assert_eq!(log.lines().count(), 3);
        assert!(!log.contains(['\r', '\x1b']));
        assert!(log.contains("refit: iteration 1, loss 5.0000e-1\n"));
    }

    #[test]
    fn a_terminal_keeps_the_last_iteration_and_every_note() {
        let screen = told(Manner::Terminal);
        let kept: Vec<&str> = screen
            .lines()
            .filter_map(|line| line.rsplit('\r').next())
            .collect();
        assert_eq!(kept.len(), 2, "{screen:?}");
        assert!(kept[0].contains("iteration 1") && kept[1].starts_with("tee: unit: cm"));
    }

    #[test]
    fn a_log_hears_of_a_drape_only_now_and_then() {
        let mut out = Vec::new();
        let mut progress = Progress::to(&mut out, Manner::Lines);
        for step in 0..1000 {
            progress.drape(DrapeProgress::Gathering { step, steps: 1000 });
        }
        // Ten seconds between lines, and this takes none.
        assert!(out.is_empty());
    }

    #[test]
    fn quiet_is_quiet() {
        assert_eq!(told(Manner::Quiet), "");
    }

    #[test]
    fn elapsed_time_leads_the_line() {
        let text = line("drape", "", Duration::from_millis(12_340));
        assert_eq!(text, "   12.3 s  drape");
    }

    #[test]
    fn only_the_second_interrupt_is_the_second() {
        let flag = AtomicBool::new(false);
        assert!(!is_second(&flag) && flag.load(Ordering::SeqCst));
        assert!(is_second(&flag));
    }
}
