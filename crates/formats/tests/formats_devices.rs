//! Files of cameras as devices, photogrammetry and vehicles store them: a point's pixel by the formula of the program that writes the file.

use crate::formats_files::between;
use crate::support::{example, read, text};
use resight_core::{Camera, Pixel, Point};
use resight_formats::{
    CameraFile, Format, explain, read_cameras, read_cameras_from_bytes, read_places, read_rig,
};
use std::path::Path;

#[track_caller]
fn assert_pixel(camera: &Camera, point: [f64; 3], expected: (f64, f64)) {
    let seen = camera.project(&Point::from(point)).expect("in front");
    assert!((seen - Pixel::new(expected.0, expected.1)).norm() < 1e-9, "{seen} is not {expected:?}");
}

#[track_caller]
fn assert_maps(file: &CameraFile, b: &str, a: &str, point_in_a: [f64; 3], expected: [f64; 3]) {
    let seen = between(file, b, a) * Point::from(point_in_a);
    assert!((seen - Point::from(expected)).norm() < 1e-12, "{seen} is not {expected:?}");
}

/// Refused with these words once `from` is `to`.
#[track_caller]
fn assert_refused(name: &str, from: &str, to: &str, words: &str) {
    let original = text(name);
    assert!(original.contains(from), "{from}");
    let reason = read_cameras_from_bytes(Path::new(name), original.replacen(from, to, 1).into_bytes())
        .map(|file| panic!("accepted: {file:?}"))
        .unwrap_err()
        .to_string();
    assert!(reason.contains(words), "`{words}` is not in: {reason}");
}

/// Metashape's own formulas, with its pixel (0.5, 0.5) in the middle of the first pixel.
#[test]
fn metashape_gives_its_pixels() {
    let file = read("metashape.xml", Format::Metashape);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["FC6310, 8.8mm", "GOPR0001"]);
    let (x, y) = (0.3f64, -0.2f64);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.01 + r2 * (0.012 + r2 * -0.004));
    let (p1, p2) = (0.0007, -0.0003);
    let xd = x * radial + p1 * (r2 + 2.0 * x * x) + 2.0 * p2 * x * y;
    let yd = y * radial + p2 * (r2 + 2.0 * y * y) + 2.0 * p1 * x * y;
    let u = 5472.0 * 0.5 - 12.5 + xd * 3650.25 + xd * -1.5;
    let v = 3648.0 * 0.5 + 20.25 + yd * 3650.25;
    assert_pixel(&file.cameras[0].camera, [0.6, -0.4, 2.0], (u - 0.5, v - 0.5));
    let rho = 1.3f64;
    let theta = rho.atan();
    let t2 = theta * theta;
    let along = theta * (1.0 + t2 * (0.04 + t2 * (-0.006 + t2 * (0.001 + t2 * 0.0002)))) / rho;
    let (u, v) = (1352.0 + 3.5 + 1180.5 * along * 0.5, 1014.0 - 2.25 - 1180.5 * along * 1.2);
    assert_pixel(&file.cameras[1].camera, [0.5, -1.2, 1.0], (u - 0.5, v - 0.5));
}

/// Ten units of the reference system to one of the chunk; two photographs share a lens, the third is the only one of its sensor.
#[test]
fn metashape_cameras_stand_in_their_chunk() {
    let file = read("metashape.xml", Format::Metashape);
    assert_maps(&file, "chunk", "DJI_0001", [0.0, 0.0, 2.0], [12.0, 20.0, 30.0]);
    assert_maps(&file, "chunk", "DJI_0002", [0.0, 0.0, 0.0], [5.0, 0.0, 0.0]);
    assert_maps(&file, "chunk", "GOPR0001", [0.0, 1.0, 0.0], [0.0, 1.5, 0.0]);
    assert_eq!(file.relations.len(), 2);
    assert!(
        file.warnings.iter().any(|w| w.contains("unknown_2 was never calibrated")),
        "{:?}",
        file.warnings
    );
    let alone = read("metashape_calibration.xml", Format::Metashape);
    assert_pixel(&alone.cameras[0].camera, [0.0, 0.0, 1.0], (2736.0 - 13.0, 1824.0 + 19.75));
}

