//! What is written reads back the same, and says so in the same bytes every time.

use crate::support::{cameras, example};
use nalgebra::DMatrix;
use resight_formats::core::Matrix6;
use resight_formats::{
    CameraFile, Format, NamedCamera, OutFile, Placement, WriteError, convert, read_cameras,
    read_cameras_from_bytes, write_atomically, write_cameras, write_rig,
};
use std::path::Path;

/// The text of a format that takes one file.
fn only(cameras: &[NamedCamera], format: Format) -> String {
    let files = write_cameras(cameras, format).unwrap();
    let [OutFile { text, .. }] = files.as_slice() else { panic!("{} files", files.len()) };
    text.clone()
}

fn read_back(text: &str, format: Format, name: &str) -> Vec<NamedCamera> {
    let file = read_cameras_from_bytes(Path::new(name), text.as_bytes().to_vec()).unwrap();
    assert_eq!(file.format, format);
    file.cameras
}

/// Same name, lens and size to the last bit; poses to rounding of the quaternion.
#[track_caller]
fn assert_same(read: &[NamedCamera], written: &[NamedCamera]) {
    assert_eq!(read.len(), written.len());
    for (a, b) in read.iter().zip(written) {
        assert_eq!((&a.name, &a.camera), (&b.name, &b.camera));
        assert_eq!(a.placement.is_some(), b.placement.is_some());
        if let (Some(p), Some(q)) = (&a.placement, &b.placement) {
            assert_eq!((&p.b, &p.a), (&q.b, &q.a));
            assert!(p.b_from_a.angle_to_rad(&q.b_from_a) < 1e-14);
            assert!((p.b_from_a.translation - q.b_from_a.translation).norm() < 1e-15);
        }
    }
}

/// `golden_NAME` holds the expected bytes; set RESIGHT_BLESS to write it anew, then read the difference.
#[track_caller]
fn assert_golden(name: &str, text: &str) {
    let path = example("golden").join(name);
    if std::env::var_os("RESIGHT_BLESS").is_some() {
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(&path, text).unwrap();
    }
    let expected = std::fs::read_to_string(&path).unwrap_or_default();
    assert_eq!(text, expected, "{}", path.display());
}

#[test]
fn own_toml_round_trips_every_model_and_pose() {
    for name in [
        "own_rig.toml",
        "own_pinhole.toml",
        "own_photogrammetric.toml",
        "kalibr_camchain.yaml",
        "basalt.json",
        "left.cameramodel",
    ] {
        let written = cameras(name);
        let text = only(&written, Format::Own);
        assert_same(&read_back(&text, Format::Own, "x"), &written);
    }
    assert_golden("rig.toml", &only(&cameras("own_rig.toml"), Format::Own));
}

#[test]
fn opencv_round_trips() {
    let pair = cameras("opencv_stereo.yml");
    let text = only(&pair, Format::OpenCv);
    assert_same(&read_back(&text, Format::OpenCv, "x"), &pair);
    assert_golden("opencv_stereo.yml", &text);
    for (name, golden) in
        [("opencv_single.yml", "opencv_single.yml"), ("opencv_fisheye.xml", "opencv_fisheye.yml")]
    {
        let single = cameras(name);
        let text = only(&single, Format::OpenCv);
        assert_same(&read_back(&text, Format::OpenCv, "x"), &single);
        assert_golden(golden, &text);
    }
}

#[test]
fn ros_round_trips() {
    for name in ["ros_plumb_bob.yaml", "ros_topic_echo.yaml", "opencv_fisheye.xml"] {
        let camera = cameras(name);
        let text = only(&camera, Format::RosCameraInfo);
        assert_same(&read_back(&text, Format::RosCameraInfo, "x"), &camera);
    }
    assert_golden("ros.yaml", &only(&cameras("ros_plumb_bob.yaml"), Format::RosCameraInfo));
}

#[test]
fn kalibr_round_trips() {
    for name in ["kalibr_camchain.yaml", "kalibr_imucam.yaml"] {
        let chain = cameras(name);
        let text = only(&chain, Format::Kalibr);
        assert_same(&read_back(&text, Format::Kalibr, "x"), &chain);
        assert_golden(name, &text);
    }
}

