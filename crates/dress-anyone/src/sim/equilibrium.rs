//! The static solve: f(x, x̄) = 0 by projected Newton with pseudo-transient continuation.
//!
//! Every iteration solves (K + σM) d = f. σ \[1/s²\] starts high, which makes the step a damped,
//! implicit fall, and goes to zero as the cloth settles, which makes it Newton's. Elements are
//! clamped to positive semi-definite until the residual is small. Steps must lower the energy, so
//! the path cannot end on a saddle that the exact stiffness shows. Where one leaves large forces in a few
//! places, their surroundings settle first, by themselves (`equilibrium/patch.rs`).

mod patch;
mod slide;

use super::cloth::Cloth;
use super::energy::contact::Surface;
use super::energy::layers::Pair;
use super::layers::Layers;
use super::system::{Assembly, System};
use crate::geometry::Vec3;
use crate::geometry::sparse::Workspace;
use patch::Patch;
use serde::{Deserialize, Serialize};
use slide::Late;

/// How to look for equilibrium.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct EquilibriumParams {
    /// Residual ‖f‖/(‖m‖|g|) at which a drape counts as at rest \[–\]. The paper has none: it
    /// stops after a number of steps.
    pub tolerance: f64,
    /// Residual to which the state is polished before it is differentiated \[–\].
    pub polished: f64,
    /// Largest number of factorisations.
    pub iterations: usize,
    /// Farthest any vertex moves in one iteration \[m\]. Higher is faster and may jump through
    /// thin limbs.
    pub step: f64,
    /// First σ of a drape from placed panels \[1/s²\].
    pub cold: f64,
    /// First σ of a drape from a nearby one \[1/s²\].
    pub warm: f64,
}

impl Default for EquilibriumParams {
    fn default() -> Self {
        Self {
            tolerance: 1e-6,
            polished: 1e-9,
            iterations: 400,
            step: 0.02,
            cold: 1e3,
            warm: 1.0,
        }
    }
}

impl EquilibriumParams {
    /// The same, but no nearer to rest than `residual` \[–\].
    pub(crate) fn no_nearer_than(self, residual: f64) -> Self {
        Self {
            tolerance: self.tolerance.max(residual),
            polished: self.polished.max(residual),
            ..self
        }
    }
}

/// How a search for equilibrium ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestStatus {
    /// The residual is below the tolerance, or as low as round-off lets it be.
    AtRest,
    /// The largest number of iterations was reached.
    IterationLimit,
    /// The garment still falls, most of it: nothing holds it.
    Sliding,
    /// No step lowers the energy any more, though the residual is above the tolerance.
    Stalled,
    /// Positions or forces stopped being finite numbers.
    NotFinite,
    /// The caller asked to stop.
    Stopped,
}

/// Where a search for equilibrium ended.
#[derive(Clone, Debug)]
pub struct Equilibrium {
    /// Positions \[m\].
    pub x: Vec<Vec3>,
    /// ‖f‖/(‖m‖|g|).
    pub residual: f64,
    /// Factorisations used.
    pub iterations: usize,
    /// How it ended.
    pub status: RestStatus,
    /// Layers that may touch there, and a matrix structure that couples those that do.
    pub touch: Touch,
}

/// Layers that may touch at a state, and the matrix structure that goes with them.
#[derive(Clone, Debug)]
pub struct Touch {
    /// All pairs closer than the thickness, and some more.
    pub pairs: Vec<Pair>,
    /// Couples the pairs that touch.
    pub assembly: Assembly,
}

impl Touch {
    /// Pairs near enough to touch at `x`, and structure for them; `assembly` is kept as long as it
    /// has room for all that touch.
    pub fn at(cloth: &Cloth, layers: &mut Layers, x: &[Vec3], assembly: Assembly) -> Self {
        let still = vec![Vec3::zeros(); x.len()];
        let pairs = layers.pairs(x, &still, 0.0);
        let assembly = with_room(assembly, cloth, layers, x, &pairs);
        Self { pairs, assembly }
    }
}

/// An assembly that couples those of the `pairs` that touch at `x`: the one at hand as long as it has room.
/// Those that nearly touch are taken in along with them, so that the structure lasts for a while.
fn with_room(
    assembly: Assembly,
    cloth: &Cloth,
    layers: &mut Layers,
    x: &[Vec3],
    pairs: &[Pair],
) -> Assembly {
    let touches = |pair: &Pair| {
        let corners = pair.vertices.map(|a| x[a as usize]);
        pair.closest(corners).r.norm() < pair.h
    };
    let room = |pair: &Pair| !touches(pair) || assembly.couples(pair);
    if pairs.iter().all(room) {
        return assembly;
    }
    let still = vec![Vec3::zeros(); x.len()];
    let near = layers.pairs(x, &still, SPARE * layers.thickness());
    Assembly::coupling(cloth, &near)
}

