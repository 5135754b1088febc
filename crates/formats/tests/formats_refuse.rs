//! Files that cannot be right are refused, with the line, the key and the reason.

use crate::support::{example, text};
use resight_formats::{
    read_camera, read_cameras, read_cameras_from_bytes, read_target, read_target_from_bytes,
};
use std::path::Path;

fn camera_refusal(name: &str, bytes: impl Into<Vec<u8>>) -> String {
    read_cameras_from_bytes(Path::new(name), bytes.into())
        .map(|f| panic!("accepted: {f:?}"))
        .unwrap_err()
        .to_string()
}

fn target_refusal(bytes: impl Into<Vec<u8>>) -> String {
    read_target_from_bytes(Path::new("t"), bytes.into())
        .map(|f| panic!("accepted: {f:?}"))
        .unwrap_err()
        .to_string()
}

#[track_caller]
fn assert_says(refusal: &str, words: &[&str]) {
    for word in words {
        assert!(refusal.contains(word), "`{word}` is not in: {refusal}");
    }
}

/// The example with one thing changed must be refused with these words.
#[track_caller]
fn assert_camera_refused(example: &str, from: &str, to: &str, words: &[&str]) {
    let original = text(example);
    assert!(original.contains(from), "{from}");
    assert_says(&camera_refusal(example, original.replacen(from, to, 1)), words);
}

#[test]
fn own_files_name_line_key_and_the_way_out() {
    let file = "own_pinhole.toml";
    assert_camera_refused(
        file,
        "width_px",
        "widht_px",
        &["own_pinhole.toml:2:", "widht_px", "did you mean `width_px`"],
    );
    assert_camera_refused(file, "fx_px", "fx", &[":4:", "write `fx_px` (pixels)"]);
    assert_camera_refused(file, "\"pinhole\"", "\"pinhol\"", &[":1: model", "did you mean `pinhole`"]);
    assert_camera_refused(file, "\"pinhole\"", "\"fisheye\"", &["did you mean `kannala_brandt`"]);
    assert_camera_refused(file, "535.4", "-535.4", &["fx_px is -535.4", "positive"]);
    assert_camera_refused(file, "535.4", "nan", &[":4: fx_px: is NaN", "finite"]);
    assert_camera_refused(file, "535.4", "\"535,4\"", &[":4: fx_px", "decimal comma", "535.4"]);
    assert_camera_refused(file, "341.8", "657.0", &["cx_px is 657", "640×480"]);
    assert_camera_refused(file, "width_px = 640\n", "", &["`width_px` is missing"]);
    assert_camera_refused(file, "640", "640.5", &[":2: width_px", "whole number"]);
    assert_camera_refused(file, "fy_px = 535.9", "fx_px = 535.9", &[":5:", "TOML"]);
}

#[test]
fn own_rigs_refuse_duplicates_and_unclear_quaternions() {
    let file = "own_rig.toml";
    assert_camera_refused(file, "\"right\"\nmodel", "\"left\"\nmodel", &["two cameras are called `left`"]);
    assert_camera_refused(file, "rotation_wxyz", "rotation", &[":22:", "rotation_wxyz = [w, x, y, z]"]);
    assert_camera_refused(file, "0.9998000066665778", "0.9", &[":22:", "length 0.9", "length 1"]);
    assert_camera_refused(
        file,
        "[-0.2, 0.1, 0.001, -0.0005, 0.0]",
        "[-0.2, 0.1, 0.001]",
        &[":10:", "3 coefficients", "4, 5, 8, 12 or 14"],
    );
    assert_camera_refused(file, "name = \"left\"\n", "", &[":1:", "`name` is missing"]);
}

#[test]
fn opencv_files_that_cannot_be_right() {
    assert_camera_refused(
        "opencv_single.yml",
        "rows: 5",
        "rows: 6",
        &[":11: distortion_coefficients", "6×1", "5 numbers"],
    );
    assert_camera_refused("opencv_single.yml", "535.4, 0.,", "535.4, 1.,", &[":6: camera_matrix", "skew"]);
    assert_camera_refused(
        "opencv_single.yml",
        "0.001",
        ".Nan",
        &[":15: distortion_coefficients.data[2]", "NaN", "finite"],
    );
    assert_camera_refused(
        "opencv_single.yml",
        "image_width: 640\n",
        "",
        &[":4: image_height", "belong together"],
    );
    assert_camera_refused(
        "opencv_fisheye.xml",
        "7.0e-03</data>",
        "</data>",
        &[":13: Distortion_Coefficients", "4×1", "3 numbers"],
    );
    assert_camera_refused("opencv_fisheye.xml", "</opencv_storage>", "", &["XML"]);
    assert_camera_refused(
        "opencv_stereo.yml",
        "data: [ 0.8, 0.,",
        "data: [ 0.8, 0.1,",
        &[":24: R", "not a rotation", "1e-3"],
    );
    assert_camera_refused("opencv_stereo.yml", "-0.6, 0., 1.,", "-0.6, 0., -1.,", &["mirror"]);
    let refusal = read_cameras(example("opencv_extrinsics.yml")).unwrap_err().to_string();
    assert_says(&refusal, &["poses only, no intrinsics"]);
}

