//! Placed panels draped from coarse to fine: a mesh of a quarter of the vertices comes to rest first,
//! and the fine one starts from there.
//!
//! Closing seams and falling takes as many steps in any mesh, and a coarse one does them for a small
//! part of the price. What it ends with needs to be near a state of rest only; the fine mesh's own
//! static solve decides. Where only the carried cloth goes through itself, steps untangle it first. Where the
//! coarse one does, or does not come to rest, the fine mesh starts from its panels after all. What slides off
//! in a coarse mesh would in the fine one.

use super::Dressing;
use super::placed::placed;
use crate::garment::Garment;
use crate::geometry::{Vec3, intersections};
use crate::pattern::resample::resample;
use crate::sim::drape::Observer;
use crate::sim::equilibrium::{EquilibriumParams, RestStatus};
use crate::sim::{Drape, SimParams, Solver, Start};

/// Vertices of a mesh over those of the next coarser one.
const COARSENING: usize = 4;
/// Fewest vertices of a mesh: a coarser one could not show sleeves and collars.
const LEAST: usize = 400;
/// Residual at which a coarse mesh is near enough to rest \[–\]: its energy then falls by some 10⁻⁵
/// more, and its forces are small beside those that the finer mesh begins with.
pub(super) const NEAR_REST: f64 = 1.0;

/// Fall of a vertex that comes off the body with its garment \[m\], and how large a part of the vertices
/// then falls so far: a hood alone may, and so may the sides of a skirt.
const FALLEN: f64 = 0.3;
const MOST: f64 = 0.75;

/// Drapes from the placed panels. What comes to rest far below where it was placed counts as sliding.
pub(super) fn from_panels(
    on: &Dressing<'_>,
    garment: &Garment,
    sim: &SimParams,
    observe: &mut Observer<'_>,
) -> Drape {
    let (placed, short) = placed(garment, on.body);
    // Who asked to stop once is not asked again.
    let mut go_on = true;
    let mut observe = |progress, x: &dyn Fn() -> Vec<Vec3>| {
        go_on = go_on && observe(progress, x);
        go_on
    };
    if let Some(coarse) = coarser(garment, sim) {
        let nearly = SimParams {
            equilibrium: EquilibriumParams {
                tolerance: sim.equilibrium.tolerance.max(NEAR_REST),
                ..sim.equilibrium
            },
            ..*sim
        };
        let carry = |x: &[Vec3]| resample(&coarse.mesh, x, &garment.mesh);
        let found = from_panels(on, &coarse, &nearly, &mut |progress, x| {
            observe(progress, &|| carry(&x()))
        });
        let carried = carry(&found.x);
        if found.status == RestStatus::Sliding {
            let mut drape = on.drape(
                garment,
                &placed,
                carried,
                Start::Near,
                &without_iterations(sim),
                &mut observe,
            );
            drape.iterations = found.iterations;
            drape.status = RestStatus::Sliding;
            return drape;
        }
        let apart = |x: &[Vec3], garment: &Garment| {
            intersections::within(x, &garment.mesh.cloth_triangles()).is_empty()
        };
        if found.status == RestStatus::AtRest && apart(&found.x, &coarse) {
            let start = if apart(&carried, garment) {
                Start::Near
            } else {
                Start::Tangled
            };
            let mut drape = on.drape(garment, &placed, carried, start, sim, &mut observe);
            drape.iterations += found.iterations;
            return drape;
        }
    }
    let start = Start::Placed { short };
    let mut drape = on.drape(garment, &placed, placed.clone(), start, sim, &mut observe);
    let ended = [
        RestStatus::AtRest,
        RestStatus::Stalled,
        RestStatus::IterationLimit,
    ];
    if ended.contains(&drape.status) && fell(&placed, &drape.x) {
        drape.status = RestStatus::Sliding;
    }
    drape
}

/// A search that only tells the residual.
fn without_iterations(sim: &SimParams) -> SimParams {
    SimParams {
        equilibrium: EquilibriumParams {
            iterations: 0,
            ..sim.equilibrium
        },
        ..*sim
    }
}

/// Whether a garment at `x` has come off the body around which it was placed.
fn fell(placed: &[Vec3], x: &[Vec3]) -> bool {
    let fallen = placed.iter().zip(x).filter(|(p, x)| p.y - x.y > FALLEN);
    fallen.count() as f64 > MOST * x.len() as f64
}

/// The garment in a coarser mesh; none if it has few vertices, cannot be meshed so coarsely, or is
/// draped in the paper's way.
fn coarser(garment: &Garment, sim: &SimParams) -> Option<Garment> {
    let wanted = garment.mesh.cloth_vertex_count / COARSENING;
    if sim.solver == Solver::Xpbd || wanted < LEAST {
        return None;
    }
    garment.remeshed(wanted)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::fixtures::two_panels;
    use crate::pattern::triangulate;

    /// Two panels that would be too small for a coarser mesh, in a mesh of their own.
    fn garment(edge: f64) -> Garment {
        let (pattern, _) = two_panels();
        Garment {
            name: "tube".to_owned(),
            mesh: triangulate::mesh(&pattern, edge).expect("two rectangles can be meshed"),
            pattern,
            drape: None,
        }
    }

    #[test]
    fn a_coarser_mesh_has_about_a_quarter_of_the_vertices() {
        let fine = garment(0.008);
        let count = fine.mesh.cloth_vertex_count;
        assert!(count > COARSENING * LEAST);
        let coarse = coarser(&fine, &SimParams::default()).expect("it is fine enough");
        let ratio = count as f64 / coarse.mesh.cloth_vertex_count as f64;
        // Boundaries count more in a coarse mesh.
        assert!((0.8..1.2).contains(&(ratio / COARSENING as f64)), "{ratio}");
    }

    #[test]
    fn a_garment_has_come_off_when_most_of_it_lies_far_below() {
        let placed = vec![Vec3::zeros(); 100];
        // A hood, a third of the garment, lies on the back; trousers lie about the feet.
        let fallen =
            |count: usize| (0..100).map(move |v| Vec3::y() * if v < count { -0.4 } else { 0.0 });
        assert!(!fell(&placed, &fallen(33).collect::<Vec<_>>()));
        assert!(fell(&placed, &fallen(90).collect::<Vec<_>>()));
        // A loose waist comes down to the hips.
        let sunk: Vec<Vec3> = placed.iter().map(|p| p - Vec3::y() * 0.2).collect();
        assert!(!fell(&placed, &sunk));
    }

    #[test]
    fn few_vertices_and_the_papers_way_have_no_coarser_mesh() {
        assert!(coarser(&garment(0.05), &SimParams::default()).is_none());
        let paper = SimParams {
            solver: Solver::Xpbd,
            ..SimParams::default()
        };
        assert!(coarser(&garment(0.008), &paper).is_none());
    }
}
