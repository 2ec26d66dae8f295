//! Area of each panel in the drape against the target shape (paper §4.4, total area):
//! Σ_p ((A*_p − Σ_t A_t)/A*_p)².

use super::Row;
use crate::geometry::Vec3;
use crate::pattern::PatternMesh;
use std::collections::BTreeMap;
use std::ops::Range;

/// Target areas of all panels.
#[derive(Clone, Debug)]
pub struct TotalArea {
    triangles: Vec<[u32; 3]>,
    panels: Vec<(Range<usize>, f64)>,
}

impl TotalArea {
    /// Areas of the panels in the target shape.
    pub fn new(mesh: &PatternMesh, x_star: &[Vec3]) -> Self {
        let triangles = mesh.cloth_triangles();
        let area = |range: &Range<usize>| {
            let doubled = |t: &[u32; 3]| normal(*t, x_star).norm();
            0.5 * triangles[range.clone()].iter().map(doubled).sum::<f64>()
        };
        let panels = mesh.panel_triangles.iter().map(|r| (r.clone(), area(r)));
        let panels = panels.filter(|(_, area)| *area > 0.0).collect();
        Self { triangles, panels }
    }

    /// One residual a panel.
    pub fn rows(&self, x: &[Vec3]) -> Vec<Row> {
        let row = |(range, target): &(Range<usize>, f64)| {
            let mut sum = 0.0;
            let mut gradient: BTreeMap<u32, Vec3> = BTreeMap::new();
            for t in &self.triangles[range.clone()] {
                let doubled = normal(*t, x);
                sum += 0.5 * doubled.norm();
                let Some(n) = doubled.try_normalize(0.0) else {
                    continue;
                };
                for k in 0..3 {
                    let [from, to] = [1, 2].map(|i| x[t[(k + i) % 3] as usize]);
                    let change = n.cross(&(to - from)) * (-0.5 / target);
                    *gradient.entry(t[k]).or_insert_with(Vec3::zeros) += change;
                }
            }
            Row {
                value: 1.0 - sum / target,
                x: gradient.into_iter().collect(),
                x_bar: Vec::new(),
            }
        };
        self.panels.iter().map(row).collect()
    }
}

/// Twice the area vector of a triangle \[m²\].
fn normal(t: [u32; 3], x: &[Vec3]) -> Vec3 {
    let [a, b, c] = t.map(|v| x[v as usize]);
    (b - a).cross(&(c - a))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::loss::fixtures;

    #[test]
    fn rows_are_derivatives() {
        let (_, mesh) = fixtures::two_panels();
        let n = mesh.cloth_vertex_count;
        let term = TotalArea::new(&mesh, &fixtures::positions(n, 1));
        let motion = vec![crate::geometry::Vec2::zeros(); mesh.x_bar.len()];
        fixtures::check_rows(
            |x, _| term.rows(x),
            (&fixtures::positions(n, 9), &fixtures::positions(n, 70)),
            (&mesh.x_bar, &motion),
        );
    }

    #[test]
    fn a_drape_one_percent_larger_is_off_by_its_square() {
        let (_, mesh) = fixtures::two_panels();
        let x_star = fixtures::positions(mesh.cloth_vertex_count, 1);
        let larger: Vec<Vec3> = x_star.iter().map(|p| p * 1.01).collect();
        for row in TotalArea::new(&mesh, &x_star).rows(&larger) {
            assert!((row.value - (1.0 - 1.01 * 1.01)).abs() < 1e-12);
        }
    }
}
