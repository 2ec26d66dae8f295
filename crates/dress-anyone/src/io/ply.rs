//! PLY: ascii and binary, both byte orders; `x y z` of the vertices, `vertex_indices` of the faces.
//!
//! Format: G. Turk, "The PLY Polygon File Format". Other elements and properties are stepped over.
//! A header's counts are believed only as far as the file's own size can bear them out.

use super::source::{Problems, Surface};
use crate::geometry::Vec3;
use crate::problem::Problem;

/// Reads a PLY file, or says everything that is wrong with it.
pub(crate) fn parse(bytes: &[u8]) -> Result<Surface, Vec<Problem>> {
    let (header, body) = header(bytes).map_err(|problem| vec![problem])?;
    let mut values = match header.encoding {
        Encoding::Ascii => Values::Ascii(Words(body)),
        Encoding::Little => Values::Binary(body, false),
        Encoding::Big => Values::Binary(body, true),
    };
    let mut surface = Surface::default();
    let mut problems = Problems::default();
    for element in &header.elements {
        // Every element with a property takes a byte at least; one without takes none.
        let believable = element.properties.is_empty() || element.count <= values.remaining();
        if !believable
            || element
                .read(&mut values, &mut surface, &mut problems)
                .is_none()
        {
            problems.at(
                format!("element `{}`", element.name),
                format!(
                    "the header promises {} but the file ends before or holds something that \
                         is no number: export it again",
                    element.count
                ),
            );
            break;
        }
    }
    check(&surface, &mut problems);
    problems.unless_any(surface)
}

#[derive(Clone, Copy)]
enum Encoding {
    Ascii,
    Little,
    Big,
}

struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
}

struct Element {
    name: String,
    count: usize,
    properties: Vec<Property>,
}

struct Property {
    name: String,
    /// Type of the length, for a list.
    list: Option<Scalar>,
    item: Scalar,
}

#[derive(Clone, Copy)]
struct Scalar {
    bytes: usize,
    kind: Kind,
}

#[derive(Clone, Copy)]
enum Kind {
    Signed,
    Unsigned,
    Float,
}

/// The header, and the bytes after it.
fn header(bytes: &[u8]) -> Result<(Header, &[u8]), Problem> {
    let mut encoding = None;
    let mut elements: Vec<Element> = Vec::new();
    let mut rest = bytes;
    for number in 1.. {
        let end = rest.iter().position(|b| *b == b'\n');
        let Some(end) = end else {
            return Err(Problem::whole("the PLY header has no `end_header` line"));
        };
        let line = String::from_utf8_lossy(&rest[..end]).into_owned();
        rest = &rest[end + 1..];
        let wrong = || {
            let place = format!("line {number}");
            Problem::at(place, format!("`{}` is not understood", line.trim()))
        };
        match *line.split_whitespace().collect::<Vec<_>>() {
            ["end_header"] => break,
            ["format", name, _] => {
                encoding = Some(match name {
                    "ascii" => Encoding::Ascii,
                    "binary_little_endian" => Encoding::Little,
                    "binary_big_endian" => Encoding::Big,
                    _ => return Err(wrong()),
                });
            }
            ["element", name, count] => elements.push(Element {
                name: name.to_owned(),
                count: count.parse().map_err(|_| wrong())?,
                properties: Vec::new(),
            }),
            ["property", ref kind @ .., name] => {
                let property = property(kind, name).ok_or_else(wrong)?;
                elements
                    .last_mut()
                    .ok_or_else(wrong)?
                    .properties
                    .push(property);
            }
            // `ply`, `comment`, `obj_info`.
            _ => {}
        }
    }
    let encoding = encoding.ok_or_else(|| Problem::whole("the PLY header has no `format` line"))?;
    Ok((Header { encoding, elements }, rest))
}

fn property(kind: &[&str], name: &str) -> Option<Property> {
    let (list, item) = match *kind {
        ["list", length, item] => (Some(scalar(length)?), scalar(item)?),
        [item] => (None, scalar(item)?),
        _ => return None,
    };
    let name = name.to_owned();
    Some(Property { name, list, item })
}

