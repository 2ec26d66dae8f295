//! Parameters: the commented defaults, and reading a user's own.
//!
//! A file has the tables of [`RefitParams`] at its top, and `[read]`. [`TEMPLATE`] is what
//! `dress params` prints; it is written by hand, and a test holds it to the defaults of the structs:
//! same values, every key, each with a comment above it.

pub mod fabric;

use dress_anyone::garment::Fabric;
use dress_anyone::io::file::{MEBIBYTE, read_capped};
use dress_anyone::io::garmentcode::RotationOrder;
use dress_anyone::problem::{BadInput, Problem};
use dress_anyone::refit::RefitParams;
use fabric::ToldFabrics;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;
use toml::de::{DeTable, Deserializer, ValueDeserializer};
use toml::{Spanned, Table, Value};

/// All parameters of the program.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Params {
    /// Reading files.
    pub read: ReadParams,
    /// Draping and refitting.
    #[serde(flatten)]
    pub refit: RefitParams,
}

/// What files leave open.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct ReadParams {
    /// Length of mesh edges where a pattern has to be meshed \[m\].
    pub resolution: f64,
    /// How the angles of a GarmentCode panel combine.
    pub panel_rotation: RotationOrder,
}

impl Default for ReadParams {
    fn default() -> Self {
        Self {
            resolution: 0.02,
            panel_rotation: RotationOrder::default(),
        }
    }
}

/// All parameters at their defaults, with what they mean.
pub const TEMPLATE: &str = include_str!("params.toml");

/// Parameter files are short.
const LIMIT: u64 = MEBIBYTE;

/// Numbers that must be above zero: others may be zero, and none is negative.
const POSITIVE: [&str; 15] = [
    "read.resolution",
    "fabric.warp",
    "fabric.weft",
    "fabric.shear",
    "fabric.density",
    "fabric.thickness",
    "sim.contact.stiffness",
    "sim.layers.thickness",
    "sim.layers.stiffness",
    "sim.step.dt",
    "sim.step.speed",
    "sim.equilibrium.step",
    "transfer.spacing",
    "transfer.place",
    "descent.step",
];

/// The parameters in a TOML file; keys it leaves out keep their defaults. `whole` stands in for its
/// table `[fabric]`.
pub fn read(path: &Path, whole: Option<Fabric>) -> Result<Params, BadInput> {
    let bytes = read_capped(path, LIMIT)?;
    let bad = |problems| BadInput::new(path, problems);
    let text = String::from_utf8(bytes)
        .map_err(|_| bad(vec![Problem::whole("this is no text; parameters are TOML")]))?;
    parse(&text, whole).map_err(bad)
}

/// [`read`] of a file's text.
fn parse(text: &str, whole: Option<Fabric>) -> Result<Params, Vec<Problem>> {
    let given: Table = text
        .parse()
        .map_err(|error| vec![in_plain_words(text, &error)])?;
    let known = known();
    let mut problems = Vec::new();
    unknown_keys(&given, &known, &mut Vec::new(), &known, &mut problems);
    numbers_out_of_range(&given, "", &mut problems);
    fabric::zone_problems(&given, &known, &mut problems);
    if !problems.is_empty() {
        return Err(problems);
    }
    let (mut params, told) = typed(text).map_err(|error| vec![in_plain_words(text, &error)])?;
    told.over(whole, &mut params.refit)?;
    Ok(params)
}

/// The parameters in `text`, and what it tells of fabrics; errors know their place in it.
fn typed(text: &str) -> Result<(Params, ToldFabrics), toml::de::Error> {
    let mut table = DeTable::parse(text)?;
    let told = ToldFabrics {
        whole: taken(&mut table, "fabric")?,
        zones: taken(&mut table, "fabric_zones")?,
    };
    let params = Params {
        read: taken(&mut table, "read")?,
        refit: RefitParams::deserialize(Deserializer::from(table))?,
    };
    Ok((params, told))
}

/// The value of `key`, which is taken out of the table; its default if it is not there.
fn taken<T: DeserializeOwned + Default>(
    table: &mut Spanned<DeTable<'_>>,
    key: &str,
) -> Result<T, toml::de::Error> {
    match table.get_mut().remove(key) {
        Some(value) => T::deserialize(ValueDeserializer::from(value)),
        None => Ok(T::default()),
    }
}

/// All keys with their defaults.
fn defaults() -> Table {
    Table::try_from(Params::default()).expect("parameters are a table")
}

/// All keys that a file may have: the defaults', and a fabric's name.
fn known() -> Table {
    let mut known = defaults();
    if let Some(Value::Table(fabric)) = known.get_mut("fabric") {
        fabric.insert("like".to_owned(), Value::String(String::new()));
    }
    known
}

/// Numbers of `table`, called `name`, that are no amounts.
fn numbers_out_of_range(table: &Table, name: &str, problems: &mut Vec<Problem>) {
    for (key, value) in table {
        let path = joined(name, key);
        let number = match value {
            Value::Table(inside) => {
                numbers_out_of_range(inside, &path, problems);
                continue;
            }
            Value::Float(number) => *number,
            Value::Integer(number) => *number as f64,
            _ => continue,
        };
        let positive = POSITIVE.contains(&path.as_str());
        if !number.is_finite() || number < 0.0 || (positive && number == 0.0) {
            let wanted = if positive {
                "above zero"
            } else {
                "zero or above"
            };
            let text = format!("`{number}` must be a finite number, {wanted}");
            problems.push(Problem::at(format!("key `{path}`"), text));
        }
    }
}