/// Version 2: a transform for each component, to which a camera belongs by its number.
#[test]
fn metashape_components_have_scales_of_their_own() {
    let own = text("metashape.xml")
        .replace("<transform>\n      <rotation>", "<unused>\n      <rotation>")
        .replace("</scale>\n    </transform>", "</scale>\n    </unused>")
        .replace(
            "<cameras ",
            "<components><component id=\"0\"><transform><scale>2</scale></transform></component><component id=\"1\"/></components><cameras ",
        )
        .replace("sensor_id=\"1\"", "sensor_id=\"1\" component_id=\"1\"")
        .replace("id=\"1\" sensor_id=\"0\"", "id=\"1\" component_id=\"0\" sensor_id=\"0\"");
    let file = read_cameras_from_bytes(Path::new("m.xml"), own.clone().into_bytes()).unwrap();
    assert_maps(&file, "component_0", "DJI_0001", [0.0, 0.0, 0.0], [2.0, 4.0, 6.0]);
    assert_maps(&file, "component_1", "GOPR0001", [0.0, 0.0, 0.0], [0.0, 0.25, 0.0]);
    assert!(file.warnings.iter().any(|w| w.contains("no scale")), "{:?}", file.warnings);
    let unknown = own.replace("component_id=\"1\"", "component_id=\"7\"");
    let refused = read_cameras_from_bytes(Path::new("m.xml"), unknown.into_bytes()).unwrap_err().to_string();
    assert!(refused.contains("component_id 7 is no component"), "{refused}");
}

#[test]
fn metashape_files_that_cannot_be_read_say_why() {
    let name = "metashape.xml";
    assert_refused(name, "<k3>-0.004</k3>", "<k4>-0.004</k4>", "k4 is -0.004, which no lens model here has");
    assert_refused(name, "<b1>-1.5</b1>", "<b2>-1.5</b2>", "fix it at zero in Metashape");
    assert_refused(
        name,
        "type=\"frame\" class=\"adjusted\"",
        "type=\"spherical\" class=\"adjusted\"",
        "type `spherical`",
    );
    assert_refused(name, "<f>3650.25</f>", "", "calibration: <f> is missing");
    assert_refused(
        name,
        "<f>3650.25</f>",
        "<f>3650,25</f>",
        "f: holds 0 finite numbers of 1 words; 1 are needed",
    );
    assert_refused(name, "0 0 1 1  1 0 0 2", "0 0 1 1  1 0 0", "transform: holds 15 finite numbers");
    assert_refused(name, "0 0 1 1  1 0 0 2", "0 0 2 1  1 0 0 2", "not a rotation");
    assert_refused(name, "<scale>10</scale>", "<scale>-1</scale>", "has scale -1");
    assert_refused("metashape_calibration.xml", "<width>5472</width>", "", "states no size");
    let unscaled = text(name).replace("<scale>10</scale>", "");
    let file = read_cameras_from_bytes(Path::new(name), unscaled.into_bytes()).unwrap();
    assert!(file.warnings.iter().any(|w| w.contains("the chunk has no scale")), "{:?}", file.warnings);
}

