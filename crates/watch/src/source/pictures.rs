//! Images in files: a list, or a growing folder.

use super::{Content, Frame, Next, Source};
use resight::{FileError, GrayImage};
use std::collections::{BTreeMap, BTreeSet, VecDeque};
use std::path::{Path, PathBuf};
use std::time::{Duration, SystemTime};

/// Endings of a folder's images.
const ENDINGS: [&str; 3] = ["png", "jpg", "jpeg"];
/// A file that was changed within this time may still be being written.
const SETTLED: Duration = Duration::from_millis(200);
/// A slow upload may pause for longer: an image that cannot be decoded is given up only when it has not changed for this time.
const RESTING: Duration = Duration::from_secs(2);

/// The origin of the capture times of images.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Clock {
    /// The last change of the file.
    Modified,
    /// The EXIF time; where there is none, the last change of the file.
    Taken,
    /// A fixed interval, seconds, the first image at 0.
    Every(f64),
}

/// Images in the order given.
pub struct ImageFiles {
    paths: VecDeque<PathBuf>,
    clock: Clock,
    number: u64,
    orientation: Option<&'static str>,
}

impl ImageFiles {
    /// Builds a source from a list, which is read as fast as its frames are processed.
    pub fn new(paths: impl IntoIterator<Item = PathBuf>, clock: Clock) -> Self {
        ImageFiles { paths: paths.into_iter().collect(), clock, number: 0, orientation: None }
    }
}

impl Source for ImageFiles {
    fn next(&mut self, _: Duration) -> Next {
        let Some(path) = self.paths.pop_front() else { return Next::End };
        self.number += 1;
        let (frame, orientation) = picture(&path, self.number - 1, self.clock);
        self.orientation = orientation;
        Next::Frame(frame)
    }

    fn is_live(&self) -> bool {
        false
    }

    fn are_photographs(&self) -> bool {
        true
    }

    fn orientation(&self) -> Option<&'static str> {
        self.orientation
    }
}

/// A folder in which images appear; they are processed by name, those already there first.
pub struct Folder {
    path: PathBuf,
    clock: Clock,
    /// Images of the last listing that were processed; a deleted one is removed, and its name may occur again.
    taken: BTreeMap<PathBuf, Taken>,
    waiting: VecDeque<PathBuf>,
    number: u64,
    is_filling: bool,
    orientation: Option<&'static str>,
}

/// The treatment of an image.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Taken {
    /// Provided, or waiting.
    Whole,
    /// Not decodable at this size: it is read again when it has grown, and a last time when it is no longer written.
    Torn { bytes: u64, is_reported: bool },
}

impl Folder {
    /// # Errors
    /// A missing folder.
    pub fn open(path: impl AsRef<Path>, clock: Clock) -> Result<Self, FileError> {
        let path = path.as_ref();
        std::fs::read_dir(path).map_err(|e| FileError::new(path, format!("cannot be read: {e}")))?;
        let (taken, waiting) = (BTreeMap::new(), VecDeque::new());
        let path = path.to_path_buf();
        Ok(Folder { path, clock, taken, waiting, number: 0, is_filling: true, orientation: None })
    }

    /// Makes the source end after the present images, instead of waiting for more.
    pub fn as_it_is(self) -> Self {
        Folder { is_filling: false, ..self }
    }

    /// Collects new images that are no longer written, by name; returns whether others are still being written.
    fn look(&mut self) -> std::io::Result<bool> {
        let (mut there, mut new, mut is_growing) = (BTreeSet::new(), Vec::new(), false);
        for entry in std::fs::read_dir(&self.path)? {
            let path = entry?.path();
            if !is_picture(&path) {
                continue;
            }
            match self.state(&path) {
                Some(true) => new.push(path.clone()),
                Some(false) => is_growing = true,
                None => {}
            }
            there.insert(path);
        }
        new.sort();
        self.taken.retain(|path, _| there.contains(path));
        self.taken.extend(new.iter().map(|path| (path.clone(), Taken::Whole)));
        self.waiting.extend(new);
        Ok(is_growing)
    }

