//! A drape with what its derivatives need: polished, its saddles left, its exact stiffness factored.

use super::adjoint::{self, body, fabric};
use super::cloth::Cloth;
use super::drape::{Drape, Scene, system};
use super::energy::contact::Surface;
use super::energy::friction::Grip;
use super::equilibrium::{EquilibriumParams, RestStatus, Touch};
use super::layers::Layers;
use super::system::System;
use crate::body::DistanceField;
use crate::garment::Fabric;
use crate::geometry::sparse::{Factor, GeneralFactor};
use crate::geometry::{TriangleMesh, Vec2, Vec3};

/// A polished drape with the factor of its exact stiffness: what can be differentiated.
pub struct Differentiable<'a> {
    cloth: &'a Cloth,
    /// The polished state.
    pub drape: Drape,
    factor: Stiffness,
    /// σ \[1/s²\] that had to be added to make the stiffness definite; 0 at a proper minimum.
    pub shift: f64,
}

/// The exact stiffness, factored.
enum Stiffness {
    /// Without friction it is symmetric.
    Symmetric(Factor),
    /// What slips makes it general.
    General(Box<GeneralFactor>),
}

/// First shift tried when the stiffness at rest is indefinite \[1/s²\]; small beside the softest
/// modes of a garment (a pendulum of 1 m has g/l ≈ 10).
const FIRST_SHIFT: f64 = 1e-3;

/// Predicted moves of the cloth beyond this are not trusted as a start \[m\].
const FARTHEST_PREDICTION: f64 = 0.03;
/// Residual above which indefinite stiffness tells of no saddle, for the state is not at rest \[–\].
const SADDLE_BELOW: f64 = 1e-3;
/// Kicks off saddles before the stiffness is shifted instead.
const KICKS: usize = 3;
/// Farthest any vertex moves in a kick \[m\].
const KICK: f64 = 1e-3;

impl Drape {
    /// Polishes the state and factors its exact stiffness. A state whose stiffness is indefinite is
    /// a saddle: it is left along its softest mode, and settles anew. Where that does not help the
    /// stiffness is shifted just as far as needed, and [`Differentiable::shift`] says so.
    pub fn differentiable<'a, S: Surface>(
        mut self,
        scene: &Scene<'a, S>,
    ) -> Option<Differentiable<'a>> {
        let params = &scene.params.equilibrium;
        let polish = EquilibriumParams {
            iterations: 40,
            tolerance: params.polished,
            ..*params
        };
        let mut sigma = 0.0;
        let mut kicks = 0;
        let assembly = scene.assembly.clone();
        let mut touch = Touch::at(scene.cloth, &mut self.layers, &self.x, assembly);
        let (factor, shift) = loop {
            touch = self.settle(scene, touch, sigma, &polish, &mut |_, _, _| true);
            let system = system(scene, &self.rest, &self.grips);
            let (factor, shift) = shifted_factor(&system, &touch, &self.x)?;
            if shift == 0.0 || kicks == KICKS || self.residual > SADDLE_BELOW {
                break (exact(&system, &touch, &self.x, factor, shift)?, shift);
            }
            kicks += 1;
            sigma = shift;
            let mut kick = softest_mode(&system, &factor);
            for d in &mut kick {
                *d *= KICK;
            }
            self.layers.hold_apart(&self.x, &mut kick);
            for (x, d) in self.x.iter_mut().zip(kick) {
                *x += d;
            }
            touch = Touch::at(scene.cloth, &mut self.layers, &self.x, touch.assembly);
        };
        Some(Differentiable {
            cloth: scene.cloth,
            drape: self,
            factor,
            shift,
        })
    }
}

/// The exact stiffness factored at positions that are at rest, whatever way led there; none if no
/// shift makes it definite.
pub fn differentiable_at<'a, S: Surface>(
    scene: &Scene<'a, S>,
    x_bar: &[Vec2],
    x: Vec<Vec3>,
    grips: Vec<Grip>,
) -> Option<Differentiable<'a>> {
    let rest = scene.cloth.at_rest(x_bar);
    let mut layers = Layers::new(scene.cloth, scene.params.layers, &x);
    let touch = Touch::at(scene.cloth, &mut layers, &x, scene.assembly.clone());
    let system = system(scene, &rest, &grips);
    let residual = system.residual(&system.force(&x, &touch.pairs));
    let (factor, shift) = shifted_factor(&system, &touch, &x)?;
    let factor = exact(&system, &touch, &x, factor, shift)?;
    let drape = Drape {
        x,
        x_bar: x_bar.to_vec(),
        residual,
        iterations: 0,
        status: RestStatus::AtRest,
        friction: scene.params.contact.friction,
        broken: None,
        rest,
        layers,
        grips,
    };
    Some(Differentiable {
        cloth: scene.cloth,
        drape,
        factor,
        shift,
    })
}

