//! The state of a search in a folder: written after every step, read to go on.
//!
//! The file is complete or not there: it is written under another name and renamed.

use crate::failure::Failure;
use anyhow::Context;
use dress_anyone::io::file::{MEBIBYTE, read_capped};
use dress_anyone::io::output::Output;
use dress_anyone::problem::{BadInput, Problem};
use dress_anyone::refit::checkpoint::Checkpoint;
use std::path::Path;

/// Name of the file.
const NAME: &str = "checkpoint.json";
/// Some hundred bytes a vertex.
const LIMIT: u64 = 512 * MEBIBYTE;

/// Notes the state in `folder`, over what was noted before.
pub fn write(folder: &Path, state: &Checkpoint) -> Result<(), Failure> {
    let text = serde_json::to_string(state).context("a checkpoint cannot be told as JSON")?;
    let mut output = Output::new(folder);
    output.add(NAME, text);
    output.write()?;
    Ok(())
}

/// What was last noted in `folder`.
pub fn read(folder: &Path) -> Result<Checkpoint, BadInput> {
    let path = folder.join(NAME);
    let bytes = read_capped(&path, LIMIT)?;
    serde_json::from_slice(&bytes).map_err(|error| {
        let text = format!("this is no checkpoint of this version of the program: {error}");
        BadInput::one(&path, Problem::whole(text))
    })
}
