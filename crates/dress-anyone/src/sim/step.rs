//! One XPBD time step (paper §3.1; Macklin et al. 2016, with the velocity factor τ).
//!
//! x̃ = x + Δt v + Δt² g, then sweeps of (∇C M⁻¹ ∇Cᵀ + α̃) Δλ = −C − α̃λ over membrane, bending,
//! folds, holds and contact in a fixed order (membrane and bending by colours, in lanes: `stretch`,
//! `turn`), then v ← τ (x − x_n)/Δt. It brings placed panels together;
//! at usual sweep counts its rest state is centimetres too long (METHOD §1.5), so the static solve
//! follows.
//!
//! A step can be recorded on a [`Tape`] and walked back through: [`pull_back`] is its exact adjoint.

mod crease;
mod lanes;
pub mod pull_back;
mod rub;
mod stretch;
mod turn;

use super::cloth::{Cloth, ContactPoint, GRAVITY, Rest};
use super::energy::contact::{ContactParams, Surface};
use super::layers::Watch;
use crate::geometry::{Mat3, Vec3};
use serde::{Deserialize, Serialize};
use stretch::{Stretch, Visit};
use turn::Turn;

/// How to step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct StepParams {
    /// Time step Δt \[s\]. DiffXPBD: 0.0016.
    pub dt: f64,
    /// Sweeps over all constraints per step. Fewer stretch more.
    pub sweeps: usize,
    /// Rate η at which velocity is lost \[1/s\]; τ = exp(−η Δt). The paper's τ = 0.95 at
    /// Δt = 1/60 is 3.1.
    pub drag: f64,
    /// Fastest any vertex moves \[m/s\]: keeps cloth from passing through limbs.
    pub speed: f64,
    /// Pressure from within while panels come together \[Pa\], fading to nothing. Without contact
    /// of layers 20 Pa keep most layers of sleeves and legs apart; with it there is no need, and wide
    /// skirts fly up. A cloth of 0.2 kg/m² weighs 2 Pa. The paper has none.
    pub inflation: f64,
    /// Simulated time \[s\] before the static solve takes over; up to twice as long while layers
    /// still go through each other.
    pub time: f64,
}

impl Default for StepParams {
    fn default() -> Self {
        Self {
            dt: 1.0 / 120.0,
            sweeps: 12,
            drag: 3.1,
            speed: 1.5,
            inflation: 0.0,
            time: 1.5,
        }
    }
}

impl StepParams {
    /// Steps that make up the time.
    pub fn steps(&self) -> usize {
        (self.time / self.dt).ceil() as usize
    }
}

/// Positions and velocities.
#[derive(Clone, Debug)]
pub struct State {
    /// \[m\].
    pub x: Vec<Vec3>,
    /// \[m/s\].
    pub v: Vec<Vec3>,
}

/// Steps a cloth with one rest shape on one body.
pub struct Stepper<'a, S> {
    cloth: &'a Cloth,
    rest: &'a Rest,
    surface: &'a S,
    contact: ContactParams,
    params: StepParams,
    /// 1/m.
    w: Vec<f64>,
    stretch: Stretch,
    turn: Turn,
    lambda_fold: Vec<f64>,
    lambda_hold: Vec<f64>,
    /// Keeps layers of cloth apart.
    watch: Watch,
}

/// A contact point near the body: its contact linearised once per step.
#[derive(Clone, Copy, Debug)]
struct Touch {
    point: ContactPoint,
    /// ∂c/∂p: of length one but for the smoothing of the distance.
    normal: Vec3,
    /// c = normal·x − offset.
    offset: f64,
    alpha_tilde: f64,
    lambda: f64,
}

/// What one step did, visit by visit: enough to walk back through it.
#[derive(Clone, Debug, Default)]
pub struct Tape {
    /// Positions before the step \[m\].
    before: Vec<Vec3>,
    /// Positions after the sweeps, before moves are shortened \[m\].
    swept: Vec<Vec3>,
    /// F and Δλ of each visit to a triangle; none where its system could not be solved.
    membrane: Vec<Visit>,
    /// Δλ of each visit to a hinge.
    bend: Vec<Vec3>,
    /// Each visit to a fold.
    folds: Vec<crease::Visit>,
    /// Δλ of each visit to a hold.
    holds: Vec<f64>,
    /// λ after each visit to a contact.
    contact: Vec<f64>,
    /// Contacts with the λ they ended with.
    touching: Vec<Touch>,
    /// How far friction drew each of them back \[m\].
    rubbed: Vec<Vec3>,
}

