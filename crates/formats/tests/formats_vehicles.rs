//! Files of vehicles' data sets, MATLAB, lens profiles and tf2_echo: points and pixels by the formulas of the programs that write them.

use crate::formats_files::between;
use crate::support::{example, read, text};
use resight_core::{Camera, Pixel, Point};
use resight_formats::{
    CameraFile, Format, explain, read_camera, read_cameras_from_bytes, read_places, read_rig,
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

#[track_caller]
fn refusal(name: &str, text: impl Into<Vec<u8>>) -> String {
    read_cameras_from_bytes(Path::new(name), text.into())
        .map(|file| panic!("accepted: {file:?}"))
        .unwrap_err()
        .to_string()
}

#[track_caller]
fn assert_refused(name: &str, from: &str, to: &str, words: &str) {
    let original = text(name);
    assert!(original.contains(from), "{from}");
    let reason = refusal(name, original.replacen(from, to, 1));
    assert!(reason.contains(words), "`{words}` is not in: {reason}");
}

fn size(camera: &Camera) -> Option<(u32, u32)> {
    camera.size.map(|size| (size.width_px, size.height_px))
}

/// `worldToImage` of MATLAB, whose first pixel is (1, 1): ours is one less.
#[test]
fn matlab_counts_pixels_from_one() {
    let file = read("matlab_camera.json", Format::Matlab);
    let camera = &file.cameras[0].camera;
    assert_eq!(size(camera), Some((1296, 1032)));
    let (x, y) = (0.25f64, -0.125f64);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.4022 + r2 * (0.1808 + r2 * 0.025));
    let xd = x * radial + 2.0 * 0.0012 * x * y + -0.0007 * (r2 + 2.0 * x * x);
    let yd = y * radial + 0.0012 * (r2 + 2.0 * y * y) + 2.0 * -0.0007 * x * y;
    assert_pixel(camera, [0.5, -0.25, 2.0], (1410.25 * xd + 610.75 - 1.0, 1411.5 * yd + 551.5 - 1.0));
    // The same camera without the matrix, and with K.
    let own = text("matlab_camera.json");
    let matrix = "\"IntrinsicMatrix\": [[1410.25, 0, 0], [0, 1411.5, 0], [610.75, 551.5, 1]],";
    assert!(own.contains(matrix));
    for instead in ["", "\"K\": [[1410.25, 0, 610.75], [0, 1411.5, 551.5], [0, 0, 1]],"] {
        let text = own.replace(matrix, instead);
        let other = read_cameras_from_bytes(Path::new("matlab_camera.json"), text.into_bytes()).unwrap();
        assert_eq!(&other.cameras[0].camera, camera);
    }
    let inside = format!("{{\"cameraParams\": {{\"Intrinsics\": {own}}}}}");
    let inner = read_cameras_from_bytes(Path::new("matlab_camera.json"), inside.into_bytes()).unwrap();
    assert_eq!(&inner.cameras[0].camera, camera);
}

/// x₂ = x₁ R + t of row vectors, millimetres.
#[test]
fn matlab_pairs_multiply_rows() {
    let file = read("matlab_stereo.yaml", Format::Matlab);
    assert_maps(&file, "camera2", "camera1", [0.0, 0.0, 1.0], [-0.12 - 0.6, 0.0015, 0.02 + 0.8]);
    assert_pixel(&file.cameras[0].camera, [0.0, 0.0, 1.0], (320.0, 240.0));
    let own = text("matlab_stereo.yaml");
    let pose = own.replace(
        "  RotationOfCamera2: [[0.8, 0, 0.6], [0, 1, 0], [-0.6, 0, 0.8]]\n  TranslationOfCamera2: [-120, 1.5, 20]",
        "  PoseCamera2:\n    R: [[0.8, 0, -0.6], [0, 1, 0], [0.6, 0, 0.8]]\n    Translation: [-120, 1.5, 20]",
    );
    assert_ne!(pose, own);
    let file = read_cameras_from_bytes(Path::new("a.yaml"), pose.into_bytes()).unwrap();
    assert_maps(&file, "camera2", "camera1", [0.0, 0.0, 1.0], [-0.12 - 0.6, 0.0015, 0.02 + 0.8]);
    let inches = own.replace("WorldUnits: millimeters", "WorldUnits: inches");
    let file = read_cameras_from_bytes(Path::new("a.yaml"), inches.into_bytes()).unwrap();
    assert_maps(&file, "camera2", "camera1", [0.0; 3], [-120.0 * 0.0254, 1.5 * 0.0254, 20.0 * 0.0254]);
    assert_refused("matlab_stereo.yaml", "millimeters", "yards", "is `yards`; millimeters");
    assert_refused("matlab_stereo.yaml", "[[0.8, 0, 0.6]", "[[0.9, 0, 0.6]", "not a rotation");
}

