//! Files that other programs wrote, in the folder RESIGHT_DATA.

use resight::core::{Point, Target};
use resight::formats::{Format, read_cameras, read_target};
use std::path::PathBuf;

fn data() -> Option<PathBuf> {
    let Some(folder) = std::env::var_os("RESIGHT_DATA") else {
        println!("RESIGHT_DATA is not set: the tests on real files are skipped");
        return None;
    };
    let folder = PathBuf::from(folder);
    assert!(folder.is_dir(), "RESIGHT_DATA = {} is not a folder", folder.display());
    Some(folder)
}

/// cam1's rotation is nearly the identity in the published file: the world is (nearly) its own frame.
#[test]
fn caliscope_array_is_world_to_camera() {
    let Some(data) = data() else { return };
    let file = read_cameras(&data.join("caliscope_4cam_charuco/camera_array.toml")).unwrap();
    assert_eq!((file.format, file.cameras.len()), (Format::Caliscope, 4));
    let camera = &file.cameras[0];
    assert_eq!(camera.camera.parameters()[0].1, 894.5288733178912);
    let cam0_from_world = camera.placement.as_ref().unwrap().b_from_a;
    let t = Point::new(-0.6425176710599999, 0.2628680995431283, 1.4515383168392715);
    assert!((cam0_from_world.translation - t).norm() < 1e-15);
    // Published baselines are 0.49 to 1.61 m; camera 0 stands that far from camera 1.
    let cam1_from_world = file.cameras[1].placement.as_ref().unwrap().b_from_a;
    let baseline = (cam0_from_world * cam1_from_world.inverse()).translation.norm();
    assert!((0.4..1.7).contains(&baseline), "{baseline}");
}

#[test]
fn caliscope_board_is_54_mm() {
    let Some(data) = data() else { return };
    let file = read_target(&data.join("caliscope_4cam_charuco/charuco.toml")).unwrap();
    let Target::Charuco(board) = file.target else { panic!() };
    assert!((board.square_m - 0.054).abs() < 1e-12 && (board.rows, board.columns) == (5, 4));
    assert!(file.warnings[0].contains("inverted"));
}

#[test]
fn opensfm_intrinsics_with_a_matrix_of_rows() {
    let Some(data) = data() else { return };
    let file = read_cameras(&data.join("opensfm_berlin_2d3d/intrinsics.json")).unwrap();
    let camera = &file.cameras[0].camera;
    assert_eq!(
        (file.format, camera.model_name(), camera.size.unwrap().width_px),
        (Format::OpenCv, "brown_conrady", 3264)
    );
    assert_eq!(camera.parameters()[4].1, 0.08851464962037196);
}