impl<'a, S: Surface> Stepper<'a, S> {
    /// Prepares to step; `watch` keeps the layers apart.
    pub fn new(
        cloth: &'a Cloth,
        rest: &'a Rest,
        surface: &'a S,
        contact: ContactParams,
        params: StepParams,
        watch: Watch,
    ) -> Self {
        let w = inverse_masses(rest);
        Self {
            stretch: Stretch::new(cloth, rest, &w, params.dt),
            turn: Turn::new(cloth, rest, &w, params.dt),
            w,
            lambda_fold: vec![0.0; cloth.folds.len()],
            lambda_hold: vec![0.0; cloth.holds.len()],
            cloth,
            rest,
            surface,
            contact,
            params,
            watch,
        }
    }

    /// Goes on with another rest shape of the same cloth.
    pub fn grow(&mut self, rest: &'a Rest) {
        if std::ptr::eq(self.rest, rest) {
            return;
        }
        self.w = inverse_masses(rest);
        self.stretch.grow(rest, &self.w);
        self.turn.grow(rest, &self.w, self.params.dt);
        self.rest = rest;
    }

    /// Whether layers still went through each other when last looked at.
    pub fn tangled(&self) -> bool {
        self.watch.tangled()
    }

    /// Advances `state` by Δt under gravity and a `pressure` \[Pa\] from within.
    pub fn step(&mut self, state: &mut State, pressure: f64) {
        let mut wanted = vec![GRAVITY; state.x.len()];
        for t in &self.cloth.outward {
            let [a, b, c] = t.map(|v| state.x[v as usize]);
            let push = (b - a).cross(&(c - a)) * (pressure / 6.0);
            for v in t.map(|v| v as usize) {
                wanted[v] += push * self.w[v];
            }
        }
        self.advance(state, &wanted, None);
    }

    /// A [`Self::step`] without pressure, recorded on `tape`.
    pub fn record(&mut self, state: &mut State, tape: &mut Tape) {
        let gravity = vec![GRAVITY; state.x.len()];
        tape.clear();
        self.advance(state, &gravity, Some(tape));
    }

    fn advance(&mut self, state: &mut State, acceleration: &[Vec3], mut tape: Option<&mut Tape>) {
        let dt = self.params.dt;
        let before = state.x.clone();
        for ((x, v), g) in state.x.iter_mut().zip(&state.v).zip(acceleration) {
            *x += *v * dt + g * (dt * dt);
        }
        self.stretch.reset();
        self.turn.reset();
        self.lambda_fold.fill(0.0);
        self.lambda_hold.fill(0.0);
        let mut touching = self.touching(&before);
        let wish: Vec<Vec3> = state.x.iter().zip(&before).map(|(x, b)| x - b).collect();
        let mut apart = self.watch.constraints(&before, &wish, 1.0 / (dt * dt));
        for _ in 0..self.params.sweeps {
            let (membrane, bend) = match &mut tape {
                Some(tape) => (Some(&mut tape.membrane), Some(&mut tape.bend)),
                None => (None, None),
            };
            self.stretch.sweep(&mut state.x, membrane);
            self.turn.sweep(&mut state.x, bend);
            self.sweep_folds(&mut state.x, tape.as_deref_mut());
            self.sweep_holds(&mut state.x, tape.as_deref_mut());
            self.watch.sweep(&mut apart, &self.w, &mut state.x);
            self.sweep_contact(&mut touching, &mut state.x, tape.as_deref_mut());
        }
        self.rub(&touching, &before, &mut state.x, tape.as_deref_mut());
        if let Some(tape) = tape {
            tape.before.clone_from(&before);
            tape.swept.clone_from(&state.x);
            tape.touching = touching;
        }
        let farthest = self.params.speed * dt;
        for (x, start) in state.x.iter_mut().zip(&before) {
            let moved = *x - start;
            let length = moved.norm();
            if length > farthest {
                *x = start + moved * (farthest / length);
            }
        }
        self.watch.restrain(&before, &mut state.x);
        for ((x, v), start) in state.x.iter().zip(&mut state.v).zip(&before) {
            *v = (x - start) * self.kept();
        }
    }

