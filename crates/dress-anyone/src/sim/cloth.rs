//! What the simulator knows of a garment: its topology and fabrics ([`Cloth`]), and what follows
//! from one rest shape x̄ ([`Rest`]).

mod contacts;
#[cfg(test)]
pub(crate) mod fixtures;
mod press;

use super::energy::bend::RestHinge;
use super::energy::fold::RestFold;
use super::energy::membrane::RestTriangle;
use super::material::Material;
use crate::garment::{Cut, Fabric};
use crate::geometry::{Vec2, Vec3, cross2};
use crate::pattern::PatternMesh;
pub use contacts::ContactPoint;
use contacts::contact_points;
pub use press::Fold;
use std::collections::BTreeMap;

/// Standard gravity \[m/s²\], y up.
pub const GRAVITY: Vec3 = Vec3::new(0.0, -9.81, 0.0);

/// A garment's topology and fabrics: everything that does not change while x̄ does.
#[derive(Clone, Debug)]
pub struct Cloth {
    /// Pattern vertices of each triangle, counter-clockwise at rest.
    pub rest_triangles: Vec<[u32; 3]>,
    /// Cloth vertices of the same triangles.
    pub triangles: Vec<[u32; 3]>,
    /// Interior edges of the welded mesh, but for folds.
    pub hinges: Vec<Hinge>,
    /// Those that are pressed.
    pub folds: Vec<Fold>,
    /// Cloth vertex of each pattern vertex.
    pub sewing: Vec<u32>,
    /// Number of cloth vertices.
    pub vertex_count: usize,
    /// Area of each cloth vertex in the reference pattern \[m²\]; constant, so that contact
    /// stiffness has no derivative by x̄.
    pub reference_area: Vec<f64>,
    /// Thickness of each cloth vertex \[m\]: the mean of the fabrics about it.
    pub thickness: Vec<f64>,
    /// Where the cloth feels the body.
    pub contacts: Vec<ContactPoint>,
    /// How often the grid of these points is halved in each triangle, `[triangle]`; none at all where it
    /// nowhere is.
    pub(in crate::sim) halved: Vec<u8>,
    /// What it is made of; every one once.
    pub materials: Vec<Material>,
    /// Which of them each triangle is of, `[triangle]`.
    pub material_of: Vec<u16>,
    /// Vertices kept near a height.
    pub holds: Vec<Hold>,
    /// Springs that draw every vertex towards a place: the place \[m\] and their stiffness \[N/m\]; none
    /// at all if nothing guides it. U = ½ Σ k |x − place|². Time steps do not know them.
    pub guide: Vec<(Vec3, f64)>,
    /// Cloth vertices of each triangle, right side in front.
    pub outward: Vec<[u32; 3]>,
    /// The reference pattern \[m\]: what contact of layers is measured by, constant like
    /// `reference_area`.
    pub reference: Vec<Vec2>,
}

/// An edge of the welded mesh with a triangle on either side, as two pattern-space half hinges.
#[derive(Clone, Copy, Debug)]
pub struct Hinge {
    /// Cloth vertices: the shared edge, then the opposite corners.
    pub vertices: [u32; 4],
    /// Pattern vertices (p0, p1, opposite) of each side.
    pub rest: [[u32; 3]; 2],
    /// The triangle on each side.
    pub triangles: [u32; 2],
}

/// A vertex kept near a height by a spring, as an elastic waistband or a neckline tape does:
/// U = ½ k (y − height)².
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hold {
    /// Cloth vertex.
    pub vertex: u32,
    /// \[m\].
    pub height: f64,
    /// \[N/m\].
    pub stiffness: f64,
}

impl Cloth {
    /// The same cloth, drawn `towards` a shape \[m\] at `rate` \[1/s²\].
    #[must_use]
    pub fn guided(&self, towards: Vec<Vec3>, rate: f64) -> Self {
        let masses = self.at_rest(&self.reference).mass;
        let springs = towards.into_iter().zip(masses);
        Self {
            guide: springs.map(|(end, mass)| (end, rate * mass)).collect(),
            ..self.clone()
        }
    }

