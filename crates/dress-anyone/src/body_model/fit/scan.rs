//! The surface to fit, prepared for questions: closest points, smooth normals, rims, and samples
//! spread evenly over its area.

use super::landmarks::Landmarks;
use crate::geometry::{ClosestPoint, Foot, TriangleMesh, Vec3};
use std::collections::BTreeMap;

/// A prepared surface.
pub(super) struct Scan {
    pub(super) mesh: TriangleMesh,
    pub(super) samples: Vec<Sample>,
    pub(super) landmarks: Landmarks,
    surface: ClosestPoint,
    normals: Vec<Vec3>,
    /// Whether a vertex lies on the rim of a hole.
    on_rim: Vec<bool>,
}

/// A point of the surface \[m\] and its outward unit normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Sample {
    pub(super) point: Vec3,
    pub(super) normal: Vec3,
}

/// Samples of a scan: on a body of 1.8 m² they are 1.1 cm apart.
const SAMPLES: usize = 16_000;

impl Scan {
    pub(super) fn new(mesh: TriangleMesh, landmarks: Landmarks) -> Self {
        let normals = mesh.vertex_normals();
        let samples = spread(&mesh, SAMPLES)
            .into_iter()
            .map(|(t, weights)| Sample {
                point: blend(&mesh.positions, mesh.triangles[t], weights),
                normal: blend(&normals, mesh.triangles[t], weights)
                    .try_normalize(0.0)
                    .unwrap_or_else(Vec3::zeros),
            })
            .collect();
        Self {
            surface: ClosestPoint::new(&mesh),
            on_rim: rim(&mesh),
            samples,
            landmarks,
            normals,
            mesh,
        }
    }

    /// The closest point no farther than `within` \[m\], and whether it lies on a rim.
    pub(super) fn closest(&self, p: Vec3, within: f64) -> Option<(Sample, bool)> {
        let foot = self.surface.query(p, within)?;
        let triangle = self.mesh.triangles[foot.triangle as usize];
        let normal = blend(&self.normals, triangle, foot.barycentric).try_normalize(0.0)?;
        let rim = self.is_rim(triangle, &foot);
        Some((
            Sample {
                point: foot.point,
                normal,
            },
            rim,
        ))
    }

    /// A foot is on a rim when all corners it leans on are.
    fn is_rim(&self, triangle: [u32; 3], foot: &Foot) -> bool {
        let leans = |(v, w): (&u32, &f64)| *w < 1e-9 || self.on_rim[*v as usize];
        let inside = foot.barycentric.iter().all(|w| *w > 1e-9);
        !inside && triangle.iter().zip(&foot.barycentric).all(leans)
    }
}

/// Σ weight · value over a triangle's corners.
pub(super) fn blend(values: &[Vec3], triangle: [u32; 3], weights: [f64; 3]) -> Vec3 {
    let [a, b, c] = triangle.map(|v| values[v as usize]);
    a * weights[0] + b * weights[1] + c * weights[2]
}

/// `count` points spread evenly over a surface: triangle and weights of its corners.
pub(super) fn spread(mesh: &TriangleMesh, count: usize) -> Vec<(usize, [f64; 3])> {
    let area = |t: usize| {
        let [a, b, c] = mesh.corners(t);
        (b - a).cross(&(c - a)).norm()
    };
    let areas: Vec<f64> = (0..mesh.triangles.len()).map(area).collect();
    let step = areas.iter().sum::<f64>() / count as f64;
    let mut points = Vec::with_capacity(count);
    let mut passed = 0.0;
    for (t, area) in areas.iter().enumerate() {
        passed += area;
        while points.len() < count && (points.len() as f64 + 0.5) * step < passed {
            // A sequence of low discrepancy in the square, folded into the triangle.
            let i = points.len() as f64;
            let (u, v) = ((i * 0.754_877_666).fract(), (i * 0.569_840_291).fract());
            let (u, v) = if u + v > 1.0 {
                (1.0 - u, 1.0 - v)
            } else {
                (u, v)
            };
            points.push((t, [1.0 - u - v, u, v]));
        }
    }
    points
}

/// Which vertices have an edge with one triangle only.
fn rim(mesh: &TriangleMesh) -> Vec<bool> {
    let mut sides: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for &[a, b, c] in &mesh.triangles {
        for [a, b] in [[a, b], [b, c], [c, a]] {
            *sides.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut on_rim = vec![false; mesh.positions.len()];
    for (edge, _) in sides.into_iter().filter(|(_, count)| *count == 1) {
        for v in edge {
            on_rim[v as usize] = true;
        }
    }
    on_rim
}
