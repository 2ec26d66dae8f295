//! Triangles and lines into a depth buffer, then light on what is seen.
//!
//! Every output pixel has [`SAMPLES`]² samples. A sample keeps the nearest surface's depth, normal
//! and own colour; light is worked out afterwards, once per sample: a key light from the upper
//! left, a fill light from the right, ambient light from above, and darkening where the depth lies
//! behind its neighbourhood (Luft et al. 2006, "unsharp masking the depth buffer"), which sets cloth
//! off from the body under it. View space: x right, y down \[samples\], z towards the eye \[m\].

use super::canvas::{Canvas, nearest_on_segment};
use super::colour::{INK, Rgb};

/// Samples per pixel, each way.
pub const SAMPLES: usize = 2;

/// Unit directions towards the lights: right, up, towards the eye.
const KEY: [f32; 3] = [-0.462, 0.525, 0.715];
const FILL: [f32; 3] = [0.755, 0.101, 0.648];
/// Depth behind the neighbourhood at which it is darkest \[m\], and how dark.
const CREVICE: f32 = 0.03;
const DARKENING: f32 = 0.42;

/// The nearest surface at every sample.
pub struct Raster {
    width: usize,
    height: usize,
    depth: Vec<f32>,
    normal: Vec<[f32; 3]>,
    colour: Vec<Rgb>,
}

/// A corner of a triangle to draw.
#[derive(Clone, Copy)]
pub struct Corner {
    /// x, y \[samples\], z \[m\].
    pub at: [f64; 3],
    /// Unit; right, up, towards the eye.
    pub normal: [f32; 3],
    pub colour: Rgb,
}

impl Raster {
    /// For `width` × `height` pixels, nothing drawn.
    pub fn new(width: usize, height: usize) -> Self {
        let (width, height) = (width * SAMPLES, height * SAMPLES);
        Self {
            width,
            height,
            depth: vec![f32::NEG_INFINITY; width * height],
            normal: vec![[0.0; 3]; width * height],
            colour: vec![[0.0; 3]; width * height],
        }
    }

    /// Draws a triangle of either winding.
    pub fn triangle(&mut self, corners: [Corner; 3]) {
        let [a, b, c] = corners.map(|corner| corner.at);
        let doubled_area = edge(a, b, [c[0], c[1]]);
        let per_area = 1.0 / doubled_area;
        if !per_area.is_finite() {
            return;
        }
        let low = |i: usize| a[i].min(b[i]).min(c[i]);
        let high = |i: usize| a[i].max(b[i]).max(c[i]);
        for y in samples(low(1), high(1), self.height) {
            for x in samples(low(0), high(0), self.width) {
                let p = [x as f64 + 0.5, y as f64 + 0.5];
                let weights = [edge(b, c, p), edge(c, a, p), edge(a, b, p)];
                let weights = weights.map(|w| w * per_area);
                if weights.iter().any(|w| *w < 0.0) {
                    continue;
                }
                let depth = (weights[0] * a[2] + weights[1] * b[2] + weights[2] * c[2]) as f32;
                let sample = y * self.width + x;
                if depth > self.depth[sample] {
                    let weights = weights.map(|w| w as f32);
                    self.depth[sample] = depth;
                    self.normal[sample] = blend(weights, corners.map(|corner| corner.normal));
                    self.colour[sample] = blend(weights, corners.map(|corner| corner.colour));
                }
            }
        }
    }

    /// Inks the surface along a segment, `width` samples wide, where nothing is more than `slack`
    /// \[m\] in front of it.
    pub fn line(&mut self, a: [f64; 3], b: [f64; 3], width: f64, slack: f64) {
        if a.iter().chain(&b).any(|v| !v.is_finite()) {
            return;
        }
        let half = 0.5 * width;
        let flat = |p: [f64; 3]| [p[0] as f32, p[1] as f32];
        let (low_y, high_y) = (a[1].min(b[1]) - half, a[1].max(b[1]) + half);
        let (low_x, high_x) = (a[0].min(b[0]) - half, a[0].max(b[0]) + half);
        for y in samples(low_y, high_y, self.height) {
            for x in samples(low_x, high_x, self.width) {
                let p = [x as f32 + 0.5, y as f32 + 0.5];
                let (t, distance) = nearest_on_segment(p, flat(a), flat(b));
                let depth = a[2] + (b[2] - a[2]) * f64::from(t) + slack;
                let sample = y * self.width + x;
                let seen = self.depth[sample].is_finite() && depth as f32 >= self.depth[sample];
                if distance <= half as f32 && seen {
                    self.colour[sample] = INK;
                }
            }
        }
    }

