//! Zones follow the camera: polygons drawn on a reference image, re-projected after the camera has rotated.
//!
//! zones file, motion (of `compare`, `landmarks` or `watch`) ─► each edge subdivided, undistorted, rotated, distorted ─► clipped to the image.
//! A rotation moves the image of everything; a shift moves near things more than far ones, so a zone is moved only where the shift, and
//! the uncertainty of both, cannot displace it by more than a stated number of pixels. Derivation: docs/math/zones.md.

mod file;
mod job;
mod motion;

pub use crate::answer::zones::ZoneAnswer;
pub use file::{Zone, ZonesFile, read_zones};
pub use job::{MovedZones, ZoneOptions, move_zones};
pub use motion::{CameraMotion, read_motion};
