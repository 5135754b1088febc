//! Lists of poses: each format with poses computed by hand, each convention by a quarter turn about one axis and an order of two, each mistake by its
//! name.

use crate::support::assert_golden;
use resight_formats::OutFile;
use resight_formats::core::Pose;
use resight_formats::core::multiview::hand_eye::{AngleUnit, Mounting};
use resight_formats::pose_list::{
    LengthUnit, PoseList, PoseListOptions, RotationFormat, RotationWord, pose_list_of_array, read_pose_list,
};
use std::path::PathBuf;

fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("resight-pose-lists-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

fn read(name: &str, bytes: &[u8], options: &PoseListOptions) -> Result<PoseList, String> {
    read_pose_list(file(name, bytes), options).map_err(|reason| reason.to_string())
}

fn word(word: &str) -> PoseListOptions {
    PoseListOptions { rotation: Some(RotationWord::parse(word).unwrap()), ..PoseListOptions::default() }
}

/// Where the axes x, y, z of the gripper point in the base, row by row of R: a quarter turn about z takes x to y and y to −x.
const ABOUT_Z: [[f64; 3]; 3] = [[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]];
/// Rz(90°) Rx(90°): x to y, y to z, z to x.
const Z_THEN_X: [[f64; 3]; 3] = [[0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]];
/// Rx(90°) Rz(90°): x to z, y to −x, z to −y.
const X_THEN_Z: [[f64; 3]; 3] = [[0.0, -1.0, 0.0], [0.0, 0.0, -1.0], [1.0, 0.0, 0.0]];

fn is(pose: &Pose, r: [[f64; 3]; 3], t: [f64; 3], what: &str) {
    for i in 0..3 {
        for j in 0..3 {
            assert!((pose.rotation[(i, j)] - r[i][j]).abs() < 1e-9, "{what}: {}", pose.rotation);
        }
        assert!((pose.translation[i] - t[i]).abs() < 1e-9, "{what}: {}", pose.translation);
    }
}

/// A second row, so that the list is none of copies.
fn with_second(first: &str, n: usize) -> String {
    format!("{first}\n0.5 0 0 {}\n", vec!["0"; n].join(" "))
}

/// KUKA: R = Rz(A) Ry(B) Rx(C). ABB: R = Rz(EZ) Ry(EY) Rx(EX). Fanuc, Mitsubishi, URDF: R = Rz(R) Ry(P) Rx(W). Stäubli: R = Rx Ry Rz. Kawasaki: R = Rz(O) Ry(A) Rz(T).
#[test]
fn three_numbers_mean_what_the_convention_says() {
    let quarter = std::f64::consts::FRAC_PI_2;
    // 120° about (1, 1, 1) takes x to y, y to z, z to x.
    let third = (2.0 * std::f64::consts::FRAC_PI_3) / 3f64.sqrt();
    type Row = (&'static str, [f64; 3], [[f64; 3]; 3], f64);
    let rows: [Row; 13] = [
        ("kuka", [90.0, 0.0, 90.0], Z_THEN_X, 1e-3),
        ("abb-zyx", [90.0, 0.0, 90.0], Z_THEN_X, 1e-3),
        ("zyx-rad", [quarter, 0.0, quarter], Z_THEN_X, 1.0),
        ("fanuc", [90.0, 0.0, 90.0], Z_THEN_X, 1e-3),
        ("mitsubishi", [0.0, 0.0, 90.0], ABOUT_Z, 1e-3),
        ("rpy-rad", [quarter, 0.0, quarter], Z_THEN_X, 1.0),
        ("rpy-deg", [0.0, 0.0, 90.0], ABOUT_Z, 1.0),
        ("staubli", [90.0, 0.0, 90.0], X_THEN_Z, 1e-3),
        ("xyz-rad", [quarter, 0.0, quarter], X_THEN_Z, 1.0),
        // Rz(90°) Ry(90°) Rz(0): x to −z, y to −x, z to y.
        ("kawasaki", [90.0, 90.0, 0.0], [[0.0, -1.0, 0.0], [0.0, 0.0, 1.0], [-1.0, 0.0, 0.0]], 1e-3),
        ("zyz-rad", [quarter, 0.0, 0.0], ABOUT_Z, 1.0),
        ("ur", [third, third, third], Z_THEN_X, 1.0),
        ("rotvec-deg", [0.0, 0.0, 90.0], ABOUT_Z, 1.0),
    ];
    for (name, [a, b, c], r, unit) in rows {
        let text = with_second(&format!("1 2 3 {a} {b} {c}"), 3);
        let list = read("three.txt", text.as_bytes(), &word(name)).unwrap();
        is(&list.poses[0].b_from_a, r, [unit, 2.0 * unit, 3.0 * unit], name);
        let metres = PoseListOptions { length: Some(LengthUnit::Metres), is_inverse: true, ..word(name) };
        let inverse = &read("three.txt", text.as_bytes(), &metres).unwrap().poses[0].b_from_a;
        is(&inverse.inverse(), r, [1.0, 2.0, 3.0], name);
    }
    assert!(RotationWord::parse("cuca").unwrap_err().contains("kuka"));
}

#[test]
fn columns_state_their_convention() {
    let none = PoseListOptions::default();
    for (header, row, options, r, t) in [
        ("view,x_m,y_m,z_m,qx,qy,qz,qw", "a,1,2,3,0,0,0.70710678,0.70710678", none, ABOUT_Z, [1.0, 2.0, 3.0]),
        ("image,x_mm,y_mm,z_mm,W,P,R", "a,1,2,3,0,0,90", none, ABOUT_Z, [1e-3, 2e-3, 3e-3]),
        ("view,x_mm,y_mm,z_mm,EZ,EY,EX", "a,1,2,3,90,0,90", none, Z_THEN_X, [1e-3, 2e-3, 3e-3]),
        ("view,X [mm],Y [mm],Z [mm],O,A,T", "a,1,2,3,90,0,0", none, ABOUT_Z, [1e-3, 2e-3, 3e-3]),
        ("view,tx,ty,tz,roll_deg,pitch_deg,yaw_deg", "a,1,2,3,90,0,90", none, Z_THEN_X, [1.0, 2.0, 3.0]),
        (
            "view,x_m,y_m,z_m,rvec_x_rad,rvec_y_rad,rvec_z_rad",
            "a,1,2,3,0,0,1.5707963267948966",
            none,
            ABOUT_Z,
            [1.0, 2.0, 3.0],
        ),
        ("view,X,Y,Z,A,B,C", "a,1,2,3,90,0,90", word("kuka"), Z_THEN_X, [1e-3, 2e-3, 3e-3]),
        ("view,X,Y,Z,A,B,C", "a,1,2,3,0,0,90", word("mitsubishi"), ABOUT_Z, [1e-3, 2e-3, 3e-3]),
        (
            "view,x,y,z,q1,q2,q3,q4",
            "a,1,2,3,0.70710678,0,0,0.70710678",
            word("abb"),
            ABOUT_Z,
            [1e-3, 2e-3, 3e-3],
        ),
        ("view,x_m,y_m,z_m,rx,ry,rz", "a,1,2,3,0,0,1.5707963267948966", word("ur"), ABOUT_Z, [1.0, 2.0, 3.0]),
        (
            "view,x_m,y_m,z_m,r11,r12,r13,r21,r22,r23,r31,r32,r33",
            "a,1,2,3,0,-1,0,1,0,0,0,0,1",
            none,
            ABOUT_Z,
            [1.0, 2.0, 3.0],
        ),
        (
            "view,m00,m01,m02,m03,m10,m11,m12,m13,m20,m21,m22,m23",
            "a,0,-1,0,1,1,0,0,2,0,0,1,3",
            none,
            ABOUT_Z,
            [1.0, 2.0, 3.0],
        ),
    ] {
        let list = read("columns.csv", format!("{header}\n{row}\n").as_bytes(), &options).unwrap();
        is(&list.poses[0].b_from_a, r, t, header);
        assert_eq!(list.poses[0].view.as_deref(), Some("a"));
    }
}

#[test]
fn what_names_leave_open_is_refused_with_the_choices() {
    let none = PoseListOptions::default();
    for (header, options, words) in [
        ("x_m,y_m,z_m,rx,ry,rz", none, "ur, rotvec-rad, rotvec-deg, rpy-rad, rpy-deg, fanuc"),
        (
            "x_m,y_m,z_m,rx_deg,ry_deg,rz_deg",
            none,
            "rotvec-deg, rpy-deg, fanuc, mitsubishi, yaskawa, staubli:",
        ),
        ("x_m,y_m,z_m,A,B,C", none, "mitsubishi, yaskawa, kuka"),
        ("x_m,y_m,z_m,roll,pitch,yaw", none, "rpy-rad, rpy-deg"),
        (
            "x_m,y_m,z_m,q1,q2,q3,q4",
            none,
            "order of the quaternion must be named: choose one of quaternion-wxyz, quaternion-xyzw, abb",
        ),
        (
            "x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg",
            word("kuka"),
            "no rotation of the stated convention `kuka`",
        ),
        ("x_m,y_m,z_m,roll_deg,pitch_deg,yaw_deg", word("rpy-rad"), "no rotation of the stated convention"),
        ("x_m,y_m,z_m,rx,ry,rz", word("kuka"), "no rotation of the stated convention"),
        ("x_m,y_m,z_m,qw,qx,qy,qz,roll_deg,pitch_deg,yaw_deg", none, "several rotations"),
        ("x_m,y_mm,z_m,qw,qx,qy,qz", none, "different units"),
        ("x_m,y_m,z_m", none, "no column `qw`"),
        ("qw,qx,qy,qz", none, "no column `x_m`"),
    ] {
        let reason = read("open.csv", format!("{header}\n").as_bytes(), &options).unwrap_err();
        assert!(reason.contains(words), "{header}: {reason}");
    }
    for (rows, words) in [("1 2 3 0 0 1\n", "rows of six numbers"), ("1 2 3 0 0 0 1\n", "quaternion-xyzw")] {
        let reason = read("open.txt", rows.as_bytes(), &none).unwrap_err();
        assert!(reason.contains(words) && reason.contains("--rotation"), "{reason}");
    }
    let both = "0 0 0 1 0 0 0\n0 1 0 0 0 0 1\n1 0 0 0 0 0 1\n";
    let reason = read("both.txt", both.as_bytes(), &word("quaternion-xyzw")).unwrap_err();
    assert!(reason.contains("length"), "{reason}");
}

/// A version-1 array as NumPy 2 writes it: `numpy.save` of float64.
fn npy(descr: &str, order: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let mut header = format!("{{'descr': '{descr}', 'fortran_order': {order}, 'shape': {shape}, }}");
    header.push_str(&" ".repeat(117usize.saturating_sub(header.len())));
    header.push('\n');
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(data);
    bytes
}

fn two_matrices() -> Vec<f64> {
    let first = [0.0, -1.0, 0.0, 1.0, 1.0, 0.0, 0.0, 2.0, 0.0, 0.0, 1.0, 3.0, 0.0, 0.0, 0.0, 1.0];
    let second = [1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    first.into_iter().chain(second).collect()
}

#[test]
fn arrays_are_read_in_every_shape() {
    let none = PoseListOptions::default();
    let numbers = two_matrices();
    let f8: Vec<u8> = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
    let f4: Vec<u8> = numbers.iter().flat_map(|x| (*x as f32).to_le_bytes()).collect();
    let text = |width: usize| {
        let row = |row: &[f64]| row.iter().map(f64::to_string).collect::<Vec<_>>().join(",") + "\n";
        numbers.chunks(width).map(row).collect::<String>().into_bytes()
    };
    let nested =
        format!("{:?}", numbers.chunks(16).map(|m| m.chunks(4).collect::<Vec<_>>()).collect::<Vec<_>>());
    for (name, bytes) in [
        ("f8.npy", npy("<f8", "False", "(2, 4, 4)", &f8)),
        ("f4.npy", npy("<f4", "False", "(2, 4, 4)", &f4)),
        ("rows.csv", text(16)),
        ("stacked.txt", text(4)),
        ("nested.json", nested.clone().into_bytes()),
        ("key.json", format!("{{\"base_from_gripper\": {nested}}}").into_bytes()),
        ("key.yaml", format!("poses: {nested}\n").into_bytes()),
    ] {
        let list = read(name, &bytes, &none).unwrap();
        assert_eq!(list.poses.len(), 2, "{name}");
        is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], name);
        assert!(list.poses[0].view.is_none());
    }
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let row = |r: [f64; 7]| [r.as_slice(), &[5.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]].concat();
    let list = pose_list_of_array(
        "motions",
        &[2, 7],
        row([1.0, 2.0, 3.0, 0.0, 0.0, half, half]),
        &word("quaternion-xyzw"),
    )
    .unwrap();
    is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "position first");
    let first = vec![half, 0.0, 0.0, half, 1.0, 2.0, 3.0, 1.0, 0.0, 0.0, 0.0, 5.0, 0.0, 0.0];
    let list = pose_list_of_array("motions", &[2, 7], first, &word("quaternion-wxyz")).unwrap();
    is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "quaternion first");
}

