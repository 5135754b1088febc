//! Files with a key for each number, as SLAM and reconstruction programs write them: what each number means, and who else has such keys.

use crate::support::{example, read};
use resight_core::{Camera, Pixel, Point};
use resight_formats::input::what_is_it::{FileKind, what_is_it};
use resight_formats::{Format, explain_from_bytes, read_cameras_from_bytes};
use std::path::Path;

#[track_caller]
fn assert_parameters(camera: &Camera, model: &str, size: (u32, u32), expected: &[f64]) {
    assert_eq!(camera.model_name(), model);
    assert_eq!(camera.size.map(|size| (size.width_px, size.height_px)), Some(size));
    let values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
    assert_eq!(values.len(), expected.len(), "{values:?}");
    for (value, expected) in values.iter().zip(expected) {
        assert!((value - expected).abs() < 1e-9, "{values:?}");
    }
}

#[test]
fn plain_keys_are_those_of_opencv() {
    let file = read("plain_keys.yaml", Format::PlainKeys);
    let expected = [612.4, 611.9, 331.2, 238.7, -0.21, 0.09, 0.0006, -0.0004];
    assert_parameters(&file.cameras[0].camera, "brown_conrady", (640, 480), &expected);
    // k1 alone is a coefficient, not a camera matrix; nothing here is a camera.
    let refused =
        read_cameras_from_bytes(Path::new("a.yaml"), b"k1: -0.21\nk2: 0.09\n".to_vec()).unwrap_err();
    assert!(refused.to_string().contains("not a camera file"), "{refused}");
}

#[test]
fn orb_slam_has_two_fisheyes_and_their_pose() {
    let file = read("orb_slam.yaml", Format::OrbSlam);
    let [first, second] = &file.cameras[..] else { panic!("{:?}", file.cameras) };
    let expected = [190.5, 190.25, 254.75, 256.5, 0.0034, 0.0007, -0.002, 0.0002];
    assert_parameters(&first.camera, "kannala_brandt", (512, 512), &expected);
    let placement = second.placement.as_ref().expect("T_c1_c2");
    assert_eq!((placement.b.as_str(), placement.a.as_str()), ("Camera1", "Camera2"));
    // Its translation is where the second camera is, in the first.
    assert_eq!(placement.b_from_a * Point::zeros(), Point::new(0.1, 0.002, 0.01));
}

#[test]
fn orb_slam_without_a_number_is_no_distortion() {
    let text =
        b"Camera.type: \"PinHole\"\nCamera.fx: 612.4\nCamera.fy: 611.9\nCamera.cx: 331.2\nCamera.cy: 238.7\n"
            .to_vec();
    let file = read_cameras_from_bytes(Path::new("a.yaml"), text).unwrap();
    assert_eq!((file.format, file.cameras[0].camera.model_name()), (Format::OrbSlam, "pinhole"));
}

/// Equation of camodocal's EquidistantCamera: r = θ + k2 θ³ + k3 θ⁵ + k4 θ⁷ + k5 θ⁹, u = mu r cos φ + u0.
#[test]
fn camodocal_kannala_brandt_gives_its_pixels() {
    let file = read("camodocal_kannala.yaml", Format::Camodocal);
    assert_eq!(file.cameras[0].name, "front");
    let point = Point::new(0.5, -0.3, 1.0);
    let theta = (0.34f64.sqrt()).atan();
    let t2 = theta * theta;
    let r = theta * (1.0 + t2 * (-0.0129 + t2 * (0.0209 + t2 * (-0.0123 + t2 * 0.0023))));
    let along = r / 0.34f64.sqrt();
    let expected = Pixel::new(460.5 * along * 0.5 + 365.25, 459.5 * along * -0.3 + 248.5);
    let seen = file.cameras[0].camera.project(&point).expect("in front");
    assert!((seen - expected).norm() < 1e-9, "{seen} {expected}");
}

