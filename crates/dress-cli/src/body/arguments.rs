//! The command line of `dress body`.

use crate::arguments::{RunningArguments, Unit, Up};
use clap::{Args, Subcommand};
use dress_anyone::io::body::BodyOptions;
use std::path::PathBuf;

/// What to do with a body.
#[derive(Debug, Subcommand)]
pub enum BodyCommand {
    /// Draw bodies at random from the body model
    Sample(SampleArguments),
    /// Picture a body file
    Show(ShowArguments),
    /// Give a body another pose
    Pose(PoseArguments),
    /// Measure a body: height, bust, waist, hip, inseam, …
    Measure(MeasureArguments),
    /// Fit the body model to a body file
    Fit(FitArguments),
}

/// `dress body sample`.
#[derive(Debug, Args)]
pub struct SampleArguments {
    /// Another seed gives other bodies
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub seed: u64,
    /// How many
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u64).range(1..=10_000))]
    pub count: u64,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
    /// The model.
    #[command(flatten)]
    pub model: ModelArguments,
}

/// `dress body show`.
#[derive(Debug, Args)]
pub struct ShowArguments {
    /// The body.
    #[command(flatten)]
    pub file: FileArguments,
    /// Folder for the picture
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
}

/// `dress body pose`.
#[derive(Debug, Args)]
pub struct PoseArguments {
    /// The body and how to fit it.
    #[command(flatten)]
    pub subject: SubjectArguments,
    /// `a`, `t`, or a TOML file with a table `rotations`: joint = [x, y, z], axis times degrees
    #[arg(long, value_name = "POSE", default_value = "a")]
    pub pose: String,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
}

/// `dress body measure`.
#[derive(Debug, Args)]
pub struct MeasureArguments {
    /// The body and how to fit it.
    #[command(flatten)]
    pub subject: SubjectArguments,
}

/// `dress body fit`.
#[derive(Debug, Args)]
pub struct FitArguments {
    /// The body and how to fit it.
    #[command(flatten)]
    pub subject: SubjectArguments,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
}

/// A body that the model is fitted to.
#[derive(Debug, Args)]
pub struct SubjectArguments {
    /// The body.
    #[command(flatten)]
    pub file: FileArguments,
    /// TOML file with a table `landmarks`: joint or point = [x, y, z] in the body file's unit and axes
    #[arg(long, value_name = "FILE")]
    pub landmarks: Option<PathBuf>,
    /// The model.
    #[command(flatten)]
    pub model: ModelArguments,
    /// How to run.
    #[command(flatten)]
    pub running: RunningArguments,
}

/// Which model.
#[derive(Debug, Args)]
pub struct ModelArguments {
    /// Body model in SMPL's layout (plain .npz) [default: built in]
    #[arg(long, value_name = "FILE")]
    pub model: Option<PathBuf>,
}

/// A body file and how to read it.
#[derive(Debug, Args)]
pub struct FileArguments {
    /// A body (OBJ, PLY, STL)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// Unit of the file [default: guessed from the body's height]
    #[arg(long, value_name = "UNIT")]
    pub body_unit: Option<Unit>,
    /// Axis that points up in the file [default: guessed]
    #[arg(long, value_name = "AXIS")]
    pub body_up: Option<Up>,
}

impl FileArguments {
    /// How to read the file.
    pub fn options(&self) -> BodyOptions {
        BodyOptions {
            metres_per_unit: self.body_unit.map(Unit::metres),
            up: self.body_up.map(Up::axis),
        }
    }
}
