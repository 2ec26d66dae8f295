//! Pictures of drapes and patterns, drawn on the processor and the same on every machine.
//!
//! [`preview`] is a contact sheet: one column per [`Figure`], one row per [`View`], all at one
//! scale and cut to the height of the clothes. Wrong sides of cloth are plum, so that an
//! inside-out sleeve is seen at once. [`tiles()`] shows many figures, each at its own scale;
//! [`film()`] makes a picture of each, all at one scale.
//! [`pattern_png`] shows a meshed pattern flat.

mod canvas;
mod colour;
mod film;
mod flat;
mod raster;
mod scene;
mod text;
mod tiles;

pub use film::film;
pub use flat::pattern_png;
pub use tiles::tiles;

use canvas::{Area, Canvas};
use colour::{INK, Rgb, hex, mix, scaled};
use dress_anyone::geometry::{TriangleMesh, Vec3};
use dress_anyone::pattern::PatternMesh;
use scene::Frame;

/// A dressed body to draw.
pub struct Figure<'a> {
    /// Written above it.
    pub caption: &'a str,
    /// The body \[m\]; may be empty.
    pub body: &'a TriangleMesh,
    /// \[m\], `[cloth vertex]`; may be empty.
    pub cloth_positions: &'a [Vec3],
    /// Cloth vertices, right side in front.
    pub cloth_triangles: &'a [[u32; 3]],
    /// `[cloth triangle]`; colours the cloth when there is no scalar.
    pub panel_of_triangle: &'a [usize],
    /// Pairs of cloth vertices to draw as seams; hems are found.
    pub seam_edges: &'a [[u32; 2]],
    /// A distance to colour the cloth by \[m\], `[cloth vertex]`.
    pub scalar: Option<&'a [f64]>,
}

/// Where the eye is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// In front: bodies face +z.
    Front,
    /// Behind.
    Back,
    /// In front, 40° to the wearer's left.
    ThreeQuarter,
    /// At the wearer's left.
    Side,
}

impl View {
    /// Turn of the eye about the vertical from the front \[rad\].
    fn turn(self) -> f64 {
        match self {
            Self::Front => 0.0,
            Self::Back => std::f64::consts::PI,
            Self::ThreeQuarter => 40_f64.to_radians(),
            Self::Side => std::f64::consts::FRAC_PI_2,
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Front => "front",
            Self::Back => "back",
            Self::ThreeQuarter => "three-quarter",
            Self::Side => "side",
        }
    }
}

/// The panel of every triangle, as [`Figure::panel_of_triangle`] wants it.
pub fn panel_of_triangle(mesh: &PatternMesh) -> Vec<usize> {
    let mut panels = vec![0; mesh.triangles.len()];
    for (panel, range) in mesh.panel_triangles.iter().enumerate() {
        panels[range.clone()].fill(panel);
    }
    panels
}