/// The factor of the exact stiffness: `factor`, unless there is friction.
fn exact<S: Surface>(
    system: &System<'_, S>,
    touch: &Touch,
    x: &[Vec3],
    factor: Factor,
    shift: f64,
) -> Option<Stiffness> {
    if system.grips.is_empty() {
        return Some(Stiffness::Symmetric(factor));
    }
    let mut k = system.stiffness(&touch.assembly, x, &touch.pairs, 1.0);
    k.add_diagonal(shift, &system.rest.mass);
    let general = GeneralFactor::new(&k, &system.drift(x))?;
    Some(Stiffness::General(Box::new(general)))
}

/// Factor of K + σM with the smallest σ tried that makes it definite, and σ \[1/s²\].
fn shifted_factor<S: Surface>(
    system: &System<'_, S>,
    touch: &Touch,
    x: &[Vec3],
) -> Option<(Factor, f64)> {
    let mut shift = 0.0;
    loop {
        let mut k = system.stiffness(&touch.assembly, x, &touch.pairs, 1.0);
        k.add_diagonal(shift, &system.rest.mass);
        if let Some(factor) = k.factor() {
            return Some((factor, shift));
        }
        shift = if shift == 0.0 {
            FIRST_SHIFT
        } else {
            10.0 * shift
        };
        if !(shift < 1e9) {
            return None;
        }
    }
}

/// The mode to which the shifted stiffness gives way most, by inverse iteration from unstructured
/// forces; its farthest vertex moves by 1.
fn softest_mode<S: Surface>(system: &System<'_, S>, factor: &Factor) -> Vec<Vec3> {
    let unstructured = |i: usize| ((i as f64 + 1.0).sin() * 43_758.545_3).fract();
    let vertices = 0..system.cloth.vertex_count;
    let mut mode: Vec<Vec3> = vertices
        .map(|a| Vec3::from_fn(|c, _| unstructured(3 * a + c)))
        .collect();
    for _ in 0..8 {
        let forces: Vec<Vec3> = mode
            .iter()
            .zip(&system.rest.mass)
            .map(|(d, m)| d * *m)
            .collect();
        mode = factor.solve(&forces);
        let farthest = mode.iter().map(Vec3::norm).fold(0.0, f64::max);
        for d in &mut mode {
            *d /= farthest;
        }
    }
    mode
}

