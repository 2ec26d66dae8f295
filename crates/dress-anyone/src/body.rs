//! A body to dress: a triangle mesh in metres, y up, and how its file saw it.

pub mod distance_field;
mod part;

use crate::geometry::{TriangleMesh, Vec3};
pub use distance_field::DistanceField;
pub use part::parted;
use serde::{Deserialize, Serialize};

/// A body in SI units, y up.
#[derive(Clone, Debug, PartialEq)]
pub struct Body {
    /// For messages and pictures: the file's stem.
    pub name: String,
    /// The surface \[m\], y up, outward counter-clockwise.
    pub mesh: TriangleMesh,
    /// How to write points back the way the body's file has them.
    pub frame: FileFrame,
    /// What was noticed and tolerated: holes, components, non-manifold edges, guesses.
    pub notes: Vec<String>,
}

/// The axis that points up in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum UpAxis {
    /// x up; the file's (x, y, z) is (−y, x, z) of a y-up world.
    X,
    /// y up, the library's own.
    Y,
    /// z up; the file's (x, y, z) is (x, −z, y) of a y-up world.
    Z,
}

impl UpAxis {
    /// "x", "y" or "z".
    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::Y => "y",
            Self::Z => "z",
        }
    }
}

/// Unit and axes of a file. The library works in metres, y up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct FileFrame {
    /// Metres in one unit of the file.
    pub metres_per_unit: f64,
    /// The file's up axis.
    pub up: UpAxis,
}

impl FileFrame {
    /// Metres, y up.
    pub const SI: Self = Self {
        metres_per_unit: 1.0,
        up: UpAxis::Y,
    };

    /// From the file's coordinates to metres, y up.
    pub fn to_si(self, p: Vec3) -> Vec3 {
        let p = p * self.metres_per_unit;
        match self.up {
            UpAxis::X => Vec3::new(-p.y, p.x, p.z),
            UpAxis::Y => p,
            UpAxis::Z => Vec3::new(p.x, p.z, -p.y),
        }
    }

    /// From metres, y up, to the file's coordinates; inverse of [`Self::to_si`].
    pub fn from_si(self, p: Vec3) -> Vec3 {
        let p = match self.up {
            UpAxis::X => Vec3::new(p.y, -p.x, p.z),
            UpAxis::Y => p,
            UpAxis::Z => Vec3::new(p.x, -p.z, p.y),
        };
        p / self.metres_per_unit
    }

    /// The unit's usual name: "m", "cm", "mm", "dm", "in", or the number of metres.
    pub fn unit_name(self) -> String {
        let known = [
            (1.0, "m"),
            (0.1, "dm"),
            (0.01, "cm"),
            (0.001, "mm"),
            (0.0254, "in"),
        ];
        known
            .iter()
            .find(|(metres, _)| (metres / self.metres_per_unit - 1.0).abs() < 1e-9)
            .map_or_else(
                || format!("{} m", self.metres_per_unit),
                |(_, name)| (*name).to_owned(),
            )
    }
}

impl Body {
    /// Whether vertex i of one body corresponds to vertex i of the other.
    pub fn shares_topology(&self, other: &Self) -> bool {
        self.mesh.positions.len() == other.mesh.positions.len()
            && self.mesh.triangles == other.mesh.triangles
    }
}
