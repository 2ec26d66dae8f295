//! What the commands work on: read from files or built in, with everything wrong told at once.

use crate::failure::Failure;
use dress_anyone::body::{Body, FileFrame, UpAxis};
use dress_anyone::io::body::{self, BodyOptions};
use dress_anyone::io::garment::{self, GarmentOptions, Loaded};
use dress_anyone::problem::BadInput;
use dress_anyone::refit::dress;
use serde::Serialize;
use std::path::{Path, PathBuf};

/// A file, or one that comes with the program.
#[derive(Clone, Copy, Debug)]
pub enum Input<'a> {
    /// At a path.
    File(&'a Path),
    /// Built in: its name in the folder `data`, and its content.
    BuiltIn(&'static str, &'static [u8]),
}

/// A T-shirt for [`AVERAGE`].
pub const TSHIRT: Input<'_> = Input::BuiltIn(
    "garments/tshirt.json",
    include_bytes!("../../../data/garments/tshirt.json"),
);
/// A woman of average build.
pub const AVERAGE: Input<'_> = Input::BuiltIn(
    "bodies/f_average.obj",
    include_bytes!("../../../data/bodies/f_average.obj"),
);
/// A heavy woman.
pub const HEAVY: Input<'_> = Input::BuiltIn(
    "bodies/f_heavy.obj",
    include_bytes!("../../../data/bodies/f_heavy.obj"),
);

impl<'a> Input<'a> {
    /// The file, if one is named.
    pub fn or(file: Option<&'a PathBuf>, built_in: Input<'a>) -> Self {
        file.map_or(built_in, |path| Self::File(path))
    }

    /// How the report calls it.
    pub fn name(&self) -> String {
        match self {
            Self::File(path) => path.display().to_string(),
            Self::BuiltIn(name, _) => format!("built in: {name}"),
        }
    }

    /// Reads a garment.
    pub fn garment(self, options: &GarmentOptions) -> Result<Loaded, BadInput> {
        match self {
            Self::File(path) => garment::read(path, options),
            Self::BuiltIn(name, bytes) => garment::parse(Path::new(name), bytes, options),
        }
    }

    /// Reads a body.
    pub fn body(self, options: &BodyOptions) -> Result<Body, BadInput> {
        match self {
            Self::File(path) => body::read(path, options),
            Self::BuiltIn(name, bytes) => body::parse(Path::new(name), bytes, options),
        }
    }
}

/// Gathers what is wrong with several inputs.
#[derive(Debug, Default)]
pub struct Gathering(Vec<BadInput>);

impl Gathering {
    /// The value, or nothing and its problems kept.
    pub fn take<T>(&mut self, read: Result<T, BadInput>) -> Option<T> {
        read.map_err(|bad| self.0.push(bad)).ok()
    }

    /// Fails if anything was wrong.
    pub fn finish(self) -> Result<(), Failure> {
        if self.0.is_empty() {
            Ok(())
        } else {
            Err(Failure::Inputs(self.0))
        }
    }
}

/// Notes how the panels of a garment that brings no drape come to `body`.
pub fn note_placement(loaded: &mut Loaded, body: &Body) {
    let up = dress::lift(&loaded.garment, body);
    if loaded.garment.drape.is_none() && up > 0.0 {
        loaded.notes.push(format!(
            "the panels are placed about the pelvis of the body they were drawn on: they start {up:.2} m \
             higher"
        ));
    }
}

/// An input, for the report.
#[derive(Debug, Serialize)]
pub struct InputReport {
    file: String,
    unit: String,
    up: UpAxis,
    notes: Vec<String>,
}

impl InputReport {
    /// Of a garment.
    pub fn of_garment(input: Input<'_>, loaded: &Loaded) -> Self {
        let pattern = loaded.specification.as_ref().map(|s| FileFrame {
            metres_per_unit: 1.0 / s.units_in_meter,
            up: UpAxis::Y,
        });
        let frame = loaded.frame.or(pattern).unwrap_or(FileFrame::SI);
        Self::new(input, frame, &loaded.notes)
    }

    /// Of a body.
    pub fn of_body(input: Input<'_>, body: &Body) -> Self {
        Self::new(input, body.frame, &body.notes)
    }

    fn new(input: Input<'_>, frame: FileFrame, notes: &[String]) -> Self {
        Self {
            file: input.name(),
            unit: frame.unit_name(),
            up: frame.up,
            notes: notes.to_vec(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::arguments::{Arguments, Command};
    use clap::Parser;

    #[test]
    fn what_is_built_in_is_good_and_goes_together() {
        let Command::Refit(refit) = Arguments::parse_from(["dress", "refit"]).command else {
            panic!("not refit");
        };
        let options = refit
            .fitting
            .pair
            .reading
            .garment(&refit.fitting.params().expect("defaults"));
        let garment = TSHIRT.garment(&options).expect("a good garment").garment;
        assert_eq!(
            (garment.name.as_str(), garment.pattern.panels.len()),
            ("tshirt", 6)
        );
        let body = |input: Input<'_>| {
            input
                .body(&refit.fitting.pair.reading.body())
                .expect("a good body")
        };
        assert!(body(AVERAGE).shares_topology(&body(HEAVY)));
    }
}
