//! What a refit begins with, and what makes its steps: for all commands that look at one.

use super::ReadingArguments;
use super::RunningArguments;
use crate::body::arguments::ModelArguments;
use crate::params::Params;
use clap::{Args, ValueEnum};
use dress_anyone::cage::CageKind;
use dress_anyone::descent::{Gradient, Optimizer};
use dress_anyone::problem::BadInput;
use std::path::PathBuf;

/// A garment, the body it fits, and the body that it shall fit.
#[derive(Debug, Args)]
pub struct PairArguments {
    /// GarmentCode pattern (JSON), or drape in OBJ with its pattern as texture coordinates
    /// [default: a T-shirt that is built in]
    #[arg(long, value_name = "FILE", requires = "source_body")]
    pub garment: Option<PathBuf>,
    /// The body that the garment fits (OBJ, PLY, STL) [default: built in]
    #[arg(long, value_name = "FILE", requires = "target_body")]
    pub source_body: Option<PathBuf>,
    /// The body that it shall fit, of any mesh and pose [default: built in]
    #[arg(long, value_name = "FILE")]
    pub target_body: Option<PathBuf>,
    /// How bodies are made to correspond.
    #[command(flatten)]
    pub correspond: CorrespondArguments,
    /// How to read the files.
    #[command(flatten)]
    pub reading: ReadingArguments,
    /// How to run.
    #[command(flatten)]
    pub running: RunningArguments,
}

/// The same, and how to search.
#[derive(Debug, Args)]
pub struct FittingArguments {
    /// Garment and bodies.
    #[command(flatten)]
    pub pair: PairArguments,
    /// What the cages that deform the panels can do
    #[arg(long, value_name = "KIND")]
    pub cage: Option<Cage>,
    /// Let mirrored panels become unlike each other
    #[arg(long)]
    pub no_symmetry: bool,
    /// Where derivatives of the drape come from [default: equilibrium]
    #[arg(long, value_name = "KIND")]
    pub gradient: Option<GradientKind>,
    /// What makes the steps [default: lm; descent where the gradient is the trajectory's]
    #[arg(long, value_name = "KIND")]
    pub optimizer: Option<OptimizerKind>,
}

/// How bodies of different meshes or poses are made to correspond.
#[derive(Debug, Args)]
pub struct CorrespondArguments {
    /// The model that is fitted to both.
    #[command(flatten)]
    pub model: ModelArguments,
    /// Landmarks on the source body, as for `dress body fit --landmarks`
    #[arg(long, value_name = "FILE")]
    pub source_landmarks: Option<PathBuf>,
    /// Landmarks on the target body
    #[arg(long, value_name = "FILE")]
    pub target_landmarks: Option<PathBuf>,
}

/// [`CageKind`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Cage {
    /// Keeps all angles, as in the paper
    Green,
    /// May stretch and shear each panel as a whole, too
    GreenAffine,
}

/// [`Gradient`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum GradientKind {
    /// The state of rest
    Equilibrium,
    /// All time steps of a drape that is stepped for a given time, as in the paper
    Trajectory,
}

/// [`Optimizer`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum OptimizerKind {
    /// Levenberg–Marquardt
    Lm,
    /// Limited-memory BFGS
    Lbfgs,
    /// Gradient descent, as in the paper
    Descent,
}

impl FittingArguments {
    /// The parameters: the file's, overridden by the command line.
    pub fn params(&self) -> Result<Params, BadInput> {
        let mut params = self.pair.reading.params()?;
        match self.cage {
            Some(Cage::Green) => params.refit.cage.kind = CageKind::Green,
            Some(Cage::GreenAffine) => params.refit.cage.kind = CageKind::GreenAffine,
            None => {}
        }
        if self.no_symmetry {
            params.refit.symmetry = false;
        }
        let descent = &mut params.refit.descent;
        match self.gradient {
            Some(GradientKind::Equilibrium) => descent.gradient = Gradient::Equilibrium,
            Some(GradientKind::Trajectory) => descent.gradient = Gradient::Trajectory,
            None => {}
        }
        match self.optimizer {
            Some(OptimizerKind::Lm) => descent.optimizer = Optimizer::Lm,
            Some(OptimizerKind::Lbfgs) => descent.optimizer = Optimizer::Lbfgs,
            Some(OptimizerKind::Descent) => descent.optimizer = Optimizer::Descent,
            // What was asked for by name decides; a default of the parameters gives way.
            None if self.gradient.is_some()
                && descent.gradient == Gradient::Trajectory
                && descent.optimizer == Optimizer::Lm =>
            {
                descent.optimizer = Optimizer::Descent;
            }
            None => {}
        }
        Ok(params)
    }
}
