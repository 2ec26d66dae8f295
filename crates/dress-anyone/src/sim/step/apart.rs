//! Layers of cloth in a time step: constraints Σ g·x ≥ gap, linear and one-sided, as contact is.

use super::lanes::Four;
use crate::geometry::Vec3;

/// Two layers that may touch, or that shall part, linearised once per step.
#[derive(Clone, Copy, Debug)]
pub(in crate::sim) struct Apart {
    /// A vertex and a triangle or two edges; or an edge and the triangle it goes through.
    pub(in crate::sim) vertices: [u32; 5],
    /// g; the last one is zero where there are but four vertices.
    pub(in crate::sim) gradient: [Vec3; 5],
    /// \[m\].
    pub(in crate::sim) gap: f64,
    /// α̃ \[1/kg\].
    pub(in crate::sim) alpha_tilde: f64,
}

/// All of a step, at places instead of cloth vertices.
#[derive(Default)]
pub(super) struct Aparts {
    each: Vec<Apart>,
    lambda: Vec<f64>,
}

impl Aparts {
    /// `each`, with the `place` of every cloth vertex.
    pub(super) fn new(mut each: Vec<Apart>, place: &[u32]) -> Self {
        for apart in &mut each {
            apart.vertices = apart.vertices.map(|v| place[v as usize]);
        }
        let lambda = vec![0.0; each.len()];
        Self { each, lambda }
    }

    /// Visits all once.
    pub(super) fn sweep(&mut self, rows: &mut [Four]) {
        for (apart, lambda) in self.each.iter().zip(&mut self.lambda) {
            let mut c = -apart.gap;
            let mut inverse_mass = apart.alpha_tilde;
            for (v, g) in apart.vertices.iter().zip(&apart.gradient) {
                let row = &rows[*v as usize];
                c += g.dot(&row.vector());
                inverse_mass += row.0[3] * g.norm_squared();
            }
            let wanted = *lambda - (c + apart.alpha_tilde * *lambda) / inverse_mass;
            let delta = wanted.max(0.0) - *lambda;
            if delta == 0.0 {
                continue;
            }
            *lambda += delta;
            for (v, g) in apart.vertices.iter().zip(&apart.gradient) {
                let row = &mut rows[*v as usize];
                row.shift(g * (row.0[3] * delta));
            }
        }
    }
}