/// "table.key", or the key alone at the top.
fn joined(table: &str, key: &str) -> String {
    if table.is_empty() {
        key.to_owned()
    } else {
        format!("{table}.{key}")
    }
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
            found.extend(tables_with(key, inside, &joined(name, inner)));
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
    use dress_anyone::transfer::Ease;

    /// What is wrong with a template.
    fn template_problems(template: &str) -> Vec<String> {
        let mut problems = Vec::new();
        match parse(template, None) {
            Ok(params) if params == Params::default() => {}
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
                explained.extend(commented.then(|| joined(&table, key.trim())));
            }
            above = line;
        }
        for key in all_keys(&defaults(), "") {
            if !explained.contains(&key) {
                problems.push(format!("`{key}` is missing, or has no comment above it"));
            }
        }
        problems
    }

    fn all_keys(table: &Table, name: &str) -> Vec<String> {
        let mut keys = Vec::new();
        for (key, value) in table {
            let path = joined(name, key);
            if let Value::Table(inside) = value {
                keys.extend(all_keys(inside, &path));
            }
            keys.push(path);
        }
        keys
    }

    fn lines_of(text: &str) -> Vec<String> {
        let problems = parse(text, None).expect_err("bad parameters");
        problems.iter().map(ToString::to_string).collect()
    }

    #[test]
    fn the_template_says_the_defaults_and_explains_every_key() {
        assert_eq!(template_problems(TEMPLATE), [""; 0]);
    }

    #[test]
    fn a_template_with_a_gap_is_found_out() {
        let bare = TEMPLATE.replace("drag = ", "\ndrag = ");
        assert_eq!(
            template_problems(&bare),
            ["`sim.step.drag` is missing, or has no comment above it"]
        );
        let other = TEMPLATE.replace("symmetry = true", "symmetry = false");
        assert_eq!(
            template_problems(&other),
            ["a value differs from the default"]
        );
    }

    #[test]
    fn keys_left_out_keep_their_defaults() {
        let params = parse("[sim.step]\nsweeps = 7\n", None).expect("good parameters");
        let mut expected = Params::default();
        expected.refit.sim.step.sweeps = 7;
        assert_eq!(params, expected);
        // A whole number where a fraction is expected is fine.
        let params = parse("fabric.warp = 500", None).expect("good parameters");
        assert_eq!(params.refit.fabric.warp, 500.0);
    }

    #[test]
    fn ease_is_a_word_or_a_blend() {
        let ease = |text: &str| {
            parse(text, None)
                .expect("good parameters")
                .refit
                .transfer
                .ease
        };
        assert_eq!(ease("transfer.ease = \"relative\""), Ease::Relative);
        assert_eq!(ease("transfer.ease = { blend = 0.5 }"), Ease::Blend(0.5));
    }

    #[test]
    fn every_unknown_key_is_named_with_advice() {
        let text = "verbosity = 1\n[fabric]\nbendign = 1e-5\ndrag = 0.1\n[read]\nbananas = 3\n";
        assert_eq!(
            lines_of(text),
            [
                "key `fabric.bendign`: there is no such key; did you mean `bending`?",
                "key `fabric.drag`: there is no such key here; it belongs to [sim.step]",
                "key `read.bananas`: there is no such key; known here: `panel_rotation`, \
                 `resolution`",
                "key `verbosity`: there is no such key; known here: `cage`, `coarse`, `descent`, `fabric`, \
                 `fabric_zones`, `folds`, `hold`, `loss`, `medium`, `outline_tolerance`, `read`, `sim`, `symmetry`, `transfer`",
            ]
        );
    }

    #[test]
    fn a_wrong_value_is_told_with_its_line() {
        for (text, line) in [
            ("# a\n[sim.step]\nsweeps = \"many\"\n", "line 3"),
            ("[read]\nresolution = \"fine\"\n", "line 2"),
            ("[sim\n", "line 1"),
        ] {
            assert_eq!(
                parse(text, None).expect_err("bad parameters")[0].place,
                line
            );
        }
    }

    #[test]
    fn numbers_that_are_no_amounts_are_refused() {
        assert_eq!(
            lines_of("[read]\nresolution = 0\n[loss]\nseam = nan\narea = -1\ninterior = 0\n"),
            [
                "key `loss.area`: `-1` must be a finite number, zero or above",
                "key `loss.seam`: `NaN` must be a finite number, zero or above",
                "key `read.resolution`: `0` must be a finite number, above zero",
            ]
        );
    }

    #[test]
    fn every_key_that_must_be_positive_exists() {
        let keys = all_keys(&defaults(), "");
        for key in POSITIVE {
            assert!(keys.iter().any(|known| known == key), "{key}");
        }
    }

    #[test]
    fn edit_distances_of_known_pairs() {
        for (a, b, distance) in [("", "abc", 3), ("kitten", "sitting", 3), ("tau", "tau", 0)] {
            assert_eq!(edit_distance(a, b), distance);
        }
    }
}
