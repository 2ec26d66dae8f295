//! A search as it stands after an accepted step: enough to go on from there to the same bits.
//!
//! What follows from the inputs is made again on resuming; the search itself, from its best guess on,
//! is not. A checkpoint knows what it was made from, and is refused with anything else.

use super::RefitParams;
use super::search::Steps;
use crate::geometry::Vec3;
use crate::report::Iteration;
use crate::sim::energy::friction::Grip;
use nalgebra::DVector;
use serde::{Deserialize, Serialize};

/// The state of a search.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Checkpoint {
    /// The parameters of the refit.
    pub(super) params: RefitParams,
    /// The target shape \[m\], which follows from garment and bodies.
    pub(super) x_star: Vec<Vec3>,
    /// The drape of the initial guess \[m\]; none in guided levels, which do without it.
    pub(super) initial: Vec<Vec3>,
    /// The level of the search that it is of, with the mesh of that level.
    pub(super) level: usize,
    /// The best pattern's unknowns \[m\], its drape \[m\], and the gradient there \[1/m\].
    pub(super) zeta: Vec<f64>,
    pub(super) x: Vec<Vec3>,
    /// Friction there; none without.
    pub(super) grips: Vec<Grip>,
    pub(super) gradient: DVector<f64>,
    pub(super) adjoint_norm: f64,
    pub(super) residual: f64,
    pub(super) shift: f64,
    /// What makes the steps, and what it has learned.
    pub(super) steps: Steps,
    /// Steps in a row that hardly lowered the loss.
    pub(super) slow: usize,
    /// Steps taken in this level.
    pub(super) taken: usize,
    /// Farthest move of the last step \[m\]; none where it says nothing.
    pub(super) moved: Option<f64>,
    pub(super) notes: Vec<Iteration>,
    pub(super) drapes: usize,
    pub(super) factorisations: usize,
    /// Seconds that the refit had taken.
    pub(super) elapsed: f64,
}

impl Checkpoint {
    /// Accepted steps so far.
    pub fn iterations(&self) -> usize {
        self.notes.last().map_or(0, |last| last.iteration)
    }

    /// Whether it is of this refit, which has so many `levels`, the first of them `guided`: same parameters, same
    /// target shape to the last bit. Whether it fits its level is for the search there to see.
    pub(super) fn is_of(
        &self,
        params: &RefitParams,
        x_star: &[Vec3],
        [guided, levels]: [usize; 2],
    ) -> bool {
        let first_guess = if self.level < guided { 0 } else { x_star.len() };
        self.params == *params
            && self.x_star == x_star
            && self.initial.len() == first_guess
            && self.level < levels
            && !self.notes.is_empty()
    }
}

/// What a checkpoint holds besides the search of its level.
#[derive(Clone, Copy)]
pub(super) struct Keep<'a> {
    pub(super) params: &'a RefitParams,
    pub(super) x_star: &'a [Vec3],
    pub(super) initial: &'a [Vec3],
    pub(super) level: usize,
}
