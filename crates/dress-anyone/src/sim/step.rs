//! One XPBD time step (paper §3.1; Macklin et al. 2016, with the velocity factor τ).
//!
//! x̃ = x + Δt v + Δt² g, then sweeps of (∇C M⁻¹ ∇Cᵀ + α̃) Δλ = −C − α̃λ over membrane, bending, folds,
//! holds, layers and contact in a fixed order (in parts of the cloth, `part`, and in lanes,
//! `lanes`), then v ← τ (x − x_n)/Δt. It brings placed panels together; at usual sweep counts its rest state is
//! centimetres too long (METHOD §1.5), so the static solve follows.
//!
//! A step can be recorded and walked back through: `pull_back` is its exact adjoint.

mod apart;
mod contact;
mod crease;
mod hold;
mod lanes;
mod part;
mod pull_back;
mod rub;
mod stretch;
mod taped;
mod turn;

use super::cloth::{Cloth, GRAVITY, Rest};
use super::energy::contact::{ContactParams, Surface};
use super::layers::Watch;
use crate::geometry::Vec3;
pub(super) use apart::Apart;
use apart::Aparts;
use contact::Look;
use lanes::{Four, row};
use part::{MOST, Part, Sweep};
use serde::{Deserialize, Serialize};

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
    /// Simulated time \[s\] before the static solve takes over; up to eight times as long while layers
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

    /// τ/Δt \[1/s\]: velocity kept per move.
    pub(super) fn kept(&self) -> f64 {
        (-self.drag * self.dt).exp() / self.dt
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
    /// Keeps layers of cloth apart.
    watch: Watch,
    /// All constraints.
    whole: Part,
    /// The cloth vertex at each place of the whole, and the place of each cloth vertex.
    order: Vec<u32>,
    place: Vec<u32>,
    /// Positions before and in the step \[m\], with inverse masses \[1/kg\]; `[place]`.
    before: Vec<Four>,
    rows: Vec<Four>,
    /// How far each vertex may sink into the body \[m\]; `[place]`.
    sinks: Vec<f64>,
    /// Gradient by inverse masses of the steps walked back through, `[cloth vertex]`.
    w_hat: Vec<f64>,
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
        Self::in_parts(cloth, rest, surface, contact, params, watch, MOST)
    }

    /// The same, in parts of up to `most` vertices.
    fn in_parts(
        cloth: &'a Cloth,
        rest: &'a Rest,
        surface: &'a S,
        contact: ContactParams,
        params: StepParams,
        watch: Watch,
        most: usize,
    ) -> Self {
        let (whole, order, place) = Part::whole(cloth, contact, params.dt, most);
        let mut stepper = Self {
            cloth,
            rest,
            surface,
            contact,
            params,
            watch,
            whole,
            order,
            place,
            before: vec![Four::default(); cloth.vertex_count],
            rows: Vec::new(),
            sinks: vec![0.0; cloth.vertex_count],
            w_hat: Vec::new(),
        };
        stepper.take_on(rest);
        stepper
    }

    /// Goes on with another rest shape of the same cloth.
    pub fn grow(&mut self, rest: &'a Rest) {
        if !std::ptr::eq(self.rest, rest) {
            self.take_on(rest);
        }
    }

    fn take_on(&mut self, rest: &'a Rest) {
        let inverse_mass = |v: &u32| 1.0 / rest.mass[*v as usize];
        let w: Vec<f64> = self.order.iter().map(inverse_mass).collect();
        self.whole.grow(rest, &w);
        for (row, w) in self.before.iter_mut().zip(w) {
            row.0[3] = w;
        }
        self.rest = rest;
    }

    /// Whether layers still went through each other when last looked at.
    pub fn tangled(&self) -> bool {
        self.watch.tangled()
    }

    /// Lets layers that go through each other sink into the body by up to `depth` \[m\], and nothing else:
    /// pressed against it they do not come apart.
    pub fn let_tangled_sink(&mut self, depth: f64) {
        for (sinks, v) in self.sinks.iter_mut().zip(&self.order) {
            *sinks = if self.watch.is_tangled(*v) {
                depth
            } else {
                0.0
            };
        }
    }

    /// Advances `state` by Δt under gravity and a `pressure` \[Pa\] from within.
    pub fn step(&mut self, state: &mut State, pressure: f64) {
        let mut wanted = vec![GRAVITY; state.x.len()];
        if pressure != 0.0 {
            for t in &self.cloth.outward {
                let t = t.map(|v| v as usize);
                let [a, b, c] = t.map(|v| state.x[v]);
                let push = (b - a).cross(&(c - a)) * (pressure / 6.0);
                for v in t {
                    wanted[v] += push / self.rest.mass[v];
                }
            }
        }
        self.advance(state, &wanted, false);
    }

    /// A [`Self::step`] without pressure, recorded so that it can be walked back through.
    pub fn record(&mut self, state: &mut State) {
        let gravity = vec![GRAVITY; state.x.len()];
        self.advance(state, &gravity, true);
    }

    fn advance(&mut self, state: &mut State, acceleration: &[Vec3], record: bool) {
        let dt = self.params.dt;
        let wish: Vec<Vec3> = (state.v.iter().zip(acceleration))
            .map(|(v, g)| *v * dt + g * (dt * dt))
            .collect();
        self.rows.clear();
        for (before, v) in self.before.iter_mut().zip(&self.order) {
            let x = state.x[*v as usize];
            *before = row(x, before.0[3]);
            self.rows.push(row(x + wish[*v as usize], before.0[3]));
        }
        let apart = self.watch.constraints(&state.x, &wish, 1.0 / (dt * dt));
        let mut apart = Aparts::new(apart, &self.place);
        // One entry into the pool of threads serves all sweeps.
        rayon::scope(|_| self.sweep(&mut apart, record));
        let farthest = self.params.speed * dt;
        let mut moved = state.x.clone();
        for ((before, row), v) in self.before.iter().zip(&self.rows).zip(&self.order) {
            let start = before.vector();
            let by = row.vector() - start;
            let length = by.norm();
            moved[*v as usize] = if length > farthest {
                start + by * (farthest / length)
            } else {
                row.vector()
            };
        }
        let before = std::mem::replace(&mut state.x, moved);
        self.watch.restrain(&before, &mut state.x);
        for ((x, v), start) in state.x.iter().zip(&mut state.v).zip(&before) {
            *v = (x - start) * self.params.kept();
        }
    }

    /// All sweeps over the constraints, and friction.
    fn sweep(&mut self, apart: &mut Aparts, record: bool) {
        let (before, rows) = (&self.before, &mut self.rows);
        let reach = self.contact.thickness + 2.0 * self.params.speed * self.params.dt;
        self.whole.look(Look {
            surface: self.surface,
            params: &self.contact,
            reach,
            rows: before,
            sinks: &self.sinks,
        });
        for sweep in 0..self.params.sweeps {
            let first = sweep == 0;
            self.whole.sweep(rows, Sweep { first, record });
            apart.sweep(rows);
            self.whole.sweep_contacts(rows, record);
        }
        self.whole.rub(before, rows);
    }
}
