//! The search, level by level: in cloth that is guided to the target shape, ever less firmly, and then
//! in free cloth. Not in the paper, which has one level and one guess.
//!
//! A guide is a spring from every vertex to its place in x* ([`Cloth::guided`](crate::sim::Cloth::guided));
//! at rate k it gives way by g/k under the cloth's weight. Firmly guided cloth has few wrinkles and few
//! drapes, and the loss few dents. As k falls, drape and pattern follow: continuation (Allgower & Georg
//! 1990). The first level is searched in a coarse mesh, and if the garment's own is fine all but the last in
//! meshes coarser than that; the last decides.

use super::checkpoint::{Checkpoint, Keep};
use super::flatten::flatten;
use super::prepare::Prepared;
use super::search::point::{ALMOST_AT_REST, Failed};
use super::search::{Guess, Run, Search, Settled};
use super::{Clock, Found, Observer, RefitError};
use crate::descent::{DescentParams, Gradient, Optimizer};
use crate::geometry::Vec3;
use crate::pattern::resample::resample;
use crate::report::{Ending, Iteration};
use crate::sim::{Scene, Start, drape};
use std::ops::Range;

/// Rates of the guides \[1/s²\]: weight stretches them by 1 and 10 cm.
const RATES: [f64; 2] = [1000.0, 100.0];
/// Residual down to which the cloth of a pattern found in a coarser mesh is eased about the target shape \[–\]: what
/// the other mesh strains is gone then, and folds are where they were.
const EASED: f64 = 10.0;
/// Most Levenberg–Marquardt steps of a guided level; the next takes them up.
const GUIDED_STEPS: usize = 4;
/// Residual at which drapes end before the last level \[–\]: what follows settles the many small folds, which the loss
/// hardly feels.
const NEARLY: f64 = 1e-2;
/// Falls of the loss not worth another step in guided cloth \[–\].
const GUIDED_TOLERANCE: f64 = 1e-2;

/// Which mesh of the garment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Mesh {
    Own,
    Medium,
    Coarse,
}

/// A level of the search.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Level {
    mesh: Mesh,
    /// k \[1/s²\]; 0 in free cloth.
    rate: f64,
    /// Residual at which a drape ends, if that is above what is asked for \[–\].
    rest: f64,
}

/// The garment in the meshes that are searched.
struct Meshes<'a> {
    own: &'a Prepared<'a>,
    medium: Option<Prepared<'a>>,
    coarse: Option<Prepared<'a>>,
}

/// The best pattern. A checkpoint is of one of the levels; those before it are not searched again. Guided levels do
/// without the drape of the first guess, which is made beside them.
pub(super) fn searched(
    prepared: &Prepared<'_>,
    mut checkpoint: Option<Checkpoint>,
    clock: &mut Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    let params = prepared.params;
    let [medium, coarse] = [params.medium, params.coarse].map(|count| prepared.coarser(count));
    let [medium, coarse] = [&medium, &coarse].map(|garment| {
        let garment = garment.as_ref();
        garment
            .map(|garment| prepared.on_mesh_of(garment))
            .transpose()
    });
    let meshes = Meshes {
        own: prepared,
        medium: medium?,
        coarse: coarse?,
    };
    let levels = levels(
        &params.descent,
        meshes.medium.is_some(),
        meshes.coarse.is_some(),
    );
    let guided = levels.iter().filter(|level| level.rate > 0.0).count();
    let mut run = Run::new(clock, observe);
    let (from, mut initial) = match &checkpoint {
        None => (0, Vec::new()),
        Some(noted) if noted.is_of(params, &prepared.x_star, [guided, levels.len()]) => {
            run.take_up(noted);
            (noted.level, noted.initial.clone())
        }
        Some(_) => return Err(RefitError::OtherCheckpoint),
    };
    let mut last = None;
    if initial.is_empty() {
        let noted = checkpoint.take();
        let search = |run: &mut Run<'_, '_>| {
            let found = meshes.search(&levels, from..guided, (last, &[]), noted, run);
            // What is left of it is waited for.
            run.stage("first guess");
            found
        };
        let first = |run: &mut Run<'_, '_>| first_drape(prepared, guided > 0, run);
        let (found, first) = run.both(&prepared.spare, search, first);
        last = found?;
        let (x, note) = first.map_err(|failed| prepared.told(failed))?;
        run.begin_with(note);
        initial = x;
    }
    let free = from.max(guided)..levels.len();
    let last = meshes.search(&levels, free, (last, &initial), checkpoint, &mut run)?;
    let (_, found) = last.ok_or(RefitError::Stopped)?;
    Ok(Found {
        x_bar: prepared.cages.deform(&found.zeta),
        x: found.x,
        grips: found.grips,
        initial,
        ending: if run.stopped() {
            Ending::Interrupted
        } else {
            found.ending
        },
        iterations: run.notes(),
    })
}

