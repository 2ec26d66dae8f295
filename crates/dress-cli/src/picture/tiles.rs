//! Many figures in one picture: each in a tile of its own, all tiles of one size, each figure at the
//! scale that fills its tile.

use super::canvas::{Area, Canvas};
use super::colour::{INK, hex, mix};
use super::scene::{self, Frame};
use super::{CARD, Figure, GREY, GUTTER, PAPER, View, text};

/// Size of one view \[px\], and of the captions below it.
const VIEW: [usize; 2] = [150, 210];
const CAPTIONS: usize = 34;

/// A sheet of tiles, `columns` in a row, each with a figure from all `views` side by side, its caption
/// and a `note` below; the bytes of a PNG file.
pub fn tiles(figures: &[(Figure<'_>, &str)], views: &[View], columns: usize) -> Vec<u8> {
    let tile = [views.len() * VIEW[0], VIEW[1] + CAPTIONS];
    let step = tile.map(|size| size + GUTTER);
    let rows = figures.len().div_ceil(columns);
    let mut canvas = Canvas::new(
        columns.min(figures.len()) * step[0] + GUTTER,
        rows * step[1] + GUTTER,
        hex(PAPER),
    );
    for (n, (figure, note)) in figures.iter().enumerate() {
        let left = GUTTER + n % columns * step[0];
        let top = GUTTER + n / columns * step[1];
        let area = Area {
            left: left as f32,
            top: top as f32,
            width: tile[0] as f32,
            height: tile[1] as f32,
        };
        let [light, dark] = CARD.map(hex);
        canvas.card(area, 7.0, |t| mix(light, dark, t * t));
        let frame = Frame::around(std::slice::from_ref(figure), views).shaped(VIEW);
        for (v, view) in views.iter().enumerate() {
            let corner = [left + v * VIEW[0], top];
            scene::draw(&mut canvas, corner, VIEW, figure, *view, &frame, None);
        }
        let room = tile[0] as f32 - 12.0;
        let at = |line: f32| [area.left + 6.0, area.top + VIEW[1] as f32 + line];
        let heading = text::fitted(figure.caption, 1.5, room);
        text::write(&mut canvas, &heading, at(12.0), 1.5, INK);
        let note = text::fitted(note, 1.3, room);
        text::write(&mut canvas, &note, at(27.0), 1.3, hex(GREY));
    }
    canvas.to_png()
}
