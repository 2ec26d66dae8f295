//! The target shape alone (paper §4.2), and how to judge it: whether the garment sits on the new body
//! as it sat on the old one. No pattern, no simulation but for the source drape.

use super::prepare::carried;
use super::{Clock, Observer, RefitError, RefitParams};
use crate::body::Body;
use crate::garment::Garment;
use crate::geometry::{ClosestPoint, Vec2, Vec3, intersections};
use crate::pattern::PatternMesh;
use crate::pattern::symmetry::Symmetry;
use crate::report::StageTime;
use crate::sim::energy::membrane::RestTriangle;
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
    /// Triangles that look the other way from the body than they did.
    pub turned_over: usize,
    /// Pairs of a cloth triangle and a triangle of the target body that intersect.
    pub through_body: usize,
    /// Pairs of cloth triangles that intersect and share no vertex, before and after.
    pub through_itself: [usize; 2],
    /// Mean turn of the cloth's seams and rims from mesh edge to mesh edge \[rad\], before and after.
    pub turning: [f64; 2],
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
}

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

/// Carries the garment's drape on `source`, made if it brought none, to `target`.
pub fn transfer(
    garment: &Garment,
    source: &Body,
    target: &Body,
    params: &RefitParams,
    observe: &mut Observer<'_>,
) -> Result<Transfer, RefitError> {
    let mut clock = Clock::new();
    let (source_drape, aim) = carried(garment, [source, target], params, &mut clock, observe)?;
    clock.stage("done", observe);
    let mesh = &garment.mesh;
    let triangles = mesh.outward_triangles();
    let both = [&source_drape, &aim.x_star];
    let bodies = [source, target].map(|body| ClosestPoint::new(&body.mesh));
    let skin = &target.mesh;
    let through_itself = both.map(|x| intersections::within(x, &triangles).len());
    let through_body =
        intersections::between(&aim.x_star, &triangles, &skin.positions, &skin.triangles).len();
    let report = TransferReport {
        iterations: aim.iterations,
        converged: aim.converged,
        spacing: spacing(garment, both, &bodies),
        stretch: stretch(&triangles, both),
        turned_over: turned_over(&triangles, both, &bodies),
        through_body,
        through_itself,
        turning: both.map(|x| turning(mesh, x)),
        asymmetry: both.map(|x| asymmetry(garment, &source_drape, x)),
        stages: clock.stages,
    };
    Ok(Transfer {
        source_drape,
        x_star: aim.x_star,
        report,
    })
}

/// Distances to the bodies by panel.
fn spacing(garment: &Garment, x: [&Vec<Vec3>; 2], bodies: &[ClosestPoint; 2]) -> Vec<Spacing> {
    let mesh = &garment.mesh;
    let panels = garment.pattern.panels.iter().zip(&mesh.panel_vertices);
    panels
        .map(|(panel, vertices)| {
            let on = |k: usize| {
                let at = |v: usize| x[k][mesh.sewing[v] as usize];
                Spread::of(
                    vertices
                        .clone()
                        .map(|v| bodies[k].signed_distance(at(v)))
                        .collect(),
                )
            };
            Spacing {
                panel: panel.name.clone(),
                before: on(0),
                after: on(1),
            }
        })
        .collect()
}

/// Principal stretches of the second shape over the first.
fn stretch(triangles: &[[u32; 3]], [before, after]: [&Vec<Vec3>; 2]) -> [Spread; 2] {
    let (mut least, mut most) = (Vec::new(), Vec::new());
    for t in triangles {
        let rest = RestTriangle::new(laid_flat(t.map(|v| before[v as usize])));
        if !(rest.area > 0.0) {
            continue;
        }
        let f = rest.gradient_of(t.map(|v| after[v as usize]));
        let [low, high] = super::measure::principal_stretches(&f);
        least.push(low);
        most.push(high);
    }
    [Spread::of(least), Spread::of(most)]
}

/// A triangle in its own plane.
fn laid_flat([a, b, c]: [Vec3; 3]) -> [Vec2; 3] {
    let along = (b - a).try_normalize(0.0).unwrap_or_else(Vec3::x);
    let side = c - a;
    let x = along.dot(&side);
    let y = (side - along * x).norm();
    [
        Vec2::zeros(),
        Vec2::new((b - a).norm(), 0.0),
        Vec2::new(x, y),
    ]
}

/// Triangles whose side towards the body changed.
fn turned_over(triangles: &[[u32; 3]], x: [&Vec<Vec3>; 2], bodies: &[ClosestPoint; 2]) -> usize {
    let faces_out = |t: &[u32; 3], k: usize| {
        let corners = t.map(|v| x[k][v as usize]);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        let foot = bodies[k].query(middle, f64::INFINITY)?;
        let away = bodies[k].pseudonormal(&foot);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        Some(normal.dot(&away) > 0.0)
    };
    let turned = |t: &&[u32; 3]| faces_out(t, 0) != faces_out(t, 1);
    triangles.iter().filter(turned).count()
}

/// Mean angle between neighbouring mesh edges along the pattern's edges \[rad\].
fn turning(mesh: &PatternMesh, x: &[Vec3]) -> f64 {
    let (mut sum, mut count) = (0.0, 0);
    for edge in mesh.edge_vertices.iter().flatten() {
        let points: Vec<Vec3> = edge
            .iter()
            .map(|v| x[mesh.sewing[*v as usize] as usize])
            .collect();
        for p in points.windows(3) {
            sum += (p[1] - p[0]).angle(&(p[2] - p[1]));
            count += 1;
        }
    }
    sum / f64::from(count.max(1))
}

/// Farthest a vertex is from the mirror image of its partner \[m\].
fn asymmetry(garment: &Garment, source_drape: &[Vec3], x: &[Vec3]) -> f64 {
    let mesh = &garment.mesh;
    let symmetry = Symmetry::detect(&garment.pattern, mesh, Some(source_drape));
    let mut worst = 0.0_f64;
    for mirror in &symmetry.mirrors {
        let Some(partners) = mirror.vertices(mesh) else {
            continue;
        };
        let first = mesh.panel_vertices[mirror.panels[0]].clone();
        for (v, w) in first.zip(partners) {
            let [p, q] = [v, w as usize].map(|v| x[mesh.sewing[v] as usize]);
            let image = Vec3::new(2.0 * symmetry.plane - p.x, p.y, p.z);
            worst = worst.max((image - q).norm());
        }
    }
    worst
}