#[test]
fn broken_arrays_are_refused_by_name() {
    let none = PoseListOptions::default();
    let data: Vec<u8> = two_matrices().iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut long = npy("<f8", "False", "(2, 4, 4)", &data);
    long[8..10].copy_from_slice(&60_000u16.to_le_bytes());
    let mut huge = b"\x93NUMPY\x02\x00".to_vec();
    huge.extend(u32::MAX.to_le_bytes());
    for (what, bytes, words) in [
        ("big endian", npy(">f8", "False", "(2, 4, 4)", &data), "astype"),
        ("whole numbers", npy("<i8", "False", "(2, 4, 4)", &data), "floating point"),
        ("objects", npy("|O", "False", "(2, 4, 4)", &data), "Python objects"),
        ("Fortran", npy("<f8", "True", "(2, 4, 4)", &data), "ascontiguousarray"),
        ("short", npy("<f8", "False", "(3, 4, 4)", &data), "damaged or incomplete"),
        (
            "overflow",
            npy("<f8", "False", "(4294967295, 4294967295, 4294967295)", &data),
            "damaged or incomplete",
        ),
        ("negative", npy("<f8", "False", "(-2, 4, 4)", &data), "whole number"),
        ("other axis", npy("<f8", "False", "(4, 4, 2)", &data), "moveaxis"),
        ("pairs", npy("<f8", "False", "(1, 2, 4, 4)", &data), "which is the robot's"),
        ("columns", npy("<f8", "False", "(4, 8)", &data), "[4, 8]"),
        ("none", npy("<f8", "False", "(0, 4, 4)", &[]), "no pose"),
        ("header", long, "60000 bytes"),
        ("header", huge, "4294967295 bytes"),
        ("cut", b"\x93NUMPY\x01".to_vec(), "incomplete"),
        ("version", b"\x93NUMPY\x09\x00\x00\x00".to_vec(), "version 9"),
        ("archive", b"PK\x03\x04....arr_0.npy".to_vec(), "numpy.save"),
        ("pickle", b"\x80\x04\x95abc".to_vec(), "numpy.save"),
        ("empty", Vec::new(), "empty"),
    ] {
        let reason = read("broken.npy", &bytes, &none).unwrap_err();
        assert!(reason.contains(words), "{what}: {reason}");
    }
}

