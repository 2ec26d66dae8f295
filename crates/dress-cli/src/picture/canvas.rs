//! A picture being made: linear RGB, anti-aliased strokes and boxes, PNG at the end.

use super::colour::{Rgb, mix, to_bytes};

/// Pixels, row by row from the top; (0, 0) is the top left corner of the first pixel.
pub struct Canvas {
    pub width: usize,
    pub height: usize,
    pub pixels: Vec<Rgb>,
}

/// A rectangle \[px\].
#[derive(Clone, Copy)]
pub struct Area {
    pub left: f32,
    pub top: f32,
    pub width: f32,
    pub height: f32,
}

impl Canvas {
    /// A canvas all of one colour; at least one pixel.
    pub fn new(width: usize, height: usize, colour: Rgb) -> Self {
        let (width, height) = (width.max(1), height.max(1));
        Self {
            width,
            height,
            pixels: vec![colour; width * height],
        }
    }

    /// Lays `colour` over the pixel with this opacity; outside the canvas nothing happens.
    pub fn blend(&mut self, x: usize, y: usize, colour: Rgb, opacity: f32) {
        if x < self.width && y < self.height {
            let pixel = &mut self.pixels[y * self.width + x];
            *pixel = mix(*pixel, colour, opacity.clamp(0.0, 1.0));
        }
    }

    /// A rounded box, shaded by height: `colour_at(0)` on top, `colour_at(1)` at the bottom.
    pub fn card(&mut self, area: Area, radius: f32, colour_at: impl Fn(f32) -> Rgb) {
        let (half_width, half_height) = (0.5 * area.width, 0.5 * area.height);
        let (x, y) = (area.left + half_width, area.top + half_height);
        self.cover([x, y], [half_width, half_height], |p| {
            let dx = ((p[0] - x).abs() - half_width + radius).max(0.0);
            let dy = ((p[1] - y).abs() - half_height + radius).max(0.0);
            let share = (p[1] - area.top) / area.height;
            (radius - dx.hypot(dy), colour_at(share.clamp(0.0, 1.0)))
        });
    }

    /// A stroke with round ends.
    pub fn stroke(&mut self, a: [f32; 2], b: [f32; 2], width: f32, colour: Rgb) {
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let reach = [0, 1].map(|i| 0.5 * ((b[i] - a[i]).abs() + width));
        self.cover(middle, reach, |p| {
            let (_, distance) = nearest_on_segment(p, a, b);
            (0.5 * width - distance, colour)
        });
    }

    /// A filled triangle of either winding.
    pub fn triangle(&mut self, corners: [[f32; 2]; 3], colour: Rgb) {
        let low = [0, 1].map(|i| corners.iter().fold(f32::INFINITY, |m, c| m.min(c[i])));
        let high = [0, 1].map(|i| corners.iter().fold(f32::NEG_INFINITY, |m, c| m.max(c[i])));
        let middle = [0, 1].map(|i| 0.5 * (low[i] + high[i]));
        let reach = [0, 1].map(|i| 0.5 * (high[i] - low[i]));
        let [a, b, c] = corners;
        let turn = cross(a, b, c).signum();
        self.cover(middle, reach, |p| {
            let inside = [(a, b), (b, c), (c, a)].map(|(from, to)| {
                let length = (to[0] - from[0]).hypot(to[1] - from[1]);
                turn * cross(from, to, p) / length.max(1e-6)
            });
            // Half a pixel more than covered, so that neighbours leave no gap.
            (inside[0].min(inside[1]).min(inside[2]) + 0.5, colour)
        });
    }