    /// τ/Δt \[1/s\]: velocity kept per move.
    fn kept(&self) -> f64 {
        (-self.params.drag * self.params.dt).exp() / self.params.dt
    }

    fn sweep_holds(&mut self, x: &mut [Vec3], mut tape: Option<&mut Tape>) {
        let per_time = 1.0 / (self.params.dt * self.params.dt);
        for (hold, lambda) in self.cloth.holds.iter().zip(&mut self.lambda_hold) {
            let a = hold.vertex as usize;
            let alpha_tilde = per_time / hold.stiffness;
            let delta = -(x[a].y - hold.height + alpha_tilde * *lambda) / (self.w[a] + alpha_tilde);
            *lambda += delta;
            x[a].y += self.w[a] * delta;
            if let Some(tape) = &mut tape {
                tape.holds.push(delta);
            }
        }
    }

    fn sweep_contact(&self, touching: &mut [Touch], x: &mut [Vec3], mut tape: Option<&mut Tape>) {
        for touch in touching {
            let c = touch.normal.dot(&touch.point.at(x)) - touch.offset;
            let w = touch.point.inverse_mass(&self.w) * touch.normal.norm_squared();
            let wanted =
                touch.lambda + (-c - touch.alpha_tilde * touch.lambda) / (w + touch.alpha_tilde);
            let delta = wanted.max(0.0) - touch.lambda;
            touch.lambda += delta;
            for (a, weight) in touch.point.parts() {
                x[a] += touch.normal * (weight * self.w[a] * delta);
            }
            if let Some(tape) = &mut tape {
                tape.contact.push(touch.lambda);
            }
        }
    }

    /// Contacts of the positions before the step: a point outside thin parts (toes, fingers) then
    /// stays on its side of them.
    fn touching(&self, x: &[Vec3]) -> Vec<Touch> {
        let per_time = 1.0 / (self.params.dt * self.params.dt);
        let reach = self.contact.thickness + 2.0 * self.params.speed * self.params.dt;
        let touch = |point: &ContactPoint| {
            let p = point.at(x);
            let (d, gradient) = self.surface.distance_below(p, reach)?;
            let normal = slope(gradient)?;
            let kappa = self.contact.stiffness * point.area;
            Some(Touch {
                point: *point,
                normal,
                offset: normal.dot(&p) - (d - self.contact.thickness),
                alpha_tilde: per_time / kappa,
                lambda: 0.0,
            })
        };
        self.cloth.contacts.iter().filter_map(touch).collect()
    }
}

/// Slope of the distance below which it is that of a crease deep in the body \[–\].
const CREASE: f64 = 0.5;

/// The gradient of the distance as the contact takes it: as it is, so that the rest state is that of
/// the energy; made a unit vector in creases, where it fades; none where there is no direction.
fn slope(gradient: Vec3) -> Option<Vec3> {
    if gradient.norm() > CREASE {
        Some(gradient)
    } else {
        gradient.try_normalize(1e-3)
    }
}

impl Tape {
    /// Forgets what is on it, and keeps the room.
    fn clear(&mut self) {
        self.membrane.clear();
        self.bend.clear();
        self.folds.clear();
        self.holds.clear();
        self.contact.clear();
        self.rubbed.clear();
    }
}

/// 1/m \[1/kg\], `[cloth vertex]`.
fn inverse_masses(rest: &Rest) -> Vec<f64> {
    rest.mass.iter().map(|m| 1.0 / m).collect()
}

/// A x = b for symmetric positive definite 3×3 A, by LDLᵀ; none if a pivot is not positive.
fn solve_symmetric(a: &Mat3, b: &Vec3) -> Option<Vec3> {
    let d0 = a.m11;
    let l10 = a.m21 / d0;
    let l20 = a.m31 / d0;
    let d1 = a.m22 - l10 * a.m21;
    let l21 = (a.m32 - l20 * a.m21) / d1;
    let d2 = a.m33 - l20 * a.m31 - l21 * (a.m32 - l20 * a.m21);
    if !(d0 > 0.0 && d1 > 0.0 && d2 > 0.0) {
        return None;
    }
    let y1 = b.y - l10 * b.x;
    let y2 = b.z - l20 * b.x - l21 * y1;
    let z = y2 / d2;
    let y = y1 / d1 - l21 * z;
    Some(Vec3::new(b.x / d0 - l10 * y - l20 * z, y, z))
}