#[test]
fn what_is_no_pose_is_refused_by_name() {
    let none = PoseListOptions::default();
    let matrix = |m: [[f64; 4]; 4]| format!("[{m:?}]");
    let id = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, 0.0, 2.0], [0.0, 0.0, 1.0, 3.0], [0.0, 0.0, 0.0, 1.0]];
    let changed = |i: usize, j: usize, x: f64| {
        let mut m = id;
        m[i][j] = x;
        matrix(m)
    };
    let mut transposed = id;
    for i in 0..4 {
        for j in 0..4 {
            transposed[i][j] = id[j][i];
        }
    }
    for (what, text, words) in [
        ("mirror", changed(0, 0, -1.0), "mirror"),
        ("not orthonormal", changed(0, 1, 0.1), "1.0e-1"),
        ("last row", changed(3, 3, 2.0), "last row"),
        ("transposed", matrix(transposed), "transposed"),
        ("copies", format!("[{id:?}, {id:?}, {id:?}]"), "did not move"),
        ("ragged", format!("[{id:?}, [[1.0, 2.0]]]"), "different lengths"),
        ("word", "[{\"view\": \"a\"}]".into(), "no key `qw`"),
        (
            "order",
            "[{\"position\": [1, 2, 3], \"orientation\": [0, 0, 0, 1]}]".into(),
            "quaternion-wxyz, quaternion-xyzw",
        ),
        ("twice", format!("{{\"base_from_gripper\": [{id:?}], \"rotation\": \"cuca\"}}"), "no convention"),
        ("unit", format!("{{\"base_from_gripper\": [{id:?}], \"length\": \"feet\"}}"), "m, cm or mm"),
        (
            "number",
            format!("{{\"base_from_gripper\": [{id:?}], \"cam_from_target\": [{id:?}, {id:?}]}}"),
            "go by place",
        ),
    ] {
        let reason = read("wrong.json", text.as_bytes(), &none).unwrap_err();
        assert!(reason.contains(words), "{what}: {reason}");
    }
    for (what, text, options, words) in [
        ("NaN", "1 2 nan 0 0 0\n", word("ur"), "NaN"),
        ("columns", "1 2 3 0 0 0\n1 2 3\n", word("ur"), ":2: 3 numbers where the first row has 6"),
        ("degrees as radians", "1 2 3 170 0 0\n", word("rpy-rad"), "in degrees?"),
        ("lengths as angles", "1 2 3 1700 0 0\n", word("kuka"), "a length?"),
        ("length", "view,x_m,y_m,z_m,qw,qx,qy,qz\na,1,2,3,1,1,0,0\n", none, "length 1.4142"),
        ("view twice", "view,x_m,y_m,z_m,qw,qx,qy,qz\na,1,2,3,1,0,0,0\na,2,2,3,1,0,0,0\n", none, "`a` twice"),
        ("no view", "view,x_m,y_m,z_m,qw,qx,qy,qz\n,1,2,3,1,0,0,0\n", none, "is empty"),
        ("inf", "view,x_m,y_m,z_m,qw,qx,qy,qz\na,inf,2,3,1,0,0,0\n", none, "finite"),
    ] {
        let reason = read("wrong.csv", text.as_bytes(), &options).unwrap_err();
        assert!(reason.contains(words), "{what}: {reason}");
    }
    let small = read("small.txt", b"1 2 3 0.1 0 0\n1 2 3 1.5 0 0\n", &word("kuka")).unwrap();
    assert!(small.remarks.iter().any(|remark| remark.contains("radians")), "{:?}", small.remarks);
    let printed = "[[[ 1.  0.  0.  0.5]\n  [ 0.  1.  0.  0.2]\n  [ 0.  0.  1. -3e-1]\n  [ 0.  0.  0.  1. ]]\n\n [[ 1.  0.  0.  0.6]\n  [ 0.  1.  0.  0. ]\n  [ 0.  0.  1.  0. ]\n  [ 0.  0.  0.  1. ]]]\n";
    let printed = read("printed.txt", printed.as_bytes(), &none).unwrap();
    let places: Vec<f64> = printed.poses.iter().map(|pose| pose.b_from_a.translation.x).collect();
    assert_eq!((places, printed.poses[0].b_from_a.translation.z), (vec![0.5, 0.6], -0.3));
    let long = read("long.txt", b"400 200 300 0.1 0 0\n1 2 3 1.5 0 0\n", &word("ur")).unwrap();
    assert!(long.remarks.iter().any(|remark| remark.contains("millimetres")), "{:?}", long.remarks);
}

