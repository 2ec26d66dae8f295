//! Whether a refit finds a pattern that is known: the reference is changed at random within its
//! cages' space, draped on the target body, and searched for from that drape alone (METHOD §6.3).
//!
//! An edge is known as well as the loss tells. At the known pattern, with the Gauss–Newton matrix H =
//! JᵀJ of all residuals and the derivative l of the edge's length, the loss rises by no more than ε
//! while the edge changes by up to √(ε lᵀ H⁻¹ l); and the terms of the pattern, whose gradient there
//! is 2g, pull it by −lᵀ H⁻¹ g.

use super::flatten::fitted;
use super::prepare::Prepared;
use super::search::Run;
use super::search::point::Failed;
use super::{Clock, Observer, RefitError, RefitParams, levels};
use crate::body::Body;
use crate::descent::Gradient;
use crate::garment::Garment;
use crate::geometry::Vec2;
use crate::loss::Row;
use crate::pattern::{EdgeId, PatternMesh};
use crate::problem::Problem;
use crate::report::{Ending, Iteration};
use serde::Serialize;

/// How the reference is changed.
#[derive(Clone, Copy, Debug)]
pub struct Change {
    /// What number of random change.
    pub seed: usize,
    /// Largest stretch and shear of each panel along its axes \[–\]; how much these vary over the panel
    /// is of the same size.
    pub size: f64,
}

/// What became of the search.
#[derive(Clone, Debug, Serialize)]
pub struct Recovery {
    /// How it ended.
    pub ending: Ending,
    /// The loss of the known pattern at its own drape, which is what the terms of the pattern cost.
    pub known: f64,
    /// The first guess, then every accepted step.
    pub iterations: Vec<Iteration>,
    /// Every edge of the pattern.
    pub edges: Vec<Recovered>,
}

/// An edge of the pattern.
#[derive(Clone, Debug, Serialize)]
pub struct Recovered {
    /// "panel:edge".
    pub edge: String,
    /// Length in the first guess, in the known pattern, and in what was found \[m\].
    pub lengths: [f64; 3],
    /// By how much it may change while the loss rises by no more than if the drape moved by 0.1 mm
    /// rms \[m\].
    pub slack: f64,
    /// How far the terms of the pattern pull it from the known length, to first order \[m\].
    pub pull: f64,
}

impl Recovered {
    /// Whether it was found to 0.5 mm or 0.5 %.
    pub fn is_found(&self) -> bool {
        let [_, known, found] = self.lengths;
        let off = (found - known).abs();
        off < FOUND || off < FOUND_PART * known
    }

    /// Whether the drape tells its length so well, by the loss alone.
    pub fn is_determined(&self) -> bool {
        let known = self.lengths[1];
        self.slack + self.pull.abs() < FOUND.max(FOUND_PART * known)
    }
}

/// An edge is found if it is off by less than this \[m\], or by less than this part.
const FOUND: f64 = 0.5e-3;
const FOUND_PART: f64 = 5e-3;
/// Weight of the random motion, in mean squared distance \[1/cm²\].
const WANTED: f64 = 0.03;
/// A rise of the loss \[–\]: that of moving seams, boundaries and all else by 0.1 mm.
const RISE: f64 = 2.05e-4;

