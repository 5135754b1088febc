//! Where is the camera? Pose from a few known points, with its covariance and its ambiguity.
//!
//! No I/O, clock, thread, global state or unseeded chance. The modules stand in layers: each
//! may use those above it, never those below (tests/tidy.rs).
#![forbid(unsafe_code)]
#![warn(missing_docs)]
#![cfg_attr(not(feature = "std"), no_std)]

pub mod error;
pub mod statistics;
pub mod covariance;
pub mod pose;
pub mod polynomial;
pub mod camera;
#[cfg(feature = "std")]
pub mod target;
pub mod correspondence;
pub mod line;
pub mod solve;
pub mod choose;
pub mod prior;
mod factor;
pub mod loss;
#[cfg(feature = "std")]
mod clustered;
pub mod least_squares;
pub mod group;
pub mod problem;
mod accumulate;
mod reweight;
mod sandwich;
pub mod refine;
mod curvature;
mod posterior;
pub mod consistency;
pub mod known_rotation;
pub mod locate_lines;
mod method;
mod search;
mod held;
mod upright;
mod literal;
mod intrinsics;
mod shared_error;
mod doubt;
pub mod locate;
pub mod observability;
#[cfg(feature = "std")]
pub mod tag_map;
#[cfg(feature = "batch")]
pub mod batch;
#[cfg(feature = "std")]
pub mod frames;
pub mod rig_pose;
#[cfg(feature = "std")]
pub mod triangulate;
#[cfg(feature = "std")]
pub mod survey;
#[cfg(feature = "std")]
pub mod robust;
#[cfg(feature = "std")]
pub mod turn;
#[cfg(feature = "std")]
pub mod rig;
#[cfg(feature = "std")]
mod relative;
#[cfg(feature = "std")]
pub mod pose_graph;
#[cfg(feature = "std")]
pub mod hand_eye;
#[cfg(feature = "std")]
pub mod compare;
#[cfg(feature = "std")]
pub mod advise;
#[cfg(feature = "std")]
pub mod snapshot;
#[cfg(feature = "std")]
pub mod track;
#[cfg(feature = "std")]
pub mod monitor;

pub use camera::{Camera, CameraMatrix, Lens};
pub use correspondence::Correspondence;
pub use error::Error;
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
