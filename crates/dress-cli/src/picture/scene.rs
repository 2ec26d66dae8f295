//! One tile of the sheet: a dressed body seen from one side, orthographic, in metres per pixel.

use super::canvas::Canvas;
use super::colour::{self, Rgb, scaled};
use super::raster::{Corner, Raster, SAMPLES};
use super::{Figure, View};
use dress_anyone::geometry::mesh::{bounds, vertex_normals};
use dress_anyone::geometry::{TriangleMesh, Vec3};

/// Shown of the body above and below the clothes \[m\].
const MARGIN: f64 = 0.16;
/// A head or feet with no more than this cut off are shown whole \[m\].
const KEEP: f64 = 0.45;
/// Left free around a body shown whole \[m\].
const AIR: f64 = 0.04;
/// A seam line shows through this much of the surface it lies in \[m\].
const SLACK: f64 = 4e-3;
/// Radius in which depth is compared for the shadow of cloth on the body \[m\].
const CREVICE_RADIUS: f64 = 0.022;
/// Thickness of seams and hems \[px\].
const LINE: f64 = 1.25;

/// The part of space that every tile shows.
pub struct Frame {
    /// Height of the tile's lower edge above the body's lowest point \[m\].
    bottom: f64,
    /// Size of a tile \[m\].
    pub width: f64,
    pub height: f64,
    /// Whether the upper and the lower edge cut bodies off.
    cut: [bool; 2],
}

impl Frame {
    /// The clothes of all figures with some of their bodies.
    pub fn around(figures: &[Figure], views: &[View]) -> Self {
        let (mut all, mut clothes) = (EMPTY, EMPTY);
        for figure in figures {
            let ground = ground(figure);
            for p in points(figure) {
                all = [all[0].min(p.y - ground), all[1].max(p.y - ground)];
            }
            for p in figure.cloth_positions.iter().copied().filter(finite) {
                clothes = [clothes[0].min(p.y - ground), clothes[1].max(p.y - ground)];
            }
        }
        if all[0] > all[1] {
            all = [0.0, 1.0];
        }
        if clothes[0] > clothes[1] {
            clothes = all;
        }
        let shown = [clothes[0] - MARGIN, clothes[1] + MARGIN];
        let cut = [all[1] - shown[1] > KEEP, shown[0] - all[0] > KEEP];
        let top = if cut[0] { shown[1] } else { all[1] + AIR };
        let bottom = if cut[1] { shown[0] } else { all[0] - AIR };
        let mut half_width = 0.05_f64;
        for figure in figures {
            let (ground, middle) = (ground(figure), middle(figure));
            for p in points(figure) {
                if (bottom..=top).contains(&(p.y - ground)) {
                    for view in views {
                        let x = right(*view).dot(&(p - middle));
                        half_width = half_width.max(x.abs());
                    }
                }
            }
        }
        Self {
            bottom,
            width: 2.0 * (half_width + AIR),
            height: top - bottom,
            cut,
        }
    }

    /// The same, widened or heightened to the shape of a tile of this size.
    pub fn shaped(self, tile: [usize; 2]) -> Self {
        let aspect = tile[0] as f64 / tile[1] as f64;
        let height = self.height.max(self.width / aspect);
        Self {
            bottom: self.bottom - 0.5 * (height - self.height),
            width: height * aspect,
            height,
            cut: self.cut,
        }
    }
}

/// Draws a figure into the tile at `corner`; `scale_top` is the top of the distance scale \[m\].
pub fn draw(
    canvas: &mut Canvas,
    corner: [usize; 2],
    tile: [usize; 2],
    figure: &Figure,
    view: View,
    frame: &Frame,
    scale_top: Option<f64>,
) {
    let eye = Eye::new(figure, view, frame, tile);
    let mut raster = Raster::new(tile[0], tile[1]);
    draw_body(&mut raster, &eye, figure.body);
    draw_cloth(&mut raster, &eye, figure, scale_top);
    let x = |a: &[u32; 2]| a.map(|v| eye.place(figure.cloth_positions[v as usize]));
    for ends in figure
        .seam_edges
        .iter()
        .chain(&hems(figure.cloth_triangles))
    {
        let [a, b] = x(ends);
        raster.line(a, b, LINE * SAMPLES as f64, SLACK);
    }
    let crevices = (CREVICE_RADIUS * eye.scale / SAMPLES as f64).ceil() as usize;
    raster.develop(canvas, corner, crevices, |row| {
        fade(row, tile[1], frame.cut)
    });
}

fn draw_body(raster: &mut Raster, eye: &Eye, body: &TriangleMesh) {
    let normals = body.vertex_normals();
    for triangle in &body.triangles {
        let corners = triangle.map(|v| eye.place(body.positions[v as usize]));
        let front = faces_eye(corners);
        let colour = if front { colour::SKIN } else { colour::HOLLOW };
        raster.triangle([0, 1, 2].map(|i| Corner {
            at: corners[i],
            normal: eye.normal(normals[triangle[i] as usize], front),
            colour,
        }));
    }
}