#[test]
fn matlab_displays_five_digits() {
    let file = read("matlab_display.txt", Format::Matlab);
    let camera = &file.cameras[0].camera;
    assert_eq!(size(camera), Some((1296, 1032)));
    assert_pixel(camera, [0.0, 0.0, 1.0], (609.9592, 550.9464));
    assert!(file.warnings.iter().any(|w| w.contains("five digits")), "{:?}", file.warnings);
    assert_refused("matlab_display.txt", "RadialDistortion", "Radial", "`RadialDistortion` is missing");
    assert_refused("matlab_display.txt", "[-0.4022 0.1808]", "[-0.4022]", "MATLAB has 2 or 3");
    let fisheye = "cameraParams:\n  MappingCoefficients: [1, 2, 3, 4]\n  StretchMatrix: [[1, 0], [0, 1]]\n";
    assert!(refusal("a.yaml", fisheye).contains("Scaramuzza"));
    let shown = "stereoParameters with properties:\n\n  CameraParameters1: [1×1 cameraParameters]\n  CameraParameters2: [1×1 cameraParameters]\n";
    assert!(refusal("a.txt", shown).contains("toStruct"));
}

/// egovehicle_from_camera, w first; the published images have no distortion.
#[test]
fn argoverse_cameras_stand_in_the_vehicle() {
    let first = read("argoverse1/vehicle_calibration_info.json", Format::Argoverse);
    let names: Vec<&str> = first.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["ring_front_center", "stereo_front_left"]);
    assert_eq!(size(&first.cameras[1].camera), Some((2464, 2056)));
    assert_maps(&first, "egovehicle", "ring_front_center", [0.0, 0.0, 2.0], [3.625, 0.0, 1.375]);
    assert_maps(&first, "egovehicle", "down_lidar", [0.0, 1.0, 1.0], [1.35, -1.0, 0.64]);
    assert_pixel(&first.cameras[0].camera, [0.5, 0.25, 1.0], (958.5 + 696.0, 611.25 + 0.25 * 1393.5));
    let second = read_rig(&[example("argoverse2")]).unwrap();
    assert_eq!(second.format, Format::Argoverse);
    assert_eq!(size(&second.cameras[0].camera), Some((1550, 2048)));
    assert_maps(&second, "egovehicle", "ring_front_center", [0.0, 0.0, 2.0], [3.625, 0.0, 1.375]);
    assert_maps(&second, "egovehicle", "up_lidar", [1.0, 0.0, 0.0], [2.35, 0.0, 1.64]);
    let records =
        r#"[{"sensor_name": "a", "qw": 1, "qx": 0, "qy": 0, "qz": 0, "tx_m": 1, "ty_m": 2, "tz_m": 3}]"#;
    let path = std::env::temp_dir().join(format!("resight-argoverse-{}.json", std::process::id()));
    std::fs::write(&path, records).unwrap();
    assert_maps(&read_places(&path).unwrap(), "egovehicle", "a", [0.0; 3], [1.0, 2.0, 3.0]);
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn argoverse_tables_that_cannot_be_read_say_why() {
    let name = "argoverse2/intrinsics.csv";
    assert_refused(name, ",2048,1550", ",2048", "9 cells under 10 columns");
    assert_refused(name, "1776.25,1776.25", "-1776.25,1776.25", "positive");
    assert_refused(name, "2048,1550\n", "2048,1550.5\n", "whole number");
    assert_refused(
        "argoverse2/egovehicle_SE3_sensor.csv",
        "0.5,-0.5,0.5,-0.5",
        "0.5,-0.5,0.5,-0.6",
        "length 1",
    );
    let binary = refusal("intrinsics.feather", b"ARROW1\0\0\xff\xff\xff\xff\x10\0".to_vec());
    assert!(binary.contains("read_feather") && binary.contains("to_csv"), "{binary}");
    assert_refused(
        "argoverse1/vehicle_calibration_info.json",
        "\"skew_\": 0.0",
        "\"skew_\": 2.0",
        "without skew",
    );
    let lacking = refusal("a.json", r#"{"sensor_name": "a", "fx_px": 1.0}"#);
    assert!(lacking.contains("Argoverse calibration, which needs fy_px"), "{lacking}");
}

/// `CameraModel.project` of the SDK behind `build_se3_transform` of the extrinsics.
#[test]
fn robotcar_mounts_are_between_camera_and_vehicle() {
    let rig = read_rig(&[example("robotcar")]).unwrap();
    assert_eq!(rig.format, Format::RobotCar);
    let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["mono_left", "stereo_wide_right"]);
    // Ahead of the vehicle is ahead of the stereo camera, 24 cm to the left of its right half; z is down.
    assert_maps(&rig, "stereo_wide_right", "vehicle", [10.0, 0.0, 1.0], [-0.239983, 1.0, 10.0]);
    let (roll, pitch, yaw) = (0.2f64, -0.25f64, 1.25f64);
    let x = [4.0, 3.0, 0.5];
    let rx = [x[0], roll.cos() * x[1] - roll.sin() * x[2], roll.sin() * x[1] + roll.cos() * x[2]];
    let ry = [pitch.cos() * rx[0] + pitch.sin() * rx[2], rx[1], -pitch.sin() * rx[0] + pitch.cos() * rx[2]];
    let rz = [yaw.cos() * ry[0] - yaw.sin() * ry[1], yaw.sin() * ry[0] + yaw.cos() * ry[1], ry[2]];
    let mount = [rz[0] - 0.0905, rz[1] + 1.6375, rz[2] + 0.2803];
    assert_maps(&rig, "mono_left", "vehicle", x, [mount[1], mount[2], mount[0]]);
    assert_maps(&rig, "vehicle", "ins", [0.0; 3], [-1.7125, 0.125, 1.1875]);
    assert_pixel(&rig.cameras[0].camera, [0.5, 0.25, 1.0], (500.25 + 200.0, 511.5 + 0.25 * 401.5));
    let six = refusal("somewhere.txt", "0 0 0 0 0 0\n");
    assert!(six.contains("bare numbers"), "{six}");
    let turned =
        text("robotcar/models/mono_left.txt").replacen("0.000000 1.000000 0.000000 0.000000", "0 -1 0 0", 1);
    assert!(refusal("mono_left.txt", turned).contains("mirror"));
}

