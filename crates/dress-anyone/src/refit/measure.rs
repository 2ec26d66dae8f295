//! The numbers of the report: what the refit changed, and whether its result can be trusted.

use super::written::Written;
use crate::body::Body;
use crate::garment::Garment;
use crate::geometry::closest_point::ClosestPoint;
use crate::geometry::intersections;
use crate::geometry::quality::{QualitySummary, qualities};
use crate::geometry::{Vec2, Vec3};
use crate::loss::Losses;
use crate::pattern::symmetry::Symmetry;
use crate::pattern::{EdgeId, Pattern, PatternMesh};
use crate::report::{
    DrapeReport, Ending, Iteration, MirrorReport, PanelReport, PatternQuality, Report, SeamReport,
    StageTime,
};
use crate::sim::energy::membrane::RestTriangle;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Drape, OrFabric};

/// Everything measured.
pub(super) struct Measured<'a> {
    pub(super) garment: &'a Garment,
    pub(super) source: &'a Body,
    pub(super) target: &'a Body,
    pub(super) source_drape: &'a [Vec3],
    pub(super) x_star: &'a [Vec3],
    pub(super) symmetry: Option<&'a Symmetry>,
    pub(super) written: &'a Written,
    pub(super) last: &'a Drape,
    pub(super) losses: &'a Losses,
}

impl Measured<'_> {
    pub(super) fn report(
        &self,
        ending: Ending,
        initial_scale: f64,
        unknowns: usize,
        iterations: Vec<Iteration>,
        stages: Vec<StageTime>,
    ) -> Report {
        let mesh = &self.garment.mesh;
        let name = |body: &Body| body.name.clone();
        Report {
            version: env!("CARGO_PKG_VERSION"),
            status: ending.status(),
            ending,
            names: [
                self.garment.name.clone(),
                name(self.source),
                name(self.target),
            ],
            size: [mesh.cloth_vertex_count, mesh.triangles.len()],
            unknowns,
            initial_scale,
            iterations,
            written: Some(
                self.losses
                    .evaluate(&self.last.x, &self.written.x_bar)
                    .terms,
            ),
            distance_to_target: distances(&self.last.x, self.x_star),
            source_drape: drape_report(mesh, &mesh.x_bar, self.source_drape, self.source, None),
            final_drape: drape_report(
                mesh,
                &self.written.x_bar,
                &self.last.x,
                self.target,
                Some(self.last),
            ),
            quality_before: quality(mesh, &mesh.x_bar),
            quality_after: quality(mesh, &self.written.x_bar),
            panels: self.panels(),
            seams: seams(&self.garment.pattern, &self.written.pattern),
            mirrors: self
                .symmetry
                .map(|s| mirrors(&self.garment.pattern, &self.written.pattern, s))
                .unwrap_or_default(),
            stages,
        }
    }

    fn panels(&self) -> Vec<PanelReport> {
        let pairs = self
            .garment
            .pattern
            .panels
            .iter()
            .zip(&self.written.pattern.panels);
        pairs
            .zip(&self.written.residuals)
            .map(|((before, after), residuals)| {
                let edges = |panel: &crate::pattern::Panel| {
                    (0..panel.edges.len())
                        .map(|e| panel.edge_length(e))
                        .collect()
                };
                PanelReport {
                    panel: after.name.clone(),
                    area_before: before.signed_area().abs(),
                    area_after: after.signed_area().abs(),
                    outline_residuals: residuals.clone(),
                    edges_before: edges(before),
                    edges_after: edges(after),
                }
            })
            .collect()
    }
}

/// Mean and largest distance of corresponding points \[m\].
fn distances(x: &[Vec3], y: &[Vec3]) -> [f64; 2] {
    let each: Vec<f64> = x.iter().zip(y).map(|(a, b)| (a - b).norm()).collect();
    [
        each.iter().sum::<f64>() / each.len() as f64,
        each.iter().copied().fold(0.0, f64::max),
    ]
}

