//! Planning before an image is taken: the uncertainty of its pose, and the further point, target or view that would reduce it.
//!
//! Everything follows from the information matrix at an assumed pose. Where that first-order figure cannot be trusted (the likelihood is bent,
//! or a second pose fits nearly as well) the answer has a [`FirstOrderLimit`].
//!
//! | question | file |
//! | --- | --- |
//! | the accuracy of one view of known points | [`expect()`] |
//! | the faults of a layout, in numbers | [`layout`] |
//! | the uncertainty of a position or a length measured on a plane | [`ground`] |
//! | the position of the next point | [`point`] |
//! | the accuracy of a target over a volume, and the changes that improve it | [`volume`], [`change`] |
//! | the pose of the next board of a rig | [`board`] |
//!
//! Derivation: docs/math/advise.md.

pub mod expect;
pub mod layout;
pub mod ground;
pub mod point;
pub mod volume;
pub mod change;
pub mod board;

pub use expect::{Expectation, FirstOrderLimit, Optics, correspondences_in_view, expect};
