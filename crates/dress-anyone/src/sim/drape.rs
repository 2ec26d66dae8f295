//! The drape: from placed panels, or from a nearby drape, to rest.

use super::broken::{Broken, Stage};
use super::cloth::{Cloth, Rest};
use super::energy::contact::{ContactParams, Surface};
use super::energy::friction::Grip;
use super::energy::layers::LayerParams;
use super::equilibrium::{self, EquilibriumParams, RestStatus, Touch};
use super::layers::{Layers, Watch};
use super::material::OrFabric;
use super::step::{State, StepParams, Stepper};
use super::system::{Assembly, System};
use crate::geometry::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// What brings cloth to rest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Solver {
    /// The static solve, after XPBD where panels start far apart.
    #[default]
    Static,
    /// XPBD alone, as in the paper: for a given time, to whatever residual it then has.
    Xpbd,
}

/// How to drape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimParams {
    /// What brings cloth to rest.
    pub solver: Solver,
    /// How cloth meets the body.
    pub contact: ContactParams,
    /// How cloth meets cloth.
    pub layers: LayerParams,
    /// XPBD, which brings placed panels together.
    pub step: StepParams,
    /// The static solve.
    pub equilibrium: EquilibriumParams,
}

/// Where a drape starts.
#[derive(Clone, Debug, PartialEq)]
pub enum Start {
    /// Far away: panels placed around the body, seams open. XPBD first.
    Placed {
        /// The rest shape to begin with \[m\], `[pattern vertex]`: panels too long for the place
        /// they start in are cut short there, and grow while they come together.
        short: Vec<Vec2>,
    },
    /// Near, but layers go through each other. XPBD until they are apart.
    Tangled,
    /// Near: a drape of a similar pattern, or the target shape. Static solve at once.
    Near,
}

/// What a drape reports while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DrapeProgress {
    /// XPBD step `step` of `steps`.
    Gathering {
        /// Steps done.
        step: usize,
        /// Steps in all, unless layers are still tangled then.
        steps: usize,
    },
    /// Newton iteration with the residual before it.
    Settling {
        /// Factorisations done.
        iteration: usize,
        /// ‖f‖/(‖m‖|g|).
        residual: f64,
    },
}

/// Told how far a drape is and, if it asks, the positions \[m\] at that moment, `[cloth vertex]`; may ask to
/// stop by returning `false`.
pub type Observer<'a> = dyn FnMut(DrapeProgress, &dyn Fn() -> Vec<Vec3>) -> bool + 'a;

/// Cloth at rest, or as near to it as the search came.
#[derive(Clone, Debug)]
pub struct Drape {
    /// Positions \[m\], `[cloth vertex]`.
    pub x: Vec<Vec3>,
    /// The rest shape it was draped with \[m\], `[pattern vertex]`.
    pub x_bar: Vec<Vec2>,
    /// ‖f‖/(‖m‖|g|).
    pub residual: f64,
    /// Factorisations used.
    pub iterations: usize,
    /// How the search ended.
    pub status: RestStatus,
    /// Coulomb's coefficient of cloth on the body \[–\].
    pub friction: OrFabric,
    /// Where positions or forces stopped being numbers; `x` is from before then.
    pub broken: Option<Broken>,
    pub(super) rest: Rest,
    pub(super) layers: Layers,
    /// Friction of each contact point; none without friction.
    pub(super) grips: Vec<Grip>,
}

/// The body and its params, with what is prepared once for a cloth.
pub struct Scene<'a, S> {
    /// Topology and fabric.
    pub cloth: &'a Cloth,
    /// Matrix structure of the cloth.
    pub assembly: &'a Assembly,
    /// The body.
    pub surface: &'a S,
    /// How to drape.
    pub params: &'a SimParams,
}

/// Drapes `x_bar` on the scene's body, starting at positions `x` \[m\].
pub fn drape<S: Surface>(
    scene: &Scene<'_, S>,
    x_bar: &[Vec2],
    x: Vec<Vec3>,
    start: Start,
    observe: &mut Observer<'_>,
) -> Drape {
    let rest = scene.cloth.at_rest(x_bar);
    let params = scene.params;
    let (short, steps) = match start {
        Start::Placed { short } => (Some(short), params.step.steps()),
        _ if params.solver == Solver::Xpbd => (Some(x_bar.to_vec()), params.step.steps()),
        Start::Tangled => (Some(x_bar.to_vec()), 0),
        Start::Near => (None, 0),
    };
    let ((x, broken), sigma) = match short {
        Some(short) => (
            gather(
                scene,
                &growth(scene.cloth, &short, x_bar),
                steps,
                x,
                observe,
            ),
            params.equilibrium.cold,
        ),
        None => ((x, None), params.equilibrium.warm),
    };
    let search = EquilibriumParams {
        iterations: match params.solver {
            Solver::Static => params.equilibrium.iterations,
            // The search then only tells the residual.
            Solver::Xpbd => 0,
        },
        ..params.equilibrium
    };
    let mut layers = Layers::new(scene.cloth, params.layers, &x);
    let touch = Touch::at(scene.cloth, &mut layers, &x, scene.assembly.clone());
    let mut grips = Vec::new();
    if params.contact.rubs() {
        grips.resize(scene.cloth.contacts.len(), Grip::default());
    }
    let mut drape = Drape {
        x,
        x_bar: x_bar.to_vec(),
        residual: f64::INFINITY,
        iterations: 0,
        status: RestStatus::IterationLimit,
        friction: params.contact.friction,
        broken,
        rest,
        layers,
        grips,
    };
    if broken.is_some() {
        drape.status = RestStatus::NotFinite;
        return drape;
    }
    drape.settle(
        scene,
        touch,
        sigma,
        &search,
        &mut |iteration, residual, x| {
            let progress = DrapeProgress::Settling {
                iteration,
                residual,
            };
            observe(progress, &|| x.to_vec())
        },
    );
    drape
}

