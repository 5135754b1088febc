//! What happens along a sweep: touch, release, slip-off (found, and foreseen), what kind of outline is touched, whether the record
//! agrees with itself.

pub mod touch;
pub mod outline;
pub mod equilibrium;
pub mod slip;

pub use outline::{Label, LocalOutline};
pub use slip::{Foresight, foresee};
pub use touch::{Change, TouchDetector};
