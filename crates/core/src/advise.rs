//! Before the image is taken: how uncertain will the pose be, and which further point, target or view would make it surer?
//!
//! All of it rests on the information matrix at a pose that is assumed, so nothing needs to be seen yet. Where that first-order
//! figure cannot be trusted (the likelihood is bent, or a second pose fits nearly as well) the answer says so by a [`FirstOrderLimit`].
//!
//! | question | file |
//! | --- | --- |
//! | what is one view of known points worth? | [`expect()`] |
//! | what is wrong with a layout, in numbers? | [`layout`] |
//! | how uncertain is a place or a length measured on a plane? | [`ground`] |
//! | where should the next point go? | [`point`] |
//! | how does a target do over a volume, and which change of it helps? | [`volume`], [`change`] |
//! | where should the next board of a rig go? | [`board`] |
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
