//! Posing by linear blend skinning, and its derivative (METHOD §8.1).
//!
//! r_v = V_s + P vec(R_k − I) + o_v with offsets o; bones G_k = G_parent (R_k, J_k − J_parent);
//! x_v = s Σ_k w_vk (G_k^R (r_v − J_k) + G_k^t) + t. Parameters come in the order
//! translation (3), ln s (1), rotations (3 per joint, axis times angle), components.

use super::rotation::{left_jacobian, rotation};
use super::{BodyModel, Shape};
use crate::geometry::{Mat3, Vec3};
use serde::{Deserialize, Serialize};

/// How a body stands.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Pose {
    /// Axis times angle \[rad\] of each joint against the one above; that of joint 0 turns the body.
    pub rotations: Vec<Vec3>,
    /// Where it stands \[m\].
    pub translation: Vec3,
}

impl Pose {
    /// The pose the model's template has.
    pub fn zero(model: &BodyModel) -> Self {
        Self {
            rotations: vec![Vec3::zeros(); model.parts.joint_count()],
            translation: Vec3::zeros(),
        }
    }
}

/// A body in a pose.
#[derive(Clone, Debug)]
pub struct Posed {
    /// Vertices \[m\].
    pub positions: Vec<Vec3>,
    /// Vertices before the bones moved them, unscaled \[m\].
    rest: Vec<Vec3>,
    /// Bone j takes the point r to `turns[j] r + shifts[j]`.
    turns: Vec<Mat3>,
    shifts: Vec<Vec3>,
    /// Joints in the pose, unscaled and untranslated \[m\].
    heads: Vec<Vec3>,
    scale: f64,
    translation: Vec3,
}

impl BodyModel {
    /// The body of `shape` in `pose`; `offsets` \[m, unscaled\] are added to its vertices at rest
    /// (empty for none).
    pub fn posed(&self, shape: &Shape, pose: &Pose, offsets: &[Vec3]) -> Posed {
        let parts = &self.parts;
        let joints = self.joints(shape);
        let local: Vec<Mat3> = pose.rotations.iter().map(|r| rotation(*r)).collect();
        let mut rest = self.shaped(shape);
        for (r, o) in rest.iter_mut().zip(offsets) {
            *r += o;
        }
        if !parts.pose_directions.is_empty() {
            let feature = pose_feature(&local);
            let rows = parts.pose_directions.chunks_exact(feature.len());
            for (r, row) in rest.iter_mut().zip(rows) {
                *r += row.iter().zip(&feature).map(|(d, f)| d * *f).sum::<Vec3>();
            }
        }
        let (mut turns, mut shifts, mut heads) = (Vec::new(), Vec::new(), Vec::new());
        for (j, joint) in joints.iter().enumerate() {
            let (turn, head) = match parts.parents[j] {
                None => (local[j], *joint),
                Some(above) => (
                    turns[above] * local[j],
                    turns[above] * joint + shifts[above],
                ),
            };
            turns.push(turn);
            heads.push(head);
            shifts.push(head - turn * joint);
        }
        let place = |(r, weights): (&Vec3, &Vec<(u32, f64)>)| {
            let by_bone = |(j, w): &(u32, f64)| (turns[*j as usize] * r + shifts[*j as usize]) * *w;
            weights.iter().map(by_bone).sum::<Vec3>() * shape.scale + pose.translation
        };
        let positions = rest.iter().zip(&parts.weights).map(place).collect();
        Posed {
            positions,
            rest,
            turns,
            shifts,
            heads,
            scale: shape.scale,
            translation: pose.translation,
        }
    }
}

/// Rows of R − I of joints 1, 2, ….
fn pose_feature(local: &[Mat3]) -> Vec<f64> {
    let entries = |r: &Mat3| (r - Mat3::identity()).transpose();
    local[1..]
        .iter()
        .flat_map(|r| entries(r).as_slice().to_vec())
        .collect()
}

impl Posed {
    /// Joints \[m\], `[joint]`.
    pub fn heads(&self) -> Vec<Vec3> {
        (0..self.heads.len()).map(|j| self.head(j)).collect()
    }

    /// Joint `j` \[m\].
    pub fn head(&self, j: usize) -> Vec3 {
        self.heads[j] * self.scale + self.translation
    }

    /// What has to be added to vertex `v` at rest to move it by `offset` \[m\] in this pose; none
    /// where the bones around it leave no way back.
    pub fn to_rest(&self, model: &BodyModel, v: usize, offset: Vec3) -> Option<Vec3> {
        let inverse = self.blended_turn(model, v).try_inverse()?;
        Some(inverse * offset / self.scale)
    }

    /// Σ_j w_vj G_j^R.
    fn blended_turn(&self, model: &BodyModel, v: usize) -> Mat3 {
        let by_bone = |(j, w): &(u32, f64)| self.turns[*j as usize] * *w;
        model.parts.weights[v].iter().map(by_bone).sum()
    }
}

/// ∂x/∂parameters at one posed body.
pub struct Jacobian<'a> {
    model: &'a BodyModel,
    posed: &'a Posed,
    /// Angular velocity of each joint's subtree by its three parameters.
    axes: Vec<Mat3>,
    /// ∂shift/∂component, `[joint][component]`.
    shift_slopes: Vec<Vec3>,
    /// Rows of ∂R_k/∂θ_k, `[joint − 1][parameter]`; only where pose moves vertices at rest.
    feature_slopes: Vec<[Mat3; 3]>,
}

/// A point that the bones carry.
struct Carried<'a> {
    position: Vec3,
    rest: Vec3,
    weights: &'a [(u32, f64)],
    /// What one unit of each component adds to it at rest.
    directions: &'a [Vec3],
}

