//! Meshes and the questions asked of them; knows nothing of garments or bodies.

pub mod bvh;
pub mod closest_point;
pub mod mesh;
pub mod plane;
pub mod polygon;
pub mod quality;
pub mod watertight;

/// A point or vector of the plane \[m\].
pub type Vec2 = nalgebra::Vector2<f64>;
/// A point or vector of space \[m\].
pub type Vec3 = nalgebra::Vector3<f64>;
/// 2×2 matrix.
pub type Mat2 = nalgebra::Matrix2<f64>;
/// 3×3 matrix.
pub type Mat3 = nalgebra::Matrix3<f64>;

pub use closest_point::{ClosestPoint, Foot};
pub use mesh::TriangleMesh;

/// `a × b` in the plane: twice the signed area of the triangle (0, a, b) \[m²\].
pub fn cross2(a: Vec2, b: Vec2) -> f64 {
    a.x * b.y - a.y * b.x
}

/// Signed area of a closed polygon \[m²\]; positive counter-clockwise.
pub fn signed_area(polygon: &[Vec2]) -> f64 {
    let next = polygon.iter().cycle().skip(1);
    0.5 * polygon
        .iter()
        .zip(next)
        .map(|(a, b)| cross2(*a, *b))
        .sum::<f64>()
}