impl Meshes<'_> {
    /// Searches the `numbers` of all `levels` one after the other, the first of them on from a checkpoint. `before` is
    /// what the last level before them found and the drape of the first guess, which guided levels do without.
    fn search(
        &self,
        levels: &[Level],
        numbers: Range<usize>,
        before: (Option<(Level, Settled)>, &[Vec3]),
        mut checkpoint: Option<Checkpoint>,
        run: &mut Run<'_, '_>,
    ) -> Result<Option<(Level, Settled)>, RefitError> {
        let (mut last, initial) = before;
        for number in numbers {
            let (level, decides) = (levels[number], number + 1 == levels.len());
            if run.stopped() && !decides {
                continue;
            }
            let on = match (level.mesh, &self.medium, &self.coarse) {
                (Mesh::Medium, Some(medium), _) => medium,
                (Mesh::Coarse, _, Some(coarse)) => coarse,
                _ => self.own,
            };
            let same = matches!(&last, Some((last, _)) if last.mesh == level.mesh);
            let again = matches!(&last, Some((last, _)) if same && last.rate == level.rate);
            let first = match &last {
                None => from_target(on, flatten(on)),
                Some((_, found)) if same => Guess::at(found.x.clone(), found.zeta.clone()),
                Some((_, found)) if level.rate == 0.0 => eased(on, found.zeta.clone()),
                Some((_, found)) => from_target(on, found.zeta.clone()),
            };
            let second = if again {
                None
            } else if level.rate == 0.0 {
                let x = match level.mesh {
                    Mesh::Own => initial.to_vec(),
                    _ => resample(&self.own.garment.mesh, initial, &on.garment.mesh),
                };
                Some(Guess::at(x, on.initial()))
            } else if number == 0 {
                Some(from_target(on, on.initial()))
            } else {
                // Not caught in what the last level was.
                same.then(|| from_target(on, first.zeta.clone()))
            };
            let guesses: Vec<Guess<'_>> = [Some(first), second].into_iter().flatten().collect();
            run.stage(level.stage());
            let keep = Keep {
                params: on.params,
                x_star: &self.own.x_star,
                initial,
                level: number,
            };
            match level.search(on, &guesses, checkpoint.take(), keep, run)? {
                Ok(found) => last = Some((level, found)),
                Err(failed) if decides && !again => return Err(self.own.told(failed)),
                Err(_) => {}
            }
        }
        Ok(last)
    }
}

/// The levels of a refit. Time steps have no guides, as they have none in the paper. Free cloth comes as near to rest as is
/// asked for in the last level, and wherever steps come from the gradient alone: so many small ones lead to states that
/// are not of rest.
fn levels(params: &DescentParams, medium: bool, coarse: bool) -> Vec<Level> {
    let at = |mesh, rate, rest| Level { mesh, rate, rest };
    let last = at(Mesh::Own, 0.0, 0.0);
    if params.gradient == Gradient::Trajectory {
        return vec![last];
    }
    let mut levels = Vec::new();
    if coarse {
        levels.push(at(Mesh::Coarse, RATES[0], NEARLY));
    }
    let mesh = if medium { Mesh::Medium } else { Mesh::Own };
    levels.extend(RATES.map(|rate| at(mesh, rate, NEARLY)));
    let newton = params.optimizer == Optimizer::Lm;
    if medium {
        levels.push(at(Mesh::Medium, 0.0, if newton { NEARLY } else { 0.0 }));
    }
    if newton {
        levels.push(at(Mesh::Own, 0.0, NEARLY));
    }
    levels.push(last);
    levels
}

