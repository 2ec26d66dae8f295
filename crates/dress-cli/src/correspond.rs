//! The bodies of a refit made to correspond: as they are where they do, else by the body model.

use crate::arguments::fitting::CorrespondArguments;
use crate::body::{landmarks, model};
use crate::failure::Failure;
use crate::progress::Progress;
use dress_anyone::body::Body;
use dress_anyone::body_model::alike::{Alike, make_alike, stand_alike};
use dress_anyone::body_model::fit::FitReport;
use dress_anyone::geometry::TriangleMesh;
use dress_anyone::problem::BadInput;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// Two bodies that correspond.
pub struct Corresponding {
    /// As the garment's source drape has it.
    pub source: Body,
    /// In the source's pose.
    pub target: Body,
    /// The target in its own pose.
    pub target_own: TriangleMesh,
    /// How it was done.
    pub how: How,
}

/// How two bodies came to correspond.
#[derive(Serialize)]
#[serde(rename_all = "snake_case")]
pub enum How {
    /// They did.
    AsRead,
    /// The model was fitted to source and target.
    Fitted(Box<[FitReport; 2]>),
}

/// Fits the model to both bodies unless they share topology and pose; tells which.
pub fn correspond(
    arguments: &CorrespondArguments,
    names: [&Path; 2],
    source: Body,
    target: Body,
    progress: &mut Progress,
) -> Result<Corresponding, Failure> {
    let same_mesh = source.shares_topology(&target);
    let note = |progress: &mut Progress, text: &str| {
        progress.notes("bodies", &[text.to_owned()]);
    };
    if same_mesh && stand_alike(&source.mesh, &target.mesh) {
        note(progress, "same mesh, same pose: used as they are");
        return Ok(Corresponding {
            target_own: target.mesh.clone(),
            source,
            target,
            how: How::AsRead,
        });
    }
    let why = if same_mesh {
        "same mesh, but other poses: the body model is fitted to both"
    } else {
        "different meshes: the body model is fitted to both"
    };
    note(progress, why);
    let model = model(&arguments.model)?;
    let marked = |body: &Body, file: &Option<PathBuf>| landmarks(&model, body, file.as_deref());
    let landmarks = [
        marked(&source, &arguments.source_landmarks)?,
        marked(&target, &arguments.target_landmarks)?,
    ];
    let alike = make_alike(&model, [&source, &target], &landmarks).map_err(|problems| {
        let bad = names
            .into_iter()
            .zip(problems)
            .filter(|(_, p)| !p.is_empty());
        Failure::Inputs(
            bad.map(|(name, problems)| BadInput::new(name, problems))
                .collect(),
        )
    })?;
    let Alike {
        source,
        target,
        target_own,
        fits,
    } = alike;
    for (body, fit) in [&source, &target].into_iter().zip(&fits) {
        let on_average = 1e3 * fit.report.distances.scan_to_fit.mean;
        let text = format!("fitted, {on_average:.2} mm off on average");
        progress.notes(&body.name, &[text]);
        progress.notes(&body.name, &fit.report.notes);
    }
    Ok(Corresponding {
        source,
        target,
        target_own,
        how: How::Fitted(Box::new(fits.map(|fit| fit.report))),
    })
}
