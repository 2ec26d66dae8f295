//! A patch: the cloth about some of its vertices, cut out to settle by itself while the rest keeps still.
//!
//! What keeps a static solve long is folds that form one after the other, in one place each, while every step
//! factors the whole cloth: from the tenth step on, 10 to 230 of a T-shirt's 10,351 vertices have forces above a tenth
//! of the largest. So what a step leaves of large forces is settled first, and then the whole again: nonlinear
//! elimination (Lanzkron, Rose & Wilkes 1996; Cai & Keyes 2002).

use crate::geometry::Vec3;
use crate::sim::cloth::{Cloth, Fold, Hinge, Hold, Rest};
use crate::sim::energy::contact::Surface;
use crate::sim::energy::friction::Grip;
use crate::sim::energy::layers::Pair;
use crate::sim::system::System;

/// Cloth cut out of a larger one, with all that acts on the vertices that are free.
pub(super) struct Patch {
    /// Vertex of the larger cloth, `[vertex]`.
    pub vertices: Vec<u32>,
    /// Its rim drawn to where it is by stiff springs.
    pub cloth: Cloth,
    /// Its rim without mass.
    pub rest: Rest,
    /// `[contact point]`, or none.
    pub grips: Vec<Grip>,
    /// Whether a vertex may move, `[vertex]`.
    pub free: Vec<bool>,
}

/// Stiffness of the springs at the rim \[N/m\]: cloth that weighs newtons moves them by less than round-off.
const RIM: f64 = 1e9;
/// Vertices with this part of the largest force are where it is large.
const LARGE: f64 = 0.1;
/// Rings of triangles around them that are free as well.
const RINGS: usize = 4;
/// Largest part of the cloth that is cut out.
const LARGEST: f64 = 0.25;
/// Smallest cloth that anything is cut out of \[vertices\]: less factors as fast.
const SMALLEST: usize = 2000;

impl Patch {
    /// The surroundings of the vertices with large forces `f` at `x`; none if these are not a small
    /// part of the cloth, or it has few vertices anyhow.
    pub(super) fn about<S>(
        system: &System<'_, S>,
        pairs: &[Pair],
        x: &[Vec3],
        f: &[Vec3],
    ) -> Option<Self> {
        if x.len() < SMALLEST {
            return None;
        }
        let largest = f.iter().map(Vec3::norm).fold(0.0, f64::max);
        let mut free: Vec<bool> = f.iter().map(|f| f.norm() > LARGE * largest).collect();
        for _ in 0..RINGS {
            free = grown(&free, system.cloth);
        }
        let count = free.iter().filter(|free| **free).count();
        if count as f64 > LARGEST * x.len() as f64 {
            return None;
        }
        let mut inside = grown(&free, system.cloth);
        let mut take = |vertices: &[u32]| {
            if vertices.iter().any(|v| free[*v as usize]) {
                for v in vertices {
                    inside[*v as usize] = true;
                }
            }
        };
        for hinge in &system.cloth.hinges {
            take(&hinge.vertices);
        }
        for fold in &system.cloth.folds {
            take(&fold.hinge.vertices);
        }
        for pair in pairs {
            take(&pair.vertices);
        }
        Some(Self::of(system, x, &free, &inside))
    }

    /// The vertices `inside` with what acts on those that are `free`; the others are kept at `x`.
    fn of<S>(system: &System<'_, S>, x: &[Vec3], free: &[bool], inside: &[bool]) -> Self {
        let whole = system.cloth;
        let vertices: Vec<u32> = chosen(inside.len(), |v| inside[v])
            .map(|v| v as u32)
            .collect();
        let mut number = vec![u32::MAX; inside.len()];
        for (new, old) in vertices.iter().enumerate() {
            number[*old as usize] = new as u32;
        }
        // All triangles between them: what is free must not pass through what is not.
        let within = |piece: &[u32]| piece.iter().all(|v| inside[*v as usize]);
        let acts = |piece: &[u32]| piece.iter().any(|v| free[*v as usize]);
        let triangles: Vec<usize> =
            chosen(whole.triangles.len(), |t| within(&whole.triangles[t])).collect();
        let hinges: Vec<usize> =
            chosen(whole.hinges.len(), |h| acts(&whole.hinges[h].vertices)).collect();
        let folds: Vec<usize> =
            chosen(whole.folds.len(), |f| acts(&whole.folds[f].hinge.vertices)).collect();
        let points: Vec<usize> = chosen(whole.contacts.len(), |p| {
            whole.contacts[p].parts().any(|(v, _)| free[v])
        })
        .collect();
        let hinge = |hinge: &Hinge| Hinge {
            vertices: hinge.vertices.map(|v| number[v as usize]),
            ..*hinge
        };
        let fold = |fold: &Fold| Fold {
            hinge: hinge(&fold.hinge),
            ..*fold
        };
        let hold = |hold: &Hold| Hold {
            vertex: number[hold.vertex as usize],
            ..*hold
        };
        let triangle = |corners: &[u32; 3]| corners.map(|v| number[v as usize]);
        let spring = |v: &u32| {
            let v = *v as usize;
            let own = whole.guide.get(v).copied().unwrap_or((x[v], 0.0));
            if free[v] { own } else { (x[v], RIM) }
        };
        let cloth = Cloth {
            rest_triangles: of(&triangles, &whole.rest_triangles),
            triangles: triangles
                .iter()
                .map(|t| triangle(&whole.triangles[*t]))
                .collect(),
            hinges: hinges.iter().map(|h| hinge(&whole.hinges[*h])).collect(),
            folds: folds.iter().map(|f| fold(&whole.folds[*f])).collect(),
            sewing: whole.sewing.clone(),
            vertex_count: vertices.len(),
            reference_area: at(&vertices, &whole.reference_area),
            thickness: at(&vertices, &whole.thickness),
            contacts: points
                .iter()
                .map(|p| whole.contacts[*p].renumbered(&number))
                .collect(),
            halved: Vec::new(),
            materials: whole.materials.clone(),
            material_of: of(&triangles, &whole.material_of),
            holds: (whole.holds.iter().filter(|h| free[h.vertex as usize]))
                .map(hold)
                .collect(),
            guide: vertices.iter().map(spring).collect(),
            outward: triangles
                .iter()
                .map(|t| triangle(&whole.outward[*t]))
                .collect(),
            reference: whole.reference.clone(),
        };
        let mass = |v: &u32| {
            let v = *v as usize;
            if free[v] { system.rest.mass[v] } else { 0.0 }
        };
        let rest = Rest {
            triangles: of(&triangles, &system.rest.triangles),
            hinges: of(&hinges, &system.rest.hinges),
            folds: of(&folds, &system.rest.folds),
            mass: vertices.iter().map(mass).collect(),
        };
        Self {
            cloth,
            rest,
            grips: if system.grips.is_empty() {
                Vec::new()
            } else {
                of(&points, system.grips)
            },
            free: vertices.iter().map(|v| free[*v as usize]).collect(),
            vertices,
        }
    }

