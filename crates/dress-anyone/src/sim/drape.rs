//! The drape: from placed panels, or from a nearby drape, to rest; and the derivatives of the
//! state it comes to.

use super::adjoint;
use super::cloth::{Cloth, Rest};
use super::energy::contact::{ContactParams, Surface};
use super::energy::layers::LayerParams;
use super::equilibrium::{self, EquilibriumParams, RestStatus, Touch};
use super::layers::{Layers, Watch, hold_apart};
use super::step::{State, StepParams, Stepper};
use super::system::{Assembly, System};
use crate::geometry::sparse::Factor;
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
    rest: Rest,
    layers: Layers,
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

/// Drapes `x_bar` on the scene's body, starting at positions `x` \[m\]. `observe` may ask to stop
/// by returning `false`.
pub fn drape<S: Surface>(
    scene: &Scene<'_, S>,
    x_bar: &[Vec2],
    x: Vec<Vec3>,
    start: Start,
    observe: &mut dyn FnMut(DrapeProgress) -> bool,
) -> Drape {
    let rest = scene.cloth.at_rest(x_bar);
    let params = scene.params;
    let begun_as = match start {
        Start::Placed { short } => Some(short),
        Start::Near if params.solver == Solver::Xpbd => Some(x_bar.to_vec()),
        Start::Near => None,
    };
    let (x, sigma) = match begun_as {
        Some(short) => (
            gather(scene, &growth(scene.cloth, &short, x_bar), x, observe),
            params.equilibrium.cold,
        ),
        None => (x, params.equilibrium.warm),
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
    let found = equilibrium::find(
        &system(scene, &rest),
        &mut layers,
        touch,
        x,
        sigma,
        &search,
        &mut |iteration, residual| {
            observe(DrapeProgress::Settling {
                iteration,
                residual,
            })
        },
    );
    Drape {
        x: found.x,
        x_bar: x_bar.to_vec(),
        residual: found.residual,
        iterations: found.iterations,
        status: found.status,
        rest,
        layers,
    }
}

fn system<'a, S>(scene: &Scene<'a, S>, rest: &'a Rest) -> System<'a, S> {
    System {
        cloth: scene.cloth,
        rest,
        surface: scene.surface,
        contact: scene.params.contact,
        thickness: scene.params.layers.thickness,
    }
}

/// Part of the gathering time over which the inflation fades \[–\].
const INFLATED: f64 = 0.7;
/// Part of the gathering time after which panels that began short grow, and at which they are grown:
/// seams are closed by then, and the cloth hangs \[–\].
const GROWING: [f64; 2] = [0.3, 0.8];
/// Rest shapes on the way.
const STAGES: usize = 16;

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

/// XPBD from rest at `x` for the configured time, through the stages of `growth`.
fn gather<S: Surface>(
    scene: &Scene<'_, S>,
    growth: &[Rest],
    x: Vec<Vec3>,
    observe: &mut dyn FnMut(DrapeProgress) -> bool,
) -> Vec<Vec3> {
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
    let steps = step_params.steps();
    for step in 0..2 * steps {
        let enough = step >= steps && !stepper.tangled();
        if enough || !observe(DrapeProgress::Gathering { step, steps }) {
            break;
        }
        let now = step as f64 / steps as f64;
        let grown = ((now - GROWING[0]) / (GROWING[1] - GROWING[0])).clamp(0.0, 1.0);
        stepper.grow(&growth[(grown * (growth.len() - 1) as f64) as usize]);
        let left = 1.0 - now / INFLATED;
        stepper.step(&mut state, step_params.inflation * left.max(0.0));
    }
    state.x
}

/// A polished drape with the factor of its exact stiffness: what can be differentiated.
pub struct Differentiable<'a> {
    cloth: &'a Cloth,
    /// The polished state.
    pub drape: Drape,
    factor: Factor,
    /// σ \[1/s²\] that had to be added to make the stiffness definite; 0 at a proper minimum.
    pub shift: f64,
}

/// First shift tried when the stiffness at rest is indefinite \[1/s²\]; small beside the softest
/// modes of a garment (a pendulum of 1 m has g/l ≈ 10).
const FIRST_SHIFT: f64 = 1e-3;

/// Kicks off saddles before the stiffness is shifted instead.
const KICKS: usize = 3;
/// Farthest any vertex moves in a kick \[m\].
const KICK: f64 = 1e-3;