/// Equation of camodocal's CataCamera: p = (x, y)/(z + ξ |P|), distorted, then gamma and the principal point.
#[test]
fn camodocal_mei_gives_its_pixels() {
    let file = read("camodocal_mei.yaml", Format::Camodocal);
    let (x, y, z) = (0.4f64, 0.2f64, 1.0f64);
    let scale = z + 0.9055 * (x * x + y * y + z * z).sqrt();
    let (x, y) = (x / scale, y / scale);
    let r2 = x * x + y * y;
    let radial = 1.0 + r2 * (-0.123 + r2 * 0.0267);
    let u = x * radial + 2.0 * 0.0002 * x * y + 0.0009 * (r2 + 2.0 * x * x);
    let v = y * radial + 2.0 * 0.0009 * x * y + 0.0002 * (r2 + 2.0 * y * y);
    let expected = Pixel::new(876.5 * u + 365.5, 874.25 * v + 249.25);
    let seen = file.cameras[0].camera.project(&Point::new(0.4, 0.2, 1.0)).expect("in front");
    assert!((seen - expected).norm() < 1e-9, "{seen} {expected}");
}

#[test]
fn transforms_have_corners_for_pixels_and_opengl_for_axes() {
    let file = read("transforms.json", Format::NerfTransforms);
    let expected = [900.0, 899.0, 640.0, 358.75, -0.02, 0.01, 0.0003, -0.0002];
    assert_parameters(&file.cameras[0].camera, "brown_conrady", (1280, 720), &expected);
    let [frame] = &file.relations[..] else { panic!("{:?}", file.relations) };
    assert_eq!((frame.b.as_str(), frame.a.as_str()), ("world", "images/0001.jpg"));
    // The camera looks along −z of OpenGL, which the matrix turns to +y of the world: one metre ahead is (2, 4, 4).
    assert!((frame.b_from_a * Point::new(0.0, 0.0, 1.0) - Point::new(2.0, 4.0, 4.0)).norm() < 1e-12);
    let by_angle = br#"{"camera_angle_x": 1.5707963267948966, "w": 800, "h": 600, "frames": []}"#.to_vec();
    let file = read_cameras_from_bytes(Path::new("t.json"), by_angle).unwrap();
    assert_parameters(&file.cameras[0].camera, "pinhole", (800, 600), &[400.0, 400.0, 399.5, 299.5]);
    let in_degrees = br#"{"x_fov": 90, "w": 800, "h": 600, "frames": []}"#.to_vec();
    let same = read_cameras_from_bytes(Path::new("t.json"), in_degrees).unwrap();
    let (same, by_angle) = (same.cameras[0].camera.parameters(), file.cameras[0].camera.parameters());
    assert!(same.iter().zip(&by_angle).all(|((_, a), (_, b))| (a - b).abs() < 1e-12), "{same:?}");
}

/// Each frame has its own lens, or the file's; k4 is of r⁸ there and none of OpenCV's.
#[test]
fn transforms_that_cannot_be_read_say_why() {
    let text = std::fs::read_to_string(example("transforms.json")).unwrap();
    for (from, to, reason) in [
        ("\"w\": 1280, \"h\": 720,", "", "`w` and `h`, the size of the images in pixels, are needed"),
        ("\"k2\": 0.01,", "\"k2\": 0.01, \"k4\": 0.001,", "k4 is 0.001, the coefficient of r⁸"),
        ("\"OPENCV\"", "\"EQUIRECTANGULAR\"", "camera_model `EQUIRECTANGULAR` is not supported"),
        ("[[1, 0, 0, 2]", "[[2, 0, 0, 2]", "transform_matrix: is not a rotation"),
        ("transform_matrix", "transform_matrix_start", "moves while it is exposed"),
        ("\"file_path\"", "\"file\"", "frames[0]: the key `file_path` is missing"),
    ] {
        assert!(text.contains(from), "{from}");
        let changed = text.replacen(from, to, 1).into_bytes();
        let refused = read_cameras_from_bytes(Path::new("t.json"), changed).unwrap_err().to_string();
        assert!(refused.contains(reason), "{refused}");
    }
    let own = text.replace(
        "\"transform_matrix\"",
        "\"fl_x\": 450.0, \"w\": 640, \"h\": 360, \"cx\": 320.0, \"cy\": 180.0, \"transform_matrix\"",
    );
    let file = read_cameras_from_bytes(Path::new("t.json"), own.into_bytes()).unwrap();
    assert_eq!((file.cameras.len(), file.cameras[0].name.as_str()), (1, "images/0001.jpg"));
    assert_eq!(file.cameras[0].camera.size.map(|size| size.width_px), Some(640));
}

