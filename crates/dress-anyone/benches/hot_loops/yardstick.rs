//! What the machine can do: one XPBD sweep over 20,000 triangles and 29,800 hinges of a square grid,
//! written the plain way: an array of structs sorted by colour, one constraint after the other, in
//! `f64`.
//!
//! A triangle's C = (ε_uu, ε_vv, 2ε_uv) takes a 3 × 3 solve, a hinge's c = Σ k x a division: the
//! constraints of the library's own sweeps (its `sim::step`), which are measured against this. The
//! aims for speed were set on a core where such a loop takes [`REFERENCE_MS`].

/// Time of the yardstick on the core that the aims were set for \[ms\]: an aim of 0.8 ms is 0.6
/// yardsticks, one of 20 s is 14,900.
pub(crate) const REFERENCE_MS: f64 = 1.34;

/// Cells along a side.
const SIDE: usize = 100;
/// Side of a cell \[m\].
const CELL: f64 = 0.01;
/// Membrane compliance 𝔻⁻¹ \[m/N\]: weft and warp, coupling, shear.
const COMPLIANCE: [f64; 3] = [1.0 / 500.0, -0.2 / 500.0, 1.0 / 200.0];
/// Bending rigidity \[N·m\].
const RIGIDITY: f64 = 1e-5;
/// Areal density \[kg/m²\].
const DENSITY: f64 = 0.2;
/// Time step \[s\].
const DT: f64 = 1.0 / 120.0;

type Vec3 = [f64; 3];

/// A square grid of triangles, slightly stretched and bent.
pub(crate) struct Grid {
    x: Vec<Vec3>,
    triangles: Vec<Triangle>,
    hinges: Vec<Hinge>,
}

struct Triangle {
    corners: [usize; 3],
    /// Gradients of the hat functions of corners 1 and 2.
    b: [[f64; 2]; 2],
    /// 𝔻⁻¹/(Ā Δt²).
    alpha: [f64; 3],
    w: [f64; 3],
    lambda: Vec3,
}

struct Hinge {
    vertices: [usize; 4],
    k: [f64; 4],
    alpha: f64,
    w: [f64; 4],
    lambda: Vec3,
}

impl Grid {
    pub(crate) fn new() -> Self {
        let at = |i: usize, j: usize| j * (SIDE + 1) + i;
        let each = (0..=SIDE).flat_map(|j| (0..=SIDE).map(move |i| (i as f64, j as f64)));
        let bent = |(u, v): (f64, f64)| {
            let height = 0.1 * CELL * (u + 2.0 * v).sin();
            [1.02 * CELL * u, 1.02 * CELL * v, height]
        };
        let w = 1.0 / (DENSITY * CELL * CELL);
        let (area, mut triangles, mut hinges) = (0.5 * CELL * CELL, Vec::new(), Vec::new());
        // A hinge between right triangles over an edge of length l, its feet at parts s and t of it.
        let hinge = |vertices: [usize; 4], l: f64, [s, t]: [f64; 2]| {
            let k = -l * l / (2.0 * area);
            Hinge {
                vertices,
                k: [-(2.0 - s - t) * k, -(s + t) * k, k, k],
                alpha: 2.0 * area / (RIGIDITY * DT * DT),
                w: [w; 4],
                lambda: [0.0; 3],
            }
        };
        let alpha = COMPLIANCE.map(|c| c / (area * DT * DT));
        for j in 0..SIDE {
            for i in 0..SIDE {
                let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
                let n = 1.0 / CELL;
                for (corners, b) in [
                    ([a, b, c], [[n, -n], [0.0, n]]),
                    ([a, c, d], [[n, 0.0], [-n, n]]),
                ] {
                    let (w, lambda) = ([w; 3], [0.0; 3]);
                    triangles.push(Triangle {
                        corners,
                        b,
                        alpha,
                        w,
                        lambda,
                    });
                }
                hinges.push(hinge([a, c, b, d], 2.0_f64.sqrt() * CELL, [0.5, 0.5]));
                if j > 0 {
                    hinges.push(hinge([a, b, c, at(i, j - 1)], CELL, [1.0, 0.0]));
                }
                if i > 0 {
                    hinges.push(hinge([a, d, at(i - 1, j), c], CELL, [0.0, 1.0]));
                }
            }
        }
        let count = (SIDE + 1) * (SIDE + 1);
        Self {
            x: each.map(bent).collect(),
            triangles: by_colour(triangles, count, |t| &t.corners),
            hinges: by_colour(hinges, count, |h| &h.vertices),
        }
    }

