//! Pictures of one figure in motion: all of one size, at one scale and from one place, as a film wants.

use super::canvas::{Area, Canvas};
use super::colour::{INK, hex, mix};
use super::scene::{self, Frame};
use super::{CARD, Figure, View, text};
use rayon::prelude::*;

/// Size of one view \[px\], and of the caption below; even, as encoders want them.
const VIEW: [usize; 2] = [540, 720];
const CAPTION: usize = 40;

/// A picture of each figure from all `views` side by side, its caption below; the bytes of PNG files.
pub fn film(figures: &[Figure<'_>], views: &[View]) -> Vec<Vec<u8>> {
    let frame = Frame::around(figures, views).shaped(VIEW);
    let picture = |figure: &Figure<'_>| {
        let size = [views.len() * VIEW[0], VIEW[1] + CAPTION];
        let [light, dark] = CARD.map(hex);
        let mut canvas = Canvas::new(size[0], size[1], light);
        let area = Area {
            left: 0.0,
            top: 0.0,
            width: size[0] as f32,
            height: size[1] as f32,
        };
        canvas.card(area, 0.0, |t| mix(light, dark, t * t));
        for (v, view) in views.iter().enumerate() {
            let corner = [v * VIEW[0], 0];
            scene::draw(&mut canvas, corner, VIEW, figure, *view, &frame, None);
        }
        let heading = text::fitted(figure.caption, 2.0, size[0] as f32 - 24.0);
        let at = [12.0, (VIEW[1] + CAPTION) as f32 - 14.0];
        text::write(&mut canvas, &heading, at, 2.0, INK);
        canvas.to_png()
    };
    figures.par_iter().map(picture).collect()
}
