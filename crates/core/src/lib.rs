//! Poses of cameras from a few known points, with their covariances and ambiguities.
//!
//! ```text
//! error statistics covariance pose budget explanation polynomial camera target correspondence line
//! solve          closed forms; `solve.rs` is the table
//! least_squares  one Levenberg–Marquardt over one trait
//! locate         one camera: points, lines and priors to a pose with covariance and ambiguity
//! robust         consensus where correspondences may be wrong
//! multiview      rigs, pose graphs, hand–eye, networks of photographs, points and motions from several views
//! temporal       tracks, change detection, comparison of calibrations, cameras on vehicles
//! batch          many views at once, in SIMD
//! advise         what the next observation is worth
//! ```
//! There is no I/O, clock, thread, global state or unseeded chance. The modules form layers: each may use those above it, never those below it
//! (tests/tidy.rs).
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(feature = "std"), no_std)]

pub mod error;
pub mod statistics;
pub mod covariance;
pub mod pose;
pub mod budget;
#[cfg(feature = "std")]
pub mod explanation;
pub(crate) mod polynomial;
pub mod camera;
#[cfg(feature = "std")]
pub mod target;
pub mod correspondence;
pub mod line;
pub mod solve;
pub mod least_squares;
pub mod locate;
#[cfg(feature = "std")]
pub mod robust;
pub mod multiview;
#[cfg(feature = "std")]
pub mod temporal;
#[cfg(feature = "batch")]
pub mod batch;
#[cfg(feature = "std")]
pub mod advise;

pub use camera::{Camera, CameraMatrix, Lens};
pub use correspondence::Correspondence;
pub use error::Error;
pub use locate::prior::Prior;
pub use locate::{Method, PoseEstimate};
pub use pose::Pose;
#[cfg(feature = "std")]
pub use target::Target;

/// Coordinates of a point in a named frame, metres: `corner_in_cam`, `x_in_target`.
pub type Point = nalgebra::Vector3<f64>;
/// Image coordinates `(u, v)`, pixels; (0, 0) is the centre of the top-left pixel.
pub type Pixel = nalgebra::Vector2<f64>;
/// Unit vector from the camera centre towards a point, in the camera frame (x right, y down, z forward).
pub type Bearing = nalgebra::Unit<nalgebra::Vector3<f64>>;
/// Covariance of a small motion `[rotation_rad; translation_m]`.
pub type Matrix6 = nalgebra::Matrix6<f64>;
/// A small motion `[rotation_rad; translation_m]`.
pub type Vector6 = nalgebra::Vector6<f64>;
