//! `explain` in sentences: where a camera stands and looks must be right, and the traps must be named.

use crate::support::example;
use resight_formats::{explain, explain_from_bytes};
use std::path::Path;

#[track_caller]
fn assert_explains(name: &str, sentences: &[&str]) {
    let text = explain(example(name)).unwrap();
    for sentence in sentences {
        assert!(text.contains(sentence), "`{sentence}` is not in:\n{text}");
    }
}

/// R turns 36.87° about y with cos 0.8, sin 0.6; centre −Rᵀ t = (0.8·0.12 + 0.6·0.02, −0.01, 0.6·0.12 − 0.8·0.02).
#[test]
fn kalibr_camera_centre_and_direction() {
    assert_explains(
        "kalibr_camchain.yaml",
        &[
            "Kalibr camera chain, 6 cameras",
            "x_cam1 = R x_cam0 + t",
            "Centre of cam1 in frame `cam0`: (0.1080, -0.0100, 0.0560) m (0.1221 m from its origin)",
            "looks along (-0.6000, 0.0000, 0.8000), 36.9° off that frame's +z axis",
            "OpenVINS",
            "fisheye (Kannala–Brandt",
            "k1 = -0.01",
        ],
    );
}

/// The pose maps the other way here: the translation is the centre itself.
#[test]
fn body_from_camera_poses_give_the_centre_directly() {
    let sentence = "Centre of cam7 in frame `body`: (-0.0200, -0.0600, 0.0100) m";
    assert_explains(
        "cam7/sensor.yaml",
        &["x_body = R x_cam7 + t", sentence, "inverse of Kalibr's T_cam_imu"],
    );
    assert_explains(
        "basalt.json",
        &["x_imu = R x_cam0 + t", "quaternion (w, x, y, z) = (0.800000, 0.000000, 0.000000, 0.600000)"],
    );
}

/// 2 atan(320 / 535.4): the principal point lies off the middle, so both halves count.
#[test]
fn fields_of_view_are_those_of_the_pinhole() {
    let (fx, cx) = (535.4f64, 341.8f64);
    let across = (((cx + 0.5) / fx).atan() + ((639.5 - cx) / fx).atan()).to_degrees();
    assert_explains(
        "own_pinhole.toml",
        &[&format!("{across:.1}° across"), "640 × 480 px", "one-to-one up to 90.0° off the axis"],
    );
}