/// Parameters before the rotations: translation and ln s.
pub const BEFORE_ROTATIONS: usize = 4;

impl<'a> Jacobian<'a> {
    /// At `posed`, which is `model` in `pose`.
    pub fn new(model: &'a BodyModel, posed: &'a Posed, pose: &Pose) -> Self {
        let parts = &model.parts;
        let components = parts.component_count();
        let turn_above =
            |j: usize| parts.parents[j].map_or_else(Mat3::identity, |above| posed.turns[above]);
        let mut axes = Vec::new();
        let mut shift_slopes: Vec<Vec3> = Vec::new();
        for j in 0..parts.joint_count() {
            axes.push(turn_above(j) * left_jacobian(pose.rotations[j]));
            let relative = turn_above(j) - posed.turns[j];
            for k in 0..components {
                let above = parts.parents[j].map(|above| shift_slopes[above * components + k]);
                let own = relative * model.joint_directions[j * components + k];
                shift_slopes.push(own + above.unwrap_or_else(Vec3::zeros));
            }
        }
        let slopes = |theta: &Vec3| {
            let (turn, jacobian) = (rotation(*theta), left_jacobian(*theta));
            [0, 1, 2].map(|c| (jacobian.column(c).into_owned().cross_matrix() * turn).transpose())
        };
        let feature_slopes = if parts.pose_directions.is_empty() {
            Vec::new()
        } else {
            pose.rotations[1..].iter().map(slopes).collect()
        };
        Self {
            model,
            posed,
            axes,
            shift_slopes,
            feature_slopes,
        }
    }

    /// Number of parameters.
    pub fn parameter_count(&self) -> usize {
        let parts = &self.model.parts;
        BEFORE_ROTATIONS + 3 * parts.joint_count() + parts.component_count()
    }

    /// Adds n · ∂x_v/∂parameters to `row`.
    pub fn add_row(&self, v: usize, n: Vec3, row: &mut [f64]) {
        let (parts, posed) = (&self.model.parts, self.posed);
        let components = parts.component_count();
        let vertex = Carried {
            position: posed.positions[v],
            rest: posed.rest[v],
            weights: &parts.weights[v],
            directions: &parts.directions[v * components..(v + 1) * components],
        };
        let turned = self.add_carried(&vertex, n, row);
        self.add_pose_directions(v, turned, row);
    }

    /// Adds n · ∂(joint j)/∂parameters to `row`.
    pub fn add_joint_row(&self, j: usize, n: Vec3, row: &mut [f64]) {
        let (model, posed) = (self.model, self.posed);
        let components = model.parts.component_count();
        let joint = Carried {
            position: posed.head(j),
            rest: posed.turns[j].tr_mul(&(posed.heads[j] - posed.shifts[j])),
            weights: &[(j as u32, 1.0)],
            directions: &model.joint_directions[j * components..(j + 1) * components],
        };
        self.add_carried(&joint, n, row);
    }

    /// Adds n · ∂x/∂parameters to `row`, but for the pose directions; (Σ w G^R)ᵀ n s.
    fn add_carried(&self, point: &Carried<'_>, n: Vec3, row: &mut [f64]) -> Vec3 {
        let (parts, posed) = (&self.model.parts, self.posed);
        let joint_count = parts.joint_count();
        let n_scaled = n * posed.scale;
        for c in 0..3 {
            row[c] += n[c];
        }
        row[3] += n.dot(&(point.position - posed.translation));

        // What hangs on each joint: weight, and weighted posed points.
        let mut moments = vec![(0.0, Vec3::zeros()); joint_count];
        let mut turned = Vec3::zeros();
        for &(j, w) in point.weights {
            let j = j as usize;
            moments[j].0 += w;
            moments[j].1 += (posed.turns[j] * point.rest + posed.shifts[j]) * w;
            turned += posed.turns[j].tr_mul(&n_scaled) * w;
        }
        for j in (0..joint_count).rev() {
            let (weight, sum) = moments[j];
            if weight == 0.0 {
                continue;
            }
            if let Some(above) = parts.parents[j] {
                moments[above].0 += weight;
                moments[above].1 += sum;
            }
            let lever = sum - posed.heads[j] * weight;
            let slope = self.axes[j].tr_mul(&lever.cross(&n_scaled));
            let at = BEFORE_ROTATIONS + 3 * j;
            for c in 0..3 {
                row[at + c] += slope[c];
            }
        }
        let components = parts.component_count();
        let tail = &mut row[BEFORE_ROTATIONS + 3 * joint_count..];
        for (entry, direction) in tail.iter_mut().zip(point.directions) {
            *entry += turned.dot(direction);
        }
        for &(j, w) in point.weights {
            let at = j as usize * components;
            let slopes = &self.shift_slopes[at..at + components];
            for (entry, slope) in tail.iter_mut().zip(slopes) {
                *entry += w * n_scaled.dot(slope);
            }
        }
        turned
    }

    /// The share of the pose directions: `turned` is (Σ w G^R)ᵀ n s.
    fn add_pose_directions(&self, v: usize, turned: Vec3, row: &mut [f64]) {
        let width = 9 * self.feature_slopes.len();
        for (k, slopes) in self.feature_slopes.iter().enumerate() {
            let at = v * width + 9 * k;
            let directions = &self.model.parts.pose_directions[at..at + 9];
            for (c, slope) in slopes.iter().enumerate() {
                let pairs = directions.iter().zip(slope.as_slice());
                let moved: f64 = pairs.map(|(d, s)| turned.dot(d) * s).sum();
                row[BEFORE_ROTATIONS + 3 * (k + 1) + c] += moved;
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests;
