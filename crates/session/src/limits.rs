//! The size limits of a session: the same for commands, for added photographs, and for loaded sessions.

use resight::input::Kind;

/// Number of photographs: each is kept in memory.
pub const MOST_PHOTOS: usize = 6;
/// Total size of the files of all photographs, bytes: a session that was saved can then be read again.
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
/// A standard deviation of a position or a distance, metres: as large as what it belongs to can be.
pub const MOST_SIGMA_M: f64 = MOST_COORDINATE_M;
/// A standard deviation of an image point, px: of the best detectors on drawn images, and of points that say nothing.
pub const LEAST_SIGMA_PX: f64 = 1e-6;
/// See [`LEAST_SIGMA_PX`].
pub const MOST_SIGMA_PX: f64 = 1e6;
