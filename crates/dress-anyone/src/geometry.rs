//! Meshes and the questions asked of them; knows nothing of garments or bodies.

pub mod box_tree;
pub mod bvh;
pub mod closest_point;
pub mod graph;
pub mod groups;
pub mod intersections;
pub mod mesh;
pub mod polygon;
pub mod quality;
pub mod sparse;
pub mod watertight;

use nalgebra::SVector;
use num_complex::Complex64;
use std::borrow::Borrow;

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
pub use polygon::signed_area;

/// `a × b` in the plane: twice the signed area of the triangle (0, a, b) \[m²\].
pub fn cross2(a: Vec2, b: Vec2) -> f64 {
    a.x * b.y - a.y * b.x
}

/// The point `p` as a complex number: the plane is also the complex plane.
pub fn complex(p: Vec2) -> Complex64 {
    Complex64::new(p.x, p.y)
}

/// The complex number `z` as a point.
pub fn point(z: Complex64) -> Vec2 {
    Vec2::new(z.re, z.im)
}

/// Smallest and largest corner of the box around `points`; infinite and reversed when there are none.
pub fn bounds<const D: usize>(
    points: impl IntoIterator<Item = impl Borrow<SVector<f64, D>>>,
) -> (SVector<f64, D>, SVector<f64, D>) {
    let start = (
        SVector::repeat(f64::INFINITY),
        SVector::repeat(f64::NEG_INFINITY),
    );
    points.into_iter().fold(start, |(low, high), p| {
        (low.inf(p.borrow()), high.sup(p.borrow()))
    })
}
