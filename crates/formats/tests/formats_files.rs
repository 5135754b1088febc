//! Files of robots, data sets and OpenCV: read against numbers worked out by hand, written to goldens, read back.
//!
//! The goldens lie in testdata/formats/golden/rigs, one folder a format; scripts/judges lets the programs they are meant
//! for read them and project the points of `pixels_files/pixels.csv` there, which this file writes too.

use crate::support::{assert_golden, chained, example, golden};
use resight_formats::core::{Camera, Pixel, Point, Pose};
use resight_formats::{
    CameraFile, Format, NamedCamera, OutFile, check_image_size, read_cameras, read_cameras_from_bytes,
    read_rig, write_rig,
};
use std::path::{Path, PathBuf};

fn rig_of(names: &[&str]) -> CameraFile {
    read_rig(&names.iter().map(|n| example(n)).collect::<Vec<_>>()).unwrap()
}

#[track_caller]
pub fn between(rig: &CameraFile, b: &str, a: &str) -> Pose {
    chained(rig.cameras.iter().filter_map(|c| c.placement.as_ref()).chain(&rig.relations), b, a)
}

#[track_caller]
fn assert_close(a: &Point, b: [f64; 3]) {
    // Sums of a few products of numbers below 10.
    assert!((a - Point::from(b)).norm() < 1e-14, "{a} is not {b:?}");
}

/// Points all over the image of a camera, in its frame, with their pixels.
fn seen_points(camera: &Camera) -> Vec<(Point, Pixel)> {
    let camera =
        if camera.size.is_some() { camera.clone() } else { check_image_size(camera, 640, 480).unwrap() };
    let size = camera.size.unwrap();
    let (w, h) = (f64::from(size.width_px), f64::from(size.height_px));
    let places = [(0.1, 0.15), (0.5, 0.2), (0.85, 0.1), (0.2, 0.5), (0.55, 0.45), (0.9, 0.6), (0.15, 0.9)];
    let point = |(i, (u, v)): (usize, &(f64, f64))| {
        let bearing = camera.bearing(&Pixel::new(u * w, v * h)).unwrap().into_inner();
        let x = bearing * (1.0 + 0.3 * i as f64);
        (x, camera.project(&x).unwrap())
    };
    places.iter().enumerate().map(point).collect()
}

/// The same lens, and the same poses between all cameras, by name or, where a format gives its own names, in order.
#[track_caller]
fn assert_same_rig(read: &CameraFile, written: &CameraFile) {
    assert_eq!(read.cameras.len(), written.cameras.len());
    let by_name = |w: &NamedCamera| read.cameras.iter().find(|c| c.name == w.name);
    let partner = |i: usize| by_name(&written.cameras[i]).unwrap_or(&read.cameras[i]);
    for (i, w) in written.cameras.iter().enumerate() {
        let r = partner(i);
        for (x, pixel) in seen_points(&w.camera) {
            assert!((r.camera.project(&x).unwrap() - pixel).norm() < 1e-9, "{}", w.name);
        }
        let ours = between(written, &w.name, &written.cameras[0].name);
        let theirs = between(read, &r.name, &partner(0).name);
        // Quaternions and three angles keep a rotation to a few rounding errors.
        assert!(ours.angle_to_rad(&theirs) < 1e-14, "{}", w.name);
        assert!((ours.translation - theirs.translation).norm() < 1e-14, "{}", w.name);
    }
}

/// Without their poses: what a file of poses is joined to.
fn lenses_of(rig: &CameraFile) -> CameraFile {
    let bare = |c: &NamedCamera| NamedCamera { placement: None, ..c.clone() };
    CameraFile { cameras: rig.cameras.iter().map(bare).collect(), relations: vec![], ..rig.clone() }
}

