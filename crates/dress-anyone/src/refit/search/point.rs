//! Patterns tried in a search: their drape, by the static solve or by the paper's time steps, their
//! loss, and — once accepted — its gradient.

use super::{Run, Search};
use crate::descent::Gradient;
use crate::geometry::{Vec2, Vec3};
use crate::loss::Loss;
use crate::refit::checkpoint::Checkpoint;
use crate::sim::broken::Broken;
use crate::sim::differentiable::{Differentiable, differentiable_at};
use crate::sim::drape::DrapeProgress;
use crate::sim::energy::contact::Surface;
use crate::sim::energy::friction::Grip;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Start, Trajectory, drape};
use nalgebra::DVector;

/// Residual at which cloth is almost at rest \[–\], and a trial judged: from there to rest the loss changes by a
/// percent or two.
pub(in crate::refit) const ALMOST_AT_REST: f64 = 0.1;

/// Residual below which cloth settles \[–\]: from there its loss seldom changes by more than a few percent.
const SETTLING: f64 = 3.0;
/// Loss meanwhile, as part of the wanted one, from which there is no way back.
const HOPELESS: f64 = 1.1;

/// Told how a trial's drape is getting on; whether to go on with it.
type Judge<'a> = dyn FnMut(DrapeProgress, &dyn Fn() -> Vec<Vec3>) -> bool + 'a;

/// Where a drape ended, with what its derivative needs.
pub(in crate::refit) enum End<'a, S> {
    /// At rest.
    Rest(Box<Differentiable<'a>>),
    /// Where the time steps left it.
    Path(Box<Trajectory<'a, S>>),
}

/// Why there is no drape to speak of.
#[derive(Clone, Copy, Debug)]
pub(in crate::refit) struct Failed {
    /// How the search for it ended.
    pub(in crate::refit) status: RestStatus,
    /// ‖f‖/(‖m‖|g|).
    pub(in crate::refit) residual: f64,
    /// Where the drape, or the walk back through it, broke down, if it did.
    pub(in crate::refit) broken: Option<Broken>,
}

/// A pattern tried, and its drape.
pub(in crate::refit) struct Candidate<'a, S> {
    pub(super) zeta: Vec<f64>,
    pub(in crate::refit) end: End<'a, S>,
    pub(in crate::refit) loss: Loss,
    /// Weighted loss with the cages' priors.
    pub(in crate::refit) total: f64,
}

/// A pattern accepted.
pub(in crate::refit) struct Point<'a> {
    pub(super) zeta: Vec<f64>,
    pub(super) x: Vec<Vec3>,
    pub(super) x_bar: Vec<Vec2>,
    pub(super) loss: Loss,
    pub(super) total: f64,
    /// ∂L/∂ζ \[1/m\].
    pub(super) gradient: DVector<f64>,
    /// ‖λ‖∞ of the equilibrium's adjoint; ‖x̂‖ at most over the last of the trajectory's.
    pub(super) adjoint_norm: f64,
    pub(super) residual: f64,
    pub(super) shift: f64,
    /// The state of rest; none with time steps, whose way is forgotten.
    pub(super) state: Option<Box<Differentiable<'a>>>,
}

impl Point<'_> {
    /// Friction there; none without.
    pub(super) fn grips(&self) -> Vec<Grip> {
        (self.state.as_ref()).map_or_else(Vec::new, |state| state.grips().to_vec())
    }
}

impl Failed {
    /// Stopped before there was anything to tell.
    pub(super) const STOPPED: Self = Self {
        status: RestStatus::Stopped,
        residual: f64::NAN,
        broken: None,
    };

    /// Whether it was asked to stop.
    pub(super) fn stopped<T>(found: &Result<T, Self>) -> bool {
        (found.as_ref()).is_err_and(|failed| failed.status == RestStatus::Stopped)
    }
}