    /// The picture as the bytes of a PNG file.
    pub fn to_png(&self) -> Vec<u8> {
        let data: Vec<u8> = self.pixels.iter().flat_map(|c| to_bytes(*c)).collect();
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, self.width as u32, self.height as u32);
        encoder.set_color(png::ColorType::Rgb);
        encoder.set_depth(png::BitDepth::Eight);
        encoder
            .write_header()
            .and_then(|mut writer| writer.write_image_data(&data))
            .expect("memory takes every byte, and the data has the size of the header");
        bytes
    }

    /// Blends wherever `shape` — depth of a point inside the shape \[px\], and its colour — is
    /// positive; half a pixel of softness.
    fn cover(&mut self, middle: [f32; 2], reach: [f32; 2], shape: impl Fn([f32; 2]) -> (f32, Rgb)) {
        let finite = middle.iter().chain(&reach).all(|v| v.is_finite());
        if !finite {
            return;
        }
        let range = |i: usize, size: usize| {
            let low = (middle[i] - reach[i] - 1.0).floor().max(0.0) as usize;
            let high = (middle[i] + reach[i] + 1.0).ceil().clamp(0.0, size as f32) as usize;
            low..high
        };
        for y in range(1, self.height) {
            for x in range(0, self.width) {
                let (depth, colour) = shape([x as f32 + 0.5, y as f32 + 0.5]);
                if depth > -0.5 {
                    self.blend(x, y, colour, depth + 0.5);
                }
            }
        }
    }
}

/// Parameter of the point of segment `a b` nearest to `p`, and its distance.
pub fn nearest_on_segment(p: [f32; 2], a: [f32; 2], b: [f32; 2]) -> (f32, f32) {
    let (along, to_p) = ([b[0] - a[0], b[1] - a[1]], [p[0] - a[0], p[1] - a[1]]);
    let squared = along[0] * along[0] + along[1] * along[1];
    let dot = to_p[0] * along[0] + to_p[1] * along[1];
    let t = (dot / squared.max(1e-12)).clamp(0.0, 1.0);
    let distance = (to_p[0] - t * along[0]).hypot(to_p[1] - t * along[1]);
    (t, distance)
}

/// Twice the signed area of the triangle a b c.
fn cross(a: [f32; 2], b: [f32; 2], c: [f32; 2]) -> f32 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    const WHITE: Rgb = [1.0; 3];
    const BLACK: Rgb = [0.0; 3];

    fn ink(canvas: &Canvas) -> f32 {
        canvas.pixels.iter().map(|c| 1.0 - c[0]).sum()
    }

    #[test]
    fn a_stroke_lays_down_its_area() {
        let mut canvas = Canvas::new(60, 20, WHITE);
        canvas.stroke([10.3, 9.7], [50.3, 9.7], 4.0, BLACK);
        // 40 × 4 px and two half discs of radius 2 px.
        let area = 160.0 + std::f32::consts::PI * 4.0;
        assert!((ink(&canvas) - area).abs() < 2.0, "{}", ink(&canvas));
    }

    #[test]
    fn what_lies_outside_the_canvas_is_cut_off() {
        let mut canvas = Canvas::new(4, 4, WHITE);
        canvas.stroke([-50.0, -50.0], [-40.0, -40.0], 3.0, BLACK);
        canvas.stroke([f32::NAN, 0.0], [1.0, 1.0], 3.0, BLACK);
        assert_eq!(ink(&canvas), 0.0);
        canvas.triangle([[-100.0, -100.0], [300.0, -100.0], [-100.0, 300.0]], BLACK);
        assert_eq!(ink(&canvas), 16.0);
    }

    #[test]
    fn a_png_reads_back_as_what_was_drawn() {
        let mut canvas = Canvas::new(3, 2, WHITE);
        canvas.blend(2, 1, BLACK, 1.0);
        let bytes = canvas.to_png();
        let mut reader = png::Decoder::new(std::io::Cursor::new(bytes))
            .read_info()
            .expect("a header");
        let mut data = vec![0; reader.output_buffer_size().expect("a small picture")];
        reader.next_frame(&mut data).expect("a frame");
        let mut expected = vec![255; 18];
        expected[15..].fill(0);
        assert_eq!(data, expected);
    }
}