    /// Prepares the meshed pattern for draping in `fabric`, every panel on the straight grain.
    pub fn new(mesh: &PatternMesh, fabric: &Fabric) -> Self {
        let cut = Cut {
            fabric: *fabric,
            grain: 0.0,
        };
        Self::cut_from(mesh, &vec![cut; mesh.panel_triangles.len()])
    }

    /// Prepares the meshed pattern for draping, its panels cut from `cuts`, `[panel]`.
    pub fn cut_from(mesh: &PatternMesh, cuts: &[Cut]) -> Self {
        let mut materials: Vec<Material> = Vec::new();
        let mut material_of = vec![0; mesh.triangles.len()];
        for (cut, triangles) in cuts.iter().zip(&mesh.panel_triangles) {
            let material = Material::from(cut);
            let found = materials.iter().position(|known| *known == material);
            let index = found.unwrap_or(materials.len());
            if found.is_none() {
                materials.push(material);
            }
            // A pattern has far fewer panels than there are numbers.
            material_of[triangles.clone()].fill(index as u16);
        }
        let triangles = mesh.cloth_triangles();
        let mut reference_area = vec![0.0; mesh.cloth_vertex_count];
        let mut thickness = vec![0.0; mesh.cloth_vertex_count];
        for (t, triangle) in triangles.iter().enumerate() {
            let material = &materials[usize::from(material_of[t])];
            for a in triangle.map(|a| a as usize) {
                let area = mesh.rest_area(t, &mesh.x_bar) / 3.0;
                reference_area[a] += area;
                thickness[a] += area * material.thickness;
            }
        }
        for (thickness, area) in thickness.iter_mut().zip(&reference_area) {
            *thickness /= area;
        }
        let friction = |t: usize| materials[usize::from(material_of[t])].friction;
        Self {
            hinges: hinges(&mesh.triangles, &triangles),
            folds: Vec::new(),
            contacts: contact_points(
                &triangles,
                |t| mesh.rest_area(t, &mesh.x_bar),
                friction,
                &[],
            ),
            halved: Vec::new(),
            thickness,
            rest_triangles: mesh.triangles.clone(),
            triangles,
            sewing: mesh.sewing.clone(),
            vertex_count: mesh.cloth_vertex_count,
            reference_area,
            materials,
            material_of,
            holds: Vec::new(),
            guide: Vec::new(),
            outward: mesh.outward_triangles(),
            reference: mesh.x_bar.clone(),
        }
    }

    /// What triangle `t` is made of.
    pub fn material(&self, t: usize) -> &Material {
        &self.materials[usize::from(self.material_of[t])]
    }

    /// Bending rigidity of a hinge \[N·m\]: across a seam of two fabrics the harmonic mean, as of springs
    /// one after the other.
    pub fn rigidity(&self, hinge: &Hinge) -> f64 {
        let [a, b] = hinge.triangles.map(|t| self.material(t as usize).bending);
        if a == b { a } else { 2.0 * a * b / (a + b) }
    }

    /// What part of each contact point's friction is that of one of the `materials`, `[contact point]`.
    pub fn friction_shares(&self, material: usize) -> Vec<f64> {
        let own = |t: usize| f64::from(usize::from(self.material_of[t]) == material);
        let points = self.points(own);
        points.into_iter().map(|point| point.friction).collect()
    }

    /// Halves the distance between the points that feel the body in some triangles.
    pub fn feel_more_closely(&mut self, triangles: impl Iterator<Item = usize>) {
        self.halved.resize(self.triangles.len(), 0);
        for t in triangles {
            self.halved[t] += 1;
        }
        self.contacts = self.points(|t| self.material(t).friction);
    }

