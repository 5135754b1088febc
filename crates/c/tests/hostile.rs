//! What is no argument has a status and a message, and nothing is read or written beyond what the caller gave.

use crate::build::{Library, compiled, root, run, sanitizers};
use resight_c::status::Status;
use std::process::Command;

fn ends(printed: &str, name: &str) -> Vec<(i32, String)> {
    let of = |line: &str| {
        let (status, message) = line.strip_prefix(name)?.strip_prefix(' ')?.split_once(' ')?;
        Some((status.parse().expect("a status"), message.to_string()))
    };
    printed.lines().filter_map(of).collect()
}

/// Name of the call in `hostile.c`, the status, and what the message has to name.
const WANTED: [(&str, Status, &str); 46] = [
    ("null_points", Status::InvalidArgument, "points_m is a null pointer"),
    ("null_pixels", Status::InvalidArgument, "pixels is a null pointer"),
    ("misaligned", Status::InvalidArgument, "pixels is not aligned; a multiple of 8 bytes"),
    ("huge", Status::InvalidArgument, "18446744073709551615 values are more"),
    ("overflow", Status::InvalidArgument, "more than memory can hold"),
    ("none", Status::Degenerate, "0 points given"),
    ("two", Status::Degenerate, "2 points given"),
    ("view_not_utf8", Status::InvalidArgument, "view is not UTF-8 from byte 0"),
    ("solve_no_camera", Status::InvalidArgument, "camera is a null pointer"),
    ("solve_no_points", Status::InvalidArgument, "points is a null pointer"),
    ("solve_no_answer", Status::InvalidArgument, "answer is a null pointer"),
    ("solve_misaligned", Status::InvalidArgument, "camera is not aligned"),
    ("detect_no_target", Status::InvalidArgument, "target is a null pointer"),
    ("locate_no_image", Status::InvalidArgument, "image is a null pointer"),
    ("rig_no_rig", Status::InvalidArgument, "rig is a null pointer"),
    ("pose_of_none", Status::InvalidArgument, "answer is a null pointer"),
    ("pose_beyond", Status::InvalidArgument, "index is 1; the number of poses is 1"),
    ("pose_nowhere", Status::InvalidArgument, "pose is a null pointer"),
    ("residuals_few", Status::InvalidArgument, "residuals_px: n is 3; there are 4"),
    ("residuals_nowhere", Status::InvalidArgument, "residuals_px is a null pointer"),
    ("detections_many", Status::InvalidArgument, "detections: n is 1; there are 0"),
    ("camera_file", Status::File, "no/such/file.yml"),
    ("camera_null", Status::InvalidArgument, "file is a null pointer"),
    ("camera_nowhere", Status::InvalidArgument, "camera is a null pointer"),
    ("camera_of_target", Status::File, "board.toml"),
    ("camera_text", Status::File, "camera"),
    ("camera_name", Status::File, "camera"),
    ("intrinsics_nan", Status::InvalidArgument, "fx_px"),
    ("intrinsics_size", Status::InvalidArgument, "height_px"),
    ("distortion_nan", Status::InvalidArgument, "NaN"),
    ("distortion_3", Status::InvalidArgument, "3"),
    ("distortion_null", Status::InvalidArgument, "distortion is a null pointer"),
    ("distortion_huge", Status::InvalidArgument, "more than memory can hold"),
    ("image_file", Status::File, "Cargo.toml"),
    ("pixels_null", Status::InvalidArgument, "data is a null pointer"),
    ("pixels_no_column", Status::InvalidArgument, "an image without pixels"),
    ("pixels_no_row", Status::InvalidArgument, "an image without pixels"),
    ("pixels_channels", Status::InvalidArgument, "2 channels; 1 (grey)"),
    ("pixels_stride", Status::InvalidArgument, "stride_bytes is 63"),
    ("pixels_width", Status::InvalidArgument, "data"),
    ("pixels_height", Status::InvalidArgument, "data"),
    ("pixels_stride_huge", Status::InvalidArgument, "data"),
    ("locate_small", Status::NotFound, "no chessboard"),
    ("detect_empty", Status::NotFound, "no chessboard"),
    ("rig_camera", Status::InvalidArgument, "cameras: 7 of point 2; the rig has"),
    ("rig_nan", Status::Error, "line 2: column `u_px` is NaN"),
];

/// As the header promises; that no handle changes, their types say.
#[test]
fn threads_may_share_handles() {
    fn shared<T: Send + Sync>() {}
    shared::<resight_c::camera::Camera>();
    shared::<resight_c::target::Target>();
    shared::<resight_c::image::Image>();
    shared::<resight_c::rig::Rig>();
    shared::<resight_c::answer::Answer>();
}

#[test]
fn what_is_no_argument_has_a_status_and_a_message() {
    let source = root().join("crates/c/tests/programs/hostile.c");
    let printed = run(Command::new(compiled(&source, Library::Shared, sanitizers())).current_dir(root()));
    assert!(printed.starts_with("good 0 "), "{printed}");
    for (name, status, part) in WANTED {
        let all = ends(&printed, name);
        assert!(!all.is_empty(), "{name} is not printed");
        for (seen, message) in all {
            assert!(seen == status as i32 && message.contains(part), "{name}: {seen} {message}");
        }
    }
    // Numbers that cannot be are refused by the mathematics, or a pixel by the lens.
    for name in ["sigma_px", "sigma_m", "robust", "point", "pixel"] {
        for (seen, message) in ends(&printed, name) {
            let is_refused = seen == Status::Error as i32 || seen == Status::InvalidArgument as i32;
            assert!(is_refused && 20 < message.len(), "{name}: {seen} {message}");
        }
    }
    let n_calls = printed.lines().count();
    assert!(WANTED.len() + 18 < n_calls, "{n_calls} calls");
    // No call ends without a sentence, and none is the library's mistake.
    let silent = printed.lines().skip(1).find(|line| line.splitn(3, ' ').nth(2).is_none_or(str::is_empty));
    assert_eq!(silent, None);
    let mistake = format!(" {} ", Status::Internal as i32);
    assert!(!printed.contains(&mistake), "{printed}");
}
