//! How much a session holds: the same for commands, for photographs added, and for sessions loaded.

use resight::input::Kind;

/// Photographs: each is held in memory.
pub const MOST_PHOTOS: usize = 6;
/// Files of all photographs together, bytes: what is saved can then be read again.
pub const FILES_BYTES: usize = Kind::Image.limit_bytes() as usize;
/// A saved session, bytes.
pub const SAVED_BYTES: usize = Kind::Session.limit_bytes() as usize;
/// Points of a photograph.
pub const MOST_POINTS: usize = 2000;
/// Distances.
pub const MOST_DISTANCES: usize = 200;
/// Measurements, and points of one of them.
pub const MOST_MEASUREMENTS: usize = 200;
/// See [`MOST_MEASUREMENTS`].
pub const MOST_MEASURED_POINTS: usize = 200;
/// Points of all measurements together: a scene of them stays one that is read.
pub const MOST_MEASURED_TOGETHER: usize = 4000;
/// Characters of a name.
pub const MOST_NAME: usize = 60;
/// A coordinate, metres from the origin.
pub const MOST_COORDINATE_M: f64 = 1e7;
