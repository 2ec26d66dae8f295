//! Where layers already go through each other: pushes that shorten the curve in which they do.
//!
//! An edge of direction E pierces a triangle of normal N at P. The triangles beside the edge leave P
//! along the curve in directions Rᵢ. When the edge moves by d, P moves by d − (d·N)/(E·N) E, and the
//! curve shortens fastest for d along G = Σ Rᵢ − (E·Rᵢ)/(E·N) N (intersection contour
//! minimisation, after Volino & Magnenat-Thalmann 2006).

use super::Layers;
use crate::geometry::box_tree::{BoxTree, around};
use crate::geometry::{Vec3, intersections};

/// An edge through a triangle, and where to move it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Piercing {
    /// The ends of the edge, then the corners of the triangle.
    pub(super) vertices: [u32; 5],
    /// Weights with which they make up the edge's P less the triangle's P.
    pub(super) weights: [f64; 5],
    /// G, at most 1 long \[–\].
    pub(super) push: Vec3,
}

/// |G| of a curve that turns by half a right angle: shorter ones push in proportion.
const FULL_PUSH: f64 = 0.5;

impl Layers {
    /// All piercings among the tangled pieces at `x`, in a fixed order.
    pub(super) fn piercings(&self, x: &[Vec3]) -> Vec<Piercing> {
        let tangled = |piece: &[u32]| piece.iter().any(|v| self.tangled[*v as usize]);
        let triangles: Vec<[u32; 3]> = (self.triangles.iter().copied())
            .filter(|t| tangled(t))
            .collect();
        let at = |v: u32| x[v as usize];
        let boxes: Vec<_> = (triangles.iter())
            .map(|t| around(&t.map(at), 0.0))
            .collect();
        let tree = BoxTree::new(&boxes);
        let mut found = Vec::new();
        for (e, edge) in self.edges.iter().enumerate().filter(|(_, e)| tangled(*e)) {
            tree.overlapping(&around(&edge.map(at), 0.0), |t| {
                let triangle = triangles[t as usize];
                let apart = edge.iter().all(|v| !triangle.contains(v));
                if apart && intersections::pierces(edge.map(at), triangle.map(at)) {
                    found.extend(self.piercing(x, e, triangle));
                }
            });
        }
        found
    }

    /// Edge `e` through `triangle`; none where they are so flat on each other that there is no
    /// telling.
    fn piercing(&self, x: &[Vec3], e: usize, triangle: [u32; 3]) -> Option<Piercing> {
        let [p, q] = self.edges[e].map(|v| x[v as usize]);
        let [a, b, c] = triangle.map(|v| x[v as usize]);
        let n = (b - a).cross(&(c - a));
        let (direction, square) = (q - p, n.norm_squared());
        let slope = direction.dot(&n);
        let s = (a - p).dot(&n) / slope;
        let at = p + direction * s;
        let u = (at - a).cross(&(c - a)).dot(&n) / square;
        let v = (b - a).cross(&(at - a)).dot(&n) / square;
        let unit = n.try_normalize(0.0)?;
        let mut g = Vec3::zeros();
        for opposite in self.beside[e].into_iter().flatten() {
            let inward = x[opposite as usize] - p;
            let r = unit.cross(&direction.cross(&inward)).try_normalize(0.0)?;
            // Into the triangle beside the edge.
            let across = inward - direction * (inward.dot(&direction) / direction.norm_squared());
            let r = if r.dot(&across) < 0.0 { -r } else { r };
            g += r - unit * (direction.dot(&r) / direction.dot(&unit));
        }
        let push = g / g.norm().hypot(FULL_PUSH);
        let ([e0, e1], [t0, t1, t2]) = (self.edges[e], triangle);
        let piercing = Piercing {
            vertices: [e0, e1, t0, t1, t2],
            weights: [1.0 - s, s, u + v - 1.0, -u, -v],
            push,
        };
        let finite = push.iter().chain(&piercing.weights).all(|w| w.is_finite());
        finite.then_some(piercing)
    }
}
