//! Events along a sweep: touch, release, slip-off (detected and predicted), the kind of outline that is touched, and the consistency of the
//! record.

pub mod touch;
pub mod outline;
pub mod equilibrium;
pub mod slip;
pub mod consistency;
pub mod timeline;

pub use consistency::{Consistency, Fault, Suspicion, consistency};
pub use outline::{Label, LocalOutline};
pub use slip::{End, Ending, Prediction, predict};
pub use timeline::{Event, EventKind, events, has_several_contacts, labels};
pub use touch::{Change, TouchDetector};
