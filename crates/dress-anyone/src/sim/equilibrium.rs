//! The static solve: f(x, x̄) = 0 by projected Newton with pseudo-transient continuation.
//!
//! Every iteration solves (K + σM) d = f. σ \[1/s²\] starts high, which makes the step a damped,
//! implicit fall, and goes to zero as the cloth settles, which makes it Newton's. Elements are
//! clamped to positive semi-definite until the residual is small. Steps must lower the energy, so
//! the path cannot end on a saddle that the exact stiffness shows.

use super::cloth::Cloth;
use super::energy::contact::Surface;
use super::energy::layers::Pair;
use super::layers::{Layers, hold_apart};
use super::system::{Assembly, System};
use crate::geometry::Vec3;
use crate::geometry::sparse::{Factor, Workspace};
use serde::{Deserialize, Serialize};

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

/// How a search for equilibrium ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum RestStatus {
    /// The residual is below the tolerance, or as low as round-off lets it be.
    AtRest,
    /// The largest number of iterations was reached.
    IterationLimit,
    /// The garment still moves as a whole: nothing holds it.
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
        let mut touch = Self {
            pairs: layers.pairs(x, &still, 0.0),
            assembly,
        };
        touch.make_room(cloth, layers, x);
        touch
    }

    /// Couples all pairs that touch at `x`. Those that nearly touch are taken in along with them,
    /// so that the structure lasts for a while.
    fn make_room(&mut self, cloth: &Cloth, layers: &mut Layers, x: &[Vec3]) {
        let touches = |pair: &Pair| {
            let corners = pair.vertices.map(|a| x[a as usize]);
            pair.closest(corners).r.norm() < pair.h
        };
        let room = |pair: &Pair| !touches(pair) || self.assembly.couples(pair);
        if !self.pairs.iter().all(room) {
            let still = vec![Vec3::zeros(); x.len()];
            let near = layers.pairs(x, &still, SPARE * layers.thickness());
            self.assembly = Assembly::coupling(cloth, &near);
        }
    }
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
/// Residual below which energy differences drown in round-off, and the residual itself must fall.
const ROUND_OFF_BELOW: f64 = 1e-4;
/// A garment whose centre moves this far \[m\] over [`SLIDE_WINDOW`] late iterations slides.
const SLIDE: f64 = 0.01;
/// Iterations over which sliding is judged.
const SLIDE_WINDOW: usize = 10;
/// Sliding is judged only after this many iterations.
const SETTLED_AFTER: usize = 100;

/// Finds the equilibrium near `x`, where layers touch as `touch` says, starting with damping `sigma`.
/// `observe` is told the iteration, the residual and the positions, and may ask to stop by returning
/// `false`.
pub fn find<S: Surface>(
    system: &System<'_, S>,
    layers: &mut Layers,
    mut touch: Touch,
    mut x: Vec<Vec3>,
    mut sigma: f64,
    params: &EquilibriumParams,
    observe: &mut dyn FnMut(usize, f64, &[Vec3]) -> bool,
) -> Equilibrium {
    let mut energy = system.energy(&x, &touch.pairs);
    let mut force = system.force(&x, &touch.pairs);
    let mut residual = system.residual(&force);
    let mut exactness: f64 = if residual < EXACT_BELOW { 1.0 } else { 0.0 };
    let mut growth = MOST_GROWTH;
    let mut centres = vec![centre(&x)];
    let mut status = RestStatus::IterationLimit;
    let mut iterations = 0;
    let mut fresh_starts = 0;
    let mut workspace = Workspace::default();
    loop {
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
        if !observe(iterations, residual, &x) {
            status = RestStatus::Stopped;
            break;
        }
        iterations += 1;
        let factor = damped_factor(system, &touch, &x, sigma, exactness, &mut workspace);
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
        let mut direction = factor.solve(&force);
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
        let near = layers.pairs(&x, &direction, 0.0);
        hold_apart(&near, &x, &mut direction);
        let Some(step) = line_search(system, &near, &x, &direction, energy, residual) else {
            if sigma < MOST_SIGMA {
                sigma = 10.0 * sigma.max(1.0);
            } else if fresh_starts < FRESH_STARTS {
                fresh_starts += 1;
                sigma = params.warm;
                exactness = 0.0;
                energy = system.energy(&x, &near);
                touch.pairs = near;
            } else {
                status = RestStatus::Stalled;
                break;
            }
            continue;
        };
        x = step.x;
        force = step.force;
        residual = step.residual;
        energy = step.energy;
        touch.pairs = near;
        touch.make_room(system.cloth, layers, &x);
        if residual >= EXACT_BELOW {
            exactness = 0.0;
        } else {
            exactness = (exactness + growth).min(1.0);
            growth = (1.5 * growth).min(MOST_GROWTH);
        }
        if step.fraction < 1.0 {
            sigma *= 2.0;
        } else if farthest < 10.0 * params.step {
            sigma *= 0.3;
            if sigma < LEAST_SIGMA {
                sigma = if residual < 1e-2 { 0.0 } else { LEAST_SIGMA };
            }
        }
        centres.push(centre(&x));
        if slides(&centres) {
            status = RestStatus::Sliding;
            break;
        }
    }
    Equilibrium {
        x,
        residual,
        iterations,
        status,
        touch,
    }
}

/// Factor of K + σM; none when it is not positive definite.
fn damped_factor<S: Surface>(
    system: &System<'_, S>,
    touch: &Touch,
    x: &[Vec3],
    sigma: f64,
    exactness: f64,
    workspace: &mut Workspace,
) -> Option<Factor> {
    let mut k = system.stiffness(&touch.assembly, x, &touch.pairs, exactness);
    k.add_diagonal(sigma, &system.rest.mass);
    k.factor_in(workspace)
}

/// An accepted step.
struct Step {
    x: Vec<Vec3>,
    force: Vec<Vec3>,
    residual: f64,
    energy: f64,
    fraction: f64,
}

/// The largest of a few fractions of `direction` that lowers the energy, or — near rest, where
/// energies cannot tell — the residual.
fn line_search<S: Surface>(
    system: &System<'_, S>,
    pairs: &[Pair],
    x: &[Vec3],
    direction: &[Vec3],
    energy: f64,
    residual: f64,
) -> Option<Step> {
    for fraction in [1.0, 0.5, 0.25, 0.1, 0.03] {
        let moved: Vec<Vec3> = x
            .iter()
            .zip(direction)
            .map(|(p, d)| p + d * fraction)
            .collect();
        let new_energy = system.energy(&moved, pairs);
        let lower = new_energy < energy;
        let drowned = residual < ROUND_OFF_BELOW && new_energy <= energy + 1e-10 * energy.abs();
        if !lower && !drowned {
            continue;
        }
        let force = system.force(&moved, pairs);
        let new_residual = system.residual(&force);
        if drowned && new_residual >= residual {
            continue;
        }
        return Some(Step {
            x: moved,
            force,
            residual: new_residual,
            energy: new_energy,
            fraction,
        });
    }
    None
}

/// Mean position.
fn centre(x: &[Vec3]) -> Vec3 {
    x.iter().sum::<Vec3>() / x.len() as f64
}

/// Whether the garment's centre keeps moving late in the search.
fn slides(centres: &[Vec3]) -> bool {
    let n = centres.len();
    n > SETTLED_AFTER && (centres[n - 1] - centres[n - 1 - SLIDE_WINDOW]).norm() > SLIDE
}