fn temporary(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("resight-files-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn formats_with_lenses_round_trip() {
    for (source, format, folder) in [
        ("placed_wide.toml", Format::Euroc, "euroc"),
        ("placed_wide.toml", Format::Basalt, "basalt"),
        ("placed_wide.toml", Format::Kalibr, "kalibr"),
        ("kalibr_imucam.yaml", Format::Kalibr, "kalibr_imu"),
        ("opencv_stereo.yml", Format::OpenCv, "opencv_yaml"),
        ("opencv_stereo.yml", Format::OpenCvXml, "opencv_xml"),
        ("kitti_object.txt", Format::Kitti, "kitti"),
        ("kitti_object.txt", Format::KittiOdometry, "kitti_odometry"),
        ("nuscenes", Format::NuScenes, "nuscenes"),
        ("placed_rig.toml", Format::Own, "own"),
        ("kalibr_imucam.yaml", Format::NerfTransforms, "transforms"),
    ] {
        let rig = rig_of(&[source]);
        assert_golden(folder, &write_rig(&rig, format).unwrap());
        assert_same_rig(&read_rig(&[golden(folder)]).unwrap(), &rig);
    }
}

#[test]
fn formats_of_poses_alone_round_trip() {
    let rig = rig_of(&["placed_rig.toml"]);
    let lenses = temporary("lenses").join("lenses.toml");
    std::fs::write(&lenses, &write_rig(&lenses_of(&rig), Format::Own).unwrap()[0].text).unwrap();
    for (format, folder) in [
        (Format::StaticTransforms, "tf_launch"),
        (Format::StaticTransformsYaml, "tf_yaml"),
        (Format::Urdf, "urdf"),
    ] {
        assert_golden(folder, &write_rig(&rig, format).unwrap());
        let back = read_rig(&[lenses.clone(), golden(folder)]).unwrap();
        assert_same_rig(&back, &rig);
        let world_from_left = between(&back, "world", "left");
        assert!((world_from_left.translation - between(&rig, "world", "left").translation).norm() < 1e-14);
    }
    std::fs::remove_dir_all(lenses.parent().unwrap()).unwrap();
}

/// What the judges project: camera, point in the frame named, our pixel.
#[test]
fn pixels_for_the_judges() {
    let mut text = String::from("rig,camera,x_m,y_m,z_m,u_px,v_px\n");
    for (source, frame) in [
        ("opencv_stereo.yml", "M1"),
        ("kitti_object.txt", "rect"),
        ("nuscenes", "ego"),
        ("kitti_unrectified/calib_cam_to_cam.txt#cam1_unrectified", "cam0_unrectified"),
        ("argoverse1", "egovehicle"),
        ("argoverse2", "egovehicle"),
        ("robotcar", "vehicle"),
        ("matlab_camera.json", "matlab_camera"),
        ("matlab_stereo.yaml", "camera1"),
        ("gyroflow.json", "gyroflow"),
        ("lensfun.xml", ""),
    ] {
        let rig = rig_of(&[source]);
        for c in &rig.cameras {
            for (x_in_cam, pixel) in seen_points(&c.camera) {
                // Cameras without poses are projected each in its own frame.
                let frame = if frame.is_empty() { &c.name } else { frame };
                let x = between(&rig, frame, &c.name) * x_in_cam;
                text += &format!(
                    "{source},{},{:?},{:?},{:?},{:?},{:?}\n",
                    c.name, x.x, x.y, x.z, pixel.x, pixel.y
                );
            }
        }
    }
    assert_golden("pixels_files", &[OutFile { name: "pixels.csv".into(), text }]);
}

/// A launch file, a script and a list place the cameras of the cart at (0.1, ±0.06, 1.2), looking along x, upright.
#[test]
fn static_transforms_place_optical_frames() {
    for name in ["static_transforms.launch.py", "static_transforms.sh", "static_transforms.yaml"] {
        let rig = rig_of(&["own_pinhole.toml", name]);
        for (frame, y) in [("left_optical_frame", 0.06), ("right_optical_frame", -0.06)] {
            let base_from_cam = between(&rig, "base_link", frame);
            assert_close(&base_from_cam.translation, [0.1, y, 1.2]);
            assert_close(&(base_from_cam.rotation * Point::z()), [1.0, 0.0, 0.0]);
            assert_close(&(base_from_cam.rotation * Point::x()), [0.0, -1.0, 0.0]);
        }
    }
}

/// The ROS 1 positional order is yaw, pitch, roll: column 0 of R_z(0.3) R_y(0.2) R_x(0.1) holds no roll.
#[test]
fn positional_angles_are_yaw_pitch_roll() {
    let rig = rig_of(&["own_pinhole.toml", "static_transforms.launch"]);
    let base_from_left = between(&rig, "base_link", "left_optical_frame");
    let (yaw, pitch, roll): (f64, f64, f64) = (0.3, 0.2, 0.1);
    let x = [yaw.cos() * pitch.cos(), yaw.sin() * pitch.cos(), -pitch.sin()];
    assert_close(&(base_from_left.rotation * Point::x()), x);
    assert!((base_from_left.rotation[(2, 1)] - pitch.cos() * roll.sin()).abs() < 1e-15);
    // 0.6 i, 0.8: a rotation about z by 2 atan(0.75); the leading slash is not part of the name.
    let map_from_base = between(&rig, "map", "base_link");
    assert_close(&(map_from_base * Point::new(1.0, 0.0, 0.0)), [0.28, 0.96, 1.0]);
}

/// The mast is rotated by rpy = (0.05, 0.1, 0.2): its x and y axes by the columns of R_z R_y R_x, written out. The cameras
/// hang 0.06 m to either side of it and look along its x.
#[test]
fn urdf_chains_joints() {
    let rig = rig_of(&["own_pinhole.toml", "robot.urdf"]);
    let base_from_left = between(&rig, "base_link", "left_optical_frame");
    let ((sr, cr), (sp, cp), (sy, cy)) = (0.05_f64.sin_cos(), 0.1_f64.sin_cos(), 0.2_f64.sin_cos());
    let y = [cy * sp * sr - sy * cr, sy * sp * sr + cy * cr, cp * sr];
    assert_close(&base_from_left.translation, [0.1 + 0.06 * y[0], 0.06 * y[1], 1.2 + 0.06 * y[2]]);
    assert_close(&(base_from_left.rotation * Point::z()), [cy * cp, sy * cp, -sp]);
    let left_from_right = between(&rig, "left_optical_frame", "right_optical_frame");
    assert_close(&left_from_right.translation, [0.12, 0.0, 0.0]);
    assert!(rig.warnings.iter().any(|w| w.contains("joint wheel is continuous")), "{:?}", rig.warnings);
}

/// P2: t = K⁻¹ p₄ = ((45 − 600·0.005)/700, (−0.34 − 180·0.005)/700, 0.005). A point 10 m ahead of the scanner is seen near
/// the middle of the image, further down by the 0.6, 0.8 of R0_rect.
#[test]
fn kitti_baselines_and_scanner() {
    let rig = rig_of(&["kitti_object.txt"]);
    let cam2 = rig.cameras.iter().find(|c| c.name == "cam2").unwrap();
    assert_close(
        &cam2.placement.as_ref().unwrap().b_from_a.translation,
        [42.0 / 700.0, -1.24 / 700.0, 0.005],
    );
    assert_close(&between(&rig, "cam0", "cam1").translation, [378.0 / 700.0, 0.0, 0.0]);
    let x_in_cam0 = between(&rig, "cam0", "velo") * Point::new(10.0, 0.0, 0.0);
    let (y, z) = (-0.076, 10.0 - 0.271);
    assert_close(&x_in_cam0, [-0.004, 0.8 * y - 0.6 * z, 0.6 * y + 0.8 * z]);
    assert_close(&between(&rig, "velo", "imu").translation, [-0.808, 0.319, -0.799]);
    // Odometry: Tr is rectified already.
    let odometry = rig_of(&["kitti_odometry.txt"]);
    let x = between(&odometry, "cam1", "velo") * Point::new(10.0, 0.0, 0.0);
    assert_close(&x, [-0.01 - 0.54, -0.06, 10.0 - 0.29]);
}

#[test]
fn kitti_raw_is_three_files_and_has_a_size() {
    let rig = rig_of(&["kitti_raw"]);
    assert_eq!(rig.cameras.len(), 2);
    assert_eq!(rig.cameras[1].camera.size.map(|s| (s.width_px, s.height_px)), Some((1242, 375)));
    let x_in_cam0 = between(&rig, "cam0", "velo") * Point::new(10.0, 0.0, 0.0);
    let (y, z) = (-0.076, 10.0 - 0.27);
    assert_close(&x_in_cam0, [-0.004, 0.8 * y - 0.6 * z, 0.6 * y + 0.8 * z]);
    assert_close(&between(&rig, "velo", "imu").translation, [-0.8, 0.32, -0.8]);
}

/// w first: (0.5, −0.5, 0.5, −0.5) turns z forward into the vehicle's x. The scanner turns by −2 atan(0.75) about z.
#[test]
fn nuscenes_names_come_from_the_sensor_table() {
    let rig = rig_of(&["nuscenes"]);
    let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["CAM_FRONT", "CAM_BACK"]);
    let ego_from_front = between(&rig, "ego", "CAM_FRONT");
    assert_close(&(ego_from_front * Point::new(0.0, 0.0, 2.0)), [3.7, 0.0, 1.5]);
    assert_close(&(between(&rig, "ego", "CAM_BACK") * Point::new(0.0, 0.0, 2.0)), [-2.0, 0.0, 1.6]);
    assert_close(&(between(&rig, "ego", "LIDAR_TOP") * Point::new(1.0, 0.0, 0.0)), [0.9 + 0.28, -0.96, 1.8]);
    let alone = read_cameras(example("nuscenes/calibrated_sensor.json")).unwrap();
    assert_eq!(alone.cameras[0].name, "47fcd48f71d75e0da5c8c1704a9bfe0a");
}

