//! Gauss–Newton over place, size, pose, shape and bone stretch.
//!
//! Minimises the mean of the weighted squared distances \[m²\] plus λ_i (p_i − p_i⁰)² for every
//! parameter, and what landmarks add, with closed-form Jacobians; pairs are sought anew before every step.

use super::super::pose::{BEFORE_ROTATIONS, Jacobian};
use super::super::{BodyModel, Part, Pose, Shape};
use super::landmarks::Pull;
use super::pairs::{Row, Search, pairs, quantile};
use super::scan::Scan;
use super::skin::{clusters, collapsed};
use crate::geometry::{TriangleMesh, Vec3};
use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

/// The model as fitted so far.
#[derive(Clone, Debug)]
pub(super) struct State {
    pub(super) shape: Shape,
    pub(super) pose: Pose,
}

/// A few steps with one idea of what is near and what is free.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    /// See [`Search::sigma`] \[m\].
    pub(super) sigma: f64,
    pub(super) steps: usize,
    /// See [`Search::points`].
    pub(super) points: usize,
    /// How many shape components are free; stretches are when any is.
    pub(super) shapes: usize,
    pub(super) freedom: Freedom,
}

/// What a unit of a parameter costs \[m²\], as a mean squared distance.
#[derive(Clone, Copy, Debug)]
pub(super) struct Freedom {
    /// Per rad².
    pub(super) pose: f64,
    pub(super) shape: f64,
    pub(super) stretch: f64,
}

/// Least cosine between normals of a pair while the pose is still rough.
const COSINE: f64 = 0.3;
/// No joint turns more than this in a step \[rad\].
const MOST_TURN: f64 = 0.35;

/// The model's surface, whole or thinned out, as the search for pairs wants it.
pub(super) struct Surface<'a> {
    pub(super) model: &'a BodyModel,
    /// The model's vertices that take part.
    vertices: Vec<u32>,
    /// Between them.
    triangles: Vec<[u32; 3]>,
    /// Of each of them.
    parts: Vec<Part>,
}

impl<'a> Surface<'a> {
    /// Every vertex.
    pub(super) fn whole(model: &'a BodyModel) -> Self {
        let template = &model.parts().template;
        Self {
            model,
            vertices: (0..template.positions.len() as u32).collect(),
            triangles: template.triangles.clone(),
            parts: model.parts_of_vertices(),
        }
    }

    /// One vertex for each cell of a grid \[m\], for the first steps: an eighth of the work.
    pub(super) fn coarse(model: &'a BodyModel, cell: f64) -> Self {
        let template = &model.parts().template;
        let (index, count) = clusters(template, cell);
        let mut vertices = vec![0; count];
        for (v, i) in index.iter().enumerate().rev() {
            if let Some(vertex) = vertices.get_mut(*i as usize) {
                *vertex = v as u32;
            }
        }
        let parts = model.parts_of_vertices();
        Self {
            model,
            parts: vertices.iter().map(|v| parts[*v as usize]).collect(),
            triangles: collapsed(&template.triangles, &index),
            vertices,
        }
    }

    fn at(&self, positions: &[Vec3]) -> TriangleMesh {
        let place = |v: &u32| positions[*v as usize];
        TriangleMesh {
            positions: self.vertices.iter().map(place).collect(),
            triangles: self.triangles.clone(),
        }
    }

    /// Share of both surfaces without a partner within `sigma` \[m\]: 0 for the same, 1 for
    /// nothing near; and as much again for the landmarks.
    pub(super) fn misfit(&self, scan: &Scan, state: &State, sigma: f64) -> f64 {
        let posed = self.model.posed(&state.shape, &state.pose, &[]);
        let search = Search {
            sigma,
            cosine: COSINE,
            points: self.vertices.len(),
        };
        let rows = pairs(&self.at(&posed.positions), &self.parts, scan, search);
        let most = 2.0 * self.vertices.len() as f64;
        let missed = scan.landmarks.misfit(&posed);
        1.0 - rows.iter().map(|row| row.weight).sum::<f64>() / most + missed
    }
}

