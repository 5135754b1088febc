//! Images, detectors, file formats and pictures over `resight-core`.
#![deny(unsafe_code)]

pub use resight_core as core;

pub mod error;
pub mod input;
pub mod image;
pub mod detect;
pub mod recording;
pub mod ros;
pub mod formats;
pub mod overlay;
pub mod drawing;
pub mod render;
pub mod rig;
pub mod source;
pub mod scene;
pub mod report;
pub mod advise;
pub mod measure;
pub mod landmarks;
pub mod history;
pub mod live;

pub use self::image::GrayImage;
pub use error::FileError;