/// A drape against the body's exact mesh and its own rest shape; without the search that found it,
/// it counts as at rest.
pub fn drape_report(
    mesh: &PatternMesh,
    x_bar: &[Vec2],
    x: &[Vec3],
    body: &Body,
    drape: Option<&Drape>,
) -> DrapeReport {
    let closest = ClosestPoint::new(&body.mesh);
    let depths: Vec<f64> = x.iter().map(|p| -closest.signed_distance(*p)).collect();
    let mut stretch = (f64::INFINITY, 0.0_f64);
    for t in &mesh.triangles {
        let rest = RestTriangle::new(t.map(|v| x_bar[v as usize]));
        let f = rest.gradient_of(t.map(|v| x[mesh.sewing[v as usize] as usize]));
        let [low, high] = principal_stretches(&f);
        stretch = (stretch.0.min(low), stretch.1.max(high));
    }
    let cloth = mesh.cloth_triangles();
    let (y, skin) = (&body.mesh.positions, &body.mesh.triangles);
    DrapeReport {
        status: drape.map_or(RestStatus::AtRest, |d| d.status),
        residual: drape.map_or(0.0, |d| d.residual),
        friction: drape.map_or(OrFabric::Number(0.0), |d| d.friction),
        deepest_penetration: depths.iter().copied().fold(0.0, f64::max),
        vertices_inside: depths.iter().filter(|d| **d > 0.0).count(),
        through_body: intersections::between(x, &cloth, y, skin).len(),
        through_itself: intersections::within(x, &cloth).len(),
        least_stretch: stretch.0,
        most_stretch: stretch.1,
    }
}

/// Least and largest stretch of a deformation gradient.
pub(super) fn principal_stretches(f: &crate::sim::energy::membrane::Mat3x2) -> [f64; 2] {
    let c = f.transpose() * f;
    let mean = 0.5 * c.trace();
    let radius = (0.25 * (c.m11 - c.m22).powi(2) + c.m12 * c.m12).sqrt();
    [(mean - radius).max(0.0).sqrt(), (mean + radius).sqrt()]
}

fn quality(mesh: &PatternMesh, x_bar: &[Vec2]) -> PatternQuality {
    let each = qualities(x_bar, &mesh.triangles);
    PatternQuality {
        flipped: each.iter().filter(|q| **q <= 0.0).count(),
        quality: QualitySummary::of(&each).expect("a meshed pattern has triangles"),
    }
}

/// Seam lengths on both sides, before and after.
fn seams(before: &Pattern, after: &Pattern) -> Vec<SeamReport> {
    let name = |id: EdgeId| format!("{}:{}", before.panels[id.panel].name, id.edge);
    let stitches = before.stitches.iter();
    stitches
        .map(|stitch| {
            let lengths = |pattern: &Pattern| stitch.sides.map(|id| pattern.edge_length(id));
            let (old, new) = (lengths(before), lengths(after));
            SeamReport {
                sides: stitch.sides.map(name),
                before: old,
                after: new,
                ratio_change: (new[0] / new[1]) / (old[0] / old[1]) - 1.0,
            }
        })
        .collect()
}

/// Corners this near to each other's mirror image correspond \[m\].
const SAME_CORNER: f64 = 1e-3;

/// How far corners moved unlike their mirror images, per mirror pair.
fn mirrors(before: &Pattern, after: &Pattern, symmetry: &Symmetry) -> Vec<MirrorReport> {
    let reports = symmetry.mirrors.iter().map(|mirror| {
        let [a, b] = mirror.panels;
        let image = |pattern: &Pattern| -> Vec<Vec2> {
            pattern.panels[a]
                .vertices
                .iter()
                .map(|p| mirror.reflection.apply(*p))
                .collect()
        };
        let (old, new) = (image(before), image(after));
        // Corners without a mirrored partner (an edge split on one side only) cannot be compared.
        let partner = |p: &Vec2| {
            let corners = before.panels[b].vertices.iter();
            corners
                .enumerate()
                .find(|(_, q)| (*q - p).norm() < SAME_CORNER)
        };
        let error = old.iter().zip(&new).filter_map(|(o, n)| {
            let (i, q) = partner(o)?;
            let moved = after.panels[b].vertices[i] - q;
            Some(((n - o) - moved).norm())
        });
        MirrorReport {
            panels: [a, b].map(|p| after.panels[p].name.clone()),
            error: error.fold(0.0, f64::max),
        }
    });
    reports.collect()
}
