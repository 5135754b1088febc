//! What each format says of itself: how its files are recognised, read, written and misread.

use super::document::{Document, Fault};
use super::file::{CameraFile, Contents, NamedCamera, OutFile, WriteError};
use super::format::Format;
use crate::FileError;
use crate::core::Target;

/// One camera format: reads, writes, or both.
pub(super) struct CameraFormat {
    pub format: Format,
    /// What `--to` calls it, the shortest first; empty where it is only read.
    pub words: &'static [&'static str],
    pub reads: Option<Reads>,
    pub write: Option<Writer>,
    /// How files of this shape are commonly misread; printed by `explain`.
    pub traps: &'static [&'static str],
}

pub(super) type ReadTogether = Result<Contents, FileError>;

/// How a format is read.
pub(super) struct Reads {
    pub recognises: fn(&Document) -> bool,
    pub read: fn(&Document) -> Result<Contents, Fault>,
    /// For models of several files of this format that mean something only together (an index in one points into
    /// another): takes over from `read` when a folder or a list of files holds more than one of them.
    pub together: Option<fn(&[&Document]) -> ReadTogether>,
}

pub(super) type Written = Result<Vec<OutFile>, WriteError>;

/// How a format is written; at least one camera is given.
#[derive(Clone, Copy)]
pub(super) enum Writer {
    /// Takes the cameras and their placements only.
    Cameras(fn(&[NamedCamera]) -> Written),
    /// Also looks at the poses between other frames, or the clocks.
    Rig(fn(&CameraFile) -> Written),
}

impl Writer {
    pub fn run(self, rig: &CameraFile) -> Written {
        match self {
            Writer::Cameras(write) => write(&rig.cameras),
            Writer::Rig(write) => write(rig),
        }
    }
}

pub(super) type TargetAndWarnings = (Target, Vec<String>);

/// One target format.
pub(super) struct TargetFormat {
    pub format: Format,
    pub recognises: fn(&Document) -> bool,
    pub read: fn(&Document) -> Result<TargetAndWarnings, Fault>,
    pub traps: &'static [&'static str],
}
