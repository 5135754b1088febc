//! What a pose is sought for: everything the cost depends on besides the pose.

use crate::{Camera, Correspondence};

/// The observations of one view.
#[derive(Debug, Clone, Copy)]
pub struct Problem<'a> {
    /// Known points and where they were seen.
    pub seen: &'a [Correspondence],
    /// The camera they were seen with.
    pub camera: &'a Camera,
}

impl<'a> Problem<'a> {
    /// Points seen by a camera, and nothing else known.
    pub fn new(seen: &'a [Correspondence], camera: &'a Camera) -> Self {
        Problem { seen, camera }
    }
}
