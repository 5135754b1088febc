//! Finding targets in images.

pub mod dots;