/// Distance beyond the thickness, as a part of it, at which layers get room in the matrix.
const SPARE: f64 = 0.5;

/// Residual above which compressive stress is left out: far from rest it only makes steps fail.
const EXACT_BELOW: f64 = 3.0;
/// Damping below which there might as well be none \[1/s²\].
const LEAST_SIGMA: f64 = 1e-3;
/// Damping at which a step is so short that energies cannot tell any more \[1/s²\].
const MOST_SIGMA: f64 = 1e12;
/// How often the search starts afresh from where no step lowers the energy.
const FRESH_STARTS: usize = 2;
/// Below this part of the compressive stress none of it is tried.
const LEAST_EXACTNESS: f64 = 0.1;
/// Most by which the part of the compressive stress grows in one iteration.
const MOST_GROWTH: f64 = 0.25;
/// Least such growth: what a part that proves too large halves comes back with time.
const LEAST_GROWTH: f64 = 0.05;
/// Newton steps that move no vertex farther than this are round-off of positions of a metre or two \[m\]:
/// in fine cloth they end before the residual is as low as asked for.
const ROUND_OFF: f64 = 1e-14;
/// Residual below which energy differences may drown in round-off, and it is enough that the residual falls.
const ROUND_OFF_BELOW: f64 = 1e-4;
/// What energies, sums of some 10⁵ terms, may be off by, as a part of them \[–\].
const ROUND_OFF_OF_ENERGY: f64 = 1e-13;
/// Least part of a step after which a patch may settle: shorter ones fail for another reason.
const LEAST_PATCHED: f64 = 0.25;
/// Forces that a patch settles to, as part of those before the step; a step that leaves less needs none.
const PATCH_TOLERANCE: f64 = 0.3;
/// Most factorisations of a patch, and the damping it starts with \[1/s²\].
const PATCH_ITERATIONS: usize = 15;
const PATCH_SIGMA: f64 = 0.1;

/// Finds the equilibrium near `x`, where layers touch as `touch` says, starting with damping `sigma`.
/// `observe` is told the iteration, the residual and the positions, and may ask to stop by returning
/// `false`.
pub fn find<S: Surface>(
    system: &System<'_, S>,
    layers: &mut Layers,
    touch: Touch,
    x: Vec<Vec3>,
    mut sigma: f64,
    params: &EquilibriumParams,
    observe: &mut dyn FnMut(usize, f64, &[Vec3]) -> bool,
) -> Equilibrium {
    let Touch {
        pairs,
        mut assembly,
    } = touch;
    let mut state = State::at(system, x, pairs);
    let mut exactness: f64 = if state.residual < EXACT_BELOW {
        1.0
    } else {
        0.0
    };
    let mut growth = MOST_GROWTH;
    let mut late = Late::new(&state.x);
    let mut status = RestStatus::IterationLimit;
    let mut iterations = 0;
    let mut fresh_starts = 0;
    let mut workspace = Workspace::default();
    loop {
        let residual = state.residual;
        if !residual.is_finite() {
            status = RestStatus::NotFinite;
            break;
        }
        if residual < params.tolerance {
            status = RestStatus::AtRest;
            break;
        }
        if iterations >= params.iterations {
            break;
        }
        if !observe(iterations, residual, &state.x) {
            status = RestStatus::Stopped;
            break;
        }
        iterations += 1;
        let mut k = system.stiffness(&assembly, &state.x, &state.pairs, exactness);
        k.add_diagonal(sigma, &system.rest.mass);
        let factor = k.factor_in(&mut workspace);
        let Some(factor) = factor else {
            // Less exact is more definite; not exact at all it is indefinite only by round-off.
            if exactness > 0.0 {
                growth = (0.5 * growth).max(LEAST_GROWTH);
                exactness = if exactness > LEAST_EXACTNESS {
                    0.4 * exactness
                } else {
                    0.0
                };
            } else {
                sigma = 10.0 * sigma.max(1.0);
            }
            continue;
        };
        let mut direction = factor.solve(&state.force);
        workspace.recycle(factor);
        let farthest = direction.iter().map(Vec3::norm).fold(0.0, f64::max);
        if !farthest.is_finite() {
            status = RestStatus::NotFinite;
            break;
        }
        if farthest < ROUND_OFF && sigma <= LEAST_SIGMA {
            status = RestStatus::AtRest;
            break;
        }
        let scale = (params.step / farthest).min(1.0);
        for d in &mut direction {
            *d *= scale;
        }
        let near = layers.hold_apart(&state.x, &mut direction);
        let found = line_search(system, layers, &state, &direction, &near, params);
        let Some((next, fraction)) = found else {
            if sigma < MOST_SIGMA {
                sigma = 10.0 * sigma.max(1.0);
            } else if fresh_starts < FRESH_STARTS {
                fresh_starts += 1;
                sigma = params.warm;
                exactness = 0.0;
                state.energy = system.energy(&state.x, &near);
                state.pairs = near;
            } else {
                status = RestStatus::Stalled;
                break;
            }
            continue;
        };
        state = next;
        assembly = with_room(assembly, system.cloth, layers, &state.x, &state.pairs);
        if state.residual >= EXACT_BELOW {
            exactness = 0.0;
        } else {
            exactness = (exactness + growth).min(1.0);
            growth = (1.5 * growth).min(MOST_GROWTH);
        }
        if fraction < 1.0 {
            sigma *= 2.0;
        } else if farthest < 10.0 * params.step {
            sigma *= 0.3;
            if sigma < LEAST_SIGMA {
                sigma = if state.residual < 1e-2 {
                    0.0
                } else {
                    LEAST_SIGMA
                };
            }
        }
        if late.slides(&state.x) {
            status = RestStatus::Sliding;
            break;
        }
    }
    let State {
        x, residual, pairs, ..
    } = state;
    Equilibrium {
        x,
        residual,
        iterations,
        status,
        touch: Touch { pairs, assembly },
    }
}