/// Kalibr's time shift and a pose between frames of no camera survive in our own file, a covariance too.
#[test]
fn clocks_relations_and_covariances_round_trip() {
    let mut rig = read_cameras(example("kalibr_imucam.yaml")).unwrap();
    assert_eq!(rig.clocks.len(), 1);
    assert_eq!((rig.clocks[0].camera.as_str(), rig.clocks[0].offset_s), ("cam0", 0.001));
    let mut stated = rig.cameras[1].placement.clone().unwrap();
    stated.covariance = Some(Matrix6::from_fn(|i, j| if i == j { 1e-6 * (1 + i) as f64 } else { 1e-7 }));
    rig.cameras[1].placement = Some(stated.clone());
    rig.relations.push(Placement { b: "imu".into(), a: "base".into(), ..stated });
    let files = write_rig(&rig, Format::Own).unwrap();
    assert_eq!(files[0].name, "rig.toml");
    let read = read_cameras_from_bytes(Path::new("x"), files[0].text.clone().into_bytes()).unwrap();
    assert_same(&read.cameras, &rig.cameras);
    let covariance = |file: &CameraFile| file.cameras[1].placement.as_ref().unwrap().covariance;
    assert_eq!(covariance(&read), covariance(&rig));
    assert_eq!((&read.clocks, &read.relations[0].covariance), (&rig.clocks, &rig.relations[0].covariance));
    assert_eq!((read.relations[0].b.as_str(), read.relations[0].a.as_str()), ("imu", "base"));
    assert_golden("rig_imu.toml", &files[0].text);
}

/// Two cameras placed in the world become a chain: cam1_from_cam0 = cam1_from_world · world_from_cam0.
#[test]
fn kalibr_chains_cameras_that_share_a_frame() {
    let mut array = cameras("caliscope.toml");
    array[0].camera = array[1].camera.clone();
    let pose = |i: usize| array[i].placement.as_ref().unwrap().b_from_a;
    let expected = pose(1) * pose(0).inverse();
    let chain = read_back(&only(&array, Format::Kalibr), Format::Kalibr, "x");
    let found = chain[1].placement.as_ref().unwrap();
    assert_eq!((found.b.as_str(), found.a.as_str()), ("cam1", "cam0"));
    assert!(found.b_from_a.angle_to_rad(&expected) < 1e-12);
    assert!((found.b_from_a.translation - expected.translation).norm() < 1e-12);
}

#[test]
fn nothing_is_dropped_silently() {
    let refused = |name: &str, format: Format, words: &str| {
        let WriteError(reason) = write_cameras(&cameras(name), format).unwrap_err();
        assert!(reason.contains(words), "{reason}");
    };
    refused("opencv_stereo.yml", Format::Kalibr, "image size");
    refused("opencv_single.yml", Format::KalibrTarget, "read, not written");
    refused("kalibr_camchain.yaml", Format::RosCameraInfo, "cam2: camera_info has no omni model");
    refused("kalibr_camchain.yaml", Format::OpenCv, "one or two cameras, not 6");
    refused("own_photogrammetric.toml", Format::OpenCv, "own unit");
    refused("photonvision_new.json", Format::Kalibr, "radtan has k1, k2, p1, p2 only");
    assert!(write_cameras(&[], Format::Own).is_err());
    let text = only(&cameras("cam7/sensor.yaml"), Format::RosCameraInfo);
    assert!(text.starts_with("# The pose body from cam7 is not part"), "{text}");
}

