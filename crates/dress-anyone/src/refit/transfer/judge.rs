//! Measures of a target shape against the drape it comes from, both `[cloth vertex]` \[m\].

use super::{BINS, Spacing, Spread};
use crate::garment::Garment;
use crate::geometry::{ClosestPoint, Vec2, Vec3};
use crate::pattern::symmetry::Symmetry;
use crate::refit::measure::principal_stretches;
use crate::sim::energy::membrane::RestTriangle;
use std::collections::BTreeSet;

/// Source drape and target shape.
type Both<'a> = [&'a Vec<Vec3>; 2];

/// Distances to the bodies by panel.
pub(super) fn spacing(garment: &Garment, x: Both<'_>, bodies: &[ClosestPoint; 2]) -> Vec<Spacing> {
    let mesh = &garment.mesh;
    let panels = garment.pattern.panels.iter().zip(&mesh.panel_vertices);
    panels
        .map(|(panel, vertices)| {
            let [before, after] = [0, 1].map(|k| -> Vec<f64> {
                let at = |v: usize| x[k][mesh.sewing[v] as usize];
                let distances = vertices.clone().map(|v| bodies[k].signed_distance(at(v)));
                distances.collect()
            });
            Spacing {
                panel: panel.name.clone(),
                histogram_before: histogram(&before),
                histogram_after: histogram(&after),
                before: Spread::of(before),
                after: Spread::of(after),
            }
        })
        .collect()
}

/// How many of the distances fall into each bin.
fn histogram(distances: &[f64]) -> Vec<usize> {
    let mut counts = vec![0; BINS.len() + 1];
    for d in distances {
        counts[BINS.partition_point(|end| end <= d)] += 1;
    }
    counts
}

/// Principal stretches of the second shape over the first.
pub(super) fn stretch(triangles: &[[u32; 3]], [before, after]: Both<'_>) -> [Spread; 2] {
    let (mut least, mut most) = (Vec::new(), Vec::new());
    for t in triangles {
        let rest = RestTriangle::new(laid_flat(t.map(|v| before[v as usize])));
        if !(rest.area > 0.0) {
            continue;
        }
        let f = rest.gradient_of(t.map(|v| after[v as usize]));
        let [low, high] = principal_stretches(&f);
        least.push(low);
        most.push(high);
    }
    [Spread::of(least), Spread::of(most)]
}

/// A triangle in its own plane.
fn laid_flat([a, b, c]: [Vec3; 3]) -> [Vec2; 3] {
    let along = (b - a).try_normalize(0.0).unwrap_or_else(Vec3::x);
    let side = c - a;
    let x = along.dot(&side);
    let y = (side - along * x).norm();
    [
        Vec2::zeros(),
        Vec2::new((b - a).norm(), 0.0),
        Vec2::new(x, y),
    ]
}

/// Turn per length of the pattern's rims, or else of its seams \[1/m\].
pub(super) fn curvature(garment: &Garment, x: &[Vec3], rims: bool) -> f64 {
    let mesh = &garment.mesh;
    let sewn: BTreeSet<_> = (garment.pattern.stitches.iter())
        .flat_map(|stitch| stitch.sides)
        .collect();
    let (mut turn, mut length) = (0.0, 0.0);
    for (panel, edges) in mesh.edge_vertices.iter().enumerate() {
        for (edge, vertices) in edges.iter().enumerate() {
            if sewn.contains(&crate::pattern::EdgeId { panel, edge }) == rims {
                continue;
            }
            let at = |v: &u32| x[mesh.sewing[*v as usize] as usize];
            let points: Vec<Vec3> = vertices.iter().map(at).collect();
            for p in points.windows(3) {
                turn += (p[1] - p[0]).angle(&(p[2] - p[1]));
                length += 0.5 * (p[2] - p[1]).norm() + 0.5 * (p[1] - p[0]).norm();
            }
        }
    }
    if length > 0.0 { turn / length } else { 0.0 }
}

/// Largest relative change of these edges' lengths.
pub(super) fn kept(edges: &[[u32; 2]], x: Both<'_>) -> f64 {
    let change = |ends: &[u32; 2]| {
        let [before, after] = x.map(|x| (x[ends[0] as usize] - x[ends[1] as usize]).norm());
        (after / before - 1.0).abs()
    };
    edges.iter().map(change).fold(0.0, f64::max)
}

/// Farthest a vertex is from the mirror image of its partner \[m\].
pub(super) fn asymmetry(garment: &Garment, source_drape: &[Vec3], x: &[Vec3]) -> f64 {
    let mesh = &garment.mesh;
    let symmetry = Symmetry::detect(&garment.pattern, mesh, Some(source_drape));
    let mut worst = 0.0_f64;
    for mirror in &symmetry.mirrors {
        let Some(partners) = mirror.vertices(mesh) else {
            continue;
        };
        let first = mesh.panel_vertices[mirror.panels[0]].clone();
        for (v, w) in first.zip(partners) {
            let [p, q] = [v, w as usize].map(|v| x[mesh.sewing[v] as usize]);
            let image = Vec3::new(2.0 * symmetry.plane - p.x, p.y, p.z);
            worst = worst.max((image - q).norm());
        }
    }
    worst
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::fixtures::two_panels;

    #[test]
    fn distances_fall_into_their_bins() {
        let counts = histogram(&[-0.1, 0.0, 2e-3, 3e-3, 0.06, 0.2]);
        assert_eq!(counts, [1, 2, 1, 0, 0, 0, 0, 1, 1]);
    }

    #[test]
    fn a_stretched_cloth_has_the_stretches_it_was_given() {
        let (_, mesh) = two_panels();
        let flat = mesh.x_bar.iter().map(|p| Vec3::new(p.x, p.y, 0.0));
        let before: Vec<Vec3> = flat.collect();
        let after = before.iter().map(|p| Vec3::new(0.0, 2.0 * p.x, 0.5 * p.y));
        let [low, high] = stretch(&mesh.triangles, [&before, &after.collect()]);
        for (found, expected) in [(low.least, 0.5), (low.most, 0.5), (high.least, 2.0)] {
            assert!((found - expected).abs() < 1e-9);
        }
    }
}
