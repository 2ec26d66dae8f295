//! Small values out of JSON; none when they are something else.

use serde_json::Value;

pub(super) fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list: &[Value; N] = value.as_array()?.as_slice().try_into().ok()?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}

pub(super) fn indices(value: &Value) -> Option<[usize; 2]> {
    let [one, other] = value.as_array()?.as_slice() else {
        return None;
    };
    Some([index(one)?, index(other)?])
}

pub(super) fn index(value: &Value) -> Option<usize> {
    usize::try_from(value.as_u64()?).ok()
}

/// `0`, `1`, `false` or `true`.
pub(super) fn flag(value: &Value) -> Option<bool> {
    match value.as_f64() {
        Some(0.0) => Some(false),
        Some(1.0) => Some(true),
        _ => value.as_bool(),
    }
}

pub(super) fn label(value: &Value) -> Option<String> {
    let label = value.get("label")?.as_str()?;
    (!label.is_empty()).then(|| label.to_owned())
}

/// The beginning of a value, for a message.
pub(super) fn show(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(60) {
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}
