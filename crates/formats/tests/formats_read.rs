//! Every format, read from a small hand-made file: the numbers, the names, and which way the poses go.

use crate::support::example;
use resight_formats::core::camera::ImageSize;
use resight_formats::core::{Camera, Lens, Pixel, Point, Pose, Target};
use resight_formats::{Format, NamedCamera, read_camera, read_cameras, read_target};

fn cameras(name: &str, format: Format) -> Vec<NamedCamera> {
    let file = read_cameras(example(name)).unwrap();
    assert_eq!(file.format, format, "{name}");
    file.cameras
}

fn one(name: &str, format: Format) -> NamedCamera {
    let mut all = cameras(name, format);
    assert_eq!(all.len(), 1, "{name}");
    all.remove(0)
}

fn values(camera: &Camera) -> Vec<f64> {
    camera.parameters().iter().map(|(_, x)| *x).collect()
}

#[track_caller]
fn assert_camera(camera: &Camera, model: &str, size: Option<(u32, u32)>, expected: &[f64]) {
    assert_eq!(camera.model_name(), model);
    assert_eq!(camera.size, size.map(|(width_px, height_px)| ImageSize { width_px, height_px }));
    assert_eq!(values(camera), expected);
}

/// `b_from_a` maps the point `x_in_a` to `x_in_b`: a wrong direction or a transposed rotation cannot pass.
#[track_caller]
fn assert_maps(camera: &NamedCamera, b: &str, a: &str, x_in_a: [f64; 3], x_in_b: [f64; 3]) {
    let placement = camera.placement.as_ref().unwrap();
    assert_eq!((placement.b.as_str(), placement.a.as_str()), (b, a));
    let mapped = placement.b_from_a * Point::from(x_in_a);
    assert!((mapped - Point::from(x_in_b)).norm() < 1e-12, "{mapped}");
}

const BROWN: [f64; 9] = [535.4, 535.9, 341.8, 234.2, -0.2, 0.1, 0.001, -0.0005, 0.0];

#[test]
fn own_files() {
    let pinhole = one("own_pinhole.toml", Format::Own);
    assert_eq!(pinhole.name, "own_pinhole");
    assert_camera(&pinhole.camera, "pinhole", Some((640, 480)), &[535.4, 535.9, 341.8, 234.2]);
    let seed = one("own_photogrammetric.toml", Format::Own);
    assert_camera(
        &seed.camera,
        "photogrammetric",
        None,
        &[3.54144878, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0],
    );
    let rig = cameras("own_rig.toml", Format::Own);
    assert_camera(&rig[0].camera, "brown_conrady", Some((640, 480)), &BROWN);
    let models: Vec<&str> = rig.iter().map(|c| c.camera.model_name()).collect();
    assert_eq!(models, ["brown_conrady", "kannala_brandt", "omni", "double_sphere", "eucm", "fov"]);
    // A quarter and a bit of a degree about y: z of `left` leans to +x of `right`.
    let pose = rig[1].placement.as_ref().unwrap().b_from_a;
    let y_turn = 2.0 * 0.01999866669333308f64.asin();
    let expected = Point::new(y_turn.sin() - 0.12, 0.001, y_turn.cos() + 0.002);
    assert!((pose * Point::new(0.0, 0.0, 1.0) - expected).norm() < 1e-12);
}

#[test]
fn opencv_in_all_its_syntaxes() {
    for name in ["opencv_single.yml", "opencv_single.json"] {
        let camera = one(name, Format::OpenCv);
        assert_eq!(camera.name, "opencv_single");
        assert_camera(&camera.camera, "brown_conrady", Some((640, 480)), &BROWN);
    }
    let fisheye = one("opencv_fisheye.xml", Format::OpenCv);
    let expected = [285.5, 285.75, 320.25, 240.5, -7.5e-3, 4.5e-2, -4.0e-2, 7.0e-3];
    assert_camera(&fisheye.camera, "kannala_brandt", Some((640, 480)), &expected);
}

/// x_2 = R x_1 + T, so a second camera to the right has T = (−B, 0, 0).
#[test]
fn opencv_stereo_places_the_second_camera() {
    let pair = cameras("opencv_stereo.yml", Format::OpenCv);
    assert_eq!((pair[0].name.as_str(), pair[1].name.as_str()), ("M1", "M2"));
    let rational = [534.0, 534.25, 341.5, 235.0, -0.28, 0.025, 1.2e-3, -1.4e-4, 0.0, 0.0, 0.0, 0.15];
    assert_camera(&pair[0].camera, "brown_conrady", None, &rational);
    assert!(pair[0].placement.is_none());
    assert_maps(&pair[1], "M2", "M1", [0.0, 0.0, 1.0], [-0.6 - 0.094, 0.0, 0.8]);
    let picked = read_camera(format!("{}#M2", example("opencv_stereo.yml").display())).unwrap();
    assert_eq!(picked, pair[1]);
}

