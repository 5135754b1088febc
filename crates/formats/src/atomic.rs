//! Files that are never half written.

use crate::{FileError, without_number};
use std::collections::BTreeSet;
use std::fs::{self, File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

/// Replaces a file by new bytes, all or nothing: a crash or a power cut leaves the old file or the new one.
///
/// The bytes go to a new file in the same folder, are synced, renamed over `path`, and the folder is synced.
/// Permissions of an existing file are kept. On an error the old file is untouched and the new one removed.
pub fn write_atomically(path: impl AsRef<Path>, bytes: &[u8]) -> Result<(), FileError> {
    let path = path.as_ref();
    stream_atomically(path, |file| file.write_all(bytes))
}

/// The same for bytes that are not all there at once: `write` puts them into the new file, one after the other.
///
/// # Errors
/// What the disk, or `write`, says; the old file is untouched.
pub fn stream_atomically(
    path: impl AsRef<Path>,
    write: impl FnOnce(&mut File) -> std::io::Result<()>,
) -> Result<(), FileError> {
    let path = path.as_ref();
    let reported =
        |e: std::io::Error| FileError::new(path, format!("cannot write: {}", without_number(&e.to_string())));
    // A symbolic link stays one; what it points to is replaced.
    let destination = fs::canonicalize(path).unwrap_or_else(|_| path.to_path_buf());
    remove_leftovers(&destination);
    let (temporary, file) = create_beside(&destination).map_err(reported)?;
    let written = fill(file, write, &destination).and_then(|()| fs::rename(&temporary, &destination));
    if let Err(e) = written {
        // The error to report is the first one; a leftover that cannot be removed either adds nothing.
        let _ = fs::remove_file(&temporary);
        return Err(reported(e));
    }
    sync_folder(&destination).map_err(reported)
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// New files of processes that were killed before they could rename them: removed once in the life of a process for each destination,
/// where the process is gone and the file has lain for a minute (another machine may write to the same folder).
fn remove_leftovers(destination: &Path) {
    static LOOKED: Mutex<BTreeSet<PathBuf>> = Mutex::new(BTreeSet::new());
    let mut looked = LOOKED.lock().unwrap_or_else(PoisonError::into_inner);
    if MOST_LOOKED <= looked.len() || !looked.insert(destination.to_path_buf()) {
        return;
    }
    drop(looked);
    let Some(name) = destination.file_name().map(|name| format!(".{}.", name.to_string_lossy())) else {
        return;
    };
    let Ok(entries) = fs::read_dir(folder_of(destination)) else { return };
    for entry in entries.flatten() {
        let file = entry.file_name().to_string_lossy().into_owned();
        if file.strip_prefix(&name).is_some_and(is_of_the_dead) && is_old(&entry.path()) {
            // Another process may have removed it.
            let _ = fs::remove_file(entry.path());
        }
    }
}

/// Files with results of their own names are written by the thousand; each folder is looked through for the first of them only.
const MOST_LOOKED: usize = 64;

/// Whether `PID-ATTEMPT.tmp` names a process that is no more. Where that cannot be known the process counts as alive.
fn is_of_the_dead(ending: &str) -> bool {
    let numbers = ending.strip_suffix(".tmp").and_then(|numbers| numbers.split_once('-'));
    let is_number = |text: &str| text.parse::<u32>().is_ok();
    let processes = Path::new("/proc/self").exists();
    numbers.is_some_and(|(process, attempt)| {
        processes && is_number(process) && is_number(attempt) && !Path::new("/proc").join(process).exists()
    })
}

fn is_old(path: &Path) -> bool {
    let modified = fs::metadata(path).and_then(|data| data.modified());
    modified.is_ok_and(|at| at.elapsed().is_ok_and(|age| Duration::from_secs(60) <= age))
}

/// Creates a file of a unique name, with the process and a counter; creation fails where it exists.
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

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(target_os = "linux")]
    #[test]
    fn files_of_the_killed_are_removed_and_those_of_the_living_stay() {
        let folder = std::env::temp_dir().join(format!("resight-leftovers-{}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let mut child = std::process::Command::new("true").spawn().unwrap();
        let dead = child.id();
        child.wait().unwrap();
        let living = std::process::id();
        let hour_ago = std::time::SystemTime::now() - Duration::from_secs(3600);
        let make = |name: String, old: bool| {
            let file = File::create(folder.join(&name)).unwrap();
            if old {
                file.set_modified(hour_ago).unwrap();
            }
            name
        };
        let gone = make(format!(".state.json.{dead}-0.tmp"), true);
        let kept = [
            make(format!(".state.json.{living}-9.tmp"), true),
            make(format!(".state.json.{dead}-1.tmp"), false),
            make(format!(".other.json.{dead}-0.tmp"), true),
            make(".state.json.x-0.tmp".to_string(), true),
        ];
        write_atomically(folder.join("state.json"), b"{}").unwrap();
        assert!(!folder.join(gone).exists());
        assert!(kept.iter().all(|name| folder.join(name).exists()), "{kept:?}");
        fs::remove_dir_all(&folder).unwrap();
    }
}
