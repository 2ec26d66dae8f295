//! STL, ascii and binary: triangles that do not know their neighbours, welded by exact position.
//!
//! Binary: 80 bytes of title, a count, then 50 bytes a triangle (normal, three corners, two spare
//! bytes), little-endian. Vertices are numbered as they first appear.

use super::source::{Problems, Surface};
use crate::geometry::Vec3;
use crate::problem::Problem;
use std::collections::HashMap;

/// Bytes before the first triangle, and bytes of one.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Reads an STL file, or says everything that is wrong with it.
pub(crate) fn parse(bytes: &[u8]) -> Result<Surface, Vec<Problem>> {
    let mut problems = Problems::default();
    let corners = if is_binary(bytes) {
        binary(bytes, &mut problems)
    } else {
        ascii(bytes, &mut problems)
    };
    if corners.is_empty() {
        problems.whole("holds no triangles: it is empty or no STL file");
    }
    problems.unless_any(()).map(|()| weld(&corners))
}

/// Whether the length is what the count of a binary file makes it. (Some binary files start with
/// "solid" too, so the word decides nothing.)
pub(crate) fn is_binary(bytes: &[u8]) -> bool {
    bytes.len() >= HEADER && {
        let count = [bytes[80], bytes[81], bytes[82], bytes[83]];
        u64::from(u32::from_le_bytes(count)) * TRIANGLE as u64 + HEADER as u64 == bytes.len() as u64
    }
}

fn binary(bytes: &[u8], problems: &mut Problems) -> Vec<Vec3> {
    let mut corners = Vec::with_capacity((bytes.len() - HEADER) / TRIANGLE * 3);
    for (t, triangle) in bytes[HEADER..].chunks_exact(TRIANGLE).enumerate() {
        for corner in triangle[12..48].chunks_exact(12) {
            let number = |k: usize| {
                let word = [corner[k], corner[k + 1], corner[k + 2], corner[k + 3]];
                f64::from(f32::from_le_bytes(word))
            };
            let p = Vec3::new(number(0), number(4), number(8));
            for value in &p {
                problems.check_coordinate(*value, || format!("triangle {t}"));
            }
            corners.push(p);
        }
    }
    corners
}

/// `vertex x y z` lines; everything between them is only decoration.
fn ascii(bytes: &[u8], problems: &mut Problems) -> Vec<Vec3> {
    let mut corners = Vec::new();
    for (i, line) in String::from_utf8_lossy(bytes).lines().enumerate() {
        let place = || format!("line {}", i + 1);
        let words: Vec<&str> = line.split_whitespace().collect();
        match *words {
            ["vertex", x, y, z] => {
                let mut p = Vec3::zeros();
                for (value, word) in p.iter_mut().zip([x, y, z]) {
                    match word.parse() {
                        Ok(number) => *value = number,
                        Err(_) => problems.at(place(), format!("`{word}` is not a number")),
                    }
                    problems.check_coordinate(*value, place);
                }
                corners.push(p);
            }
            ["vertex", ..] => problems.at(place(), "a vertex needs three numbers"),
            ["endloop"] if corners.len() % 3 != 0 => {
                problems.at(place(), "a facet needs exactly three vertices");
                corners.truncate(corners.len() / 3 * 3);
            }
            _ => {}
        }
    }
    if corners.len() % 3 != 0 {
        problems.whole("the file ends in the middle of a facet");
    }
    corners
}

fn weld(corners: &[Vec3]) -> Surface {
    let mut surface = Surface::default();
    let mut index_of: HashMap<[u64; 3], u32> = HashMap::new();
    let mut vertices = Vec::with_capacity(corners.len());
    for p in corners {
        // Adding 0 turns −0 into 0.
        let key = [p.x, p.y, p.z].map(|c| (c + 0.0).to_bits());
        let v = *index_of.entry(key).or_insert_with(|| {
            surface.positions.push(*p);
            surface.positions.len() as u32 - 1
        });
        vertices.push(v);
    }
    surface.polygons = vertices.chunks_exact(3).map(<[u32]>::to_vec).collect();
    surface
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::fmt::Write as _;

    /// Two triangles of a unit square, once with −0 where the other has 0.
    const CORNERS: [[f32; 3]; 6] = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [1.0, 1.0, 0.0],
        [-0.0, 0.0, -0.0],
        [1.0, 1.0, 0.0],
        [0.0, 1.0, 0.0],
    ];

    fn binary_square() -> Vec<u8> {
        let mut bytes = b"solid in name only".to_vec();
        bytes.resize(80, b' ');
        bytes.extend(2_u32.to_le_bytes());
        for triangle in CORNERS.chunks(3) {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|c| c.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    fn ascii_square() -> String {
        let mut text = String::from("solid square\n");
        for triangle in CORNERS.chunks(3) {
            text += "facet normal 0 0 1\n outer loop\n";
            for [x, y, z] in triangle {
                writeln!(text, "  vertex {x:e} {y} {z}").unwrap();
            }
            text += " endloop\nendfacet\n";
        }
        text + "endsolid\n"
    }

    #[test]
    fn shared_corners_are_welded_in_order_of_appearance() {
        for bytes in [binary_square(), ascii_square().into_bytes()] {
            let surface = parse(&bytes).unwrap();
            assert_eq!(surface.positions.len(), 4);
            assert_eq!(surface.polygons, [[0, 1, 2], [0, 2, 3]]);
        }
    }

    #[test]
    fn non_finite_corners_and_cut_facets_are_told() {
        let mut bytes = binary_square();
        bytes[HEADER + 12..HEADER + 16].copy_from_slice(&f32::NAN.to_le_bytes());
        assert_eq!(parse(&bytes).unwrap_err()[0].place, "triangle 0");
        let text = ascii_square().replacen("  vertex 1e0 1 0\n", "", 1);
        assert_eq!(parse(text.as_bytes()).unwrap_err()[0].place, "line 6");
        assert!(parse(b"solid\nendsolid\n").is_err());
    }

    proptest! {
        #[test]
        fn damaged_files_never_panic(at in 0_usize..184, byte: u8, cut in 0_usize..184) {
            let mut bytes = binary_square();
            bytes[at] = byte;
            bytes.truncate(184 - cut);
            let _ = parse(&bytes);
        }
    }
}
