//! The drape as the paper has it (§3.1, §3.2): a given number of XPBD steps, and the exact adjoint of
//! all of them.
//!
//! Backwards, every step is walked through as it was run, sweep by sweep (`step::pull_back`):
//! from the gradient by the last positions to that by the rest shape, through strain, bending, masses,
//! contact and its planes. Some states are kept on the way; the steps between them are run again.
//! The start is given, and does not depend on the rest shape. Layers of cloth do not feel each other
//! here.

use super::cloth::{Cloth, Rest};
use super::drape::{DrapeProgress, Scene, SimParams};
use super::energy::contact::Surface;
use super::energy::layers::LayerParams;
use super::layers::Watch;
use super::step::{State, Stepper};
use super::system::System;
use crate::geometry::{Vec2, Vec3};

/// Cloth after some XPBD steps, and the way it came there.
pub struct Trajectory<'a, S> {
    cloth: &'a Cloth,
    surface: &'a S,
    params: SimParams,
    x_bar: Vec<Vec2>,
    rest: Rest,
    /// States before the steps 0, `stride`, 2 `stride`, …
    kept: Vec<State>,
    stride: usize,
    steps: usize,
    last: State,
}

/// What the loss at the end of a trajectory answers to.
#[derive(Clone, Debug)]
pub struct TrajectoryHat {
    /// Gradient by the rest shape, `[pattern vertex]`.
    pub x_bar: Vec<Vec2>,
    /// Gradient by the start, `[cloth vertex]`.
    pub start: State,
    /// Largest gradient by the positions on the way, as a multiple of that by the last \[–\]: far
    /// above 1 where the cloth crumples and the end hangs on trifles.
    pub growth: f64,
}

/// States are kept up to this many bytes; where they are more, steps are run again.
const KEPT: usize = 150 << 20;

impl<'a, S: Surface> Trajectory<'a, S> {
    /// Steps the cloth of `scene`, with the rest shape `x_bar` \[m\], from rest at `x` \[m\] for
    /// `steps` steps. `observe` may ask to stop by returning `false`: none is then returned.
    pub fn run(
        scene: &Scene<'a, S>,
        x_bar: &[Vec2],
        x: Vec<Vec3>,
        steps: usize,
        observe: &mut dyn FnMut(DrapeProgress) -> bool,
    ) -> Option<Self> {
        let per_state = 2 * std::mem::size_of::<Vec3>() * x.len();
        let v = vec![Vec3::zeros(); x.len()];
        let mut run = Self {
            cloth: scene.cloth,
            surface: scene.surface,
            params: *scene.params,
            rest: scene.cloth.at_rest(x_bar),
            x_bar: x_bar.to_vec(),
            kept: Vec::new(),
            stride: (steps * per_state).div_ceil(KEPT).max(1),
            steps,
            last: State { x, v },
        };
        let mut state = run.last.clone();
        let mut kept = Vec::new();
        let mut stepper = run.stepper();
        for step in 0..steps {
            if !observe(DrapeProgress::Gathering { step, steps }) {
                return None;
            }
            if step % run.stride == 0 {
                kept.push(state.clone());
            }
            stepper.step(&mut state, 0.0);
        }
        drop(stepper);
        run.kept = kept;
        run.last = state;
        Some(run)
    }

    /// Positions at the end \[m\], `[cloth vertex]`.
    pub fn x(&self) -> &[Vec3] {
        &self.last.x
    }

    /// The rest shape \[m\], `[pattern vertex]`.
    pub fn x_bar(&self) -> &[Vec2] {
        &self.x_bar
    }

    /// ‖f‖/(‖m‖|g|) at the end: how far from rest it still is.
    pub fn residual(&self) -> f64 {
        let system = System {
            cloth: self.cloth,
            rest: &self.rest,
            surface: self.surface,
            contact: self.params.contact,
            grips: &[],
        };
        system.residual(&system.force(&self.last.x, &[]))
    }

    /// Turns the gradient by the last positions into those by rest shape and start.
    pub fn pull_back(&self, x_hat: &[Vec3]) -> TrajectoryHat {
        let mut hat = State {
            x: x_hat.to_vec(),
            v: vec![Vec3::zeros(); x_hat.len()],
        };
        let mut stepper = self.stepper();
        let last = norm(x_hat);
        let mut largest = last;
        for (segment, kept) in self.kept.iter().enumerate().rev() {
            let first = segment * self.stride;
            let count = self.stride.min(self.steps - first);
            let mut states = vec![kept.clone()];
            for step in 1..count {
                let mut state = states[step - 1].clone();
                stepper.step(&mut state, 0.0);
                states.push(state);
            }
            for mut state in states.into_iter().rev() {
                stepper.record(&mut state);
                stepper.pull_back(&mut hat);
                largest = largest.max(norm(&hat.x));
            }
        }
        TrajectoryHat {
            x_bar: stepper.by_rest_shape(&self.x_bar),
            start: hat,
            growth: largest / last,
        }
    }

    fn stepper(&self) -> Stepper<'_, S> {
        let alone = LayerParams {
            on: false,
            ..self.params.layers
        };
        Stepper::new(
            self.cloth,
            &self.rest,
            self.surface,
            self.params.contact,
            self.params.step,
            Watch::new(self.cloth, alone, &self.last.x),
        )
    }
}

fn norm(x: &[Vec3]) -> f64 {
    x.iter().map(Vec3::norm_squared).sum::<f64>().sqrt()
}

#[cfg(test)]
mod tests;