    /// Returns whether an image is to be read now (or else later); none where it has been read.
    fn state(&self, path: &Path) -> Option<bool> {
        let is_due = match self.taken.get(path) {
            None => true,
            Some(Taken::Whole) => return None,
            Some(Taken::Torn { bytes, is_reported }) => {
                let has_grown = size(path) != *bytes;
                if *is_reported && !has_grown {
                    return None;
                }
                has_grown || has_rested(path, RESTING)
            }
        };
        Some(is_due && has_rested(path, SETTLED))
    }

    /// Returns the image, or none where it may be complete later.
    fn read(&mut self, path: &Path) -> Option<Frame> {
        let bytes = size(path); // Before reading, so that growth during the reading shows later.
        let (frame, orientation) = picture(path, self.number, self.clock);
        if matches!(frame.content, Content::Unreadable(_)) {
            let is_reported = has_rested(path, RESTING);
            self.taken.insert(path.to_path_buf(), Taken::Torn { bytes, is_reported });
            if !is_reported {
                return None;
            }
        }
        self.number += 1;
        self.orientation = orientation;
        Some(frame)
    }
}

impl Source for Folder {
    fn next(&mut self, patience: Duration) -> Next {
        if self.waiting.is_empty() {
            let is_growing = match self.look() {
                Ok(is_growing) => is_growing,
                Err(reason) => {
                    return Next::Lost(FileError::new(&self.path, format!("cannot be read: {reason}")));
                }
            };
            if self.waiting.is_empty() && !self.is_filling && !is_growing {
                return Next::End;
            }
            if self.waiting.is_empty() {
                std::thread::sleep(patience);
            }
        }
        let Some(path) = self.waiting.pop_front() else { return Next::Nothing };
        self.read(&path).map_or(Next::Nothing, Next::Frame)
    }

    /// Returns false: the files wait on the disk.
    fn is_live(&self) -> bool {
        false
    }

    fn are_photographs(&self) -> bool {
        true
    }

    fn orientation(&self) -> Option<&'static str> {
        self.orientation
    }
}

/// Reads an image, and how EXIF asks viewers to show it.
fn picture(path: &Path, number: u64, clock: Clock) -> (Frame, Option<&'static str>) {
    let bytes = resight::input::read(path, resight::input::Kind::Image).map_err(|fault| fault.reason);
    let taken_s = || resight::image::exif::taken_s(bytes.as_ref().ok()?);
    let capture_s = match clock {
        Clock::Every(period_s) => period_s * number as f64,
        Clock::Modified => modified_s(path),
        Clock::Taken => taken_s().unwrap_or_else(|| modified_s(path)),
    };
    let content = match bytes.as_ref().map_err(String::clone).and_then(|bytes| GrayImage::decode(bytes)) {
        Ok(image) => Content::Image(image),
        Err(reason) => Content::Unreadable(FileError::new(path, reason).to_string()),
    };
    let orientation = bytes.as_ref().ok().and_then(|bytes| resight::image::exif::orientation(bytes));
    (Frame { number, capture_s, name: path.display().to_string(), content }, orientation)
}

/// Returns the time of the last change, seconds since 1970; 0 for a file that is gone, which cannot be read either.
fn modified_s(path: &Path) -> f64 {
    let modified = std::fs::metadata(path).and_then(|data| data.modified());
    modified
        .ok()
        .and_then(|at| at.duration_since(SystemTime::UNIX_EPOCH).ok())
        .map_or(0.0, |d| d.as_secs_f64())
}

fn is_picture(path: &Path) -> bool {
    let ending = path.extension().map(|ending| ending.to_string_lossy().to_lowercase());
    // The names of incomplete files begin with a dot where the writer renames complete ones.
    let is_hidden = path.file_name().is_some_and(|name| name.to_string_lossy().starts_with('.'));
    !is_hidden && ending.is_some_and(|ending| ENDINGS.contains(&ending.as_str()))
}

/// Returns whether a file has not been written for this long.
fn has_rested(path: &Path, time: Duration) -> bool {
    let age = std::fs::metadata(path).and_then(|data| data.modified()).map(|at| at.elapsed());
    // A time in the future belongs to another clock, so there is nothing to wait for.
    !matches!(age, Ok(Ok(age)) if age < time)
}

/// Returns the size of a file, bytes; 0 for one that is gone.
fn size(path: &Path) -> u64 {
    std::fs::metadata(path).map_or(0, |data| data.len())
}
