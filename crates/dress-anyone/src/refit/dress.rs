//! A garment put on a body: what holds it up, and its drape from the placed panels.

mod clear;
mod coarse;
mod placed;

use super::RefitParams;
use crate::body::Body;
use crate::body::distance_field::DistanceField;
use crate::garment::Garment;
use crate::geometry::{Vec3, intersections};
use crate::pattern::{Edge, EdgeId};
use crate::sim::drape::Observer;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Assembly, Cloth, Drape, Hold, OrFabric, Scene, SimParams, Start, drape};
pub use placed::lift;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// What keeps a garment at its height where shape alone would let it slide.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct HoldParams {
    /// Edge labels that are held: waistlines and the tops of strapless bodices, which cling by
    /// friction or elastic that the drape does not model.
    pub labels: Vec<String>,
    /// Stiffness of the hold per length of the edge \[N/m²\]: 1e4 lets a waistband carrying 5 N/m
    /// sink by half a millimetre.
    pub stiffness: f64,
    /// Cloth that reaches this far above an edge hangs from what is up there: the waist of a dress
    /// needs no hold \[m\].
    pub carried: f64,
    /// Whether the upper rim is held, too: free edges at the top of the garment. A pattern without labels
    /// that slides off is draped again so.
    pub rim: bool,
    /// Coulomb's coefficient of cloth on the body with which a garment is draped again that slides off
    /// without friction \[–\]; 0 lets it slide. Textiles on skin have 0.2 to 0.6 (Derler & Gerhardt
    /// 2012).
    pub friction: OrFabric,
}

impl Default for HoldParams {
    fn default() -> Self {
        Self {
            labels: vec!["lower_interface".to_owned(), "strapless_top".to_owned()],
            stiffness: 1e4,
            carried: 0.15,
            rim: false,
            friction: OrFabric::Fabric,
        }
    }
}

/// Springs that keep the vertices of held edges at the heights they have in `x` \[m\], where nothing
/// above carries them.
pub fn holds(garment: &Garment, x: &[Vec3], params: &HoldParams) -> Vec<Hold> {
    let mesh = &garment.mesh;
    let top = x.iter().map(|p| p.y).fold(f64::NEG_INFINITY, f64::max);
    let below_top = |v: u32| top - x[mesh.sewing[v as usize] as usize].y;
    let carried = |v: u32| below_top(v) > params.carried;
    let stitches = &garment.pattern.stitches;
    let free = |id: EdgeId| !stitches.iter().any(|stitch| stitch.sides.contains(&id));
    let mut lengths: BTreeMap<u32, f64> = BTreeMap::new();
    for (p, panel) in garment.pattern.panels.iter().enumerate() {
        for (e, edge) in panel.edges.iter().enumerate() {
            let vertices = &mesh.edge_vertices[p][e];
            let labelled = is_held(edge, params) && !vertices.iter().all(|v| carried(*v));
            let id = EdgeId { panel: p, edge: e };
            let on_rim = || vertices.iter().all(|v| below_top(*v) < RIM) && free(id);
            let held = labelled || params.rim && on_rim();
            if !held {
                continue;
            }
            for pair in vertices.windows(2) {
                let [a, b] = [pair[0], pair[1]].map(|v| v as usize);
                let half = 0.5 * (mesh.x_bar[b] - mesh.x_bar[a]).norm();
                for v in [a, b] {
                    *lengths.entry(mesh.sewing[v]).or_insert(0.0) += half;
                }
            }
        }
    }
    let hold = |(vertex, length): (u32, f64)| Hold {
        vertex,
        height: x[vertex as usize].y,
        stiffness: params.stiffness * length,
    };
    lengths.into_iter().map(hold).collect()
}

/// Free edges that lie no lower than this under the top of a garment are its upper rim \[m\].
const RIM: f64 = 0.08;

/// Whether the label of an edge says that it is held.
fn is_held(edge: &Edge, params: &HoldParams) -> bool {
    (edge.label.as_ref()).is_some_and(|label| params.labels.contains(label))
}

