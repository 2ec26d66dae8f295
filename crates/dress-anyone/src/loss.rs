//! What the refit minimises (paper §4.4): four terms, and two that keep a
//! pattern fit for meshing and drawing, each a sum of squared residuals, each without
//! dimension and independent of resolution and unit.
//!
//! A term states its residuals as [`Row`]s, each with its derivatives beside its value. Loss,
//! gradient and the Gauss–Newton matrix all follow from the same rows, so they cannot drift apart.

pub mod area;
pub mod curvature;
pub mod drawable;
pub mod quality;
pub mod seam_length;
pub mod shape_match;

use crate::geometry::{Vec2, Vec3};
use crate::pattern::{Pattern, PatternMesh};
use serde::{Deserialize, Serialize};

/// One residual r with its non-zero derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// r \[–\].
    pub value: f64,
    /// ∂r/∂x, by cloth vertex \[1/m\].
    pub x: Vec<(u32, Vec3)>,
    /// ∂r/∂x̄, by pattern vertex \[1/m\].
    pub x_bar: Vec<(u32, Vec2)>,
}

/// Weights of the terms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct LossParams {
    /// α: distance of hems, necklines and cuffs to x*; 1 is a loss of 1 at 1 cm rms. The paper
    /// gives no weights.
    pub boundary: f64,
    /// β: distance of seams to x*, likewise.
    pub seam: f64,
    /// γ: distance of everything to x*, likewise. Low, so that wrinkles may fall where they like.
    pub interior: f64,
    /// Change of the outline's curvature; higher keeps edges as they were drawn.
    pub curvature: f64,
    /// Mismatch of sewn edge pieces beyond the designed ease; 100 makes 1 % mismatch 0.01.
    pub seam_length: f64,
    /// Mismatch of whole stitches beyond the designed ease, where small ones would add up.
    pub whole_seam: f64,
    /// Area of each panel's drape against x*; 10 makes 1 % of area 0.001.
    pub area: f64,
    /// Triangles of the pattern flatter than the reference's flattest: 300 makes 10 % less quality
    /// a loss of 3. Not in the paper.
    pub quality: f64,
    /// Edges that leave what one cubic curve can follow: 1 makes 1 mm rms on one edge a loss of 1.
    /// Not in the paper.
    pub drawable: f64,
    /// Preference for conformal cages: the squared stretch |β|² that each panel's affine part may
    /// add (`cage.kind = "green-affine"`); 0.01 makes 10 % stretch 0.0001. Not in the paper.
    pub affine: f64,
    /// Preference for cages whose neighbouring sides change alike: the squared difference of their
    /// similarities; 0.005 makes a side that turns by 10° beside a fixed one 0.00015. Not in the paper.
    pub cage: f64,
}

impl Default for LossParams {
    fn default() -> Self {
        Self {
            boundary: 1.0,
            seam: 1.0,
            interior: 0.05,
            curvature: 0.002,
            seam_length: 300.0,
            whole_seam: 3000.0,
            area: 10.0,
            quality: 300.0,
            drawable: 0.5,
            affine: 0.01,
            cage: 0.005,
        }
    }
}

/// The value of each term, unweighted, in the order of [`LossParams`].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct LossTerms {
    /// Mean squared distance of the boundary to x* \[cm²\].
    pub boundary: f64,
    /// Mean squared distance of seams to x* \[cm²\].
    pub seam: f64,
    /// Mean squared distance of all cloth to x* \[cm²\].
    pub interior: f64,
    /// Squared change of curvature along outlines \[–\].
    pub curvature: f64,
    /// Squared relative mismatch of seam pieces \[–\].
    pub seam_length: f64,
    /// Squared relative mismatch of stitches \[–\].
    pub whole_seam: f64,
    /// Squared relative change of panel areas \[–\].
    pub area: f64,
    /// Squared relative shortfall of triangle quality \[–\].
    pub quality: f64,
    /// Mean squared distance of edges from one cubic curve, summed over edges \[mm²\].
    pub drawable: f64,
}

impl LossTerms {
    /// α boundary + β seam + γ interior: the paper's shape-matching loss.
    pub fn shape_matching(&self, weights: &LossParams) -> f64 {
        weights.boundary * self.boundary
            + weights.seam * self.seam
            + weights.interior * self.interior
    }

    /// The weighted sum of all terms.
    pub fn total(&self, weights: &LossParams) -> f64 {
        self.shape_matching(weights)
            + weights.curvature * self.curvature
            + weights.seam_length * self.seam_length
            + weights.whole_seam * self.whole_seam
            + weights.area * self.area
            + weights.quality * self.quality
            + weights.drawable * self.drawable
    }
}

/// All terms, prepared for one garment and target.
#[derive(Clone, Debug)]
pub struct Losses {
    weights: LossParams,
    shape: shape_match::ShapeMatch,
    curvature: curvature::Curvature,
    seams: seam_length::SeamLength,
    area: area::TotalArea,
    quality: quality::Quality,
    drawable: drawable::Drawable,
}

