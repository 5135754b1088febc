//! Messages of ROS 1 and ROS 2 without ROS: decoded by the definitions stored with them; a few types are also written.
//!
//! A definition is converted to a table of fields (`definition`), bytes to a tree of values (`decode`, `value`), and the tree to intrinsics
//! (`resight-formats`) or to observations of a camera (`resight-watch`). Fields are found by name, so that messages of older and newer releases
//! are read in the same way.

pub mod definition;
pub mod value;
pub mod decode;
mod known;
pub mod decoder;
mod cdr;
mod covariance;
pub mod write;

pub use covariance::pose_covariance;
