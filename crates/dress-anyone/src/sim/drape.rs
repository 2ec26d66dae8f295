//! The drape: from placed panels, or from a nearby drape, to rest; and the derivatives of the
//! state it comes to.

use super::adjoint;
use super::cloth::{Cloth, Rest};
use super::energy::contact::{ContactParams, Surface};
use super::equilibrium::{self, EquilibriumParams, RestStatus};
use super::step::{State, StepParams, Stepper};
use super::system::{Assembly, System};
use crate::geometry::sparse::Factor;
use crate::geometry::{Vec2, Vec3};
use serde::{Deserialize, Serialize};

/// How to drape.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimParams {
    /// How cloth meets the body.
    pub contact: ContactParams,
    /// XPBD, which brings placed panels together.
    pub step: StepParams,
    /// The static solve.
    pub equilibrium: EquilibriumParams,
}

/// Where a drape starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Start {
    /// Far away: panels placed around the body, seams open. XPBD first.
    Placed,
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
        /// Steps in all.
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
    let (x, sigma) = match start {
        Start::Placed => (gather(scene, &rest, x, observe), params.equilibrium.cold),
        Start::Near => (x, params.equilibrium.warm),
    };
    let found = equilibrium::find(
        &system(scene, &rest),
        x,
        sigma,
        params.equilibrium.tolerance,
        &params.equilibrium,
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
    }
}

fn system<'a, S>(scene: &Scene<'a, S>, rest: &'a Rest) -> System<'a, S> {
    System {
        cloth: scene.cloth,
        assembly: scene.assembly,
        rest,
        surface: scene.surface,
        contact: scene.params.contact,
    }
}

/// Part of the gathering time over which the inflation fades \[–\].
const INFLATED: f64 = 0.7;

/// XPBD from rest at `x` for the configured time.
fn gather<S: Surface>(
    scene: &Scene<'_, S>,
    rest: &Rest,
    x: Vec<Vec3>,
    observe: &mut dyn FnMut(DrapeProgress) -> bool,
) -> Vec<Vec3> {
    let step_params = scene.params.step;
    let mut stepper = Stepper::new(
        scene.cloth,
        rest,
        scene.surface,
        scene.params.contact,
        step_params,
    );
    let v = vec![Vec3::zeros(); x.len()];
    let mut state = State { x, v };
    let steps = (step_params.time / step_params.dt).ceil() as usize;
    for step in 0..steps {
        if !observe(DrapeProgress::Gathering { step, steps }) {
            break;
        }
        let left = 1.0 - step as f64 / (INFLATED * steps as f64);
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
            ..*params
        };
        let mut sigma = 0.0;
        let mut kicks = 0;
        let (factor, shift) = loop {
            let start = std::mem::take(&mut self.x);
            let still = &mut |_, _| true;
            let found = equilibrium::find(&system, start, sigma, params.polished, &polish, still);
            self.iterations += found.iterations;
            self.residual = found.residual;
            self.x = found.x;
            let (factor, shift) = shifted_factor(&system, &self.x)?;
            if shift == 0.0 || kicks == KICKS {
                break (factor, shift);
            }
            kicks += 1;
            sigma = shift;
            let mode = softest_mode(&system, &factor);
            for (x, d) in self.x.iter_mut().zip(mode) {
                *x += d * KICK;
            }
        };
        Some(Differentiable {
            cloth: scene.cloth,
            drape: self,
            factor,
            shift,
        })
    }
}

