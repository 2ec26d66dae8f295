//! Small cloths shared by the tests of the simulator.

use super::{Cloth, PatternMesh};
use crate::garment::{Cut, Fabric, FoldLine};
use crate::geometry::{Vec2, Vec3};
use crate::pattern::EdgeId;
use crate::sim::material::Material;

/// Unlike along warp and weft, and softer than most: small forces show.
pub(crate) const SOFT: Fabric = Fabric {
    warp: 50.0,
    weft: 80.0,
    poisson: 0.2,
    shear: 20.0,
    bending: 1e-4,
    density: 0.2,
    thickness: 5e-4,
    friction: 0.15,
};

/// Every other triangle of a stiffer, heavier fabric than [`SOFT`], and on the bias.
pub(crate) fn patched(mesh: &PatternMesh) -> Cloth {
    let mut cloth = Cloth::new(mesh, &SOFT);
    let patch = Cut {
        fabric: Fabric {
            warp: 120.0,
            bending: 3e-4,
            density: 0.3,
            friction: 0.08,
            ..SOFT
        },
        grain: 35.0,
    };
    cloth.materials.push(Material::from(&patch));
    for of in cloth.material_of.iter_mut().step_by(2) {
        *of = 1;
    }
    rub(&mut cloth);
    cloth
}

/// One cloth of a mesh without seams and its copy.
pub(crate) fn twice(one: &PatternMesh) -> PatternMesh {
    let count = one.x_bar.len() as u32;
    let mut both = one.clone();
    both.x_bar
        .extend(one.x_bar.iter().map(|p| p.add_scalar(1.0)));
    both.triangles
        .extend(one.triangles.iter().map(|t| t.map(|v| v + count)));
    both.sewing = (0..2 * count).collect();
    both.cloth_vertex_count = 2 * count as usize;
    both
}

/// Has the contact points rub as the materials do.
pub(crate) fn rub(cloth: &mut Cloth) {
    for point in &mut cloth.contacts {
        point.friction = 0.0;
    }
    for m in 0..cloth.materials.len() {
        let shares = cloth.friction_shares(m);
        for (point, share) in cloth.contacts.iter_mut().zip(shares) {
            point.friction += share * cloth.materials[m].friction;
        }
    }
}

/// A [`tube`] of two fabrics whose seam is pressed.
pub(crate) fn creased(mesh: &PatternMesh) -> Cloth {
    let mut cloth = patched(mesh);
    let seam = FoldLine {
        edge: EdgeId { panel: 0, edge: 3 },
        angle: 1.9,
        firmness: 3.0,
    };
    cloth.press(mesh, &[seam]);
    cloth
}

/// A rectangular panel of staggered triangles, `columns` × `rows` cells of side `h` \[m\].
pub(crate) fn sheet(columns: usize, rows: usize, h: f64) -> PatternMesh {
    let mut x_bar = Vec::new();
    let mut triangles = Vec::new();
    for j in 0..=rows {
        for i in 0..=columns {
            x_bar.push(Vec2::new(h * i as f64, h * j as f64));
        }
    }
    let at = |i: usize, j: usize| (j * (columns + 1) + i) as u32;
    for j in 0..rows {
        for i in 0..columns {
            let [a, b, c, d] = [at(i, j), at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)];
            // Diagonals alternate, so that no direction is favoured.
            if (i + j) % 2 == 0 {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[a, b, d], [b, c, d]]);
            }
        }
    }
    let count = x_bar.len();
    PatternMesh {
        panel_vertices: std::iter::once(0..count).collect(),
        panel_triangles: std::iter::once(0..triangles.len()).collect(),
        right_side_up: vec![true],
        edge_vertices: vec![vec![
            (0..=columns).map(|i| at(i, 0)).collect(),
            (0..=rows).map(|j| at(columns, j)).collect(),
            (0..=columns).rev().map(|i| at(i, rows)).collect(),
            (0..=rows).rev().map(|j| at(0, j)).collect(),
        ]],
        sewing: (0..count as u32).collect(),
        cloth_vertex_count: count,
        x_bar,
        triangles,
    }
}

/// The sheet with its left side sewn to its right side: a tube about the y axis.
pub(crate) fn tube(columns: usize, rows: usize, h: f64) -> PatternMesh {
    let mut mesh = sheet(columns, rows, h);
    let mut next = 0;
    for v in 0..mesh.x_bar.len() {
        let column = v % (columns + 1);
        mesh.sewing[v] = if column == columns {
            mesh.sewing[v - columns]
        } else {
            next += 1;
            next - 1
        };
    }
    mesh.cloth_vertex_count = next as usize;
    mesh
}

/// The tube's cloth vertices on a cylinder of radius `r` \[m\] about the y axis.
pub(crate) fn rolled(mesh: &PatternMesh, width: f64, r: f64) -> Vec<Vec3> {
    let flat: Vec<Vec3> = mesh
        .x_bar
        .iter()
        .map(|p| {
            let angle = std::f64::consts::TAU * p.x / width;
            Vec3::new(r * angle.sin(), p.y, r * angle.cos())
        })
        .collect();
    mesh.sew(&flat)
}
