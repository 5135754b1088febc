//! The Python package `resight`: the jobs and answers of the library `resight`, for NumPy arrays and files. A door: no mathematics.
//!
//! `python/resight` names what users see; this module, `resight._native`, is what they are made of.
#![forbid(unsafe_code)]

mod error;
mod notebook;
mod arrays;
mod run;
mod pixels;
mod camera;
mod target;
mod pose;
mod answer;
mod points;
mod many;
mod image;
mod jobs;
mod columns;
mod robot;
mod lines;
mod advice;
mod monitor;
mod table;
mod fleet;
mod program;

use pyo3::prelude::*;

#[pymodule(gil_used = false)]
mod _native {
    #[pymodule_export]
    use super::advice::{advise_boards, advise_points, advise_target};
    #[pymodule_export]
    use super::answer::PoseAnswer;
    #[pymodule_export]
    use super::camera::Camera;
    #[pymodule_export]
    use super::fleet::{Cameras, FleetState, batch, fleet_report, fleet_span_s, locate_views, solve_views};
    #[pymodule_export]
    use super::image::{detect, locate_image, locate_images};
    #[pymodule_export]
    use super::jobs::{
        check_intrinsics, compare, explain, intrinsics, map_tags, measure, pose_graph, rig_from_detections,
        rig_from_images, schema, write_atomically,
    };
    #[pymodule_export]
    use super::lines::solve_lines;
    #[pymodule_export]
    use super::many::{Poses, solve_many};
    #[pymodule_export]
    use super::monitor::Monitor;
    #[pymodule_export]
    use super::points::{solve, solve_table};
    #[pymodule_export]
    use super::pose::Pose;
    #[pymodule_export]
    use super::program::main;
    #[pymodule_export]
    use super::robot::{hand_eye, hand_eye_of_poses, rig_pose};
    #[pymodule_export]
    use super::run::panic_on_purpose;
    #[pymodule_export]
    use super::table::{Table, table};
    #[pymodule_export]
    use super::target::Target;

    use pyo3::prelude::*;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
