//! What many tests begin with: plain panels, and the files of the shared data. Test-only.

use crate::geometry::polygon::Polygon;
use crate::geometry::{Mat3, TriangleMesh, Vec2, Vec3, bounds};
use crate::io::garmentcode;
use crate::pattern::{Curve, Edge, EdgeId, Panel, Pattern, PatternMesh, Placement, Stitch};
use std::path::{Path, PathBuf};

/// Adds a closed box to `mesh`, its faces outward \[m\].
pub(crate) fn add_box(mesh: &mut TriangleMesh, low: [f64; 3], high: [f64; 3]) {
    let base = mesh.positions.len() as u32;
    for i in 0..8 {
        let pick = |k: usize| if i >> k & 1 == 0 { low[k] } else { high[k] };
        mesh.positions.push(Vec3::new(pick(0), pick(1), pick(2)));
    }
    let quads = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    for [a, b, c, d] in quads.map(|q| q.map(|v| v + base)) {
        mesh.triangles.extend([[a, b, c], [a, c, d]]);
    }
}

/// Folders of the shared data that hold GarmentCode patterns.
pub(crate) const GARMENTS: [&str; 4] = [
    "garments/named",
    "garments/random",
    "garments/shipped",
    "garments/templates2021",
];

/// Files of the shared data with this extension, sorted; none, with a note, where there are none.
/// The data are next to the repository, or where the environment's `DRESS_SHARED` says.
pub(crate) fn shared(folders: &[&str], extension: &str) -> Vec<PathBuf> {
    let beside = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared");
    let data = std::env::var_os("DRESS_SHARED")
        .map_or(beside, PathBuf::from)
        .join("data");
    let entries = folders
        .iter()
        .map(|folder| std::fs::read_dir(data.join(folder)));
    let mut files: Vec<_> = entries
        .flat_map(|entries| entries.into_iter().flatten())
        .map(|entry| entry.unwrap().path())
        .filter(|path| path.extension().is_some_and(|e| e == extension))
        .collect();
    files.sort();
    if files.is_empty() {
        println!("skipped: no {extension} files in {folders:?} of the shared data");
    }
    files
}

/// A file of the repository's own data.
pub(crate) fn own(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR"))
        .join("../../data")
        .join(path)
}

/// The GarmentCode pattern in a file, and the file's name.
pub(crate) fn named_pattern(path: &Path) -> (String, Pattern) {
    let name = path.file_stem().unwrap().to_string_lossy().into_owned();
    let read = garmentcode::read(path, &garmentcode::ReadOptions::default());
    (name, read.unwrap_or_else(|error| panic!("{error}")).pattern)
}

/// Corners of a lopsided sleeve \[m\], which does not mirror itself.
pub(crate) const SLEEVE: [(f64, f64); 5] = [
    (0.0, 0.0),
    (0.2, 0.0),
    (0.3, 0.42),
    (0.1, 0.52),
    (-0.05, 0.4),
];

/// A panel of straight edges through `corners` \[m\], waiting at the origin.
pub(crate) fn panel(name: &str, corners: &[impl Copy + Into<[f64; 2]>]) -> Panel {
    panel_at(name, corners, Vec3::zeros())
}

/// A panel of straight edges, `at` its place in space, facing +z.
pub(crate) fn panel_at(name: &str, corners: &[impl Copy + Into<[f64; 2]>], at: Vec3) -> Panel {
    let count = corners.len();
    let edge = |start| Edge {
        start,
        end: (start + 1) % count,
        curve: Curve::Line,
        label: None,
    };
    Panel {
        name: name.to_owned(),
        vertices: corners.iter().map(|&c| Vec2::from(c.into())).collect(),
        edges: (0..count).map(edge).collect(),
        placement: Placement {
            rotation: Mat3::identity(),
            translation: at,
        },
        label: None,
    }
}

/// A panel whose edges are bottom, right, top, left.
pub(crate) fn rectangle(name: &str, width: f64, height: f64) -> Panel {
    panel(
        name,
        &[(0.0, 0.0), (width, 0.0), (width, height), (0.0, height)],
    )
}

/// Sews two edges, each given as panel and edge.
pub(crate) fn stitch(a: (usize, usize), b: (usize, usize)) -> Stitch {
    Stitch {
        sides: [a, b].map(|(panel, edge)| EdgeId { panel, edge }),
        right_wrong: false,
    }
}

/// The outline's points, and a grid of points inside, for every panel; no triangles, nothing sewn.
pub(crate) fn sampled(pattern: &Pattern, spacing: f64) -> PatternMesh {
    let mut x_bar = Vec::new();
    let mut panel_vertices = Vec::new();
    for panel in &pattern.panels {
        let start = x_bar.len();
        let outline = panel.outline(spacing);
        let (low, high) = bounds(&outline);
        let inside = Polygon::new(outline.clone());
        let steps = ((high - low) / spacing).map(|s| s as usize);
        x_bar.extend(&outline);
        for i in 1..=steps.x {
            let column = (1..=steps.y).map(|j| low + Vec2::new(i as f64, j as f64) * spacing);
            x_bar.extend(column.filter(|p| inside.contains(*p)));
        }
        panel_vertices.push(start..x_bar.len());
    }
    PatternMesh {
        triangles: Vec::new(),
        panel_triangles: vec![0..0; pattern.panels.len()],
        right_side_up: pattern
            .panels
            .iter()
            .map(|p| p.signed_area() > 0.0)
            .collect(),
        edge_vertices: vec![Vec::new(); pattern.panels.len()],
        sewing: (0..x_bar.len() as u32).collect(),
        cloth_vertex_count: x_bar.len(),
        x_bar,
        panel_vertices,
    }
}
