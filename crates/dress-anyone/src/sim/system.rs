//! The total energy U(x; x̄) of cloth on a body, its force and stiffness (METHOD §1.4: membrane,
//! bending, contact, holds, weight), assembled from the pieces of [`super::energy`].

#[cfg(test)]
pub(crate) mod fixtures;

use super::cloth::{Cloth, ContactPoint, GRAVITY, Hinge, Rest};
use super::energy::contact::{Contact, ContactParams, Surface};
use super::energy::friction::Grip;
use super::energy::layers::Pair;
use super::energy::membrane;
use crate::geometry::sparse::{BlockMatrix, Slot, Structure};
use crate::geometry::{Mat3, Vec3};
use std::cell::RefCell;
use std::sync::Arc;

/// Where each element's blocks go in the stiffness matrix; the same for every x and x̄, but for
/// the layers of cloth that touch.
#[derive(Clone, Debug)]
pub struct Assembly {
    structure: Arc<Structure>,
    /// Lower-triangle block pairs of each triangle, in the order of [`PAIRS`]`[..6]`.
    triangles: Vec<[Slot; 6]>,
    /// Lower-triangle block pairs of each hinge, in the order of [`PAIRS`].
    hinges: Vec<[Slot; 10]>,
    /// Lower-triangle block pairs of each fold, likewise.
    folds: Vec<[Slot; 10]>,
    /// Lower-triangle block pairs of each contact point's vertices, one point after the other.
    contacts: Vec<Slot>,
    vertices: Vec<Slot>,
}

/// (row, column) corners of the lower triangle of an element matrix.
const PAIRS: [(usize, usize); 10] = [
    (0, 0),
    (1, 0),
    (1, 1),
    (2, 0),
    (2, 1),
    (2, 2),
    (3, 0),
    (3, 1),
    (3, 2),
    (3, 3),
];

impl Assembly {
    /// Prepares the matrix structure of `cloth` and orders its elimination.
    pub fn new(cloth: &Cloth) -> Self {
        Self::coupling(cloth, &[])
    }

    /// The same, with room for the layers in `pairs` to touch.
    pub fn coupling(cloth: &Cloth, pairs: &[Pair]) -> Self {
        let triangles = cloth.triangles.iter().map(<[u32; 3]>::as_slice);
        let hinges = cloth.hinges.iter().map(|h| h.vertices.as_slice());
        let folds = cloth.folds.iter().map(|f| f.hinge.vertices.as_slice());
        let layers = pairs.iter().map(|p| p.vertices.as_slice());
        let elements = triangles.chain(hinges).chain(folds).chain(layers);
        let structure = Structure::new(cloth.vertex_count, elements);
        let slot = |a: u32, b: u32| structure.slot(a.max(b), a.min(b));
        let four = |h: &Hinge| {
            std::array::from_fn(|p| slot(h.vertices[PAIRS[p].0], h.vertices[PAIRS[p].1]))
        };
        Self {
            triangles: cloth
                .triangles
                .iter()
                .map(|t| std::array::from_fn(|p| slot(t[PAIRS[p].0], t[PAIRS[p].1])))
                .collect(),
            hinges: cloth.hinges.iter().map(four).collect(),
            folds: cloth.folds.iter().map(|f| four(&f.hinge)).collect(),
            contacts: (cloth.contacts.iter())
                .flat_map(|point| pairs_of(point).map(|(a, b, _)| slot(a as u32, b as u32)))
                .collect(),
            vertices: (0..cloth.vertex_count as u32).map(|v| slot(v, v)).collect(),
            structure: Arc::new(structure),
        }
    }

    /// Whether there is room for the four vertices of a pair to act on each other.
    pub fn couples(&self, pair: &Pair) -> bool {
        let v = pair.vertices;
        PAIRS.iter().all(|(i, j)| {
            v[*i] == v[*j] || self.structure.coupled(v[*i].max(v[*j]), v[*i].min(v[*j]))
        })
    }

    /// Sparsity and elimination order.
    pub fn structure(&self) -> &Structure {
        &self.structure
    }
}