/// Drapes a garment from its placed panels on `body`, or — when it brought a drape — from there. What
/// slides off, or comes to rest far below where it was placed, is draped again held by its upper rim, if its
/// pattern has no labels that would say what is held, or else with friction; where that does not help, it
/// slides.
pub fn drape_on(
    garment: &Garment,
    body: &Body,
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Drape {
    drape_on_surface(garment, body, &surface(body), params, observe)
}

/// A body as cloth feels it.
pub(super) fn surface(body: &Body) -> DistanceField {
    DistanceField::new(&body.mesh, DistanceField::SPACING, DistanceField::OUTER)
}

/// The same on the `surface` of the body.
pub(super) fn drape_on_surface(
    garment: &Garment,
    body: &Body,
    surface: &DistanceField,
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Drape {
    let (hold, sim) = (&params.hold, &params.sim);
    let mut patient = *sim;
    patient.equilibrium.iterations *= PATIENCE;
    let mut drape = |hold: &HoldParams, sim: &SimParams| {
        let on = Dressing {
            body,
            surface,
            params,
            hold,
        };
        match &garment.drape {
            Some(x) => on.drape(garment, x, x.clone(), Start::Near, sim, observe),
            None => coarse::from_panels(&on, garment, sim, observe),
        }
    };
    let found = drape(hold, &patient);
    if found.status != RestStatus::Sliding {
        return found;
    }
    let mut edges = garment.pattern.panels.iter().flat_map(|panel| &panel.edges);
    let again = if !hold.rim && !edges.any(|edge| is_held(edge, hold)) {
        let rim = HoldParams {
            rim: true,
            ..hold.clone()
        };
        drape(&rim, &patient)
    } else if !sim.contact.rubs() && hold.friction != OrFabric::Number(0.0) {
        patient.contact.friction = hold.friction;
        drape(hold, &patient)
    } else {
        return found;
    };
    let nearer_to_rest = again.status != RestStatus::Sliding && again.residual < found.residual;
    if again.status == RestStatus::AtRest || nearer_to_rest {
        again
    } else {
        found
    }
}

/// Iterations of a first drape over those of a drape in a search, where a pattern that takes long to
/// settle is better given up: full skirts and hoods take 400 to 1300.
const PATIENCE: usize = 4;

/// How often the points that feel the body are set more closely where a fold of skin comes through between
/// them, and most iterations to settle again: one dress hovered just above the tolerance for hundreds, and settled
/// in eight after the next halving.
const HALVINGS: usize = 5;
const SETTLING_AGAIN: usize = 150;

/// A body, and what a garment on it is made of and held by.
struct Dressing<'a> {
    body: &'a Body,
    surface: &'a DistanceField,
    params: &'a RefitParams,
    hold: &'a HoldParams,
}

impl Dressing<'_> {
    /// Drapes from `x`; what is held is held at its height in `placed` \[m\].
    fn drape(
        &self,
        garment: &Garment,
        placed: &[Vec3],
        x: Vec<Vec3>,
        start: Start,
        sim: &SimParams,
        observe: &mut Observer<'_>,
    ) -> Drape {
        let mut cloth = self.params.cloth(garment);
        cloth.holds = holds(garment, placed, self.hold);
        let mut drape = |cloth: &Cloth, x, start, sim| {
            let scene = Scene {
                cloth,
                assembly: &Assembly::new(cloth),
                surface: self.surface,
                params: sim,
            };
            drape(&scene, &garment.mesh.x_bar, x, start, observe)
        };
        let mut found = drape(&cloth, x, start, sim);
        let mut briefly = *sim;
        briefly.equilibrium.iterations = sim.equilibrium.iterations.min(SETTLING_AGAIN);
        let is_final = sim.equilibrium.tolerance < coarse::NEAR_REST;
        for _ in 0..HALVINGS {
            if found.status != RestStatus::AtRest || !is_final {
                break;
            }
            let through = self.triangles_through(&cloth.triangles, &found.x);
            if through.is_empty() {
                break;
            }
            cloth.feel_more_closely(through.into_iter());
            let again = drape(&cloth, found.x.clone(), Start::Near, &briefly);
            let iterations = found.iterations + again.iterations;
            if again.status == RestStatus::AtRest {
                found = again;
            }
            found.iterations = iterations;
        }
        found
    }

    /// Triangles of a cloth at `x` through which the body comes.
    fn triangles_through(&self, triangles: &[[u32; 3]], x: &[Vec3]) -> Vec<usize> {
        let body = &self.body.mesh;
        let pairs = intersections::between(x, triangles, &body.positions, &body.triangles);
        let mut through: Vec<usize> = pairs.iter().map(|[t, _]| *t as usize).collect();
        through.dedup();
        through
    }
}

#[cfg(test)]
mod tests {
    use super::placed::fixtures::tube;
    use super::*;
    use crate::body::FileFrame;
    use crate::fixture::add_box;
    use crate::geometry::TriangleMesh;

    #[test]
    fn a_sharp_edge_does_not_come_through_between_the_points_that_feel_it() {
        let mut garment = tube();
        for panel in &mut garment.pattern.panels {
            panel.edges[2].label = Some("lower_interface".to_owned());
        }
        // A blade that is a little too wide for the tube, which is 64 cm around.
        let mut mesh = TriangleMesh::default();
        add_box(&mut mesh, [-0.005, -0.5, -0.004], [0.325, 1.0, 0.004]);
        let body = Body {
            name: "blade".to_owned(),
            mesh,
            frame: FileFrame::SI,
            notes: Vec::new(),
        };
        let found = drape_on(&garment, &body, &RefitParams::default(), &mut |_, _| true);
        let through = intersections::between(
            &found.x,
            &garment.mesh.cloth_triangles(),
            &body.mesh.positions,
            &body.mesh.triangles,
        );
        assert_eq!(found.status, RestStatus::AtRest);
        assert!(through.is_empty());
    }

    #[test]
    fn a_waist_is_held_unless_something_reaches_far_above_it() {
        let held = |edge: usize| {
            let mut garment = tube();
            garment.pattern.panels[0].edges[edge].label = Some("lower_interface".to_owned());
            let held = holds(&garment, &garment.placed(), &HoldParams::default()).len();
            (held, garment.mesh.edge_vertices[0][edge].len())
        };
        let (waist, all) = held(2);
        assert_eq!(waist, all);
        let (below_a_bodice, _) = held(0);
        assert_eq!(below_a_bodice, 0);
    }
}
