//! JSON as people make it: errors by line and column in plain words, and no key twice.
//!
//! A repeated key would silently drop a panel, so it is refused. Numbers are finite by the grammar;
//! depth is limited by serde_json (128).

use crate::problem::{BadInput, Problem};
use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::error::Category;
use serde_json::{Map, Number, Value};
use std::fmt;
use std::path::Path;

/// The JSON document in `bytes`, read from `file`.
pub fn parse(file: &Path, bytes: &[u8]) -> Result<Value, BadInput> {
    let text = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    match serde_json::from_slice::<Strict>(text) {
        Ok(Strict(value)) => Ok(value),
        Err(error) => Err(BadInput::one(file, in_plain_words(&error, text))),
    }
}

fn in_plain_words(error: &serde_json::Error, text: &[u8]) -> Problem {
    if text.trim_ascii().is_empty() {
        return Problem::whole("the file is empty");
    }
    let place = format!("line {}, column {}", error.line(), error.column());
    let suffix = format!(" at line {} column {}", error.line(), error.column());
    let message = error.to_string().replace(&suffix, "");
    let words = if error.classify() == Category::Eof {
        "the file ends in the middle of the JSON; it looks cut off, so save or fetch it again"
            .to_owned()
    } else if message == "number out of range" {
        "a number is too large to be a measurement".to_owned()
    } else if message == "recursion limit exceeded" {
        "lists are nested too deeply to be a pattern".to_owned()
    } else if let Some(word) = not_a_number(error, text) {
        format!("`{word}` is not a number; every measurement must be one")
    } else if error.classify() == Category::Data {
        message
    } else {
        format!("this is not valid JSON: {message}")
    };
    Problem::at(place, words)
}

/// The word by which some programs write a number that is none, if it is what stopped the parser.
fn not_a_number(error: &serde_json::Error, text: &[u8]) -> Option<&'static str> {
    let line = text.split(|&b| b == b'\n').nth(error.line() - 1)?;
    // The column is that of the last byte looked at, one or two into the word.
    let from = error.column().saturating_sub(3);
    let near = line
        .get(from..)?
        .split(|&b| b == b',' || b == b']')
        .next()?;
    ["NaN", "nan", "Infinity", "inf"]
        .into_iter()
        .find(|word| near.windows(word.len()).any(|w| w == word.as_bytes()))
}

/// A JSON value in which no object has a key twice.
struct Strict(Value);

impl<'de> Deserialize<'de> for Strict {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(StrictVisitor).map(Self)
    }
}

struct StrictVisitor;

impl<'de> Visitor<'de> for StrictVisitor {
    type Value = Value;

    fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a JSON value")
    }

    fn visit_unit<E>(self) -> Result<Value, E> {
        Ok(Value::Null)
    }

    fn visit_bool<E>(self, value: bool) -> Result<Value, E> {
        Ok(Value::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_u64<E>(self, value: u64) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_f64<E>(self, value: f64) -> Result<Value, E> {
        Ok(Number::from_f64(value).map_or(Value::Null, Value::Number))
    }

    fn visit_str<E>(self, value: &str) -> Result<Value, E> {
        Ok(value.into())
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Value, A::Error> {
        let mut values = Vec::new();
        while let Some(Strict(value)) = list.next_element()? {
            values.push(value);
        }
        Ok(Value::Array(values))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Value, A::Error> {
        let mut object = Map::new();
        while let Some(key) = map.next_key::<String>()? {
            if object.contains_key(&key) {
                return Err(A::Error::custom(format!(
                    "`{key}` appears a second time here; give the two different names or remove one"
                )));
            }
            let Strict(value) = map.next_value()?;
            object.insert(key, value);
        }
        Ok(Value::Object(object))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn complaint(text: &str) -> String {
        parse(Path::new("p.json"), text.as_bytes())
            .unwrap_err()
            .to_string()
    }

    #[test]
    fn a_document_is_read_as_serde_json_reads_it() {
        let text = r#"{"b": [1, -2, 0.1, 1e-3, true, null, "xA"], "a": {"c": {}}}"#;
        let ours = parse(Path::new("p.json"), text.as_bytes()).unwrap();
        assert_eq!(ours, serde_json::from_str::<Value>(text).unwrap());
        let keys: Vec<_> = ours.as_object().unwrap().keys().collect();
        assert_eq!(keys, ["b", "a"]);
    }

    #[test]
    fn a_byte_order_mark_is_no_matter() {
        assert_eq!(
            parse(Path::new("p"), b"\xef\xbb\xbf[]").unwrap(),
            Value::Array(vec![])
        );
    }

    #[test]
    fn each_mistake_is_told_in_plain_words_at_its_place() {
        for (text, words) in [
            ("", "the file is empty"),
            (
                "{\"a\": [1,\n 2",
                "line 2, column 2: the file ends in the middle",
            ),
            (
                "{\"a\":\n 1e400}",
                "line 2, column 6: a number is too large",
            ),
            ("{\"a\": NaN}", "`NaN` is not a number"),
            ("{\"a\": [1, -Infinity]}", "`Infinity` is not a number"),
            (
                "{\"a\": 1,\n\"a\": 2}",
                "line 2, column 3: `a` appears a second time",
            ),
            ("{\"a\" 1}", "not valid JSON: expected `:`"),
            (&"[".repeat(500), "nested too deeply"),
        ] {
            let told = complaint(text);
            assert!(told.contains(words), "{text:.40}: {told}");
        }
    }
}
