//! What a search works on: the target shape (paper §4.2), cages (§4.3) with their symmetry (§4.5), the
//! initial scale (§4.6), the body to drape on and the loss (§4.4).

use super::dress::{holds, surface};
use super::search::aside::Spare;
use super::search::point::Failed;
use super::search::{self, Search};
use super::{Clock, Observer, RefitError, RefitParams, drape_to_rest};
use crate::body::Body;
use crate::body::distance_field::DistanceField;
use crate::cage::Cages;
use crate::descent::Gradient;
use crate::garment::Garment;
use crate::geometry::{Vec2, Vec3};
use crate::loss::Losses;
use crate::pattern::resample::resample;
use crate::pattern::symmetry::Symmetry;
use crate::sim::equilibrium::RestStatus;
use crate::sim::{Assembly, Cloth, Scene};
use crate::transfer::{Layout, target_shape};
use std::sync::Arc;

/// A mesh of less than this many times a coarser one's vertices needs no coarser one.
const WORTH_COARSENING: usize = 2;

/// Everything that follows from garment, bodies and parameters, and that no search changes.
pub(super) struct Prepared<'a> {
    pub(super) garment: &'a Garment,
    pub(super) target: &'a Body,
    pub(super) params: &'a RefitParams,
    /// The garment on the source body \[m\].
    pub(super) source_drape: Vec<Vec3>,
    /// The shape to aim for \[m\].
    pub(super) x_star: Vec<Vec3>,
    /// What is held is held at its height here \[m\].
    held: Vec<Vec3>,
    pub(super) symmetry: Option<Symmetry>,
    pub(super) cages: Cages,
    /// Scale of the initial guess \[–\].
    pub(super) scale: f64,
    cloth: Cloth,
    assembly: Assembly,
    surface: Arc<DistanceField>,
    pub(super) losses: Losses,
    /// ∂x̄ along each unknown, `[unknown][pattern vertex]`.
    pub(super) motions: Vec<Vec<Vec2>>,
    pub(super) spare: Spare,
}

impl<'a> Prepared<'a> {
    pub(super) fn new(
        garment: &'a Garment,
        [source, target]: [&'a Body; 2],
        x_star: Option<Vec<Vec3>>,
        params: &'a RefitParams,
        clock: &mut Clock,
        observe: &mut Observer<'_>,
    ) -> Result<Self, RefitError> {
        let problems = params.descent.problems();
        if !problems.is_empty() {
            return Err(RefitError::Garment(problems));
        }
        let mesh = &garment.mesh;
        let layout = Layout::of(garment, &params.transfer).map_err(RefitError::Garment)?;
        // All cores make the source's surface, for the drape waits for it; the target's then has time.
        let on_source = OnSource::new(garment, source, params, clock, observe)?;
        let aim = || {
            let source_drape = on_source.drape(params, observe)?;
            let x_star = if let Some(x_star) = x_star {
                x_star
            } else {
                clock.stage("target shape", observe);
                target_shape(&source_drape, &layout, source, target, &params.transfer)?.x_star
            };
            clock.stage("target body", observe);
            Ok::<_, RefitError>((source_drape, x_star))
        };
        let (aim, surface) = Spare::all().both(aim, || surface(target));
        let (source_drape, x_star) = aim?;

        clock.stage("cages", observe);
        let symmetry = params
            .symmetry
            .then(|| Symmetry::detect(&garment.pattern, mesh, garment.drape.as_deref()));
        Self::aiming(
            garment,
            [source_drape, x_star.clone(), x_star],
            symmetry,
            (target, Arc::new(surface)),
            params,
        )
    }

    /// A search that aims at the second of the drapes, where the first is what the garment was.
    fn aiming(
        garment: &'a Garment,
        [source_drape, x_star, held]: [Vec<Vec3>; 3],
        symmetry: Option<Symmetry>,
        (target, surface): (&'a Body, Arc<DistanceField>),
        params: &'a RefitParams,
    ) -> Result<Self, RefitError> {
        let mesh = &garment.mesh;
        // §4.3, §4.5: the unknowns are the control points of one cage per panel.
        let cages = Cages::enclose(&garment.pattern, mesh, symmetry.as_ref(), &params.cage)
            .map_err(RefitError::Garment)?;
        let mut cloth = params.cloth(garment);
        cloth.holds = holds(garment, &held, &params.hold);
        Ok(Self {
            garment,
            target,
            params,
            scale: initial_scale(garment, &source_drape, &x_star),
            assembly: Assembly::new(&cloth),
            losses: Losses::new(&garment.pattern, mesh, &x_star, &params.loss),
            motions: search::newton::motions(&cages, mesh),
            source_drape,
            x_star,
            spare: Spare::all(),
            held,
            symmetry,
            cages,
            cloth,
            surface,
        })
    }

    /// The same search aiming at `x_star` instead, with the same held.
    pub(super) fn aimed_at(self, x_star: Vec<Vec3>) -> Result<Self, RefitError> {
        let drapes = [self.source_drape, x_star, self.held];
        let body = (self.target, self.surface);
        Self::aiming(self.garment, drapes, self.symmetry, body, self.params)
    }

    /// The garment in a mesh of about `wanted` vertices; none if it has few more than that itself, or cannot be
    /// meshed so coarsely, or is searched in the paper's way.
    pub(super) fn coarser(&self, wanted: usize) -> Option<Garment> {
        let count = self.garment.mesh.cloth_vertex_count;
        let paper = self.params.descent.gradient == Gradient::Trajectory;
        if paper || wanted == 0 || count < WORTH_COARSENING * wanted {
            return None;
        }
        self.garment.remeshed(wanted)
    }

    /// The same search with the mesh of `coarse`: same aim, same cages, so its unknowns are these.
    pub(super) fn on_mesh_of<'b>(
        &'b self,
        coarse: &'b Garment,
    ) -> Result<Prepared<'b>, RefitError> {
        let fine = &self.garment.mesh;
        let drapes =
            [&self.source_drape, &self.x_star, &self.held].map(|x| resample(fine, x, &coarse.mesh));
        let body = (self.target, Arc::clone(&self.surface));
        Prepared::aiming(coarse, drapes, self.symmetry.clone(), body, self.params)
    }