/// DepthAI: 14 coefficients in OpenCV's order; extrinsics from this socket to another, in centimetres.
#[test]
fn depthai_is_opencv_in_centimetres() {
    let file = read("depthai.json", Format::DepthAi);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["CAM_B", "CAM_C"]);
    let (x, y) = (0.25f64, -0.5f64);
    let r2 = x * x + y * y;
    let radial = (1.0 + r2 * (-4.5 + r2 * (9.25 + r2 * 2.5))) / (1.0 + r2 * (-4.4 + r2 * (8.75 + r2 * 3.25)));
    let xd = x * radial + 2.0 * -0.0003 * x * y + 0.0004 * (r2 + 2.0 * x * x);
    let yd = y * radial + -0.0003 * (r2 + 2.0 * y * y) + 2.0 * 0.0004 * x * y;
    assert_pixel(&file.cameras[0].camera, [0.25, -0.5, 1.0], (799.75 * xd + 642.5, 799.5 * yd + 402.25));
    assert_maps(&file, "CAM_C", "CAM_B", [0.0, 0.0, 1.0], [0.6 - 0.075625, 0.000125, 0.8 - 0.0005]);
    assert!(file.warnings.iter().any(|w| w.contains("CAM_A was never calibrated")), "{:?}", file.warnings);
    assert_eq!(file.cameras[1].camera.model_name(), "kannala_brandt");
    assert_refused(
        "depthai.json",
        "\"cameraType\": 0",
        "\"cameraType\": 3",
        "is 3; 0 (perspective) and 1 (fisheye)",
    );
    assert_refused("depthai.json", "[1, {", "[{", "holds 1 values; a socket and its camera are needed");
    assert_refused("depthai.json", "\"x\": -7.5625,", "", "the key `x` is missing");
}

/// `intrinsic_transformation.c`, with p2 before p1; the corner of the first pixel is (0, 0) in the file.
#[test]
fn azure_kinect_is_normalised_from_the_corner() {
    let file = read("azure_kinect.json", Format::AzureKinect);
    let (x, y) = (0.25f64, 0.5f64);
    let rs = x * x + y * y;
    let a = 1.0 + rs * (0.5 + rs * (-0.02 + rs * -0.003));
    let b = 1.0 + rs * (0.85 + rs * (0.08 + rs * -0.014));
    let (p2, p1) = (-0.0001, 0.00002);
    let xd = x * a / b + (rs + 2.0 * x * x) * p2 + 2.0 * x * y * p1;
    let yd = y * a / b + (rs + 2.0 * y * y) * p1 + 2.0 * x * y * p2;
    let u = (xd * 0.4921875 + 0.5) * 1024.0 - 0.5;
    let v = (yd * 0.4931640625 + 0.5078125) * 1024.0 - 0.5;
    assert_eq!(file.cameras[0].name, "depth");
    assert_pixel(&file.cameras[0].camera, [0.25, 0.5, 1.0], (u, v));
    assert_maps(&file, "color", "depth", [0.0, 0.0, 1.0], [-0.032, 0.598, 0.804]);
    assert_refused(
        "azure_kinect.json",
        "ModelBrownConrady",
        "ModelTheta",
        "`CALIBRATION_LensDistortionModelTheta`",
    );
    assert_refused("azure_kinect.json", "-0.014, 0, 0,", "-0.014, 0.1, 0,", "centre of distortion (0.1, 0)");
    assert_refused(
        "azure_kinect.json",
        "-0.014, 0, 0,",
        "-0.014, 0,",
        "13 numbers; 14 are needed (cx cy fx fy",
    );
}

