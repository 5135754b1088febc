//! The tests of this crate in one program: linking one for each file is most of the time of a clean run.

mod detect_support;
mod dots_support;
mod film_support;
mod fuzz_support;
mod landmarks_support;
mod real_support;
#[path = "../../core/tests/recorded.rs"]
mod recorded;
mod report_support;

mod board_parts;
mod corner_sigma;
mod detect_real;
mod detect_synthetic;
mod dots_accuracy;
mod dots_identification;
mod dots_lens;
mod everyday;
mod follow;
mod fuzz;
mod images_of_any_size;
mod hints;
mod landmarks;
mod not_found;
mod real_aprilgrid;
mod real_board_counts;
mod real_chessboard;
mod real_fisheye_boards;
mod real_four_points;
mod real_intrinsics;
mod real_landmarks;
mod real_pnp_literals;
mod real_pose_graph;
mod real_robust;
mod real_rotating_tag;
mod real_tag_map;
mod render_is_read_by_detectors;
mod render_physics;
mod report_rig;
mod rig_jobs;
mod scene;
mod sharp_tags;
mod tag_tolerance;
mod target_table;
mod mirrored;
