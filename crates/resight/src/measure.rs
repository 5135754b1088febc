//! Measures in photographs: from a scene file to a table, a plan and rectified images of the ground. The mathematics is
//! `core::multiview::network`.
//!
//! scene file → named scene → network → answers → table, drawing, bird's-eye images. Each arrow is one file.

pub mod scene;
pub mod clicks;
pub mod answers;
mod causes;
mod job;
mod again;
pub mod words;
pub mod table;
pub mod plan;
pub mod map;
pub mod birdseye;

pub use answers::{Answers, QueryAnswer};
pub use job::{measure, measure_after, measure_provisionally};
pub use scene::{NamedQuery, NamedScene, QueryKind, ScenePhoto, read_scene, rig_scene};
