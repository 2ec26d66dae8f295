//! Derivatives of the equilibrium by what the cloth is made of (METHOD §10): with λ = K⁻ᵀ x̂ the
//! gradient by a number θ of a fabric is λ·∂f/∂θ at fixed positions. Friction's anchors stay.

use crate::garment::Fabric;
use crate::geometry::Vec3;
use crate::sim::cloth::{Cloth, GRAVITY, Rest};
use crate::sim::energy::contact::Surface;
use crate::sim::energy::fold;
use crate::sim::energy::membrane::{self, Elasticity};
use crate::sim::system::System;

/// Gradient by the fabrics of the cloth at positions `x`, `[material]`; that by friction is the
/// [`friction_pull_back`]'s, and thickness has none.
pub fn fabric_pull_back(cloth: &Cloth, rest: &Rest, x: &[Vec3], lambda: &[Vec3]) -> Vec<Fabric> {
    let nothing = Elasticity {
        weft: 0.0,
        warp: 0.0,
        coupling: 0.0,
        shear: 0.0,
    };
    let count = cloth.materials.len();
    let (mut stretch, mut density) = (vec![nothing; count], vec![0.0; count]);
    for (e, t) in cloth.triangles.iter().enumerate() {
        let of = usize::from(cloth.material_of[e]);
        let (corners, multipliers) = (t.map(|a| x[a as usize]), t.map(|a| lambda[a as usize]));
        let element = &rest.triangles[e];
        let by = membrane::elasticity_pull_back(element, corners, multipliers);
        let sum = &mut stretch[of];
        sum.weft += by.weft;
        sum.warp += by.warp;
        sum.coupling += by.coupling;
        sum.shear += by.shear;
        let along: f64 = multipliers.iter().map(|l| l.dot(&GRAVITY)).sum();
        density[of] += element.area / 3.0 * along;
    }
    let bending = bending_pull_back(cloth, rest, x, lambda);
    let hat = |m: usize| {
        let [warp, weft, poisson, shear] = cloth.materials[m].elasticity.pull_back(&stretch[m]);
        Fabric {
            warp,
            weft,
            poisson,
            shear,
            bending: bending[m],
            density: density[m],
            thickness: 0.0,
            friction: 0.0,
        }
    };
    (0..count).map(hat).collect()
}

/// Gradient by the bending rigidities, `[material]`, through hinges and folds.
fn bending_pull_back(cloth: &Cloth, rest: &Rest, x: &[Vec3], lambda: &[Vec3]) -> Vec<f64> {
    let mut hats = vec![0.0; cloth.materials.len()];
    let hinges = cloth.hinges.iter().zip(&rest.hinges).map(|(hinge, rest)| {
        let at = hinge.vertices;
        let c = rest.curvature_vector(at.map(|a| x[a as usize]));
        let c_lambda = rest.curvature_vector(at.map(|a| lambda[a as usize]));
        (hinge, -rest.stiffness * c.dot(&c_lambda))
    });
    let folds = cloth.folds.iter().zip(&rest.folds).map(|(fold, rest)| {
        let at = fold.hinge.vertices;
        let corners = at.map(|a| x[a as usize]);
        let along: f64 = (at.iter().zip(fold::gradient(corners)))
            .map(|(a, g)| g.dot(&lambda[*a as usize]))
            .sum();
        let moment = rest.stiffness * (rest.angle - fold::angle(corners));
        (&fold.hinge, moment * along)
    });
    // λ·f is proportional to the hinge's rigidity, a mean of those on its sides.
    for (hinge, work) in hinges.chain(folds) {
        let of = hinge
            .triangles
            .map(|t| usize::from(cloth.material_of[t as usize]));
        let [a, b] = of.map(|m| cloth.materials[m].bending);
        let squared = (a + b) * (a + b);
        let per_rigidity = work / cloth.rigidity(hinge);
        hats[of[0]] += per_rigidity * 2.0 * b * b / squared;
        hats[of[1]] += per_rigidity * 2.0 * a * a / squared;
    }
    hats
}

/// Gradient by the fabrics' coefficients of friction at positions `x`, `[material]`; where one number
/// stands for all fabrics, that by it is their sum.
pub fn friction_pull_back<S: Surface>(
    system: &System<'_, S>,
    x: &[Vec3],
    lambda: &[Vec3],
) -> Vec<f64> {
    let cloth = system.cloth;
    let by_point: Vec<f64> = (system.grips.iter().zip(&cloth.contacts))
        .map(|(grip, point)| {
            let mu = system.contact.friction.or(point.friction);
            let by = grip.by_coefficient(mu, system.kappa(point), point.at(x));
            point.at(lambda).dot(&by)
        })
        .collect();
    let sum = |material: usize| -> f64 {
        let shares = cloth.friction_shares(material);
        shares.iter().zip(&by_point).map(|(s, by)| s * by).sum()
    };
    (0..cloth.materials.len()).map(sum).collect()
}