#[test]
fn a_lens_that_folds_inside_the_image_says_so() {
    let folder = std::env::temp_dir().join(format!("resight-explain-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("folds.toml");
    let text = std::fs::read_to_string(example("own_pinhole.toml")).unwrap();
    std::fs::write(&path, text.replace("pinhole", "brown_conrady") + "distortion = [-1.5, 0.0, 0.0, 0.0]\n")
        .unwrap();
    let said = explain(&path).unwrap();
    assert!(said.contains("not the whole image"), "{said}");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn each_format_names_its_trap() {
    assert_explains("ros_plumb_bob.yaml", &["0.090000 m along x", "is not where the camera is"]);
    assert_explains(
        "opencv_stereo.yml",
        &[
            "x_M2 = R x_M1 + t",
            "Centre of M2 in frame `M1`: (0.0752, 0.0000, -0.0564) m",
            "T is not the second camera's position",
            "no image size",
        ],
    );
    assert_explains(
        "opencv_extrinsics.yml",
        &["poses only", "x_second = R x_first + t", "94.0 long", "divide by 1000"],
    );
    assert_explains("cameras.txt", &["0.5 px was subtracted", "world → camera"]);
    assert_explains(
        "left.cameramodel",
        &[
            "rt_cam_ref",
            "x_left = R x_reference + t",
            "from which mrcal computes how uncertain the intrinsics are",
        ],
    );
    assert_explains(
        "kalibr_results_cam.txt",
        &["poses between cameras are in camchain.yaml", "no correlations"],
    );
    assert_explains("caliscope.toml", &["cam_10 comes before cam_2", "x_2 = R x_world + t"]);
    assert_explains("photonvision_old.json", &["cameraExtrinsics"]);
    assert_explains("wpilib_2024.json", &["welded and AndyMark", "165.1 mm"]);
    assert_explains("own_photogrammetric.toml", &["photogrammetric: f = 3.54144878", "paper's W"]);
}

/// Read as T_cam_imu, cam0 stands at −Rᵀ t = (0.02, −0.01, −0.03); as OpenVINS's T_imu_cam at t. Both are printed, for a ruler.
#[test]
fn a_camchain_says_where_the_camera_were_if_it_were_openvins() {
    let both = "T_cam_imu puts cam0 at (0.0200, -0.0100, -0.0300) m in the IMU's frame; were its numbers those of an \
        OpenVINS T_imu_cam, cam0 would stand at (0.0100, 0.0200, 0.0300) m";
    assert_explains("kalibr_imucam.yaml", &[both, "time of `imu` = time stamp of cam0 + 1.000 ms"]);
}

#[test]
fn poses_of_robots_and_data_sets_are_explained() {
    assert_explains(
        "static_transforms.launch.py",
        &[
            "poses only",
            "x_base_link = R x_left_optical_frame + t",
            "line 17: six positional numbers",
            "w comes last",
        ],
    );
    assert_explains(
        "robot.urdf",
        &["x_mast = R x_left_optical_frame + t", "rpy is roll, pitch, yaw", "joint wheel is"],
    );
    assert_explains(
        "kitti_object.txt",
        &[
            "Centre of cam1 in frame `rect`: (0.5400, 0.0000, 0.0000) m",
            "x_cam0_unrectified = R x_velo + t",
            "P[0][3] is not a length",
            "Sketch: x to the right, z up",
        ],
    );
    assert_explains(
        "nuscenes/calibrated_sensor.json",
        &[
            "x_ego = R x_47fcd48f71d75e0da5c8c1704a9bfe0a + t",
            "(1.7000, 0.0000, 1.5000) m",
            "sensor.json beside this file",
        ],
    );
}

#[test]
fn targets_say_points_frame_and_critical_plane() {
    assert_explains(
        "target_tag.toml",
        &["4 known points over 80.0 × 80.0 mm", "z into the surface", "tag25h9 id 7"],
    );
    assert_explains(
        "target_middle.toml",
        &["47 % of its length", "Put the fourth point over an end", "off_m = [0, 0.15]"],
    );
    assert_explains("kalibr_aprilgrid.yaml", &["120 known points", "gap 26.4 mm", "y up"]);
}

#[test]
fn what_cannot_be_read_is_an_error_with_the_path() {
    let refusal = explain(Path::new("nowhere.toml")).unwrap_err().to_string();
    assert!(refusal.starts_with("nowhere.toml: "), "{refusal}");
}

/// Files of other programs as people have them: what they say is read, and what can hardly be so is remarked on.
#[test]
fn what_no_camera_has_is_remarked_on() {
    let said = |name: &str, from: &str, to: &str| {
        let text = std::fs::read_to_string(example(name)).unwrap();
        assert!(text.contains(from), "{name}: {from}");
        explain_from_bytes(Path::new("a.yaml"), text.replace(from, to).into_bytes()).unwrap()
    };
    assert!(!said("ros_plumb_bob.yaml", "", "").contains("Warnings"));
    let zeros = said("ros_plumb_bob.yaml", "[1, 0, 0, 0, 1, 0, 0, 0, 1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]");
    assert!(zeros.contains("rectification_matrix is no rotation"), "{zeros}");
    let spoilt = said("ros_plumb_bob.yaml", "[400, 0, 298.5, -36,", "[-640, 7, 298.5, -36,");
    assert!(spoilt.contains("projection_matrix is not that of a rectified image"), "{spoilt}");
    assert!(!spoilt.contains("stereo baseline"), "{spoilt}");
}

#[test]
fn a_skew_that_moves_no_pixel_is_none() {
    let with = |skew: &str| {
        format!(
            "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   \
            data: [ 600., {skew}, 320., 0., 600., 240., 0., 0., 1. ]\n\
            distortion_coefficients: !!opencv-matrix\n   rows: 1\n   cols: 5\n   dt: d\n   data: [ 0., 0., 0., 0., 0. ]\n"
        )
    };
    assert!(explain_from_bytes(Path::new("a.yml"), with("4e-4").into_bytes()).is_ok());
    let refused = explain_from_bytes(Path::new("a.yml"), with("0.5").into_bytes()).unwrap_err().to_string();
    assert!(refused.contains("skew 0.5") && refused.contains("0.30 px"), "{refused}");
}
