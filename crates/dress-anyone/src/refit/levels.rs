//! The search from coarse to fine: in a coarse mesh of the garment from three guesses, then in the
//! garment's own mesh from what that found. Not in the paper, which has one mesh and one guess.

use super::checkpoint::Checkpoint;
use super::prepare::Prepared;
use super::search::{Guess, Search};
use super::{Clock, Found, Observer, RefitError, flatten, stiffen};
use crate::descent::{DescentParams, Gradient};
use crate::geometry::intersections;
use crate::pattern::resample::resample;
use crate::report::Status;

/// The best pattern, searched for in a coarse mesh of the garment first if it is fine. What the
/// coarse search ends with is a guess; the search in the garment's own mesh decides. A checkpoint is
/// of one or the other.
pub(super) fn searched(
    prepared: &Prepared<'_>,
    mut checkpoint: Option<Checkpoint>,
    clock: &mut Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    if let Some(own) = checkpoint.take_if(|noted| prepared.noted(noted)) {
        clock.stage("search", observe);
        return resumed(prepared, own, clock, observe);
    }
    if let Some(garment) = prepared.coarser() {
        let coarser = prepared.on_mesh_of(&garment)?;
        let stages = [
            "search in stiffer cloth, coarse mesh",
            "search, coarse mesh",
        ];
        let coarse = if let Some(own) = checkpoint.take_if(|noted| coarser.noted(noted)) {
            clock.stage(stages[1], observe);
            resumed(&coarser, own, clock, observe)
        } else if checkpoint.is_some() {
            Err(RefitError::OtherCheckpoint)
        } else {
            explored(&coarser, stages, clock, observe)
        };
        match coarse {
            Ok(coarse) => {
                let x = resample(&garment.mesh, &coarse.x, &prepared.garment.mesh);
                let zeta = coarse.zeta;
                let guess = Guess { zeta, x };
                return finished(prepared, guess, coarse.status, clock, observe);
            }
            // Not in so coarse a mesh.
            Err(RefitError::NotAtRest { .. }) => {}
            Err(error) => return Err(error),
        }
    }
    if checkpoint.is_some() {
        return Err(RefitError::OtherCheckpoint);
    }
    explored(
        prepared,
        ["search in stiffer cloth", "search"],
        clock,
        observe,
    )
}

/// The search, taken up from where a checkpoint left it.
fn resumed(
    prepared: &Prepared<'_>,
    checkpoint: Checkpoint,
    clock: &Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    let scene = prepared.scene();
    let found = prepared.search(&scene).resume(checkpoint, clock, observe);
    found.ok_or(RefitError::OtherCheckpoint)
}

/// The search in the garment's own mesh, from what the `coarse` one found. If that was interrupted,
/// its pattern is draped and taken.
fn finished(
    prepared: &Prepared<'_>,
    coarse: Guess,
    status: Status,
    clock: &mut Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    clock.stage("search", observe);
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let (initial, guesses) = (prepared.initial(), both_starts(prepared, coarse));
    if status != Status::Stopped {
        return search.run(initial, guesses, clock, observe);
    }
    let no_further = DescentParams {
        iterations: 0,
        ..prepared.params.descent
    };
    let search = Search {
        params: &no_further,
        fresh_starts: 0,
        ..search
    };
    let mut found = search.run(initial, guesses, clock, &mut |_| true)?;
    found.status = Status::Stopped;
    Ok(found)
}

/// The guess draped from the target shape, and — if no cloth goes through itself there — from the
/// drape it came with, which has the fewer wrinkles of a coarse mesh.
fn both_starts(prepared: &Prepared<'_>, guess: Guess) -> Vec<Guess> {
    let from_target = Guess {
        zeta: guess.zeta.clone(),
        x: prepared.x_star.clone(),
    };
    let triangles = prepared.garment.mesh.cloth_triangles();
    if intersections::within(&guess.x, &triangles).is_empty() {
        vec![from_target, guess]
    } else {
        vec![from_target]
    }
}

/// The best pattern, from the best of three guesses.
fn explored(
    prepared: &Prepared<'_>,
    [in_stiffer_cloth, in_its_own]: [&'static str; 2],
    clock: &mut Clock,
    observe: &mut Observer<'_>,
) -> Result<Found, RefitError> {
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let initial = prepared.initial();
    let from_target = |zeta| Guess {
        zeta,
        x: prepared.x_star.clone(),
    };
    let mut guesses = vec![from_target(flatten::flatten(prepared))];
    if prepared.params.descent.gradient == Gradient::Equilibrium {
        clock.stage(in_stiffer_cloth, observe);
        let third = stiffen::stiffened(&search, initial.clone(), guesses.clone(), clock, observe)?;
        guesses.extend(third.map(from_target));
    }
    clock.stage(in_its_own, observe);
    search.run(initial, guesses, clock, observe)
}
