//! Advice in words and pictures: maps of what a further point, a target or a board would be worth over the image and over the ground.

mod contour;
pub mod heat;
pub mod maps;
pub mod words;