/// A state on the way.
struct State {
    x: Vec<Vec3>,
    /// All layers that may touch there, and more.
    pairs: Vec<Pair>,
    energy: f64,
    force: Vec<Vec3>,
    residual: f64,
}

impl State {
    fn at<S: Surface>(system: &System<'_, S>, x: Vec<Vec3>, pairs: Vec<Pair>) -> Self {
        let energy = system.energy(&x, &pairs);
        Self::of_energy(energy, system, x, pairs)
    }

    fn of_energy<S: Surface>(
        energy: f64,
        system: &System<'_, S>,
        x: Vec<Vec3>,
        pairs: Vec<Pair>,
    ) -> Self {
        let force = system.force(&x, &pairs);
        Self {
            energy,
            residual: system.residual(&force),
            x,
            pairs,
            force,
        }
    }

    /// The same once the patch in which forces are large has settled alone, to forces like those of a state of
    /// residual `before`; none if there is no such patch.
    fn with_patch_settled<S: Surface>(
        &self,
        system: &System<'_, S>,
        layers: &mut Layers,
        before: f64,
        params: &EquilibriumParams,
    ) -> Option<Self> {
        let patch = Patch::about(system, &self.pairs, &self.x, &self.force)?;
        let small = patch.system(system);
        let x = patch.cut(&self.x);
        let mut own = Layers::new(&patch.cloth, *layers.params(), &x);
        let touch = Touch::at(&patch.cloth, &mut own, &x, Assembly::new(&patch.cloth));
        let share = system.rest.weight() / small.rest.weight();
        let params = EquilibriumParams {
            tolerance: (PATCH_TOLERANCE * before * share).max(params.tolerance),
            iterations: PATCH_ITERATIONS,
            ..*params
        };
        let found = find(
            &small,
            &mut own,
            touch,
            x,
            PATCH_SIGMA,
            &params,
            &mut |_, _, _| true,
        );
        let mut direction = patch.moves(&self.x, &found.x);
        let pairs = layers.hold_apart(&self.x, &mut direction);
        Some(Self::at(system, moved(&self.x, &direction, 1.0), pairs))
    }
}

/// Where the largest of a few fractions of `direction` leads to that lowers the energy, or — near rest, where
/// energies cannot tell — the residual; `near` are all layers that it may bring together.
fn line_search<S: Surface>(
    system: &System<'_, S>,
    layers: &mut Layers,
    from: &State,
    direction: &[Vec3],
    near: &[Pair],
    params: &EquilibriumParams,
) -> Option<(State, f64)> {
    for fraction in [1.0, 0.5, 0.25, 0.1, 0.03] {
        let x = moved(&from.x, direction, fraction);
        let energy = system.energy(&x, near);
        let lower = energy < from.energy;
        let drowned =
            from.residual < ROUND_OFF_BELOW && energy <= from.energy + 1e-10 * from.energy.abs();
        let may_settle = !drowned && energy.is_finite() && fraction >= LEAST_PATCHED;
        if !(lower || drowned || may_settle) {
            continue;
        }
        let step = State::of_energy(energy, system, x, near.to_vec());
        if may_settle && !(lower && step.residual < PATCH_TOLERANCE * from.residual) {
            let settled = step.with_patch_settled(system, layers, from.residual, params);
            if let Some(settled) = settled.filter(|settled| settled.energy < from.energy) {
                return Some((settled, fraction));
            }
        }
        let clearly_lower = energy < from.energy - ROUND_OFF_OF_ENERGY * from.energy.abs();
        let better = if drowned {
            clearly_lower || step.residual < from.residual
        } else {
            lower
        };
        if better {
            return Some((step, fraction));
        }
    }
    None
}

/// `x` and a part of a move.
fn moved(x: &[Vec3], direction: &[Vec3], fraction: f64) -> Vec<Vec3> {
    let along = x.iter().zip(direction);
    along.map(|(p, d)| p + d * fraction).collect()
}