fn scalar(name: &str) -> Option<Scalar> {
    let (bytes, kind) = match name {
        "char" | "int8" => (1, Kind::Signed),
        "short" | "int16" => (2, Kind::Signed),
        "int" | "int32" => (4, Kind::Signed),
        "uchar" | "uint8" => (1, Kind::Unsigned),
        "ushort" | "uint16" => (2, Kind::Unsigned),
        "uint" | "uint32" => (4, Kind::Unsigned),
        "float" | "float32" => (4, Kind::Float),
        "double" | "float64" => (8, Kind::Float),
        _ => return None,
    };
    Some(Scalar { bytes, kind })
}

impl Element {
    /// Reads all of them; none if the file ends too early.
    fn read(
        &self,
        values: &mut Values,
        surface: &mut Surface,
        problems: &mut Problems,
    ) -> Option<()> {
        let count = if self.properties.is_empty() {
            0
        } else {
            self.count
        };
        let mut list = Vec::new();
        for i in 0..count {
            let mut position = Vec3::repeat(f64::NAN);
            for property in &self.properties {
                property.read(values, &mut list)?;
                match (self.name.as_str(), property.name.as_str()) {
                    ("vertex", "x") => position.x = list[0],
                    ("vertex", "y") => position.y = list[0],
                    ("vertex", "z") => position.z = list[0],
                    ("face", "vertex_indices" | "vertex_index") => {
                        surface.polygons.push(polygon(&list, i, problems));
                    }
                    _ => {}
                }
            }
            if self.name == "vertex" {
                surface.positions.push(position);
            }
        }
        Some(())
    }
}

/// A negative or fractional index becomes one that no file has.
fn polygon(list: &[f64], face: usize, problems: &mut Problems) -> Vec<u32> {
    if list.len() < 3 {
        problems.at(format!("face {face}"), "a face needs three corners or more");
    }
    let index = |value: &f64| {
        if *value < 0.0 || value.fract() != 0.0 {
            u32::MAX
        } else {
            *value as u32
        }
    };
    list.iter().map(index).collect()
}

impl Property {
    /// The items of a list, or the one value, into `list`; none if the file ends too early.
    fn read(&self, values: &mut Values, list: &mut Vec<f64>) -> Option<()> {
        let length = match self.list {
            Some(kind) => values.next(kind)?,
            None => 1.0,
        };
        // Each item takes a byte at least, so a longer list cannot be.
        if !(0.0..=values.remaining() as f64).contains(&length) {
            return None;
        }
        list.clear();
        for _ in 0..length as usize {
            list.push(values.next(self.item)?);
        }
        Some(())
    }
}

/// The numbers after the header.
enum Values<'a> {
    Ascii(Words<'a>),
    /// Bytes, and whether the most significant comes first.
    Binary(&'a [u8], bool),
}

/// Bytes read word by word.
struct Words<'a>(&'a [u8]);

impl Values<'_> {
    /// Bytes left.
    fn remaining(&self) -> usize {
        match self {
            Self::Ascii(Words(rest)) | Self::Binary(rest, _) => rest.len(),
        }
    }

    fn next(&mut self, scalar: Scalar) -> Option<f64> {
        match self {
            Self::Ascii(words) => words.next()?.parse().ok(),
            Self::Binary(rest, big) => {
                let (word, after) = rest.split_at_checked(scalar.bytes)?;
                *rest = after;
                Some(number(word, *big, scalar.kind))
            }
        }
    }
}

impl<'a> Iterator for Words<'a> {
    type Item = &'a str;

    fn next(&mut self) -> Option<&'a str> {
        let rest = self.0.trim_ascii_start();
        let end = rest
            .iter()
            .position(u8::is_ascii_whitespace)
            .unwrap_or(rest.len());
        let (word, after) = rest.split_at(end);
        self.0 = after;
        std::str::from_utf8(word).ok()
    }
}