#[test]
fn a_tree_of_sensor_files_is_one_rig() {
    let rig = rig_of(&["euroc_tree"]);
    let names: Vec<&str> = rig.cameras.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["cam0", "cam1"]);
    assert_close(&between(&rig, "body", "cam1").translation, [-0.02, 0.05, 0.01]);
    assert_eq!((rig.relations[0].b.as_str(), rig.relations[0].a.as_str()), ("body", "imu0"));
}

/// Intrinsics of two files, poses of a third: the frames are the cameras' optical ones.
#[test]
fn poses_join_lenses_by_name() {
    let folder = temporary("join");
    let lens = std::fs::read_to_string(example("ros_plumb_bob.yaml")).unwrap();
    let name = lens.lines().find(|l| l.starts_with("camera_name")).unwrap().to_owned();
    for camera in ["left", "right"] {
        let text = lens.replace(&name, &format!("camera_name: {camera}"));
        std::fs::write(folder.join(format!("{camera}.yaml")), text).unwrap();
    }
    let paths = [folder.join("left.yaml"), folder.join("right.yaml"), example("robot.urdf")];
    let rig = read_rig(&paths).unwrap();
    assert_eq!(rig.format, Format::RosCameraInfo);
    let left = rig.cameras[0].placement.as_ref().unwrap();
    assert_eq!((left.b.as_str(), left.a.as_str()), ("mast", "left"));
    assert_close(&between(&rig, "left", "right").translation, [0.12, 0.0, 0.0]);

    // A second file that says the same is silent, one that contradicts is named, and the first holds.
    let mut both = paths.to_vec();
    both.push(example("static_transforms.sh"));
    let rig = read_rig(&both).unwrap();
    let said = rig.warnings.iter().filter(|w| w.contains("two files place")).collect::<Vec<_>>();
    assert_eq!(said.len(), 2, "{said:?}");
    assert!(said[0].contains("12.0 mm and 13.00° apart"), "{said:?}");
    assert_eq!(rig.cameras[0].placement.as_ref().unwrap().b, "mast");

    let refused = |paths: &[PathBuf], words: &str| {
        let reason = read_rig(paths).unwrap_err().to_string();
        assert!(reason.contains(words), "{reason}");
    };
    refused(&[paths[0].clone(), paths[0].clone()], "camera `left` is in an earlier file too");
    refused(&[paths[2].clone()], "poses only, no intrinsics");
    refused(&[folder.join("left.yaml#right")], "no camera `right`; there are left");
    refused(&[folder.join("absent")], "no such file");
    std::fs::remove_dir_all(&folder).unwrap();
}