/// The nearest formats with what they lack, and the keys as they are: with the points in them, and long ones whole.
#[test]
fn an_unknown_file_is_refused_with_what_it_lacks() {
    let refused = |text: &str| {
        read_cameras_from_bytes(Path::new("a.yaml"), text.as_bytes().to_vec()).unwrap_err().to_string()
    };
    let half = refused("fx: 600\nfy: 600\nk1: -0.2\n\"phone 4032 3024 brown 0.75\": 1\n");
    assert!(half.contains("keys fx, fy, k1, phone 4032 3024 brown 0.75"), "{half}");
    assert!(
        half.contains("the nearest: camera with a key for each number, which needs cx, cy too"),
        "{half}"
    );
    assert!(!half.contains("truncated"), "{half}");
    let orb = refused("Camera.fy: 600\nCamera.cx: 320\nCamera.cy: 240\n");
    assert!(orb.contains("ORB-SLAM settings, which needs Camera.fx too"), "{orb}");
    assert!(refused("colour: red\n").contains("the formats are Resight camera file"));
}

#[test]
fn open_sfm_counts_from_the_middle_in_longer_sides() {
    let file = read("open_sfm_camera_models.json", Format::OpenSfm);
    assert_eq!(file.cameras[0].name, "phone 4000 3000 brown 0.75");
    let expected = [3000.0, 3010.0, 2003.5, 1491.5, 0.05, -0.1, 0.0001, 0.0002, 0.01];
    assert_parameters(&file.cameras[0].camera, "brown_conrady", (4000, 3000), &expected);
    let expected = [576.0, 576.0, 319.5, 239.5, -0.05, 0.02, 0.0, 0.0];
    assert_parameters(&file.cameras[1].camera, "brown_conrady", (640, 480), &expected);
}

#[test]
fn the_ini_of_ros_is_its_yaml() {
    let file = read("ros.ini", Format::RosCameraInfo);
    assert_eq!(file.cameras[0].name, "narrow_stereo/left");
    let expected = [612.4, 611.9, 331.2, 238.7, -0.21, 0.09, 0.0006, -0.0004, 0.0];
    assert_parameters(&file.cameras[0].camera, "brown_conrady", (640, 480), &expected);
    let text = std::fs::read_to_string(example("ros.ini")).unwrap();
    let said = explain_from_bytes(Path::new("ros.ini"), text.clone().into_bytes()).unwrap();
    assert!(said.contains("0.060000 m along x"), "{said}");
    for (from, to, reason) in [
        ("0 611.9 238.7", "0 611.9", "camera_matrix: 8 numbers; 9 are needed"),
        ("0 611.9 238.7", "0 611,9 238.7", "`611,9` is not a number"),
        ("projection", "camera matrix", "camera_matrix is there twice"),
    ] {
        let refused =
            read_cameras_from_bytes(Path::new("a.ini"), text.replacen(from, to, 1).into_bytes()).unwrap_err();
        assert!(refused.to_string().contains(reason), "{refused}");
    }
}