/// The loss at one drape, with its gradients.
#[derive(Clone, Debug)]
pub struct Loss {
    /// Weighted sum of the terms.
    pub total: f64,
    /// The terms, unweighted.
    pub terms: LossTerms,
    /// ∂L/∂x \[1/m\].
    pub x_hat: Vec<Vec3>,
    /// ∂L/∂x̄ at fixed x \[1/m\].
    pub x_bar_hat: Vec<Vec2>,
}

impl Losses {
    /// Prepares the terms for the reference pattern in `mesh` and the target shape `x_star` \[m\].
    pub fn new(
        pattern: &Pattern,
        mesh: &PatternMesh,
        x_star: &[Vec3],
        weights: &LossParams,
    ) -> Self {
        Self {
            weights: *weights,
            shape: shape_match::ShapeMatch::new(mesh, x_star),
            curvature: curvature::Curvature::new(mesh),
            seams: seam_length::SeamLength::new(pattern, mesh),
            area: area::TotalArea::new(mesh, x_star),
            quality: quality::Quality::new(mesh),
            drawable: drawable::Drawable::new(mesh),
        }
    }

    /// The weights.
    pub fn weights(&self) -> &LossParams {
        &self.weights
    }

    /// Residuals of every term with the term's weight, in the order of [`LossParams`].
    fn weighted_rows(&self, x: &[Vec3], x_bar: &[Vec2]) -> [(f64, Vec<Row>); 9] {
        let w = &self.weights;
        let [boundary, seam, interior] = self.shape.rows(x);
        let (pieces, whole) = self.seams.rows(x_bar);
        [
            (w.boundary, boundary),
            (w.seam, seam),
            (w.interior, interior),
            (w.curvature, self.curvature.rows(x_bar)),
            (w.seam_length, pieces),
            (w.whole_seam, whole),
            (w.area, self.area.rows(x)),
            (w.quality, self.quality.rows(x_bar)),
            (w.drawable, self.drawable.rows(x_bar)),
        ]
    }

    /// Residuals scaled so that the loss is the sum of their squares.
    pub fn rows(&self, x: &[Vec3], x_bar: &[Vec2]) -> Vec<Row> {
        let terms = self.weighted_rows(x, x_bar).into_iter();
        terms
            .flat_map(|(weight, rows)| rows.into_iter().map(move |row| row.scaled(weight.sqrt())))
            .collect()
    }

    /// The loss and its gradients.
    pub fn evaluate(&self, x: &[Vec3], x_bar: &[Vec2]) -> Loss {
        let mut x_hat = vec![Vec3::zeros(); x.len()];
        let mut x_bar_hat = vec![Vec2::zeros(); x_bar.len()];
        let mut values = [0.0; 9];
        for (value, (weight, rows)) in values.iter_mut().zip(self.weighted_rows(x, x_bar)) {
            for row in &rows {
                *value += row.value * row.value;
                for (v, g) in &row.x {
                    x_hat[*v as usize] += g * (2.0 * weight * row.value);
                }
                for (v, g) in &row.x_bar {
                    x_bar_hat[*v as usize] += g * (2.0 * weight * row.value);
                }
            }
        }
        let [
            boundary,
            seam,
            interior,
            curvature,
            seam_length,
            whole_seam,
            area,
            quality,
            drawable,
        ] = values;
        let terms = LossTerms {
            boundary,
            seam,
            interior,
            curvature,
            seam_length,
            whole_seam,
            area,
            quality,
            drawable,
        };
        Loss {
            total: terms.total(&self.weights),
            terms,
            x_hat,
            x_bar_hat,
        }
    }
}

impl Row {
    fn scaled(mut self, factor: f64) -> Self {
        self.value *= factor;
        self.x.iter_mut().for_each(|(_, g)| *g *= factor);
        self.x_bar.iter_mut().for_each(|(_, g)| *g *= factor);
        self
    }
}

#[cfg(test)]
pub(crate) mod fixtures {
    //! A small sewn garment, and the check that rows are derivatives.

    use super::*;
    use crate::check::{assert_derivative, noise};
    use crate::pattern::{Curve, Edge, EdgeId, Panel, Placement, Stitch};