/// Pairs (row, column) of a contact point's vertices in the lower triangle, with the products of their
/// weights. Vertices rise.
fn pairs_of(point: &ContactPoint) -> impl Iterator<Item = (usize, usize, f64)> + use<> {
    let point = *point;
    (point.parts()).flat_map(move |(b, u)| {
        let rows = point.parts().filter(move |(a, _)| *a >= b);
        rows.map(move |(a, v)| (a, b, u * v))
    })
}

/// Cloth with one rest shape on one body.
pub struct System<'a, S> {
    /// Topology and fabric.
    pub cloth: &'a Cloth,
    /// What follows from x̄.
    pub rest: &'a Rest,
    /// The body.
    pub surface: &'a S,
    /// How cloth meets it.
    pub contact: ContactParams,
    /// Friction of each of the cloth's contact points; none at all without friction.
    pub grips: &'a [Grip],
    /// What each contact point found last.
    found: RefCell<Vec<Found>>,
}

/// What a contact point found of the body.
#[derive(Clone, Copy)]
struct Found {
    /// Where it was \[m\].
    from: Vec3,
    /// Distance and gradient; or how far it may move from there, and still not touch \[m\].
    touch: Result<(f64, Vec3), f64>,
}

impl<'a, S: Surface> System<'a, S> {
    /// `cloth` of a `rest` shape on a body.
    pub fn new(
        cloth: &'a Cloth,
        rest: &'a Rest,
        surface: &'a S,
        contact: ContactParams,
        grips: &'a [Grip],
    ) -> Self {
        let nothing = Found {
            from: Vec3::repeat(f64::NAN),
            touch: Err(0.0),
        };
        Self {
            cloth,
            rest,
            surface,
            contact,
            grips,
            found: RefCell::new(vec![nothing; cloth.contacts.len()]),
        }
    }

    /// How contact point `i` touches the body; none where it does not. Energy, forces and stiffness at the same
    /// x look at the body once, and points that are far off only when they have come nearer.
    fn contact(&self, i: usize, x: &[Vec3]) -> Option<Contact> {
        let (point, h) = (&self.cloth.contacts[i], self.contact.thickness);
        let p = point.at(x);
        let found = &mut self.found.borrow_mut()[i];
        let knows = match found.touch {
            Ok(_) => found.from == p,
            Err(room) => (p - found.from).norm_squared() < room * room,
        };
        if !knows {
            *found = Found {
                from: p,
                touch: self.surface.distance_below(p, h),
            };
        }
        let (d, n) = found.touch.ok()?;
        let kappa = self.kappa(point);
        Some(Contact { kappa, h, p, d, n })
    }

    /// U \[J\]. `pairs` are all layers that may touch.
    pub fn energy(&self, x: &[Vec3], pairs: &[Pair]) -> f64 {
        let mut sum = 0.0;
        for pair in pairs {
            sum += pair.energy(pair.vertices.map(|a| x[a as usize]));
        }
        for (e, t) in self.cloth.triangles.iter().enumerate() {
            let (rest, d) = (&self.rest.triangles[e], &self.cloth.material(e).elasticity);
            sum += membrane::energy(rest, d, t.map(|a| x[a as usize]));
        }
        for (rest, hinge) in self.rest.hinges.iter().zip(&self.cloth.hinges) {
            sum += rest.energy(hinge.vertices.map(|a| x[a as usize]));
        }
        for (rest, fold) in self.rest.folds.iter().zip(&self.cloth.folds) {
            sum += rest.energy(fold.hinge.vertices.map(|a| x[a as usize]));
        }
        for (a, p) in x.iter().enumerate() {
            sum -= self.rest.mass[a] * GRAVITY.dot(p);
        }
        for i in 0..self.cloth.contacts.len() {
            sum += self.contact(i, x).map_or(0.0, |contact| contact.energy());
        }
        for (grip, point) in self.grips.iter().zip(&self.cloth.contacts) {
            sum += grip.energy(self.kappa(point), point.at(x));
        }
        for hold in &self.cloth.holds {
            let off = x[hold.vertex as usize].y - hold.height;
            sum += 0.5 * hold.stiffness * off * off;
        }
        for ((place, stiffness), p) in self.cloth.guide.iter().zip(x) {
            sum += 0.5 * stiffness * (p - place).norm_squared();
        }
        sum
    }

