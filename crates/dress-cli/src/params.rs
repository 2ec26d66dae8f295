//! Parameter files: the commented defaults, and reading a user's own.
//!
//! [`TEMPLATE`] is what `dress params` prints. It is written by hand; a test holds it to the
//! defaults of the parameter structs: same values, every key, each with a comment above it.

use dress_anyone::problem::{BadInput, Problem};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::path::Path;
use toml::{Table, Value};

/// All parameters at their defaults, with what they mean.
pub const TEMPLATE: &str = include_str!("params.toml");

/// The parameters in a TOML file; keys it leaves out keep their defaults.
pub fn read_params<T>(path: &Path) -> Result<T, BadInput>
where
    T: Serialize + DeserializeOwned + Default,
{
    let text = std::fs::read_to_string(path).map_err(|error| {
        let why = format!("cannot be read as text: {error}");
        BadInput::one(path, Problem::whole(why))
    })?;
    parse_params(&text).map_err(|problems| BadInput::new(path, problems))
}

/// [`read_params`] of a file's text.
fn parse_params<T>(text: &str) -> Result<T, Vec<Problem>>
where
    T: Serialize + DeserializeOwned + Default,
{
    let error = match toml::from_str::<T>(text) {
        Ok(params) => return Ok(params),
        Err(error) => error,
    };
    let mut problems = Vec::new();
    if let (Ok(given), Ok(known)) = (text.parse::<Table>(), Table::try_from(T::default())) {
        unknown_keys(&given, &known, &mut Vec::new(), &known, &mut problems);
    }
    if problems.is_empty() {
        problems.push(in_plain_words(text, &error));
    }
    Err(problems)
}

/// Keys of `given` that `known`, the table at `path` of all `defaults`, does not have.
fn unknown_keys(
    given: &Table,
    known: &Table,
    path: &mut Vec<String>,
    defaults: &Table,
    problems: &mut Vec<Problem>,
) {
    for (key, value) in given {
        path.push(key.clone());
        match (known.get(key), value) {
            (None, _) => {
                let place = format!("key `{}`", path.join("."));
                problems.push(Problem::at(place, advice(key, known, defaults)));
            }
            (Some(Value::Table(known)), Value::Table(given)) => {
                unknown_keys(given, known, path, defaults, problems);
            }
            _ => {}
        }
        path.pop();
    }
}

/// What the writer of an unknown key may have meant.
fn advice(key: &str, siblings: &Table, defaults: &Table) -> String {
    let elsewhere = tables_with(key, defaults, "");
    if !elsewhere.is_empty() {
        return format!(
            "there is no such key here; it belongs to {}",
            elsewhere.join(" or ")
        );
    }
    let nearest = siblings
        .keys()
        .map(|known| (edit_distance(key, known), known))
        .min();
    match nearest {
        // A third of the letters wrong is still a slip of the pen.
        Some((distance, known)) if distance <= (key.chars().count() / 3).max(2) => {
            format!("there is no such key; did you mean `{known}`?")
        }
        _ => {
            let known: Vec<String> = siblings.keys().map(|key| format!("`{key}`")).collect();
            format!("there is no such key; known here: {}", known.join(", "))
        }
    }
}

/// The tables within `table`, called `name`, that have this key.
fn tables_with(key: &str, table: &Table, name: &str) -> Vec<String> {
    let mut found = Vec::new();
    if table.contains_key(key) {
        found.push(if name.is_empty() {
            "the top of the file, before any [table]".to_owned()
        } else {
            format!("[{name}]")
        });
    }
    for (inner, value) in table {
        if let Value::Table(inside) = value {
            let dot = if name.is_empty() { "" } else { "." };
            found.extend(tables_with(key, inside, &format!("{name}{dot}{inner}")));
        }
    }
    found
}

/// Where and what is wrong, of an error that is no unknown key.
fn in_plain_words(text: &str, error: &toml::de::Error) -> Problem {
    match error.span() {
        Some(span) => {
            let before = text.get(..span.start).unwrap_or(text);
            let line = before.matches('\n').count() + 1;
            Problem::at(format!("line {line}"), error.message())
        }
        None => Problem::whole(error.message()),
    }
}