/// The drape of the scaled reference in free cloth, almost at rest, with its note; what stops the search stops it
/// only where there is nothing `to_keep` otherwise.
fn first_drape(
    prepared: &Prepared<'_>,
    to_keep: bool,
    run: &mut Run<'_, '_>,
) -> Result<(Vec<Vec3>, Iteration), Failed> {
    let scene = prepared.scene();
    let mut sim = *scene.params;
    sim.equilibrium = sim.equilibrium.no_nearer_than(ALMOST_AT_REST);
    let scene = Scene {
        params: &sim,
        ..scene
    };
    if to_keep {
        run.never_stop();
    }
    let first = from_target(prepared, prepared.initial());
    prepared.search(&scene).first(first, run)
}

/// A pattern, and its cloth eased about the target shape, where guides hold it: so it keeps the folds of the target
/// shape where it can.
fn eased<'a>(on: &'a Prepared<'_>, zeta: Vec<f64>) -> Guess<'a> {
    let x_bar = on.cages.deform(&zeta);
    let start = move |run: &mut Run<'_, '_>| {
        let free = on.scene();
        let cloth = free.cloth.clone().guided(on.x_star.clone(), RATES[0]);
        let mut sim = *free.params;
        sim.equilibrium.tolerance = EASED;
        sim.equilibrium.iterations = on.params.descent.patience;
        let scene = Scene {
            cloth: &cloth,
            params: &sim,
            ..free
        };
        let from = on.x_star.clone();
        let found = drape(&scene, &x_bar, from, Start::Near, &mut |p, _| run.drapes(p));
        run.count(&found);
        found.x
    };
    Guess {
        zeta,
        start: Box::new(start),
    }
}

/// A pattern, to be draped from the target shape.
fn from_target<'a>(on: &Prepared<'_>, zeta: Vec<f64>) -> Guess<'a> {
    Guess::at(on.x_star.clone(), zeta)
}

impl Level {
    fn stage(self) -> &'static str {
        match (self.rate > 0.0, self.mesh == Mesh::Own) {
            (false, true) if self.rest > 0.0 => "search, almost at rest",
            (false, true) => "search",
            (false, false) => "search, coarser mesh",
            (true, true) => "guided search",
            (true, false) => "guided search, coarser mesh",
        }
    }

    /// The best pattern from several guesses, or on from a checkpoint; why the last failed if none comes
    /// to rest.
    fn search(
        self,
        on: &Prepared<'_>,
        guesses: &[Guess<'_>],
        checkpoint: Option<Checkpoint>,
        keep: Keep<'_>,
        run: &mut Run<'_, '_>,
    ) -> Result<Result<Settled, Failed>, RefitError> {
        let mut params = on.params.descent;
        let free = on.scene();
        let mut cloth = free.cloth.clone();
        let mut sim = *free.params;
        sim.equilibrium = sim.equilibrium.no_nearer_than(self.rest);
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
            params: &sim,
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
    use super::Mesh::{Coarse, Medium, Own};
    use super::*;

    #[test]
    fn levels_go_from_coarse_to_fine_and_from_guided_to_free() {
        let each = |params: DescentParams, medium, coarse| -> Vec<(Mesh, f64, f64)> {
            let levels = levels(&params, medium, coarse).into_iter();
            levels
                .map(|level| (level.mesh, level.rate, level.rest))
                .collect()
        };
        let newton = DescentParams::default();
        let own = [
            (Own, 1000.0, NEARLY),
            (Own, 100.0, NEARLY),
            (Own, 0.0, NEARLY),
            (Own, 0.0, 0.0),
        ];
        assert_eq!(each(newton, false, false), own);
        let all = each(newton, false, true);
        assert_eq!((all[0], &all[1..]), ((Coarse, 1000.0, NEARLY), &own[..]));
        let all = [
            (Coarse, 1000.0, NEARLY),
            (Medium, 1000.0, NEARLY),
            (Medium, 100.0, NEARLY),
            (Medium, 0.0, NEARLY),
            (Own, 0.0, NEARLY),
            (Own, 0.0, 0.0),
        ];
        assert_eq!(each(newton, true, true), all);
        let downhill = DescentParams {
            optimizer: Optimizer::Lbfgs,
            ..newton
        };
        let free = [(Medium, 0.0, 0.0), (Own, 0.0, 0.0)];
        assert_eq!(each(downhill, true, false)[2..], free);
        let paper = DescentParams {
            gradient: Gradient::Trajectory,
            ..downhill
        };
        assert_eq!(each(paper, false, false), [(Own, 0.0, 0.0)]);
    }
}
