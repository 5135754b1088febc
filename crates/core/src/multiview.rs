//! Several views or cameras at once: rigs, pose graphs, hand–eye, networks of photographs and lengths, points from many views, relative poses of two.

#[cfg(feature = "std")]
pub mod tag_map;
#[cfg(feature = "std")]
mod flat_target;
#[cfg(feature = "std")]
mod shared_blocks;
#[cfg(feature = "std")]
pub mod intrinsics_check;
#[cfg(feature = "std")]
pub mod intrinsics;
pub mod rig_pose;
#[cfg(feature = "std")]
pub mod triangulate;
#[cfg(feature = "std")]
pub mod network;
#[cfg(feature = "std")]
pub mod rig;
#[cfg(feature = "std")]
pub mod map;
#[cfg(feature = "std")]
pub(crate) mod relative;
#[cfg(feature = "std")]
pub mod two_view;
#[cfg(feature = "std")]
pub mod pose_graph;
#[cfg(feature = "std")]
pub mod hand_eye;
