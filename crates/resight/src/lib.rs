//! Images, detectors, file formats and pictures over `resight-core`.
#![deny(unsafe_code)]

pub use resight_core as core;

pub mod error;
pub mod image;
pub mod detect;
pub mod formats;
pub mod overlay;
pub mod render;
pub mod report;
pub mod rig;
pub mod measure;

pub use self::image::GrayImage;
pub use error::FileError;
