//! Finding the files the user meant.

use crate::stdio;
use anyhow::{Context, Result, bail};
use resight::rig::KeptDetections;
use std::path::{Path, PathBuf};

/// The most frequent ending among the images of a folder; `png` where there is none.
fn ending_of_images(folder: &Path) -> String {
    const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
    let mut counts = std::collections::BTreeMap::<String, usize>::new();
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        let ending = entry.path().extension().unwrap_or_default().to_string_lossy().into_owned();
        if ENDINGS.contains(&ending.to_lowercase().as_str()) {
            *counts.entry(ending).or_default() += 1;
        }
    }
    counts.into_iter().max_by_key(|(_, n)| *n).map_or("png".to_owned(), |(ending, _)| ending)
}

/// Images given as paths or patterns (`*`, `?`, `[…]`; a shell usually expands them first), in the order given.
pub fn expand(arguments: &[String]) -> Result<Vec<PathBuf>> {
    let mut paths = Vec::new();
    for argument in arguments {
        let path = PathBuf::from(argument);
        if path.exists() || !argument.contains(['*', '?', '[']) {
            if path.is_dir() {
                bail!(
                    "{} is a folder; give its images, e.g. '{}'",
                    path.display(),
                    path.join(format!("*.{}", ending_of_images(&path))).display()
                );
            }
            must_exist(&path)?;
            paths.push(path);
            continue;
        }
        let before = paths.len();
        let entries = glob::glob(argument)
            .map_err(|e| anyhow::anyhow!("{argument}: not a file, and no pattern either ({})", e.msg))?;
        for entry in entries {
            match entry {
                // A pipe or a device among the files of a pattern is left out, because reading it may block for ever.
                Ok(path) if path.is_file() || path.is_dir() => paths.push(path),
                Ok(path) => stdio::remark(&format!("{}: no file, left out", path.display())),
                Err(fault) => stdio::remark(&format!(
                    "{}: cannot be looked into ({}), left out",
                    fault.path().display(),
                    fault.error()
                )),
            }
        }
        if paths.len() == before {
            bail!("no file matches {argument}; check the folder and the ending (upper and lower case count)");
        }
    }
    Ok(paths)
}

/// Refuses a path that is not a file, naming the nearest one in its folder.
pub fn must_exist(path: &Path) -> Result<()> {
    if path.is_file() {
        return Ok(());
    }
    if path.is_dir() {
        bail!("{} is a folder; give a file in it", path.display());
    }
    if path.exists() {
        // A pipe that the shell opened (`/dev/stdin`, `<(…)`) is as good as a file.
        return Ok(resight::input::must_not_block(path)?);
    }
    let missing = std::io::Error::from(std::io::ErrorKind::NotFound);
    Err(resight::FileError::of_system(path, &missing).into())
}

/// Refuses, before any work is done, an output file that could not be written later.
pub fn must_be_writable(path: &Path) -> Result<()> {
    if path.is_dir() {
        bail!(
            "-o {}: this is a folder; give a file, e.g. {}",
            path.display(),
            path.join("results.jsonl").display()
        );
    }
    can_be_written("-o", path)
}

/// The same for the file of any flag.
pub fn can_be_written(flag: &str, path: &Path) -> Result<()> {
    let (folder, file) = (folder_of(path), path.display());
    if path.is_dir() {
        bail!("{flag} {file}: this is a folder; give a file in it");
    }
    if !folder.is_dir() {
        bail!("{flag} {file}: there is no folder {}; make it first", folder.display());
    }
    let probe = folder.join(format!(".resight-{}.probe", std::process::id()));
    if let Err(reason) = std::fs::File::create_new(&probe) {
        bail!("{flag} {file}: nothing can be written to {} ({reason}); write elsewhere", folder.display());
    }
    let _ = std::fs::remove_file(&probe); // It was made a line above.
    Ok(())
}

/// Makes a folder for results, and those above it.
pub fn make_folder(flag: &str, folder: &Path) -> Result<()> {
    if folder.exists() && !folder.is_dir() {
        bail!("{flag} {}: this is a file; give a folder", folder.display());
    }
    std::fs::create_dir_all(folder)
        .with_context(|| format!("{flag} {}: cannot make this folder", folder.display()))
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(parent) if parent != Path::new("") => parent,
        _ => Path::new("."),
    }
}

/// A camera argument is `FILE` or `FILE#NAME`.
pub fn camera_must_exist(argument: &str) -> Result<()> {
    must_exist(resight::formats::split_spec(Path::new(argument)).0)
}

/// Where detections are kept between runs: below the user's folder for what can be made again. The size and the age of this program stand for the
/// version of its detectors.
pub fn kept_detections() -> Option<KeptDetections> {
    let folder_in =
        |variable: &str| std::env::var_os(variable).map(PathBuf::from).filter(|f| f.is_absolute());
    let home = || {
        folder_in("HOME")
            .map(|home| home.join(if cfg!(target_os = "macos") { "Library/Caches" } else { ".cache" }))
    };
    let folder = folder_in("XDG_CACHE_HOME").or_else(|| folder_in("LOCALAPPDATA")).or_else(home)?;
    let program = std::env::current_exe().and_then(std::fs::metadata).ok()?;
    let detector = format!("{} {:?}", program.len(), program.modified().ok()?);
    Some(KeptDetections::new(folder.join("resight").join("detections"), detector))
}
