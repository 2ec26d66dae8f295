//! Work on a core that would idle. Some is wanted only if other work turns out so: the next shorter step, if the one
//! before it is refused. What comes of it is what one after the other gives, bit for bit; only the clock tells.

use super::Run;
use crate::refit::Progress;
use crate::sim::drape::DrapeProgress;
use std::panic::resume_unwind;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::Duration;

/// How often the work in front looks after that aside.
const GLANCE: Duration = Duration::from_millis(5);

/// Cores that a search leaves idle.
#[derive(Clone, Debug)]
pub(in crate::refit) struct Spare(Arc<AtomicUsize>);

/// A core in use, given back when dropped.
pub(in crate::refit) struct Core<'a>(&'a Spare);

/// What came of work aside, and what it took.
pub(in crate::refit) struct Made<T> {
    pub(super) found: T,
    pub(super) drapes: usize,
    pub(super) factorisations: usize,
}

impl Spare {
    /// All threads but the one that searches.
    pub(in crate::refit) fn all() -> Self {
        let count = rayon::current_num_threads().saturating_sub(1);
        Self(Arc::new(AtomicUsize::new(count)))
    }

    /// Does `main` and, if there is a core to spare, `aside` at the same time; else one after the other.
    pub(in crate::refit) fn both<A, B: Send>(
        &self,
        main: impl FnOnce() -> A,
        aside: impl FnOnce() -> B + Send,
    ) -> (A, B) {
        let Some(_core) = self.take() else {
            return (main(), aside());
        };
        thread::scope(|scope| {
            let aside = scope.spawn(aside);
            let found = main();
            let made = aside.join().unwrap_or_else(|panic| resume_unwind(panic));
            (found, made)
        })
    }

    fn take(&self) -> Option<Core<'_>> {
        let one_less = |count: usize| count.checked_sub(1);
        let taken = (self.0).fetch_update(Ordering::Relaxed, Ordering::Relaxed, one_less);
        taken.ok().map(|_| Core(self))
    }
}

impl Drop for Core<'_> {
    fn drop(&mut self) {
        self.0.0.fetch_add(1, Ordering::Relaxed);
    }
}

impl Run<'_, '_> {
    /// Does `first` and, beside it or after it if there is no core to spare, `second`, whose notes count what it took
    /// alone.
    pub(in crate::refit) fn both<A, B: Send>(
        &mut self,
        spare: &Spare,
        first: impl FnOnce(&mut Self) -> A,
        second: impl Fn(&mut Run<'_, '_>) -> B + Sync,
    ) -> (A, B) {
        let (found, made) = self.beside(spare, first, Some(&second), |_| false);
        let made = made.unwrap_or_else(|| self.apart(second));
        (found, self.count_made(made))
    }

    /// Does `first` and, if there is a core to spare, `second` beside it, which is stopped once `first` is `enough`.
    /// None of `second` if there was none or `first` is enough.
    pub(super) fn beside<A, B: Send>(
        &mut self,
        spare: &Spare,
        first: impl FnOnce(&mut Self) -> A,
        second: Option<impl FnOnce(&mut Run<'_, '_>) -> B + Send>,
        enough: impl FnOnce(&A) -> bool,
    ) -> (A, Option<Made<B>>) {
        let Some((second, core)) = second.and_then(|second| Some((second, spare.take()?))) else {
            return (first(self), None);
        };
        let (stop, latest) = (&AtomicBool::new(false), &Mutex::new(None));
        let mut clock = self.clock.same_start();
        let work = move || {
            let _until_done = core;
            let mut observe = |progress: &Progress| {
                if let Progress::Drape(progress) = progress {
                    *latest.lock().unwrap_or_else(PoisonError::into_inner) = Some(*progress);
                }
                !stop.load(Ordering::Relaxed)
            };
            let mut run = Run::new(&mut clock, &mut observe);
            let found = second(&mut run);
            run.made(found)
        };
        thread::scope(|scope| {
            let aside = scope.spawn(work);
            let found = first(self);
            let unwanted = enough(&found);
            stop.store(unwanted, Ordering::Relaxed);
            while !aside.is_finished() {
                thread::sleep(GLANCE);
                let progress: Option<DrapeProgress> =
                    latest.lock().unwrap_or_else(PoisonError::into_inner).take();
                if !unwanted && progress.is_some_and(|progress| !self.drapes(progress)) {
                    stop.store(true, Ordering::Relaxed);
                }
            }
            let made = aside.join().unwrap_or_else(|panic| resume_unwind(panic));
            (found, (!unwanted).then_some(made))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refit::Clock;

    fn with_run<T>(work: impl FnOnce(&mut Run<'_, '_>) -> T) -> T {
        let mut clock = Clock::new();
        work(&mut Run::new(&mut clock, &mut |_| true))
    }

    #[test]
    fn work_aside_is_counted_when_it_is_used_and_not_done_without_a_core() {
        let second = |run: &mut Run<'_, '_>| {
            run.count_drape();
            run.count_factorisations(7);
            "second"
        };
        let spare = Spare(Arc::new(AtomicUsize::new(1)));
        with_run(|run| {
            let (first, made) = run.beside(&spare, |_| "first", Some(second), |_| false);
            let before = run.made(());
            assert_eq!((before.drapes, before.factorisations), (0, 0));
            let second = run.count_made(made.expect("there is a core"));
            assert_eq!((first, second), ("first", "second"));
            let after = run.made(());
            assert_eq!((after.drapes, after.factorisations), (1, 7));
        });
        // The core is given back.
        assert_eq!(spare.0.load(Ordering::Relaxed), 1);
        let none = Spare(Arc::default());
        let made = with_run(|run| run.beside(&none, |_| (), Some(second), |()| false).1);
        assert!(made.is_none());
        assert_eq!(none.both(|| 1, || 2), (1, 2));
    }

    #[test]
    fn what_counts_for_itself_counts_alike_beside_other_work_and_after_it() {
        let second = |run: &mut Run<'_, '_>| {
            run.count_drape();
            run.made(()).drapes
        };
        for cores in [0, 1] {
            let spare = Spare(Arc::new(AtomicUsize::new(cores)));
            with_run(|run| {
                let first = |run: &mut Run<'_, '_>| run.count_drape();
                let ((), own) = run.both(&spare, first, second);
                assert_eq!((own, run.made(()).drapes), (1, 2), "{cores} cores");
            });
            assert_eq!(spare.0.load(Ordering::Relaxed), cores);
        }
    }

    #[test]
    fn work_aside_is_stopped_once_it_is_not_wanted() {
        let settling = DrapeProgress::Settling {
            iteration: 0,
            residual: 1.0,
        };
        // Would go on for ever.
        let second = |run: &mut Run<'_, '_>| while run.drapes(settling) {};
        let spare = Spare(Arc::new(AtomicUsize::new(1)));
        let made = with_run(|run| run.beside(&spare, |_| (), Some(second), |()| true).1);
        assert!(made.is_none());
        // An observer that wants no more stops it, too.
        let mut clock = Clock::new();
        let mut no_more = |_: &Progress| false;
        let mut run = Run::new(&mut clock, &mut no_more);
        let ((), made) = run.beside(&spare, |_| (), Some(second), |()| false);
        assert!(made.is_some() && run.stopped());
    }
}