#[test]
fn ros_saved_and_echoed() {
    let saved = one("ros_plumb_bob.yaml", Format::RosCameraInfo);
    assert_eq!(saved.name, "narrow_stereo/left");
    let expected = [430.5, 430.4, 306.9, 227.2, -0.3375, 0.1115, -0.0007, -0.0001, 0.0];
    assert_camera(&saved.camera, "brown_conrady", Some((640, 480)), &expected);
    assert!(saved.placement.is_none(), "R of camera_info is no pose");
    let echoed = one("ros_topic_echo.yaml", Format::RosCameraInfo);
    let expected = [605.5, 605.25, 320.5, 242.0, 0.5, -2.5, 0.0005, -0.0002, 1.5, 0.4, -2.4, 1.4];
    assert_camera(&echoed.camera, "brown_conrady", Some((640, 480)), &expected);
}

#[test]
fn kalibr_models_and_chain() {
    let chain = cameras("kalibr_camchain.yaml", Format::Kalibr);
    let radtan = [542.1, 541.4, 512.4, 373.6, -0.3, 0.08, 0.0016, 0.0004];
    assert_camera(&chain[0].camera, "brown_conrady", Some((1024, 768)), &radtan);
    let equidistant = [461.6, 460.2, 362.6, 246.0, -0.01, 0.02, -0.03, 0.01];
    assert_camera(&chain[1].camera, "kannala_brandt", Some((752, 480)), &equidistant);
    assert_maps(&chain[1], "cam1", "cam0", [1.0, 2.0, 3.0], [0.8 + 1.8 - 0.12, 2.01, -0.6 + 2.4 + 0.02]);
    let Lens::Omni(omni) = &chain[2].camera.lens else { panic!() };
    assert_eq!((omni.xi(), omni.distortion()), (0.9, [-0.1, 0.02, 0.0001, 0.0002]));
    let Lens::Eucm(eucm) = &chain[3].camera.lens else { panic!() };
    assert_eq!((eucm.alpha(), eucm.beta(), eucm.matrix().fx_px), (0.59, 1.12, 460.7));
    let Lens::DoubleSphere(ds) = &chain[4].camera.lens else { panic!() };
    assert_eq!((ds.xi(), ds.alpha(), ds.matrix().cy_px), (-0.24, 0.57, 249.3));
    let Lens::Fov(fov) = &chain[5].camera.lens else { panic!() };
    assert_eq!((fov.w_rad(), fov.matrix().fy_px), (0.93, 251.0));
}

