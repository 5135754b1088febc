//! Rigs in other programs' files: each is written, held to its golden, and read back to the same pixels.
//!
//! The goldens lie in testdata/formats/golden/rigs, one folder a format; scripts/judges lets the programs themselves
//! read them and project the points of `pixels.csv` there, which this file writes too.

use crate::support::{
    assert_golden, assert_same_rig, assert_says, between, cameras, example, golden, read_back, refusal,
    round_trip, seen_points,
};
use resight_formats::core::Target;
use resight_formats::{
    Field, Format, NamedCamera, OutFile, convert, read_cameras, read_cameras_from_bytes, read_field,
    read_rig, read_target, read_target_from_bytes, write_cameras, write_field_layout,
};
use std::path::Path;

/// What the judges project: camera, point in the world, our pixel.
#[test]
fn pixels_for_the_judges() {
    let mut text = String::from("rig,camera,x_m,y_m,z_m,u_px,v_px\n");
    for source in ["placed_rig", "placed_wide"] {
        let rig = cameras(&format!("{source}.toml"));
        for camera in &rig {
            let world_from_cam = between(&rig, "world", &camera.name);
            for (x_in_cam, pixel) in seen_points(camera) {
                let x = world_from_cam * x_in_cam;
                let name = &camera.name;
                text +=
                    &format!("{source},{name},{:?},{:?},{:?},{:?},{:?}\n", x.x, x.y, x.z, pixel.x, pixel.y);
            }
        }
    }
    assert_golden("pixels", &[OutFile { name: "pixels.csv".into(), text }]);
}

/// Every format that reads what it wrote keeps lenses and poses; what it has no place for is said.
#[test]
fn converted_and_read_back() {
    let mut rig = read_cameras(example("placed_rig.toml")).unwrap();
    rig.cameras.truncate(2);
    for (format, words) in [
        (Format::Colmap, &[][..]),
        (Format::Mrcal, &["frame `world`, which is `reference`"]),
        (Format::Aniposelib, &[]),
        (Format::Caliscope, &[]),
        (Format::Multical, &["frame `world`, which is `rig`"]),
        (Format::McCalib, &["name of camera `left`, which is `camera_0`"]),
        (Format::PhotonVision, &["pose"]),
        (Format::PhotonVisionOld, &["pose"]),
    ] {
        let conversion = convert(&rig, format, None).unwrap_or_else(|e| panic!("{format:?}: {e}"));
        assert!(conversion.checked, "{format:?}");
        let lost = conversion.lost.join("; ");
        assert_eq!(lost.is_empty(), words.is_empty(), "{format:?}: {lost}");
        assert_says(&lost, words);
    }
    for format in [Format::Blender, Format::Gltf] {
        assert!(!convert(&rig, format, Some("right")).unwrap().checked);
    }
}

/// `explain` says which way each file's poses go.
#[test]
fn explained_with_their_traps() {
    for (file, words) in [
        ("colmap/images.txt", &["COLMAP text model", "x_left = R x_world + t", "world → camera"][..]),
        (
            "multical_pair/calibration.json",
            &["`cam2_to_cam1` maps points of cam1 into cam2", "x_right = R x_left + t"],
        ),
        ("mccalib/calibrated_cameras_data.yml", &["x_group_0 = R x_camera_1 + t", "unit of the board"]),
        ("easy_handeye_hand/easy_handeye.yaml", &["x_world = R x_right + t", "optical frame"]),
        ("aniposelib/calibration.toml", &["aniposelib camera group", "cam_10 comes before cam_2"]),
    ] {
        assert_says(&resight_formats::explain(golden(file)).unwrap(), words);
    }
}

#[test]
fn mrcal_round_trips() {
    round_trip("placed_rig.toml", Format::Mrcal, "mrcal", &[]);
    assert_says(&refusal("placed_wide.toml", Format::Mrcal), &["front", "no kannala_brandt model"]);
    let mut odd = cameras("placed_rig.toml");
    odd[0].name = "../left".into();
    odd[0].placement.as_mut().unwrap().b = "../left".into();
    assert_says(&write_cameras(&odd, Format::Mrcal).unwrap_err().0, &["`../left` is no file name"]);
}

