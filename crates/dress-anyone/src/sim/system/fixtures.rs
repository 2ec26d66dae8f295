//! Cloth on which everything acts but layers, for tests of forces.

use super::System;
use crate::check::noise;
use crate::geometry::Vec3;
use crate::pattern::PatternMesh;
use crate::sim::cloth::{Cloth, Hold, Rest, fixtures};
use crate::sim::energy::contact::ContactParams;
use crate::sim::energy::contact::fixtures::Cone;
use crate::sim::energy::friction::Grip;
use crate::sim::material::OrFabric;

/// A tube of two fabrics with a pressed seam, held, guided, and rubbing on a leaning cone.
pub(crate) struct ActedOn {
    pub cloth: Cloth,
    pub x: Vec<Vec3>,
    pub rest: Rest,
    surface: Cone,
    contact: ContactParams,
    grips: Vec<Grip>,
}

impl ActedOn {
    /// With these vertices `held`, and all crumpled by so much \[m\] since it began to touch.
    pub(crate) fn new(mesh: &PatternMesh, held: &[u32], crumpled: f64) -> Self {
        let mut cloth = fixtures::creased(mesh);
        let hold = |vertex: &u32| Hold {
            vertex: *vertex,
            height: 0.1,
            stiffness: 40.0,
        };
        cloth.holds.extend(held.iter().map(hold));
        let cloth = cloth.guided(fixtures::rolled(mesh, 0.61, 0.09), 1e4);
        let surface = Cone {
            radius: 0.09,
            slope: 0.2,
            flat: 1.1,
            lean: 0.2,
        };
        let contact = ContactParams {
            thickness: 0.02,
            stiffness: 1e4,
            friction: OrFabric::Number(0.0),
        };
        let mut x = fixtures::rolled(mesh, 0.6, 0.092);
        let mut grips = vec![Grip::default(); cloth.contacts.len()];
        for (grip, point) in grips.iter_mut().zip(&cloth.contacts) {
            grip.look(&surface, 0.3, [1e4 * point.area, 0.02], point.at(&x));
        }
        for (i, p) in x.iter_mut().enumerate() {
            *p += Vec3::from_fn(|c, _| crumpled * noise(3 * i + c));
        }
        Self {
            rest: cloth.at_rest(&mesh.x_bar),
            cloth,
            x,
            surface,
            contact,
            grips,
        }
    }

    pub(crate) fn system(&self) -> System<'_, Cone> {
        System::new(
            &self.cloth,
            &self.rest,
            &self.surface,
            self.contact,
            &self.grips,
        )
    }
}