    pub(crate) fn sweep(&mut self) {
        for triangle in &mut self.triangles {
            triangle.visit(&mut self.x);
        }
        for hinge in &mut self.hinges {
            hinge.visit(&mut self.x);
        }
    }
}

impl Triangle {
    fn visit(&mut self, x: &mut [Vec3]) {
        let [p, q, r] = self.corners.map(|a| x[a]);
        let [b1, b2] = self.b;
        let b0 = [-b1[0] - b2[0], -b1[1] - b2[1]];
        let column = |i: usize| -> Vec3 {
            std::array::from_fn(|c| (q[c] - p[c]) * b1[i] + (r[c] - p[c]) * b2[i])
        };
        let (fu, fv) = (column(0), column(1));
        let (uu, uv, vv) = (dot(fu, fu), dot(fu, fv), dot(fv, fv));
        let mut m = [0.0; 3];
        for (b, w) in [b0, b1, b2].iter().zip(self.w) {
            m[0] += w * b[0] * b[0];
            m[1] += w * b[0] * b[1];
            m[2] += w * b[1] * b[1];
        }
        let [diagonal, beside, shear] = self.alpha;
        let a00 = m[0] * uu + diagonal;
        let a10 = m[1] * uv + beside;
        let a11 = m[2] * vv + diagonal;
        let a20 = m[0] * uv + m[1] * uu;
        let a21 = m[1] * vv + m[2] * uv;
        let a22 = m[0] * vv + 2.0 * m[1] * uv + m[2] * uu + shear;
        let l = self.lambda;
        let right = [
            0.5 * (1.0 - uu) - diagonal * l[0] - beside * l[1],
            0.5 * (1.0 - vv) - beside * l[0] - diagonal * l[1],
            -uv - shear * l[2],
        ];
        // By LDLᵀ.
        let (l10, l20) = (a10 / a00, a20 / a00);
        let d1 = a11 - l10 * a10;
        let l21 = (a21 - l20 * a10) / d1;
        let d2 = a22 - l20 * a20 - l21 * (a21 - l20 * a10);
        let y1 = right[1] - l10 * right[0];
        let y2 = right[2] - l20 * right[0] - l21 * y1;
        let z = y2 / d2;
        let y = y1 / d1 - l21 * z;
        let delta = [right[0] / a00 - l10 * y - l20 * z, y, z];
        for c in 0..3 {
            self.lambda[c] += delta[c];
        }
        for ((a, b), w) in self.corners.iter().zip([b0, b1, b2]).zip(self.w) {
            let along_u = w * (delta[0] * b[0] + delta[2] * b[1]);
            let along_v = w * (delta[2] * b[0] + delta[1] * b[1]);
            for c in 0..3 {
                x[*a][c] += fu[c] * along_u + fv[c] * along_v;
            }
        }
    }
}

impl Hinge {
    fn visit(&mut self, x: &mut [Vec3]) {
        let mut mass = self.alpha;
        let mut value = self.lambda.map(|l| self.alpha * l);
        for ((a, k), w) in self.vertices.iter().zip(self.k).zip(self.w) {
            mass += w * k * k;
            for c in 0..3 {
                value[c] += k * x[*a][c];
            }
        }
        let delta = value.map(|v| -v / mass);
        for c in 0..3 {
            self.lambda[c] += delta[c];
        }
        for ((a, k), w) in self.vertices.iter().zip(self.k).zip(self.w) {
            for c in 0..3 {
                x[*a][c] += w * k * delta[c];
            }
        }
    }
}

fn dot(a: Vec3, b: Vec3) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// The pieces colour by colour: those of one colour share no vertex.
fn by_colour<T, const N: usize>(
    pieces: Vec<T>,
    vertex_count: usize,
    vertices: impl Fn(&T) -> &[usize; N],
) -> Vec<T> {
    let mut taken = vec![0_u64; vertex_count];
    let mut coloured: Vec<(u32, T)> = Vec::new();
    for piece in pieces {
        let at = *vertices(&piece);
        let colour = at.iter().fold(0, |all, a| all | taken[*a]).trailing_ones();
        for a in at {
            taken[a] |= 1 << colour;
        }
        coloured.push((colour, piece));
    }
    coloured.sort_by_key(|(colour, _)| *colour);
    coloured.into_iter().map(|(_, piece)| piece).collect()
}
