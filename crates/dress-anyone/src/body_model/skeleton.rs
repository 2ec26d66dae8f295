//! What the joints of SMPL's order are: names, the parts of the body they move, and the poses a
//! tailor asks for. SMPL, STAR, SMPL+H and SMPL-X agree on the first 22.

use super::{BodyModel, Pose, Posed, Shape};
use crate::geometry::Vec3;
use serde::Serialize;

/// Joints a model must have: SMPL's, without the hands' own.
pub const LEAST_JOINTS: usize = 22;

pub(super) const PELVIS: usize = 0;
pub(super) const HIPS: [usize; 2] = [1, 2];
pub(super) const KNEES: [usize; 2] = [4, 5];
pub(super) const ANKLES: [usize; 2] = [7, 8];
pub(super) const NECK: usize = 12;
pub(super) const HEAD: usize = 15;
pub(super) const SHOULDERS: [usize; 2] = [16, 17];
pub(super) const ELBOWS: [usize; 2] = [18, 19];
pub(super) const WRISTS: [usize; 2] = [20, 21];

const NAMES: [&str; LEAST_JOINTS] = [
    "pelvis",
    "left_hip",
    "right_hip",
    "spine1",
    "left_knee",
    "right_knee",
    "spine2",
    "left_ankle",
    "right_ankle",
    "spine3",
    "left_foot",
    "right_foot",
    "neck",
    "left_collar",
    "right_collar",
    "head",
    "left_shoulder",
    "right_shoulder",
    "left_elbow",
    "right_elbow",
    "left_wrist",
    "right_wrist",
];

/// The usual name of joint `j`: "left_elbow"; joints beyond the 22nd belong to hands and face.
pub fn joint_name(j: usize) -> String {
    match NAMES.get(j) {
        Some(name) => (*name).to_owned(),
        None => format!("joint_{j}"),
    }
}

/// A part of the body, as a report names it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Part {
    /// Trunk, from the crotch to the base of the neck.
    Trunk,
    /// Neck.
    Neck,
    /// Head and face.
    Head,
    /// Left upper arm and forearm.
    LeftArm,
    /// Right upper arm and forearm.
    RightArm,
    /// Left hand.
    LeftHand,
    /// Right hand.
    RightHand,
    /// Left thigh and lower leg.
    LeftLeg,
    /// Right thigh and lower leg.
    RightLeg,
    /// Left foot.
    LeftFoot,
    /// Right foot.
    RightFoot,
}

impl Part {
    /// All of them.
    pub const ALL: [Self; 11] = [
        Self::Trunk,
        Self::Neck,
        Self::Head,
        Self::LeftArm,
        Self::RightArm,
        Self::LeftHand,
        Self::RightHand,
        Self::LeftLeg,
        Self::RightLeg,
        Self::LeftFoot,
        Self::RightFoot,
    ];

    /// Where garments are worn: all but hands, feet and head.
    pub fn is_clothed(self) -> bool {
        !matches!(
            self,
            Self::Head | Self::LeftHand | Self::RightHand | Self::LeftFoot | Self::RightFoot
        )
    }

    /// As a sentence has it: "the left arm".
    pub fn in_words(self) -> &'static str {
        match self {
            Self::Trunk => "the trunk",
            Self::Neck => "the neck",
            Self::Head => "the head",
            Self::LeftArm => "the left arm",
            Self::RightArm => "the right arm",
            Self::LeftHand => "the left hand",
            Self::RightHand => "the right hand",
            Self::LeftLeg => "the left leg",
            Self::RightLeg => "the right leg",
            Self::LeftFoot => "the left foot",
            Self::RightFoot => "the right foot",
        }
    }

    /// What joint `j` of a model moves.
    pub(super) fn of_joint(model: &BodyModel, j: usize) -> Self {
        match j {
            0 | 3 | 6 | 9 | 13 | 14 => Self::Trunk,
            1 | 4 => Self::LeftLeg,
            2 | 5 => Self::RightLeg,
            7 | 10 => Self::LeftFoot,
            8 | 11 => Self::RightFoot,
            12 => Self::Neck,
            15 => Self::Head,
            16 | 18 => Self::LeftArm,
            17 | 19 => Self::RightArm,
            20 => Self::LeftHand,
            21 => Self::RightHand,
            // Fingers, jaw and eyes go with what they hang on; joint 0 ends every climb.
            _ => model.parts.parents[j].map_or(Self::Trunk, |above| Self::of_joint(model, above)),
        }
    }
}

impl BodyModel {
    /// The part of the body each vertex belongs to, `[vertex]`.
    pub fn parts_of_vertices(&self) -> Vec<Part> {
        let owners = self.owners().into_iter();
        owners.map(|j| Part::of_joint(self, j)).collect()
    }

    /// The pose in which the mean body's upper arms are `below` \[rad\] the horizontal, elbows as
    /// the model has them; all else at the model's zero. π/4 is the canonical A-pose, 0 a T-pose.
    pub fn arms_at(&self, below: f64) -> Pose {
        let mut pose = Pose::zero(self);
        let joints = self.joints(&self.mean_shape());
        for side in 0..2 {
            let arm = joints[ELBOWS[side]] - joints[SHOULDERS[side]];
            let now = (-arm.y).atan2(arm.x.abs());
            let turn = (now - below) * arm.x.signum();
            if turn.abs() > AS_IT_IS {
                pose.rotations[SHOULDERS[side]] = Vec3::new(0.0, 0.0, turn);
            }
        }
        pose
    }

    /// The canonical A-pose, soles on the floor, pelvis above the origin, for a shape with offsets.
    pub fn a_pose(&self, shape: &Shape, offsets: &[Vec3]) -> Posed {
        let mut pose = self.arms_at(std::f64::consts::FRAC_PI_4);
        let posed = self.posed(shape, &pose, offsets);
        let (low, _) = crate::geometry::bounds(&posed.positions);
        let pelvis = posed.heads()[PELVIS];
        pose.translation = Vec3::new(-pelvis.x, -low.y, -pelvis.z);
        self.posed(shape, &pose, offsets)
    }
}

/// Arms this close \[rad\] to where they should be are left alone.
const AS_IT_IS: f64 = 5e-3;