/// Eleven cameras: aniposelib loads the tables in the order of their sorted names, which must be ours.
#[test]
fn aniposelib_round_trips_in_order() {
    round_trip("placed_rig.toml", Format::Aniposelib, "aniposelib", &[]);
    let first = cameras("placed_rig.toml").remove(0);
    let many: Vec<NamedCamera> = (0..11)
        .map(|i| {
            let mut camera = first.clone();
            camera.name = format!("c{i}");
            camera.placement.as_mut().unwrap().b = camera.name.clone();
            camera
        })
        .collect();
    let text = &write_cameras(&many, Format::Aniposelib).unwrap()[0].text;
    let mut tables: Vec<&str> = text.lines().filter(|l| l.starts_with("[cam_")).collect();
    let ours = tables.clone();
    tables.sort();
    assert_eq!(tables, ours);
    let file = read_cameras_from_bytes(Path::new("x"), text.clone().into_bytes()).unwrap();
    assert_eq!(file.format, Format::Aniposelib);
    assert_eq!(file.cameras[10].name, "c10");
    let [one_place, one_lens] = &file.warnings[..] else { panic!("{:?}", file.warnings) };
    assert_says(one_place, &["cameras c0 and c1 stand in one place"]);
    assert_says(one_lens, &["cameras c0 and c1 have one lens"]);
    let unpadded = text.replace("[cam_0", "[cam_");
    let file = read_cameras_from_bytes(Path::new("x"), unpadded.into_bytes()).unwrap();
    assert_says(&file.warnings.join(" "), &["cam_0, cam_1, cam_10, cam_2", "not the order of the file"]);
}

#[test]
fn caliscope_round_trips() {
    round_trip("placed_rig.toml", Format::Caliscope, "caliscope", &[]);
    let array = cameras("caliscope.toml");
    let text = &write_cameras(&array, Format::Caliscope).unwrap()[0].text;
    assert_says(text, &["[cameras.2]", "[cameras.10]", "fisheye = true"]);
    let back = read_cameras_from_bytes(Path::new("x"), text.clone().into_bytes()).unwrap();
    assert_same_rig(&back.cameras, &array, &[]);
    assert_says(&refusal("placed_wide.toml", Format::Caliscope), &["back", "no fov model"]);
}

/// A fisheye beside an ordinary lens.
#[test]
fn fisheyes_round_trip_where_the_format_has_them() {
    let all = cameras("placed_wide.toml");
    let mut pair = vec![all[0].clone(), all[3].clone()];
    let p = pair[1].placement.as_mut().unwrap();
    (p.a, p.b_from_a) = ("world".into(), between(&all, "plain", "world"));
    let numbers = [("front", "camera_0"), ("plain", "camera_1")];
    for (format, folder, names) in [
        (Format::Caliscope, "caliscope_wide", &[][..]),
        (Format::Aniposelib, "aniposelib_wide", &[]),
        (Format::McCalib, "mccalib_wide", &numbers),
    ] {
        assert_golden(folder, &write_cameras(&pair, format).unwrap());
        assert_same_rig(&read_back(folder).cameras, &pair, names);
    }
}

#[test]
fn multical_round_trips() {
    round_trip("placed_rig.toml", Format::Multical, "multical", &[]);
    assert_says(&refusal("placed_wide.toml", Format::Multical), &["front", "no kannala_brandt model"]);
}