    /// The cloth on the target body.
    pub(super) fn scene(&self) -> Scene<'_, DistanceField> {
        Scene {
            cloth: &self.cloth,
            assembly: &self.assembly,
            surface: &*self.surface,
            params: &self.params.sim,
        }
    }

    /// The search, ready to run in this scene.
    pub(super) fn search<'s>(
        &'s self,
        scene: &'s Scene<'s, DistanceField>,
    ) -> Search<'s, DistanceField> {
        Search {
            mesh: &self.garment.mesh,
            cages: &self.cages,
            losses: &self.losses,
            scene,
            params: &self.params.descent,
            motions: &self.motions,
            guide: 0.0,
            spare: &self.spare,
            keep: None,
        }
    }

    /// Why there is no drape on the target body, in words.
    pub(super) fn told(&self, failed: Failed) -> RefitError {
        if failed.status == RestStatus::Stopped {
            return RefitError::Stopped;
        }
        let Garment { pattern, mesh, .. } = self.garment;
        RefitError::NotAtRest {
            body: self.target.name.clone(),
            status: failed.status,
            residual: failed.residual,
            broken: failed.broken.map(|broken| broken.told(pattern, mesh)),
        }
    }

    /// The unknowns of the scaled reference.
    pub(super) fn initial(&self) -> Vec<f64> {
        self.cages.scaled(self.scale)
    }
}

/// A garment about to be draped on the source body.
pub(super) struct OnSource<'a> {
    garment: &'a Garment,
    source: &'a Body,
    drape: SourceDrape<'a>,
}

/// The garment's drape on the source body.
enum SourceDrape<'a> {
    /// Its file has it \[m\].
    Brought(&'a [Vec3]),
    /// To be made on this surface.
    Wanted(DistanceField),
}

impl<'a> OnSource<'a> {
    /// Checks what `params` name, and makes what the drape needs.
    pub(super) fn new(
        garment: &'a Garment,
        source: &'a Body,
        params: &RefitParams,
        clock: &mut Clock,
        observe: &mut Observer<'_>,
    ) -> Result<Self, RefitError> {
        let problems = params.problems(&garment.pattern);
        if !problems.is_empty() {
            return Err(RefitError::Garment(problems));
        }
        clock.stage("source drape", observe);
        let drape = match &garment.drape {
            Some(x) => SourceDrape::Brought(x),
            None => SourceDrape::Wanted(surface(source)),
        };
        Ok(Self {
            garment,
            source,
            drape,
        })
    }

    /// The garment on the source body \[m\]: as its file has it, or from the placed panels.
    pub(super) fn drape(
        self,
        params: &RefitParams,
        observe: &mut Observer<'_>,
    ) -> Result<Vec<Vec3>, RefitError> {
        match self.drape {
            SourceDrape::Brought(x) => Ok(x.to_vec()),
            SourceDrape::Wanted(surface) => {
                drape_to_rest(self.garment, (self.source, &surface), params, observe)
            }
        }
    }
}

/// The uniform scale of the initial guess (§4.6, corrected): √ of the growth of the cloth's area
/// from drape to target, so that stretch already in the drape does not count as size.
fn initial_scale(garment: &Garment, drape: &[Vec3], x_star: &[Vec3]) -> f64 {
    let triangles = garment.mesh.cloth_triangles();
    let area = |x: &[Vec3]| -> f64 {
        let doubled = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|v| x[v as usize]);
            (b - a).cross(&(c - a)).norm()
        };
        triangles.iter().map(doubled).sum()
    };
    (area(x_star) / area(drape)).sqrt().clamp(0.3, 3.0)
}