fn draw_cloth(raster: &mut Raster, eye: &Eye, figure: &Figure, scale_top: Option<f64>) {
    let normals = vertex_normals(figure.cloth_positions, figure.cloth_triangles);
    for (t, triangle) in figure.cloth_triangles.iter().enumerate() {
        let corners = triangle.map(|v| eye.place(figure.cloth_positions[v as usize]));
        let front = faces_eye(corners);
        let colours = corner_colours(figure, t, scale_top);
        raster.triangle([0, 1, 2].map(|i| Corner {
            at: corners[i],
            normal: eye.normal(normals[triangle[i] as usize], front),
            colour: if front {
                colours[i]
            } else {
                colour::mix(scaled(colours[i], 0.25), colour::WRONG_SIDE, 0.85)
            },
        }));
    }
}

/// Colours of the right side at the corners of cloth triangle `t`.
fn corner_colours(figure: &Figure, t: usize, scale_top: Option<f64>) -> [Rgb; 3] {
    match (figure.scalar, scale_top) {
        (Some(scalar), Some(top)) => {
            figure.cloth_triangles[t].map(|v| colour::distance(scalar[v as usize] / top))
        }
        _ => [colour::panel(figure.panel_of_triangle[t]); 3],
    }
}

/// Edges that belong to one triangle only.
fn hems(triangles: &[[u32; 3]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    let alone = |group: &[[u32; 2]]| (group.len() == 1).then_some(group[0]);
    edges.chunk_by(|a, b| a == b).filter_map(alone).collect()
}

/// From space to a tile's samples.
struct Eye {
    middle: Vec3,
    right: Vec3,
    towards: Vec3,
    /// \[samples/m\].
    scale: f64,
    /// Where `middle` lands \[samples\].
    origin: [f64; 2],
}

impl Eye {
    fn new(figure: &Figure, view: View, frame: &Frame, tile: [usize; 2]) -> Self {
        let mut middle = middle(figure);
        middle.y = ground(figure) + frame.bottom;
        let samples = tile.map(|size| (size * SAMPLES) as f64);
        let (sin, cos) = view.turn().sin_cos();
        Self {
            middle,
            right: right(view),
            towards: Vec3::new(sin, 0.0, cos),
            scale: samples[1] / frame.height,
            origin: [0.5 * samples[0], samples[1]],
        }
    }

    /// x, y \[samples\], z towards the eye \[m\].
    fn place(&self, p: Vec3) -> [f64; 3] {
        let d = p - self.middle;
        [
            self.origin[0] + self.right.dot(&d) * self.scale,
            self.origin[1] - d.y * self.scale,
            self.towards.dot(&d),
        ]
    }

    /// The normal of the side that is seen: right, up, towards the eye.
    fn normal(&self, n: Vec3, front: bool) -> [f32; 3] {
        let n = if front { n } else { -n };
        [self.right.dot(&n), n.y, self.towards.dot(&n)].map(|v| v as f32)
    }
}

/// Whether a placed triangle is counter-clockwise as seen; y of the screen points down.
fn faces_eye([a, b, c]: [[f64; 3]; 3]) -> bool {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]) < 0.0
}

/// Opacity of a row: bodies that go on beyond the tile fade out.
fn fade(row: usize, height: usize, [top, bottom]: [bool; 2]) -> f32 {
    let reach = 0.07 * height as f32;
    let smooth = |rows: usize| {
        let t = ((rows as f32 + 0.5) / reach).min(1.0);
        t * t * (3.0 - 2.0 * t)
    };
    let upper = if top { smooth(row) } else { 1.0 };
    let lower = if bottom {
        smooth(height - 1 - row)
    } else {
        1.0
    };
    upper * lower
}

/// The screen's right in space.
fn right(view: View) -> Vec3 {
    let (sin, cos) = view.turn().sin_cos();
    Vec3::new(cos, 0.0, -sin)
}

/// An interval without a number in it.
const EMPTY: [f64; 2] = [f64::INFINITY, f64::NEG_INFINITY];

/// What a figure stands around: the body, or the cloth when there is none.
fn standing<'a>(figure: &'a Figure) -> &'a [Vec3] {
    if figure.body.positions.is_empty() {
        figure.cloth_positions
    } else {
        &figure.body.positions
    }
}

/// Finite points of body and cloth.
fn points<'a>(figure: &'a Figure) -> impl Iterator<Item = Vec3> + 'a {
    let both = figure.body.positions.iter().chain(figure.cloth_positions);
    both.copied().filter(finite)
}

fn finite(p: &Vec3) -> bool {
    p.iter().all(|v| v.is_finite())
}

/// Height of the lowest point \[m\]; 0 without points.
fn ground(figure: &Figure) -> f64 {
    let heights = standing(figure).iter().map(|p| p.y);
    let lowest = heights
        .filter(|y| y.is_finite())
        .fold(f64::INFINITY, f64::min);
    if lowest.is_finite() { lowest } else { 0.0 }
}

/// Middle of the box around what a figure stands around \[m\].
fn middle(figure: &Figure) -> Vec3 {
    let solid: Vec<Vec3> = standing(figure).iter().copied().filter(finite).collect();
    let (low, high) = bounds(&solid);
    if solid.is_empty() {
        Vec3::zeros()
    } else {
        (low + high) * 0.5
    }
}
