//! Where to put the next point, target or board, in figures, words and maps over the image and over the ground.

mod contour;
pub mod heat;
pub mod maps;
pub mod words;
pub mod read;
pub mod points;
pub mod target;
pub mod board;

pub use board::{NextBoardRequest, advise_boards};
pub use points::{AimFor, NextPointRequest, advise_points};
pub use read::{MeasuredPoint, read_points, read_poses};
pub use target::{TargetRequest, advise_target};

use crate::Error;
use crate::answer::advise::Picture;
use crate::core::Camera;
use heat::HeatMap;

/// Collects the maps that could be drawn, with their file names.
fn drawn(maps: impl IntoIterator<Item = (String, Option<HeatMap>)>) -> Vec<Picture> {
    maps.into_iter().filter_map(|(name, map)| Some((name, map?))).collect()
}

/// Refuses a camera without an image size: the figures are stated in pixels and depend on what the camera can see.
fn must_have_image(camera: &Camera) -> Result<(), Error> {
    match camera.size {
        Some(_) => Ok(()),
        None => Err(Error::request(
            "the camera file has no image size; add width_px and height_px, which determine what is in view",
        )),
    }
}
