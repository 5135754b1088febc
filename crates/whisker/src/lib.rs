//! Object profiles by touch: an elastic whisker on a load cell, read by the elastica.
//!
//! The force and the torque at the hub determine the whole bent whisker; where its bending moment vanishes, there it touches.
//! One sample gives one contact point with its covariance; a sweep gives a locus; the locus gives the object.
//!
//! ```
//! use resight_whisker::contact::Method;
//! use resight_whisker::{Cell, HubLoad, Rod, Sample, estimate::{Status, estimate}};
//!
//! # fn main() -> Result<(), resight_whisker::Error> {
//! let rod = Rod::uniform(0.2, 0.0098)?; // Length in metres, stiffness in N·m².
//! let cell = Cell { force_sigma_n: 5e-4, torque_sigma_n_m: 1e-5, ..Cell::default() };
//! let sample = Sample { load: HubLoad { fx_n: 0.0, fy_n: 0.05, mz_n_m: 0.005 }, ..Sample::default() };
//! let found = estimate(&rod, &cell, &sample, Method::Auto);
//! assert_eq!(found.status, Status::Ok);
//! let contact = found.contact.expect("an ok answer has one");
//! assert!((contact.x_in_world.x - 0.1).abs() < 1e-3); // About torque over force, 0.1 m along the whisker.
//! assert!(contact.covariance[(0, 0)].sqrt() < 2e-3);
//! # Ok(())
//! # }
//! ```
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
pub mod solve;
pub mod replay;

pub use contact::HubContact;
pub use error::Error;
pub use estimate::ContactEstimate;
pub use load::{Cell, HubLoad, Sample};
pub use plane::PlanarPose;
pub use rod::Rod;
pub use shape::Shape;