/// Factor of K + σM with the smallest σ tried that makes it definite, and σ \[1/s²\].
fn shifted_factor<S: Surface>(system: &System<'_, S>, x: &[Vec3]) -> Option<(Factor, f64)> {
    let mut shift = 0.0;
    loop {
        let mut k = system.stiffness(x, 1.0);
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
mod tests {
    use super::*;
    use crate::check::{assert_derivative, noise};
    use crate::garment::Fabric;
    use crate::sim::cloth::{Hold, fixtures};
    use crate::sim::energy::contact::Nothing;
    use crate::sim::energy::contact::fixtures::{Cone, Floor};
    use approx::assert_relative_eq;

    const SOFT: Fabric = Fabric {
        warp: 50.0,
        weft: 80.0,
        poisson: 0.2,
        shear: 20.0,
        bending: 1e-4,
        density: 0.2,
    };

    fn settle<S: Surface>(scene: &Scene<'_, S>, x_bar: &[Vec2], x: Vec<Vec3>) -> Drape {
        let drape = drape(scene, x_bar, x, Start::Near, &mut |_| true);
        assert_eq!(
            drape.status,
            RestStatus::AtRest,
            "residual {}",
            drape.residual
        );
        drape
    }

    /// Directional derivative of a fixed linear function of the drape by the rest shape, against
    /// two complete drapes.
    fn check_gradient<S: Surface>(
        scene: &Scene<'_, S>,
        x_bar: &[Vec2],
        x: Vec<Vec3>,
        tolerance: f64,
    ) {
        let weights: Vec<Vec3> = (0..x.len())
            .map(|i| Vec3::from_fn(|c, _| noise(11 * i + c)))
            .collect();
        let direction: Vec<Vec2> = x_bar
            .iter()
            .enumerate()
            .map(|(i, _)| Vec2::new(noise(7 * i), noise(7 * i + 3)))
            .collect();
        let at = settle(scene, x_bar, x)
            .differentiable(scene)
            .expect("a minimum");
        assert_eq!(at.shift, 0.0);
        let (hat, _) = at.pull_back(&weights);
        let slope: f64 = hat.iter().zip(&direction).map(|(h, d)| h.dot(d)).sum();
        let value = |s: f64| {
            let moved: Vec<Vec2> = x_bar
                .iter()
                .zip(&direction)
                .map(|(p, d)| p + d * s)
                .collect();
            let there = settle(scene, &moved, at.drape.x.clone())
                .differentiable(scene)
                .expect("a minimum");
            there
                .drape
                .x
                .iter()
                .zip(&weights)
                .map(|(x, w)| x.dot(w))
                .sum::<f64>()
        };
        assert_derivative(value, slope, 1e-7, 1e-6, tolerance);
        let forward = at.sensitivities(std::iter::once(direction));
        let pushed: f64 = forward
            .chunks_exact(3)
            .zip(&weights)
            .map(|(d, w)| d[0] * w.x + d[1] * w.y + d[2] * w.z)
            .sum();
        assert_relative_eq!(pushed, slope, max_relative = 1e-8);
    }

    /// Makes one side of a tube longer, so that it knows which way round it wants to hang.
    fn skew(mesh: &mut crate::pattern::PatternMesh) {
        let width = mesh.x_bar.iter().map(|p| p.x).fold(0.0, f64::max);
        for p in &mut mesh.x_bar {
            p.y *= 1.0 + 0.2 * (std::f64::consts::TAU * p.x / width).sin();
        }
    }

    fn firm_contact() -> SimParams {
        let contact = ContactParams {
            thickness: 0.003,
            stiffness: 1e5,
        };
        SimParams {
            contact,
            ..SimParams::default()
        }
    }

    #[test]
    fn the_gradient_of_a_skirt_agrees_with_two_drapes() {
        // Held at the waist, wide enough to fold below it, on a flattened cone.
        let mut mesh = fixtures::tube(24, 10, 0.04);
        skew(&mut mesh);
        let mut cloth = Cloth::new(&mesh, &SOFT);
        cloth.holds = (240..264)
            .map(|vertex| Hold {
                vertex,
                height: 0.0,
                stiffness: 30.0,
            })
            .collect();
        let assembly = Assembly::new(&cloth);
        let cone = Cone {
            radius: 0.14,
            slope: 0.2,
            flat: 1.2,
            lean: 0.1,
        };
        let params = firm_contact();
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &cone,
            params: &params,
        };
        let mut x = fixtures::rolled(&mesh, 0.96, 0.16);
        for (i, p) in x.iter_mut().enumerate() {
            *p += Vec3::from_fn(|c, _| 1e-3 * noise(3 * i + c)) - Vec3::y() * 0.4;
        }
        // The differences' own error, which falls with the square of their step.
        check_gradient(&scene, &mesh.x_bar, x, 1e-5);
    }

    #[test]
    fn the_gradient_of_a_tight_tube_agrees_with_two_drapes() {
        let mut mesh = fixtures::tube(24, 6, 0.025);
        skew(&mut mesh);
        let cloth = Cloth::new(&mesh, &SOFT);
        let assembly = Assembly::new(&cloth);
        // Circumference 0.6 m on a cone of 0.6 m and more: held by the slope alone.
        let cone = Cone {
            radius: 0.1,
            slope: 0.3,
            flat: 1.1,
            lean: 0.2,
        };
        let params = firm_contact();
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &cone,
            params: &params,
        };
        let x = fixtures::rolled(&mesh, 0.6, 0.11);
        check_gradient(&scene, &mesh.x_bar, x, 1e-7);
    }

    #[test]
    fn a_tight_tube_presses_as_laplace_says() {
        // p = N/R: hoop tension over radius, on a smooth cylinder without weight to speak of.
        let mesh = fixtures::tube(60, 6, 0.01);
        let fabric = Fabric {
            density: 1e-4,
            bending: 1e-9,
            poisson: 0.0,
            ..SOFT
        };
        let cloth = Cloth::new(&mesh, &fabric);
        let assembly = Assembly::new(&cloth);
        let radius = 0.1;
        let cylinder = Cone {
            radius,
            slope: 0.0,
            flat: 1.0,
            lean: 0.0,
        };
        let params = SimParams {
            contact: ContactParams {
                thickness: 0.0,
                stiffness: 1e8,
            },
            equilibrium: EquilibriumParams {
                tolerance: 1e-4,
                ..Default::default()
            },
            ..SimParams::default()
        };
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &cylinder,
            params: &params,
        };
        let x = fixtures::rolled(&mesh, 0.6, 0.1001);
        let rest = cloth.at_rest(&mesh.x_bar);
        let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_| true);
        let system = system(&scene, &rest);
        let push: f64 = drape
            .x
            .iter()
            .enumerate()
            .map(|(a, p)| {
                crate::sim::energy::contact::force(&cylinder, system.kappa(a), 0.0, *p).norm()
            })
            .sum();
        // The polygon of 60 sides inscribed in the radius stretches to its own length, not 2πR.
        let stretch = 60.0 * 2.0 * radius * (std::f64::consts::PI / 60.0).sin() / 0.6;
        let tension = 80.0 * 0.5 * (stretch * stretch - 1.0) * stretch;
        let expected = tension / radius * (std::f64::consts::TAU * radius * 0.06);
        // The rims draw in a little where nothing pulls along the axis; 1 % covers it.
        assert_relative_eq!(push, expected, max_relative = 1e-2);
    }

    #[test]
    fn a_sheet_on_the_floor_sinks_in_by_its_weight() {
        let mesh = fixtures::sheet(6, 6, 0.05);
        let cloth = Cloth::new(&mesh, &SOFT);
        let assembly = Assembly::new(&cloth);
        let floor = Floor { height: 0.0 };
        let params = SimParams::default();
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &floor,
            params: &params,
        };
        let x = mesh
            .x_bar
            .iter()
            .map(|p| Vec3::new(p.x, 0.004, p.y))
            .collect();
        let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_| true);
        let depth = 0.2 * 9.81 / params.contact.stiffness;
        for p in &drape.x {
            assert_relative_eq!(p.y, params.contact.thickness - depth, max_relative = 1e-6);
        }
    }

    #[test]
    fn what_nothing_holds_falls_and_is_reported() {
        let mesh = fixtures::sheet(3, 3, 0.05);
        let cloth = Cloth::new(&mesh, &SOFT);
        let assembly = Assembly::new(&cloth);
        let params = SimParams::default();
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &Nothing,
            params: &params,
        };
        let x = mesh
            .x_bar
            .iter()
            .map(|p| Vec3::new(p.x, p.y, 0.0))
            .collect();
        let drape = drape(&scene, &mesh.x_bar, x, Start::Near, &mut |_| true);
        assert_eq!(drape.status, RestStatus::Sliding);
    }
}