    /// Where it feels the body, with `friction` of each triangle.
    fn points(&self, friction: impl Fn(usize) -> f64) -> Vec<ContactPoint> {
        let area = |t: usize| {
            let [a, b, c] = self.reference_corners(t);
            0.5 * cross2(b - a, c - a)
        };
        contact_points(&self.triangles, area, friction, &self.halved)
    }

    /// Corners of triangle `t` in the reference pattern \[m\].
    pub fn reference_corners(&self, t: usize) -> [Vec2; 3] {
        self.rest_triangles[t].map(|v| self.reference[v as usize])
    }

    /// The rest quantities that follow from x̄.
    pub fn at_rest(&self, x_bar: &[Vec2]) -> Rest {
        let at = |t: [u32; 3]| t.map(|v| x_bar[v as usize]);
        let triangles: Vec<_> = (self.rest_triangles.iter().enumerate())
            .map(|(t, corners)| RestTriangle::new(self.material(t).on_grain(at(*corners))))
            .collect();
        let hinges = self
            .hinges
            .iter()
            .map(|hinge| RestHinge::new(hinge.rest.map(at), self.rigidity(hinge)))
            .collect();
        let fold = |fold: &Fold| {
            let rigidity = fold.firmness * self.rigidity(&fold.hinge);
            RestFold::new(fold.hinge.rest.map(at), rigidity, fold.angle)
        };
        let mut mass = vec![0.0; self.vertex_count];
        for (t, (rest, triangle)) in triangles.iter().zip(&self.triangles).enumerate() {
            for &a in triangle {
                mass[a as usize] += self.material(t).density * rest.area / 3.0;
            }
        }
        Rest {
            triangles,
            hinges,
            folds: self.folds.iter().map(fold).collect(),
            mass,
        }
    }
}

/// What follows from one rest shape x̄.
#[derive(Clone, Debug)]
pub struct Rest {
    /// `[triangle]`.
    pub triangles: Vec<RestTriangle>,
    /// `[hinge]`.
    pub hinges: Vec<RestHinge>,
    /// `[fold]`.
    pub folds: Vec<RestFold>,
    /// Lumped mass \[kg\], `[cloth vertex]`.
    pub mass: Vec<f64>,
}

impl Rest {
    /// ‖m‖₂ |g| \[N\]: what force residuals are relative to.
    pub fn weight(&self) -> f64 {
        self.mass.iter().map(|m| m * m).sum::<f64>().sqrt() * GRAVITY.norm()
    }
}

/// The interior edges of the welded mesh; an edge of more than two triangles gets one hinge per
/// consecutive pair.
fn hinges(rest: &[[u32; 3]], welded: &[[u32; 3]]) -> Vec<Hinge> {
    let mut sides: BTreeMap<(u32, u32), Vec<(usize, usize)>> = BTreeMap::new();
    for (t, triangle) in welded.iter().enumerate() {
        for corner in 0..3 {
            let (a, b) = (triangle[corner], triangle[(corner + 1) % 3]);
            sides
                .entry((a.min(b), a.max(b)))
                .or_default()
                .push((t, corner));
        }
    }
    // (p0, p1, opposite) of the side whose edge starts at `corner`, run from cloth vertex `first`.
    let side = |(t, corner): (usize, usize), first: u32| {
        let [a, b, c] = [0, 1, 2].map(|i| rest[t][(corner + i) % 3]);
        if welded[t][corner] == first {
            [a, b, c]
        } else {
            [b, a, c]
        }
    };
    let opposite = |(t, corner): (usize, usize)| welded[t][(corner + 2) % 3];
    let mut hinges = Vec::new();
    for ((x0, x1), at) in sides {
        for pair in at.windows(2) {
            hinges.push(Hinge {
                vertices: [x0, x1, opposite(pair[0]), opposite(pair[1])],
                rest: [side(pair[0], x0), side(pair[1], x0)],
                triangles: [pair[0].0 as u32, pair[1].0 as u32],
            });
        }
    }
    hinges
}

#[cfg(test)]
mod tests {
    use super::*;
    use approx::assert_relative_eq;