const QUARTER: &str = "translation: {x: 1.0, y: 2.0, z: 3.0}, rotation: {x: 0.0, y: 0.0, z: 0.7071067811865476, w: 0.7071067811865476}";
const NOTHING: &str = "translation: {x: 0.0, y: 0.0, z: 0.0}, rotation: {x: 0.0, y: 0.0, z: 0.0, w: 1.0}";

/// Records that hold the poses of gripper and target give both; one without the target's is refused.
#[test]
fn records_of_pairs_hold_both_poses() {
    let turned = "[[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]";
    let still = "[[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]";
    let text = |robot: &str| {
        format!(
            "[{{\"{robot}\": {turned}, \"cam_from_target\": {still}}}, {{\"{robot}\": {still}, \"cam_from_target\": {turned}}}]"
        )
    };
    let none = PoseListOptions::default();
    let list = read("pairs.json", text("base_from_gripper").as_bytes(), &none).unwrap();
    is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "gripper");
    is(&list.cam_from_target.unwrap()[1], ABOUT_Z, [1.0, 2.0, 3.0], "target");
    let list = read("pairs.json", text("gripper_from_base").as_bytes(), &none).unwrap();
    is(&list.poses[0].b_from_a.inverse(), ABOUT_Z, [1.0, 2.0, 3.0], "gripper");
    is(&list.cam_from_target.unwrap()[1], ABOUT_Z, [1.0, 2.0, 3.0], "target");
    let half = text("base_from_gripper").replacen(&format!(", \"cam_from_target\": {turned}"), "", 1);
    assert!(read("pairs.json", half.as_bytes(), &none).unwrap_err().contains("cam_from_target"));
}

