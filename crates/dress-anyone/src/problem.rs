//! What is wrong with an input, in its user's words: all of it at once.

use std::fmt;
use std::path::{Path, PathBuf};

/// One thing wrong with an input.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Problem {
    /// Where: "panel `left_sleeve`, edge 3", "line 17", or empty for the whole input.
    pub place: String,
    /// What is wrong, and what to do about it.
    pub text: String,
}

impl Problem {
    /// A problem at a place.
    pub fn at(place: impl Into<String>, text: impl Into<String>) -> Self {
        Self {
            place: place.into(),
            text: text.into(),
        }
    }

    /// A problem of the whole input.
    pub fn whole(text: impl Into<String>) -> Self {
        Self::at("", text)
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.place.is_empty() {
            write!(f, "{}", self.text)
        } else {
            write!(f, "{}: {}", self.place, self.text)
        }
    }
}

/// An input that cannot be used: the file and everything wrong with it.
#[derive(Clone, Debug, thiserror::Error)]
pub struct BadInput {
    /// The file, as the user named it.
    pub file: PathBuf,
    /// Everything wrong with it; never empty.
    pub problems: Vec<Problem>,
}

impl BadInput {
    /// All `problems` of `file`.
    pub fn new(file: &Path, problems: Vec<Problem>) -> Self {
        Self {
            file: file.to_owned(),
            problems,
        }
    }

    /// A single problem of `file`.
    pub fn one(file: &Path, problem: Problem) -> Self {
        Self::new(file, vec![problem])
    }
}

impl fmt::Display for BadInput {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.problems.as_slice() {
            [one] => write!(f, "{}: {one}", self.file.display()),
            many => {
                write!(f, "{}: {} problems", self.file.display(), many.len())?;
                for problem in many {
                    write!(f, "\n  - {problem}")?;
                }
                Ok(())
            }
        }
    }
}
