//! Files that are never half written.

use crate::FileError;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// Replaces a file by new bytes, all or nothing: a crash or a power cut leaves the old file or the new one.
///
/// The bytes go to a new file in the same folder, are synced, renamed over `path`, and the folder is synced.
/// Permissions of an existing file are kept. On an error the old file is untouched and the new one removed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    stream_atomically(path, |file| file.write_all(bytes))
}

/// The same for bytes that are not all there at once: `write` puts them into the new file, one after the other.
///
/// # Errors
/// What the disk, or `write`, says; the old file is untouched.
pub fn stream_atomically(
    path: &Path,
    write: impl FnOnce(&mut File) -> std::io::Result<()>,
) -> Result<(), FileError> {
    let told = |e: std::io::Error| FileError::new(path, format!("cannot write: {e}"));
    // A symbolic link stays one; what it points to is replaced.
    let destination = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    let (temporary, file) = create_beside(&destination).map_err(told)?;
    let written = fill(file, write, &destination).and_then(|()| fs::rename(&temporary, &destination));
    if let Err(e) = written {
        // The error to report is the first one; a leftover that cannot be removed either adds nothing.
        let _ = fs::remove_file(&temporary);
        return Err(told(e));
    }
    sync_folder(&destination).map_err(told)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// A file nobody else has: the name carries the process and a counter, and creation fails where it exists.
fn create_beside(path: &Path) -> std::io::Result<(PathBuf, File)> {
    let name = path.file_name().ok_or_else(|| std::io::Error::other("the path names no file"))?;
    for attempt in 0..100 {
        let mut hidden = std::ffi::OsString::from(".");
        hidden.push(name);
        hidden.push(format!(".{}-{attempt}.tmp", std::process::id()));
        let temporary = folder_of(path).join(hidden);
        match OpenOptions::new().write(true).create_new(true).open(&temporary) {
            Err(e) if e.kind() == std::io::ErrorKind::AlreadyExists => continue,
            opened => return opened.map(|file| (temporary, file)),
        }
    }
    Err(std::io::Error::other("100 temporary files of this name already lie in the folder; remove them"))
}

fn fill(
    mut file: File,
    write: impl FnOnce(&mut File) -> std::io::Result<()>,
    destination: &Path,
) -> std::io::Result<()> {
    if let Ok(existing) = fs::metadata(destination) {
        file.set_permissions(existing.permissions())?;
    }
    write(&mut file)?;
    file.sync_all()
}

/// The rename itself lasts only once the folder is on disk; only Unix can sync a folder.
fn sync_folder(path: &Path) -> std::io::Result<()> {
    if cfg!(unix) { File::open(folder_of(path))?.sync_all() } else { Ok(()) }
}