    /// Lights what was drawn and lays it on the canvas at pixel (`left`, `top`).
    /// `crevices` is the radius of the neighbourhood \[px\]; `opacity` is by pixel row.
    pub fn develop(
        &self,
        canvas: &mut Canvas,
        [left, top]: [usize; 2],
        crevices: usize,
        opacity: impl Fn(usize) -> f32,
    ) {
        let width = self.width / SAMPLES;
        let neighbourhood = self.mean_depth(crevices);
        for y in 0..self.height / SAMPLES {
            for x in 0..width {
                let (mut sum, mut covered) = ([0.0; 3], 0);
                for sample in self.samples_of(x, y) {
                    if self.depth[sample].is_finite() {
                        let lit = self.lit(sample, neighbourhood[y * width + x]);
                        sum = [0, 1, 2].map(|i| sum[i] + lit[i]);
                        covered += 1;
                    }
                }
                if covered > 0 {
                    let mean = sum.map(|channel| channel / covered as f32);
                    let share = covered as f32 / (SAMPLES * SAMPLES) as f32;
                    canvas.blend(left + x, top + y, mean, share * opacity(y));
                }
            }
        }
    }

    /// Where the samples of a pixel are kept.
    fn samples_of(&self, x: usize, y: usize) -> impl Iterator<Item = usize> {
        let first = y * SAMPLES * self.width + x * SAMPLES;
        let width = self.width;
        (0..SAMPLES * SAMPLES).map(move |i| first + i / SAMPLES * width + i % SAMPLES)
    }

    /// The colour of one sample under the lights.
    fn lit(&self, sample: usize, neighbourhood: f32) -> Rgb {
        let n = self.normal[sample];
        let length = dot(n, n).sqrt().max(1e-6);
        let n = n.map(|v| v / length);
        // The key light wraps a little around the edge, as a large lamp does.
        let key = ((dot(n, KEY) + 0.15) / 1.15).max(0.0);
        let fill = dot(n, FILL).max(0.0);
        let ambient = 0.75 + 0.25 * n[1];
        let sheen = dot(n, half_way()).max(0.0).powi(24);
        let behind = ((neighbourhood - self.depth[sample]) / CREVICE).clamp(0.0, 1.0);
        let open = 1.0 - DARKENING * behind * (2.0 - behind);
        let light = (0.24 * ambient + 0.80 * key + 0.15 * fill) * open;
        self.colour[sample].map(|channel| channel * light + 0.035 * sheen * open)
    }

    /// Mean depth of what is drawn around each pixel, nearer pixels weighing more: two sweeps of
    /// running sums each way, over about `radius` pixels.
    fn mean_depth(&self, radius: usize) -> Vec<f32> {
        let (width, height) = (self.width / SAMPLES, self.height / SAMPLES);
        let mut sums = Vec::with_capacity(width * height);
        for pixel in 0..width * height {
            let mut sum = (0.0, 0.0);
            for sample in self.samples_of(pixel % width, pixel / width) {
                if self.depth[sample].is_finite() {
                    sum = (sum.0 + f64::from(self.depth[sample]), sum.1 + 1.0);
                }
            }
            sums.push(sum);
        }
        for _ in 0..2 {
            for y in 0..height {
                running_sums(&mut sums, y * width, 1, width, radius.div_ceil(2));
            }
            for x in 0..width {
                running_sums(&mut sums, x, width, height, radius.div_ceil(2));
            }
        }
        let mean = |(sum, count): (f64, f64)| (sum / count.max(1.0)) as f32;
        sums.into_iter().map(mean).collect()
    }
}

/// Replaces `count` entries, `stride` apart, by their sums over `radius` entries either way.
fn running_sums(sums: &mut [(f64, f64)], start: usize, stride: usize, count: usize, radius: usize) {
    let mut upto = vec![(0.0, 0.0)];
    for i in 0..count {
        let (sum, number) = upto[i];
        let next = sums[start + i * stride];
        upto.push((sum + next.0, number + next.1));
    }
    for i in 0..count {
        let (low, high) = (
            upto[i.saturating_sub(radius)],
            upto[count.min(i + radius + 1)],
        );
        sums[start + i * stride] = (high.0 - low.0, high.1 - low.1);
    }
}