/// `right_to_left` holds left's points in right; the master's identity is no other frame.
#[test]
fn multical_pairs_map_against_the_reading_of_their_name() {
    let mut pair = cameras("placed_rig.toml");
    pair.truncate(2);
    let right_from_left = between(&pair, "right", "left");
    pair[0].placement = None;
    let right = pair[1].placement.as_mut().unwrap();
    (right.a, right.b_from_a) = ("left".into(), right_from_left);
    let files = write_cameras(&pair, Format::Multical).unwrap();
    assert_golden("multical_pair", &files);
    assert_says(&files[0].text, &["\"right_to_left\"", "\"left\": { \"R\": [[1.0, 0.0, 0.0]"]);
    let read = read_back("multical_pair").cameras;
    assert_eq!(read[0].placement, None);
    assert_eq!(read[1].placement.as_ref().unwrap().a, "left");
    assert_same_rig(&read, &pair, &[]);
    let bad = files[0].text.replace("right_to_left", "right_to_middle");
    let refusal = read_cameras_from_bytes(Path::new("m.json"), bad.into_bytes()).unwrap_err().to_string();
    assert_says(&refusal, &["m.json:", "camera_poses.right_to_middle", "left, right"]);
}

#[test]
fn mccalib_round_trips() {
    let mut rig = cameras("placed_rig.toml");
    rig.truncate(2);
    let files = write_cameras(&rig, Format::McCalib).unwrap();
    assert_golden("mccalib", &files);
    let read = read_back("mccalib").cameras;
    assert_same_rig(&read, &rig, &[("left", "camera_0"), ("right", "camera_1")]);
    let p = read[1].placement.as_ref().unwrap();
    assert_eq!((p.b.as_str(), p.a.as_str()), ("group_0", "camera_1"));
    assert_says(&refusal("placed_rig.toml", Format::McCalib), &["tele", "k1, k2, p1, p2, k3 only"]);
}

/// The camera's intrinsics are in another file; read together they are the rig again.
#[test]
fn easy_handeye_round_trips_with_the_intrinsics_beside() {
    let right = cameras("placed_rig.toml").remove(1);
    for (format, folder, key) in [
        (Format::EasyHandeyeOnBase, "easy_handeye_base", "robot_base_frame: \"world\""),
        (Format::EasyHandeyeOnHand, "easy_handeye_hand", "robot_effector_frame: \"world\""),
    ] {
        let files = write_cameras(std::slice::from_ref(&right), format).unwrap();
        assert_golden(folder, &files);
        assert_says(&files[0].text, &[key]);
        let mut unplaced = right.clone();
        unplaced.placement = None;
        let intrinsics = &write_cameras(&[unplaced.clone()], Format::Own).unwrap()[0].text;
        let beside =
            std::env::temp_dir().join(format!("resight-handeye-{}-{folder}.toml", std::process::id()));
        std::fs::write(&beside, intrinsics).unwrap();
        let read = read_rig(&[beside.clone(), golden(folder).join("easy_handeye.yaml")]).unwrap();
        std::fs::remove_file(&beside).unwrap();
        let p = read.cameras[0].placement.as_ref().unwrap();
        assert_eq!((p.b.as_str(), p.a.as_str()), ("world", "right"));
        assert_same_rig(&read.cameras, std::slice::from_ref(&right), &[]);
        assert_says(&write_cameras(&[unplaced], format).unwrap_err().0, &["right", "no pose"]);
    }
    let text = std::fs::read_to_string(golden("easy_handeye_hand").join("easy_handeye.yaml")).unwrap();
    let refused = |from: &str, to: &str| {
        let bytes = text.replace(from, to).into_bytes();
        read_cameras_from_bytes(Path::new("h.yaml"), bytes).unwrap_err().to_string()
    };
    assert_says(&refused("qw: ", "qw: 1"), &["h.yaml:", "transformation", "length"]);
    assert_says(&refused("  robot_effector_frame: \"world\"", "  robot_effector_frame: \"\""), &["is empty"]);
    assert_says(&refused("nothing", ""), &["poses only"]);
}

#[test]
fn photonvision_round_trips_in_both_shapes() {
    let rig = cameras("placed_rig.toml");
    for (format, folder) in
        [(Format::PhotonVision, "photonvision"), (Format::PhotonVisionOld, "photonvision_old")]
    {
        let mut unplaced = rig.clone();
        unplaced.iter_mut().for_each(|c| c.placement = None);
        let files = write_cameras(&unplaced, format).unwrap();
        assert_golden(folder, &files);
        for (file, camera) in files.iter().zip(&unplaced) {
            let read = read_cameras(golden(folder).join(&file.name)).unwrap().cameras;
            assert_eq!((&read[0].name, &read[0].camera), (&camera.name, &camera.camera));
        }
    }
    assert_says(&refusal("placed_wide.toml", Format::PhotonVision), &["no kannala_brandt model"]);
}

