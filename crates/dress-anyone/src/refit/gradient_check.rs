//! The gradient of the whole loss beside differences of complete drapes, on one's own garment.
//!
//! Along random directions of the unknowns the slope that the adjoint predicts is compared with
//! (L(ζ + h d) − L(ζ − h d)) / 2h for several h. Small steps tell whether the gradient is right; large
//! ones how far it can be trusted, for wrinkles and contacts jump.

use super::prepare::Prepared;
use super::search::Run;
use super::search::guards::farthest;
use super::search::point::{Candidate, Failed};
use super::{Clock, Observer, RefitError, RefitParams};
use crate::body::Body;
use crate::body::distance_field::DistanceField;
use crate::descent::Gradient;
use crate::garment::Garment;
use crate::geometry::Vec3;
use crate::sim::equilibrium::RestStatus;
use nalgebra::DVector;
use serde::Serialize;

/// Steps of the differences: farthest move of any pattern vertex \[m\], from large to small.
const STEPS: [f64; 7] = [1e-2, 3e-3, 1e-3, 1e-4, 1e-5, 1e-6, 1e-7];
/// Relative difference up to which a gradient counts as trusted \[–\].
pub const TRUSTED: f64 = 1e-2;

/// Predicted and measured slopes.
#[derive(Clone, Debug, Serialize)]
pub struct GradientCheck {
    /// The loss of the scaled reference.
    pub loss: f64,
    /// ‖f‖/(‖m‖|g|) of its drape.
    pub residual: f64,
    /// Unknowns of the cages.
    pub unknowns: usize,
    /// Farthest moves of the pattern in the differences \[m\].
    pub steps: Vec<f64>,
    /// One for each direction.
    pub directions: Vec<Direction>,
    /// The largest step up to which predicted and measured slopes of all directions agree to
    /// [`TRUSTED`], from the step of best agreement on \[m\]; none if no step does.
    pub trust: Option<f64>,
}

/// The loss along one direction.
#[derive(Clone, Debug, Serialize)]
pub struct Direction {
    /// Slope from the gradient \[1/m\], per farthest move of the pattern.
    pub predicted: f64,
    /// Slopes from differences \[1/m\]; none where a drape failed.
    pub measured: Vec<Option<f64>>,
}

impl Direction {
    /// Relative difference of prediction and measurement, `[step]`.
    pub fn differences(&self) -> impl Iterator<Item = Option<f64>> {
        let relative = |m: f64| (m - self.predicted).abs() / m.abs().max(self.predicted.abs());
        self.measured.iter().map(move |m| m.map(relative))
    }
}

/// The loss along a direction, and what the gradients on the way say of it.
#[derive(Clone, Debug, Serialize)]
pub struct Line {
    /// Farthest moves of the pattern from the scaled reference, with sign \[m\].
    pub moves: Vec<f64>,
    /// Loss there, and its slope along the line \[1/m\]; none where a drape failed.
    pub points: Vec<Option<(f64, f64)>>,
}

impl Line {
    /// By which part the change of the loss from each point to the next is another than the mean of the
    /// slopes at both says \[–\].
    pub fn steps(&self) -> impl Iterator<Item = f64> {
        let moves = self.moves.windows(2).map(|at| at[1] - at[0]);
        moves.zip(self.points.windows(2)).map(|(step, ends)| {
            let [Some((a, at_a)), Some((b, at_b))] = ends else {
                return f64::INFINITY;
            };
            let (change, said) = (b - a, 0.5 * (at_a + at_b) * step);
            (change - said).abs() / change.abs().max(said.abs())
        })
    }
}

/// Compares the gradient at the scaled reference with differences along `count` random directions.
pub fn check_gradient(
    garment: &Garment,
    bodies: [&Body; 2],
    params: &RefitParams,
    count: usize,
    observe: &mut Observer<'_>,
) -> Result<GradientCheck, RefitError> {
    let mut clock = Clock::new();
    let prepared = Prepared::new(garment, bodies, None, params, &mut clock, observe)?;
    clock.stage("drapes to compare", observe);
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let mut run = Run::new(&mut clock, observe);
    let failed = |failed: Failed| prepared.told(failed);
    let zeta = prepared.initial();
    let here = search.candidate(zeta.clone(), prepared.x_star.clone(), &mut run);
    let here = here.map_err(failed)?;
    let (gradient, _) = search.gradient(&here).map_err(failed)?;
    let start = start(&prepared, here.end.x());
    let mut directions = Vec::new();
    for number in 0..count {
        let straight = Straight::new(&prepared, number);
        let mut loss = |s: f64| match search.candidate(straight.at(s), start.clone(), &mut run) {
            Ok(there) => Ok(Some(there.total)),
            Err(f) if f.status == RestStatus::Stopped => Err(failed(f)),
            Err(_) => Ok(None),
        };
        let mut measured = Vec::new();
        for h in STEPS {
            let ends = loss(h)?.zip(loss(-h)?);
            measured.push(ends.map(|(plus, minus)| (plus - minus) / (2.0 * h)));
        }
        directions.push(Direction {
            predicted: straight.slope(&gradient),
            measured,
        });
    }
    Ok(GradientCheck {
        loss: here.total,
        residual: here.end.residual(),
        unknowns: zeta.len(),
        steps: STEPS.to_vec(),
        trust: trust(&directions),
        directions,
    })
}

