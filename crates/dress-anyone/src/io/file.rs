//! Reading a file whole, up to a size, with errors in plain words.
//!
//! At most one byte more than the limit is ever read, whatever the file claims to be: a device or a
//! pipe that never ends is refused like any other file that is too large.

use crate::problem::{BadInput, Problem};
use std::fs::File;
use std::io::{ErrorKind, Read};
use std::path::Path;

/// One mebibyte, the unit in which limits are told.
pub const MEBIBYTE: u64 = 1 << 20;

/// The bytes of the file at `path`, refused when there are more than `limit`.
pub fn read_capped(path: &Path, limit: u64) -> Result<Vec<u8>, BadInput> {
    let refuse = |text: String| BadInput::one(path, Problem::whole(text));
    if path.is_dir() {
        return Err(refuse(
            "this is a folder, not a file; name the file in it".to_owned(),
        ));
    }
    let file = File::open(path).map_err(|e| refuse(in_plain_words(&e)))?;
    let mut bytes = Vec::new();
    file.take(limit + 1)
        .read_to_end(&mut bytes)
        .map_err(|e| refuse(in_plain_words(&e)))?;
    if bytes.len() as u64 > limit {
        return Err(refuse(format!(
            "the file is larger than {}, the most that is read of this kind; is it the right file?",
            size_in_words(limit)
        )));
    }
    Ok(bytes)
}

/// What the operating system complained of, for someone who does not know its names.
pub(crate) fn in_plain_words(error: &std::io::Error) -> String {
    match error.kind() {
        ErrorKind::NotFound => "there is no such file or folder; check the spelling".to_owned(),
        ErrorKind::PermissionDenied => {
            "you are not allowed to open it; check its permissions".to_owned()
        }
        ErrorKind::NotADirectory => {
            "a part of this path is a file where a folder is needed".to_owned()
        }
        ErrorKind::StorageFull => "the disk is full".to_owned(),
        ErrorKind::ReadOnlyFilesystem => "the disk can only be read, not written".to_owned(),
        _ => format!("the system reports: {error}"),
    }
}

fn size_in_words(bytes: u64) -> String {
    if bytes >= MEBIBYTE {
        format!("{} MiB", bytes / MEBIBYTE)
    } else {
        format!("{bytes} bytes")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_up_to_the_limit_is_read_and_one_byte_more_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("five.txt");
        std::fs::write(&path, b"12345").unwrap();
        assert_eq!(read_capped(&path, 5).unwrap(), b"12345");
        let error = read_capped(&path, 4).unwrap_err().to_string();
        assert!(error.contains("larger than 4 bytes"), "{error}");
    }

    #[test]
    fn a_missing_file_and_a_folder_are_named_as_such() {
        let folder = tempfile::tempdir().unwrap();
        let missing = read_capped(&folder.path().join("nothing"), 1).unwrap_err();
        assert!(missing.to_string().contains("no such file"), "{missing}");
        let directory = read_capped(folder.path(), 1).unwrap_err();
        assert!(directory.to_string().contains("a folder"), "{directory}");
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_device_without_end_is_refused() {
        let error = read_capped(Path::new("/dev/zero"), MEBIBYTE).unwrap_err();
        assert!(error.to_string().contains("larger than 1 MiB"), "{error}");
    }
}