#[test]
fn ros_files_that_cannot_be_right() {
    let file = "ros_plumb_bob.yaml";
    assert_camera_refused(
        file,
        "plumb_bob",
        "plumb_bop",
        &[":8: distortion_model", "plumb_bop", "rational_polynomial"],
    );
    assert_camera_refused(
        file,
        "plumb_bob",
        "rational_polynomial",
        &[":9: distortion_coefficients", "5 coefficients", "8"],
    );
    assert_camera_refused(
        file,
        "plumb_bob\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.3375, 0.1115, -0.0007, -0.0001, 0]",
        "equidistant\ndistortion_coefficients:\n  rows: 1\n  cols: 5\n  data: [-0.3375, 0.1115, -0.0007, -0.0001, 0.5]",
        &["5 coefficients; equidistant takes 4"],
    );
    assert_camera_refused(file, "image_width: 640\n", "", &["`image_width` is missing"]);
    assert_camera_refused(
        "ros_topic_echo.yaml",
        "binning_x: 0",
        "binning_x: 2",
        &["binning_x: is 2", "unbinned"],
    );
    assert_camera_refused(
        "ros_topic_echo.yaml",
        "x_offset: 0",
        "x_offset: 16",
        &["roi", "part of the image"],
    );
}

#[test]
fn kalibr_files_that_cannot_be_right() {
    let file = "kalibr_camchain.yaml";
    assert_camera_refused(
        file,
        "camera_model: pinhole",
        "camera_model: pinhol",
        &[":3: cam0.camera_model", "pinhol", "eucm"],
    );
    assert_camera_refused(
        file,
        "distortion_model: radtan",
        "distortion_model: radtang",
        &[":5: cam0.distortion_model", "equidistant"],
    );
    assert_camera_refused(
        file,
        "[542.1, 541.4, 512.4, 373.6]",
        "[542.1, 541.4, 512.4]",
        &[":6: cam0.intrinsics", "3 numbers; 4", "fu, fv, pu, pv"],
    );
    assert_camera_refused(
        file,
        "0.08, 0.0016, 0.0004]",
        "0.08, 0.0016]",
        &[":4: cam0.distortion_coeffs", "3 coefficients; radtan takes 4"],
    );
    assert_camera_refused(
        file,
        "[0.8, 0.0, 0.6, -0.12]",
        "[0.81, 0.0, 0.6, -0.12]",
        &[":10: cam1.T_cn_cnm1", "not a rotation"],
    );
    assert_camera_refused(file, "  - [0.0, 0.0, 0.0, 1.0]\n", "", &[":10: cam1.T_cn_cnm1", "3×4", "4×4"]);
    assert_camera_refused(
        file,
        "camera_model: ds\n  distortion_coeffs: []\n  distortion_model: none",
        "camera_model: ds\n  distortion_coeffs: [0.1, 0, 0, 0]\n  distortion_model: radtan",
        &["radtan on top of double_sphere"],
    );
    assert_camera_refused(
        file,
        "resolution: [1024, 768]",
        "resolution: [1024, 768, 3]",
        &["cam0.resolution"],
    );
}