/// The loss along the first random direction at `2 * count + 1` points, up to moves of the pattern of
/// `reach` \[m\] either way. Each drape starts where the last ended, so that jumps are the cloth's own.
pub fn loss_along(
    garment: &Garment,
    bodies: [&Body; 2],
    params: &RefitParams,
    (reach, count): (f64, usize),
    observe: &mut Observer<'_>,
) -> Result<Line, RefitError> {
    let mut clock = Clock::new();
    let prepared = Prepared::new(garment, bodies, None, params, &mut clock, observe)?;
    clock.stage("drapes along a line", observe);
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let mut run = Run::new(&mut clock, observe);
    let failed = |failed: Failed| prepared.told(failed);
    let straight = Straight::new(&prepared, 0);
    let step = reach / count as f64;
    let centre = search.candidate(straight.at(0.0), prepared.x_star.clone(), &mut run);
    let centre = centre.map_err(failed)?;
    let told = |there: &Candidate<'_, DistanceField>| {
        let (gradient, _) = search.gradient(there)?;
        Ok((there.total, straight.slope(&gradient)))
    };
    let mut side = |sign: f64| {
        let mut x = start(&prepared, centre.end.x());
        let mut points = Vec::new();
        for k in 1..=count {
            let zeta = straight.at(sign * step * k as f64);
            points.push(match search.candidate(zeta, x.clone(), &mut run) {
                Ok(there) => {
                    x = start(&prepared, there.end.x());
                    told(&there).ok()
                }
                Err(f) if f.status == RestStatus::Stopped => return Err(failed(f)),
                Err(_) => None,
            });
        }
        Ok(points)
    };
    let mut points = side(-1.0)?;
    points.reverse();
    points.push(Some(told(&centre).map_err(failed)?));
    points.extend(side(1.0)?);
    let moves = (0..points.len()).map(|k| step * (k as f64 - count as f64));
    Ok(Line {
        moves: moves.collect(),
        points,
    })
}

/// Where a drape near one that ended at `x` starts. At rest the start does not matter, and a near one is
/// quick; time steps must start alike.
fn start(prepared: &Prepared<'_>, x: &[Vec3]) -> Vec<Vec3> {
    match prepared.params.descent.gradient {
        Gradient::Equilibrium => x.to_vec(),
        Gradient::Trajectory => prepared.x_star.clone(),
    }
}

/// A straight line through the scaled reference.
struct Straight {
    zeta: Vec<f64>,
    /// Change of the unknowns \[–\] per farthest move of the pattern.
    along: Vec<f64>,
}

impl Straight {
    /// In the random direction of this number.
    fn new(prepared: &Prepared<'_>, number: usize) -> Self {
        let zeta = prepared.initial();
        let random: Vec<f64> = (0..zeta.len()).map(|j| unstructured(number, j)).collect();
        let moved: Vec<f64> = zeta.iter().zip(&random).map(|(z, d)| z + d).collect();
        let cages = &prepared.cages;
        let reach = farthest(&cages.deform(&moved), &cages.deform(&zeta));
        Self {
            zeta,
            along: random.into_iter().map(|d| d / reach).collect(),
        }
    }

    /// The unknowns where the farthest move is `s` \[m\].
    fn at(&self, s: f64) -> Vec<f64> {
        let each = self.zeta.iter().zip(&self.along);
        each.map(|(z, d)| z + s * d).collect()
    }

    /// Slope along the line of what has this gradient.
    fn slope(&self, gradient: &DVector<f64>) -> f64 {
        gradient.iter().zip(&self.along).map(|(g, d)| g * d).sum()
    }
}

/// The largest step of the unbroken run of agreeing steps that the best step belongs to.
fn trust(directions: &[Direction]) -> Option<f64> {
    let worst: Vec<f64> = (0..STEPS.len())
        .map(|step| {
            let at = directions
                .iter()
                .map(|d| d.differences().nth(step).flatten());
            at.map(|d| d.unwrap_or(f64::INFINITY)).fold(0.0, f64::max)
        })
        .collect();
    let best = (0..STEPS.len()).min_by(|a, b| worst[*a].total_cmp(&worst[*b]))?;
    let agrees = |step: &usize| worst[*step] < TRUSTED;
    let first = (0..=best).rev().take_while(agrees).last()?;
    Some(STEPS[first])
}

/// A number in (−1, 1) without pattern, the same in every run.
pub(super) fn unstructured(direction: usize, unknown: usize) -> f64 {
    let seed = (1 + unknown + 7919 * direction) as f64;
    2.0 * (seed.sin() * 43_758.545_3).rem_euclid(1.0) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn slopes_of_a_parabola_tell_all_its_changes_and_not_its_jumps() {
        let at = |s: f64| Some((1.0 + 3.0 * s * s, 6.0 * s));
        let mut line = Line {
            moves: vec![1.0, 2.0, 3.0, 4.0],
            points: [1.0, 2.0, 3.0, 4.0].map(at).to_vec(),
        };
        assert!(line.steps().all(|off| off < 1e-12));
        line.points[2] = Some((0.0, 18.0));
        line.points[3] = None;
        let off: Vec<f64> = line.steps().collect();
        assert!(
            off[0] < 1e-12 && off[1] > 0.5 && off[2].is_infinite(),
            "{off:?}"
        );
    }

    #[test]
    fn trust_ends_where_a_direction_jumps() {
        let direction = |measured: [f64; 7]| Direction {
            predicted: 1.0,
            measured: measured.map(Some).to_vec(),
        };
        // Right from 1 mm down to 1 µm, where round-off sets in.
        let smooth = direction([1.3, 1.05, 1.002, 1.0001, 1.000_001, 1.0005, 1.2]);
        let jumpy = direction([0.2, 1.001, 1.05, 1.003, 1.000_02, 1.001, 0.5]);
        assert_eq!(trust(std::slice::from_ref(&smooth)), Some(1e-3));
        // Agreement by chance beyond a jump does not count.
        assert_eq!(trust(&[smooth, jumpy]), Some(1e-4));
        assert_eq!(trust(&[direction([2.0; 7])]), None);
    }
}