/// `rs2_project_point_to_pixel` puts the radially distorted point into the tangential terms: some 0.01 px here, which is reported.
#[test]
fn realsense_is_opencv_up_to_its_tangential_terms() {
    let file = read("realsense.json", Format::RealSense);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["color", "depth", "fisheye1"]);
    let (x, y) = (0.9f64, 0.5f64);
    let r2 = x * x + y * y;
    let f = 1.0 + r2 * (-0.055 + r2 * (0.065 + r2 * -0.021));
    let (xf, yf) = (x * f, y * f);
    let dx = xf + 2.0 * -0.0007 * xf * yf + 0.0003 * (r2 + 2.0 * xf * xf);
    let dy = yf + 2.0 * 0.0003 * xf * yf + -0.0007 * (r2 + 2.0 * yf * yf);
    let seen = file.cameras[0].camera.project(&Point::new(x, y, 1.0)).unwrap();
    let off = (seen - Pixel::new(640.5 * dx + 641.5, 639.75 * dy + 362.25)).norm();
    assert!(1e-6 < off && off < 0.05, "{off}");
    let said = file.warnings.iter().find(|w| w.contains("differs by at most")).expect("a remark");
    let most: f64 = said.rsplit("at most ").next().unwrap().trim_end_matches(" px").parse().unwrap();
    assert!(off <= most && most < 0.05, "{off} {said}");
    assert_eq!(file.cameras[1].camera.model_name(), "pinhole");
    let theta = 0.75f64.atan();
    let t2 = theta * theta;
    let along = theta * (1.0 + t2 * (-0.008 + t2 * (0.046 + t2 * (-0.043 + t2 * 0.008)))) / 0.75;
    let expected = (286.5 * along * 0.45 + 418.5, 286.25 * along * 0.6 + 403.25);
    assert_pixel(&file.cameras[2].camera, [0.45, 0.6, 1.0], expected);
    assert_refused(
        "realsense.json",
        "-0.0007, 0.0003",
        "-0.04, 0.03",
        "px from OpenCV's formula (at most 0.5 px is read)",
    );
    assert_refused(
        "realsense.json",
        "distortion.inverse_brown_conrady",
        "polynomial",
        "unknown model `polynomial`",
    );
    assert_refused(
        "realsense.json",
        "\"model\": \"distortion.inverse_brown_conrady\",",
        "",
        "but no `model`",
    );
}

/// The right camera stands at +Baseline: x_right = R x_left + T with T = (−Baseline, TY, TZ) in millimetres.
#[test]
fn zed_has_a_camera_for_every_resolution() {
    let file = read("zed.conf", Format::Zed);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["LEFT_CAM_HD", "RIGHT_CAM_HD", "LEFT_CAM_VGA"]);
    assert_eq!(file.cameras[2].camera.size.map(|s| (s.width_px, s.height_px)), Some((672, 376)));
    let (x, y) = (0.25f64, -0.5f64);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.17 + r2 * (0.025 + r2 * 0.001));
    let xd = x * radial + 2.0 * -0.0004 * x * y + 0.0002 * (r2 + 2.0 * x * x);
    let yd = y * radial + -0.0004 * (r2 + 2.0 * y * y) + 2.0 * 0.0002 * x * y;
    assert_pixel(&file.cameras[0].camera, [0.25, -0.5, 1.0], (700.5 * xd + 642.5, 700.25 * yd + 362.25));
    // A turn by CV about y.
    let (s, c) = 0.01f64.sin_cos();
    assert_maps(&file, "RIGHT_CAM_HD", "LEFT_CAM_HD", [0.0, 0.0, 1.0], [s - 0.12025, 0.0005, c - 0.00025]);
    assert_refused("zed.conf", "Baseline=120.25", "Baseline=-120.25", "a positive length is needed");
    assert_refused("zed.conf", "k1=-0.17", "", "k1 is neither here nor in LEFT_DISTO");
    assert_refused("zed.conf", "fx=700.5", "fx=700,5", "decimal comma");
    assert_refused("zed.conf", "fx=700.5", "fx 700.5", "neither a [section] nor `key = value`");
    let later = text("zed.conf").replace("k1=-0.17\nk2=0.025\np1=-0.0004\np2=0.0002\nk3=0.001\n", "")
        + "[LEFT_DISTO]\nk1=0.04\nk2=-0.006\nk3=0.001\nk4=0.0002\n";
    let file = read_cameras_from_bytes(Path::new("SN1.conf"), later.into_bytes()).unwrap();
    assert_eq!(file.cameras[0].camera.model_name(), "kannala_brandt");
}