impl<S: Surface> End<'_, S> {
    /// Positions \[m\].
    pub(in crate::refit) fn x(&self) -> &[Vec3] {
        match self {
            Self::Rest(state) => &state.drape.x,
            Self::Path(trajectory) => trajectory.x(),
        }
    }

    /// The rest shape \[m\].
    fn x_bar(&self) -> &[Vec2] {
        match self {
            Self::Rest(state) => &state.drape.x_bar,
            Self::Path(trajectory) => trajectory.x_bar(),
        }
    }

    /// ‖f‖/(‖m‖|g|).
    pub(in crate::refit) fn residual(&self) -> f64 {
        match self {
            Self::Rest(state) => state.drape.residual,
            Self::Path(trajectory) => trajectory.residual(),
        }
    }

    /// (∂x/∂x̄)ᵀ x̂, and how large the adjoint grew; or where it broke down.
    fn pull_back(&self, x_hat: &[Vec3]) -> Result<(Vec<Vec2>, f64), Broken> {
        match self {
            Self::Rest(state) => {
                let (hat, lambda) = state.pull_back(x_hat);
                Ok((hat, lambda.iter().map(Vec3::norm).fold(0.0, f64::max)))
            }
            Self::Path(trajectory) => {
                let hat = trajectory.pull_back(x_hat);
                hat.broken.map_or(Ok((hat.x_bar, hat.growth)), Err)
            }
        }
    }
}