#[test]
fn gyroflow_is_opencv_fisheye() {
    let file = read("gyroflow.json", Format::Gyroflow);
    assert_eq!(size(&file.cameras[0].camera), Some((1920, 1440)));
    let theta = 1.0f64.atan();
    let t2 = theta * theta;
    let r = theta * (1.0 + t2 * (0.035 + t2 * (0.0425 + t2 * (-0.0365 + t2 * 0.0125))));
    assert_pixel(
        &file.cameras[0].camera,
        [0.6, -0.8, 1.0],
        (983.5 + 951.25 * 0.6 * r, 718.25 - 951.5 * 0.8 * r),
    );
    assert_refused("gyroflow.json", "0.0365, 0.0125]", "0.0365]", "a fisheye has 4");
    assert_refused(
        "gyroflow.json",
        "\"use_opencv_fisheye\": true",
        "\"distortion_model\": \"sony\"",
        "is `sony`",
    );
    let stretched = text("gyroflow.json").replace("stretch\": 1.0", "stretch\": 1.33");
    let file = read_cameras_from_bytes(Path::new("a.json"), stretched.into_bytes()).unwrap();
    assert!(file.warnings.iter().any(|w| w.contains("1.33")), "{:?}", file.warnings);
}

/// lensfun's own polynomials, of radii in halves of the short side; its profiles are of the undistorted image's focal length.
#[test]
fn lensfun_gives_its_radii() {
    let file = read("lensfun.xml", Format::Lensfun);
    let names: Vec<&str> = file.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["Poly_three_4mm", "Poly_five_4mm", "Odd_powers_4mm", "Wide_3mm"]);
    // 36 × 24 mm over 5, of 4:3, is 5.192 mm high; 4000 × 3000 px.
    let half_mm = (36f64.hypot(24.0) / 5.0) * 0.6 / 2.0;
    let place = |radius: f64| 1499.5 - 1500.0 * radius;
    let tan = |degrees: f64| degrees.to_radians().tan();
    for (i, degrees, off_px) in
        [(0, 10.0, 1e-9), (0, 25.0, 1e-9), (1, 25.0, 1e-9), (2, 12.0, 2.0), (2, 30.0, 2.0)]
    {
        let r = 4.0 / half_mm * tan(degrees);
        let radius = match i {
            0 => r * (1.03 - 0.03 * r * r),
            1 => r * (1.0 - 0.05 * r * r + 0.0125 * r.powi(4)),
            _ => r * (1.0275 + 0.01 * r - 0.05 * r * r + 0.0125 * r.powi(3)),
        };
        let seen = file.cameras[i].camera.project(&Point::new(0.0, -tan(degrees), 1.0)).unwrap();
        assert!(
            (seen.y - place(radius)).abs() < off_px && (seen.x - 1999.5).abs() < 1e-9,
            "{i} {degrees}: {seen}"
        );
    }
    let half_angle = 25f64.to_radians().tan();
    let r = 3.0 / half_mm * 2.0 * half_angle;
    let seen = file.cameras[3].camera.project(&Point::new(0.0, -tan(50.0), 1.0)).unwrap();
    assert!((seen.y - place(r * (1.03 - 0.03 * r * r))).abs() < 0.1, "{seen}");
    let fits: Vec<&String> = file.warnings.iter().filter(|w| w.contains("are fitted")).collect();
    assert!(fits.len() == 1 && fits[0].contains("2 of 4"), "{:?}", file.warnings);
}

