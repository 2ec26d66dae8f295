//! GarmentCode pattern specifications (`*_specification.json`), read and written.
//!
//! Files are in `units_in_meter` units (100 = centimetres) and most give control points relative to
//! their edge: `c = a + c_x e + c_y p` with `e = b − a` and `p` = `e` turned left. Korosteleva and
//! Sorkine-Hornung 2023, "GarmentCode"; templates of Korosteleva and Lee 2021 are read as well. What
//! is read and not understood (design parameters, unknown keys) is kept and written back.

mod read;
mod write;

use super::file::{MEBIBYTE, read_capped};
use crate::pattern::Pattern;
use crate::problem::BadInput;
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::path::Path;
pub use write::write;

/// The largest file read; the largest known specification has 0.1 MiB.
const LIMIT: u64 = 32 * MEBIBYTE;

/// A pattern, and the document it was read from.
#[derive(Clone, Debug, PartialEq)]
pub struct Specification {
    /// Panels and stitches, SI.
    pub pattern: Pattern,
    /// The document as read, for writing back.
    pub document: Value,
    /// Units of the file in one metre.
    pub units_in_meter: f64,
    /// What was noticed and tolerated.
    pub notes: Vec<String>,
}

/// What a file leaves open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadOptions {
    /// How the three angles of a panel's `rotation` combine.
    pub rotation: RotationOrder,
}

/// How the angles x, y, z combine. It matters only where two or more of them are not zero, and only
/// for where the flat panel waits before draping.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum RotationOrder {
    /// About fixed axes, R_z R_y R_x: how GarmentCode's mesher and Maya read the file.
    #[default]
    Extrinsic,
    /// About axes that turn along, R_x R_y R_z: how GarmentCode's writer meant it.
    Intrinsic,
}

/// The specification in the file at `path`, or everything wrong with it.
pub fn read(path: &Path, options: &ReadOptions) -> Result<Specification, BadInput> {
    parse(path, &read_capped(path, LIMIT)?, options)
}

/// The specification in `bytes`; `file` is for messages only.
pub fn parse(file: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Specification, BadInput> {
    read::parse(file, bytes, *options)
}

#[cfg(test)]
mod tests;