#[test]
fn one_camera_of_a_chain_keeps_its_place() {
    let rig =
        read_rig(&[PathBuf::from(format!("{}#cam1", example("kalibr_imucam.yaml").display()))]).unwrap();
    assert_eq!(rig.cameras.len(), 1);
    assert_close(&between(&rig, "cam1", "imu").translation, [-0.09, 0.02, 0.03]);
}

#[track_caller]
fn assert_refused(name: &str, from: &str, to: &str, words: &[&str]) {
    let text = std::fs::read_to_string(example(name)).unwrap();
    assert!(text.contains(from), "{from}");
    let changed = text.replacen(from, to, 1);
    let path = Path::new(name).file_name().unwrap();
    let folder = temporary("refused").join(path);
    std::fs::write(&folder, changed).unwrap();
    let reason = read_rig(&[example("own_pinhole.toml"), folder]).unwrap_err().to_string();
    for word in words {
        assert!(reason.contains(word), "`{word}` is not in: {reason}");
    }
}

#[test]
fn unclear_transforms_are_refused_at_their_line() {
    let py = "static_transforms.launch.py";
    assert_refused(
        py,
        "'--qw', '0.5'",
        "'--yaw', '0.5'",
        &[".py:10:", "both a quaternion and roll, pitch, yaw"],
    );
    assert_refused(py, ", '--qw', '0.5'", "", &["belong together"]);
    assert_refused(py, "'--x', '0.1'", "'--x', x_m", &[".py:13:", "`x_m` in its arguments is an expression"]);
    assert_refused(py, "\"0.1\", \"-0.06\"", "\"-0.06\"", &["5 numbers before the frame names; 6", "or 7"]);
    assert_refused(py, "'--qw', '0.5'", "'--qw', '0.9'", &["length 1.2"]);
    assert_refused(py, "'--z', '1.2'", "'--zed', '1.2'", &["`--zed` is no flag"]);
    let xml = "static_transforms.launch";
    assert_refused(
        xml,
        "0.1 0.06 1.2 0.3",
        "$(arg x) 0.06 1.2 0.3",
        &["launch:5:", "args hold a substitution"],
    );
    let yaml = "static_transforms.yaml";
    let mapping = "rotation: {roll: -1.5707963267948966, pitch: 0.0, yaw: -1.5707963267948966}";
    assert_refused(yaml, mapping, "rotation: [0, 0, 0, 1]", &["quaternion of unclear order"]);
    let urdf = "robot.urdf";
    assert_refused(urdf, "xyz=\"0.1 0 1.2\"", "xyz=\"${x} 0 1.2\"", &["urdf:8:", "xacro expression"]);
    assert_refused(urdf, "xyz=\"0.1 0 1.2\"", "xyz=\"0.1 0\"", &["three finite numbers"]);
    assert_refused(urdf, "<parent link=\"base_link\"/>", "", &["joint mast_joint", "<parent link"]);
}

