//! Object profiles by touch: an elastic whisker on a load cell, read by the elastica.
//!
//! The force and the torque at the hub determine the whole bent whisker; where its bending moment vanishes, there it touches.
//! One sample gives one contact point with its covariance; a sweep gives a locus; the locus gives the object.
//!
//! No disk, clock, thread, global state or unseeded chance: `files` turns text into rows and rows into text. The modules stand
//! in layers: each may use those above it, never those below (tests/tidy.rs).
#![forbid(unsafe_code)]
#![warn(missing_docs)]

pub mod error;
pub mod plane;
pub mod load;
pub mod rod;
pub mod elliptic;
pub mod contact;
pub mod estimate;
pub mod friction;
pub mod events;
pub mod sweep;
pub mod shape;
pub mod identify;
pub mod simulate;
pub mod calibrate;
pub mod spatial;
pub mod files;

pub use contact::HubContact;
pub use error::Error;
pub use estimate::ContactEstimate;
pub use load::{Cell, HubLoad, Sample};
pub use plane::PlanarPose;
pub use rod::Rod;
pub use shape::Shape;
