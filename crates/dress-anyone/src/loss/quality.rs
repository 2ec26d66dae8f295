//! Quality of the rest triangles: a wall that the search feels before it runs into it.
//!
//! Σ_t max(0, 1 − q_t/q₀)², with q = 4√3·A/Σl² and q₀ a little below the reference pattern's
//! poorest: nothing is lost by a pattern meshed as well as the reference, and a step that would
//! flatten a triangle is turned aside instead of shortened. Not in the paper.

use super::Row;
use crate::geometry::quality::{qualities, quality};
use crate::geometry::{Vec2, cross2};
use crate::pattern::PatternMesh;

/// q₀ as a part of the quality of the reference pattern's poorest triangle: above the 0.8 that a
/// pattern must keep, far enough for one step.
const WALL: f64 = 0.92;

/// The wall of one pattern.
#[derive(Clone, Debug)]
pub struct Quality {
    triangles: Vec<[u32; 3]>,
    /// q₀ \[–\].
    wall: f64,
}

impl Quality {
    /// Prepares the term for the reference pattern in `mesh`.
    pub fn new(mesh: &PatternMesh) -> Self {
        let each = qualities(&mesh.x_bar, &mesh.triangles);
        Self {
            triangles: mesh.triangles.clone(),
            wall: WALL * each.into_iter().fold(1.0, f64::min),
        }
    }

    /// One residual for each triangle behind the wall.
    pub fn rows(&self, x_bar: &[Vec2]) -> Vec<Row> {
        let row = |t: &[u32; 3]| {
            let corners = t.map(|v| x_bar[v as usize]);
            let q = quality(corners);
            (q < self.wall).then(|| Row {
                value: 1.0 - q / self.wall,
                x: Vec::new(),
                x_bar: (t.iter().zip(gradient(corners)))
                    .map(|(v, g)| (*v, g * (-1.0 / self.wall)))
                    .collect(),
            })
        };
        self.triangles.iter().filter_map(row).collect()
    }
}

/// ∂q by each corner \[1/m\]; zero where all corners coincide.
fn gradient([a, b, c]: [Vec2; 3]) -> [Vec2; 3] {
    let squares = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    if !(squares > 0.0) {
        return [Vec2::zeros(); 3];
    }
    let doubled = cross2(b - a, c - a);
    let factor = 2.0 * 3.0_f64.sqrt() / squares;
    [[a, b, c], [b, c, a], [c, a, b]].map(|[here, next, last]| {
        let area = Vec2::new(next.y - last.y, last.x - next.x);
        let lengths = (2.0 * here - next - last) * 2.0;
        (area - lengths * (doubled / squares)) * factor
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::Vec3;
    use crate::loss::fixtures;

    #[test]
    fn rows_are_derivatives() {
        let (_, mesh) = fixtures::two_panels();
        let term = Quality::new(&mesh);
        // Moved by up to 15 mm of 50, many triangles are poorer than the reference's poorest.
        let x_bar = fixtures::rest(&mesh, 0.015, 3);
        assert!(term.rows(&x_bar).len() > 5);
        let x = vec![Vec3::zeros(); mesh.cloth_vertex_count];
        fixtures::check_rows(
            |_, x_bar| term.rows(x_bar),
            (&x, &x),
            (&x_bar, &fixtures::rest(&mesh, 0.01, 40)),
        );
    }

    #[test]
    fn the_reference_pattern_turned_and_scaled_loses_nothing() {
        let (_, mesh) = fixtures::two_panels();
        let turned: Vec<Vec2> = (mesh.x_bar.iter())
            .map(|p| Vec2::new(0.6 * p.x - 0.8 * p.y, 0.8 * p.x + 0.6 * p.y) * 1.3)
            .collect();
        assert!(Quality::new(&mesh).rows(&turned).is_empty());
    }
}