#[test]
fn tables_that_cannot_be_right_are_refused() {
    let kitti = "kitti_object.txt";
    assert_refused(kitti, "P1: 7.000000000000e+02 ", "P1: ", &["txt:2: P1", "11 numbers; 12"]);
    assert_refused(
        kitti,
        "P1: 7.000000000000e+02 0.0",
        "P1: 7.000000000000e+02 1.0",
        &["rectified projection"],
    );
    assert_refused(kitti, "R0_rect: 1.0", "R0_rect: 1.1", &["txt:5: R0_rect", "not a rotation"]);
    assert_refused(kitti, "P2: 7.0", "P2: nan 7.0", &["`nan` is not a finite number"]);
    let nuscenes = "nuscenes/calibrated_sensor.json";
    assert_refused(nuscenes, "[0.5, -0.5, 0.5, -0.5]", "[0.5, -0.5, 0.5]", &["rotation", "3 numbers; 4"]);
    assert_refused(nuscenes, "[0.5, -0.5, 0.5, -0.5]", "[0.5, -0.5, 0.5, -0.9]", &["length 1.2"]);
    assert_refused(nuscenes, "[0.0, 0.0, 1.0]]", "[0.0, 0.0]]", &["camera_intrinsic"]);
    assert_refused("nuscenes/sensor.json", "\"camera\"", "\"camera\"", &["names sensors only"]);
}

