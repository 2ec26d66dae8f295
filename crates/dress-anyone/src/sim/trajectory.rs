//! The drape as the paper has it (§3.1, §3.2): a given number of XPBD steps, and the exact adjoint of
//! all of them.
//!
//! Backwards, every step is walked through as it was run, sweep by sweep (`step::pull_back`):
//! from the gradient by the last positions to that by the rest shape, through strain, bending, masses,
//! contact and its planes. Some states are kept on the way; the steps between them are run again.
//! The start is given, and does not depend on the rest shape. Layers of cloth do not feel each other
//! here.

use super::broken::{Broken, Stage};
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
    kept: Kept,
    steps: usize,
    last: State,
    broken: Option<Broken>,
}

/// States on the way.
struct Kept {
    /// Before the steps 0, `stride`, 2 `stride`, …; without velocities where they follow from the
    /// positions kept before.
    states: Vec<State>,
    stride: usize,
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
    /// Where it stopped being numbers; none if it did not, as long as the trajectory did not.
    pub broken: Option<Broken>,
}

/// States are kept up to this many bytes; where they are more, steps are run again.
const KEPT: usize = 200 << 20;

impl Kept {
    /// For a cloth of `count` vertices that goes `steps` steps.
    fn new(count: usize, steps: usize) -> Self {
        let positions = steps * count * std::mem::size_of::<Vec3>();
        let stride = if positions <= KEPT {
            1
        } else {
            (2 * positions).div_ceil(KEPT)
        };
        Self {
            states: Vec::new(),
            stride,
        }
    }

    /// Keeps the `state` before `step` if it is one to keep.
    fn keep(&mut self, step: usize, state: &State) {
        if self.stride == 1 && step > 0 {
            self.states.push(State {
                x: state.x.clone(),
                v: Vec::new(),
            });
        } else if step.is_multiple_of(self.stride) {
            self.states.push(state.clone());
        }
    }

    /// State number `at`; `tau` \[1/s\] makes a move in a step its velocity.
    fn state(&self, at: usize, tau: f64) -> State {
        let mut state = self.states[at].clone();
        if state.v.is_empty() {
            let moves = state.x.iter().zip(&self.states[at - 1].x);
            state.v = moves.map(|(x, before)| (x - before) * tau).collect();
        }
        state
    }

    fn bytes(&self) -> usize {
        let vectors = |s: &State| s.x.len() + s.v.len();
        self.states.iter().map(vectors).sum::<usize>() * std::mem::size_of::<Vec3>()
    }
}

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
        let mut kept = Kept::new(x.len(), steps);
        let v = vec![Vec3::zeros(); x.len()];
        let mut run = Self {
            cloth: scene.cloth,
            surface: scene.surface,
            params: *scene.params,
            rest: scene.cloth.at_rest(x_bar),
            x_bar: x_bar.to_vec(),
            kept: Kept::new(0, 0),
            steps,
            last: State { x, v },
            broken: None,
        };
        let mut state = run.last.clone();
        let (mut taken, mut broken) = (steps, None);
        let mut stepper = run.stepper();
        for step in 0..steps {
            if !observe(DrapeProgress::Gathering { step, steps }) {
                return None;
            }
            let before = state.clone();
            stepper.step(&mut state, 0.0);
            if !norm(&state.x).is_finite() {
                broken = Broken::at(Stage::Step(step), scene.cloth, &run.rest, &before.x);
                taken = step;
                state = before;
                break;
            }
            kept.keep(step, &before);
        }
        (run.steps, run.broken) = (taken, broken);
        run.kept = kept;
        run.last = state;
        Some(run)
    }

    /// Positions at the end \[m\], `[cloth vertex]`.
    pub fn x(&self) -> &[Vec3] {
        &self.last.x
    }

    /// Where it broke down, with the positions before; none if it did not.
    pub fn broken(&self) -> Option<Broken> {
        self.broken
    }

    /// Memory for the states on the way \[bytes\].
    pub fn kept(&self) -> usize {
        self.kept.bytes()
    }

    /// The rest shape \[m\], `[pattern vertex]`.
    pub fn x_bar(&self) -> &[Vec2] {
        &self.x_bar
    }

    /// ‖f‖/(‖m‖|g|) at the end: how far from rest it still is.
    pub fn residual(&self) -> f64 {
        let contact = self.params.contact;
        let system = System::new(self.cloth, &self.rest, self.surface, contact, &[]);
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
        let (mut largest, mut broken) = (last, None);
        let Kept { states, stride } = &self.kept;
        for segment in (0..states.len()).rev() {
            let count = (*stride).min(self.steps - segment * stride);
            let mut states = vec![self.kept.state(segment, self.params.step.kept())];
            for step in 1..count {
                let mut state = states[step - 1].clone();
                stepper.step(&mut state, 0.0);
                states.push(state);
            }
            for (i, mut state) in states.into_iter().enumerate().rev() {
                let after = hat.x.clone();
                stepper.record(&mut state);
                stepper.pull_back(&mut hat);
                let size = norm(&hat.x);
                if !size.is_finite() && broken.is_none() {
                    broken = Broken::back_at(segment * stride + i, self.cloth, &after);
                }
                largest = largest.max(size);
            }
        }
        TrajectoryHat {
            x_bar: stepper.by_rest_shape(&self.x_bar),
            start: hat,
            growth: largest / last,
            broken,
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