/// easy_handeye 2 states its mounting, on which the direction of the robot's pose depends; with an empty one nothing is guessed.
#[test]
fn samples_of_easy_handeye_are_read_in_both_mountings() {
    let text = |kind: &str, key: &str| {
        format!(
            "parameters:\n  name: ''\n  calibration_type: '{kind}'\nsamples:\n- robot: {{{QUARTER}}}\n  {key}: {{{NOTHING}}}\n- robot: {{{NOTHING}}}\n  {key}: {{{QUARTER}}}\n"
        )
    };
    let none = PoseListOptions::default();
    let hand = read("hand.samples", text("eye_in_hand", "tracking").as_bytes(), &none).unwrap();
    assert_eq!(hand.mounting, Some(Mounting::CameraOnGripper));
    is(&hand.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "hand");
    is(&hand.cam_from_target.unwrap()[1], ABOUT_Z, [1.0, 2.0, 3.0], "target");
    let base = read("base.samples", text("eye_on_base", "optical").as_bytes(), &none).unwrap();
    assert_eq!(base.mounting, Some(Mounting::TargetOnGripper));
    is(&base.poses[0].b_from_a.inverse(), ABOUT_Z, [1.0, 2.0, 3.0], "base");
    let to_hand = PoseListOptions { eye_to_hand: true, ..none };
    let open = text("", "tracking");
    assert!(read("open.samples", open.as_bytes(), &none).unwrap_err().contains("eye_in_hand or eye_on_base"));
    assert_eq!(read("open.samples", open.as_bytes(), &to_hand).unwrap(), base);
    let reason = read("both.samples", text("eye_in_hand", "tracking").as_bytes(), &to_hand).unwrap_err();
    assert!(reason.contains("leave one of them out"), "{reason}");
    let reason = read("word.samples", text("sideways", "tracking").as_bytes(), &none).unwrap_err();
    assert!(reason.contains("eye_on_base"), "{reason}");
}