#[test]
fn what_a_format_cannot_hold_is_refused_by_name() {
    let refused = |source: &str, format: Format, words: &[&str]| {
        let reason = write_rig(&rig_of(&[source]), format).unwrap_err().to_string();
        for word in words {
            assert!(reason.contains(word), "`{word}` is not in: {reason}");
        }
    };
    refused("placed_rig.toml", Format::Kitti, &["left: has distortion", "rectify"]);
    let mut flat = rig_of(&["placed_rig.toml"]);
    let lens = flat.cameras[1].camera.clone();
    flat.cameras.iter_mut().for_each(|c| c.camera = lens.clone());
    let reason = write_rig(&flat, Format::Kitti).unwrap_err().to_string();
    assert!(reason.contains("right: rotated by 16.3792°") && reason.contains("against `left`"), "{reason}");
    refused("placed_rig.toml", Format::NuScenes, &["left: has distortion", "undistort"]);
    refused("placed_rig.toml", Format::Kalibr, &["left: Kalibr's radtan has k1, k2, p1, p2 only"]);
    refused("placed_rig.toml", Format::OpenCvXml, &["one or two cameras, not 3"]);
    refused("basalt.json", Format::NerfTransforms, &["transforms.json has no", "write resight"]);
    refused("camodocal_mei.yaml", Format::NerfTransforms, &["transforms.json has no omni model"]);
    refused("kalibr_camchain.yaml", Format::Urdf, &["no pose joins camera `cam2` to `cam0`"]);
    refused("kalibr_camchain.yaml", Format::Basalt, &["no pose joins"]);
    refused("kalibr_imucam.yaml", Format::Basalt, &["one clock offset for all cameras", "[1.0, 0.0] ms"]);
    refused("own_pinhole.toml", Format::StaticTransforms, &["no pose between any two frames"]);
    let mut rig = rig_of(&["placed_rig.toml"]);
    rig.cameras[1].name = "a b".into();
    rig.cameras[1].placement.as_mut().unwrap().b = "a b".into();
    let reason = write_rig(&rig, Format::Urdf).unwrap_err().to_string();
    assert!(reason.contains("`a b_optical_frame`: ROS frames take letters"), "{reason}");
}

/// One offset in whole nanoseconds for all cameras.
#[test]
fn basalt_keeps_a_clock_that_all_cameras_share() {
    let mut rig = rig_of(&["kalibr_imucam.yaml"]);
    let mut second = rig.clocks[0].clone();
    second.camera = "cam1".into();
    rig.clocks.push(second);
    let text = write_rig(&rig, Format::Basalt).unwrap()[0].text.clone();
    assert!(text.contains("\"cam_time_offset_ns\": 1000000"), "{text}");
    let back = read_cameras_from_bytes(Path::new("x"), text.into_bytes()).unwrap();
    assert_eq!(back.clocks, rig.clocks);
}