impl Drape {
    /// The static solve, on from where it is; what may touch in the end. With friction, solves and
    /// looks at what the body carries alternate until a look changes nothing; anchors are where the
    /// first look finds what touches, or a later one finds it anew.
    pub(super) fn settle<S: Surface>(
        &mut self,
        scene: &Scene<'_, S>,
        mut touch: Touch,
        mut sigma: f64,
        params: &EquilibriumParams,
        observe: &mut dyn FnMut(usize, f64, &[Vec3]) -> bool,
    ) -> Touch {
        let before = self.iterations;
        loop {
            self.look(scene);
            let done = self.iterations - before;
            let left = EquilibriumParams {
                iterations: params.iterations - done,
                ..*params
            };
            let found = equilibrium::find(
                &system(scene, &self.rest, &self.grips),
                &mut self.layers,
                touch,
                std::mem::take(&mut self.x),
                sigma,
                &left,
                &mut |iteration, residual, x| observe(done + iteration, residual, x),
            );
            self.x = found.x;
            self.residual = found.residual;
            self.status = found.status;
            self.iterations += found.iterations;
            (touch, sigma) = (found.touch, 0.0);
            if self.status == RestStatus::NotFinite {
                let stage = Stage::Iteration(self.iterations);
                self.broken = Broken::at(stage, scene.cloth, &self.rest, &self.x);
            }
            let still = found.iterations == 0 || self.grips.is_empty();
            if still || found.status != RestStatus::AtRest {
                return touch;
            }
        }
    }

    /// Lets the grips see what the body carries.
    fn look<S: Surface>(&mut self, scene: &Scene<'_, S>) {
        let contact = &scene.params.contact;
        for (grip, point) in self.grips.iter_mut().zip(&scene.cloth.contacts) {
            let at = [contact.stiffness * point.area, contact.thickness];
            let mu = contact.friction.or(point.friction);
            grip.look(scene.surface, mu, at, point.at(&self.x));
        }
    }
}

pub(super) fn system<'a, S: Surface>(
    scene: &Scene<'a, S>,
    rest: &'a Rest,
    grips: &'a [Grip],
) -> System<'a, S> {
    let contact = scene.params.contact;
    System::new(scene.cloth, rest, scene.surface, contact, grips)
}

/// Part of the gathering time over which the inflation fades \[–\].
const INFLATED: f64 = 0.7;
/// Part of the gathering time after which panels that began short grow, and at which they are grown:
/// seams are closed by then, and the cloth hangs \[–\].
const GROWING: [f64; 2] = [0.3, 0.8];
/// Rest shapes on the way.
const STAGES: usize = 16;
/// Gathering times that are spent on layers which go through each other: armpits, where the body presses,
/// take long to untangle.
const UNTANGLING: usize = 8;
/// How far these may sink into the body meanwhile \[m\].
const SINKS: f64 = 0.01;

/// The rest from `short` to `x_bar` in stages; one stage if there is nothing to grow.
fn growth(cloth: &Cloth, short: &[Vec2], x_bar: &[Vec2]) -> Vec<Rest> {
    let stages = if short == x_bar { 0 } else { STAGES };
    let grown = |stage: usize| {
        let part = (STAGES - stage) as f64 / STAGES as f64;
        let between = short.iter().zip(x_bar).map(|(s, x)| x + (s - x) * part);
        cloth.at_rest(&between.collect::<Vec<_>>())
    };
    (STAGES - stages..=STAGES).map(grown).collect()
}

/// XPBD from rest at `x` for so many `steps` at least, through the stages of `growth`. Where positions stop
/// being numbers, the last that were.
fn gather<S: Surface>(
    scene: &Scene<'_, S>,
    growth: &[Rest],
    steps: usize,
    x: Vec<Vec3>,
    observe: &mut Observer<'_>,
) -> (Vec<Vec3>, Option<Broken>) {
    let step_params = scene.params.step;
    let mut stepper = Stepper::new(
        scene.cloth,
        &growth[0],
        scene.surface,
        scene.params.contact,
        step_params,
        Watch::new(scene.cloth, scene.params.layers, &x),
    );
    let v = vec![Vec3::zeros(); x.len()];
    let mut state = State { x, v };
    let usual = step_params.steps();
    for step in 0..UNTANGLING * usual {
        let enough = step >= steps && !stepper.tangled();
        let progress = DrapeProgress::Gathering { step, steps: usual };
        if enough || !observe(progress, &|| state.x.clone()) {
            break;
        }
        let now = step as f64 / usual as f64;
        let grown = ((now - GROWING[0]) / (GROWING[1] - GROWING[0])).clamp(0.0, 1.0);
        let rest = &growth[(grown * (growth.len() - 1) as f64) as usize];
        stepper.grow(rest);
        if step >= steps {
            stepper.let_tangled_sink(SINKS);
        }
        let before = state.x.clone();
        let left = 1.0 - now / INFLATED;
        stepper.step(&mut state, step_params.inflation * left.max(0.0));
        if !state.x.iter().all(|p| p.iter().all(|c| c.is_finite())) {
            let broken = Broken::at(Stage::Step(step), scene.cloth, rest, &before);
            return (before, broken);
        }
    }
    (state.x, None)
}

#[cfg(test)]
mod tests;