#[test]
fn lensfun_files_that_cannot_be_read_say_why() {
    let name = "lensfun.xml";
    // The others of a database are read.
    for (from, to, words) in [
        (
            "focal=\"4\" k1=\"-0.03\"",
            "focal=\"0\" k1=\"-0.03\"",
            "line 19: distortion.@focal: the focal length is `0`",
        ),
        ("<type>stereographic</type>", "<type>panoramic</type>", "<type> is `panoramic`"),
        ("k1=\"-0.03\"", "k1=\"1.5\"", "which no lens does"),
        ("model=\"poly3\"", "model=\"poly9\"", "is `poly9`; poly3"),
        (
            "a=\"0.0125\" b=\"-0.05\" c=\"0.01\"",
            "a=\"0.01\" b=\"0.02\" c=\"-0.6\"",
            "in the nearest model here",
        ),
    ] {
        let own = text(name);
        assert!(own.contains(from), "{from}");
        let file = read_cameras_from_bytes(Path::new(name), own.replacen(from, to, 1).into_bytes()).unwrap();
        assert_eq!(file.cameras.len(), 3, "{from}");
        let said = file.warnings.iter().any(|w| w.contains("1 lenses are left out") && w.contains(words));
        assert!(said, "`{words}` is not in {:?}", file.warnings);
    }
    let bomb = text(name).replace("SYSTEM \"lensfun-database.dtd\"", "[<!ENTITY a \"aaaaaaaa\">]");
    assert!(refusal(name, bomb).contains("DTD"), "an inner DTD stays refused");
}

/// The lens before rectification is read by its name, and joined to the rectified cameras.
#[test]
fn kitti_raw_has_its_cameras_before_rectification() {
    let path = example("kitti_unrectified/calib_cam_to_cam.txt");
    let camera = read_camera(format!("{}#cam1_unrectified", path.display())).unwrap();
    let (x, y) = (0.2f64, -0.1f64);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.3675 + r2 * (0.1875 + r2 * -0.0625));
    let xd = x * radial + 2.0 * 1.25e-4 * x * y + 2.5e-4 * (r2 + 2.0 * x * x);
    let yd = y * radial + 1.25e-4 * (r2 + 2.0 * y * y) + 2.0 * 2.5e-4 * x * y;
    assert_pixel(&camera.camera, [0.2, -0.1, 1.0], (986.0 * xd + 702.0, 982.0 * yd + 259.0));
    assert_eq!(size(&camera.camera), Some((1392, 512)));
    let rig = read_rig(&[format!("{}#cam1_unrectified", path.display()).into()]).unwrap();
    assert_eq!(rig.cameras.len(), 1);
    assert_maps(
        &rig,
        "cam1_unrectified",
        "cam0_unrectified",
        [0.0, 0.0, 1.0],
        [-0.54 - 0.6, 0.0045, 0.8 - 0.012],
    );
    assert!(explain(&path).unwrap().contains("FILE#cam0_unrectified"));
}

#[test]
fn tf2_echo_is_the_child_in_its_parent() {
    let file = read_places(example("tf_echo.txt")).unwrap();
    assert_eq!(file.format, Format::StaticTransforms);
    // camera_link is turned by 90° about z; its optical frame looks along its x.
    assert_maps(&file, "base_link", "camera_link", [1.0, 0.0, 0.0], [0.19, 1.0, 0.22]);
    assert_maps(&file, "base_link", "camera_optical_frame", [0.0, 0.0, 1.0], [0.19, 1.01, 0.22]);
    assert!(file.warnings.iter().any(|w| w.contains("three decimals")), "{:?}", file.warnings);
    let own = text("tf_echo.txt");
    let nameless: String =
        own.lines().filter(|l| !l.starts_with(['$', '['])).map(|l| format!("{l}\n")).collect();
    assert!(refusal("a.txt", nameless).contains("tf2_echo PARENT CHILD"));
    let broken = own.replace("[0.190, -0.000, 0.220]", "[0.190, nan, 0.220]");
    assert!(refusal("a.txt", broken).contains("3 finite numbers"));
}

#[test]
fn a_matrix_alone_is_read_where_its_meaning_is_stated() {
    for (name, b) in [("matrix_with_comment.txt", "cam"), ("named_matrix/left_T_lidar.txt", "left")] {
        let file = read_places(example(name)).unwrap();
        assert_eq!(file.format, Format::PoseMatrices);
        assert_maps(&file, b, "lidar", [10.0, 1.0, 2.0], [-0.9, -2.2, 9.7]);
    }
}