/// A binary number of 1, 2, 4 or 8 bytes.
fn number(word: &[u8], big: bool, kind: Kind) -> f64 {
    let byte = |bits: u64, b: &u8| bits << 8 | u64::from(*b);
    let bits = if big {
        word.iter().fold(0, byte)
    } else {
        word.iter().rev().fold(0, byte)
    };
    match (kind, word.len()) {
        (Kind::Unsigned, _) => bits as f64,
        (Kind::Signed, length) => {
            let unused = 64 - 8 * length as u32;
            ((bits << unused).cast_signed() >> unused) as f64
        }
        (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
        (Kind::Float, _) => f64::from_bits(bits),
    }
}

fn check(surface: &Surface, problems: &mut Problems) {
    let count = surface.positions.len();
    if count == 0 {
        problems.whole("holds no vertices");
    }
    for (i, p) in surface.positions.iter().enumerate() {
        for value in p {
            problems.check_coordinate(*value, || format!("vertex {i}"));
        }
    }
    for (i, polygon) in surface.polygons.iter().enumerate() {
        if let Some(v) = polygon.iter().find(|v| **v as usize >= count) {
            let text = format!("vertex {v} does not exist: the file has {count}, counted from 0");
            problems.at(format!("face {i}"), text);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const ASCII: &str = "ply\r\nformat ascii 1.0\ncomment x\nelement vertex 4\nproperty float x\n\
        property float y\nproperty float z\nproperty uchar red\nelement face 2\n\
        property list uchar int vertex_indices\nend_header\n\
        0 0 0 255\n1 0 0 255\n1 1 0.5 255\n0 -1 0 255\n3 0 1 2\n4 0 1 2 3\n";

    /// The same mesh in binary, without the colour.
    fn binary(big: bool) -> Vec<u8> {
        let name = if big { "big" } else { "little" };
        let mut bytes = format!(
            "ply\nformat binary_{name}_endian 1.0\nelement vertex 4\nproperty float x\n\
             property double y\nproperty float z\nelement face 2\n\
             property list uchar short vertex_index\nend_header\n"
        )
        .into_bytes();
        let mut put = |mut little: Vec<u8>| {
            if big {
                little.reverse();
            }
            bytes.extend(little);
        };
        for [x, y, z] in [
            [0.0_f32, 0.0, 0.0],
            [1.0, 0.0, 0.0],
            [1.0, 1.0, 0.5],
            [0.0, -1.0, 0.0],
        ] {
            put(x.to_le_bytes().to_vec());
            put(f64::from(y).to_le_bytes().to_vec());
            put(z.to_le_bytes().to_vec());
        }
        for face in [vec![0_i16, 1, 2], vec![0, 1, 2, 3]] {
            put(vec![face.len() as u8]);
            for v in face {
                put(v.to_le_bytes().to_vec());
            }
        }
        bytes
    }

    #[test]
    fn ascii_and_both_byte_orders_say_the_same() {
        let ascii = parse(ASCII.as_bytes()).unwrap();
        assert_eq!(ascii.positions[2], Vec3::new(1.0, 1.0, 0.5));
        assert_eq!(ascii.polygons, [vec![0, 1, 2], vec![0, 1, 2, 3]]);
        assert_eq!(parse(&binary(false)).unwrap(), ascii);
        assert_eq!(parse(&binary(true)).unwrap(), ascii);
    }

    #[test]
    fn a_header_that_promises_too_much_is_not_believed() {
        for count in ["5", "99999999999999", "18446744073709551615"] {
            let text = ASCII.replace("face 2", &format!("face {count}"));
            let problems = parse(text.as_bytes()).unwrap_err();
            assert!(problems[0].text.contains(count), "{problems:?}");
        }
        let empty = "ply\nformat ascii 1.0\nelement vertex 9999999999999999\nend_header\n";
        assert!(parse(empty.as_bytes()).is_err());
    }

    #[test]
    fn bad_numbers_and_indices_name_their_vertex_and_face() {
        let text = ASCII
            .replace("1 1 0.5", "1 1 inf")
            .replace("3 0 1 2", "3 0 1 -2");
        let problems = parse(text.as_bytes()).unwrap_err();
        let places: Vec<&str> = problems.iter().map(|p| p.place.as_str()).collect();
        assert_eq!(places, ["vertex 2", "face 0"]);
    }

    proptest! {
        #[test]
        fn damaged_files_never_panic(at in 0_usize..260, byte: u8, cut in 0_usize..260, big: bool) {
            let mut bytes = binary(big);
            let length = bytes.len();
            bytes[at % length] = byte;
            bytes.truncate(length - cut % length);
            let _ = parse(&bytes);
        }
    }
}
