//! Draws the landmarks: the former and the current position of each, green where it agrees with the rotation, red where not.

use super::{Found, LandmarkObservation};
use crate::GrayImage;
use crate::overlay::canvas::{Canvas, Path, Pen};
use nalgebra::Vector2;

const AGREES: [u8; 3] = [40, 220, 90];
const DISAGREES: [u8; 3] = [255, 70, 60];
const BLACK: [u8; 3] = [0, 0, 0];
/// Radius of the ring around a landmark, px.
const RING_PX: f64 = 5.0;
const CORNERS: usize = 12;

/// Draws the landmarks over the image.
pub fn draw(image: &GrayImage, landmark_observation: &LandmarkObservation) -> Canvas {
    let mut canvas = Canvas::from_photograph(image, 1, 0, BLACK);
    let (used, others): (Vec<_>, Vec<_>) = landmark_observation
        .found
        .iter()
        .enumerate()
        .partition(|(i, _)| landmark_observation.relative_rotation.used.binary_search(i).is_ok());
    for (found, color) in [(others, DISAGREES), (used, AGREES)] {
        let paths: Vec<Path> = found.iter().flat_map(|(_, found)| paths(found)).collect();
        canvas.stroke_with_rim(&paths, Pen { color, width: 1.2, opacity: 1.0 });
    }
    canvas
}

/// Returns a ring at the current position, and a line from the former one.
fn paths(found: &Found) -> [Path; 2] {
    let ring = |k: usize| {
        let angle = std::f64::consts::TAU * k as f64 / CORNERS as f64;
        found.now_px + Vector2::new(angle.cos(), angle.sin()) * RING_PX
    };
    [vec![found.reference_px, found.now_px], (0..=CORNERS).map(ring).collect()]
}
