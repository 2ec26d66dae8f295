//! Figures of one garment for the preview.

use crate::picture::{self, Figure, View, panel_of_triangle, preview, seam_edges};
use dress_anyone::geometry::{TriangleMesh, Vec3};
use dress_anyone::pattern::PatternMesh;

/// A drape to show on a body.
pub struct Shown<'a> {
    /// Written above it.
    pub caption: &'a str,
    /// What it is on.
    pub body: &'a TriangleMesh,
    /// \[m\], `[cloth vertex]`.
    pub x: &'a [Vec3],
    /// A shape \[m\]; the distance to it is the colour.
    pub aim: Option<&'a [Vec3]>,
}

/// The drapes of one garment side by side, one row per view, as the bytes of a PNG file.
pub fn contact_sheet(
    title: &str,
    mesh: &PatternMesh,
    drapes: &[Shown<'_>],
    views: &[View],
) -> Vec<u8> {
    with_figures(mesh, drapes, |figures| preview(title, figures, views))
}

/// A picture of each drape of one garment, from the front and from aside, as the bytes of PNG files.
pub fn film(mesh: &PatternMesh, drapes: &[Shown<'_>]) -> Vec<Vec<u8>> {
    let views = [View::Front, View::ThreeQuarter];
    with_figures(mesh, drapes, |figures| picture::film(figures, &views))
}

fn with_figures<T>(
    mesh: &PatternMesh,
    drapes: &[Shown<'_>],
    draw: impl FnOnce(&[Figure<'_>]) -> T,
) -> T {
    let triangles = mesh.outward_triangles();
    let panels = panel_of_triangle(mesh);
    let seams = seam_edges(mesh);
    let distances: Vec<Option<Vec<f64>>> = drapes.iter().map(distances).collect();
    let figures: Vec<Figure<'_>> = drapes
        .iter()
        .zip(&distances)
        .map(|(shown, scalar)| Figure {
            caption: shown.caption,
            body: shown.body,
            cloth_positions: shown.x,
            cloth_triangles: &triangles,
            panel_of_triangle: &panels,
            seam_edges: &seams,
            scalar: scalar.as_deref(),
        })
        .collect();
    draw(&figures)
}

/// Distance of each vertex to where it should be \[m\].
fn distances(shown: &Shown<'_>) -> Option<Vec<f64>> {
    let pairs = shown.x.iter().zip(shown.aim?);
    Some(pairs.map(|(p, q)| (p - q).norm()).collect())
}