#[test]
fn other_camera_files_that_cannot_be_right() {
    assert_camera_refused(
        "cameras.txt",
        "3 OPENCV",
        "3 OPENCW",
        &["cameras.txt:6: camera 3", "unknown model `OPENCW`"],
    );
    assert_camera_refused(
        "cameras.txt",
        "3 OPENCV",
        "3 THIN_PRISM_FISHEYE",
        &[":6:", "not supported", "undistort"],
    );
    assert_camera_refused(
        "cameras.txt",
        " -0.2 0.1 0.001 -0.0005\n",
        " -0.2\n",
        &[":6:", "5 parameters; OPENCV takes 8"],
    );
    assert_camera_refused("cameras.txt", "2 PINHOLE", "1 PINHOLE", &["two cameras are called `1`"]);
    assert_camera_refused(
        "left.cameramodel",
        "LENSMODEL_OPENCV5",
        "LENSMODEL_CAHVOR",
        &[":3: lensmodel", "LENSMODEL_CAHVOR", "mrcal-convert-lensmodel"],
    );
    assert_camera_refused("left.cameramodel", " -0.25,]", "]", &[":5: intrinsics", "8 numbers; 9"]);
    assert_camera_refused(
        "photonvision_new.json",
        "LENSMODEL_OPENCV",
        "LENSMODEL_STERIOGRAPHIC",
        &[":9: lensmodel", "STERIOGRAPHIC"],
    );
    assert_camera_refused("basalt.json", "\"ds\"", "\"dds\"", &["camera_type", "unknown camera_type `dds`"]);
    assert_camera_refused("basalt.json", "\"qw\": 0.8", "\"qw\": 0.9", &["length 1.08"]);
    assert_camera_refused(
        "caliscope.toml",
        "rotation = [0.0, 0.0, 1.5707963267948966]",
        "rotation = [0.0, 0.0, 0.0, 1.0]",
        &["quaternion of unclear order"],
    );
    assert_camera_refused(
        "cam7/sensor.yaml",
        "sensor_type: camera",
        "sensor_type: imu",
        &["poses only, no intrinsics"],
    );
}

#[test]
fn targets_that_cannot_be_right() {
    let changed = |name: &str, from: &str, to: &str| {
        assert!(text(name).contains(from), "{from}");
        target_refusal(text(name).replacen(from, to, 1))
    };
    assert_says(&changed("target_tag.toml", "size_m", "size"), &["t:4: size", "write `size_m` (metres)"]);
    assert_says(&changed("target_tag.toml", "size_m", "size_mm"), &["write `size_m = 0.00008` (metres)"]);
    assert_says(&changed("target_tag.toml", "0.08", "-0.08"), &["size_m is -0.08", "positive"]);
    assert_says(&changed("target_tag.toml", "\"tag\"", "\"tagg\""), &["t:1: kind", "did you mean `tag`"]);
    assert_says(
        &changed("target_line_plus_one.toml", "0.10, 0.15]", "0.10]"),
        &["t:2: line_m", "2 numbers; 3"],
    );
    assert_says(
        &changed("target_line_plus_one.toml", "off_m = [0.0, 0.15]", "off_m = [0.0, 0.0]"),
        &["off the line"],
    );
    assert_says(
        &changed("target_charuco.toml", "marker_m = 0.0405", "marker_m = 0.06"),
        &["marker_m is 0.06"],
    );
    assert_says(
        &changed("target_tag_map.toml", "id = 1", "id = 3"),
        &["t:9: tag[1]", "tag 3 is listed twice"],
    );
    assert_says(
        &changed("target_tag_map.toml", "rotation_wxyz", "rotation_xyzw"),
        &["rotation_wxyz = [w, x, y, z]"],
    );
    assert_says(&changed("target_points.toml", "\"kerb\"", "\"church\""), &["`church` is listed twice"]);
    assert_says(
        &changed("kalibr_aprilgrid.yaml", "'aprilgrid'", "'circles'"),
        &["t:1: target_type", "aprilgrid, checkerboard and circlegrid are read"],
    );
    assert_says(&changed("kalibr_circlegrid.yaml", "targetCols: 4", "targetCols: 1"), &["t:2: targetCols"]);
    assert_says(
        &changed("kalibr_aprilgrid.yaml", "tagRows: 5", "tagRows: 4000000000"),
        &["t:3: tagRows", "at most 1000"],
    );
    assert_says(
        &changed("kalibr_checkerboard.yaml", "rowSpacingMeters: 0.025", "rowSpacingMeters: 0.03"),
        &["rowSpacingMeters", "differs"],
    );
    assert_says(&changed("wpilib_2024.json", "\"ID\":4", "\"ID\":1"), &["tag 1 is listed twice"]);
}

#[test]
fn cameras_and_targets_are_reported_apart() {
    let refusal = read_cameras(example("target_tag.toml")).unwrap_err().to_string();
    assert_says(&refusal, &["target_tag.toml", "is a target", "--target"]);
    let refusal = read_target(example("own_pinhole.toml")).unwrap_err().to_string();
    assert_says(&refusal, &["is a camera", "--camera"]);
    assert_says(&camera_refusal("x", "colour: blue\n"), &["not a camera file", "keys colour", "Kalibr"]);
}

