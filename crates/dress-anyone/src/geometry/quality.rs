//! How good a triangle is: q = 4√3·A / (l₁² + l₂² + l₃²), and what follows from it.
//!
//! 1 is equilateral, 0 degenerate, negative inverted (clockwise); the right isosceles triangle has
//! √3/2. Scale-invariant; of Shewchuk's family A/l_rms² ("What is a good linear element?", 2002).
//! Its averages on ordinary pattern meshes are those that "Dress Anyone", Table 1, prints.

use super::{Vec2, cross2};
use serde::Serialize;

/// Quality q of the triangle `[a, b, c]` \[–\]; 0 when all corners coincide.
pub fn quality([a, b, c]: [Vec2; 3]) -> f64 {
    let squares = (b - a).norm_squared() + (c - b).norm_squared() + (a - c).norm_squared();
    if squares > 0.0 {
        2.0 * 3.0_f64.sqrt() * cross2(b - a, c - a) / squares
    } else {
        0.0
    }
}

/// Quality of every triangle \[–\], `[triangle]`.
pub fn qualities(points: &[Vec2], triangles: &[[u32; 3]]) -> Vec<f64> {
    let corners = |t: &[u32; 3]| t.map(|v| points[v as usize]);
    triangles.iter().map(|t| quality(corners(t))).collect()
}

/// How well the triangle conditions a stiffness matrix \[–\], from its [`quality`] q:
/// q_c = 4√3·A / (Σl² + √((Σl²)² − 48 A²)) = q / (1 + √(1 − q²)). Never better than q.
pub fn conditioning(q: f64) -> f64 {
    q / (1.0 + (1.0 - q * q).max(0.0).sqrt())
}

/// Qualities in three numbers.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QualitySummary {
    /// The worst.
    pub min: f64,
    /// The mean.
    pub mean: f64,
    /// One triangle in a hundred is no better than this.
    pub one_percent: f64,
}

impl QualitySummary {
    /// Of these qualities; none when there are none.
    pub fn of(qualities: &[f64]) -> Option<Self> {
        let mut sorted = qualities.to_vec();
        sorted.sort_by(f64::total_cmp);
        let rank = sorted.len().div_ceil(100);
        Some(Self {
            min: *sorted.first()?,
            mean: sorted.iter().sum::<f64>() / sorted.len() as f64,
            one_percent: sorted[rank - 1],
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    const RIGHT_ISOSCELES: [Vec2; 3] = [
        Vec2::new(0.0, 0.0),
        Vec2::new(1.0, 0.0),
        Vec2::new(0.0, 1.0),
    ];

    #[test]
    fn an_equilateral_triangle_of_any_size_has_quality_one() {
        let top = Vec2::new(0.5, 0.75_f64.sqrt());
        let corners = [Vec2::zeros(), Vec2::new(1.0, 0.0), top].map(|p| p * 1e-3);
        assert_relative_eq!(quality(corners), 1.0, epsilon = 1e-14);
        assert_relative_eq!(conditioning(quality(corners)), 1.0, epsilon = 1e-6);
    }

    #[test]
    fn half_a_square_has_the_known_qualities() {
        let q = quality(RIGHT_ISOSCELES);
        // 4√3·½ / (1 + 1 + 2), and q / (1 + √(1 − ¾)).
        assert_relative_eq!(q, 3.0_f64.sqrt() / 2.0, epsilon = 1e-14);
        assert_relative_eq!(conditioning(q), 1.0 / 3.0_f64.sqrt(), epsilon = 1e-14);
    }

    #[test]
    fn an_inverted_triangle_has_the_negative_quality() {
        let [a, b, c] = RIGHT_ISOSCELES;
        assert_eq!(quality([a, c, b]), -quality([a, b, c]));
        assert_eq!(quality([a, a, a]), 0.0);
    }

    #[test]
    fn a_summary_finds_the_worst_the_mean_and_the_hundredth() {
        let values: Vec<f64> = (1..=200).rev().map(f64::from).collect();
        let summary = QualitySummary::of(&values).unwrap();
        assert_eq!(summary.min, 1.0);
        assert_eq!(summary.mean, 100.5);
        // Two of two hundred are no better than 2.
        assert_eq!(summary.one_percent, 2.0);
        assert_eq!(QualitySummary::of(&[]), None);
    }
}
