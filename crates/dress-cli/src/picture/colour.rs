//! Colours: linear RGB inside, sRGB in files, OKLab (Ottosson 2020) where a step should look like a
//! step.
//!
//! Distances are shown light (none) to dark (much), so that the scale reads in grey print and to
//! eyes that do not tell red from green.

/// Linear RGB, each channel 0 to 1.
pub type Rgb = [f32; 3];

/// Drawn on seams, hems and as text.
pub const INK: Rgb = [0.030, 0.034, 0.045];
/// Bodies.
pub const SKIN: Rgb = [0.56, 0.52, 0.49];
/// The inside of a body, seen through a hole of a scan.
pub const HOLLOW: Rgb = [0.16, 0.10, 0.09];
/// The wrong side of cloth: no panel and no distance has this colour.
pub const WRONG_SIDE: Rgb = [0.19, 0.045, 0.16];
/// What must not be: a flipped triangle.
pub const ALARM: Rgb = [0.80, 0.03, 0.02];

/// Hue \[turns\] of the panels' colours; neighbours in the file's order are far apart.
const HUES: [f32; 10] = [0.66, 0.16, 0.44, 0.03, 0.76, 0.28, 0.56, 0.10, 0.88, 0.36];

/// Lightness, chroma, hue \[turns\] along the distance scale.
const SCALE: [[f32; 3]; 6] = [
    [0.93, 0.025, 0.60],
    [0.87, 0.090, 0.50],
    [0.82, 0.140, 0.30],
    [0.72, 0.160, 0.17],
    [0.56, 0.180, 0.07],
    [0.36, 0.140, -0.03],
];

/// A muted colour for panel `p`; lightness alternates every round of hues.
pub fn panel(p: usize) -> Rgb {
    let lightness = if (p / HUES.len()).is_multiple_of(2) {
        0.73
    } else {
        0.60
    };
    oklch([lightness, 0.075, HUES[p % HUES.len()]])
}

/// Colour of `share` of the distance scale's top, 0 to 1 and clamped; non-finite alarms.
pub fn distance(share: f64) -> Rgb {
    if !share.is_finite() {
        return ALARM;
    }
    let at = share.clamp(0.0, 1.0) as f32 * (SCALE.len() - 1) as f32;
    let i = (at as usize).min(SCALE.len() - 2);
    oklch(mix(SCALE[i], SCALE[i + 1], at - i as f32))
}

/// `a` at 0, `b` at 1.
pub fn mix(a: Rgb, b: Rgb, t: f32) -> Rgb {
    [0, 1, 2].map(|i| a[i] + (b[i] - a[i]) * t)
}

/// `c` with every channel times `factor`.
pub fn scaled(c: Rgb, factor: f32) -> Rgb {
    c.map(|channel| channel * factor)
}

/// Linear RGB of an sRGB grey or colour given as in style sheets, 0xRRGGBB.
pub fn hex(code: u32) -> Rgb {
    [16, 8, 0].map(|shift| {
        let s = ((code >> shift) & 0xff) as f32 / 255.0;
        if s <= 0.040_45 {
            s / 12.92
        } else {
            ((s + 0.055) / 1.055).powf(2.4)
        }
    })
}

/// The bytes of a file: sRGB.
pub fn to_bytes(c: Rgb) -> [u8; 3] {
    c.map(|channel| {
        let l = channel.clamp(0.0, 1.0);
        let s = if l <= 0.003_130_8 {
            12.92 * l
        } else {
            1.055 * l.powf(1.0 / 2.4) - 0.055
        };
        (s * 255.0 + 0.5) as u8
    })
}

/// OKLab's polar form to linear RGB, clipped to what a screen shows.
fn oklch([lightness, chroma, hue]: [f32; 3]) -> Rgb {
    let angle = hue * std::f32::consts::TAU;
    let (a, b) = (chroma * angle.cos(), chroma * angle.sin());
    let l = (lightness + 0.396_337_78 * a + 0.215_803_76 * b).powi(3);
    let m = (lightness - 0.105_561_346 * a - 0.063_854_17 * b).powi(3);
    let s = (lightness - 0.089_484_18 * a - 1.291_485_5 * b).powi(3);
    [
        4.076_741_7 * l - 3.307_711_6 * m + 0.230_969_94 * s,
        -1.268_438 * l + 2.609_757_4 * m - 0.341_319_4 * s,
        -0.004_196_086_3 * l - 0.703_418_6 * m + 1.707_614_7 * s,
    ]
    .map(|channel| channel.clamp(0.0, 1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn luminance(c: Rgb) -> f32 {
        0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2]
    }

    #[test]
    fn the_distance_scale_darkens_all_the_way() {
        let scale: Vec<f32> = (0..=100)
            .map(|i| luminance(distance(f64::from(i) / 100.0)))
            .collect();
        assert!(scale.windows(2).all(|w| w[1] < w[0]), "{scale:?}");
        assert_eq!(distance(7.0), distance(1.0));
        assert_eq!(distance(f64::NAN), ALARM);
    }

    #[test]
    fn a_grey_of_oklab_is_grey() {
        // Without chroma the three channels are lightness cubed.
        for channel in oklch([0.5, 0.0, 0.3]) {
            assert!((channel - 0.125).abs() < 1e-4);
        }
    }

    #[test]
    fn bytes_are_the_inverse_of_hex() {
        for code in [0x00_0000, 0x01_0203, 0x7f_8081, 0xff_eedd] {
            let [r, g, b] = to_bytes(hex(code)).map(u32::from);
            assert_eq!(r << 16 | g << 8 | b, code);
        }
    }
}