#[test]
fn samples_of_moveit_are_read() {
    let quarter = "[0, -1, 0, 1, 1, 0, 0, 2, 0, 0, 1, 3, 0, 0, 0, 1]";
    let nothing = "[1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]";
    let text = format!(
        "- effector_wrt_world: {quarter}\n  object_wrt_sensor: {nothing}\n- effector_wrt_world: {nothing}\n  object_wrt_sensor: {quarter}\n"
    );
    let list = read("moveit.yaml", text.as_bytes(), &PoseListOptions::default()).unwrap();
    is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "effector");
    is(&list.cam_from_target.unwrap()[1], ABOUT_Z, [1.0, 2.0, 3.0], "object");
    assert_eq!(list.mounting, None);
    let inverse = PoseListOptions { is_inverse: true, ..PoseListOptions::default() };
    assert!(read("moveit.yaml", text.as_bytes(), &inverse).unwrap_err().contains("leave out the option"));
}

/// Messages of ROS, rows of a table as JSON, and poses by the name of their view.
#[test]
fn records_are_read_by_their_keys() {
    let none = PoseListOptions::default();
    let half = "0.7071067811865476";
    for (name, text) in [
        ("ros.json", format!("[{{\"view\": \"a\", \"position\": {{\"x\": 1, \"y\": 2, \"z\": 3}}, \"orientation\": {{\"x\": 0, \"y\": 0, \"z\": {half}, \"w\": {half}}}}}]")),
        ("rows.json", format!("[{{\"view\": \"a\", \"qw\": {half}, \"qx\": 0, \"qy\": 0, \"qz\": {half}, \"x_mm\": 1000, \"y_mm\": 2000, \"z_mm\": 3000}}]")),
        ("named.json", "{\"a\": [[0, -1, 0, 1], [1, 0, 0, 2], [0, 0, 1, 3], [0, 0, 0, 1]]}".to_owned()),
        ("inverse.json", "[{\"view\": \"a\", \"gripper_from_base\": [[0, 1, 0, -2], [-1, 0, 0, 1], [0, 0, 1, -3], [0, 0, 0, 1]]}]".to_owned()),
        ("words.json", "{\"rotation\": \"kuka\", \"poses\": {\"a\": {\"X\": 1000, \"Y\": 2000, \"Z\": 3000, \"A\": 90, \"B\": 0, \"C\": 0}}}".to_owned()),
        ("tf.yaml", format!("- view: a\n  transform: {{{QUARTER}}}\n")),
    ] {
        let list = read(name, text.as_bytes(), &none).unwrap();
        is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], name);
        assert_eq!(list.poses[0].view.as_deref(), Some("a"), "{name}");
    }
    let inverse = PoseListOptions { is_inverse: true, ..none };
    let text = "[{\"view\": \"a\", \"gripper_from_base\": [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]}]";
    assert!(read("twice.json", text.as_bytes(), &inverse).unwrap_err().contains("leave out the option"));
}

