//! A garment: pattern, sewing, fabric, and — once it has one — its drape.

mod cut;
pub mod fabrics;
mod fold;
mod summary;

use crate::geometry::{Vec2, Vec3};
use crate::pattern::{Panel, Pattern, PatternMesh, triangulate};
pub use cut::{Cut, FabricZone, cuts, unknown_panels};
pub use fold::{FoldLine, PressedFold, fold_lines};
use serde::{Deserialize, Serialize};
pub use summary::Summary;

/// A pattern, meshed and sewn, with the drape its file brought, if any.
#[derive(Clone, Debug, PartialEq)]
pub struct Garment {
    /// For messages and pictures: the file's stem.
    pub name: String,
    /// What the pattern maker drew.
    pub pattern: Pattern,
    /// The same, meshed and sewn.
    pub mesh: PatternMesh,
    /// Positions on the source body \[m\], `[cloth vertex]`; none for a pattern that only waits
    /// around the body.
    pub drape: Option<Vec<Vec3>>,
}

impl Garment {
    /// Cloth positions of the flat panels as placed around the body \[m\]; sewn vertices take the
    /// mean of their copies.
    pub fn placed(&self) -> Vec<Vec3> {
        self.moved(|_, p| p).0
    }

    /// The cloth with its panels placed and every point of each moved by `motion`, sewn \[m\]; and the rest
    /// shape that would lie so but for what leaves the panels' planes.
    pub fn moved(&self, motion: impl Fn(&Panel, Vec3) -> Vec3) -> (Vec<Vec3>, Vec<Vec2>) {
        let mut placed = vec![Vec3::zeros(); self.mesh.x_bar.len()];
        let mut flat = self.mesh.x_bar.clone();
        for (panel, range) in self.pattern.panels.iter().zip(&self.mesh.panel_vertices) {
            for v in range.clone() {
                let p = panel.placement.place(self.mesh.x_bar[v]);
                placed[v] = motion(panel, p);
                if placed[v] != p {
                    flat[v] = panel.placement.flatten(placed[v]);
                }
            }
        }
        (self.mesh.sew(&placed), flat)
    }

    /// The same pattern in a mesh of about `vertices` cloth vertices, not draped; none if it cannot be
    /// meshed so.
    pub fn remeshed(&self, vertices: usize) -> Option<Self> {
        let triangles = 0..self.mesh.triangles.len();
        let area: f64 = triangles
            .map(|t| self.mesh.rest_area(t, &self.mesh.x_bar))
            .sum();
        // Equilateral triangles, two for each vertex.
        let edge = (2.0 / 3.0_f64.sqrt() * area / vertices as f64).sqrt();
        Some(Self {
            name: self.name.clone(),
            pattern: self.pattern.clone(),
            mesh: triangulate::mesh(&self.pattern, edge).ok()?,
            drape: None,
        })
    }
}

/// What cloth is made of. On the straight grain warp runs along the y axis of a panel, weft along x.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Fabric {
    /// Tensile stiffness along the warp \[N/m\]. Higher stretches less and drapes slower.
    /// Jersey 100–500, woven 1e3–1e4. The paper gives none.
    pub warp: f64,
    /// Tensile stiffness along the weft \[N/m\].
    pub weft: f64,
    /// Coupling of warp and weft, as Poisson's ratio \[–\]; 0 to 0.5.
    pub poisson: f64,
    /// Shear stiffness \[N/m\].
    pub shear: f64,
    /// Bending rigidity \[N·m\]. 5e-6 soft, 1e-4 stiff.
    pub bending: f64,
    /// Mass per area \[kg/m²\]. 0.1 light, 0.4 heavy.
    pub density: f64,
    /// Thickness \[m\]. 1e-4 chiffon, 3e-3 fleece.
    pub thickness: f64,
    /// Coulomb's coefficient on the body \[–\]. 0.2 smooth, 0.5 rough.
    pub friction: f64,
}

impl Default for Fabric {
    /// A medium jersey-like cloth: E·h = 1000 N/m, ν = 0.3, isotropic; 200 g/m²; bending as of
    /// soft shirting (about 0.1 gf·cm²/cm).
    fn default() -> Self {
        Self {
            warp: 1000.0,
            weft: 1000.0,
            poisson: 0.3,
            shear: 1000.0 / 2.6,
            bending: 1e-5,
            density: 0.2,
            thickness: 5e-4,
            friction: 0.4,
        }
    }
}
