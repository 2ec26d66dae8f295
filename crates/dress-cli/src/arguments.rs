//! The command line.

pub mod design;
pub mod fitting;

use crate::body::arguments::BodyCommand;
use crate::params::fabric::{ChosenFabrics, FabricOf};
use crate::params::{self, Params};
use clap::{Args, Parser, Subcommand, ValueEnum};
use design::DesignArguments;
use dress_anyone::body::UpAxis;
use dress_anyone::io::body::BodyOptions;
use dress_anyone::io::garment::GarmentOptions;
use dress_anyone::io::garment_obj::UvOptions;
use dress_anyone::io::garmentcode::RotationOrder;
use dress_anyone::problem::BadInput;
use dress_anyone::sim::Solver;
use fitting::{FittingArguments, PairArguments};
use std::num::NonZeroUsize;
use std::path::PathBuf;

/// Refits sewing patterns, and their drapes, to any body.
#[derive(Debug, Parser)]
#[command(name = "dress", version, arg_required_else_help = true)]
pub struct Arguments {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// What to do.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Refit a garment from the body it fits to another one.
    Refit(RefitArguments),
    /// Compare the gradient of a refit's loss with differences of complete drapes.
    CheckGradient(CheckGradientArguments),
    /// Change a pattern at random, and search for the change from its drape on another body alone.
    CheckRecovery(CheckRecoveryArguments),
    /// Carry a garment's drape to another body: the shape that a refit aims for, without a pattern.
    Transfer(TransferArguments),
    /// Drape a garment on a body.
    Drape(DrapeArguments),
    /// Picture the results of many drapes in one sheet.
    Sheet(SheetArguments),
    /// Tell what is in a garment or body file, and what is wrong with it.
    Inspect(InspectArguments),
    /// Draw, show, pose, measure and fit bodies.
    #[command(subcommand)]
    Body(BodyCommand),
    /// List the fabrics that are known by name, or tell where the numbers of one come from.
    Fabrics(FabricsArguments),
    /// Print all parameters with their defaults and what they do, as TOML.
    Params,
}

/// `dress refit`.
#[derive(Debug, Args)]
pub struct RefitArguments {
    /// Garment, bodies, and how.
    #[command(flatten)]
    pub fitting: FittingArguments,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
    /// Pose of the result: the source body's, or the target body's own besides
    #[arg(long, value_name = "POSE", default_value = "source")]
    pub pose: PoseChoice,
    /// A shape to aim for, in the unit and axes of the target body: a drape of the same mesh in OBJ, as
    /// `dress transfer` writes it [default: the source drape carried to the target body]
    #[arg(long, value_name = "FILE")]
    pub target_shape: Option<PathBuf>,
    /// Folder in which to note every step of the search, so that it can be resumed
    #[arg(long, value_name = "FOLDER")]
    pub checkpoint: Option<PathBuf>,
    /// Go on from what an interrupted refit of the same noted in this folder, and note further steps there
    #[arg(long, value_name = "FOLDER", conflicts_with = "checkpoint")]
    pub resume: Option<PathBuf>,
}

/// `dress transfer`.
#[derive(Debug, Args)]
pub struct TransferArguments {
    /// Garment and bodies.
    #[command(flatten)]
    pub pair: PairArguments,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
    /// What the shape is to keep.
    #[command(flatten)]
    pub design: DesignArguments,
    /// Ease painted on the drape: an OBJ with vertex colours, black for absolute, white for relative, in
    /// place of --ease
    #[arg(long, value_name = "FILE", conflicts_with = "ease")]
    pub ease_paint: Option<PathBuf>,
}

/// `dress check-gradient`.
#[derive(Debug, Args)]
pub struct CheckGradientArguments {
    /// Garment, bodies, and how.
    #[command(flatten)]
    pub fitting: FittingArguments,
    /// Random directions along which to compare
    #[arg(long, value_name = "N", default_value = "3")]
    pub directions: NonZeroUsize,
    /// Draw the loss and its slopes along the first direction into this file (SVG) instead
    #[arg(long, value_name = "FILE")]
    pub plot: Option<PathBuf>,
    /// How far the pattern moves in the plot, either way
    #[arg(long, value_name = "MM", value_parser = positive, default_value = "2", requires = "plot")]
    pub reach: f64,
}

/// `dress check-recovery`.
#[derive(Debug, Args)]
pub struct CheckRecoveryArguments {
    /// Garment, bodies, and how.
    #[command(flatten)]
    pub fitting: FittingArguments,
    /// How much panels are stretched, sheared and bent at most, as a part of their size
    #[arg(long, value_name = "PART", value_parser = positive, default_value = "0.15")]
    pub change: f64,
    /// Which random change
    #[arg(long, value_name = "N", default_value = "1")]
    pub seed: usize,
}