/// Programs of controllers state their convention by their spelling: a quarter turn about z, and one about x before or after it.
#[test]
fn programs_of_controllers_are_read_in_their_convention() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let ur = format!(
        "def calib():\n  movej(p[0.1, 0.2, 0.3, 0, 0, {quarter}], a=1)\n  movej(p[1, 0, 0, 0, 0, 0])\nend\n"
    );
    let kuka = "$TOOL={X 9,Y 9,Z 9,A 0,B 0,C 0}\nDECL E6POS XP1={X 100,Y 200,Z 300,A 90.0,B 0,C 90.0,S 2,T 10}\nDECL E6POS XP2={X 0,Y 0,Z 0,A 0,B 0,C 0}\n";
    let fanuc = "/POS\nP[1]{\n   GP1:\n\tUF : 0, UT : 1,\tCONFIG : 'N U T, 0, 0, 0',\n\tX =   100.000  mm,\tY =   200.000  mm,\tZ =   300.000  mm,\n\tW =    90.000 deg,\tP =     0.000 deg,\tR =    90.000 deg\n};\nP[2]{\n   GP1:\n\tX = 0 mm, Y = 0 mm, Z = 0 mm,\n\tW = 0 deg, P = 0 deg, R = 0 deg\n};\n";
    let half = std::f64::consts::FRAC_1_SQRT_2;
    let abb = format!(
        "MODULE Calib\n  CONST robtarget p10:=[[100,200,300],[{half},0,0,{half}],[0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\n  CONST robtarget p20 := [ [0, 0, 0], [1, 0, 0, 0], [0,0,0,0],[9E9,9E9,9E9,9E9,9E9,9E9]];\nENDMODULE\n"
    );
    let yaskawa = "/JOB\n//POS\n///PULSE\nC00000=1,2,3,4,5,6\n///RECTAN\n///RCONF 0,0,0,0,0,0,0,0\nC00001=100.000,200.000,300.000,90.0,0.0,90.0\nC00002=0,0,0,0,0,0\n";
    let none = PoseListOptions::default();
    for (name, text, r) in [
        ("a.script", ur.as_str(), ABOUT_Z),
        ("a.dat", kuka, Z_THEN_X),
        ("a.ls", fanuc, Z_THEN_X),
        ("a.mod", abb.as_str(), ABOUT_Z),
        ("a.jbi", yaskawa, Z_THEN_X),
    ] {
        let list = read(name, text.as_bytes(), &none).unwrap();
        assert_eq!(list.poses.len(), 2, "{name}");
        is(&list.poses[0].b_from_a, r, [0.1, 0.2, 0.3], name);
    }
    let reason = read("a.dat", kuka.as_bytes(), &word("staubli")).unwrap_err();
    assert!(reason.contains(":2: pose 1: is written in the convention `kuka`"), "{reason}");
    assert!(read("a.dat", kuka.as_bytes(), &word("kuka")).is_ok());
    let reason = read("a.dat", kuka.replace("A 90.0", "A inf").as_bytes(), &none).unwrap_err();
    assert!(reason.contains("finite"), "{reason}");
}

/// Brackets that never close cost no more than reading them: searching each to the end of a file of a megabyte would take hours.
#[test]
fn brackets_that_never_close_are_read_once() {
    for mark in ["{", "p[", ":=[[", "{ X = 1 ", "p[1,"] {
        let text = mark.repeat((1 << 20) / mark.len());
        assert!(read("a.txt", text.as_bytes(), &PoseListOptions::default()).is_err(), "{mark}");
    }
}

