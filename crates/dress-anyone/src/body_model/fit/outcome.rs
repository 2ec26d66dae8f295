//! How far the fitted surface and the scan are from each other, part by part, and when that is too
//! far for the scan to be a body.

use super::super::Part;
use super::scan::{Scan, blend, spread};
use crate::geometry::{ClosestPoint, TriangleMesh};
use crate::problem::Problem;
use rayon::prelude::*;
use serde::Serialize;

/// Distances between a fitted surface and a scan.
#[derive(Clone, Debug, Serialize)]
pub struct Distances {
    /// From the scan to the fitted surface, where garments are worn.
    pub scan_to_fit: Figures,
    /// From the fitted surface to the scan, where garments are worn and the scan has no hole.
    pub fit_to_scan: Figures,
    /// From the scan to the fitted surface everywhere: hands, feet and head too.
    pub whole_scan_to_fit: Figures,
    /// By part of the body, worst first: from the fitted surface to the scan.
    pub parts: Vec<PartFigures>,
}

/// Distances \[m\] in a few numbers.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Figures {
    /// How many were measured.
    pub count: usize,
    /// Their mean.
    pub mean: f64,
    /// Half are below this.
    pub median: f64,
    /// 95 % are below this.
    pub p95: f64,
    /// The largest.
    pub max: f64,
}

/// Distances of one part.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct PartFigures {
    /// The part.
    pub part: Part,
    /// Its distances.
    #[serde(flatten)]
    pub figures: Figures,
}

impl Figures {
    fn of(mut distances: Vec<f64>) -> Self {
        distances.sort_by(f64::total_cmp);
        let Some(max) = distances.last().copied() else {
            return Self::default();
        };
        let count = distances.len();
        let rank = |share: f64| distances[((share * count as f64) as usize).min(count - 1)];
        Self {
            count,
            mean: distances.iter().sum::<f64>() / count as f64,
            median: rank(0.5),
            p95: rank(0.95),
            max,
        }
    }
}

/// Points of each surface from which distances are measured. Not the number of [`Scan::samples`]: so
/// they are other points than those that were fitted.
const POINTS: usize = 21_000;

/// Distances between `body`, whose vertices belong to `parts`, and `scan`.
pub(super) fn distances(body: &TriangleMesh, parts: &[Part], scan: &Scan) -> Distances {
    let surface = ClosestPoint::new(body);
    let part_of = |t: usize| parts[body.triangles[t][0] as usize];
    let to_fit: Vec<(Part, f64)> = spread(&scan.mesh, POINTS)
        .par_iter()
        .filter_map(|(t, weights)| {
            let p = blend(&scan.mesh.positions, scan.mesh.triangles[*t], *weights);
            let foot = surface.query(p, f64::INFINITY)?;
            Some((part_of(foot.triangle as usize), foot.distance))
        })
        .collect();
    let to_scan: Vec<(Part, f64)> = spread(body, POINTS)
        .par_iter()
        .filter_map(|(t, weights)| {
            let p = blend(&body.positions, body.triangles[*t], *weights);
            let (aim, rim) = scan.closest(p, f64::INFINITY)?;
            (!rim).then(|| (part_of(*t), (p - aim.point).norm()))
        })
        .collect();
    let clothed = |pairs: &[(Part, f64)]| {
        let worn = pairs.iter().filter(|(part, _)| part.is_clothed());
        Figures::of(worn.map(|(_, d)| *d).collect())
    };
    let of_part = |part: Part| {
        let own = to_scan.iter().filter(|(p, _)| *p == part);
        let figures = Figures::of(own.map(|(_, d)| *d).collect());
        PartFigures { part, figures }
    };
    let mut by_part: Vec<PartFigures> = Part::ALL.map(of_part).to_vec();
    by_part.sort_by(|a, b| b.figures.mean.total_cmp(&a.figures.mean));
    Distances {
        scan_to_fit: clothed(&to_fit),
        fit_to_scan: clothed(&to_scan),
        whole_scan_to_fit: Figures::of(to_fit.iter().map(|(_, d)| *d).collect()),
        parts: by_part,
    }
}

/// How far a body may be from the model.
#[derive(Clone, Copy, Debug)]
pub(super) struct Limits {
    /// Mean distance of a clothed part, or of the whole mesh \[m\].
    pub(super) part: f64,
    /// Distance that 95 % of what is clothed may have, either way \[m\].
    pub(super) most: f64,
}

/// Refuses a mesh that is farther from the model than the limits, and tells where.
pub(super) fn refuse_strangers(distances: &Distances, limits: Limits) -> Result<(), Vec<Problem>> {
    let far = |p: &&PartFigures| p.part.is_clothed() && p.figures.mean > limits.part;
    let mut problems: Vec<Problem> = distances
        .parts
        .iter()
        .filter(far)
        .map(|p| {
            Problem::whole(format!(
                "no body was recognised in this mesh: {} of the body model stays {:.0} mm from it \
                 on average; it should be one body, standing, near an A- or T-pose",
                p.part.in_words(),
                1e3 * p.figures.mean
            ))
        })
        .collect();
    let p95 = distances.scan_to_fit.p95.max(distances.fit_to_scan.p95);
    if problems.is_empty() && p95 > limits.most {
        let clothed = distances.parts.iter().find(|p| p.part.is_clothed());
        problems.push(Problem::whole(format!(
            "no body was recognised in this mesh: a twentieth of the body model stays more than \
             {:.0} mm away, most of all {}; it should be one body, standing, near an A- or T-pose",
            1e3 * p95,
            clothed.map_or("", |p| p.part.in_words())
        )));
    }
    if distances.whole_scan_to_fit.mean > limits.part {
        problems.push(Problem::whole(format!(
            "no body was recognised in this mesh: its surface is {:.0} mm from the body model on \
             average; remove what is not the body (stand, hair, wide clothes)",
            1e3 * distances.whole_scan_to_fit.mean
        )));
    }
    if problems.is_empty() {
        Ok(())
    } else {
        Err(problems)
    }
}
