//! Common cameras and phones with the focal length of their main camera, for photographs without EXIF, which messengers remove.

use schemars::JsonSchema;
use serde::Serialize;

/// A camera of the list.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
pub struct CommonCamera {
    /// What it is called.
    pub name: &'static str,
    /// Focal length that sees the same diagonal on film of 36 × 24 mm, as its maker states it, millimetres.
    pub focal_35mm: u16,
}

const fn camera(name: &'static str, focal_35mm: u16) -> CommonCamera {
    CommonCamera { name, focal_35mm }
}

/// The list, for whole photographs of the main camera, neither zoomed nor cropped.
pub const COMMON_CAMERAS: [CommonCamera; 17] = [
    camera("Apple iPhone 7, 8, X, SE", 28),
    camera("Apple iPhone XR, XS, 11, 12, 13, 14, 15", 26),
    camera("Apple iPhone 14 Pro, 15 Pro, 16 Pro", 24),
    camera("Google Pixel 3, 4, 5", 27),
    camera("Google Pixel 6, 7, 8", 25),
    camera("Samsung Galaxy S8, S9, S10, S20, S21", 26),
    camera("Samsung Galaxy S22, S23, S24", 24),
    camera("Samsung Galaxy A5x", 25),
    camera("Xiaomi Redmi Note", 25),
    camera("DJI Mini, Air, Mavic 3, Phantom 4 Pro", 24),
    camera("DJI Phantom 4", 20),
    camera("Logitech C920, C922, C925e", 27),
    camera("Logitech C270", 37),
    camera("Raspberry Pi Camera Module 2", 29),
    camera("Raspberry Pi Camera Module 3", 28),
    camera("Raspberry Pi Camera Module 3 Wide", 15),
    camera("A phone of recent years, model unknown", 26),
];
