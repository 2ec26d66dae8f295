//! What a search tells and counts while it runs, through all its levels.

use super::Search;
use super::aside::Made;
use super::point::Point;
use crate::refit::checkpoint::Checkpoint;
use crate::refit::{Clock, Observer, Progress};
use crate::report::Iteration;
use crate::sim::Drape;
use crate::sim::drape::DrapeProgress;

/// What changes while searching.
pub(in crate::refit) struct Run<'a, 'b> {
    notes: Vec<Iteration>,
    drapes: usize,
    factorisations: usize,
    pub(super) clock: &'a mut Clock,
    observe: &'a mut Observer<'b>,
    stopped: bool,
    /// Whether drapes are draped to their end whatever the observer wants.
    never_stops: bool,
}

impl<'a, 'b> Run<'a, 'b> {
    /// Nothing done yet.
    pub(in crate::refit) fn new(clock: &'a mut Clock, observe: &'a mut Observer<'b>) -> Self {
        Self {
            notes: Vec::new(),
            drapes: 0,
            factorisations: 0,
            clock,
            observe,
            stopped: false,
            never_stops: false,
        }
    }

    /// Goes on counting where a checkpoint was made.
    pub(in crate::refit) fn take_up(&mut self, from: &Checkpoint) {
        self.notes.clone_from(&from.notes);
        self.drapes = from.drapes;
        self.factorisations = from.factorisations;
    }

    /// What is draped from now on is draped to its end, whatever the observer wants.
    pub(in crate::refit) fn never_stop(&mut self) {
        self.never_stops = true;
    }

    /// Another stage begins.
    pub(in crate::refit) fn stage(&mut self, stage: &'static str) {
        self.clock.stage(stage, self.observe);
    }

    /// Whether the observer wants no more.
    pub(in crate::refit) fn stopped(&self) -> bool {
        self.stopped
    }

    /// The first guess, then every accepted step.
    pub(in crate::refit) fn notes(self) -> Vec<Iteration> {
        self.notes
    }

    /// A drape begins.
    pub(super) fn count_drape(&mut self) {
        self.drapes += 1;
    }

    /// A drape took so many.
    pub(super) fn count_factorisations(&mut self, count: usize) {
        self.factorisations += count;
    }

    /// Counts a drape that only leads to where another begins.
    pub(in crate::refit) fn count(&mut self, drape: &Drape) {
        self.count_drape();
        self.count_factorisations(drape.iterations);
    }

    /// Does `work` as a run of its own.
    pub(super) fn apart<T>(&mut self, work: impl FnOnce(&mut Run<'_, '_>) -> T) -> Made<T> {
        let mut run = Run::new(self.clock, self.observe);
        run.stopped = self.stopped;
        let found = work(&mut run);
        let made = run.made(found);
        self.stopped = run.stopped;
        made
    }

    /// Gives what was found aside, with what it took.
    pub(super) fn made<T>(&self, found: T) -> Made<T> {
        Made {
            found,
            drapes: self.drapes,
            factorisations: self.factorisations,
        }
    }

    /// Counts what was made aside as done here.
    pub(super) fn count_made<T>(&mut self, made: Made<T>) -> T {
        self.drapes += made.drapes;
        self.factorisations += made.factorisations;
        made.found
    }

    /// Tells how a drape proceeds; whether to go on with it. Once stopped, what is left to drape is
    /// draped to its end.
    pub(in crate::refit) fn drapes(&mut self, progress: DrapeProgress) -> bool {
        self.tell(&Progress::Drape(progress)) || self.never_stops
    }

    /// Notes an accepted point, and tells it. Number 0 is the first guess, which has its own note.
    pub(super) fn note<S>(&mut self, search: &Search<'_, S>, best: &Point<'_>, moved: f64) {
        let iteration = self.notes.last().map_or(1, |last| last.iteration + 1);
        let note = self.noted(iteration, search, best, moved);
        self.tell_of(&note);
        self.notes.push(note);
    }

    /// Puts the note of the first guess before all others, and tells it.
    pub(in crate::refit) fn begin_with(&mut self, note: Iteration) {
        self.tell_of(&note);
        self.notes.insert(0, note);
    }

    /// The note of a point, as things stand.
    pub(super) fn noted<S>(
        &self,
        iteration: usize,
        search: &Search<'_, S>,
        best: &Point<'_>,
        moved: f64,
    ) -> Iteration {
        Iteration {
            iteration,
            guide: search.guide,
            loss: best.total,
            shape_matching: best.loss.terms.shape_matching(search.losses.weights()),
            terms: best.loss.terms,
            gradient_norm: best.gradient.norm(),
            adjoint_norm: best.adjoint_norm,
            residual: best.residual,
            shift: best.shift,
            moved,
            drapes: self.drapes,
            factorisations: self.factorisations,
            elapsed: self.clock.elapsed(),
        }
    }

    fn tell_of(&mut self, note: &Iteration) {
        self.tell(&Progress::Iteration {
            iteration: note.iteration,
            loss: note.loss,
            terms: note.terms,
        });
    }

    /// Tells that the search may be taken up from here.
    pub(super) fn keep(&mut self, checkpoint: Checkpoint) {
        let noted = Checkpoint {
            notes: self.notes.clone(),
            drapes: self.drapes,
            factorisations: self.factorisations,
            elapsed: self.clock.elapsed(),
            ..checkpoint
        };
        self.tell(&Progress::Checkpoint(Box::new(noted)));
    }

    /// Whether to go on.
    fn tell(&mut self, progress: &Progress) -> bool {
        if !self.stopped {
            self.stopped = !(self.observe)(progress);
            return !self.stopped;
        }
        true
    }
}
