//! The gradient of the whole loss beside differences of complete drapes, on one's own garment.
//!
//! Along random directions of the unknowns the slope that the adjoint predicts is compared with
//! (L(ζ + h d) − L(ζ − h d)) / 2h for several h. Small steps tell whether the gradient is right; large
//! ones how far it can be trusted, for wrinkles and contacts jump.

use super::prepare::Prepared;
use super::search::Run;
use super::search::guards::farthest;
use super::{Clock, Observer, RefitError, RefitParams};
use crate::body::Body;
use crate::garment::Garment;
use crate::sim::equilibrium::RestStatus;
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

/// Compares the gradient at the scaled reference with differences along `count` random directions.
pub fn check_gradient(
    garment: &Garment,
    source: &Body,
    target: &Body,
    params: &RefitParams,
    count: usize,
    observe: &mut Observer<'_>,
) -> Result<GradientCheck, RefitError> {
    let mut clock = Clock::new();
    let prepared = Prepared::new(garment, [source, target], None, params, &mut clock, observe)?;
    clock.stage("drapes to compare", observe);
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let zeta = prepared.initial();
    let mut run = Run::new(&mut clock, observe);
    let failed = |failed: super::search::point::Failed| failed.on(&target.name);
    let here = search
        .candidate(zeta.clone(), prepared.x_star.clone(), &mut run)
        .map_err(failed)?;
    let (gradient, _) = search.gradient(&here);
    // At rest the start does not matter, and a near one is quick; time steps must start alike.
    let start = match params.descent.gradient {
        crate::descent::Gradient::Equilibrium => here.end.x().to_vec(),
        crate::descent::Gradient::Trajectory => prepared.x_star.clone(),
    };
    let x_bar = prepared.cages.deform(&zeta);
    let mut directions = Vec::new();
    for number in 0..count {
        let random: Vec<f64> = (0..zeta.len()).map(|j| unstructured(number, j)).collect();
        let after = |s: f64| -> Vec<f64> {
            let each = zeta.iter().zip(&random);
            each.map(|(z, d)| z + s * d).collect()
        };
        let reach = farthest(&prepared.cages.deform(&after(1.0)), &x_bar);
        let mut loss = |s: f64| match search.candidate(after(s / reach), start.clone(), &mut run) {
            Ok(there) => Ok(Some(there.total)),
            Err(f) if f.status == RestStatus::Stopped => Err(failed(f)),
            Err(_) => Ok(None),
        };
        let mut measured = Vec::new();
        for h in STEPS {
            let ends = loss(h)?.zip(loss(-h)?);
            measured.push(ends.map(|(plus, minus)| (plus - minus) / (2.0 * h)));
        }
        let along: f64 = gradient.iter().zip(&random).map(|(g, d)| g * d).sum();
        directions.push(Direction {
            predicted: along / reach,
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
