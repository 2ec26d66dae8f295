//! Ways to fail, and what the shell is told of them.

use dress_anyone::problem::BadInput;
use dress_anyone::refit::RefitError;
use std::fmt;

/// Why there is no result.
#[derive(Debug)]
pub enum Failure {
    /// Everything wrong with the inputs; exit status 2.
    Inputs(Vec<BadInput>),
    /// Inputs that are good by themselves and do not go together; exit status 2.
    Refused(String),
    /// Ctrl-C before there was anything to write; exit status 130.
    Interrupted(String),
    /// A mistake of this program; exit status 1.
    Internal(anyhow::Error),
}

impl Failure {
    /// The exit status of the program.
    pub fn code(&self) -> u8 {
        match self {
            Self::Internal(_) => 1,
            Self::Inputs(_) | Self::Refused(_) => 2,
            Self::Interrupted(_) => 130,
        }
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Inputs(inputs) => {
                let each: Vec<String> = inputs.iter().map(ToString::to_string).collect();
                f.write_str(&each.join("\n"))
            }
            Self::Refused(text) | Self::Interrupted(text) => f.write_str(text),
            Self::Internal(error) => write!(f, "{error:#}"),
        }
    }
}

impl From<BadInput> for Failure {
    fn from(input: BadInput) -> Self {
        Self::Inputs(vec![input])
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::Internal(error)
    }
}

impl From<RefitError> for Failure {
    fn from(error: RefitError) -> Self {
        match error {
            RefitError::Stopped => Self::Interrupted(error.to_string()),
            _ => Self::Refused(error.to_string()),
        }
    }
}
