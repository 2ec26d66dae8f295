//! What kind of file some bytes are, for messages about a file that is not what was asked for.

/// Openings by which files are recognised.
const SIGNATURES: [(&[u8], &str); 10] = [
    (b"{", "a JSON document"),
    (b"ply", "a PLY mesh"),
    (b"solid", "an STL mesh"),
    (b"glTF", "a glTF scene"),
    (b"Kaydara", "an FBX scene"),
    (b"<", "an SVG or other XML file"),
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
    let signature = SIGNATURES
        .iter()
        .find(|(signature, _)| text.starts_with(signature));
    if let Some((_, kind)) = signature {
        return Some(kind);
    }
    text.split(|&b| b == b'\n')
        .take(LINES)
        .any(|line| OBJ_LINES.iter().any(|tag| line.starts_with(tag)))
        .then_some("an OBJ mesh")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn usual_files_are_told_apart() {
        assert_eq!(of(b"\n {\"a\": 1}"), Some("a JSON document"));
        assert_eq!(of(b"# made by hand\nv 0 0 0\n"), Some("an OBJ mesh"));
        assert_eq!(of(b"PK\x03\x04..."), Some("a zip archive"));
        assert_eq!(of(b"very plain words"), None);
        assert_eq!(of(b""), None);
    }
}
