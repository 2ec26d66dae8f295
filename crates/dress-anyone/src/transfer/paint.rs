//! Ease painted on a drape: numbers at points, taken over by the cloth's nearest vertices, so that the
//! painted mesh may be numbered otherwise, or be finer or coarser, but not lie elsewhere.

use super::ease::{Ease, EaseAt};
use crate::geometry::bvh::Bvh;
use crate::geometry::{Vec3, bounds};
use crate::problem::Problem;
use rayon::prelude::*;

/// Numbers at the points of a painted mesh, in whatever unit of length it has.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Paint {
    /// `[painted vertex]`.
    pub points: Vec<Vec3>,
    /// κ at each: 0 keeps the ease in metres, 1 lets it grow with the body.
    pub kappa: Vec<f64>,
}

/// Metres in one unit of files.
const UNITS: [f64; 5] = [1.0, 0.1, 0.01, 0.001, 0.0254];
/// Share of the drape's diagonal that the painted mesh may be away from it at the median.
const OFF: f64 = 0.02;

impl Paint {
    /// The ease at every vertex of `drape` \[m\].
    pub fn onto(&self, drape: &[Vec3]) -> Result<Vec<EaseAt>, Problem> {
        let diagonal = |points: &[Vec3]| {
            let (low, high) = bounds(points);
            (high - low).norm()
        };
        let (wanted, own) = (diagonal(drape), diagonal(&self.points));
        let misfit = |unit: &f64| (unit * own / wanted).ln().abs();
        let unit = UNITS
            .into_iter()
            .min_by(|a, b| misfit(a).total_cmp(&misfit(b)))
            .unwrap_or(1.0);
        let points: Vec<Vec3> = self.points.iter().map(|p| p * unit).collect();
        let tree = Bvh::new(&points.iter().map(|p| [*p; 3]).collect::<Vec<_>>());
        let nearest = |x: &Vec3| -> Option<(f64, f64)> {
            let mut best = None;
            tree.nearest(*x, f64::INFINITY, |place, bound| {
                let point = tree.order()[place] as usize;
                let squared = (points[point] - x).norm_squared();
                if squared < bound {
                    best = Some((squared.sqrt(), self.kappa[point]));
                    squared
                } else {
                    bound
                }
            });
            best
        };
        let found: Vec<(f64, f64)> = drape.par_iter().filter_map(nearest).collect();
        let mut distances: Vec<f64> = found.iter().map(|(distance, _)| *distance).collect();
        distances.sort_by(f64::total_cmp);
        let median = distances.get(distances.len() / 2);
        if median.is_none_or(|&median| !(median <= OFF * wanted)) {
            return Err(Problem::whole(
                "the painted mesh does not lie on the garment's drape; paint the `garment.obj` that \
                 `dress drape` writes, and leave it where it is",
            ));
        }
        let ease = |(_, kappa): &(f64, f64)| Ease::Blend(*kappa).into();
        Ok(found.iter().map(ease).collect())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::check::noise;

    fn scattered(count: usize) -> Vec<Vec3> {
        let point = |i| Vec3::from_fn(|c, _| noise(3 * i + c));
        (0..count).map(point).collect()
    }

    #[test]
    fn paint_is_found_whatever_its_unit_and_numbering() {
        let drape = scattered(50);
        let paint = Paint {
            points: drape.iter().rev().map(|p| p * 100.0).collect(),
            kappa: (0..50).rev().map(|i| f64::from(i) / 50.0).collect(),
        };
        let ease = paint.onto(&drape).expect("on the drape");
        let expected = (0..50).map(|i| EaseAt::from(Ease::Blend(f64::from(i) / 50.0)));
        assert_eq!(ease, expected.collect::<Vec<_>>());
    }

    #[test]
    fn paint_that_lies_elsewhere_is_refused() {
        let drape = scattered(50);
        let moved: Vec<Vec3> = drape.iter().map(|p| p + Vec3::repeat(3.0)).collect();
        let kappa = vec![0.5; 50];
        let paint = Paint {
            points: moved,
            kappa,
        };
        assert!(paint.onto(&drape).is_err());
        assert!(Paint::default().onto(&drape).is_err());
    }
}
