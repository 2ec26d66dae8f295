//! Poses and landmarks: TOML files with one table of names and three numbers each.

use dress_anyone::geometry::Vec3;
use dress_anyone::io::file::{MEBIBYTE, read_capped};
use dress_anyone::problem::{BadInput, Problem};
use std::path::Path;
use toml::{Table, Value};

/// Files of this kind are short.
const LIMIT: u64 = MEBIBYTE;

/// The table `[name]` of a file: none where a value is not three finite numbers.
pub fn vectors(path: &Path, name: &str) -> Result<Vec<(String, Option<Vec3>)>, BadInput> {
    let bad = |text: String| BadInput::one(path, Problem::whole(text));
    let text = String::from_utf8(read_capped(path, LIMIT)?)
        .map_err(|_| bad("this is no text; it should be TOML".to_owned()))?;
    let table: Table = text.parse().map_err(|error| bad(format!("{error}")))?;
    let entries = table.get(name).and_then(Value::as_table);
    let Some(entries) = entries else {
        return Err(bad(format!("there is no table `[{name}]` in it")));
    };
    let entry = |(name, value): (&String, &Value)| (name.clone(), vector(value));
    Ok(entries.iter().map(entry).collect())
}

/// Three finite numbers.
fn vector(value: &Value) -> Option<Vec3> {
    let [x, y, z] = value.as_array()?.as_slice() else {
        return None;
    };
    let number = |v: &Value| v.as_float().or_else(|| v.as_integer().map(|i| i as f64));
    let vector = Vec3::new(number(x)?, number(y)?, number(z)?);
    vector.iter().all(|c| c.is_finite()).then_some(vector)
}