/// Does the steps of one round.
pub(super) fn refine(surface: &Surface<'_>, scan: &Scan, state: &mut State, round: &Round) {
    let model = surface.model;
    let mut search = Search {
        sigma: round.sigma,
        cosine: COSINE,
        points: round.points,
    };
    let costs = costs(model, round);
    for step_index in 0..round.steps {
        let posed = model.posed(&state.shape, &state.pose, &[]);
        let body = surface.at(&posed.positions);
        if step_index % WIDEN_EVERY == 0 && round.shapes > 0 {
            let far = quantile(&body, scan, REACHED);
            search.sigma = far.clamp(round.sigma, WIDEST);
        }
        let mut rows = pairs(&body, &surface.parts, scan, search);
        for row in &mut rows {
            row.corners = row.corners.map(|v| surface.vertices[v as usize]);
        }
        let jacobian = Jacobian::new(model, &posed, &state.pose);
        let pulls = scan.landmarks.pulls(&posed, round.sigma);
        let Some(step) = step(&jacobian, &rows, &pulls, &costs, &values(state)) else {
            return;
        };
        take(state, &step);
    }
}

/// Pairs reach for this share of both surfaces: on bodies far from human whole feet begin beyond a
/// round's own reach.
const REACHED: f64 = 0.97;
/// And never farther \[m\].
const WIDEST: f64 = 0.1;
/// Steps after which the reach is measured again.
const WIDEN_EVERY: usize = 4;

/// λ of every parameter; infinite where it is held.
fn costs(model: &BodyModel, round: &Round) -> Vec<f64> {
    let parts = model.parts();
    let mut costs = vec![0.0, 0.0, 0.0, SIZE];
    for j in 0..parts.joint_count() {
        costs.extend([round.freedom.pose * stiffness(model, j); 3]);
    }
    for k in 0..parts.component_count() {
        costs.push(if k >= parts.shape_count && round.shapes > 0 {
            round.freedom.stretch
        } else if k < round.shapes && k < parts.shape_count {
            round.freedom.shape
        } else {
            f64::INFINITY
        });
    }
    costs
}

/// What ln s costs \[m²\]: shapes know how tall people are built, size alone does not.
const SIZE: f64 = 1e-4;

/// How unwilling joint `j` is to turn: the trunk bends little, ankles and wrists less than knees
/// and elbows, fingers and faces hardly at all.
fn stiffness(model: &BodyModel, j: usize) -> f64 {
    match j {
        0 => 0.0,
        3 | 6 | 9 | 13 | 14 => 10.0,
        10 | 11 => 30.0,
        12 | 15 | 20 | 21 => 3.0,
        7 | 8 => 2.0,
        _ if j >= 22 => 100.0,
        _ => match Part::of_joint(model, j) {
            Part::Trunk => 10.0,
            _ => 1.0,
        },
    }
}

/// All parameters as one vector; translation and the body's turn are free, whatever their value.
fn values(state: &State) -> Vec<f64> {
    let mut values = vec![0.0, 0.0, 0.0, state.shape.scale.ln()];
    values.extend(state.pose.rotations.iter().flat_map(|r| [r.x, r.y, r.z]));
    values.extend(&state.shape.components);
    values
}

/// Rows gathered into one matrix at a time; sums are added in this order on any machine.
const CHUNK: usize = 512;

