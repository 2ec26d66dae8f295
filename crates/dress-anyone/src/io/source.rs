//! What every reader shares: the bytes of a file within reason, and a list of problems that does
//! not drown its reader.

use super::file::{MEBIBYTE, read_capped};
use crate::geometry::Vec3;
use crate::problem::{BadInput, Problem};
use std::path::Path;

/// Larger files are refused: no body or garment needs a gibibyte, and a mistaken file may.
const MAX_BYTES: u64 = 1024 * MEBIBYTE;

/// Problems shown before the rest is only counted.
const MAX_SHOWN: usize = 20;

/// A number beyond this is no coordinate in any unit, and its powers would overflow.
const MAX_COORDINATE: f64 = 1e12;

/// The content of `path`.
pub(crate) fn bytes(path: &Path) -> Result<Vec<u8>, BadInput> {
    let bytes = read_capped(path, MAX_BYTES)?;
    if bytes.is_empty() {
        return Err(BadInput::one(path, Problem::whole("the file is empty")));
    }
    Ok(bytes)
}

/// The file's name without folder and extension, for [`crate::body::Body::name`] and the like.
pub(crate) fn stem(path: &Path) -> String {
    path.file_stem()
        .map(|stem| stem.to_string_lossy().into_owned())
        .unwrap_or_default()
}

/// A surface as its file has it: the file's unit, axes and polygons.
#[derive(Debug, Default, PartialEq)]
pub(crate) struct Surface {
    /// In the file's unit and axes, `[vertex]`.
    pub(crate) positions: Vec<Vec3>,
    /// Vertex indices, all in range, three or more each, `[polygon][corner]`.
    pub(crate) polygons: Vec<Vec<u32>>,
}

/// Problems found so far: the first [`MAX_SHOWN`], and how many more there were.
#[derive(Default)]
pub(crate) struct Problems {
    shown: Vec<Problem>,
    hidden: usize,
}

impl Problems {
    /// Adds a problem at a place.
    pub(crate) fn at(&mut self, place: impl Into<String>, text: impl Into<String>) {
        if self.shown.len() < MAX_SHOWN {
            self.shown.push(Problem::at(place, text));
        } else {
            self.hidden += 1;
        }
    }

    /// Adds a problem of the whole file.
    pub(crate) fn whole(&mut self, text: impl Into<String>) {
        self.at("", text);
    }

    /// Adds a problem unless `value` is finite and of a size that coordinates have.
    pub(crate) fn check_coordinate(&mut self, value: f64, place: impl FnOnce() -> String) {
        if !value.is_finite() {
            self.at(place(), format!("`{value}` is not a finite number"));
        } else if value.abs() > MAX_COORDINATE {
            self.at(
                place(),
                format!("`{value:e}` is too large for a coordinate"),
            );
        }
    }

    /// `value` if there was no problem, else all problems.
    pub(crate) fn unless_any<T>(mut self, value: T) -> Result<T, Vec<Problem>> {
        if self.shown.is_empty() {
            return Ok(value);
        }
        if self.hidden > 0 {
            let text = format!("and {} more", self.hidden);
            self.shown.push(Problem::whole(text));
        }
        Err(self.shown)
    }
}

/// Things joined into groups (union–find).
pub(crate) struct Groups(Vec<usize>);

impl Groups {
    /// Every one of `count` things on its own.
    pub(crate) fn new(count: usize) -> Self {
        Self((0..count).collect())
    }

    /// The group of thing `i`, named by its smallest member.
    pub(crate) fn of(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    /// Makes one group of the groups of `i` and `j`.
    pub(crate) fn join(&mut self, i: usize, j: usize) {
        let (i, j) = (self.of(i), self.of(j));
        self.0[i.max(j)] = i.min(j);
    }
}
