//! Where the panels of a garment start around a body, and how short.

use super::clear::{Arms, Hanging, Narrowing, out_of};
use crate::body::Body;
use crate::garment::Garment;
use crate::geometry::{Vec2, Vec3};
use crate::pattern::Panel;

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

/// The panels placed on `body` \[m\], and the rest shape to begin with: what would start in the body waits in
/// front of it, skirts hang below the arms, tops pass between them, and what would start about the feet or
/// below the soles, where it would be caught, is shortened into the space between instep and knee.
pub(super) fn placed(garment: &Garment, body: &Body) -> (Vec<Vec3>, Vec<Vec2>) {
    let mut garment = garment.clone();
    let up = lift(&garment, body);
    for panel in &mut garment.pattern.panels {
        panel.placement.translation.y += up;
    }
    out_of(body, &mut garment);
    let arms = Arms::of(body);
    let hanging = Hanging::below_arms(&arms, &garment);
    let narrowing = Narrowing::between_arms(&arms, &garment);
    let start = |panel: &Panel, p| narrowing.start(panel, hanging.start(panel, p));
    let (floor, top) = body.mesh.bounds();
    let at = |part: f64| floor.y + part * (top.y - floor.y);
    let (instep, knee) = (at(INSTEP), at(KNEE));
    let (hung, _) = garment.moved(start);
    let lowest = hung.iter().map(|p| p.y).fold(f64::INFINITY, f64::min);
    let shorter = if lowest < instep {
        (knee - instep) / (knee - lowest)
    } else {
        1.0
    };
    garment.moved(|panel, p| {
        let p = start(panel, p);
        let y = if p.y < knee && shorter < 1.0 {
            knee - shorter * (knee - p.y)
        } else {
            p.y
        };
        Vec3::new(p.x, y, p.z)
    })
}

#[cfg(test)]
pub(crate) mod fixtures {
    use crate::garment::Garment;
    use crate::loss::fixtures::two_panels;

    /// Two panels, 0.4 m high; their lower side is edge 0, their upper side edge 2.
    pub(crate) fn tube() -> Garment {
        let (pattern, mesh) = two_panels();
        Garment {
            name: "tube".to_owned(),
            pattern,
            mesh,
            drape: None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::fixtures::tube;
    use super::*;
    use crate::body::FileFrame;
    use crate::fixture::add_box;
    use crate::geometry::TriangleMesh;
    use approx::assert_relative_eq;

    /// A box of 1.2 m that stands at a height, between the panels.
    fn body(floor: f64) -> Body {
        let mut mesh = TriangleMesh::default();
        add_box(&mut mesh, [-0.2, floor, -0.05], [0.2, floor + 1.2, 0.05]);
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
}