#[test]
fn krtd_maps_the_world_into_the_camera() {
    let file = read("camera.krtd", Format::Krtd);
    let (x, y) = (0.25f64, -0.5f64);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.05 + r2 * (0.02 + r2 * 0.001));
    let xd = x * radial + 2.0 * 0.0003 * x * y + -0.0002 * (r2 + 2.0 * x * x);
    let yd = y * radial + 0.0003 * (r2 + 2.0 * y * y) + 2.0 * -0.0002 * x * y;
    assert_pixel(&file.cameras[0].camera, [0.25, -0.5, 1.0], (1000.5 * xd + 640.25, 999.5 * yd + 360.75));
    assert_maps(&file, "camera", "world", [0.0, 0.0, 1.0], [0.7, -0.2, 3.8]);
    assert_refused(
        "camera.krtd",
        "0.0003 -0.0002 0.001",
        "0.0003",
        "holds 3 coefficients; KWIVER's model takes",
    );
    assert_refused("camera.krtd", "0.8 0 0.6", "0.8 0 0.7", "R: is not a rotation");
    assert_refused("camera.krtd", "0.1 -0.2 3", "nan -0.2 3", "not finite");
    // Seven points are no camera.
    let points = "0 0 1\n".repeat(7);
    let refused = read_cameras_from_bytes(Path::new("a.txt"), points.into_bytes()).unwrap_err().to_string();
    assert!(!refused.contains("KWIVER camera (.krtd) with"), "{refused}");
}

/// parent_from_child with R = R_z(yaw) R_y(pitch) R_x(roll).
#[test]
fn autoware_states_children_in_their_parent() {
    let file = read_places(example("autoware_sensor_kit.yaml")).unwrap();
    assert_eq!(file.format, Format::Autoware);
    let parent = "sensor_kit_base_link";
    assert_maps(&file, parent, "velodyne_top_base_link", [2.0, 0.0, 0.0], [0.0, 2.0, 0.0]);
    let (s, c) = 0.315f64.sin_cos();
    let (sy, cy) = 1.035f64.sin_cos();
    let ahead = [0.10731 + cy * c, 0.56343 + sy * c, -0.27697 - s];
    assert_maps(&file, parent, "camera0/camera_link", [1.0, 0.0, 0.0], ahead);
    assert_refused("autoware_sensor_kit.yaml", "yaw: 1.035", "yaw: 59.3", "is it in degrees?");
    assert_refused("autoware_sensor_kit.yaml", "    pitch: 0.315\n", "", "the key `pitch` is missing");
    assert_refused("autoware_sensor_kit.yaml", "yaw: 1.035", "yaw: 1.035", "poses only, no intrinsics");
}

#[test]
fn matrices_need_a_name_that_states_their_frames() {
    let file = read_places(example("pose_matrices.yaml")).unwrap();
    assert_eq!(file.format, Format::PoseMatrices);
    assert_maps(&file, "cam", "lidar", [5.0, 0.0, 0.0], [0.1, 0.2, 5.3]);
    assert_maps(&file, "base", "lidar", [5.0, 0.0, 0.0], [6.8, -0.1, 1.05]);
    let refused = |name: &str, text: &str, words: &str| {
        let reason =
            read_cameras_from_bytes(Path::new(name), text.as_bytes().to_vec()).unwrap_err().to_string();
        assert!(reason.contains(words), "`{words}` is not in: {reason}");
    };
    let rows = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
    refused("a.yaml", &format!("T_cam_lidar: {rows}\n"), "call it `b_from_a` where x_b = M x_a");
    refused("a.json", rows, "a 4×4 matrix alone, which states no frames");
    refused("a.txt", "1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n", "a 4×4 matrix alone");
    refused("a.yaml", &format!("cam_from_lidar: {}\n", rows.replacen('1', "2", 1)), "not a rotation");
    refused("a.yaml", "gain: [1, 2, 3]\n", "not a camera file");
}

/// `solvePnP`: x_camera = R x_object + t, R a turn by 90° about y here.
#[test]
fn rvec_and_tvec_place_the_object_in_the_camera() {
    let file = read("solve_pnp.yml", Format::OpenCv);
    assert_maps(&file, "solve_pnp", "object", [0.0, 0.0, 1.0], [1.1, -0.2, 1.5]);
    assert_refused("solve_pnp.yml", "0., 1.5707963267948966, 0.", "0., 90., 0.", "is it in degrees?");
    assert_refused("solve_pnp.yml", "0.1, -0.2, 1.5", ".Nan, -0.2, 1.5", "finite");
}