impl Drape {
    /// Polishes the state and factors its exact stiffness. A state whose stiffness is indefinite is
    /// a saddle: it is left along its softest mode, and settles anew. Where that does not help the
    /// stiffness is shifted just as far as needed, and [`Differentiable::shift`] says so.
    pub fn differentiable<'a, S: Surface>(
        mut self,
        scene: &Scene<'a, S>,
    ) -> Option<Differentiable<'a>> {
        let params = &scene.params.equilibrium;
        let system = system(scene, &self.rest);
        let polish = EquilibriumParams {
            iterations: 40,
            tolerance: params.polished,
            ..*params
        };
        let mut sigma = 0.0;
        let mut kicks = 0;
        let assembly = scene.assembly.clone();
        let mut touch = Touch::at(scene.cloth, &mut self.layers, &self.x, assembly);
        let (factor, shift) = loop {
            let start = std::mem::take(&mut self.x);
            let layers = &mut self.layers;
            let still = &mut |_, _| true;
            let found = equilibrium::find(&system, layers, touch, start, sigma, &polish, still);
            self.iterations += found.iterations;
            self.residual = found.residual;
            self.x = found.x;
            touch = found.touch;
            let (factor, shift) = shifted_factor(&system, &touch, &self.x)?;
            if shift == 0.0 || kicks == KICKS {
                break (factor, shift);
            }
            kicks += 1;
            sigma = shift;
            let mut kick = softest_mode(&system, &factor);
            for d in &mut kick {
                *d *= KICK;
            }
            hold_apart(&self.layers.pairs(&self.x, &kick, 0.0), &self.x, &mut kick);
            for (x, d) in self.x.iter_mut().zip(kick) {
                *x += d;
            }
            touch = Touch::at(scene.cloth, &mut self.layers, &self.x, touch.assembly);
        };
        Some(Differentiable {
            cloth: scene.cloth,
            drape: self,
            factor,
            shift,
        })
    }
}

/// The exact stiffness factored at positions that are at rest, whatever way led there; none if no
/// shift makes it definite.
pub fn differentiable_at<'a, S: Surface>(
    scene: &Scene<'a, S>,
    x_bar: &[Vec2],
    x: Vec<Vec3>,
) -> Option<Differentiable<'a>> {
    let rest = scene.cloth.at_rest(x_bar);
    let mut layers = Layers::new(scene.cloth, scene.params.layers, &x);
    let touch = Touch::at(scene.cloth, &mut layers, &x, scene.assembly.clone());
    let system = system(scene, &rest);
    let residual = system.residual(&system.force(&x, &touch.pairs));
    let (factor, shift) = shifted_factor(&system, &touch, &x)?;
    let drape = Drape {
        x,
        x_bar: x_bar.to_vec(),
        residual,
        iterations: 0,
        status: RestStatus::AtRest,
        rest,
        layers,
    };
    Some(Differentiable {
        cloth: scene.cloth,
        drape,
        factor,
        shift,
    })
}

/// Factor of K + σM with the smallest σ tried that makes it definite, and σ \[1/s²\].
fn shifted_factor<S: Surface>(
    system: &System<'_, S>,
    touch: &Touch,
    x: &[Vec3],
) -> Option<(Factor, f64)> {
    let mut shift = 0.0;
    loop {
        let mut k = system.stiffness(&touch.assembly, x, &touch.pairs, 1.0);
        k.add_diagonal(shift, &system.rest.mass);
        if let Some(factor) = k.factor() {
            return Some((factor, shift));
        }
        shift = if shift == 0.0 {
            FIRST_SHIFT
        } else {
            10.0 * shift
        };
        if !(shift < 1e9) {
            return None;
        }
    }
}

/// The mode to which the shifted stiffness gives way most, by inverse iteration from unstructured
/// forces; its farthest vertex moves by 1.
fn softest_mode<S: Surface>(system: &System<'_, S>, factor: &Factor) -> Vec<Vec3> {
    let unstructured = |i: usize| ((i as f64 + 1.0).sin() * 43_758.545_3).fract();
    let vertices = 0..system.cloth.vertex_count;
    let mut mode: Vec<Vec3> = vertices
        .map(|a| Vec3::from_fn(|c, _| unstructured(3 * a + c)))
        .collect();
    for _ in 0..8 {
        let forces: Vec<Vec3> = mode
            .iter()
            .zip(&system.rest.mass)
            .map(|(d, m)| d * *m)
            .collect();
        mode = factor.solve(&forces);
        let farthest = mode.iter().map(Vec3::norm).fold(0.0, f64::max);
        for d in &mut mode {
            *d /= farthest;
        }
    }
    mode
}

impl Differentiable<'_> {
    /// x̄̂ = (∂x/∂x̄)ᵀ x̂, and the adjoint λ = K⁻¹ x̂ it comes from.
    pub fn pull_back(&self, x_hat: &[Vec3]) -> (Vec<Vec2>, Vec<Vec3>) {
        let lambda = self.factor.solve(x_hat);
        let drape = &self.drape;
        let hat = adjoint::rest_pull_back(self.cloth, &drape.rest, &drape.x_bar, &drape.x, &lambda);
        (hat, lambda)
    }

    /// ∂x along each motion of the rest shape, `[motion][vertex]` flattened to x, y, z.
    pub fn sensitivities(&self, motions: impl Iterator<Item = Vec<Vec2>>) -> Vec<f64> {
        let drape = &self.drape;
        let push = |motion: Vec<Vec2>| {
            adjoint::rest_push_forward(self.cloth, &drape.rest, &drape.x_bar, &drape.x, &motion)
        };
        adjoint::sensitivities(&self.factor, motions.map(push))
    }
}

#[cfg(test)]
mod tests;
