//! `dress body show`.

use super::arguments::ShowArguments;
use super::bare;
use crate::failure::Failure;
use crate::picture::{View, preview};
use dress_anyone::io;
use dress_anyone::io::output::Output;

/// Pictures a body; what to say about it in the end.
pub fn run(arguments: &ShowArguments) -> Result<String, Failure> {
    let body = io::body::read(&arguments.file.file, &arguments.file.options())?;
    let figure = bare(&body.name, &body.mesh);
    let picture = preview("", &[figure], &[View::Front, View::Side, View::Back]);
    let mut output = Output::new(&arguments.out);
    output.add(format!("{}.png", body.name), picture);
    let written = output.write()?;
    let note = |note: &String| format!("{}: {note}\n", body.name);
    let notes: String = body.notes.iter().map(note).collect();
    Ok(notes + &format!("Picture written to {}\n", written[0].display()))
}
