//! What is wrong with a file: a reason with a path and a line.

use crate::input::nearest;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use thiserror::Error;

/// What is wrong with a file, where, and what to do.
#[derive(Debug, Error)]
#[error("{}{}: {reason}", path.display(), line.map(|l| format!(":{l}")).unwrap_or_default())]
pub struct FileError {
    /// The file.
    pub path: PathBuf,
    /// Line, counted from 1, where one can be named.
    pub line: Option<usize>,
    /// What is wrong, what was seen, what is needed.
    pub reason: String,
}

impl FileError {
    /// With no line.
    pub fn new(path: impl Into<PathBuf>, reason: impl Into<String>) -> Self {
        FileError { path: path.into(), line: None, reason: reason.into() }
    }

    /// What the system says of a file: in words, without its number, and for one that is not there the nearest that is.
    pub fn of_system(path: impl Into<PathBuf>, reason: &std::io::Error) -> Self {
        let path = path.into();
        let reason = match reason.kind() {
            ErrorKind::NotFound => not_there(&path),
            ErrorKind::PermissionDenied => {
                "the system does not allow it to be read; check its permissions".to_owned()
            }
            ErrorKind::IsADirectory => "is a folder; give a file in it".to_owned(),
            _ => without_number(&reason.to_string()),
        };
        FileError::new(path, reason)
    }

    /// At a line, counted from 1.
    pub fn at_line(path: impl Into<PathBuf>, line: usize, reason: impl Into<String>) -> Self {
        FileError { path: path.into(), line: Some(line), reason: reason.into() }
    }
}

/// That a path names no file, and which one of its folder may be meant.
fn not_there(path: &Path) -> String {
    if path.as_os_str().to_string_lossy().contains("://") {
        return "this is an address; download it first and give the file".to_owned();
    }
    let folder = match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        return format!("no such file (nor is there a folder {})", folder.display());
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let files =
        std::fs::read_dir(folder).into_iter().flatten().flatten().filter(|entry| entry.path().is_file());
    match nearest(&name, files.map(|entry| entry.file_name().to_string_lossy().into_owned())) {
        Some(found) => format!("no such file; did you mean {}?", path.with_file_name(found).display()),
        None if path.as_os_str().to_string_lossy().ends_with('/') => "no such folder".to_owned(),
        None => "no such file".to_owned(),
    }
}

/// A message of the system without its number: "(os error 28)" says nothing to a person.
pub fn without_number(message: &str) -> String {
    let mut text = message.to_owned();
    while let Some(from) = text.find(" (os error ") {
        let Some(length) = text[from..].find(')') else { break };
        text.replace_range(from..=from + length, "");
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_number_of_a_system_error_is_left_out() {
        let full = std::io::Error::from_raw_os_error(28).to_string();
        assert!(!without_number(&format!("cannot write: {full}; and {full}")).contains("os error"));
        assert_eq!(without_number("a (os error"), "a (os error");
    }

    #[test]
    fn a_file_that_is_not_there_has_a_nearest_one() {
        let folder = std::env::temp_dir().join(format!("resight-error-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("camera.yml"), "").unwrap();
        let of = |path: PathBuf| {
            let reason = std::fs::File::open(&path).unwrap_err();
            FileError::of_system(path, &reason).reason
        };
        assert!(of(folder.join("camera.yaml")).ends_with("camera.yml?"));
        assert_eq!(of(folder.join("zzzzzzzzzz.toml")), "no such file");
        assert!(of(folder.join("no folder/x.toml")).contains("nor is there a folder"));
        std::fs::remove_dir_all(folder).unwrap();
    }
}
