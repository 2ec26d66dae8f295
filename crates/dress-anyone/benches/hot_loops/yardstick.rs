//! What the machine can do: one Gauss–Seidel sweep of distance constraints over a grid of triangles,
//! colour by colour, in plain arrays of `f64`.

/// Cells along a side: 20,000 triangles.
const SIDE: usize = 100;

/// A square grid of triangles, slightly stretched.
pub(crate) struct Grid {
    x: Vec<[f64; 3]>,
    /// Sorted by colour: triangles of one colour share no vertex.
    triangles: Vec<[usize; 3]>,
    /// Lengths at rest, of the sides from each corner to the next.
    lengths: Vec<[f64; 3]>,
}

impl Grid {
    pub(crate) fn new() -> Self {
        let mut x = Vec::new();
        for j in 0..=SIDE {
            for i in 0..=SIDE {
                let (u, v) = (i as f64, j as f64);
                x.push([u, v, 0.1 * (u + 2.0 * v).sin()]);
            }
        }
        let mut triangles = Vec::new();
        for colour in 0..8 {
            for j in (colour % 2..SIDE).step_by(2) {
                for i in (colour / 2 % 2..SIDE).step_by(2) {
                    let a = j * (SIDE + 1) + i;
                    let (b, c, d) = (a + 1, a + SIDE + 2, a + SIDE + 1);
                    triangles.push(if colour < 4 { [a, b, c] } else { [a, c, d] });
                }
            }
        }
        let side = |p: [f64; 3], q: [f64; 3]| 0.98 * difference(p, q).1;
        let lengths = triangles
            .iter()
            .map(|t| [0, 1, 2].map(|k| side(x[t[k]], x[t[(k + 1) % 3]])))
            .collect();
        Self {
            x,
            triangles,
            lengths,
        }
    }

    pub(crate) fn sweep(&mut self) {
        for (t, lengths) in self.triangles.iter().zip(&self.lengths) {
            for k in 0..3 {
                let (a, b) = (t[k], t[(k + 1) % 3]);
                let (d, length) = difference(self.x[a], self.x[b]);
                let share = 0.25 * (length - lengths[k]) / length;
                for c in 0..3 {
                    self.x[a][c] += share * d[c];
                    self.x[b][c] -= share * d[c];
                }
            }
        }
    }
}

fn difference(p: [f64; 3], q: [f64; 3]) -> ([f64; 3], f64) {
    let d = [q[0] - p[0], q[1] - p[1], q[2] - p[2]];
    (d, (d[0] * d[0] + d[1] * d[1] + d[2] * d[2]).sqrt())
}
