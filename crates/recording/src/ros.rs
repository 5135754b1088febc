//! Messages of ROS 1 and ROS 2 without ROS: read by the definitions that travel with them, and the few that are written.
//!
//! A definition is turned into a table of fields (`definition`), bytes into a tree of values (`decode`, `value`), and the tree into
//! intrinsics (`resight-formats`) or into what a camera saw (`resight-watch`). Fields are found by name, so messages of older and newer
//! releases are read alike.

pub mod definition;
pub mod value;
pub mod decode;
mod known;
pub mod decoder;
mod cdr;
mod covariance;
pub mod write;

pub use covariance::pose_covariance;
