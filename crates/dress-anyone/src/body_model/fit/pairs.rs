//! Which point of the model belongs to which point of the scan: closest points both ways, as rows
//! of a least-squares problem, weight · (n · (x − y))², with the scan's normal n.
//!
//! A pair counts less the farther it is (Geman–McClure: (σ²/(σ² + d²))²), and not at all when its
//! normals disagree or it ends on the rim of a hole.

use super::scan::{Sample, Scan, blend};
use super::{Part, importance};
use crate::geometry::mesh::vertex_normals;
use crate::geometry::{ClosestPoint, TriangleMesh, Vec3};
use rayon::prelude::*;

/// One point-to-plane distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Row {
    /// The model's point, as weighted vertices.
    pub(super) corners: [u32; 3],
    pub(super) shares: [f64; 3],
    /// The scan's point and normal.
    pub(super) aim: Sample,
    /// n · (x − y) \[m\].
    pub(super) residual: f64,
    /// Robust weight times importance; 1 for a full pair \[–\].
    pub(super) weight: f64,
}

/// How pairs are looked for.
#[derive(Clone, Copy, Debug)]
pub(super) struct Search {
    /// Distance \[m\] at which a pair counts a quarter; beyond three of them it is dropped.
    pub(super) sigma: f64,
    /// Least cosine between the normals of a pair.
    pub(super) cosine: f64,
    /// About how many vertices take part, and how many samples.
    pub(super) points: usize,
}

/// All pairs between `body` and `scan`.
pub(super) fn pairs(body: &TriangleMesh, parts: &[Part], scan: &Scan, search: Search) -> Vec<Row> {
    let normals = vertex_normals(&body.positions, &body.triangles);
    let stride = |count: usize| count.div_ceil(search.points).max(1);
    let (vertices, samples) = (body.positions.len(), scan.samples.len());
    let mut rows: Vec<Row> = (0..vertices)
        .into_par_iter()
        .step_by(stride(vertices))
        .filter_map(|v| from_vertex(v, body, normals[v], parts[v], scan, search))
        .collect();
    let surface = ClosestPoint::new(body);
    let back: Vec<Row> = scan
        .samples
        .par_iter()
        .step_by(stride(samples))
        .filter_map(|sample| from_sample(*sample, body, &surface, &normals, parts, search))
        .collect();
    // Both directions count alike, however many there are of each.
    let tried = |count: usize| count as f64 / stride(count) as f64;
    let share = tried(vertices) / tried(samples);
    let weighed = |row: Row| Row {
        weight: row.weight * share,
        ..row
    };
    rows.extend(back.into_iter().map(weighed));
    rows
}

fn from_vertex(
    v: usize,
    body: &TriangleMesh,
    normal: Vec3,
    part: Part,
    scan: &Scan,
    search: Search,
) -> Option<Row> {
    let x = body.positions[v];
    let (aim, rim) = scan.closest(x, 3.0 * search.sigma)?;
    if rim || aim.normal.dot(&normal) < search.cosine {
        return None;
    }
    Some(Row {
        corners: [v as u32; 3],
        shares: [1.0, 0.0, 0.0],
        aim,
        residual: aim.normal.dot(&(x - aim.point)),
        weight: importance(part) * geman_mcclure((x - aim.point).norm_squared(), search.sigma),
    })
}

fn from_sample(
    aim: Sample,
    body: &TriangleMesh,
    surface: &ClosestPoint,
    normals: &[Vec3],
    parts: &[Part],
    search: Search,
) -> Option<Row> {
    let foot = surface.query(aim.point, 3.0 * search.sigma)?;
    let corners = body.triangles[foot.triangle as usize];
    let normal = blend(normals, corners, foot.barycentric).try_normalize(0.0)?;
    if aim.normal.dot(&normal) < search.cosine {
        return None;
    }
    let part = parts[corners[0] as usize];
    Some(Row {
        corners,
        shares: foot.barycentric,
        aim,
        residual: aim.normal.dot(&(foot.point - aim.point)),
        weight: importance(part) * geman_mcclure(foot.distance * foot.distance, search.sigma),
    })
}

/// Distance \[m\] below which this share of all points is, both ways and whatever their normals.
pub(super) fn quantile(body: &TriangleMesh, scan: &Scan, share: f64) -> f64 {
    let surface = ClosestPoint::new(body);
    let to_body = scan.samples.par_iter().step_by(COARSE);
    let mut distances: Vec<f64> = to_body
        .filter_map(|s| Some(surface.query(s.point, f64::INFINITY)?.distance))
        .collect();
    let to_scan = body.positions.par_iter().step_by(COARSE);
    distances.par_extend(to_scan.filter_map(|x| {
        let (aim, rim) = scan.closest(*x, f64::INFINITY)?;
        (!rim).then(|| (x - aim.point).norm())
    }));
    distances.sort_by(f64::total_cmp);
    let rank = (share * distances.len() as f64) as usize;
    distances.get(rank).copied().unwrap_or(0.0)
}

/// Every how manyth point a quantile is taken of.
const COARSE: usize = 6;

/// Weight of a pair at a distance: 1 when it is zero, a quarter at `sigma`.
pub(super) fn geman_mcclure(squared: f64, sigma: f64) -> f64 {
    let s = sigma * sigma;
    (s / (s + squared)).powi(2)
}