    #[test]
    fn seams_have_hinges_and_hems_have_none() {
        let (columns, rows) = (8, 3);
        let cloth = Cloth::new(&fixtures::tube(columns, rows, 0.1), &Fabric::default());
        // 3F = 2E + B over all edges, B the two rims.
        let edges = usize::midpoint(3 * cloth.triangles.len(), 2 * columns);
        assert_eq!(cloth.hinges.len(), edges - 2 * columns);
    }

    #[test]
    fn panels_have_the_mass_of_their_fabrics_and_seams_a_mean_of_their_bending() {
        let mut mesh = fixtures::tube(4, 3, 0.1);
        let half = mesh.triangles.len() / 2;
        mesh.panel_triangles = vec![0..half, half..2 * half];
        let light = Fabric {
            bending: 1e-5,
            density: 0.1,
            ..Fabric::default()
        };
        let heavy = Fabric {
            bending: 3e-5,
            density: 0.4,
            ..Fabric::default()
        };
        let cuts = [light, heavy, light].map(|fabric| Cut { fabric, grain: 0.0 });
        let cloth = Cloth::cut_from(&mesh, &cuts[..2]);
        let mass: f64 = cloth.at_rest(&mesh.x_bar).mass.iter().sum();
        // Half of 0.4 × 0.3 m of each.
        assert_relative_eq!(mass, 0.06 * (0.1 + 0.4), max_relative = 1e-12);
        let mut found: Vec<f64> = cloth.hinges.iter().map(|h| cloth.rigidity(h)).collect();
        found.sort_by(f64::total_cmp);
        found.dedup();
        // Alone, 1/(½/1 + ½/3) across the seam, alone.
        assert_relative_eq!(&found[..], &[1e-5, 1.5e-5, 3e-5][..], max_relative = 1e-12);
        // Panels of one fabric share one material.
        let same = Cloth::cut_from(&mesh, &[cuts[0], cuts[2]]);
        assert_eq!(same.materials.len(), 1);
    }

    #[test]
    fn a_panel_cut_at_an_angle_is_the_turned_panel_on_the_straight_grain() {
        let mesh = fixtures::sheet(4, 4, 0.1);
        let (sin, cos) = 0.5_f64.sin_cos();
        let turned = |p: &Vec2| Vec2::new(cos * p.x + sin * p.y, cos * p.y - sin * p.x);
        let mut straight = mesh.clone();
        straight.x_bar = mesh.x_bar.iter().map(turned).collect();
        // The turned panel has its warp where the other has it half a radian to the left.
        let cut = Cut {
            fabric: fixtures::SOFT,
            grain: 0.5_f64.to_degrees(),
        };
        let at_angle = Cloth::cut_from(&mesh, &[cut]).at_rest(&mesh.x_bar);
        let on_grain = Cloth::new(&straight, &fixtures::SOFT).at_rest(&straight.x_bar);
        for (a, b) in at_angle.triangles.iter().zip(&on_grain.triangles) {
            assert_relative_eq!(a.inverse, b.inverse, max_relative = 1e-12, epsilon = 1e-12);
        }
    }

    #[test]
    fn a_flat_panel_has_no_curvature_anywhere() {
        let mesh = fixtures::sheet(4, 4, 0.1);
        let cloth = Cloth::new(&mesh, &Fabric::default());
        let rest = cloth.at_rest(&mesh.x_bar);
        for (hinge, at_rest) in cloth.hinges.iter().zip(&rest.hinges) {
            let x = hinge.vertices.map(|a| {
                let p = mesh.x_bar[a as usize];
                Vec3::new(p.x, p.y, 0.0)
            });
            // Round-off of decimetres.
            assert!(at_rest.curvature_vector(x).norm() < 1e-15);
        }
        assert_relative_eq!(
            rest.mass.iter().sum::<f64>(),
            0.2 * 0.16,
            max_relative = 1e-12
        );
    }
}
