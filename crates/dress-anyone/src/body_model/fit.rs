//! Fits a body model to any mesh, with landmarks or without (METHOD §8.2–8.4).
//!
//! Similarity and a bank of poses (`start`), then pose, shape and bone stretch by Gauss–Newton on
//! robust point-to-plane distances both ways (`pairs`, `solve`), then free-form offsets under an
//! as-rigid-as-possible regulariser (`offsets`). The offsets are taken back to the model's rest,
//! so the result can be posed at will and keeps the surface of the mesh.

mod landmarks;
mod offsets;
mod outcome;
mod pairs;
mod scan;
mod skin;
mod solve;
mod start;

use super::measure::{Measurement, measure};
use super::{BodyModel, Part, Pose, Posed, Shape};
use crate::geometry::{TriangleMesh, Vec3};
use crate::problem::Problem;
pub use landmarks::{LandmarkDistance, Landmarks};
use outcome::Limits;
pub use outcome::{Distances, Figures, PartFigures};
use rayon::prelude::*;
use scan::Scan;
use serde::Serialize;
use solve::{Freedom, Round, State, Surface};
use std::time::Instant;

/// A body model fitted to a mesh.
#[derive(Clone, Debug)]
pub struct Fit {
    /// Shape of the model.
    pub shape: Shape,
    /// The mesh's own pose and place.
    pub pose: Pose,
    /// What the model's shapes do not reach \[m, unscaled, at rest\], `[vertex]`.
    pub offsets: Vec<Vec3>,
    /// The model's surface on the mesh, where the mesh stands \[m\].
    pub mesh: TriangleMesh,
    /// The same without offsets: shape, stretch and pose alone \[m\].
    pub plain: TriangleMesh,
    /// What it was fitted to: the mesh without small components, thinned out where it was too fine.
    pub skin: TriangleMesh,
    /// How well it fits.
    pub report: FitReport,
}

/// How a fit went.
#[derive(Clone, Debug, Serialize)]
pub struct FitReport {
    /// Distances of shape, stretch and pose alone \[m\].
    pub without_offsets: Distances,
    /// Distances of the fitted surface \[m\].
    pub distances: Distances,
    /// Faces that are turned over where a garment can touch.
    pub flipped_faces: usize,
    /// How far the fitted body is from the landmarks that were given.
    pub landmarks: Vec<LandmarkDistance>,
    /// What was noticed and tolerated.
    pub notes: Vec<String>,
    /// Duration of the fit \[s\].
    pub seconds: f64,
}

/// Rounds of the fit: distance \[m\] beyond which a pair counts little, and what is free. Shape
/// comes in by its largest components first, so that it does not make up for a wrong pose.
const ROUNDS: [Round; 5] = [
    Round {
        sigma: 0.08,
        steps: 8,
        points: 800,
        shapes: 0,
        freedom: Freedom {
            pose: 3e-4,
            shape: 1.0,
            stretch: 1.0,
        },
    },
    Round {
        sigma: 0.06,
        steps: 8,
        points: 1000,
        shapes: 6,
        freedom: Freedom {
            pose: 1e-4,
            shape: 4e-6,
            stretch: 1e-4,
        },
    },
    Round {
        sigma: 0.04,
        steps: 10,
        points: 1000,
        shapes: 20,
        freedom: Freedom {
            pose: 3e-5,
            shape: 1e-6,
            stretch: 2e-5,
        },
    },
    Round {
        sigma: 0.02,
        steps: 8,
        points: 3500,
        shapes: usize::MAX,
        freedom: Freedom {
            pose: 1e-5,
            shape: 3e-7,
            stretch: 1e-5,
        },
    },
    Round {
        sigma: 0.01,
        steps: 6,
        points: 7000,
        shapes: usize::MAX,
        freedom: Freedom {
            pose: 3e-6,
            shape: 1e-7,
            stretch: 3e-6,
        },
    },
];