#[test]
fn one_of_several_cameras_is_picked_by_name() {
    let path = example("kalibr_camchain.yaml").display().to_string();
    assert_eq!(read_camera(format!("{path}#cam3")).unwrap().name, "cam3");
    assert_says(
        &read_camera(format!("{path}#cam9")).unwrap_err().to_string(),
        &["no camera `cam9`", "cam0, cam1"],
    );
    assert_says(&read_camera(&path).unwrap_err().to_string(), &["6 cameras", "FILE#cam0"]);
    assert_says(&read_camera("no-such-file.yaml").unwrap_err().to_string(), &["no-such-file.yaml"]);
}

#[test]
fn files_that_are_not_text_or_too_much() {
    assert_says(&camera_refusal("x", "\u{feff}model"), &["not"]);
    assert_says(&camera_refusal("x", [0xff, 0xfe, b'm', 0]), &["UTF-16"]);
    assert_says(&camera_refusal("x", b"model = 1\nfx\0".to_vec()), &["x:2:", "NUL"]);
    assert_says(&camera_refusal("x", b"model = 1\n\xff\xff".to_vec()), &["x:2:", "not UTF-8"]);
    assert_says(&camera_refusal("x", ""), &["empty"]);
    assert_says(&camera_refusal("x", " \n\n"), &["empty"]);
    assert_says(&camera_refusal("x", format!("a: {}\n", "1".repeat(1 << 20))), &["larger than 1 MiB"]);
    let deep = format!("{{\"a\": {}{}}}", "[".repeat(100_000), "]".repeat(100_000));
    assert_says(&camera_refusal("x", deep), &["nested deeper than"]);
    camera_refusal("x", format!("a: {}{}\n", "[".repeat(10_000), "]".repeat(10_000)));
    camera_refusal("x", format!("a = {}{}\n", "[".repeat(10_000), "]".repeat(10_000)));
    let tags = 20_000;
    camera_refusal(
        "x",
        format!("<opencv_storage>{}{}</opencv_storage>", "<a>".repeat(tags), "</a>".repeat(tags)),
    );
}

/// Nine levels of nine references each would be 387 million nodes.
#[test]
fn yaml_that_unfolds_is_refused_quickly() {
    let mut bomb = String::from("a: &a [lol, lol, lol, lol, lol, lol, lol, lol, lol]\n");
    for (previous, this) in "abcdefgh".chars().zip("bcdefghi".chars()) {
        let references = vec![format!("*{previous}"); 9].join(", ");
        bomb += &format!("{this}: &{this} [{references}]\n");
    }
    let start = std::time::Instant::now();
    assert_says(&camera_refusal("x", bomb), &["YAML"]);
    assert!(start.elapsed().as_secs_f64() < 2.0);
}

#[test]
fn xml_with_entities_is_refused() {
    let text =
        "<?xml version=\"1.0\"?><!DOCTYPE x [<!ENTITY a \"aaaa\">]><opencv_storage>&a;</opencv_storage>";
    assert_says(&camera_refusal("x", text), &["XML"]);
}

/// As many values as the size limits let through: seconds at most, whatever they are.
#[test]
fn the_largest_files_end_soon() {
    let yaml = |unit: &str| unit.repeat((1 << 20) / unit.len());
    for (name, text) in [
        ("list", yaml("- 1\n")),
        ("flow", format!("a: [{}1]\n", "1,".repeat(500_000))),
        ("maps", yaml("- {a: 1, b: 2}\n")),
        ("toml", format!("a = [{}1]\n", "1,".repeat(500_000))),
        ("json", format!("{{\"a\": [{}1]}}", "1,".repeat(8_000_000))),
        ("xml", format!("<opencv_storage>{}</opencv_storage>", "<a>1</a>".repeat(100_000))),
    ] {
        let start = std::time::Instant::now();
        camera_refusal("x", text);
        println!("{name}: {:.2} s", start.elapsed().as_secs_f64());
        assert!(start.elapsed().as_secs_f64() < 20.0, "{name}");
    }
}

/// Points of a target of 1e308 m are no numbers.
#[test]
fn a_target_beyond_any_size_is_refused() {
    for text in [
        "kind = \"aprilgrid\"\nrows = 5\ncolumns = 6\ntag_size_m = 1.6e308\ntag_spacing_ratio = 0.3\n",
        "kind = \"chessboard\"\nrows = 5\ncolumns = 6\nsquare_m = 1e300\n",
    ] {
        let refused = resight_formats::read_target_from_bytes("board.toml", text.as_bytes().to_vec());
        let reason = refused.expect_err("refused").to_string();
        assert!(reason.contains("at most 1e9 m"), "{reason}");
    }
}
