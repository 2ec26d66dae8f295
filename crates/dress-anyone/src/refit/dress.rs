//! A garment put on a body: what holds it up, and its drape from the placed panels.

mod coarse;

use crate::body::Body;
use crate::body::distance_field::DistanceField;
use crate::garment::{Fabric, Garment};
use crate::geometry::{Vec2, Vec3};
use crate::pattern::{Edge, EdgeId};
use crate::sim::drape::DrapeProgress;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Assembly, Cloth, Drape, Hold, Scene, SimParams, Start, drape};
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
    pub friction: f64,
}

impl Default for HoldParams {
    fn default() -> Self {
        Self {
            labels: vec!["lower_interface".to_owned(), "strapless_top".to_owned()],
            stiffness: 1e4,
            carried: 0.15,
            rim: false,
            friction: 0.4,
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
            let labelled = is_label(edge, params) && !vertices.iter().all(|v| carried(*v));
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

/// Whether an edge has a label that says it is held.
fn is_label(edge: &Edge, params: &HoldParams) -> bool {
    (edge.label.as_ref()).is_some_and(|label| params.labels.contains(label))
}

/// Drapes a garment from its placed panels on `body`, or — when it brought a drape — from there. What
/// slides off is draped again held by its upper rim, if its pattern has no labels that would say what
/// is held, or else with friction; where that does not help, it slides.
pub fn drape_on(
    garment: &Garment,
    body: &Body,
    fabric: &Fabric,
    hold: &HoldParams,
    sim: &SimParams,
    observe: &mut dyn FnMut(DrapeProgress) -> bool,
) -> Drape {
    let surface = DistanceField::new(&body.mesh, DistanceField::SPACING, DistanceField::OUTER);
    let mut patient = *sim;
    patient.equilibrium.iterations *= PATIENCE;
    let mut drape = |hold: &HoldParams, sim: &SimParams| {
        let on = Dressing {
            body,
            surface: &surface,
            fabric,
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
    let again = if !hold.rim && !edges.any(|edge| is_label(edge, hold)) {
        let rim = HoldParams {
            rim: true,
            ..hold.clone()
        };
        drape(&rim, &patient)
    } else if sim.contact.friction < hold.friction {
        patient.contact.friction = hold.friction;
        drape(hold, &patient)
    } else {
        return found;
    };
    if again.status == RestStatus::AtRest {
        again
    } else {
        found
    }
}

/// Iterations of a first drape over those of a drape in a search, where a pattern that takes long to
/// settle is better given up: full skirts and hoods take 400 to 1300.
const PATIENCE: usize = 4;

/// A body, and what a garment on it is made of and held by.
struct Dressing<'a> {
    body: &'a Body,
    surface: &'a DistanceField,
    fabric: &'a Fabric,
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
        observe: &mut dyn FnMut(DrapeProgress) -> bool,
    ) -> Drape {
        let mut cloth = Cloth::new(&garment.mesh, self.fabric);
        cloth.holds = holds(garment, placed, self.hold);
        let scene = Scene {
            cloth: &cloth,
            assembly: &Assembly::new(&cloth),
            surface: self.surface,
            params: sim,
        };
        drape(&scene, &garment.mesh.x_bar, x, start, observe)
    }
}

/// A garment whose middle is below this part of the body's height is placed about the pelvis: the
/// body it was drawn on has its origin there, not on the floor.
const NOT_ON_THE_FLOOR: f64 = 0.15;
/// Height of that origin, likewise: the waists and shoulders of the templates of Korosteleva & Lee 2021
/// then come to those of GarmentCode's.
const PELVIS: f64 = 0.65;
/// Height of the instep, likewise: cloth starts above it.
const INSTEP: f64 = 0.05;
/// Height below which cloth starts shortened for that, likewise.
const KNEE: f64 = 0.3;

/// How far the placed panels are lifted because they are placed about a body's pelvis \[m\].
pub fn lift(garment: &Garment, body: &Body) -> f64 {
    let ((floor, top), (low, high)) = (body.mesh.bounds(), heights(garment));
    let height = top.y - floor.y;
    if 0.5 * (low + high) < floor.y + NOT_ON_THE_FLOOR * height {
        PELVIS * height
    } else {
        0.0
    }
}

/// Lowest and highest point of the placed panels \[m\].
fn heights(garment: &Garment) -> (f64, f64) {
    let placed = garment.placed();
    let heights = placed.iter().map(|p| p.y);
    heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), y| {
        (low.min(y), high.max(y))
    })
}

/// The panels placed on `body` \[m\], and the rest shape to begin with: what would start about the feet
/// or below the soles, where it would be caught, is shortened into the space between instep and knee.
fn placed(garment: &Garment, body: &Body) -> (Vec<Vec3>, Vec<Vec2>) {
    let mut garment = garment.clone();
    let up = lift(&garment, body);
    for panel in &mut garment.pattern.panels {
        panel.placement.translation.y += up;
    }
    let (floor, top) = body.mesh.bounds();
    let at = |part: f64| floor.y + part * (top.y - floor.y);
    let (instep, knee) = (at(INSTEP), at(KNEE));
    let (lowest, _) = heights(&garment);
    if lowest >= instep {
        return (garment.placed(), garment.mesh.x_bar);
    }
    let shorter = (knee - instep) / (knee - lowest);
    garment.moved(&mut |p| {
        let y = if p.y < knee {
            knee - shorter * (knee - p.y)
        } else {
            p.y
        };
        Vec3::new(p.x, y, p.z)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::FileFrame;
    use crate::fixture::add_box;
    use crate::geometry::TriangleMesh;
    use crate::loss::fixtures::two_panels;
    use approx::assert_relative_eq;

    /// Two panels, 0.4 m high; their lower side is edge 0, their upper side edge 2.
    fn tube() -> Garment {
        let (pattern, mesh) = two_panels();
        Garment {
            name: "tube".to_owned(),
            pattern,
            mesh,
            drape: None,
        }
    }

    /// A box of 1.2 m that stands at a height.
    fn body(floor: f64) -> Body {
        let mut mesh = TriangleMesh::default();
        add_box(&mut mesh, [-0.2, floor, -0.2], [0.2, floor + 1.2, 0.2]);
        Body {
            name: "box".to_owned(),
            mesh,
            frame: FileFrame::SI,
            notes: Vec::new(),
        }
    }

    #[test]
    fn what_starts_below_the_soles_is_shortened_to_above_the_feet() {
        // Of a body of 1.2 m that stands at 0.01 m the instep is at 0.07 m, the knee at 0.37 m.
        let garment = tube();
        let (x, short) = placed(&garment, &body(0.01));
        let lowest = x.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
        assert_relative_eq!(lowest, 0.07, epsilon = 1e-12);
        for (rest, short) in garment.mesh.x_bar.iter().zip(&short) {
            // 0.3 m where there were 0.37 m.
            let part = if rest.y < 0.37 { 0.3 / 0.37 } else { 1.0 };
            assert_relative_eq!(short.x, rest.x, epsilon = 1e-12);
            assert_relative_eq!(0.37 - short.y, (0.37 - rest.y) * part, epsilon = 1e-12);
        }
        // A body that stands lower leaves it as it is.
        let as_placed = (garment.placed(), garment.mesh.x_bar.clone());
        assert_eq!(placed(&garment, &body(-0.1)), as_placed);
    }

    #[test]
    fn what_is_placed_about_the_pelvis_is_lifted_to_it() {
        // The middle of the panels, 0.2 m up, is 0.19 m above one floor and below the other.
        let garment = tube();
        assert_eq!(lift(&garment, &body(0.01)), 0.0);
        let (x, short) = placed(&garment, &body(0.3));
        assert_relative_eq!(lift(&garment, &body(0.3)), 0.65 * 1.2);
        assert_relative_eq!(x[0].y, 0.65 * 1.2, epsilon = 1e-12);
        assert_eq!(short, garment.mesh.x_bar);
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