/// `dress drape`.
#[derive(Debug, Args)]
pub struct DrapeArguments {
    /// GarmentCode pattern (JSON), or drape in OBJ with its pattern as texture coordinates
    #[arg(long, value_name = "FILE")]
    pub garment: PathBuf,
    /// The body to drape it on (OBJ, PLY, STL)
    #[arg(long, value_name = "FILE")]
    pub body: PathBuf,
    /// Start from this drape of the same garment (OBJ) [default: the placed panels]
    #[arg(long, value_name = "FILE")]
    pub from: Option<PathBuf>,
    /// What brings the cloth to rest [default: static]
    #[arg(long, value_name = "SOLVER")]
    pub solver: Option<SolverKind>,
    /// Folder for snapshots on the way, numbered, each as OBJ and PNG
    #[arg(long, value_name = "FOLDER")]
    pub frames: Option<PathBuf>,
    /// Folder for the results
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
    /// How to read the files.
    #[command(flatten)]
    pub reading: ReadingArguments,
    /// How to run.
    #[command(flatten)]
    pub running: RunningArguments,
}

/// `dress sheet`.
#[derive(Debug, Args)]
pub struct SheetArguments {
    /// Folders that `dress drape` or `dress transfer` wrote
    #[arg(value_name = "FOLDER", required = true)]
    pub folders: Vec<PathBuf>,
    /// Garments in a row
    #[arg(long, value_name = "N", default_value = "6")]
    pub columns: NonZeroUsize,
    /// Folder for the picture
    #[arg(long, value_name = "FOLDER", default_value = "dress-out")]
    pub out: PathBuf,
}

/// `dress inspect`.
#[derive(Debug, Args)]
pub struct InspectArguments {
    /// A garment (JSON, OBJ with texture coordinates) or a body (OBJ, PLY, STL)
    #[arg(value_name = "FILE")]
    pub file: PathBuf,
    /// What the file is [default: patterns and open textured meshes are garments]
    #[arg(long = "as", value_name = "KIND")]
    pub kind: Option<Kind>,
    /// How to read the file.
    #[command(flatten)]
    pub reading: ReadingArguments,
}

/// `dress fabrics`.
#[derive(Debug, Args)]
pub struct FabricsArguments {
    /// A fabric's name [default: all of them]
    #[arg(value_name = "NAME")]
    pub name: Option<String>,
}

/// How to run.
#[derive(Debug, Args)]
pub struct RunningArguments {
    /// Number of threads [default: one per core]
    #[arg(long, value_name = "N")]
    pub threads: Option<NonZeroUsize>,
    /// Say nothing unless something is wrong
    #[arg(long)]
    pub quiet: bool,
}

/// How to read files. What is given here overrides the parameter file, which overrides guesses.
#[derive(Debug, Args)]
pub struct ReadingArguments {
    /// Parameters (TOML); `dress params` prints them all
    #[arg(long, value_name = "FILE")]
    pub params: Option<PathBuf>,
    /// What the cloth, or a panel of it, is made of: a name, or a file with the keys of the table "fabric"
    /// (TOML); may be given several times
    #[arg(long, value_name = "[PANEL:]NAME|FILE", value_parser = FabricOf::read)]
    pub fabric: Vec<FabricOf>,
    /// Length of mesh edges, where a pattern has to be meshed [default: 20]
    #[arg(long, value_name = "MM", value_parser = positive)]
    pub resolution: Option<f64>,
    /// How the three angles of a GarmentCode panel combine [default: extrinsic]
    #[arg(long, value_name = "ORDER")]
    pub panel_rotation: Option<Rotation>,
    /// Length of one unit of an OBJ garment's texture coordinates [default: measured]
    #[arg(long, value_name = "METRES", value_parser = positive)]
    pub uv_scale: Option<f64>,
    /// Unit of an OBJ garment [default: guessed from its size]
    #[arg(long, value_name = "UNIT")]
    pub garment_unit: Option<Unit>,
    /// Axis that points up in an OBJ garment [default: guessed]
    #[arg(long, value_name = "AXIS")]
    pub garment_up: Option<Up>,
    /// Unit of the body files [default: guessed from their heights]
    #[arg(long, value_name = "UNIT")]
    pub body_unit: Option<Unit>,
    /// Axis that points up in the body files [default: guessed]
    #[arg(long, value_name = "AXIS")]
    pub body_up: Option<Up>,
}

/// What a file is.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Kind {
    /// A garment
    Garment,
    /// A body
    Body,
}

/// Poses of a result.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum PoseChoice {
    /// That of the source body
    Source,
    /// That, and the target body's own
    Own,
}

/// [`Solver`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum SolverKind {
    /// The static solve, to a true equilibrium
    Static,
    /// The paper's time steps alone
    Xpbd,
}

/// [`RotationOrder`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Rotation {
    /// About axes that turn along
    Intrinsic,
    /// About fixed axes
    Extrinsic,
}

/// A unit of length.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Unit {
    /// Metres
    M,
    /// Decimetres
    Dm,
    /// Centimetres
    Cm,
    /// Millimetres
    Mm,
    /// Inches
    In,
}

/// [`UpAxis`].
#[derive(Clone, Copy, Debug, ValueEnum)]
pub enum Up {
    /// x
    X,
    /// y
    Y,
    /// z
    Z,
}