/// Drivers write `cols: 5` beside eight coefficients, and matrices of zeros before anybody calibrated.
#[test]
fn camera_info_as_drivers_write_it() {
    let text = std::fs::read_to_string(example("ros_plumb_bob.yaml")).unwrap();
    let eight = text.replace("plumb_bob", "rational_polynomial").replace(
        "[-0.3375, 0.1115, -0.0007, -0.0001, 0]",
        "[0.61, 0.11, -0.0002, 0.0001, 0.004, 0.98, 0.27, 0.02]",
    );
    let file = read_cameras_from_bytes(Path::new("a.yaml"), eight.into_bytes()).unwrap();
    assert_eq!(file.cameras[0].camera.parameters().len(), 12);
    let named_plumb_bob = text.replace(
        "[-0.3375, 0.1115, -0.0007, -0.0001, 0]",
        "[0.61, 0.11, -0.0002, 0.0001, 0.004, 0.98, 0.27, 0.02]",
    );
    let same = read_cameras_from_bytes(Path::new("a.yaml"), named_plumb_bob.into_bytes()).unwrap();
    assert_eq!(same.cameras[0].camera, file.cameras[0].camera);
    assert!(
        same.warnings.iter().any(|w| w.contains("8 coefficients under plumb_bob")),
        "{:?}",
        same.warnings
    );
    // The names of librealsense, as its own recorder writes them.
    let recorded = text.replace("plumb_bob", "\"Inverse Brown Conrady\"");
    let recorded = read_cameras_from_bytes(Path::new("a.yaml"), recorded.into_bytes()).unwrap();
    let plain = read_cameras_from_bytes(Path::new("a.yaml"), text.clone().into_bytes()).unwrap();
    assert_eq!(recorded.cameras[0].camera, plain.cameras[0].camera);
    assert!(recorded.warnings.iter().any(|w| w.contains("0.01 px")), "{:?}", recorded.warnings);
    let five = text.replace("plumb_bob", "equidistant");
    let fisheye = read_cameras_from_bytes(Path::new("a.yaml"), five.into_bytes()).unwrap();
    assert_eq!(fisheye.cameras[0].camera.model_name(), "kannala_brandt");
    let zeros = text.replace("[430.5, 0, 306.9, 0, 430.4, 227.2, 0, 0, 1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]");
    let refused = read_cameras_from_bytes(Path::new("a.yaml"), zeros.into_bytes()).unwrap_err().to_string();
    assert!(refused.contains("never calibrated"), "{refused}");
    let nothing = text
        .replace("[430.5, 0, 306.9, 0, 430.4, 227.2, 0, 0, 1]", "[0, 0, 0, 0, 0, 0, 0, 0, 0]")
        .replace("image_width: 640", "image_width: 0")
        .replace("plumb_bob", "\"\"");
    let refused = read_cameras_from_bytes(Path::new("a.yaml"), nothing.into_bytes()).unwrap_err().to_string();
    assert!(refused.contains("never calibrated"), "{refused}");
}

/// What is no text is called by its name, with the way out.
#[test]
fn files_that_are_no_text_are_named() {
    let zip = |member: &str| [b"PK\x03\x04\x14\0\0\0", member.as_bytes(), b"\0\0\0"].concat();
    for (bytes, said) in [
        (zip("mtx.npy"), "NumPy archive"),
        (zip("xl/workbook.xml"), "save it as CSV"),
        (zip("readme"), "ZIP archive"),
        (b"\x93NUMPY\x01\0".to_vec(), "NumPy array"),
        (b"\x80\x04\x95".to_vec(), "Python pickle"),
        (b"\xff\xd8\xff\xe0\0".to_vec(), "a JPEG image"),
        (b"%PDF-1.7\n".to_vec(), "a PDF"),
        (b"\0\0\0\x18ftypheic".to_vec(), "a HEIC image"),
        (b"\0\0\0\x18ftypisom".to_vec(), "a video"),
        (b"MATLAB 5.0 MAT-file, Platform\0".to_vec(), "MATLAB"),
        (b"\xff\xfef\0x\0".to_vec(), "UTF-16"),
    ] {
        let kind = what_is_it(&bytes).expect("a kind of file").name;
        let refused = read_cameras_from_bytes(Path::new("camera"), bytes).unwrap_err().to_string();
        assert!(refused.contains(said) && refused.contains(kind), "{refused}");
    }
    let packets = [&b"G"[..], &[0xff; 187]].concat().repeat(3);
    assert!(what_is_it(&packets).is_some_and(FileKind::is_video));
    assert_eq!(what_is_it(&[&b"G"[..], &[b' '; 187]].concat().repeat(3)), None, "text");
    for text in ["# about AVI files", "cameras WEBP", "the ftypes", "OggS: 1", "µ"] {
        assert_eq!(what_is_it(text.as_bytes()), None, "{text}");
    }
}