/// Edges of the cloth along which two panel edges are sewn, as [`Figure::seam_edges`] wants them.
pub fn seam_edges(mesh: &PatternMesh) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = mesh
        .edge_vertices
        .iter()
        .flatten()
        .flat_map(|along| along.windows(2))
        .map(|pair| [mesh.sewing[pair[0] as usize], mesh.sewing[pair[1] as usize]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    let sewn = |group: &[[u32; 2]]| (group.len() > 1).then_some(group[0]);
    edges.chunk_by(|a, b| a == b).filter_map(sewn).collect()
}

/// Sizes of the sheet \[px\]: the most a sheet of several columns is wide, the most a tile is high.
const SHEET_WIDTH: f64 = 2000.0;
const TILE_HEIGHT: f64 = 860.0;
const MARGIN: usize = 26;
const GUTTER: usize = 12;
const TITLE_BAND: usize = 52;
const CAPTION_BAND: usize = 54;
const LEGEND_BAND: usize = 66;
const PAPER: u32 = 0x00ff_ffff;
const CARD: [u32; 2] = [0x00f3_f5f8, 0x00d9_dee5];
const GREY: u32 = 0x0068_6f7a;

/// The contact sheet of `figures` seen from `views`, as the bytes of a PNG file.
pub fn preview(title: &str, figures: &[Figure], views: &[View]) -> Vec<u8> {
    let frame = Frame::around(figures, views);
    let columns = figures.len().max(1);
    let scale = (SHEET_WIDTH / (columns as f64 * frame.width)).min(TILE_HEIGHT / frame.height);
    let tile = [frame.width, frame.height].map(|size| (size * scale).ceil() as usize);
    let top_scale = figures
        .iter()
        .filter_map(|figure| figure.scalar)
        .map(scale_top)
        .reduce(f64::max);

    let step = [tile[0] + GUTTER, tile[1] + GUTTER];
    let title_band = if title.is_empty() { 0 } else { TITLE_BAND };
    let first_row = MARGIN + title_band + CAPTION_BAND;
    let mut canvas = Canvas::new(
        2 * MARGIN + columns * step[0] - GUTTER,
        first_row + (views.len() * step[1]).max(GUTTER) - GUTTER + LEGEND_BAND + MARGIN,
        hex(PAPER),
    );
    let room = (canvas.width - 2 * MARGIN) as f32;
    let baseline = [MARGIN as f32 + 4.0, MARGIN as f32 + 22.0];
    let title = text::fitted(title, 3.0, room);
    text::write(&mut canvas, &title, baseline, 3.0, INK);
    for (column, figure) in figures.iter().enumerate() {
        let left = MARGIN + column * step[0];
        caption(&mut canvas, figure, [left, MARGIN + title_band], tile[0]);
        for (row, view) in views.iter().enumerate() {
            let corner = [left, first_row + row * step[1]];
            card(&mut canvas, corner, tile);
            scene::draw(&mut canvas, corner, tile, figure, *view, &frame, top_scale);
            let at = [corner[0] as f32 + 12.0, (corner[1] + tile[1]) as f32 - 13.0];
            text::write(&mut canvas, view.name(), at, 1.6, hex(GREY));
        }
    }
    let from_bottom = MARGIN + LEGEND_BAND - 20;
    let at = [MARGIN as f32 + 4.0, (canvas.height - from_bottom) as f32];
    let dressed =
        |figure: &Figure| !figure.cloth_triangles.is_empty() && !figure.body.triangles.is_empty();
    legend(&mut canvas, at, top_scale, figures.iter().any(dressed));
    canvas.to_png()
}

/// The background of a tile.
fn card(canvas: &mut Canvas, corner: [usize; 2], tile: [usize; 2]) {
    let area = Area {
        left: corner[0] as f32,
        top: corner[1] as f32,
        width: tile[0] as f32,
        height: tile[1] as f32,
    };
    let [light, dark] = CARD.map(hex);
    canvas.card(area, 7.0, |t| mix(light, dark, t * t));
}

/// The caption of a column and, below it, what its distances amount to.
fn caption(canvas: &mut Canvas, figure: &Figure, corner: [usize; 2], width: usize) {
    let (left, top) = (corner[0] as f32 + 4.0, corner[1] as f32);
    let room = width as f32 - 8.0;
    let heading = text::fitted(figure.caption, 2.3, room);
    text::write(canvas, &heading, [left, top + 18.0], 2.3, INK);
    if let Some(scalar) = figure.scalar {
        let line = text::fitted(&summary(scalar), 1.7, room);
        text::write(canvas, &line, [left, top + 40.0], 1.7, hex(GREY));
    }
}

/// "mean 3.1, 95% below 8.0, max 14.2 mm".
fn summary(scalar: &[f64]) -> String {
    let sorted = sorted_finite(scalar);
    let Some(largest) = sorted.last() else {
        return String::new();
    };
    let mean = sorted.iter().sum::<f64>() / sorted.len() as f64;
    format!(
        "mean {:.1}, 95% below {:.1}, max {:.1} mm",
        mean * 1e3,
        quantile(&sorted, 0.95) * 1e3,
        largest * 1e3
    )
}

/// Top of the colour scale \[m\]: the next round number of mm above nearly all of `scalar`.
fn scale_top(scalar: &[f64]) -> f64 {
    let most = quantile(&sorted_finite(scalar), 0.98) * 1e3;
    let power = 10_f64.powf(most.max(1.0).log10().floor());
    let mut steps = [1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 6.0, 8.0].into_iter();
    let top = steps.find(|step| step * power >= most);
    top.unwrap_or(10.0) * power * 1e-3
}

fn sorted_finite(values: &[f64]) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.iter().copied().filter(|v| v.is_finite()).collect();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted
}

/// The value below which this share of the values lies; 0 when there are none.
fn quantile(sorted: &[f64], share: f64) -> f64 {
    let last = sorted.len().saturating_sub(1) as f64;
    let rank = (last * share).round() as usize;
    sorted.get(rank).copied().unwrap_or(0.0)
}

/// The colour scale, if any, and, where bodies wear something, what wrong sides look like.
fn legend(canvas: &mut Canvas, [left, top]: [f32; 2], top_scale: Option<f64>, dressed: bool) {
    const WIDTH: f32 = 300.0;
    const LABEL: f32 = 150.0;
    let shift = if top_scale.is_some() {
        WIDTH + LABEL
    } else {
        0.0
    };
    if dressed {
        let meaning = "wrong side of the cloth";
        swatch(canvas, [left + shift, top], colour::WRONG_SIDE, meaning);
    }
    if let Some(top_scale) = top_scale {
        scale_bar(canvas, [left, top], WIDTH, top_scale);
    }
}

/// The colour scale with its ends and middle in millimetres.
fn scale_bar(canvas: &mut Canvas, [left, top]: [f32; 2], width: f32, top_scale: f64) {
    for i in 0..width as usize {
        let x = left + i as f32 + 0.5;
        let colour = colour::distance((i as f64 + 0.5) / f64::from(width));
        canvas.stroke([x, top], [x, top + 12.0], 1.0, scaled(colour, 0.95));
    }
    for (share, more) in [(0.0, ""), (0.5, ""), (1.0, " mm or more")] {
        let x = left + width * share;
        canvas.stroke([x, top + 14.0], [x, top + 19.0], 1.2, hex(GREY));
        let number = tidy(f64::from(share) * top_scale * 1e3);
        let start = (x - 0.5 * text::width(&number, 1.7)).max(left);
        text::write(canvas, &(number + more), [start, top + 34.0], 1.7, INK);
    }
}

/// A colour and what it means.
fn swatch(canvas: &mut Canvas, [left, top]: [f32; 2], colour: Rgb, meaning: &str) {
    let area = Area {
        left,
        top,
        width: 24.0,
        height: 12.0,
    };
    canvas.card(area, 3.0, |_| colour);
    text::write(canvas, meaning, [left + 34.0, top + 11.0], 1.7, INK);
}

/// A number of the scale: these are multiples of a half.
fn tidy(value: f64) -> String {
    if value.fract() == 0.0 || value >= 10.0 {
        format!("{value:.0}")
    } else {
        format!("{value:.1}")
    }
}

#[cfg(test)]
mod tests;