impl Unit {
    /// Metres in one.
    pub fn metres(self) -> f64 {
        match self {
            Self::M => 1.0,
            Self::Dm => 0.1,
            Self::Cm => 0.01,
            Self::Mm => 0.001,
            Self::In => 0.0254,
        }
    }
}

impl Up {
    /// As the library calls it.
    pub fn axis(self) -> UpAxis {
        match self {
            Self::X => UpAxis::X,
            Self::Y => UpAxis::Y,
            Self::Z => UpAxis::Z,
        }
    }
}

impl ReadingArguments {
    /// The parameters: the file's, overridden by the command line.
    pub fn params(&self) -> Result<Params, BadInput> {
        let fabrics = ChosenFabrics::find(&self.fabric)?;
        let file = self.params.as_deref();
        let mut params = file.map_or_else(
            || Ok(Params::default()),
            |file| params::read(file, fabrics.whole),
        )?;
        fabrics.over(&mut params.refit);
        if let Some(millimetres) = self.resolution {
            params.read.resolution = 1e-3 * millimetres;
        }
        match self.panel_rotation {
            Some(Rotation::Intrinsic) => params.read.panel_rotation = RotationOrder::Intrinsic,
            Some(Rotation::Extrinsic) => params.read.panel_rotation = RotationOrder::Extrinsic,
            None => {}
        }
        Ok(params)
    }

    /// How to read the garment.
    pub fn garment(&self, params: &Params) -> GarmentOptions {
        GarmentOptions {
            resolution: params.read.resolution,
            rotation: params.read.panel_rotation,
            uv: UvOptions {
                uv_scale: self.uv_scale,
                metres_per_unit: self.garment_unit.map(Unit::metres),
                up: self.garment_up.map(Up::axis),
            },
        }
    }

    /// How to read bodies.
    pub fn body(&self) -> BodyOptions {
        BodyOptions {
            metres_per_unit: self.body_unit.map(Unit::metres),
            up: self.body_up.map(Up::axis),
        }
    }
}

impl DrapeArguments {
    /// The parameters: the file's, overridden by the command line.
    pub fn params(&self) -> Result<Params, BadInput> {
        let mut params = self.reading.params()?;
        match self.solver {
            Some(SolverKind::Static) => params.refit.sim.solver = Solver::Static,
            Some(SolverKind::Xpbd) => params.refit.sim.solver = Solver::Xpbd,
            None => {}
        }
        Ok(params)
    }
}

/// A length or scale.
fn positive(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok(number),
        _ => Err("must be a number above zero".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use clap::CommandFactory;
    use dress_anyone::cage::CageKind;
    use dress_anyone::descent::{Gradient, Optimizer};

    #[test]
    fn the_command_line_is_well_formed() {
        Arguments::command().debug_assert();
    }

    #[test]
    fn options_override_the_parameters() {
        let line = "dress refit --resolution 35 --cage green --no-symmetry \
                    --panel-rotation intrinsic --body-unit in --body-up z";
        let Command::Refit(refit) = Arguments::parse_from(line.split_whitespace()).command else {
            panic!("not refit");
        };
        let params = refit.fitting.params().expect("good parameters");
        // 35 mm.
        assert!((params.read.resolution - 0.035).abs() < 1e-12);
        assert_eq!(params.read.panel_rotation, RotationOrder::Intrinsic);
        assert_eq!(params.refit.cage.kind, CageKind::Green);
        assert!(!params.refit.symmetry);
        let body = refit.fitting.pair.reading.body();
        assert_eq!(body.metres_per_unit, Some(0.0254));
        assert_eq!(body.up, Some(UpAxis::Z));
    }

    #[test]
    fn the_papers_gradient_goes_with_the_papers_descent_unless_told() {
        let chosen = |line: &str| {
            let Command::Refit(refit) = Arguments::parse_from(line.split_whitespace()).command
            else {
                panic!("not refit");
            };
            let descent = refit
                .fitting
                .params()
                .expect("good parameters")
                .refit
                .descent;
            (descent.gradient, descent.optimizer)
        };
        let (equilibrium, trajectory) = (Gradient::Equilibrium, Gradient::Trajectory);
        for (line, expected) in [
            ("dress refit", (equilibrium, Optimizer::Lm)),
            (
                "dress refit --gradient trajectory",
                (trajectory, Optimizer::Descent),
            ),
            (
                "dress refit --gradient trajectory --optimizer lbfgs",
                (trajectory, Optimizer::Lbfgs),
            ),
            (
                "dress refit --optimizer descent",
                (equilibrium, Optimizer::Descent),
            ),
        ] {
            assert_eq!(chosen(line), expected, "{line}");
        }
    }

    #[test]
    fn lengths_that_are_none_are_refused() {
        for bad in ["0", "-3", "nan", "inf", "fine"] {
            assert!(positive(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn a_garment_of_ones_own_needs_bodies_of_ones_own() {
        for line in [
            "dress refit --garment a.json",
            "dress refit --garment a.json --target-body b.obj",
            "dress refit --source-body b.obj",
        ] {
            assert!(Arguments::try_parse_from(line.split_whitespace()).is_err());
        }
    }
}
