//! Draws the image of docs/watch.md: `cargo run --release -p resight --example make_landmarks` from the repository's root.

#[allow(dead_code)] // The tests use the rest.
#[path = "../tests/landmarks_support/mod.rs"]
mod landmarks_support;

use landmarks_support::{camera, exposed, pass_by, picture, turned};
use nalgebra::Matrix3;
use resight::formats::write_atomically;
use resight::landmarks::{Landmarks, draw};
use resight::render::Pcg;
use std::path::Path;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let camera = camera(640, 480, 550.0);
    let mut chance = Pcg::new(1);
    let reference = exposed(&camera, &picture(&camera, &Matrix3::identity(), 7), 1.0, 2.0, &mut chance);
    let landmarks = Landmarks::new(&reference, &camera)?;
    let mut image = exposed(&camera, &picture(&camera, &turned([0.3, -0.7, 0.2]), 7), 0.8, 2.0, &mut chance);
    pass_by(&mut image, (330, 120), (150, 360), 99);
    let landmark_observation = landmarks.observe(&image, None)?;
    let png = draw(&image, &landmark_observation).png()?;
    Ok(write_atomically(Path::new("docs/images/landmarks.png"), &png)?)
}
