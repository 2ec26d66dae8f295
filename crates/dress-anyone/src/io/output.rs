//! Writing results: all of them, or a clear reason why not.
//!
//! Every file is first written in full under a temporary name in the folder it belongs to, and only
//! when all are complete are they renamed. A full disk or an interruption thus leaves the results of
//! an earlier run as they were.

use super::file::in_plain_words;
use crate::problem::{BadInput, Problem};
use std::io::Write;
use std::path::{Path, PathBuf};
use tempfile::NamedTempFile;

/// Files to be written together into one folder.
#[derive(Clone, Debug)]
pub struct Output {
    folder: PathBuf,
    files: Vec<(String, Vec<u8>)>,
}

impl Output {
    /// Nothing yet, to go into `folder`.
    pub fn new(folder: &Path) -> Self {
        Self {
            folder: folder.to_owned(),
            files: Vec::new(),
        }
    }

    /// Adds a file called `name` (a plain name, no folders in it).
    pub fn add(&mut self, name: impl Into<String>, contents: impl Into<Vec<u8>>) {
        self.files.push((name.into(), contents.into()));
    }

    /// Writes all files, making the folder where there is none; the paths, in the order added.
    pub fn write(self) -> Result<Vec<PathBuf>, BadInput> {
        let refuse = |path: &Path, error: &std::io::Error| {
            let text = format!("cannot be written: {}", in_plain_words(error));
            BadInput::one(path, Problem::whole(text))
        };
        check_writable(&self.folder)?;
        std::fs::create_dir_all(&self.folder).map_err(|e| refuse(&self.folder, &e))?;
        let mut complete = Vec::new();
        for (name, contents) in &self.files {
            let path = self.folder.join(name);
            let file = temporary(&self.folder)
                .and_then(|mut file| file.write_all(contents).map(|()| file))
                .map_err(|e| refuse(&path, &e))?;
            complete.push((path, file));
        }
        let mut written = Vec::new();
        for (path, file) in complete {
            file.persist(&path).map_err(|e| refuse(&path, &e.error))?;
            written.push(path);
        }
        Ok(written)
    }
}

/// Whether files can be written into `folder`, which need not exist yet. Leaves nothing behind.
pub fn check_writable(folder: &Path) -> Result<(), BadInput> {
    let refuse = |text: String| Err(BadInput::one(folder, Problem::whole(text)));
    let existing = nearest_existing(folder);
    if !existing.is_dir() {
        let what = if existing == folder {
            "this is a file".to_owned()
        } else {
            format!("`{}` is a file", existing.display())
        };
        return refuse(format!(
            "{what}; results are written into a folder, so name a folder or a new name"
        ));
    }
    match temporary(existing) {
        Ok(_) => Ok(()),
        Err(error) => refuse(format!(
            "nothing can be written there: {}; choose another folder",
            in_plain_words(&error)
        )),
    }
}

/// The folder itself, or the nearest one above it that exists.
fn nearest_existing(folder: &Path) -> &Path {
    folder
        .ancestors()
        .find(|path| path.symlink_metadata().is_ok())
        .unwrap_or(Path::new("."))
}

/// A new temporary file in `folder`, with the permissions of an ordinary one; removed when dropped.
fn temporary(folder: &Path) -> std::io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    builder.prefix(".writing-");
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<_> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_are_written_whole_into_a_new_folder_and_replace_older_ones() {
        let root = tempfile::tempdir().unwrap();
        let folder = root.path().join("a/b");
        for contents in ["first", "second"] {
            let mut output = Output::new(&folder);
            output.add("pattern.json", contents);
            output.add("drape.obj", "v 0 0 0\n");
            assert_eq!(output.write().unwrap().len(), 2);
            let read = std::fs::read_to_string(folder.join("pattern.json")).unwrap();
            assert_eq!(read, contents);
        }
        assert_eq!(names(&folder), ["drape.obj", "pattern.json"]);
    }

    #[test]
    fn a_file_where_the_folder_should_be_is_refused_and_kept() {
        let root = tempfile::tempdir().unwrap();
        let file = root.path().join("out");
        std::fs::write(&file, "mine").unwrap();
        for folder in [file.clone(), file.join("deeper")] {
            let error = check_writable(&folder).unwrap_err().to_string();
            assert!(error.contains("is a file"), "{error}");
            assert!(Output::new(&folder).write().is_err());
        }
        assert_eq!(std::fs::read_to_string(&file).unwrap(), "mine");
    }

    #[test]
    fn checking_leaves_nothing_behind() {
        let root = tempfile::tempdir().unwrap();
        check_writable(root.path()).unwrap();
        check_writable(&root.path().join("new/folder")).unwrap();
        assert!(names(root.path()).is_empty());
    }

    #[test]
    fn a_failed_write_leaves_no_temporary_file() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("taken")).unwrap();
        let mut output = Output::new(root.path());
        output.add("taken", "a folder has this name");
        let error = output.write().unwrap_err().to_string();
        assert!(error.contains("cannot be written"), "{error}");
        assert_eq!(names(root.path()), ["taken"]);
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_folder_nobody_may_write_is_refused() {
        let error = check_writable(Path::new("/proc/results")).unwrap_err();
        assert!(error.to_string().contains("nothing can be written"));
    }
}