/// What only the report holds: a standard deviation for every parameter, wherever numpy broke the line.
#[test]
fn kalibr_report_keeps_its_standard_deviations() {
    let all = cameras("kalibr_results_cam.txt", Format::KalibrReport);
    let sigmas = |i: usize| -> Vec<f64> {
        let covariance = all[i].intrinsics_covariance.as_ref().expect("stated");
        assert_eq!(covariance.sum(), covariance.trace(), "no correlations");
        covariance.diagonal().iter().map(|variance| variance.sqrt()).collect()
    };
    let close = |found: Vec<f64>, expected: &[f64]| {
        assert_eq!(found.len(), expected.len());
        assert!(found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{found:?}");
    };
    let radtan = [
        458.71532104,
        457.30128847,
        367.20814422,
        248.37219931,
        -0.28410231,
        0.07563082,
        0.00019327,
        -0.00002571,
    ];
    assert_camera(&all[0].camera, "brown_conrady", None, &radtan);
    close(
        sigmas(0),
        &[0.15120844, 0.14963018, 0.21877342, 0.19045513, 0.00061204, 0.00049377, 0.00006412, 0.00005198],
    );
    // Kalibr's omni has xi before its focal lengths.
    let Lens::Omni(omni) = &all[1].camera.lens else { panic!("{:?}", all[1].camera) };
    assert_eq!((omni.xi(), omni.matrix().cy_px), (1.87112032, 251.77430812));
    let by_name: Vec<(&str, f64)> =
        all[1].camera.parameters().iter().zip(sigmas(1)).map(|((name, _), sigma)| (*name, sigma)).collect();
    let of = |name: &str| by_name.iter().find(|(known, _)| *known == name).map(|(_, sigma)| *sigma).unwrap();
    for (name, sigma) in
        [("fx_px", 3.10422871), ("cy_px", 0.28811904), ("xi", 0.00711093), ("k1", 0.00215033)]
    {
        assert!((of(name) - sigma).abs() < 1e-12, "{name}: {by_name:?}");
    }
    assert!(all.iter().all(|camera| camera.placement.is_none()));

    let text = std::fs::read_to_string(example("kalibr_results_cam.txt")).unwrap();
    let refused = |from: &str, to: &str, reason: &str| {
        let bytes = text.replace(from, to).into_bytes();
        let fault =
            resight_formats::read_cameras_from_bytes(example("x.txt"), bytes).unwrap_err().to_string();
        assert!(fault.contains(reason), "{fault}");
    };
    refused(" +- [0.15120844 ", " +- [", "4 numbers and 3 standard deviations");
    refused("+- [0.15120844", "+- [-0.15120844", "is not negative");
    refused("+- [0.15120844", "+- [nan", "[standard deviations]");
    refused("DistortedOmniCamera", "DistortedToyCamera", "DistortedToyCameraGeometry");
}

/// Nothing is wrong with the poses; the two cameras have the same numbers.
#[track_caller]
fn assert_only_one_lens(warnings: &[String]) {
    assert!(matches!(warnings, [one] if one.contains("cam0 and cam1 have one lens")), "{warnings:?}");
}

#[test]
fn kalibr_imu_pose_and_a_key_that_lies() {
    let file = read_cameras(example("kalibr_imucam.yaml")).unwrap();
    assert_maps(&file.cameras[0], "cam0", "imu", [1.0, 0.0, 0.0], [0.01, -0.98, 0.03]);
    assert_maps(&file.cameras[1], "cam1", "cam0", [0.0, 0.0, 0.0], [-0.1, 0.0, 0.0]);
    assert_only_one_lens(&file.warnings);
    // The same numbers as OpenVINS holds them (imu_from_cam), the key left as it was.
    let text = std::fs::read_to_string(example("kalibr_imucam.yaml")).unwrap();
    let inverse = |x: f64, y: f64| {
        format!("  - [0.0, -1.0, 0.0, {y}]\n  - [1.0, 0.0, 0.0, {x}]\n  - [0.0, 0.0, 1.0, -0.03]\n")
    };
    let lying = text
        .replace(
            "  - [0.0, 1.0, 0.0, 0.01]\n  - [-1.0, 0.0, 0.0, 0.02]\n  - [0.0, 0.0, 1.0, 0.03]\n",
            &inverse(-0.01, 0.02),
        )
        .replace(
            "  - [0.0, 1.0, 0.0, -0.09]\n  - [-1.0, 0.0, 0.0, 0.02]\n  - [0.0, 0.0, 1.0, 0.03]\n",
            &inverse(0.09, 0.02),
        );
    let file =
        resight_formats::read_cameras_from_bytes(example("x.yaml"), lying.clone().into_bytes()).unwrap();
    assert!(file.warnings.iter().any(|w| w.contains("T_imu_cam")), "{:?}", file.warnings);
    // Under its right name the file is consistent again.
    let honest = lying.replace("T_cam_imu", "T_imu_cam");
    let file = resight_formats::read_cameras_from_bytes(example("x.yaml"), honest.into_bytes()).unwrap();
    assert_only_one_lens(&file.warnings);
    assert_maps(&file.cameras[0], "cam0", "imu", [1.0, 0.0, 0.0], [0.01, -0.98, 0.03]);
}

#[test]
fn euroc_maps_sensor_to_body() {
    let camera = one("cam7/sensor.yaml", Format::Euroc);
    assert_eq!(camera.name, "cam7");
    let expected = [458.6, 457.3, 367.2, 248.4, -0.28, 0.07, 0.0002, 1.8e-5];
    assert_camera(&camera.camera, "brown_conrady", Some((752, 480)), &expected);
    assert_maps(&camera, "body", "cam7", [1.0, 0.0, 0.0], [-0.02, 0.94, 0.01]);
}

/// COLMAP's principal point of an image's exact middle is (w/2, h/2), ours (w/2 − ½, h/2 − ½).
#[test]
fn colmap_loses_half_a_pixel() {
    let all = cameras("cameras.txt", Format::Colmap);
    let names: Vec<&str> = all.iter().map(|c| c.name.as_str()).collect();
    assert_eq!(names, ["1", "2", "3", "4", "5", "6"]);
    assert_camera(
        &all[0].camera,
        "brown_conrady",
        Some((640, 480)),
        &[535.5, 535.5, 320.0, 240.0, -0.05, 0.0, 0.0, 0.0],
    );
    assert_camera(&all[1].camera, "pinhole", Some((3072, 2304)), &[2560.5, 2560.25, 1536.0, 1152.0]);
    let opencv = [535.4, 535.9, 341.8, 234.2, -0.2, 0.1, 0.001, -0.0005];
    assert!(values(&all[2].camera).iter().zip(opencv).all(|(a, b)| (a - b).abs() < 1e-12));
    assert_eq!(values(&all[3].camera)[4..], [-0.2, 0.1, 0.001, -0.0005, 0.02, 0.01, 0.003, 0.001]);
    assert_eq!(all[4].camera.model_name(), "kannala_brandt");
    assert_eq!(all[5].camera.model_name(), "fov");
}

#[test]
fn mrcal_model_and_reference_pose() {
    let camera = one("left.cameramodel", Format::Mrcal);
    assert_eq!(camera.name, "left");
    let expected = [462.7, 462.4, 327.0, 179.3, 0.08, -0.05, 0.0004, -0.0012, -0.25];
    assert_camera(&camera.camera, "brown_conrady", Some((640, 360)), &expected);
    // 30° about y takes z to (½, 0, √¾).
    assert_maps(&camera, "left", "reference", [0.0, 0.0, 1.0], [0.5 - 0.1, 0.02, 0.75f64.sqrt() + 0.3]);
}

#[test]
fn photonvision_both_shapes() {
    let old = one("photonvision_old.json", Format::PhotonVision);
    let expected = [1011.4, 1008.5, 645.5, 408.3, 0.137, -0.29, 0.0008, -0.0004, 0.095];
    assert_camera(&old.camera, "brown_conrady", Some((1280, 720)), &expected);
    let new = one("photonvision_new.json", Format::PhotonVision);
    let expected = [1011.4, 1008.5, 645.5, 408.3, 0.13, -0.29, 0.0008, -0.0004, 0.09, 0.01, 0.02, 0.003];
    assert_camera(&new.camera, "brown_conrady", Some((1280, 720)), &expected);
}

#[test]
fn basalt_maps_camera_to_imu() {
    let all = cameras("basalt.json", Format::Basalt);
    let models: Vec<&str> = all.iter().map(|c| c.camera.model_name()).collect();
    assert_eq!(models, ["eucm", "double_sphere", "kannala_brandt", "brown_conrady"]);
    // qz = 0.6, qw = 0.8: x goes to (0.28, 0.96).
    assert_maps(&all[0], "imu", "cam0", [1.0, 0.0, 0.0], [0.28 - 0.0168, 0.96 - 0.0689, 0.0051]);
    assert_eq!(values(&all[3].camera)[4..], [-0.2, 0.1, 0.001, -0.0005, 0.02, 0.01, 0.003, 0.001]);
}

#[test]
fn caliscope_keeps_file_order_and_maps_world_to_camera() {
    let all = cameras("caliscope.toml", Format::Caliscope);
    assert_eq!((all[0].name.as_str(), all[1].name.as_str()), ("2", "10"));
    assert_maps(&all[0], "2", "world", [1.0, 0.0, 0.0], [-0.64, 1.26, 1.45]);
    assert_maps(&all[1], "10", "world", [1.0, 0.0, 0.0], [0.0, 1.0, 0.5]);
    assert_eq!(all[1].camera.model_name(), "kannala_brandt");
}

#[test]
fn own_targets_of_every_kind() {
    let kinds = ["line_plus_one", "tag", "aprilgrid", "chessboard", "charuco", "tag_map", "points"];
    for kind in kinds {
        let file = read_target(example(&format!("target_{kind}.toml"))).unwrap();
        assert_eq!((file.format, file.target.kind()), (Format::OwnTarget, kind));
        assert_eq!(file.warnings, Vec::<String>::new(), "{kind}");
    }
    let Target::Charuco(board) = read_target(example("target_charuco.toml")).unwrap().target else {
        panic!()
    };
    assert!(board.legacy_pattern && board.marker_m == 0.0405 && (board.rows, board.columns) == (5, 4));
    let Target::Points(points) = read_target(example("target_points.toml")).unwrap().target else { panic!() };
    assert_eq!((points[0].sigma_m, points[1].sigma_m, points[1].position.x), (0.02, 0.0, 3.0));
    let Target::TagMap(map) = read_target(example("target_tag_map.toml")).unwrap().target else { panic!() };
    assert_eq!(map.tags[0].world_from_tag.translation, Point::new(1.0, 2.0, 0.5));
}

#[test]
fn fourth_point_over_the_middle_is_warned_of() {
    let file = read_target(example("target_middle.toml")).unwrap();
    assert!(
        file.warnings[0].contains("over the middle") && file.warnings[0].contains("over an end"),
        "{:?}",
        file.warnings
    );
}

#[test]
fn kalibr_and_basalt_targets() {
    for name in ["kalibr_aprilgrid.yaml", "basalt_aprilgrid.json"] {
        let Target::AprilGrid(grid) = read_target(example(name)).unwrap().target else { panic!() };
        assert_eq!((grid.rows, grid.columns, grid.tag_size_m, grid.tag_spacing_ratio), (5, 6, 0.088, 0.3));
    }
    let Target::Chessboard(board) = read_target(example("kalibr_checkerboard.yaml")).unwrap().target else {
        panic!()
    };
    assert_eq!((board.rows, board.columns, board.square_m), (6, 9, 0.025));
    let Target::CircleGrid(grid) = read_target(example("kalibr_circlegrid.yaml")).unwrap().target else {
        panic!()
    };
    assert_eq!((grid.rows, grid.columns, grid.spacing_m, grid.asymmetric), (11, 4, 0.02, true));
}

/// Tag 1 of the layout faces +x of the field: a viewer beyond it, looking back along −x, sees it upright.
#[test]
fn wpilib_tags_turn_into_our_tag_frame() {
    for name in ["wpilib_2024.json", "wpilib_2027.json"] {
        let Target::TagMap(map) = read_target(example(name)).unwrap().target else { panic!() };
        assert_eq!((map.family.as_str(), map.tags.len(), map.tags[0].size_m), ("tag36h11", 2, 0.1651));
        let axis = |pose: &Pose, x: f64, y: f64, z: f64| pose.rotation * Point::new(x, y, z);
        let (facing_plus_x, facing_minus_x) = (&map.tags[0].world_from_tag, &map.tags[1].world_from_tag);
        // Into the surface is away from the viewer, down is −z; the viewer looks along −x, so his right is +y.
        assert!((axis(facing_plus_x, 0.0, 0.0, 1.0) - Point::new(-1.0, 0.0, 0.0)).norm() < 1e-12);
        assert!((axis(facing_plus_x, 0.0, 1.0, 0.0) - Point::new(0.0, 0.0, -1.0)).norm() < 1e-12);
        assert!((axis(facing_plus_x, 1.0, 0.0, 0.0) - Point::new(0.0, 1.0, 0.0)).norm() < 1e-12);
        assert!((axis(facing_minus_x, 1.0, 0.0, 0.0) - Point::new(0.0, -1.0, 0.0)).norm() < 1e-12);
        assert_eq!(facing_plus_x.translation, Point::new(15.0, 0.25, 1.36));
    }
}

#[test]
fn caliscope_board_in_metres() {
    let Target::Charuco(board) = read_target(example("caliscope_charuco.toml")).unwrap().target else {
        panic!()
    };
    assert!((board.square_m - 0.054).abs() < 1e-15 && (board.marker_m - 0.0405).abs() < 1e-15);
    assert_eq!((board.rows, board.columns, board.legacy_pattern), (5, 4, false));
}

/// A camera read for one size serves images of half of it: the same ray, a pixel that keeps its centre.
#[test]
fn image_size_scales_or_refuses() {
    let camera = one("opencv_single.yml", Format::OpenCv).camera;
    assert_eq!(resight_formats::check_image_size(&camera, 640, 480).unwrap(), camera);
    let half = resight_formats::check_image_size(&camera, 320, 240).unwrap();
    let (a, b) =
        (camera.bearing(&Pixel::new(100.5, 60.5)).unwrap(), half.bearing(&Pixel::new(50.0, 30.0)).unwrap());
    assert!(a.angle(&b) < 1e-12);
    let refusal = resight_formats::check_image_size(&camera, 640, 360).unwrap_err();
    assert!(refusal.contains("640×480") && refusal.contains("640×360"), "{refusal}");
}

/// OpenVINS writes OpenCV's header, no `---` after it, and the inverse of Kalibr's pose.
#[test]
fn openvins_chain_with_its_header() {
    let kalibr = std::fs::read_to_string(example("kalibr_imucam.yaml")).unwrap();
    let text = format!(
        "%YAML:1.0 # need to specify the file type at the top!\n\n{}",
        kalibr.replace("T_cam_imu", "T_imu_cam")
    );
    let file = resight_formats::read_cameras_from_bytes(example("x.yaml"), text.into_bytes()).unwrap();
    assert_eq!((file.format, file.cameras.len()), (Format::Kalibr, 2));
    // Rᵀ (x − t) of T_imu_cam.
    assert_maps(&file.cameras[0], "cam0", "imu", [0.01, 0.02, 0.03], [0.0, 0.0, 0.0]);
}
