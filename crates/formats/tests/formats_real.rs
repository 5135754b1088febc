//! Files that other programs wrote, in the folder RESIGHT_DATA.

use crate::recorded::recorded;
use resight_formats::core::{Point, Pose, Target, Vector6};
use resight_formats::{Format, read_cameras, read_target};

/// The published camN_from_cam0 (checked there against an adjustment of our own) follow from the file only when its
/// poses are read as world → camera.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn caliscope_array_is_world_to_camera() {
    let data = recorded("");
    let folder = data.join("caliscope_4cam_charuco");
    let file = read_cameras(folder.join("camera_array.toml")).unwrap();
    assert_eq!((file.format, file.cameras.len()), (Format::Caliscope, 4));
    assert_eq!(file.cameras[0].camera.parameters()[0].1, 894.5288733178912);
    let from_world: Vec<Pose> = file.cameras.iter().map(|c| c.placement.as_ref().unwrap().b_from_a).collect();
    let table = std::fs::read_to_string(folder.join("extrinsics_cam0_to_camN.csv")).unwrap();
    for row in table.lines().skip(1) {
        let n: Vec<f64> = row.split(',').map(|x| x.parse().unwrap()).collect();
        let cam_n_from_cam_0 = from_world[n[1] as usize] * from_world[0].inverse();
        let mut published = Pose::exp(&Vector6::new(n[2], n[3], n[4], 0.0, 0.0, 0.0));
        published.translation = Point::new(n[5], n[6], n[7]);
        assert!(cam_n_from_cam_0.angle_to_rad(&published) < 1e-9, "{row}");
        assert!((cam_n_from_cam_0.translation - published.translation).norm() < 1e-9, "{row}");
    }
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn caliscope_board_is_54_mm() {
    let data = recorded("");
    let file = read_target(data.join("caliscope_4cam_charuco/charuco.toml")).unwrap();
    let Target::Charuco(board) = file.target else { panic!() };
    assert!((board.square_m - 0.054).abs() < 1e-12 && (board.rows, board.columns) == (5, 4));
    assert!(file.warnings[0].contains("inverted"));
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn opensfm_intrinsics_with_a_matrix_of_rows() {
    let data = recorded("");
    let file = read_cameras(data.join("opensfm_berlin_2d3d/intrinsics.json")).unwrap();
    let camera = &file.cameras[0].camera;
    assert_eq!(
        (file.format, camera.model_name(), camera.size.unwrap().width_px),
        (Format::OpenCv, "brown_conrady", 3264)
    );
    assert_eq!(camera.parameters()[4].1, 0.08851464962037196);
}