    /// Two panels, 0.3 × 0.4 m, sewn along both sides, meshed at 5 cm.
    pub(crate) fn two_panels() -> (Pattern, PatternMesh) {
        let corners = [(0.0, 0.0), (0.3, 0.0), (0.32, 0.4), (0.0, 0.4)];
        let panel = |name: &str, z: f64| Panel {
            name: name.to_owned(),
            vertices: corners.iter().map(|(x, y)| Vec2::new(*x, *y)).collect(),
            edges: (0..4)
                .map(|i| Edge {
                    start: i,
                    end: (i + 1) % 4,
                    curve: Curve::Line,
                    label: None,
                })
                .collect(),
            placement: Placement {
                rotation: crate::geometry::Mat3::identity(),
                translation: Vec3::new(0.0, 0.0, z),
            },
            label: None,
        };
        let stitch = |edge: usize| Stitch {
            sides: [EdgeId { panel: 0, edge }, EdgeId { panel: 1, edge }],
            right_wrong: true,
        };
        let pattern = Pattern {
            panels: vec![panel("front", 0.1), panel("back", -0.1)],
            stitches: vec![stitch(1), stitch(3)],
        };
        let mesh = crate::pattern::triangulate::mesh(&pattern, 0.05).expect("a valid pattern");
        (pattern, mesh)
    }

    /// Unstructured positions for every cloth vertex, and a motion of them.
    pub(crate) fn positions(count: usize, seed: usize) -> Vec<Vec3> {
        (0..count)
            .map(|i| Vec3::from_fn(|c, _| 0.3 * noise(seed + 3 * i + c)))
            .collect()
    }

    /// Rest positions moved by noise, and a motion of them.
    pub(crate) fn rest(mesh: &PatternMesh, size: f64, seed: usize) -> Vec<Vec2> {
        let off = |i: usize| Vec2::from_fn(|c, _| size * noise(seed + 2 * i + c));
        mesh.x_bar
            .iter()
            .enumerate()
            .map(|(i, p)| p + off(i))
            .collect()
    }

    /// Every row's derivatives along one motion of x and x̄, against central differences.
    pub(crate) fn check_rows(
        rows: impl Fn(&[Vec3], &[Vec2]) -> Vec<Row>,
        (x, dx): (&[Vec3], &[Vec3]),
        (x_bar, dx_bar): (&[Vec2], &[Vec2]),
    ) {
        let at = |s: f64| {
            let x: Vec<Vec3> = x.iter().zip(dx).map(|(p, d)| p + d * s).collect();
            let x_bar: Vec<Vec2> = x_bar.iter().zip(dx_bar).map(|(p, d)| p + d * s).collect();
            rows(&x, &x_bar)
        };
        let here = at(0.0);
        assert!(!here.is_empty());
        let scale = here.iter().map(|r| r.value.abs()).fold(0.0, f64::max);
        for (i, row) in here.iter().enumerate() {
            let slope = row
                .x
                .iter()
                .map(|(v, g)| g.dot(&dx[*v as usize]))
                .sum::<f64>()
                + row
                    .x_bar
                    .iter()
                    .map(|(v, g)| g.dot(&dx_bar[*v as usize]))
                    .sum::<f64>();
            assert_derivative(|s| at(s)[i].value, slope, 1e-5, scale, 1e-6);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::assert_derivative;

    #[test]
    fn the_gradient_is_the_slope_of_the_total() {
        let (pattern, mesh) = fixtures::two_panels();
        let x_star = fixtures::positions(mesh.cloth_vertex_count, 1);
        let losses = Losses::new(&pattern, &mesh, &x_star, &LossParams::default());
        let (x, dx) = (
            fixtures::positions(mesh.cloth_vertex_count, 100),
            fixtures::positions(mesh.cloth_vertex_count, 500),
        );
        let x_bar = fixtures::rest(&mesh, 0.005, 900);
        let d_bar: Vec<Vec2> = fixtures::rest(&mesh, 0.01, 77)
            .iter()
            .zip(&mesh.x_bar)
            .map(|(p, q)| p - q)
            .collect();
        let at = |s: f64| {
            let x: Vec<Vec3> = x.iter().zip(&dx).map(|(p, d)| p + d * s).collect();
            let x_bar: Vec<Vec2> = x_bar.iter().zip(&d_bar).map(|(p, d)| p + d * s).collect();
            losses.evaluate(&x, &x_bar)
        };
        let here = at(0.0);
        let slope = here
            .x_hat
            .iter()
            .zip(&dx)
            .map(|(g, d)| g.dot(d))
            .sum::<f64>()
            + here
                .x_bar_hat
                .iter()
                .zip(&d_bar)
                .map(|(g, d)| g.dot(d))
                .sum::<f64>();
        assert_derivative(|s| at(s).total, slope, 1e-5, 1.0, 1e-7);
        let rows: f64 = losses
            .rows(&x, &x_bar)
            .iter()
            .map(|r| r.value * r.value)
            .sum();
        approx::assert_relative_eq!(rows, here.total, max_relative = 1e-12);
    }

    #[test]
    fn nothing_is_lost_at_the_target_with_the_reference_pattern() {
        let (pattern, mesh) = fixtures::two_panels();
        let x_star = fixtures::positions(mesh.cloth_vertex_count, 1);
        let losses = Losses::new(&pattern, &mesh, &x_star, &LossParams::default());
        // Round-off only.
        assert!(losses.evaluate(&x_star, &mesh.x_bar).total < 1e-20);
    }
}