#[test]
fn fspy_blender_and_gltf_are_written() {
    let mut right = cameras("placed_rig.toml").remove(1);
    assert_golden("fspy", &write_cameras(&[right.clone()], Format::FSpy).unwrap());
    assert_golden("blender", &write_cameras(&cameras("placed_rig.toml"), Format::Blender).unwrap());
    assert_golden("gltf", &write_cameras(&cameras("placed_rig.toml"), Format::Gltf).unwrap());
    assert_golden("gltf_wide", &write_cameras(&cameras("placed_wide.toml"), Format::Gltf).unwrap());
    assert_says(&refusal("placed_rig.toml", Format::FSpy), &["one camera, not 3"]);
    assert_says(&refusal("placed_wide.toml", Format::Blender), &["front", "kannala_brandt", "undistort"]);
    right.name = "other".into();
    assert!(write_cameras(&[right.clone()], Format::Blender).is_err());
    right.placement = None;
    assert!(write_cameras(&[right], Format::Gltf).unwrap()[0].text.contains("\"other\""));
}

#[test]
fn wpilib_layouts_round_trip_in_both_spellings() {
    for (source, folder, keys_of_2027) in
        [("wpilib_2024.json", "wpilib", false), ("wpilib_2027.json", "wpilib_2027", true)]
    {
        let target = read_target(example(source)).unwrap().target;
        let field = read_field(&example(source)).unwrap();
        assert_eq!(field, Field { length_m: 16.541, width_m: 8.211, keys_of_2027 });
        let file = write_field_layout(&target, &field).unwrap();
        assert_golden(folder, std::slice::from_ref(&file));
        assert_same_tags(&read_target(golden(folder).join(&file.name)).unwrap().target, &target);
        assert_eq!(read_field(&golden(folder).join(&file.name)).unwrap(), field);
    }
}

#[track_caller]
fn assert_same_tags(a: &Target, b: &Target) {
    let (Target::TagMap(a), Target::TagMap(b)) = (a, b) else { panic!("{a:?}") };
    assert_eq!((&a.family, a.tags.len()), (&b.family, b.tags.len()));
    for (s, t) in a.tags.iter().zip(&b.tags) {
        assert_eq!((s.id, s.size_m), (t.id, t.size_m));
        assert!(s.world_from_tag.angle_to_rad(&t.world_from_tag) < 1e-12);
        assert!((s.world_from_tag.translation - t.world_from_tag.translation).norm() < 1e-12);
    }
}

#[test]
fn wpilib_layouts_refuse_what_they_cannot_hold() {
    let field = Field { length_m: 3.0, width_m: 2.0, keys_of_2027: false };
    let refused = |target: &str, field: &Field| {
        write_field_layout(&read_target(example(target)).unwrap().target, field).unwrap_err().0
    };
    assert_says(&refused("target_tag.toml", &field), &["kind `tag`"]);
    assert_says(&refused("target_tag_map.toml", &field), &["tag 1 is 0.1 m", "0.1651"]);
    assert_says(&refused("wpilib_2024.json", &Field { width_m: 0.0, ..field }), &["3 m by 0 m"]);
    // Another family and size travel under keys of our own.
    let Target::TagMap(mut map) = read_target(example("wpilib_2024.json")).unwrap().target else { panic!() };
    map.family = "tag25h9".into();
    map.tags.iter_mut().for_each(|t| t.size_m = 0.08);
    let target = Target::TagMap(map);
    let file = write_field_layout(&target, &field).unwrap();
    assert_golden("wpilib_own", std::slice::from_ref(&file));
    let back = read_target_from_bytes(Path::new("x.json"), file.text.into_bytes()).unwrap();
    assert!(back.warnings.is_empty());
    assert_same_tags(&back.target, &target);
}
