//! A statistical body: a template that takes on shapes and poses (paper §4.1; METHOD §8.1).
//!
//! In SMPL's layout (Loper et al. 2015): V_s = T̄ + Sβ, joints J = 𝒥 V_s, and posing by linear blend
//! skinning ([`pose`]). Beside shape components a model may have bone stretches, directions that
//! lengthen or thicken limbs beyond human proportions; both are components of one [`Shape`].
//! [`mod@fit`] fits a model to any mesh, [`alike`] makes two bodies correspond, [`mod@measure`] takes a
//! tailor's measurements.

pub mod alike;
pub mod fit;
pub mod measure;
pub mod pose;
mod rotation;
pub mod sample;
mod skeleton;

use crate::geometry::{TriangleMesh, Vec3};
pub use pose::{Pose, Posed};
use serde::{Deserialize, Serialize};
pub use skeleton::{LEAST_JOINTS, Part, joint_name};

/// A statistical body model.
#[derive(Clone, Debug, PartialEq)]
pub struct BodyModel {
    parts: Parts,
    /// Joints of the template \[m\], `[joint]`.
    joints: Vec<Vec3>,
    /// How components move joints \[m\], `[joint][component]`.
    joint_directions: Vec<Vec3>,
}

/// What a model is made of. Whoever fills it sees to it that all counts agree and indices exist.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// For messages.
    pub name: String,
    /// The mean body \[m\], y up, facing +z.
    pub template: TriangleMesh,
    /// What one unit of each component adds \[m\], `[vertex][component]`: shape, then stretches.
    pub directions: Vec<Vec3>,
    /// How many components are shapes, of unit variance.
    pub shape_count: usize,
    /// Names of the other components: coefficient c makes a bone 1 + c times as long or thick.
    pub stretches: Vec<String>,
    /// What each entry of R − I of joints 1, 2, … (row by row) adds \[m\], `[vertex][9 (joints − 1)]`;
    /// empty for none.
    pub pose_directions: Vec<Vec3>,
    /// Joints as weighted vertices, `[joint]`; weights sum to 1.
    pub regressor: Vec<Vec<(u32, f64)>>,
    /// Joints that carry each vertex, `[vertex]`; weights sum to 1.
    pub weights: Vec<Vec<(u32, f64)>>,
    /// The joint above each joint; always one of lower index, none for joint 0 only.
    pub parents: Vec<Option<usize>>,
}

/// What a body looks like, whatever its pose.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Shape {
    /// Size of the whole, times the model's own \[–\].
    pub scale: f64,
    /// Coefficients of the model's components.
    pub components: Vec<f64>,
}

impl BodyModel {
    /// A model of these parts.
    pub fn new(parts: Parts) -> Self {
        let components = parts.component_count();
        let mut joint_directions = Vec::new();
        let mut joints = Vec::new();
        for row in &parts.regressor {
            let position = |(v, w): &(u32, f64)| parts.template.positions[*v as usize] * *w;
            joints.push(row.iter().map(position).sum());
            for k in 0..components {
                let direction =
                    |(v, w): &(u32, f64)| parts.directions[*v as usize * components + k] * *w;
                joint_directions.push(row.iter().map(direction).sum());
            }
        }
        Self {
            parts,
            joints,
            joint_directions,
        }
    }

    /// What the model is made of.
    pub fn parts(&self) -> &Parts {
        &self.parts
    }

    /// The mean shape.
    pub fn mean_shape(&self) -> Shape {
        Shape {
            scale: 1.0,
            components: vec![0.0; self.parts.component_count()],
        }
    }

    /// The template with `shape`'s components added, unscaled and in the model's zero pose \[m\].
    pub fn shaped(&self, shape: &Shape) -> Vec<Vec3> {
        combine(
            &self.parts.template.positions,
            &self.parts.directions,
            &shape.components,
        )
    }

    /// The joints of `shape`, unscaled and in the model's zero pose \[m\].
    pub fn joints(&self, shape: &Shape) -> Vec<Vec3> {
        combine(&self.joints, &self.joint_directions, &shape.components)
    }

    /// The joint that carries most of each vertex, `[vertex]`.
    pub fn owners(&self) -> Vec<usize> {
        let heaviest = |weights: &Vec<(u32, f64)>| {
            let first = (0, 0.0);
            let most = |a: (u32, f64), b: &(u32, f64)| if b.1 > a.1 { *b } else { a };
            weights.iter().fold(first, most).0 as usize
        };
        self.parts.weights.iter().map(heaviest).collect()
    }
}

impl Parts {
    /// Shape components and stretches.
    pub fn component_count(&self) -> usize {
        self.shape_count + self.stretches.len()
    }

    /// Joints.
    pub fn joint_count(&self) -> usize {
        self.parents.len()
    }
}

/// mean + Σ coefficient · direction, for every point.
fn combine(mean: &[Vec3], directions: &[Vec3], coefficients: &[f64]) -> Vec<Vec3> {
    if coefficients.is_empty() {
        return mean.to_vec();
    }
    mean.iter()
        .zip(directions.chunks_exact(coefficients.len()))
        .map(|(p, row)| {
            let moved = row.iter().zip(coefficients).map(|(d, c)| d * *c);
            p + moved.sum::<Vec3>()
        })
        .collect()
}