    /// What of the larger cloth's `x` is its own.
    pub(super) fn cut(&self, x: &[Vec3]) -> Vec<Vec3> {
        at(&self.vertices, x)
    }

    /// The move from `x` of the larger cloth that takes the free vertices to `own`.
    pub(super) fn moves(&self, x: &[Vec3], own: &[Vec3]) -> Vec<Vec3> {
        let mut moves = vec![Vec3::zeros(); x.len()];
        for ((v, free), to) in self.vertices.iter().zip(&self.free).zip(own) {
            if *free {
                moves[*v as usize] = to - x[*v as usize];
            }
        }
        moves
    }

    /// Its system.
    pub(super) fn system<'a, S: Surface>(&'a self, whole: &System<'a, S>) -> System<'a, S> {
        System::new(
            &self.cloth,
            &self.rest,
            whole.surface,
            whole.contact,
            &self.grips,
        )
    }
}

/// The numbers below `count` that are wanted.
fn chosen(count: usize, wanted: impl Fn(usize) -> bool) -> impl Iterator<Item = usize> {
    (0..count).filter(move |i| wanted(*i))
}

/// Those with these numbers.
fn of<T: Clone>(numbers: &[usize], all: &[T]) -> Vec<T> {
    numbers.iter().map(|i| all[*i].clone()).collect()
}

/// Those of these vertices.
fn at<T: Clone>(vertices: &[u32], all: &[T]) -> Vec<T> {
    vertices.iter().map(|v| all[*v as usize].clone()).collect()
}

/// What is marked and all that shares a triangle with it.
fn grown(marked: &[bool], cloth: &Cloth) -> Vec<bool> {
    let mut grown = marked.to_vec();
    for t in &cloth.triangles {
        if t.iter().any(|v| marked[*v as usize]) {
            for v in t {
                grown[*v as usize] = true;
            }
        }
    }
    grown
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::cloth::fixtures;
    use crate::sim::energy::layers::LayerParams;
    use crate::sim::layers::Layers;
    use crate::sim::material::OrFabric;
    use crate::sim::system::fixtures::ActedOn;
    use approx::assert_relative_eq;

    #[test]
    fn forces_on_free_vertices_are_those_of_the_whole_and_the_rim_keeps_still() {
        let mesh = fixtures::tube(70, 30, 0.01);
        let scene = ActedOn::new(&mesh, &[700, 705], 5e-4);
        let (system, x) = (scene.system(), &scene.x);
        // Neighbours farther along the mesh than twice 6 mm touch, as layers would.
        let layers = LayerParams {
            thickness: OrFabric::Number(0.006),
            ..LayerParams::default()
        };
        let still = vec![Vec3::zeros(); x.len()];
        let pairs = Layers::new(&scene.cloth, layers, x).pairs(x, &still, 0.0);

        let mut large = still.clone();
        large[703] = Vec3::x();
        let patch = Patch::about(&system, &pairs, x, &large).expect("a small part");
        let own = patch.cut(x);
        let small = patch.system(&system);
        let pairs_inside = Layers::new(&patch.cloth, layers, &own).pairs(
            &own,
            &vec![Vec3::zeros(); own.len()],
            0.0,
        );
        let (whole, part) = (system.force(x, &pairs), small.force(&own, &pairs_inside));
        let free = || (0..own.len()).filter(|v| patch.free[*v]);
        assert!((30..200).contains(&free().count()), "{}", free().count());
        for v in free() {
            assert_relative_eq!(part[v], whole[patch.vertices[v] as usize], epsilon = 1e-12);
        }
        let moves = patch.moves(x, &own.iter().map(|p| p + Vec3::y()).collect::<Vec<_>>());
        for (v, old) in patch.vertices.iter().enumerate() {
            let expected = if patch.free[v] {
                Vec3::y()
            } else {
                Vec3::zeros()
            };
            assert_relative_eq!(moves[*old as usize], expected, epsilon = 1e-12);
            assert!(patch.free[v] || patch.cloth.guide[v] == (own[v], RIM));
        }
        // What is large all over is no patch.
        large.fill(Vec3::x());
        assert!(Patch::about(&system, &pairs, x, &large).is_none());
    }
}