impl Differentiable<'_> {
    /// x̄̂ = (∂x/∂x̄)ᵀ x̂, and the adjoint λ = K⁻ᵀ x̂ it comes from.
    pub fn pull_back(&self, x_hat: &[Vec3]) -> (Vec<Vec2>, Vec<Vec3>) {
        let lambda = match &self.factor {
            Stiffness::Symmetric(factor) => factor.solve(x_hat),
            Stiffness::General(factor) => factor.solve_transposed(x_hat),
        };
        let drape = &self.drape;
        let hat = adjoint::rest_pull_back(self.cloth, &drape.rest, &drape.x_bar, &drape.x, &lambda);
        (hat, lambda)
    }

    /// Gradient by the numbers of each of the cloth's materials, in the shape of a fabric, from the adjoint λ
    /// of [`Self::pull_back`]; `scene` is the one that was draped in. Where one coefficient of friction is
    /// told for all fabrics, the gradient by it is the sum of theirs; thickness has none.
    pub fn by_fabrics<S: Surface>(&self, scene: &Scene<'_, S>, lambda: &[Vec3]) -> Vec<Fabric> {
        let Drape { rest, x, grips, .. } = &self.drape;
        let mut hats = fabric::fabric_pull_back(self.cloth, rest, x, lambda);
        let by_friction = fabric::friction_pull_back(&system(scene, rest, grips), x, lambda);
        for (hat, friction) in hats.iter_mut().zip(by_friction) {
            hat.friction = friction;
        }
        hats
    }

    /// Gradient by the vertices of `body`, the mesh of the scene's field, from the adjoint λ of
    /// [`Self::pull_back`].
    pub fn by_body(
        &self,
        scene: &Scene<'_, DistanceField>,
        body: &TriangleMesh,
        lambda: &[Vec3],
    ) -> Vec<Vec3> {
        let Drape { rest, x, grips, .. } = &self.drape;
        body::body_pull_back(&system(scene, rest, grips), body, x, lambda)
    }

    /// ∂x along each motion of the rest shape, `[motion][vertex]` flattened to x, y, z.
    pub fn sensitivities(&self, motions: impl Iterator<Item = Vec<Vec2>>) -> Vec<f64> {
        let drape = &self.drape;
        let push = |motion: Vec<Vec2>| {
            adjoint::rest_push_forward(self.cloth, &drape.rest, &drape.x_bar, &drape.x, &motion)
        };
        let mut columns: Vec<f64> = motions
            .flat_map(push)
            .flat_map(|f| [f.x, f.y, f.z])
            .collect();
        match &self.factor {
            Stiffness::Symmetric(factor) => factor.solve_columns(&mut columns),
            Stiffness::General(factor) => factor.solve_columns(&mut columns),
        }
        columns
    }

    /// Where the cloth goes \[m\] to first order and through nothing as the rest shape moves by `motion` \[m\],
    /// `[pattern vertex]`: a drape does not feel what goes through itself where it starts. None where that is too far
    /// to be believed.
    pub fn predicted(&self, motion: Vec<Vec2>) -> Option<Vec<Vec3>> {
        let moves = self.sensitivities(std::iter::once(motion));
        let moves = moves.chunks_exact(3).map(Vec3::from_column_slice);
        let mut moves: Vec<Vec3> = moves.collect();
        if moves.iter().any(|d| !(d.norm() < FARTHEST_PREDICTION)) {
            return None;
        }
        let x = &self.drape.x;
        self.drape.layers.clone().hold_apart(x, &mut moves);
        Some(x.iter().zip(moves).map(|(p, d)| p + d).collect())
    }

    /// Friction of each contact point; none without friction.
    pub fn grips(&self) -> &[Grip] {
        &self.drape.grips
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::garment::Fabric;
    use crate::geometry::intersections;
    use crate::sim::cloth::fixtures;
    use crate::sim::energy::contact::Nothing;
    use crate::sim::{Assembly, SimParams};

    #[test]
    fn what_is_predicted_goes_through_nothing_and_not_too_far() {
        // A sheet that stands 3 mm above one that lies, both of 12 cm and in soft springs.
        let one = fixtures::sheet(6, 6, 0.02);
        let (mesh, count) = (fixtures::twice(&one), one.x_bar.len());
        let place = |i: usize| {
            let p = one.x_bar[i % count];
            if i < count {
                Vec3::new(p.x, 0.0, p.y)
            } else {
                Vec3::new(p.x, p.y + 3e-3, 0.053)
            }
        };
        let x: Vec<Vec3> = (0..2 * count).map(place).collect();
        let cloth = Cloth::new(&mesh, &Fabric::default()).guided(x.clone(), 100.0);
        let (assembly, params) = (Assembly::new(&cloth), SimParams::default());
        let scene = Scene {
            cloth: &cloth,
            assembly: &assembly,
            surface: &Nothing,
            params: &params,
        };
        let state = differentiable_at(&scene, &mesh.x_bar, x.clone(), Vec::new());
        let state = state.expect("springs hold it");
        let told = [0.002, 0.02, 0.5].map(|growth| {
            // About its middle, which lies still.
            let grown = |(i, p): (usize, &Vec2)| {
                let part = if i < count { 0.0 } else { growth };
                (p - Vec2::repeat(0.06)) * part
            };
            let motion: Vec<Vec2> = mesh.x_bar.iter().enumerate().map(grown).collect();
            let moves = state.sensitivities(std::iter::once(motion.clone()));
            let moves = moves.chunks_exact(3).map(Vec3::from_column_slice);
            let linear: Vec<Vec3> = x.iter().zip(moves).map(|(x, d)| x + d).collect();
            let meets = |x: &[Vec3]| !intersections::within(x, &cloth.triangles).is_empty();
            let predicted = state.predicted(motion);
            let as_linear = predicted.as_ref().map(|x| *x == linear);
            (
                meets(&linear),
                as_linear,
                predicted.is_some_and(|x| meets(&x)),
            )
        });
        let (short, through, far) = (
            (false, Some(true), false),
            (true, Some(false), false),
            (true, None, false),
        );
        assert_eq!(told, [short, through, far]);
    }
}