/// The Gauss–Newton step; none when nothing is paired.
pub(super) fn step(
    jacobian: &Jacobian<'_>,
    rows: &[Row],
    pulls: &[Pull],
    costs: &[f64],
    values: &[f64],
) -> Option<Vec<f64>> {
    let free: Vec<usize> = (0..costs.len()).filter(|i| costs[*i].is_finite()).collect();
    let total: f64 = rows.iter().map(|row| row.weight).sum();
    if !(total > 0.0) {
        return None;
    }
    let sums: Vec<(DMatrix<f64>, DVector<f64>)> = rows
        .par_chunks(CHUNK)
        .map(|chunk| normal_equations(jacobian, chunk, &free, total))
        .collect();
    let mut matrix = DMatrix::zeros(free.len(), free.len());
    let mut slope = DVector::zeros(free.len());
    for (part, part_slope) in sums {
        matrix += part;
        slope += part_slope;
    }
    let (pull, pull_slope) = landmark_equations(jacobian, pulls, &free);
    matrix += pull;
    slope += pull_slope;
    for (i, at) in free.iter().enumerate() {
        matrix[(i, i)] += costs[*at] + DAMPING;
        slope[i] += costs[*at] * values[*at];
    }
    let solved = matrix.cholesky()?.solve(&-slope);
    let mut step = vec![0.0; costs.len()];
    for (at, value) in free.iter().zip(solved.iter()) {
        step[*at] = *value;
    }
    Some(step)
}

/// Keeps the matrix definite where a parameter moves nothing that is paired \[m²\].
const DAMPING: f64 = 1e-9;

/// Jᵀ W J and Jᵀ W r of some rows, the weights summing to 1 over all.
fn normal_equations(
    jacobian: &Jacobian<'_>,
    rows: &[Row],
    free: &[usize],
    total: f64,
) -> (DMatrix<f64>, DVector<f64>) {
    let mut matrix = DMatrix::zeros(rows.len(), free.len());
    let mut residuals = DVector::zeros(rows.len());
    let mut full = vec![0.0; jacobian.parameter_count()];
    for (i, row) in rows.iter().enumerate() {
        full.fill(0.0);
        for (v, share) in row.corners.iter().zip(row.shares) {
            if share > 0.0 {
                jacobian.add_row(*v as usize, row.aim.normal * share, &mut full);
            }
        }
        let root = (row.weight / total).sqrt();
        for (c, at) in free.iter().enumerate() {
            matrix[(i, c)] = root * full[*at];
        }
        residuals[i] = root * row.residual;
    }
    (matrix.tr_mul(&matrix), matrix.tr_mul(&residuals))
}

/// Jᵀ W J and Jᵀ W r of the landmarks, along the three axes.
fn landmark_equations(
    jacobian: &Jacobian<'_>,
    pulls: &[Pull],
    free: &[usize],
) -> (DMatrix<f64>, DVector<f64>) {
    let mut matrix = DMatrix::zeros(3 * pulls.len(), free.len());
    let mut residuals = DVector::zeros(3 * pulls.len());
    let mut full = vec![0.0; jacobian.parameter_count()];
    for (i, pull) in pulls.iter().enumerate() {
        let root = pull.weight.sqrt();
        for axis in 0..3 {
            full.fill(0.0);
            pull.add_row(jacobian, Vec3::ith(axis, 1.0), &mut full);
            for (c, at) in free.iter().enumerate() {
                matrix[(3 * i + axis, c)] = root * full[*at];
            }
            residuals[3 * i + axis] = root * pull.residual[axis];
        }
    }
    (matrix.tr_mul(&matrix), matrix.tr_mul(&residuals))
}

/// Goes a step, shortened where a joint would turn too far at once.
pub(super) fn take(state: &mut State, step: &[f64]) {
    let joints = state.pose.rotations.len();
    let (rotations, components) = step[BEFORE_ROTATIONS..].split_at(3 * joints);
    let turns = rotations.chunks_exact(3).map(Vec3::from_column_slice);
    let most = turns.clone().map(|t| t.norm()).fold(0.0, f64::max);
    let share = (MOST_TURN / most).min(1.0);
    state.pose.translation += Vec3::from_column_slice(&step[..3]) * share;
    state.shape.scale *= (step[3] * share).exp();
    for (rotation, turn) in state.pose.rotations.iter_mut().zip(turns) {
        *rotation += turn * share;
    }
    for (coefficient, change) in state.shape.components.iter_mut().zip(components) {
        *coefficient += change * share;
    }
}
