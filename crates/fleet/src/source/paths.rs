//! Files, folders and patterns.

use crate::FleetError;
use std::path::{Path, PathBuf};

/// Endings of the files that are used in folders.
const ENDINGS: [&str; 5] = ["parquet", "csv", "jsonl", "ndjson", "json"];

/// Returns the files of the arguments: files as given, those of a folder (and of its subfolders) by name, those that match a pattern by name.
///
/// # Errors
/// An argument that does not exist, or contains no file of views.
pub fn expand(arguments: &[String]) -> Result<Vec<PathBuf>, FleetError> {
    let mut files = Vec::new();
    for argument in arguments {
        let path = Path::new(argument);
        let before = files.len();
        if path.is_dir() {
            below(path, &mut files, 0)?;
        } else if path.exists() || !argument.contains(['*', '?', '[']) {
            files.push(path.to_path_buf());
        } else {
            let found =
                glob::glob(argument).map_err(|e| FleetError::at(path, format!("no pattern ({})", e.msg)))?;
            for found in found.flatten() {
                if found.is_dir() { below(&found, &mut files, 0)? } else { files.push(found) }
            }
        }
        if files.len() == before {
            let reason =
                format!("no file of views ({}) is here", ENDINGS.map(|e| format!(".{e}")).join(", "));
            return Err(FleetError::at(path, reason));
        }
    }
    Ok(files)
}

/// Largest depth of subfolders.
const DEEPEST: usize = 16;

/// Adds the files below a folder; hidden files, and those that Spark leaves (`_SUCCESS`), are no views.
fn below(folder: &Path, files: &mut Vec<PathBuf>, depth: usize) -> Result<(), FleetError> {
    let entries = std::fs::read_dir(folder).map_err(|e| FleetError::at(folder, e.to_string()))?;
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    for path in paths {
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let is_views = path
            .extension()
            .is_some_and(|ending| ENDINGS.iter().any(|known| ending.eq_ignore_ascii_case(known)));
        if name.starts_with(['.', '_']) {
            continue;
        }
        if path.is_dir() && depth < DEEPEST {
            below(&path, files, depth + 1)?;
        } else if is_views && path.is_file() {
            files.push(path);
        }
    }
    Ok(())
}
