//! The state file: trackers, monitors and readings learned so far, so that a session continues where another stopped, or was killed.
//!
//! Two lines of JSON: the kind of the file with the SHA-256 of the second line, and the state. It is replaced as a whole, at most half a second
//! after a change. Only a state of the same camera, target, reference and settings is used; a damaged one is renamed.

mod record;
pub(super) mod rig_record;
mod keep;

pub use keep::StateFile;
pub(super) use keep::{EVERY, unix_s};
pub(super) use record::{
    CameraRecord, LandmarksRecord, PairRecord, ReadingRecord, StageRecord, changed, landmark_settings,
    rig_settings, settings,
};