impl<'s, S: Surface> Search<'s, S> {
    /// The pattern of the unknowns `zeta`, draped from a nearby start, and its loss.
    pub(in crate::refit) fn candidate(
        &self,
        zeta: Vec<f64>,
        start: Vec<Vec3>,
        run: &mut Run<'_, '_>,
    ) -> Result<Candidate<'s, S>, Failed> {
        let all = &mut |_, _: &dyn Fn() -> Vec<Vec3>| true;
        self.draped(zeta, start, all, run)
    }

    /// The same with its gradient, if its loss is below what is `wanted`, which is asked when the cloth is almost
    /// at rest: what is not better by then is not draped to its end. With `patience`, neither is what takes more than
    /// so many factorisations, nor what is far from better while it settles: cloth may snap into another state.
    pub(super) fn trial(
        &self,
        zeta: &[f64],
        start: Vec<Vec3>,
        wanted: &dyn Fn() -> f64,
        patience: Option<usize>,
        run: &mut Run<'_, '_>,
    ) -> Result<Option<Box<Point<'s>>>, Failed> {
        let x_bar = self.cages.deform(zeta);
        let (mut promising, mut refused) = (false, false);
        let mut judge = |progress, x: &dyn Fn() -> Vec<Vec3>| {
            let DrapeProgress::Settling {
                iteration,
                residual,
            } = progress
            else {
                return true;
            };
            let total = || self.total(&self.losses.evaluate(&x(), &x_bar), zeta);
            if !promising && residual < ALMOST_AT_REST {
                promising = total() < wanted();
                refused = !promising;
            } else if let Some(most) = patience {
                let hopeless = residual < SETTLING && !(total() < HOPELESS * wanted());
                refused = hopeless || iteration >= most;
            }
            !refused
        };
        let tried = self.draped(zeta.to_vec(), start, &mut judge, run);
        if refused {
            return Ok(None);
        }
        let better = Some(tried?).filter(|tried| tried.total < wanted());
        better.map(|better| self.accept(better)).transpose()
    }

    fn draped(
        &self,
        zeta: Vec<f64>,
        start: Vec<Vec3>,
        judge: &mut Judge<'_>,
        run: &mut Run<'_, '_>,
    ) -> Result<Candidate<'s, S>, Failed> {
        let x_bar = self.cages.deform(&zeta);
        run.count_drape();
        let end = match self.params.gradient {
            Gradient::Equilibrium => self.rest(&x_bar, start, judge, run)?,
            Gradient::Trajectory => self.path(&x_bar, start, run)?,
        };
        let loss = self.losses.evaluate(end.x(), &x_bar);
        Ok(Candidate {
            total: self.total(&loss, &zeta),
            zeta,
            end,
            loss,
        })
    }

    /// The drape at rest, polished.
    fn rest(
        &self,
        x_bar: &[Vec2],
        start: Vec<Vec3>,
        judge: &mut Judge<'_>,
        run: &mut Run<'_, '_>,
    ) -> Result<End<'s, S>, Failed> {
        let found = drape(self.scene, x_bar, start, Start::Near, &mut |p, x| {
            run.drapes(p) && judge(p, x)
        });
        let failed = Failed {
            status: found.status,
            residual: found.residual,
            broken: found.broken,
        };
        if failed.status != RestStatus::AtRest {
            run.count_factorisations(found.iterations);
            return Err(failed);
        }
        let state = found.differentiable(self.scene).ok_or(failed)?;
        run.count_factorisations(state.drape.iterations);
        Ok(End::Rest(Box::new(state)))
    }

    /// The drape as far as the paper's time steps bring it.
    fn path(
        &self,
        x_bar: &[Vec2],
        start: Vec<Vec3>,
        run: &mut Run<'_, '_>,
    ) -> Result<End<'s, S>, Failed> {
        let steps = self.scene.params.step.steps();
        let found = Trajectory::run(self.scene, x_bar, start, steps, &mut |p| run.drapes(p));
        let found = found.ok_or(Failed::STOPPED)?;
        let (residual, broken) = (found.residual(), found.broken());
        if broken.is_some() || !residual.is_finite() {
            return Err(Failed {
                status: RestStatus::NotFinite,
                residual,
                broken,
            });
        }
        Ok(End::Path(Box::new(found)))
    }

    /// The gradient of a candidate's loss by the unknowns \[1/m\], and how large the adjoint grew.
    pub(in crate::refit) fn gradient(
        &self,
        of: &Candidate<'_, S>,
    ) -> Result<(DVector<f64>, f64), Failed> {
        let pulled = of.end.pull_back(&of.loss.x_hat);
        let (mut hat, adjoint_norm) = pulled.map_err(|broken| Failed {
            status: RestStatus::NotFinite,
            residual: of.end.residual(),
            broken: Some(broken),
        })?;
        for (hat, direct) in hat.iter_mut().zip(&of.loss.x_bar_hat) {
            *hat += direct;
        }
        let mut gradient = DVector::from_vec(self.cages.pull_back(&hat));
        for prior in self.priors(&of.zeta) {
            for (j, slope) in prior.by {
                gradient[j] += 2.0 * prior.value * slope;
            }
        }
        Ok((gradient, adjoint_norm))
    }

    /// The candidate with its gradient, if that does not break down. Its stiffness is factored anew from its
    /// positions alone, so that a resumed search goes on with the same bits.
    pub(in crate::refit) fn accept(
        &self,
        mut candidate: Candidate<'s, S>,
    ) -> Result<Box<Point<'s>>, Failed> {
        if let End::Rest(state) = &mut candidate.end {
            let (x, x_bar) = (state.drape.x.clone(), state.drape.x_bar.clone());
            let grips = state.grips().to_vec();
            if let Some(anew) = differentiable_at(self.scene, &x_bar, x, grips) {
                **state = anew;
            }
        }
        let (gradient, adjoint_norm) = self.gradient(&candidate)?;
        let end = candidate.end;
        let (x, x_bar, residual) = (end.x().to_vec(), end.x_bar().to_vec(), end.residual());
        let state = match end {
            End::Rest(state) => Some(state),
            End::Path(_) => None,
        };
        Ok(Box::new(Point {
            zeta: candidate.zeta,
            x,
            x_bar,
            loss: candidate.loss,
            total: candidate.total,
            gradient,
            adjoint_norm,
            residual,
            shift: state.as_ref().map_or(0.0, |state| state.shift),
            state,
        }))
    }

    /// The point that a checkpoint was made at; none if its stiffness cannot be factored.
    pub(super) fn restored(&self, from: &Checkpoint) -> Option<Box<Point<'s>>> {
        let x_bar = self.cages.deform(&from.zeta);
        let state = match self.params.gradient {
            Gradient::Equilibrium => Some(Box::new(differentiable_at(
                self.scene,
                &x_bar,
                from.x.clone(),
                from.grips.clone(),
            )?)),
            Gradient::Trajectory => None,
        };
        let loss = self.losses.evaluate(&from.x, &x_bar);
        Some(Box::new(Point {
            total: self.total(&loss, &from.zeta),
            zeta: from.zeta.clone(),
            x: from.x.clone(),
            x_bar,
            loss,
            gradient: from.gradient.clone(),
            adjoint_norm: from.adjoint_norm,
            residual: from.residual,
            shift: from.shift,
            state,
        }))
    }

    /// Weighted loss with the cages' priors.
    fn total(&self, loss: &Loss, zeta: &[f64]) -> f64 {
        let priors = self.priors(zeta);
        loss.total + priors.iter().map(|p| p.value * p.value).sum::<f64>()
    }
}