/// Fits `model` to `mesh` \[m\], helped by `landmarks`; or tells why the mesh is no body.
pub fn fit(
    model: &BodyModel,
    mesh: &TriangleMesh,
    landmarks: &Landmarks,
) -> Result<Fit, Vec<Problem>> {
    let clock = Instant::now();
    let mut notes = Vec::new();
    let skin = skin::outer_skin(mesh, &mut notes)?;
    let scan = Scan::new(skin, landmarks.clone());
    let mut state = pose_and_build(model, &scan);
    let whole = Surface::whole(model);
    for round in &ROUNDS[COARSE_ROUNDS..] {
        solve::refine(&whole, &scan, &mut state, round);
    }
    let parts = model.parts_of_vertices();
    let triangles = &model.parts().template.triangles;
    let posed = model.posed(&state.shape, &state.pose, &[]);
    let surface = |positions: &[Vec3]| TriangleMesh {
        positions: positions.to_vec(),
        triangles: triangles.clone(),
    };
    let plain = surface(&posed.positions);
    let without_offsets = outcome::distances(&plain, &parts, &scan);
    outcome::refuse_strangers(&without_offsets, ROUGHLY)?;

    let moved = offsets::conform(&plain, &parts, &scan);
    let offsets = at_rest(model, &posed, &moved.positions);
    let posed = model.posed(&state.shape, &state.pose, &offsets);
    let mesh = surface(&posed.positions);
    let distances = outcome::distances(&mesh, &parts, &scan);
    let from_landmarks = landmarks.distances(&posed);
    let strain = without_offsets.scan_to_fit.p95;
    notes.extend(landmarks::notes(&from_landmarks, strain));
    outcome::refuse_strangers(&distances, CLOSELY)?;
    let State { shape, pose } = state;
    Ok(Fit {
        shape,
        pose,
        offsets,
        mesh,
        plain,
        skin: scan.mesh,
        report: FitReport {
            without_offsets,
            distances,
            flipped_faces: moved.flipped,
            landmarks: from_landmarks,
            notes,
            seconds: clock.elapsed().as_secs_f64(),
        },
    })
}

/// From every start the coarse rounds; the best of what they come to. Bellies look like backs until
/// shape is free, so the way to stand is not settled before.
fn pose_and_build(model: &BodyModel, scan: &Scan) -> State {
    let coarse = Surface::coarse(model, CELL);
    let refined = |mut state: State| {
        for round in &ROUNDS[..COARSE_ROUNDS] {
            solve::refine(&coarse, scan, &mut state, round);
        }
        (coarse.misfit(scan, &state, CELL), state)
    };
    let starts = start::starts(&coarse, scan);
    let ends: Vec<(f64, State)> = starts.into_par_iter().map(refined).collect();
    let best = ends
        .into_iter()
        .reduce(|a, b| if b.0 < a.0 { b } else { a });
    best.expect("there is always a way to stand").1
}

/// How many of the rounds a coarse surface does, and its cells \[m\].
const COARSE_ROUNDS: usize = 3;
const CELL: f64 = 0.04;

/// Distances beyond which the mesh is refused: before the offsets, and with them. Offsets would wrap a body around any box; shape and stretch come within 3 mm of every
/// body tried, goblins too.
const ROUGHLY: Limits = Limits {
    part: 0.02,
    most: 0.025,
};
const CLOSELY: Limits = Limits {
    part: 0.015,
    most: 0.012,
};

/// Offsets at rest that bring the vertices of `posed` to `positions`.
fn at_rest(model: &BodyModel, posed: &Posed, positions: &[Vec3]) -> Vec<Vec3> {
    let pairs = positions.iter().zip(&posed.positions).enumerate();
    pairs
        .map(|(v, (to, from))| {
            posed
                .to_rest(model, v, to - from)
                .unwrap_or_else(Vec3::zeros)
        })
        .collect()
}

impl Fit {
    /// A tailor's measurements of the fitted surface.
    pub fn measurements(&self, model: &BodyModel) -> Vec<Measurement> {
        measure(model, &self.shape, &self.offsets)
    }

    /// The fitted surface in another pose \[m\].
    pub fn posed(&self, model: &BodyModel, pose: &Pose) -> TriangleMesh {
        TriangleMesh {
            positions: model.posed(&self.shape, pose, &self.offsets).positions,
            triangles: self.mesh.triangles.clone(),
        }
    }

    /// The fitted surface in the canonical A-pose, soles on the floor \[m\].
    pub fn a_pose(&self, model: &BodyModel) -> TriangleMesh {
        TriangleMesh {
            positions: model.a_pose(&self.shape, &self.offsets).positions,
            triangles: self.mesh.triangles.clone(),
        }
    }
}

/// How much the parts count: hands close to fists and faces under hair must not drag the rest.
fn importance(part: Part) -> f64 {
    match part {
        Part::LeftHand | Part::RightHand => 0.1,
        Part::Head | Part::LeftFoot | Part::RightFoot => 0.5,
        _ => 1.0,
    }
}

#[cfg(test)]
mod tests;
