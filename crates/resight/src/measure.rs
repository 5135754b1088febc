//! Measuring in photographs: a scene file in, a table, a plan and rectified grounds out. The mathematics is `core::multiview::network`'s.
//!
//! scene file → named scene → network → answers → table, drawing, bird's-eye images. Each arrow is one file.

pub mod scene;
pub mod clicks;
pub mod answers;
mod job;
mod again;
pub mod words;
pub mod table;
pub mod plan;
pub mod birdseye;

pub use answers::{Answers, QueryAnswer};
pub use job::{measure, measure_after};
pub use scene::{NamedQuery, NamedScene, QueryKind, ScenePhoto, read_scene, rig_scene};
