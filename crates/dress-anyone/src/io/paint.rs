//! Numbers painted on a mesh: the vertex colours of an OBJ, `v x y z r g b`, as Blender and others write
//! them. Black is 0, white is 1; the three channels are averaged. Colours may run to 1 or to 255.

use super::file::{MEBIBYTE, read_capped};
use super::source::Problems;
use crate::geometry::Vec3;
use crate::problem::{BadInput, Problem};
use std::path::Path;

/// Meshes of some million vertices.
const LIMIT: u64 = 512 * MEBIBYTE;

/// The vertices in the file's unit, and what is painted on each.
pub fn read(path: &Path) -> Result<(Vec<Vec3>, Vec<f64>), BadInput> {
    let bytes = read_capped(path, LIMIT)?;
    parse(&bytes).map_err(|problems| BadInput::new(path, problems))
}

/// [`read`] of a file's bytes.
pub fn parse(bytes: &[u8]) -> Result<(Vec<Vec3>, Vec<f64>), Vec<Problem>> {
    let text = String::from_utf8_lossy(bytes);
    let mut problems = Problems::default();
    let (mut points, mut values) = (Vec::new(), Vec::new());
    for (line, text) in text.lines().enumerate() {
        let mut words = text.split_whitespace();
        if words.next() != Some("v") {
            continue;
        }
        let numbers: Vec<f64> = words.map_while(|word| word.parse().ok()).collect();
        match numbers[..] {
            [x, y, z, r, g, b] if numbers.iter().all(|n| n.is_finite()) => {
                points.push(Vec3::new(x, y, z));
                values.push((r + g + b) / 3.0);
            }
            _ => problems.at(
                format!("line {}", line + 1),
                "a painted vertex has three coordinates and three colours; export the mesh with its \
                 vertex colours",
            ),
        }
    }
    if points.is_empty() {
        problems.whole("there is no vertex with a colour in this file");
    }
    let highest = values.iter().copied().fold(0.0, f64::max);
    let white = if highest > 1.0 { 255.0 } else { 1.0 };
    for value in &mut values {
        *value /= white;
    }
    if values.iter().any(|value| !(0.0..=1.0).contains(value)) {
        problems.whole("colours must lie between 0 and 1, or between 0 and 255");
    }
    problems.unless_any((points, values))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_are_read_in_either_scale() {
        for (white, grey) in [("1 1 1", "0.5 0.5 0.5"), ("255 255 255", "255 127.5 0")] {
            let text = format!("# painted\nv 1 2 3 {white}\nvn 0 0 1\nv 4 5 6 {grey}\nf 1 2 1\n");
            let (points, values) = parse(text.as_bytes()).expect("painted");
            assert_eq!(points[1], Vec3::new(4.0, 5.0, 6.0));
            assert_eq!(values, [1.0, 0.5]);
        }
    }

    #[test]
    fn what_is_not_painted_is_told() {
        let lines = |text: &str| -> Vec<String> {
            let problems = parse(text.as_bytes()).expect_err("bad paint");
            problems.iter().map(ToString::to_string).collect()
        };
        assert!(lines("v 0 0 0\nv 1 0 0 1 1 1\n")[0].starts_with("line 1"));
        assert_eq!(lines("f 1 2 3\n").len(), 1);
        assert_eq!(lines("v 0 0 0 -1 -1 -1\n").len(), 1);
        assert!(lines("v 0 0 nan 1 1 1\n")[0].starts_with("line 1"));
    }

    proptest::proptest! {
        #[test]
        fn arbitrary_bytes_never_panic(bytes in proptest::collection::vec(proptest::num::u8::ANY, 0..200)) {
            let _ = parse(&bytes);
        }
    }
}
