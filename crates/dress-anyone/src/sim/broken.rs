//! Where a drape, or the walk back through it, broke down: positions, forces or gradients that are no
//! numbers any more, and the likely cause.
//!
//! Once there is one such position, the next sweep or solve spreads it over the cloth. So the cloth is
//! kept as it was before, and the triangle told is the one that was stretched most then; of gradients,
//! the one at whose corners they were largest.

use super::cloth::{Cloth, Rest};
use crate::geometry::{Vec2, Vec3};
use crate::pattern::{Pattern, PatternMesh};
use std::ops::Range;

/// When a drape broke down, and where.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Broken {
    /// What was going on.
    pub stage: Stage,
    /// The triangle of cloth that was stretched most, or whose gradient was largest.
    pub triangle: usize,
    /// How many times its length it was stretched \[–\], or the norm of the gradient by its corners;
    /// infinite if these are no numbers themselves.
    pub most: f64,
}

/// What was going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// This step of those that bring panels together.
    Step(usize),
    /// The static solve, after this many iterations.
    Iteration(usize),
    /// The walk back through this step.
    StepBack(usize),
}

impl Broken {
    /// Looks at the last good positions `x` \[m\]; none for cloth without triangles.
    pub(super) fn at(stage: Stage, cloth: &Cloth, rest: &Rest, x: &[Vec3]) -> Option<Self> {
        let triangles = cloth.triangles.iter().zip(&rest.triangles);
        let stretches =
            triangles.map(|(t, rest)| rest.gradient_of(t.map(|v| x[v as usize])).norm());
        Self::most(stage, stretches)
    }

    /// Looks at the last good gradient by positions; none for cloth without triangles.
    pub(super) fn back_at(step: usize, cloth: &Cloth, x_hat: &[Vec3]) -> Option<Self> {
        let of = |t: &[u32; 3]| t.map(|v| x_hat[v as usize].norm_squared());
        let sizes = (cloth.triangles.iter()).map(|t| of(t).iter().sum::<f64>().sqrt());
        Self::most(Stage::StepBack(step), sizes)
    }

    /// The triangle of which `each` is largest.
    fn most(stage: Stage, each: impl Iterator<Item = f64>) -> Option<Self> {
        let finite = |m: f64| if m.is_finite() { m } else { f64::INFINITY };
        let all = each.map(finite).enumerate();
        let most = all.reduce(|most, next| if next.1 > most.1 { next } else { most });
        most.map(|(triangle, most)| Self {
            stage,
            triangle,
            most,
        })
    }

    /// In words, for the garment that `mesh` is of.
    pub fn told(&self, pattern: &Pattern, mesh: &PatternMesh) -> String {
        let when = match self.stage {
            Stage::Step(step) => format!("in step {step} of bringing the panels together"),
            Stage::Iteration(iteration) => format!("in iteration {iteration} of the static solve"),
            Stage::StepBack(step) => format!("walking back through step {step}"),
        };
        let what = match self.stage {
            Stage::StepBack(_) => format!("the gradient was largest ({:.1e})", self.most),
            _ => format!("the cloth was stretched most ({:.1e} times)", self.most),
        };
        let holds = |triangles: &Range<usize>| triangles.contains(&self.triangle);
        let panel = mesh.panel_triangles.iter().position(holds);
        let name = panel.map_or("", |panel| &pattern.panels[panel].name);
        let corners = mesh.triangles[self.triangle].map(|v| mesh.x_bar[v as usize]);
        let middle = corners.iter().sum::<Vec2>() * (100.0 / 3.0);
        format!(
            "{when}; {what} in panel `{name}`, triangle {}, at ({:.1}, {:.1}) cm of the pattern",
            self.triangle, middle.x, middle.y
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::rectangle;
    use crate::sim::cloth::fixtures::{self, SOFT};
    use crate::sim::energy::contact::Nothing;
    use crate::sim::equilibrium::RestStatus;
    use crate::sim::{Assembly, Drape, Scene, SimParams, Start, drape};

    /// Drapes a sheet whose middle is moved by `off` \[m\], and tells where it broke.
    fn broken(off: f64, params: &SimParams, start: fn(&PatternMesh) -> Start) -> (Drape, String) {
        let mesh = fixtures::sheet(4, 4, 0.05);
        let cloth = Cloth::new(&mesh, &SOFT);
        let scene = Scene {
            cloth: &cloth,
            assembly: &Assembly::new(&cloth),
            surface: &Nothing,
            params,
        };
        let mut x: Vec<Vec3> = (mesh.x_bar.iter())
            .map(|p| Vec3::new(p.x, p.y, 0.0))
            .collect();
        x[12].z += off;
        let found = drape(&scene, &mesh.x_bar, x, start(&mesh), &mut |_, _| true);
        assert_eq!(found.status, RestStatus::NotFinite);
        let broken = found.broken.expect("it broke");
        assert!(mesh.triangles[broken.triangle].contains(&12));
        let pattern = Pattern {
            panels: vec![rectangle("front", 0.2, 0.2)],
            stitches: Vec::new(),
        };
        (found, broken.told(&pattern, &mesh))
    }

    #[test]
    fn a_static_solve_that_breaks_down_tells_the_iteration_and_the_triangle() {
        let (_, told) = broken(1e160, &SimParams::default(), |_| Start::Near);
        assert!(
            told.contains("in iteration 0 of the static solve"),
            "{told}"
        );
        assert!(told.contains("in panel `front`, triangle"), "{told}");
    }

    #[test]
    fn steps_that_break_down_stop_there_with_the_last_good_positions() {
        // A pressure without bound.
        let mut params = SimParams::default();
        params.step.inflation = 1e308;
        params.layers.on = false;
        let placed = |mesh: &PatternMesh| Start::Placed {
            short: mesh.x_bar.clone(),
        };
        let (found, told) = broken(0.1, &params, placed);
        assert!(told.contains("in step 0 of bringing"), "{told}");
        assert!(found.x.iter().all(|p| p.iter().all(|c| c.is_finite())));
    }
}
