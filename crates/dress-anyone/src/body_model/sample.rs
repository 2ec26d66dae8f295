//! Bodies drawn at random: shape components from the standard normal distribution they were scaled
//! to, drawn again where the result stands in its own way.

use super::skeleton::HIPS;
use super::{BodyModel, Part, Shape};
use crate::geometry::Vec3;

/// Numbers that look random and are the same on every machine (SplitMix64; Steele et al. 2014).
#[derive(Clone, Debug)]
pub struct Random(u64);

impl Random {
    /// A sequence of its own for every seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// Uniform in [0, 1).
    pub fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// Of the standard normal distribution (Box, Muller 1958).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (std::f64::consts::TAU * self.uniform()).cos()
    }
}

/// Components are cut off here: beyond it the linear model makes no bodies any more.
const MOST: f64 = 2.5;
/// Draws before the mean body is given instead.
const DRAWS: usize = 100;
/// How far a leg may reach over to the other side \[m\]; thighs that press together touch here.
const OVERLAP: f64 = 4e-3;

impl BodyModel {
    /// A random body.
    pub fn sample(&self, random: &mut Random) -> Shape {
        for _ in 0..DRAWS {
            let mut shape = self.mean_shape();
            for coefficient in &mut shape.components[..self.parts.shape_count] {
                *coefficient = random.normal().clamp(-MOST, MOST);
            }
            if self.legs_are_apart(&shape) {
                return shape;
            }
        }
        self.mean_shape()
    }

    /// Whether neither leg reaches into the other's half.
    fn legs_are_apart(&self, shape: &Shape) -> bool {
        let joints = self.joints(shape);
        let middle = 0.5 * (joints[HIPS[0]].x + joints[HIPS[1]].x);
        let left = (joints[HIPS[0]].x - joints[HIPS[1]].x).signum();
        let parts = self.parts_of_vertices();
        let over = |(p, part): (&Vec3, &Part)| match part {
            Part::LeftLeg => (middle - p.x) * left > OVERLAP,
            Part::RightLeg => (p.x - middle) * left > OVERLAP,
            _ => false,
        };
        !self.shaped(shape).iter().zip(&parts).any(over)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn normal_numbers_have_mean_zero_and_variance_one() {
        let mut random = Random::new(7);
        let drawn: Vec<f64> = (0..100_000).map(|_| random.normal()).collect();
        let mean = drawn.iter().sum::<f64>() / 1e5;
        let variance = drawn.iter().map(|x| x * x).sum::<f64>() / 1e5;
        // Standard errors 0.003 and 0.0045.
        assert!(
            mean.abs() < 0.015 && (variance - 1.0).abs() < 0.02,
            "{mean} {variance}"
        );
    }

    #[test]
    fn a_seed_gives_the_same_bodies_and_another_seed_others() {
        let model = crate::io::body_model::built_in();
        let draw = |seed| model.sample(&mut Random::new(seed));
        assert_eq!(draw(7), draw(7));
        assert_ne!(draw(7), draw(8));
        assert!(draw(7).components.iter().all(|c| c.abs() <= MOST));
        assert!(
            draw(7).components[model.parts().shape_count..]
                .iter()
                .all(|c| *c == 0.0)
        );
    }
}
