//! What changes over time: a pose followed, a change detected, two calibrations compared, a rotation since a reference image, a camera on
//! a vehicle that drives.

pub mod compare;
pub mod snapshot;
pub mod relative_rotation;
pub mod track;
pub mod disagreement;
pub mod monitor;
pub mod vehicle;
