//! The search, level by level: in cloth that is guided to the target shape, ever less firmly, and then
//! in free cloth. Not in the paper, which has one level and one guess.
//!
//! A guide is a spring from every vertex to its place in x* ([`Cloth::guided`](crate::sim::Cloth::guided));
//! at rate k it gives way by g/k under the cloth's weight. Firmly guided cloth has few wrinkles and few
//! drapes, and the loss few dents. As k falls, drape and pattern follow: continuation (Allgower & Georg
//! 1990). The first level is searched in a coarse mesh if the garment's own is fine; the last decides.

use super::checkpoint::{Checkpoint, Keep};
use super::flatten::flatten;
use super::prepare::Prepared;
use super::search::point::Failed;
use super::search::{Guess, Run, Search, Settled};
use super::{Clock, Found, Observer, RefitError};
use crate::descent::{Gradient, Optimizer};
use crate::geometry::Vec3;
use crate::report::Ending;
use crate::sim::Scene;

/// Rates of the guides \[1/s²\]: weight stretches them by 1 and 10 cm.
const RATES: [f64; 2] = [1000.0, 100.0];
/// Most Levenberg–Marquardt steps of a guided level; the next takes them up.
const GUIDED_STEPS: usize = 4;
/// Falls of the loss not worth another step in guided cloth \[–\].
const GUIDED_TOLERANCE: f64 = 1e-2;

/// A level of the search.
#[derive(Clone, Copy, Debug)]
struct Level {
    /// Whether it is searched in the coarse mesh.
    coarse: bool,
    /// k \[1/s²\]; 0 in free cloth.
    rate: f64,
}

/// The best pattern. A checkpoint is of one of the levels; those before it are not searched again.
pub(super) fn searched(
    prepared: &Prepared<'_>,
    mut checkpoint: Option<Checkpoint>,
    clock: &mut Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    let coarse = prepared.coarser();
    let coarser = coarse.as_ref().map(|garment| prepared.on_mesh_of(garment));
    let coarser = coarser.transpose()?;
    let levels = levels(prepared.params.descent.gradient, coarser.is_some());
    let mut run = Run::new(clock, observe);
    let (from, initial) = match &checkpoint {
        None => (0, first_drape(prepared, &mut run)?),
        Some(noted) if noted.is_of(prepared.params, &prepared.x_star, levels.len()) => {
            run.take_up(noted);
            (noted.level, noted.initial.clone())
        }
        Some(_) => return Err(RefitError::OtherCheckpoint),
    };
    let mut last: Result<Settled, RefitError> = Err(RefitError::Stopped);
    for (number, level) in levels.iter().enumerate().skip(from) {
        if run.stopped() && level.rate > 0.0 {
            continue;
        }
        let on = match &coarser {
            Some(coarser) if level.coarse => coarser,
            _ => prepared,
        };
        let mut guesses = vec![match &last {
            Err(_) => from_target(on, flatten(on)),
            Ok(found) if found.x.len() == on.x_star.len() => Guess {
                zeta: found.zeta.clone(),
                x: found.x.clone(),
            },
            Ok(found) => from_target(on, found.zeta.clone()),
        }];
        guesses.push(if level.rate == 0.0 {
            let x = initial.clone();
            let zeta = on.initial();
            Guess { zeta, x }
        } else if number == 0 {
            from_target(on, on.initial())
        } else {
            // Not caught in what the last level was.
            from_target(on, guesses[0].zeta.clone())
        });
        run.stage(level.stage());
        let keep = Keep {
            params: prepared.params,
            x_star: &prepared.x_star,
            initial: &initial,
            level: number,
        };
        let found = level.search(on, guesses, checkpoint.take(), keep, &mut run)?;
        let found = found.map_err(|failed| failed.on(&prepared.target.name));
        if found.is_ok() || level.rate == 0.0 {
            last = found;
        }
    }
    let found = last?;
    Ok(Found {
        x_bar: prepared.cages.deform(&found.zeta),
        x: found.x,
        initial,
        ending: if run.stopped() {
            Ending::Interrupted
        } else {
            found.ending
        },
        iterations: run.notes(),
    })
}

/// The levels of a refit. Time steps have no guides, as they have none in the paper.
fn levels(gradient: Gradient, coarse: bool) -> Vec<Level> {
    let own = |rate| Level {
        coarse: false,
        rate,
    };
    if gradient == Gradient::Trajectory {
        return vec![own(0.0)];
    }
    let first = coarse.then_some(Level {
        coarse: true,
        rate: RATES[0],
    });
    let guided = RATES.into_iter().map(own);
    first.into_iter().chain(guided).chain([own(0.0)]).collect()
}

/// The drape of the scaled reference in free cloth, noted as where the search begins.
fn first_drape(prepared: &Prepared<'_>, run: &mut Run<'_, '_>) -> Result<Vec<Vec3>, RefitError> {
    run.stage("first guess");
    let scene = prepared.scene();
    let first = from_target(prepared, prepared.initial());
    prepared.search(&scene).first(first, run)
}

/// A pattern, to be draped from the target shape.
fn from_target(on: &Prepared<'_>, zeta: Vec<f64>) -> Guess {
    let x = on.x_star.clone();
    Guess { zeta, x }
}

impl Level {
    fn stage(self) -> &'static str {
        match self {
            Self { rate: 0.0, .. } => "search",
            Self { coarse: true, .. } => "guided search, coarse mesh",
            Self { coarse: false, .. } => "guided search",
        }
    }

    /// The best pattern from several guesses, or on from a checkpoint; why the last failed if none comes
    /// to rest.
    fn search(
        self,
        on: &Prepared<'_>,
        guesses: Vec<Guess>,
        checkpoint: Option<Checkpoint>,
        keep: Keep<'_>,
        run: &mut Run<'_, '_>,
    ) -> Result<Result<Settled, Failed>, RefitError> {
        let mut params = on.params.descent;
        let free = on.scene();
        let mut cloth = free.cloth.clone();
        if self.rate > 0.0 {
            cloth = cloth.guided(on.x_star.clone(), self.rate);
            params.tolerance = params.tolerance.max(GUIDED_TOLERANCE);
            if params.optimizer == Optimizer::Lm {
                params.iterations = params.iterations.min(GUIDED_STEPS);
            }
        }
        if run.stopped() {
            // What was found is only draped in free cloth.
            params.iterations = 0;
        }
        let scene = Scene {
            cloth: &cloth,
            ..free
        };
        let search = Search {
            params: &params,
            guide: self.rate,
            keep: Some(keep),
            ..on.search(&scene)
        };
        match checkpoint {
            None => Ok(search.run(guesses, run)),
            Some(noted) => {
                let found = search.resume(noted, run);
                found.map(Ok).ok_or(RefitError::OtherCheckpoint)
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn levels_go_from_coarse_to_fine_and_from_guided_to_free() {
        let each = |gradient, coarse| -> Vec<(bool, f64)> {
            let levels = levels(gradient, coarse).into_iter();
            levels.map(|level| (level.coarse, level.rate)).collect()
        };
        let own = [(false, 1000.0), (false, 100.0), (false, 0.0)];
        assert_eq!(each(Gradient::Equilibrium, false), own);
        let all = each(Gradient::Equilibrium, true);
        assert_eq!((all[0], &all[1..]), ((true, 1000.0), &own[..]));
        assert_eq!(each(Gradient::Trajectory, false), [(false, 0.0)]);
    }
}
