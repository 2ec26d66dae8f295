//! What a fabric is to the simulator, as a panel is cut from it.

use super::energy::membrane::Elasticity;
use crate::garment::Cut;
use crate::geometry::Vec2;
use serde::{Deserialize, Serialize};
use std::fmt;

/// A fabric and how the panel lies on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Membrane stiffness, along weft and warp.
    pub elasticity: Elasticity,
    /// Bending rigidity \[N·m\].
    pub bending: f64,
    /// Areal density \[kg/m²\].
    pub density: f64,
    /// Thickness \[m\].
    pub thickness: f64,
    /// Coulomb's coefficient on the body \[–\].
    pub friction: f64,
    /// Direction of the weft in the panel's plane, of length one.
    weft: Vec2,
}

impl From<&Cut> for Material {
    fn from(cut: &Cut) -> Self {
        // The sine and cosine of 90° are not quite 0 and 1; those of 0° are.
        let (sin, cos) = cut.grain.to_radians().sin_cos();
        Self {
            elasticity: Elasticity::from(&cut.fabric),
            bending: cut.fabric.bending,
            density: cut.fabric.density,
            thickness: cut.fabric.thickness,
            friction: cut.fabric.friction,
            weft: Vec2::new(cos, sin),
        }
    }
}

impl Material {
    /// Points or motions of the panel's plane, as components along weft and warp.
    pub fn on_grain<const N: usize>(&self, p: [Vec2; N]) -> [Vec2; N] {
        let (cos, sin) = (self.weft.x, self.weft.y);
        p.map(|p| Vec2::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x))
    }

    /// The inverse of [`Self::on_grain`], and its transpose: gradients come back this way.
    pub fn off_grain<const N: usize>(&self, p: [Vec2; N]) -> [Vec2; N] {
        let (cos, sin) = (self.weft.x, self.weft.y);
        p.map(|p| Vec2::new(cos * p.x - sin * p.y, cos * p.y + sin * p.x))
    }
}

/// A number for all cloth, or what each fabric has of its own.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "Told", into = "Told")]
pub enum OrFabric {
    /// For all cloth.
    Number(f64),
    /// Each fabric's own; "fabric" in files.
    Fabric,
}

/// [`OrFabric`] in a file.
#[derive(Serialize, Deserialize)]
#[serde(untagged, expecting = "must be a number, or \"fabric\"")]
enum Told {
    Number(f64),
    Word(String),
}

impl OrFabric {
    /// The number, or else the `fabric`'s.
    pub fn or(self, fabric: f64) -> f64 {
        match self {
            Self::Number(number) => number,
            Self::Fabric => fabric,
        }
    }
}

impl fmt::Display for OrFabric {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Number(number) => write!(f, "a coefficient of {number}"),
            Self::Fabric => f.write_str("that of its fabrics"),
        }
    }
}

impl TryFrom<Told> for OrFabric {
    type Error = String;

    fn try_from(told: Told) -> Result<Self, String> {
        match told {
            Told::Number(number) => Ok(Self::Number(number)),
            Told::Word(word) if word == "fabric" => Ok(Self::Fabric),
            Told::Word(word) => Err(format!("`{word}` must be a number, or \"fabric\"")),
        }
    }
}

impl From<OrFabric> for Told {
    fn from(value: OrFabric) -> Self {
        match value {
            OrFabric::Number(number) => Self::Number(number),
            OrFabric::Fabric => Self::Word("fabric".to_owned()),
        }
    }
}
