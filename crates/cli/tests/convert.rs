//! `convert`: what it prints, what it writes, what it refuses, with which exit status.

use crate::support::{Run, folder, json_lines, matches_golden, resight};
use std::path::Path;

fn example(name: &str) -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../testdata/formats").join(name).display().to_string()
}

fn refused(run: &Run, code: i32, wanted: &str) {
    assert_eq!((run.code, run.stdout.as_str()), (code, ""), "{wanted}: {}", run.stderr);
    assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
}

/// Three files in, one out: intrinsics of two cameras, their poses from the robot's description.
#[test]
fn lenses_and_a_robot_become_one_chain() {
    let folder = folder("convert_chain");
    let lens = std::fs::read_to_string(example("ros_plumb_bob.yaml")).unwrap();
    let name = lens.lines().find(|l| l.starts_with("camera_name")).unwrap();
    let mut files = Vec::new();
    for camera in ["left", "right"] {
        let path = folder.join(format!("{camera}.yaml"));
        std::fs::write(&path, lens.replace(name, &format!("camera_name: {camera}"))).unwrap();
        files.push(path.display().to_string());
    }
    let out = folder.join("camchain.yaml").display().to_string();
    let robot = example("robot.urdf");
    let run = resight(&[
        "convert",
        &files[0],
        &files[1],
        &robot,
        "--to",
        "kalibr",
        "--reference",
        "left",
        "-o",
        &out,
    ]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    for said in [
        "Cameras in frame `left` (x right, y down, z forward), metres:",
        "2 right   at (0.1200, 0.0000, 0.0000)   looks along (0.0000, 0.0000, 1.0000), 0.0° off that frame's +z axis",
        "read back and compared with what was meant",
        "camchain.yaml",
    ] {
        assert!(run.stdout.contains(said), "`{said}` is not in:\n{}", run.stdout);
    }
    for warned in [
        "warning: line 20: joint wheel is continuous",
        "warning: not kept: the name of camera `left`, which is `cam0` there",
        "warning: not kept: frame `mast`",
    ] {
        assert!(run.stderr.contains(warned), "`{warned}` is not in:\n{}", run.stderr);
    }
    let chain = std::fs::read_to_string(&out).unwrap();
    assert!(chain.contains("T_cn_cnm1"), "{chain}");
}

#[test]
fn several_files_make_a_folder_and_json_names_them() {
    let out = folder("convert_nuscenes").join("tables").display().to_string();
    let run = resight(&[
        "convert",
        &example("kitti_object.txt"),
        "--to",
        "nuscenes",
        "-o",
        &out,
        "--json",
        "--quiet",
    ]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""), "{}", run.stderr);
    let report = &json_lines(&run)[0];
    assert_eq!(report["reference"], "rect");
    assert_eq!(report["checked"], true);
    let files: Vec<&str> = report["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
    assert!(files[0].ends_with("calibrated_sensor.json") && files[1].ends_with("sensor.json"), "{files:?}");
    assert!(files.iter().all(|f| Path::new(f).is_file()));
    let centre = &report["cameras"]["cam1"]["centre_m"];
    assert!((centre[0].as_f64().unwrap() - 0.54).abs() < 1e-12, "{centre}");
    assert_eq!(report["cameras"]["cam1"]["looks_along"][2], 1.0);
    assert!(report["lost"].as_array().unwrap().iter().any(|l| l.as_str().unwrap().contains("`rect`")));
}

#[test]
fn a_size_that_the_file_lacks_can_be_given() {
    let out = folder("convert_size").join("infos");
    let (stereo, path) = (example("opencv_stereo.yml"), out.display().to_string());
    let ros = ["convert", &stereo, "--to", "ros", "-o", &path];
    refused(&resight(&ros), 1, "camera_info needs the image size");
    let sized = resight(&[&ros[..], &["--image-size-px", "640x480"]].concat());
    assert_eq!(sized.code, 0, "{}", sized.stderr);
    let text = std::fs::read_to_string(out.join("M1.yaml")).unwrap();
    assert!(text.contains("image_width: 640"), "{text}");
}

#[test]
fn what_cannot_be_done_is_refused_before_anything_is_written() {
    let folder = folder("convert_refused");
    let path = |name: &str| folder.join(name).display().to_string();
    let (chain, stereo) = (example("kalibr_camchain.yaml"), example("opencv_stereo.yml"));
    let convert = |file: &str, to: &str, out: &str| resight(&["convert", file, "--to", to, "-o", out]);
    refused(&convert(&stereo, "kalbir", &path("x")), 2, "did you mean `kalibr`?");
    refused(&convert(&chain, "opencv", &path("x")), 1, "OpenCV FileStorage cannot hold this: ");
    refused(&convert(&example("absent.yaml"), "ros", &path("x")), 2, "no such file");
    refused(&convert(&example("robot.urdf"), "kalibr", &path("x")), 2, "poses only, no intrinsics");
    refused(&convert(&stereo, "tf", &path("none/x.py")), 2, "make it first");
    let reference = ["convert", &stereo, "--to", "tf", "-o", &path("x"), "--reference", "M3"];
    refused(&resight(&reference), 2, "no frame `M3`; there are M1, M2");
    std::fs::copy(&stereo, path("own.yml")).unwrap();
    refused(
        &convert(&path("own.yml"), "opencv", &path("own.yml")),
        2,
        "would replace the file it is made from",
    );
    let left: Vec<_> = std::fs::read_dir(&folder).unwrap().collect();
    assert_eq!(left.len(), 1, "{left:?}");
}

#[test]
fn the_sketch_of_a_stereo_pair() {
    let out = folder("convert_sketch").join("stereo.xml").display().to_string();
    let run =
        resight(&["convert", &example("opencv_stereo.yml"), "--to", "opencv-xml", "-o", &out, "--quiet"]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    matches_golden("convert_stereo.txt", &run.stdout.replace(&out, "stereo.xml"));
}

/// A field layout in the other spelling and back is the file it was; a map that states no field needs its size.
#[test]
fn a_field_layout_changes_its_spelling_and_comes_back() {
    let folder = folder("convert_layout");
    let classic = example("golden/rigs/wpilib/field_layout.json");
    let (new, back) = (folder.join("2027.json"), folder.join("back.json"));
    for (input, to, out) in [(classic.clone(), "wpilib-2027", &new), (path(&new), "wpilib", &back)] {
        let run = resight(&["convert", &input, "--to", to, "-o", &path(out)]);
        assert_eq!(run.code, 0, "{}", run.stderr);
    }
    assert!(std::fs::read_to_string(&new).unwrap().contains("field-tags"));
    assert_eq!(std::fs::read_to_string(&back).unwrap(), std::fs::read_to_string(&classic).unwrap());
    let map = folder.join("map.toml");
    let pose = "{ rotation_wxyz = [1.0, 0.0, 0.0, 0.0], translation_m = [1.0, 2.0, 0.5] }";
    let text = format!(
        "kind = \"tag_map\"\nfamily = \"tag36h11\"\n[[tag]]\nid = 3\nsize_m = 0.1651\nworld_from_tag = {pose}\n"
    );
    std::fs::write(&map, text).unwrap();
    let out = path(&folder.join("map.json"));
    refused(&resight(&["convert", &path(&map), "--to", "wpilib", "-o", &out]), 2, "--field-size-m");
    let run = resight(&["convert", &path(&map), "--to", "wpilib", "--field-size-m", "16.5x8", "-o", &out]);
    assert!(run.code == 0 && std::fs::read_to_string(&out).unwrap().contains("16.5"), "{}", run.stderr);
}

fn path(path: &Path) -> String {
    path.display().to_string()
}
