//! A third guess for the pattern, searched for in stiffer cloth.
//!
//! Soft cloth has many drapes that differ by a wrinkle, and the loss a dent for each. Cloth that
//! bends over a hand's breadth instead of a finger's hangs in few ways: its search is short and
//! smooth, and ends near where the soft cloth's should. Not in the paper.

use super::search::{Guess, Search};
use super::{Clock, Found, Observer, RefitError};
use crate::descent::DescentParams;
use crate::sim::Scene;
use crate::sim::energy::contact::Surface;

/// Bending rigidity as a multiple of the fabric's: the length over which cloth bends under its own
/// weight, ∛(B/ρg), grows threefold.
const STIFFER: f64 = 30.0;
/// Steps; the soft cloth's search takes them up.
const ITERATIONS: usize = 8;
/// Falls of the loss not worth another step \[–\].
const TOLERANCE: f64 = 2e-2;

/// The best pattern for stiffer cloth, from guesses as for [`Search::run`]; none if that cloth does
/// not come to rest.
pub(super) fn stiffened<S: Surface>(
    search: &Search<'_, S>,
    initial: Vec<f64>,
    others: Vec<Guess>,
    clock: &Clock,
    observe: &mut Observer<'_>,
) -> Result<Option<Vec<f64>>, RefitError> {
    let soft = search.scene;
    let mut cloth = soft.cloth.clone();
    for material in &mut cloth.materials {
        material.bending *= STIFFER;
    }
    let search = Search {
        scene: &Scene {
            cloth: &cloth,
            ..*soft
        },
        params: &DescentParams {
            iterations: ITERATIONS.min(search.params.iterations),
            tolerance: search.params.tolerance.max(TOLERANCE),
            ..*search.params
        },
        fresh_starts: 0,
        keep: None,
        ..*search
    };
    match search.run(initial, others, clock, observe) {
        Ok(Found { zeta, .. }) => Ok(Some(zeta)),
        Err(RefitError::NotAtRest { .. }) => Ok(None),
        Err(error) => Err(error),
    }
}