    /// f = −∂U/∂x \[N\].
    pub fn force(&self, x: &[Vec3], pairs: &[Pair]) -> Vec<Vec3> {
        let mut f: Vec<Vec3> = self.rest.mass.iter().map(|m| GRAVITY * *m).collect();
        for pair in pairs {
            let corners = pair.vertices.map(|a| x[a as usize]);
            if let Some(forces) = pair.force(corners) {
                for (a, force) in pair.vertices.iter().zip(forces) {
                    f[*a as usize] += force;
                }
            }
        }
        for (e, t) in self.cloth.triangles.iter().enumerate() {
            let (rest, d) = (&self.rest.triangles[e], &self.cloth.material(e).elasticity);
            let forces = membrane::force(rest, d, t.map(|a| x[a as usize]));
            for (a, force) in t.iter().zip(forces) {
                f[*a as usize] += force;
            }
        }
        for (rest, hinge) in self.rest.hinges.iter().zip(&self.cloth.hinges) {
            let forces = rest.force(hinge.vertices.map(|a| x[a as usize]));
            for (a, force) in hinge.vertices.iter().zip(forces) {
                f[*a as usize] += force;
            }
        }
        for (rest, fold) in self.rest.folds.iter().zip(&self.cloth.folds) {
            let at = fold.hinge.vertices;
            for (a, force) in at.iter().zip(rest.force(at.map(|a| x[a as usize]))) {
                f[*a as usize] += force;
            }
        }
        for (i, point) in self.cloth.contacts.iter().enumerate() {
            if let Some(contact) = self.contact(i, x) {
                let force = contact.force();
                for (a, weight) in point.parts() {
                    f[a] += weight * force;
                }
            }
        }
        for (grip, point) in self.grips.iter().zip(&self.cloth.contacts) {
            let force = grip.force(self.kappa(point), point.at(x));
            for (a, weight) in point.parts() {
                f[a] += weight * force;
            }
        }
        for hold in &self.cloth.holds {
            let a = hold.vertex as usize;
            f[a].y -= hold.stiffness * (x[a].y - hold.height);
        }
        for ((place, stiffness), (p, f)) in self.cloth.guide.iter().zip(x.iter().zip(&mut f)) {
            *f -= *stiffness * (p - place);
        }
        f
    }