/// Pairs in the rows of one table, by what the columns map.
#[test]
fn columns_of_pairs_hold_both_poses() {
    let header = |robot: &str| {
        let matrix =
            |begin: &str| (0..12).map(|i| format!(",{begin}_m{}{}", i / 4, i % 4)).collect::<String>();
        format!("view{}{}\n", matrix(robot), matrix("cam_from_target"))
    };
    let rows = "a,0,-1,0,1,1,0,0,2,0,0,1,3,1,0,0,0.5,0,1,0,0,0,0,1,0\nb,1,0,0,0,0,1,0,0,0,0,1,0,1,0,0,0,0,1,0,0,0,0,1,0\n";
    let none = PoseListOptions::default();
    let list = read("pairs.csv", (header("base_from_gripper") + rows).as_bytes(), &none).unwrap();
    is(&list.poses[0].b_from_a, ABOUT_Z, [1.0, 2.0, 3.0], "robot");
    let seen = list.cam_from_target.unwrap();
    assert_eq!((seen.len(), seen[0].translation.x), (2, 0.5));
    let list = read("pairs.csv", (header("gripper_from_base") + rows).as_bytes(), &none).unwrap();
    is(&list.poses[0].b_from_a.inverse(), ABOUT_Z, [1.0, 2.0, 3.0], "inverse");
    let mixed = "view,base_from_gripper_X_mm,base_from_gripper_Y_mm,base_from_gripper_Z_mm,base_from_gripper_A,base_from_gripper_B,base_from_gripper_C,cam_from_target_x_m,cam_from_target_y_m,cam_from_target_z_m,cam_from_target_qx,cam_from_target_qy,cam_from_target_qz,cam_from_target_qw\na,1000,2000,3000,90,0,90,0.5,0,0,0,0,0,1\n";
    let list = read("pairs.csv", mixed.as_bytes(), &word("kuka")).unwrap();
    is(&list.poses[0].b_from_a, Z_THEN_X, [1.0, 2.0, 3.0], "kuka");
    let inverse = PoseListOptions { is_inverse: true, ..none };
    for (text, options, words) in [
        (header("base_from_gripper") + rows, inverse, "state their direction"),
        (header("robot") + rows, none, "need `base_from_gripper_…`"),
    ] {
        let reason = read("pairs.csv", text.as_bytes(), &options).unwrap_err();
        assert!(reason.contains(words), "{reason}");
    }
}

/// What the judges compute with other programs: the numbers of each convention, and our pose.
#[test]
fn rotations_for_the_judges() {
    let turns = [[0.3, -0.7, 1.1], [-1.9, 0.4, 0.25], [2.5, 1.2, -0.6]];
    let half = [[0.5, -0.5, 0.5, 0.5], [0.8, 0.0, -0.6, 0.0], [0.1, 0.7, -0.5, 0.5]];
    let mut text = String::from("word,n1,n2,n3,n4,r11,r12,r13,r21,r22,r23,r31,r32,r33,tx_m,ty_m,tz_m\n");
    for word in RotationWord::ALL {
        let numbers: Vec<Vec<f64>> = match word.format {
            RotationFormat::Angles(convention) => {
                let unit = if convention.unit == AngleUnit::Degrees { 64.0 } else { 1.0 };
                turns.iter().map(|turn| turn.iter().map(|x| x * unit).collect()).collect()
            }
            _ => half.iter().map(|q| q.to_vec()).collect(),
        };
        let rows: String = numbers
            .iter()
            .map(|n| format!("100 -200 300 {}\n", n.iter().map(f64::to_string).collect::<Vec<_>>().join(" ")))
            .collect();
        let options = PoseListOptions { rotation: Some(*word), ..PoseListOptions::default() };
        let list = read("judged.txt", rows.as_bytes(), &options).unwrap();
        for (n, pose) in numbers.iter().zip(&list.poses) {
            let (r, t) = (pose.b_from_a.rotation.transpose(), pose.b_from_a.translation);
            let fourth = n.get(3).map_or_else(String::new, f64::to_string);
            let cells = r.iter().chain(&t).map(|x| format!("{x:.15}")).collect::<Vec<_>>().join(",");
            text += &format!("{},{},{},{},{fourth},{cells}\n", word.word, n[0], n[1], n[2]);
        }
    }
    assert_golden("rotations", &[OutFile { name: "rotations.csv".into(), text }]);
}
