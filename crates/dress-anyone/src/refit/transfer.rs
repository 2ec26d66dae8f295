//! The target shape alone (paper §4.2), and how to judge it: whether the garment sits on the new body
//! as it sat on the old one. No pattern, no simulation but for the source drape.

mod judge;

use super::prepare::OnSource;
use super::{Clock, Observer, RefitError, RefitParams};
use crate::body::Body;
use crate::garment::Garment;
use crate::geometry::{ClosestPoint, Vec3, intersections};
use crate::report::StageTime;
use crate::transfer::{Layout, Paint, target_shape, turned_over};
use serde::Serialize;

/// A garment carried to another body.
#[derive(Clone, Debug)]
pub struct Transfer {
    /// The garment on the source body \[m\], `[cloth vertex]`.
    pub source_drape: Vec<Vec3>,
    /// The target shape x* \[m\].
    pub x_star: Vec<Vec3>,
    /// How well it keeps the design.
    pub report: TransferReport,
}

/// How a target shape compares to the drape it comes from.
#[derive(Clone, Debug, Serialize)]
pub struct TransferReport {
    /// Rounds of relaxing and rebinding.
    pub iterations: usize,
    /// Whether they ended by the tolerance.
    pub converged: bool,
    /// Distance to the body, panel by panel.
    pub spacing: Vec<Spacing>,
    /// Stretch of x* over the source drape: of every triangle the smaller and the larger principal
    /// one \[–\].
    pub stretch: [Spread; 2],
    /// Triangles that are turned over against their surroundings.
    pub turned_over: usize,
    /// Pairs of a cloth triangle and a triangle of the target body that intersect.
    pub through_body: usize,
    /// Pairs of cloth triangles that intersect and share no vertex, before and after.
    pub through_itself: [usize; 2],
    /// Mean curvature of the cloth's seams \[1/m\], before and after.
    pub seam_curvature: [f64; 2],
    /// Mean curvature of its rims \[1/m\].
    pub rim_curvature: [f64; 2],
    /// Largest change of an edge that was to keep its length \[–\]; zero where none was.
    pub kept: f64,
    /// Farthest a vertex of a mirrored panel is from the mirror image of its partner \[m\], before and
    /// after; zero where nothing is mirrored.
    pub asymmetry: [f64; 2],
    /// Time of each stage.
    pub stages: Vec<StageTime>,
}

/// Distances of a panel to the bodies \[m\].
#[derive(Clone, Debug, Serialize)]
pub struct Spacing {
    /// Its name.
    pub panel: String,
    /// On the source body.
    pub before: Spread,
    /// On the target body.
    pub after: Spread,
    /// Vertices by their distance to the source body: below 0, below 3 mm, and so on, the last beyond
    /// all of [`BINS`].
    pub histogram_before: Vec<usize>,
    /// The same on the target body.
    pub histogram_after: Vec<usize>,
}

/// Where the bins of distances to the body end \[m\].
pub const BINS: [f64; 8] = [0.0, 3e-3, 6e-3, 0.01, 0.02, 0.03, 0.05, 0.1];

/// How numbers are spread.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Spread {
    /// Least.
    pub least: f64,
    /// One in twenty is below.
    pub low: f64,
    /// Half are below.
    pub median: f64,
    /// One in twenty is above.
    pub high: f64,
    /// Most.
    pub most: f64,
}

impl Spread {
    fn of(mut numbers: Vec<f64>) -> Self {
        numbers.sort_by(f64::total_cmp);
        let at = |part: f64| {
            let last = numbers.len().saturating_sub(1) as f64;
            let place = (part * last).round() as usize;
            numbers.get(place).copied().unwrap_or(0.0)
        };
        Self {
            least: at(0.0),
            low: at(0.05),
            median: at(0.5),
            high: at(0.95),
            most: at(1.0),
        }
    }
}

/// Carries the garment's drape on `source`, made if it brought none, to `target`; with the ease that is
/// painted on the drape, if some is.
pub fn transfer(
    garment: &Garment,
    paint: Option<&Paint>,
    [source, target]: [&Body; 2],
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Result<Transfer, RefitError> {
    let mut clock = Clock::new();
    let mut layout = Layout::of(garment, &params.transfer).map_err(RefitError::Garment)?;
    let on_source = OnSource::new(garment, source, params, &mut clock, observe)?;
    let source_drape = on_source.drape(params, observe)?;
    if let Some(paint) = paint {
        let painted = paint.onto(&source_drape);
        layout.ease = painted.map_err(|problem| RefitError::Garment(vec![problem]))?;
    }
    clock.stage("target shape", observe);
    let aim = target_shape(&source_drape, &layout, source, target, &params.transfer)?;
    clock.stage("report", observe);
    let triangles = &layout.triangles;
    let both = [&source_drape, &aim.x_star];
    let bodies = [source, target].map(|body| ClosestPoint::new(&body.mesh));
    let skin = &target.mesh;
    let through_itself = both.map(|x| intersections::within(x, triangles).len());
    let through_body =
        intersections::between(&aim.x_star, triangles, &skin.positions, &skin.triangles).len();
    let curvature = |rims: bool| both.map(|x| judge::curvature(garment, x, rims));
    let mut report = TransferReport {
        iterations: aim.iterations,
        converged: aim.converged,
        spacing: judge::spacing(garment, both, &bodies),
        stretch: judge::stretch(triangles, both),
        turned_over: turned_over(triangles, [&source_drape, &aim.x_star]).len(),
        through_body,
        through_itself,
        seam_curvature: curvature(false),
        rim_curvature: curvature(true),
        kept: judge::kept(&layout.kept, both),
        asymmetry: both.map(|x| judge::asymmetry(garment, &source_drape, x)),
        stages: Vec::new(),
    };
    clock.stage("done", observe);
    report.stages = clock.stages;
    Ok(Transfer {
        source_drape,
        x_star: aim.x_star,
        report,
    })
}
