//! What a fabric is to the simulator, as a panel is cut from it.

use super::energy::membrane::Elasticity;
use crate::garment::Cut;
use crate::geometry::Vec2;

/// A fabric and how the panel lies on it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Membrane stiffness, along weft and warp.
    pub elasticity: Elasticity,
    /// Bending rigidity \[N·m\].
    pub bending: f64,
    /// Areal density \[kg/m²\].
    pub density: f64,
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