/// Letters to insert, drop or replace to come from one word to the other (Levenshtein 1966).
fn edit_distance(a: &str, b: &str) -> usize {
    let b: Vec<char> = b.chars().collect();
    let mut row: Vec<usize> = (0..=b.len()).collect();
    for (i, letter) in a.chars().enumerate() {
        let mut diagonal = row[0];
        row[0] = i + 1;
        for j in 0..b.len() {
            let replaced = diagonal + usize::from(letter != b[j]);
            diagonal = row[j + 1];
            row[j + 1] = replaced.min(diagonal + 1).min(row[j] + 1);
        }
    }
    row[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use dress_anyone::garment::Fabric;
    use serde::Deserialize;

    /// Stands for the parameters of the whole program.
    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Params {
        fabric: Fabric,
    }

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Sim {
        steps: usize,
        damping: f64,
    }

    #[derive(Debug, Default, PartialEq, Serialize, Deserialize)]
    #[serde(default, deny_unknown_fields)]
    struct Nested {
        quiet: bool,
        sim: Sim,
        fabric: Fabric,
    }

    /// What is wrong with a template of `T`'s defaults.
    fn template_problems<T>(template: &str) -> Vec<String>
    where
        T: Serialize + DeserializeOwned + Default + PartialEq,
    {
        let mut problems = Vec::new();
        match parse_params::<T>(template) {
            Ok(params) if params == T::default() => {}
            Ok(_) => problems.push("a value differs from the default".to_owned()),
            Err(errors) => problems.extend(errors.iter().map(ToString::to_string)),
        }
        let (mut table, mut above, mut explained) = (String::new(), "", Vec::new());
        for line in template.lines().map(str::trim) {
            let commented = above.starts_with('#');
            if let Some(name) = line.strip_prefix('[').and_then(|l| l.strip_suffix(']')) {
                name.clone_into(&mut table);
                explained.extend(commented.then(|| name.to_owned()));
            } else if let Some((key, _)) = line.split_once('=').filter(|_| !line.starts_with('#')) {
                let dot = if table.is_empty() { "" } else { "." };
                explained.extend(commented.then(|| format!("{table}{dot}{}", key.trim())));
            }
            above = line;
        }
        let defaults = Table::try_from(T::default()).expect("parameters are a table");
        for key in all_keys(&defaults, "") {
            if !explained.contains(&key) {
                problems.push(format!("`{key}` is missing, or has no comment above it"));
            }
        }
        problems
    }

    fn all_keys(table: &Table, name: &str) -> Vec<String> {
        let mut keys = Vec::new();
        for (key, value) in table {
            let dot = if name.is_empty() { "" } else { "." };
            let path = format!("{name}{dot}{key}");
            if let Value::Table(inside) = value {
                keys.extend(all_keys(inside, &path));
            }
            keys.push(path);
        }
        keys
    }

    #[test]
    fn the_template_says_the_defaults_and_explains_every_key() {
        assert_eq!(template_problems::<Params>(TEMPLATE), [""; 0]);
    }

    #[test]
    fn a_template_with_a_gap_is_found_out() {
        let without_comment = "# Sim.\n[sim]\nsteps = 0\n# Damping.\ndamping = 0.0\n";
        assert_eq!(
            template_problems::<Sim>("# Steps.\nsteps = 0\ndamping = 0.0\n"),
            ["`damping` is missing, or has no comment above it"]
        );
        assert_eq!(
            template_problems::<Sim>("# Steps.\nsteps = 1\n# Damping.\ndamping = 0.0\n"),
            ["a value differs from the default"]
        );
        let problems = template_problems::<Nested>(without_comment);
        assert!(problems[0].contains("`fabric.bending`"), "{problems:?}");
        assert!(problems.iter().any(|p| p.starts_with("`sim.steps`")));
    }

    #[test]
    fn keys_left_out_keep_their_defaults() {
        let params: Nested = parse_params("[sim]\nsteps = 7\n").expect("good parameters");
        assert_eq!((params.sim.steps, params.fabric), (7, Fabric::default()));
        // A whole number where a fraction is expected is fine.
        let params: Nested = parse_params("fabric.warp = 500").expect("good parameters");
        assert_eq!(params.fabric.warp, 500.0);
    }

    #[test]
    fn every_unknown_key_is_named_with_advice() {
        let text = "loud = true\n[fabric]\nbendign = 1e-5\ndamping = 0.1\n[sim]\nbananas = 3\n";
        let problems = parse_params::<Nested>(text).expect_err("four unknown keys");
        let lines: Vec<String> = problems.iter().map(ToString::to_string).collect();
        assert_eq!(
            lines,
            [
                "key `fabric.bendign`: there is no such key; did you mean `bending`?",
                "key `fabric.damping`: there is no such key here; it belongs to [sim]",
                "key `loud`: there is no such key; known here: `fabric`, `quiet`, `sim`",
                "key `sim.bananas`: there is no such key; known here: `damping`, `steps`",
            ]
        );
    }

    #[test]
    fn a_wrong_value_is_told_with_its_line() {
        let problems = parse_params::<Nested>("# a\n[sim]\nsteps = \"many\"\n").expect_err("words");
        assert_eq!(problems[0].place, "line 3");
        let problems = parse_params::<Nested>("[sim\n").expect_err("no TOML");
        assert_eq!(problems[0].place, "line 1");
    }

    #[test]
    fn a_file_that_is_not_there_is_bad_input() {
        let folder = tempfile::tempdir().expect("a folder");
        let error = read_params::<Params>(&folder.path().join("none.toml")).expect_err("no file");
        assert!(error.to_string().contains("none.toml: cannot be read"));
    }

    #[test]
    fn edit_distances_of_known_pairs() {
        for (a, b, distance) in [("", "abc", 3), ("kitten", "sitting", 3), ("tau", "tau", 0)] {
            assert_eq!(edit_distance(a, b), distance);
        }
    }
}
