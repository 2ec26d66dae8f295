//! A tube of two panels, 3 % too tight, pulled over an elliptic cylinder and held at its top.

use dress_anyone::garment::Fabric;
use dress_anyone::geometry::{Mat3, TriangleMesh, Vec2, Vec3};
use dress_anyone::pattern::{
    Curve, Edge, EdgeId, Panel, Pattern, PatternMesh, Placement, Stitch, triangulate,
};
use dress_anyone::sim::{Cloth, Hold};
use std::f64::consts::TAU;

/// Half axes of the body \[m\].
const HALF_AXES: (f64, f64) = (0.14, 0.10);
/// Height of the tube \[m\]; the body reaches 0.1 m beyond.
const HEIGHT: f64 = 0.6;
/// Circumference of the pattern over that of the body.
const FIT: f64 = 0.97;
/// Points around the body.
const AROUND: usize = 96;

/// A pattern, its mesh and a start for its drape.
pub(crate) struct Tube {
    pub(crate) pattern: Pattern,
    pub(crate) mesh: PatternMesh,
    /// On the body \[m\], `[cloth vertex]`.
    pub(crate) x: Vec<Vec3>,
}

impl Tube {
    /// A tube of about `size` cloth vertices.
    pub(crate) fn new(size: usize) -> Self {
        let ring = ring();
        let around: f64 = sides(&ring).sum();
        let width = 0.5 * FIT * around;
        let pattern = Pattern {
            panels: vec![panel("front", width, 0.2), panel("back", width, -0.2)],
            stitches: [1, 3].map(sew).to_vec(),
        };
        // In a lattice of equilateral triangles of side h a vertex has an area of √3/2 h².
        let resolution = (2.0 * width * HEIGHT / (0.75_f64.sqrt() * size as f64)).sqrt();
        let mesh = triangulate::mesh(&pattern, resolution).expect("two rectangles can be meshed");
        let mut x = vec![Vec3::zeros(); mesh.x_bar.len()];
        for (side, range) in [1.0, -1.0].into_iter().zip(&mesh.panel_vertices) {
            for v in range.clone() {
                let p = mesh.x_bar[v];
                let on_ring = at(&ring, 0.5 * around * p.x / width);
                x[v] = Vec3::new(on_ring.x, p.y, side * on_ring.y);
            }
        }
        let x = mesh.sew(&x);
        Self { pattern, mesh, x }
    }

    /// The cloth of default fabric, its upper rim held.
    pub(crate) fn cloth(&self) -> Cloth {
        let mut cloth = Cloth::new(&self.mesh, &Fabric::default());
        let rim = (0..cloth.vertex_count as u32).filter(|v| self.x[*v as usize].y > 0.999 * HEIGHT);
        let hold = |vertex| Hold {
            vertex,
            height: HEIGHT,
            stiffness: 100.0,
        };
        cloth.holds = rim.map(hold).collect();
        cloth
    }
}

/// The cylinder, closed.
pub(crate) fn body() -> TriangleMesh {
    const ROWS: usize = 66;
    let ring = ring();
    let n = ring.len() as u32;
    let mut positions = Vec::new();
    for j in 0..=ROWS {
        let y = -0.1 + (HEIGHT + 0.2) * j as f64 / ROWS as f64;
        positions.extend(ring.iter().map(|p| Vec3::new(p.x, y, p.y)));
    }
    let mut triangles = Vec::new();
    for j in 0..ROWS as u32 {
        for i in 0..n {
            let [a, b] = [j * n + i, j * n + (i + 1) % n];
            triangles.extend([[a, a + n, b], [b, a + n, b + n]]);
        }
    }
    let top = ROWS as u32 * n;
    for i in 1..n - 1 {
        triangles.extend([[0, i, i + 1], [top, top + i + 1, top + i]]);
    }
    TriangleMesh {
        positions,
        triangles,
    }
}

/// The ellipse, from +x towards +z.
fn ring() -> Vec<Vec2> {
    let point = |i: usize| {
        let angle = TAU * i as f64 / AROUND as f64;
        Vec2::new(HALF_AXES.0 * angle.cos(), HALF_AXES.1 * angle.sin())
    };
    (0..AROUND).map(point).collect()
}

fn sides(ring: &[Vec2]) -> impl Iterator<Item = f64> {
    let next = ring.iter().cycle().skip(1);
    ring.iter().zip(next).map(|(a, b)| (b - a).norm())
}

/// The point of the ring `length` \[m\] from its start.
fn at(ring: &[Vec2], mut length: f64) -> Vec2 {
    for (i, side) in sides(ring).enumerate() {
        if length <= side {
            return ring[i].lerp(&ring[(i + 1) % ring.len()], length / side);
        }
        length -= side;
    }
    ring[0]
}

fn panel(name: &str, width: f64, z: f64) -> Panel {
    let corners = [(0.0, 0.0), (width, 0.0), (width, HEIGHT), (0.0, HEIGHT)];
    let edge = |start| Edge {
        start,
        end: (start + 1) % 4,
        curve: Curve::Line,
        label: None,
    };
    Panel {
        name: name.to_owned(),
        vertices: corners.map(|(x, y)| Vec2::new(x, y)).to_vec(),
        edges: (0..4).map(edge).collect(),
        placement: Placement {
            rotation: Mat3::identity(),
            translation: Vec3::new(0.0, 0.0, z),
        },
        label: None,
    }
}

/// Edge `edge` of the front to the same of the back.
fn sew(edge: usize) -> Stitch {
    Stitch {
        sides: [EdgeId { panel: 0, edge }, EdgeId { panel: 1, edge }],
        right_wrong: true,
    }
}
