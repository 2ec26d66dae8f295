//! Presses folds into a cloth: hinges along a seam that rest at an angle.

use super::{Cloth, Hinge};
use crate::garment::FoldLine;
use crate::pattern::PatternMesh;

/// A hinge that rests at an angle, its side 0 that of the panel whose fold it is; the corners (x0, x1,
/// opposite) of that side run counter-clockwise seen from the right side of the cloth.
#[derive(Clone, Copy, Debug)]
pub struct Fold {
    /// Where it is.
    pub hinge: Hinge,
    /// Rest angle \[rad\]; positive with the wrong sides of the cloth together.
    pub angle: f64,
    /// Bending rigidity as a multiple of the cloth's \[–\].
    pub firmness: f64,
}

impl Cloth {
    /// Has the hinges along `lines` rest at their angles. `mesh` is the one the cloth was made of.
    pub fn press(&mut self, mesh: &PatternMesh, lines: &[FoldLine]) {
        for line in lines {
            let along = mesh.along(line.edge);
            let on_line = |side: &[u32; 3]| {
                let [p, q, _] = *side;
                along.windows(2).any(|w| w == [p, q] || w == [q, p])
            };
            let (pressed, flat) = std::mem::take(&mut self.hinges)
                .into_iter()
                // The two corners opposite to a seam may be one vertex (the tip of a dart): no angle.
                .partition(|h| h.vertices[2] != h.vertices[3] && h.rest.iter().any(on_line));
            self.hinges = flat;
            self.folds
                .retain(|fold| !fold.hinge.rest.iter().any(on_line));
            let pressed: Vec<Hinge> = pressed;
            let fold = |mut hinge: Hinge| {
                if !on_line(&hinge.rest[0]) {
                    hinge.vertices.swap(2, 3);
                    hinge.rest.swap(0, 1);
                    hinge.triangles.swap(0, 1);
                }
                let [a, b, ..] = hinge.vertices;
                let front = self.outward[hinge.triangles[0] as usize];
                if !(0..3).any(|i| front[i] == a && front[(i + 1) % 3] == b) {
                    hinge.vertices.swap(0, 1);
                    for side in &mut hinge.rest {
                        side.swap(0, 1);
                    }
                }
                Fold {
                    hinge,
                    angle: line.angle,
                    firmness: line.firmness,
                }
            };
            let folds: Vec<Fold> = pressed.into_iter().map(fold).collect();
            self.folds.extend(folds);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{panel_at, stitch};
    use crate::garment::Fabric;
    use crate::geometry::Vec3;
    use crate::pattern::{EdgeId, Pattern, triangulate};
    use crate::sim::energy::contact::Nothing;
    use crate::sim::energy::fold::angle;
    use crate::sim::equilibrium::RestStatus;
    use crate::sim::{Assembly, Hold, Scene, SimParams, Start, drape};

    const STRIP: [(f64, f64); 4] = [(0.0, 0.0), (0.2, 0.0), (0.2, 0.1), (0.0, 0.1)];

    /// Two strips one above the other, sewn where they meet: the upper panel's lower edge to the lower
    /// panel's upper edge. `mirrored` has the upper one face the other way.
    fn strips(mirrored: bool) -> (Pattern, PatternMesh) {
        let mut upper = panel_at("upper", &STRIP, Vec3::new(0.0, 0.1, 0.0));
        if mirrored {
            // Listed clockwise, its right side is the far one.
            upper.vertices.reverse();
        }
        let lower = panel_at("lower", &STRIP, Vec3::zeros());
        // Reversed, the lower edge is the third.
        let mut seam = stitch((0, if mirrored { 2 } else { 0 }), (1, 2));
        seam.right_wrong = mirrored;
        let pattern = Pattern {
            panels: vec![upper, lower],
            stitches: vec![seam],
        };
        let mesh = triangulate::mesh(&pattern, 0.03).expect("two strips can be meshed");
        (pattern, mesh)
    }

    /// Light enough to hardly sag.
    fn feather() -> Fabric {
        Fabric {
            density: 1e-4,
            bending: 1e-3,
            ..Fabric::default()
        }
    }

    /// The lower strip's turn out of the upper one's plane, towards the upper one's wrong side, at rest.
    fn rested(mirrored: bool, of: usize, told: f64) -> Vec<f64> {
        let (pattern, mesh) = strips(mirrored);
        let edge = pattern.stitches[0].sides[of];
        let line = FoldLine {
            edge,
            angle: told,
            firmness: 10.0,
        };
        let mut cloth = Cloth::new(&mesh, &feather());
        cloth.press(&mesh, &[line]);
        assert_eq!(cloth.folds.len() + 1, mesh.along(edge).len());
        let garment = crate::garment::Garment {
            name: "strips".to_owned(),
            pattern,
            mesh,
            drape: None,
        };
        let x = garment.placed();
        cloth.holds = (x.iter().enumerate().filter(|(_, p)| p.y > 0.199))
            .map(|(v, p)| Hold {
                vertex: v as u32,
                height: p.y,
                stiffness: 1.0,
            })
            .collect();
        let params = SimParams::default();
        let scene = Scene {
            cloth: &cloth,
            assembly: &Assembly::new(&cloth),
            surface: &Nothing,
            params: &params,
        };
        let found = drape(&scene, &garment.mesh.x_bar, x, Start::Near, &mut |_, _| {
            true
        });
        assert_eq!(found.status, RestStatus::AtRest);
        let at = |fold: &Fold| angle(fold.hinge.vertices.map(|a| found.x[a as usize]));
        cloth.folds.iter().map(at).collect()
    }

    #[test]
    fn a_feather_rests_at_the_angle_that_was_pressed_into_it() {
        for (mirrored, of, told) in [(false, 0, 1.2), (false, 1, -1.2), (true, 0, 1.2)] {
            for found in rested(mirrored, of, told) {
                // Its weight of 2 mN/m² bends it by less than a hundredth.
                assert!((found - told).abs() < 0.01, "{found} {told}");
            }
        }
    }

    #[test]
    fn an_angle_is_told_of_the_panel_that_is_named_and_of_its_right_side() {
        // Side 0 is that of the panel named, with its right side in front, also where the two panels face
        // opposite ways.
        for mirrored in [false, true] {
            let (pattern, mesh) = strips(mirrored);
            for (of, edge) in pattern.stitches[0].sides.into_iter().enumerate() {
                let mut cloth = Cloth::new(&mesh, &feather());
                let line = FoldLine {
                    edge,
                    angle: 1.0,
                    firmness: 1.0,
                };
                cloth.press(&mesh, &[line]);
                let panel = EdgeId { panel: of, ..edge };
                for Fold { hinge, .. } in &cloth.folds {
                    let t = hinge.triangles[0] as usize;
                    assert!(mesh.panel_triangles[panel.panel].contains(&t));
                    let [a, b, c, _] = hinge.vertices;
                    let front = cloth.outward[t];
                    let turned = [[a, b, c], [b, c, a], [c, a, b]];
                    assert!(turned.contains(&front), "{turned:?} {front:?}");
                }
            }
        }
    }
}