    /// K = ∂²U/∂x² \[N/m\], with the part `exactness` of what can make an element indefinite:
    /// compressive stress and contact curvature. 1 is exact, 0 positive semi-definite. `assembly`
    /// must couple those of the `pairs` that touch.
    pub fn stiffness(
        &self,
        assembly: &Assembly,
        x: &[Vec3],
        pairs: &[Pair],
        exactness: f64,
    ) -> BlockMatrix {
        let mut k = BlockMatrix::zeros(Arc::clone(&assembly.structure));
        for pair in pairs {
            let corners = pair.vertices.map(|a| x[a as usize]);
            let Some(blocks) = pair.stiffness(corners, exactness) else {
                continue;
            };
            let v = pair.vertices;
            for (i, j) in PAIRS {
                let slot = assembly.structure.slot(v[i].max(v[j]), v[i].min(v[j]));
                if v[i] >= v[j] {
                    k.add(slot, &blocks[i][j]);
                } else {
                    k.add(slot, &blocks[i][j].transpose());
                }
            }
        }
        for (e, t) in self.cloth.triangles.iter().enumerate() {
            let corners = t.map(|a| x[a as usize]);
            let (rest, d) = (&self.rest.triangles[e], &self.cloth.material(e).elasticity);
            let blocks = membrane::stiffness(rest, d, corners, exactness);
            for (slot, (i, j)) in assembly.triangles[e].iter().zip(PAIRS) {
                if t[i] >= t[j] {
                    k.add(*slot, &blocks[i][j]);
                } else {
                    k.add(*slot, &blocks[i][j].transpose());
                }
            }
        }
        for (e, hinge) in self.cloth.hinges.iter().enumerate() {
            let rest = &self.rest.hinges[e];
            for (slot, (i, j)) in assembly.hinges[e].iter().zip(PAIRS) {
                let value = rest.stiffness * rest.k[i] * rest.k[j];
                // The two corners opposite to a seam may be one vertex (the tip of a dart).
                let twice = i != j && hinge.vertices[i] == hinge.vertices[j];
                k.add_scalar(*slot, if twice { 2.0 * value } else { value });
            }
        }
        for (e, fold) in self.cloth.folds.iter().enumerate() {
            let at = fold.hinge.vertices;
            let blocks = self.rest.folds[e].stiffness(at.map(|a| x[a as usize]), exactness);
            for (slot, (i, j)) in assembly.folds[e].iter().zip(PAIRS) {
                if at[i] >= at[j] {
                    k.add(*slot, &blocks[i][j]);
                } else {
                    k.add(*slot, &blocks[i][j].transpose());
                }
            }
        }
        let mut slots = assembly.contacts.as_slice();
        for (i, point) in self.cloth.contacts.iter().enumerate() {
            let own;
            (own, slots) = slots.split_at(pairs_of(point).count());
            let contact = self.contact(i, x);
            let pressing = contact.map(|contact| contact.stiffness(self.surface, exactness));
            let grip = |grip: &Grip| grip.stiffness(self.kappa(point), point.at(x));
            let gripping = self.grips.get(i).and_then(grip);
            let Some(block) = pressing.into_iter().chain(gripping).reduce(|a, b| a + b) else {
                continue;
            };
            // The block is symmetric, so it is its own transpose in the lower triangle.
            for (slot, (_, _, weight)) in own.iter().zip(pairs_of(point)) {
                k.add(*slot, &(weight * block));
            }
        }
        for hold in &self.cloth.holds {
            let block = Mat3::from_diagonal(&Vec3::new(0.0, hold.stiffness, 0.0));
            k.add(assembly.vertices[hold.vertex as usize], &block);
        }
        for ((_, stiffness), slot) in self.cloth.guide.iter().zip(&assembly.vertices) {
            k.add_scalar(*slot, *stiffness);
        }
        k
    }

    /// What friction adds to −∂f/∂x that has no energy, as blocks at (row vertex, column vertex)
    /// \[N/m\].
    pub fn drift(&self, x: &[Vec3]) -> Vec<(u32, u32, Mat3)> {
        let mut blocks = Vec::new();
        for (grip, point) in self.grips.iter().zip(&self.cloth.contacts) {
            let at = [self.kappa(point), self.contact.thickness];
            let mu = self.contact.friction.or(point.friction);
            if let Some(block) = grip.drift(self.surface, mu, at, point.at(x)) {
                for (a, row) in point.parts() {
                    let columns = point.parts();
                    blocks.extend(columns.map(|(b, w)| (a as u32, b as u32, row * w * block)));
                }
            }
        }
        blocks
    }

    /// ‖f‖₂ / (‖m‖₂ |g|) \[–\].
    pub fn residual(&self, force: &[Vec3]) -> f64 {
        force.iter().map(Vec3::norm_squared).sum::<f64>().sqrt() / self.rest.weight()
    }

    /// Contact stiffness of a point \[N/m\].
    pub fn kappa(&self, point: &ContactPoint) -> f64 {
        self.contact.stiffness * point.area
    }
}

#[cfg(test)]
mod tests {
    use super::fixtures::ActedOn;
    use super::*;
    use crate::body::DistanceField;
    use crate::check::{assert_derivative, noise};
    use crate::geometry::closest_point::tests::sphere;
    use crate::sim::cloth::fixtures;
    use crate::sim::energy::layers::LayerParams;
    use crate::sim::layers::Layers;
    use crate::sim::material::OrFabric;