/// The new bytes are there, the permissions are the old ones, no temporary file is left; a failure changes nothing.
#[test]
fn atomic_write_replaces_all_or_nothing() {
    let folder = std::env::temp_dir().join(format!("resight-atomic-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join("camera.toml");
    write_atomically(&path, b"first").unwrap();
    let mut readonly_for_others = std::fs::metadata(&path).unwrap().permissions();
    set_mode(&mut readonly_for_others);
    std::fs::set_permissions(&path, readonly_for_others.clone()).unwrap();
    write_atomically(&path, b"second").unwrap();
    assert_eq!(std::fs::read(&path).unwrap(), b"second");
    assert_eq!(std::fs::metadata(&path).unwrap().permissions(), readonly_for_others);
    // A folder cannot be replaced by a file: the rename fails after the bytes are written.
    let occupied = folder.join("occupied");
    std::fs::create_dir_all(occupied.join("inside")).unwrap();
    assert!(write_atomically(&occupied, b"third").is_err());
    assert!(
        write_atomically(folder.join("absent/x.toml"), b"third")
            .unwrap_err()
            .to_string()
            .contains("cannot write")
    );
    let mut left: Vec<String> =
        std::fs::read_dir(&folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    left.sort();
    assert_eq!(left, ["camera.toml", "occupied"]);
    std::fs::remove_dir_all(&folder).unwrap();
}

#[cfg(unix)]
fn set_mode(permissions: &mut std::fs::Permissions) {
    use std::os::unix::fs::PermissionsExt;
    permissions.set_mode(0o100640);
}

#[cfg(not(unix))]
fn set_mode(permissions: &mut std::fs::Permissions) {
    permissions.set_readonly(false);
}

/// The covariance of intrinsics survives in our own file; of another format it is named as lost.
#[test]
fn intrinsics_covariances_round_trip_or_are_named() {
    let mut camera = cameras("opencv_single.yml").remove(0);
    let n = camera.camera.parameters().len();
    let factor = DMatrix::from_fn(n, n, |i, j| if j <= i { 0.3 + (i + 2 * j) as f64 * 0.01 } else { 0.0 });
    camera.intrinsics_covariance = Some(&factor * factor.transpose());
    let rig =
        CameraFile { cameras: vec![camera.clone()], ..read_cameras(example("opencv_single.yml")).unwrap() };
    let own = convert(&rig, Format::Own, None).unwrap();
    assert!(own.lost.is_empty(), "{:?}", own.lost);
    let back = read_back(&own.files[0].text, Format::Own, "x").remove(0).intrinsics_covariance.expect("kept");
    let error = (back - camera.intrinsics_covariance.as_ref().expect("given")).amax();
    assert!(error < 1e-12, "{error}");
    let lost = convert(&rig, Format::OpenCv, None).unwrap().lost;
    assert!(lost.iter().any(|text| text.contains("covariance of the intrinsics of")), "{lost:?}");
}

/// Standard deviations by name, those of OpenCV, and what is no covariance.
#[test]
fn stated_uncertainties_of_intrinsics_are_read() {
    let own = |more: &str| {
        let text = format!(
            "model = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 500.0\nfy_px = 501.0\ncx_px = 319.5\ncy_px = 239.5\n{more}\n"
        );
        read_cameras_from_bytes("camera.toml", text.into_bytes())
    };
    let covariance = |more: &str| own(more).unwrap().cameras.remove(0).intrinsics_covariance;
    let diagonal = covariance("intrinsics_sigma = { fx_px = 2.0, cy_px = 0.5 }").expect("stated");
    assert_eq!(diagonal.diagonal().as_slice(), [4.0, 0.0, 0.0, 0.25]);
    let whole =
        covariance("intrinsics_covariance = [[4.0], [3.9, 4.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]");
    assert_eq!(whole.expect("stated")[(0, 1)], 3.9);
    assert!(covariance("").is_none());
    for (more, said) in [
        (
            "intrinsics_covariance = [[4.0], [5.0, 4.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]",
            "no covariance",
        ),
        ("intrinsics_covariance = [[4.0], [0.0, 4.0]]", "holds 2 rows; 4 are needed"),
        ("intrinsics_covariance = [[4.0], [0.0], [0.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]]", "2 are needed"),
        ("intrinsics_sigma = { fx_px = -1.0 }", "is not negative"),
        ("intrinsics_sigma = { fx = 1.0 }", "`fx_px` (pixels)"),
        ("intrinsics_sigma = { fx_px = 1.0 }\nintrinsics_covariance = []", "remove one of them"),
    ] {
        let refused = own(more).unwrap_err().to_string();
        assert!(refused.contains(said), "{refused}");
    }
    let opencv = |sigmas: &str| {
        let text = format!(
            "%YAML:1.0\n---\nimage_width: 640\nimage_height: 480\ncamera_matrix: !!opencv-matrix\n   rows: 3\n   cols: 3\n   dt: d\n   data: [ 500., 0., 320., 0., 500., 240., 0., 0., 1. ]\ndistortion_coefficients: !!opencv-matrix\n   rows: 5\n   cols: 1\n   dt: d\n   data: [ -0.2, 0.1, 0., 0., 0. ]\nstdDeviationsIntrinsics: [{sigmas}]\n"
        );
        read_cameras_from_bytes("camera.yml", text.into_bytes())
    };
    let read = opencv("1., 1., 2., 2., 0.01, 0.02, 0., 0., 0.03, 0., 0., 0.").unwrap().cameras.remove(0);
    let sigma = read.intrinsics_covariance.expect("stated").diagonal().map(f64::sqrt);
    assert!((sigma[2] - 2.0).abs() + (sigma[8] - 0.03).abs() < 1e-12 && sigma.len() == 9, "{sigma}");
    assert!(opencv("1., 1., 2., 2.").unwrap_err().to_string().contains("9 parameters"));
    assert!(
        opencv("1., 1., 2., 2., 0.01, 0.02, 0., 0., -0.03").unwrap_err().to_string().contains("negative")
    );
}
