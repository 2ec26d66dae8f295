//! Curvature of the outlines (paper §4.4, boundary curvature, after Li et al. 2024): each boundary
//! vertex's two edges should change by one similarity.
//!
//! With edges e₁ to the next and e₂ to the previous vertex as complex numbers, the best similarity
//! T = (ē₁* e₁ + ē₂* e₂)/D leaves r = (e₁ − Tē₁) + (e₂ − Tē₂) = a₁e₁ + a₂e₂, linear in x̄ (METHOD
//! §5.2; the printed form freezes T, which gives a wrong gradient). Along an edge the sum
//! Λ Σ |r|²/h³ tends to Λ ∫ (Δκ)² ds; at a corner |r|²/h² is the squared change of its angle.

use super::Row;
use crate::geometry::{Vec2, complex};
use crate::pattern::PatternMesh;
use num_complex::Complex64;

/// Edges shorter than this do not get more weight \[m\]: they are drafting artefacts.
const SHORTEST: f64 = 2e-3;

/// The constant stencils of all boundary vertices.
#[derive(Clone, Debug)]
pub struct Curvature {
    stencils: Vec<Stencil>,
}

/// r = a₁ e₁ + a₂ e₂, scaled so that |r|² is the vertex's part of the term.
#[derive(Clone, Copy, Debug)]
struct Stencil {
    next: u32,
    here: u32,
    previous: u32,
    a1: Complex64,
    a2: Complex64,
}

impl Curvature {
    /// Stencils of the reference outlines in `mesh.x_bar`.
    pub fn new(mesh: &PatternMesh) -> Self {
        let at = |v: u32| complex(mesh.x_bar[v as usize]);
        let mut stencils = Vec::new();
        for edges in &mesh.edge_vertices {
            let pairs = || edges.iter().flat_map(|chain| chain.windows(2));
            let around: f64 = pairs().map(|p| (at(p[1]) - at(p[0])).norm()).sum();
            for (e, chain) in edges.iter().enumerate() {
                for triple in chain.windows(3) {
                    stencils.extend(Stencil::new(
                        [triple[0], triple[1], triple[2]],
                        at,
                        Some(around),
                    ));
                }
                let following = &edges[(e + 1) % edges.len()];
                let [.., before, corner] = chain[..] else {
                    continue;
                };
                let [_, after, ..] = following[..] else {
                    continue;
                };
                stencils.extend(Stencil::new([before, corner, after], at, None));
            }
        }
        Self { stencils }
    }

    /// Real and imaginary part of every vertex's r.
    pub fn rows(&self, x_bar: &[Vec2]) -> Vec<Row> {
        let at = |v: u32| complex(x_bar[v as usize]);
        let rows = |s: &Stencil| {
            let (e1, e2) = (at(s.next) - at(s.here), at(s.previous) - at(s.here));
            let r = s.a1 * e1 + s.a2 * e2;
            let a0 = -s.a1 - s.a2;
            // Re(a z) = a_r x − a_i y and Im(a z) = a_i x + a_r y.
            let real = |a: Complex64| Vec2::new(a.re, -a.im);
            let imaginary = |a: Complex64| Vec2::new(a.im, a.re);
            let row = |value: f64, by: &dyn Fn(Complex64) -> Vec2| Row {
                value,
                x: Vec::new(),
                x_bar: vec![(s.next, by(s.a1)), (s.previous, by(s.a2)), (s.here, by(a0))],
            };
            [row(r.re, &real), row(r.im, &imaginary)]
        };
        self.stencils.iter().flat_map(rows).collect()
    }
}

impl Stencil {
    /// The stencil at the middle vertex; `around` is the outline's length, or none at a corner.
    fn new(
        [previous, here, next]: [u32; 3],
        at: impl Fn(u32) -> Complex64,
        around: Option<f64>,
    ) -> Option<Self> {
        let (e1, e2) = (at(next) - at(here), at(previous) - at(here));
        let d = e1.norm_sqr() + e2.norm_sqr();
        if d == 0.0 {
            return None;
        }
        let h = (0.5 * (e1.norm() + e2.norm())).max(SHORTEST);
        let scale = around.map_or(1.0 / h, |length| (length / h.powi(3)).sqrt());
        let across = (e2 - e1).conj() * (scale / d);
        Some(Self {
            next,
            here,
            previous,
            a1: across * e2,
            a2: -across * e1,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::panel;
    use crate::loss::fixtures;
    use crate::pattern::{Pattern, triangulate};
    use approx::assert_relative_eq;

    /// A panel of 1 m by `width` \[m\], meshed at that width.
    fn strip(width: f64) -> PatternMesh {
        let corners = [[0.0, 0.0], [width, 0.0], [width, 1.0], [0.0, 1.0]];
        let pattern = Pattern {
            panels: vec![panel("strip", &corners)],
            stitches: Vec::new(),
        };
        triangulate::mesh(&pattern, width).expect("a rectangle can be meshed")
    }

    fn sum(rows: &[Row]) -> f64 {
        rows.iter().map(|r| r.value * r.value).sum()
    }

    #[test]
    fn rows_are_derivatives() {
        let (_, mesh) = fixtures::two_panels();
        let term = Curvature::new(&mesh);
        let still = fixtures::positions(mesh.cloth_vertex_count, 1);
        let motion: Vec<Vec2> = fixtures::rest(&mesh, 1.0, 40);
        fixtures::check_rows(
            |_, x_bar| term.rows(x_bar),
            (&still, &still),
            (&fixtures::rest(&mesh, 0.01, 3), &motion),
        );
    }

    #[test]
    fn similarities_cost_nothing() {
        let (_, mesh) = fixtures::two_panels();
        let term = Curvature::new(&mesh);
        let turn = Complex64::from_polar(1.4, 0.7);
        let moved: Vec<Vec2> = mesh
            .x_bar
            .iter()
            .map(|p| {
                let z = turn * complex(*p) + Complex64::new(0.3, -2.0);
                Vec2::new(z.re, z.im)
            })
            .collect();
        // Round-off of metres, amplified by 1/h² of centimetres.
        assert!(sum(&term.rows(&moved)) < 1e-18);
    }

    #[test]
    fn bending_a_straight_strip_costs_its_squared_curvature_at_any_resolution() {
        // The side x = 0 of a strip bent to radius 2 m: Δκ = ½ on every long edge.
        let cost = |rows: usize| {
            let width = 1.0 / rows as f64;
            let mesh = strip(width);
            let bent: Vec<Vec2> = mesh
                .x_bar
                .iter()
                .map(|p| {
                    let (radius, angle) = (2.0 + p.x, p.y / 2.0);
                    Vec2::new(radius * angle.cos(), radius * angle.sin())
                })
                .collect();
            sum(&Curvature::new(&mesh).rows(&bent)) / (2.0 + 2.0 * width)
        };
        // Two sides of 1 m: 2 · (½)². The mesh narrows as it is refined, so the rest is its error.
        assert_relative_eq!(cost(80), 0.5, max_relative = 0.03);
        assert_relative_eq!(cost(80), cost(160), max_relative = 0.02);
    }
}