    #[test]
    fn what_is_remembered_of_the_body_changes_no_energy_however_the_cloth_moves() {
        let mesh = fixtures::sheet(12, 12, 0.01);
        let cloth = Cloth::new(&mesh, &fixtures::SOFT);
        let rest = cloth.at_rest(&mesh.x_bar);
        let ball = DistanceField::new(&sphere(0.1, 3), 5e-3, 0.03);
        let contact = ContactParams::default();
        let system = System::new(&cloth, &rest, &ball, contact, &[]);
        let mut touching = 0;
        // Above the ball, down onto it in steps of up to 4 mm, through it, and back.
        let heights = [
            0.15, 0.12, 0.104, 0.1025, 0.102, 0.099, 0.098, 0.05, 0.0, 0.101, 0.103, 0.13,
        ];
        for (n, height) in heights.into_iter().enumerate() {
            let place = |(v, p): (usize, &crate::geometry::Vec2)| {
                let shake = Vec3::from_fn(|c, _| 1e-3 * noise(97 * n + 3 * v + c));
                Vec3::new(p.x - 0.06, height, p.y - 0.06) + shake
            };
            let x: Vec<Vec3> = mesh.x_bar.iter().enumerate().map(place).collect();
            let anew = System::new(&cloth, &rest, &ball, contact, &[]);
            assert_eq!(system.energy(&x, &[]), anew.energy(&x, &[]));
            assert_eq!(system.force(&x, &[]), anew.force(&x, &[]));
            let all = 0..cloth.contacts.len();
            touching += all.filter(|i| system.contact(*i, &x).is_some()).count();
        }
        // Some do at most of these heights, and never all of them but within the ball.
        let looks = heights.len() * cloth.contacts.len();
        assert!(
            touching > looks / 20 && touching < looks / 2,
            "{touching} of {looks}"
        );
    }

    #[test]
    fn force_and_stiffness_are_derivatives_of_the_energy() {
        let mesh = fixtures::tube(10, 4, 0.06);
        let scene = ActedOn::new(&mesh, &[3], 0.004);
        let (system, cloth, x) = (scene.system(), &scene.cloth, &scene.x);
        let d: Vec<Vec3> = (0..x.len())
            .map(|i| Vec3::from_fn(|c, _| noise(900 + 3 * i + c)))
            .collect();
        let at = |s: f64| x.iter().zip(&d).map(|(p, d)| p + d * s).collect::<Vec<_>>();
        let dot = |a: &[Vec3], b: &[Vec3]| a.iter().zip(b).map(|(a, b)| a.dot(b)).sum::<f64>();

        // Pairs of neighbours that a thickness this large lets touch, as layers would.
        let layers = LayerParams {
            thickness: OrFabric::Number(0.055),
            stiffness: 1e4,
            ..LayerParams::default()
        };
        let mut without_neighbours = cloth.clone();
        for p in &mut without_neighbours.reference {
            *p *= 3.0;
        }
        let mut layers = Layers::new(&without_neighbours, layers, x);
        let pairs = layers.pairs(x, &d.iter().map(|d| d * 1e-3).collect::<Vec<_>>(), 0.0);
        let assembly = Assembly::coupling(cloth, &pairs);
        let touching = pairs.iter().filter(|pair| {
            let corners = pair.vertices.map(|a| x[a as usize]);
            pair.energy(corners) > 0.0
        });
        assert!(touching.count() > 20);

        let slope = -dot(&system.force(x, &pairs), &d);
        assert_derivative(|s| system.energy(&at(s), &pairs), slope, 1e-6, 1e-3, 1e-6);
        let kd = system.stiffness(&assembly, x, &pairs, 1.0).multiply(&d);
        let q: Vec<Vec3> = (0..x.len())
            .map(|i| Vec3::from_fn(|c, _| noise(70 + 5 * i + c)))
            .collect();
        assert_derivative(
            |s| -dot(&system.force(&at(s), &pairs), &q),
            dot(&kd, &q),
            1e-6,
            1e-3,
            1e-6,
        );
    }
}
