//! Positions on the Earth: points in latitude, longitude and height or in a projected system, poses and footprints in the same coordinates.
//!
//! columns ─► `system`, `earth` ─► local frame (east, north, up; metres near zero) ─► a pose as of any points ─► `pose`, `footprint` ─► `features`
//! (GeoJSON, KML). `map_image` gives coordinates to pixels of an orthophoto. Nothing but `earth` knows the crate `geodesy`. Derivation:
//! docs/math/georeference.md.

pub mod columns;
pub mod earth;
pub mod features;
pub mod footprint;
pub mod map_image;
mod pose;
pub mod system;
mod tiff;

pub use crate::answer::georeference::{GeoreferencedPose, MapPointAnswer, OriginObject};
pub use earth::{Geographic, LocalFrame};
pub use features::{Features, Ground, NamedPosition};
pub use map_image::{MapImage, MapPoints, read_map_image, read_map_points};
pub use pose::georeferenced_pose;
pub use system::{CoordinateSystem, Zone};