#[test]
fn orb_slam_before_its_version_1_has_tlr_and_tbc() {
    let file = read("orb_slam_old.yaml", Format::OrbSlam);
    assert_maps(&file, "Camera", "Camera2", [0.0, 0.0, 1.0], [0.71, 0.002, 0.81]);
    assert_maps(&file, "imu", "Camera", [0.0, 0.0, 1.0], [-0.02, -0.06, 1.01]);
    let said = explain(example("orb_slam_old.yaml")).unwrap();
    assert!(said.contains("The baseline is 0.1100 m"), "{said}");
    let half = text("orb_slam_old.yaml").replace("Camera.height: 480\n", "");
    let refused = read_cameras_from_bytes(Path::new("a.yaml"), half.into_bytes()).unwrap_err().to_string();
    assert!(refused.contains("`Camera.height` is missing"), "{refused}");
}

/// imu_from_cam, in one file (VINS-Mono) or beside the cameras (VINS-Fusion).
#[test]
fn vins_configurations_place_their_cameras() {
    let mono = read("vins_mono.yaml", Format::Camodocal);
    assert_maps(&mono, "imu", "front", [1.0, 0.0, 0.0], [-0.02, 0.94, 0.01]);
    assert_eq!((mono.clocks[0].offset_s, mono.clocks[0].reference.as_str()), (0.004, "imu"));
    let fusion = read_rig(&[example("vins")]).unwrap();
    let models: Vec<(&str, &str)> =
        fusion.cameras.iter().map(|c| (c.name.as_str(), c.camera.model_name())).collect();
    assert_eq!(models, [("cam0", "omni"), ("cam1", "brown_conrady")]);
    assert_maps(&fusion, "cam0", "cam1", [0.0, 0.0, 0.0], [0.11, 0.0, 0.0]);
    let config = read_cameras(example("vins/stereo_config.yaml")).unwrap_err().to_string();
    assert!(config.contains("poses only, no intrinsics"), "{config}");
    assert_refused("vins_mono.yaml", "PINHOLE", "SCARAMUZZA", "calibrate the same images as MEI");
    assert_refused("vins_mono.yaml", "model_type: PINHOLE\n", "", "the key `model_type` is missing");
    assert_refused("vins_mono.yaml", "   cx: 379.75\n", "", "projection_parameters: the key `cx` is missing");
}

/// cam_from_world; a lens of two photographs is one camera, that of one photograph stands where it was taken.
#[test]
fn open_sfm_reconstructions_place_their_photographs() {
    let file = read("open_sfm_reconstruction.json", Format::OpenSfm);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["drone 4000 3000 brown 0.75", "side.jpg"]);
    assert_maps(&file, "0001.jpg", "world", [0.0, 0.0, 1.0], [2.0, 2.0, 3.0]);
    assert_maps(&file, "side.jpg", "0002.jpg", [0.5, 1.0, 2.0], [0.0, -0.75, 2.0]);
    // Its fisheye: θ (1 + k1 θ² + k2 θ⁴) in sides of 640 px, from the middle.
    let theta = 0.75f64.atan();
    let t2 = theta * theta;
    let along = theta * (1.0 + t2 * (-0.02 + t2 * 0.003)) / 0.75;
    let expected = (0.5 * 640.0 * along * 0.45 + 319.5, 0.5 * 640.0 * along * 0.6 + 239.5);
    assert_pixel(&file.cameras[1].camera, [0.45, 0.6, 1.0], expected);
    let name = "open_sfm_reconstruction.json";
    assert_refused(name, "\"rotation\": [0.0, 1.57", "\"turn\": [0.0, 1.57", "the key `rotation` is missing");
    assert_refused(name, "\"fisheye\"", "\"fisheye624\"", "model `fisheye624` is not supported");
}