/// Direction half-way between key light and eye, of unit length.
fn half_way() -> [f32; 3] {
    let sum = [KEY[0], KEY[1], KEY[2] + 1.0];
    let length = dot(sum, sum).sqrt();
    sum.map(|v| v / length)
}

fn dot(a: [f32; 3], b: [f32; 3]) -> f32 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Twice the signed area of the triangle a b p on the screen.
fn edge(a: [f64; 3], b: [f64; 3], p: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (p[1] - a[1]) - (b[1] - a[1]) * (p[0] - a[0])
}

fn blend(weights: [f32; 3], values: [[f32; 3]; 3]) -> [f32; 3] {
    [0, 1, 2]
        .map(|i| weights[0] * values[0][i] + weights[1] * values[1][i] + weights[2] * values[2][i])
}

/// Samples whose centres lie between `low` and `high`.
fn samples(low: f64, high: f64, count: usize) -> std::ops::Range<usize> {
    let first = (low - 0.5).ceil().max(0.0) as usize;
    let end = (high + 0.5).floor().max(0.0) as usize;
    first..end.min(count)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RED: Rgb = [1.0, 0.0, 0.0];
    const BLUE: Rgb = [0.0, 0.0, 1.0];

    fn flat(points: [[f64; 2]; 3], depth: f64, colour: Rgb) -> [Corner; 3] {
        points.map(|[x, y]| Corner {
            at: [x, y, depth],
            normal: [0.0, 0.0, 1.0],
            colour,
        })
    }

    const HALF: [[f64; 2]; 3] = [[0.0, 0.0], [30.0, 0.0], [0.0, 30.0]];

    #[test]
    fn the_nearer_triangle_is_seen_whatever_the_order() {
        for order in [[(0.0, RED), (1.0, BLUE)], [(1.0, BLUE), (0.0, RED)]] {
            let mut raster = Raster::new(10, 10);
            for (depth, colour) in order {
                raster.triangle(flat(HALF, depth, colour));
            }
            assert_eq!(raster.colour[30 + 3], BLUE);
        }
    }

    #[test]
    fn two_triangles_of_a_square_leave_no_gap() {
        let mut raster = Raster::new(10, 10);
        raster.triangle(flat(HALF, 0.0, RED));
        raster.triangle(flat([[30.0, 0.0], [30.0, 30.0], [0.0, 30.0]], 0.0, RED));
        assert!(raster.depth.iter().all(|d| *d == 0.0));
    }

    #[test]
    fn a_line_behind_a_surface_is_not_drawn() {
        let mut raster = Raster::new(10, 10);
        raster.triangle(flat(HALF, 0.0, RED));
        let inked = |raster: &Raster| raster.colour.iter().filter(|c| **c == INK).count();
        raster.line([0.0, 5.0, -0.1], [20.0, 5.0, -0.1], 2.0, 0.01);
        assert_eq!(inked(&raster), 0);
        raster.line([0.0, 5.0, -0.005], [20.0, 5.0, -0.005], 2.0, 0.01);
        // Two rows of twenty samples, and at most a round end.
        assert!((40..=42).contains(&inked(&raster)), "{}", inked(&raster));
    }

    #[test]
    fn what_is_not_finite_is_not_drawn() {
        let mut raster = Raster::new(4, 4);
        raster.triangle(flat([[f64::NAN, 0.0], [9.0, 0.0], [0.0, 9.0]], 0.0, RED));
        raster.line([0.0; 3], [f64::INFINITY; 3], 2.0, 1.0);
        assert!(raster.depth.iter().all(|d| !d.is_finite()));
    }

    #[test]
    fn the_mean_depth_leaves_the_background_out() {
        let mut raster = Raster::new(9, 1);
        raster.depth[0] = 2.0;
        raster.depth[4] = 4.0;
        let mean = raster.mean_depth(1);
        // Pixels 0 and 1 are drawn, by one sample each; pixel 8 has none of them near.
        assert!(mean[0] > 2.0 && mean[0] < mean[1] && mean[1] < 4.0);
        assert_eq!(mean[8], 0.0);
    }
}