/// Searches for a pattern from its drape on `target`, beginning with the scaled reference, which fits
/// `source`.
pub fn recover(
    garment: &Garment,
    [source, target]: [&Body; 2],
    params: &RefitParams,
    change: Change,
    observe: &mut Observer<'_>,
) -> Result<Recovery, RefitError> {
    if params.descent.gradient == Gradient::Trajectory {
        let text = "how well a drape tells a pattern follows from its state of rest alone: choose the \
                    gradient `equilibrium`";
        let problem = Problem::at("descent parameter `gradient`", text);
        return Err(RefitError::Garment(vec![problem]));
    }
    let mut clock = Clock::new();
    let bodies = [source, target];
    let carried = Prepared::new(garment, bodies, None, params, &mut clock, observe)?;
    let known = changed(&carried, change);
    clock.stage("drape of the known pattern", observe);
    let x_star = {
        let scene = carried.scene();
        let start = carried.x_star.clone();
        let search = carried.search(&scene);
        let draped = search.candidate(known.clone(), start, &mut Run::new(&mut clock, observe));
        let draped = draped.map_err(|failed| carried.told(failed))?;
        draped.end.x().to_vec()
    };
    let prepared = carried.aimed_at(x_star.clone())?;
    let scene = prepared.scene();
    let search = prepared.search(&scene);
    let failed = |failed: Failed| prepared.told(failed);
    let there = search
        .candidate(known.clone(), x_star, &mut Run::new(&mut clock, observe))
        .map_err(failed)?;
    let total = there.total;
    let model = search.model(&*search.accept(there).map_err(failed)?);
    let found = levels::searched(&prepared, None, &mut clock, observe)?;

    let mesh = &garment.mesh;
    let shapes = [
        prepared.cages.deform(&prepared.initial()),
        prepared.cages.deform(&known),
        found.x_bar,
    ];
    let all = (0..mesh.edge_vertices.len()).flat_map(|panel| {
        (0..mesh.edge_vertices[panel].len()).map(move |edge| EdgeId { panel, edge })
    });
    let edges = all.map(|id| {
        let along = length_by(mesh, id, &shapes[1], &prepared.motions);
        let answer = model.undamped(&along);
        Recovered {
            edge: format!("{}:{}", garment.pattern.panels[id.panel].name, id.edge),
            lengths: [0, 1, 2].map(|k| length(mesh, id, &shapes[k])),
            slack: (RISE * answer.dot(&along)).sqrt(),
            pull: -answer.dot(model.half_gradient()),
        }
    });
    Ok(Recovery {
        ending: found.ending,
        known: total,
        iterations: found.iterations,
        edges: edges.collect(),
    })
}

/// The scaled reference, changed at random within what the cages can do and what can be sewn.
fn changed(prepared: &Prepared<'_>, Change { seed, size }: Change) -> Vec<f64> {
    let mesh = &prepared.garment.mesh;
    let start = prepared.cages.deform(&prepared.initial());
    let mut wanted = start.clone();
    let mut random = (0..).map(|k| super::gradient_check::unstructured(seed, k));
    for vertices in &mesh.panel_vertices {
        let all = &start[vertices.clone()];
        let middle = all.iter().sum::<Vec2>() / all.len() as f64;
        let spread = all.iter().map(|p| (p - middle).norm_squared()).sum::<f64>();
        let reach = (spread / all.len() as f64).sqrt();
        let by: Vec<f64> = random.by_ref().take(10).collect();
        for v in vertices.clone() {
            let q = (start[v] - middle) / reach;
            let terms = [q.x, q.y, 0.5 * q.x * q.x, 0.5 * q.x * q.y, 0.5 * q.y * q.y];
            let along = |k: usize| terms.iter().zip(&by[k..]).map(|(t, b)| t * b).sum::<f64>();
            wanted[v] += Vec2::new(along(0), along(5)) * (size * reach);
        }
    }
    let scale = (WANTED / wanted.len() as f64).sqrt() / 0.01;
    fitted(prepared, prepared.initial(), 1.0, |x_bar| {
        let rows = wanted.iter().zip(x_bar).enumerate();
        let rows = rows.flat_map(|(v, (goal, p))| {
            [Vec2::x(), Vec2::y()].map(|axis| Row {
                value: scale * axis.dot(&(p - goal)),
                x: Vec::new(),
                x_bar: vec![(v as u32, axis * scale)],
            })
        });
        rows.collect()
    })
}

/// Length of an edge \[m\].
fn length(mesh: &PatternMesh, id: EdgeId, x_bar: &[Vec2]) -> f64 {
    let ends = mesh.along(id).windows(2);
    ends.map(|p| (x_bar[p[1] as usize] - x_bar[p[0] as usize]).norm())
        .sum()
}

/// Its derivatives by the unknowns \[–\].
fn length_by(
    mesh: &PatternMesh,
    id: EdgeId,
    x_bar: &[Vec2],
    motions: &[Vec<Vec2>],
) -> nalgebra::DVector<f64> {
    let by = |motion: &Vec<Vec2>| -> f64 {
        let pieces = mesh.along(id).windows(2);
        let piece = |p: &[u32]| {
            let [a, b] = [p[0] as usize, p[1] as usize];
            (x_bar[b] - x_bar[a])
                .normalize()
                .dot(&(motion[b] - motion[a]))
        };
        pieces.map(piece).sum()
    };
    nalgebra::DVector::from_iterator(motions.len(), motions.iter().map(by))
}
