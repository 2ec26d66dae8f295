//! What kind of file some bytes are: to choose its reader, and for messages about a file that is not
//! what was asked for.

use super::stl;

/// Of patterns.
pub const JSON: &str = "a JSON document";
/// Of bodies and drapes.
pub const OBJ: &str = "an OBJ mesh";
/// Of bodies.
pub const PLY: &str = "a PLY mesh";
/// Of bodies.
pub const STL: &str = "an STL mesh";
/// Of drawings.
pub const XML: &str = "an SVG or other XML file";

/// Openings by which files are recognised.
const SIGNATURES: [(&[u8], &str); 10] = [
    (b"{", JSON),
    (b"ply", PLY),
    (b"solid", STL),
    (b"glTF", "a glTF scene"),
    (b"Kaydara", "an FBX scene"),
    (b"<", XML),
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture"),
    (b"\xff\xd8", "a picture"),
    (b"PK\x03\x04", "a zip archive"),
];

/// Lines of an OBJ begin with one of these.
const OBJ_LINES: [&[u8]; 4] = [b"v ", b"vt ", b"f ", b"mtllib "];

/// Lines searched for one of an OBJ; comments may come first.
const LINES: usize = 200;

/// The kind of file that begins with `bytes`, as in "this looks like …"; none when it is not known.
pub fn of(bytes: &[u8]) -> Option<&'static str> {
    let text = bytes.trim_ascii_start();
    let opens = |(signature, _): &&(&[u8], &'static str)| text.starts_with(signature);
    // A binary STL may begin with any words.
    if stl::is_binary(bytes) {
        Some(STL)
    } else if let Some((_, kind)) = SIGNATURES.iter().find(opens) {
        Some(*kind)
    } else {
        text.split(|&b| b == b'\n')
            .take(LINES)
            .any(|line| OBJ_LINES.iter().any(|tag| line.starts_with(tag)))
            .then_some(OBJ)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_files_are_told_apart() {
        assert_eq!(of(b"\n {\"a\": 1}"), Some(JSON));
        assert_eq!(of(b"# made by hand\nv 0 0 0\n"), Some(OBJ));
        assert_eq!(of(b"PK\x03\x04..."), Some("a zip archive"));
        assert_eq!(of(b"very plain words"), None);
        assert_eq!(of(b""), None);
    }

    #[test]
    fn a_binary_stl_is_one_whatever_its_header_says() {
        // 80 bytes of words, then the number of triangles: none.
        let mut stl = b"<ply solid>".to_vec();
        stl.resize(84, 0);
        assert_eq!(of(&stl), Some(STL));
    }
}
