//! `compare` on simulated rigs of which something moved suddenly, and on poses.

use crate::rig_support::*;
use crate::support::{Run, data, folder, json_lines, resight, same};
use resight::core::{Pose, Vector6};
use serde_json::Value;
use std::path::Path;

fn compare(a: &str, b: &str, extra: &[&str]) -> Run {
    resight(&[&["compare", a, b], extra].concat())
}

fn write(folder: &Path, name: &str, text: &str) -> String {
    let path = folder.join(name);
    std::fs::write(&path, text).unwrap();
    path.display().to_string()
}

/// A camera as our own file writes it; 1 mm and 0.5 mrad unless it is the reference.
fn camera_text(name: &str, cam_from_rig: &Pose, is_reference: bool, has_covariances: bool) -> String {
    let variance = |i: usize| {
        if is_reference {
            0.0
        } else if i < 3 {
            2.5e-7
        } else {
            1e-6
        }
    };
    let cell = |i: usize, j: usize| {
        if i == j { format!("{:e}", variance(i)).replace('e', ".0e") } else { "0.0".into() }
    };
    let row = |i: usize| format!("[{}]", (0..6).map(|j| cell(i, j)).collect::<Vec<_>>().join(", "));
    let rows: Vec<String> = (0..6).map(row).collect();
    let covariance = if has_covariances {
        format!("covariance = [{}]\n", rows.join(", ")).replace("2.5.0e", "2.5e")
    } else {
        String::new()
    };
    format!(
        "[[camera]]\nname = \"{name}\"\nmodel = \"pinhole\"\nwidth_px = 640\nheight_px = 480\nfx_px = 600.0\nfy_px = 600.0\ncx_px = 319.5\ncy_px = 239.5\n[camera.placement]\nb = \"{name}\"\na = \"rig\"\nrotation_wxyz = {:?}\ntranslation_m = {:?}\n{covariance}\n",
        cam_from_rig.quaternion_wxyz(),
        <[f64; 3]>::from(cam_from_rig.translation)
    )
}

/// The rig of the simulation, one camera moved suddenly, expressed in the frame of `reference`.
fn rig_text(knocked: Option<&str>, reference: &str, has_covariances: bool) -> String {
    // 12 mm to its right and 0.5° about its y axis.
    let old_from_new = Pose::exp(&Vector6::new(0.0, 0.5f64.to_radians(), 0.0, 0.012, 0.0, 0.0));
    let place = |(name, pose): (&'static str, Pose)| match Some(name) == knocked {
        true => (name, old_from_new.inverse() * pose),
        false => (name, pose),
    };
    let places: Vec<(&str, Pose)> = cameras().into_iter().map(place).collect();
    let rig_from_old = places.iter().find(|(name, _)| *name == reference).unwrap().1.inverse();
    places
        .iter()
        .map(|(name, pose)| camera_text(name, &(*pose * rig_from_old), *name == reference, has_covariances))
        .collect()
}

#[test]
fn whichever_camera_was_knocked_is_named() {
    let folder = folder("compare_knocked");
    let before = write(&folder, "before.toml", &rig_text(None, "left", true));
    for knocked in ["left", "middle", "right"] {
        let after = write(&folder, "after.toml", &rig_text(Some(knocked), "left", true));
        let run = compare(&before, &after, &["--json"]);
        let answer = &json_lines(&run)[0];
        assert_eq!((run.code, &answer["verdict"], &answer["kind"]), (3, &"moved".into(), &"rigs".into()));
        let moved = answer["moved"].as_array().unwrap();
        assert_eq!((moved.len(), &moved[0]["camera"]), (1, &knocked.into()), "{answer}");
        // To three of the standard deviations stated.
        let near = |key: &str, sigma: &str, truth: f64| {
            let off = (moved[0][key].as_f64().unwrap() - truth).abs();
            assert!(off < 3.0 * moved[0][sigma].as_f64().unwrap(), "{key}: {}", moved[0]);
        };
        near("moved_m", "moved_sigma_m", 0.012);
        near("rotation_rad", "rotation_sigma_rad", 0.5f64.to_radians());
        assert!(moved[0]["p"].as_f64().unwrap() < 1e-3 && moved[0]["degrees_of_freedom"] == 6);
        let words = compare(&before, &after, &[]).stdout;
        let named = format!("{knocked} moved");
        let said = ["MOVED   3 cameras compared", &named, "right 12", "to the right", "stayed"];
        assert!(said.iter().all(|text| words.contains(*text)), "{words}");
    }
}

/// The same rig in the frame of another camera has not moved.
#[test]
fn another_reference_is_no_motion() {
    let folder = folder("compare_gauge");
    let a = write(&folder, "a.toml", &rig_text(None, "left", true));
    let b = write(&folder, "b.toml", &rig_text(None, "right", true));
    let run = compare(&a, &b, &["--json"]);
    assert_eq!((run.code, &json_lines(&run)[0]["verdict"]), (0, &"unmoved".into()));
    assert!(compare(&a, &b, &[]).stdout.contains("Nothing moved"));
}

#[test]
fn of_two_cameras_nobody_can_say_which() {
    let folder = folder("compare_two");
    let without_middle = |text: String| -> String {
        text.split("[[camera]]").filter(|t| !t.contains("middle")).collect::<Vec<_>>().join("[[camera]]")
    };
    let a = write(&folder, "a.toml", &without_middle(rig_text(None, "left", true)));
    let b = write(&folder, "b.toml", &without_middle(rig_text(Some("right"), "left", true)));
    let run = compare(&a, &b, &["--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!((run.code, &answer["verdict"]), (3, &"undecided".into()));
    assert!(answer["message"].as_str().unwrap().contains("which is not decided"), "{answer}");
    let three = write(&folder, "c.toml", &rig_text(None, "left", true));
    let answer = &json_lines(&compare(&a, &three, &["--json"]))[0];
    assert_eq!(
        (&answer["verdict"], &answer["only_in_b"]),
        (&"unmoved".into(), &serde_json::json!(["middle"]))
    );
}

#[test]
fn files_without_covariance_ask_for_sigmas() {
    let folder = folder("compare_unsure");
    let a = write(&folder, "a.toml", &rig_text(None, "left", false));
    let b = write(&folder, "b.toml", &rig_text(Some("left"), "left", false));
    let run = compare(&a, &b, &[]);
    assert!(run.code == 2 && run.stderr.contains("--sigma-mm 0.5 --sigma-deg 0.02"), "{}", run.stderr);
    assert_eq!(compare(&a, &b, &["--sigma-mm", "1"]).code, 2, "one without the other");
    let sure = compare(&a, &b, &["--sigma-mm", "0.5", "--sigma-deg", "0.03", "--json"]);
    assert_eq!((sure.code, &json_lines(&sure)[0]["moved"][0]["camera"]), (3, &"left".into()));
    assert_eq!(compare(&a, &b, &["--sigma-mm", "50", "--sigma-deg", "3"]).code, 0);
}

/// From points to verdict: two recordings, the reference moved suddenly in between, with the covariance of all cameras together.
#[test]
fn two_recordings_say_that_the_reference_was_knocked() {
    let folder = folder("compare_recordings");
    let arguments = camera_arguments(&folder);
    let solved = |name: &str, seed: u64, knock: Option<Pose>| {
        let mut rows = recording(seed);
        if let Some(old_from_new) = knock {
            // What the left camera saw, seen from its new place.
            let place = |s: &Observed| old_from_new.inverse() * lens_point(s, seed);
            rows.iter_mut()
                .filter(|s| s.camera == "left")
                .for_each(|s| s.pixel = lens().project(&place(s)).unwrap());
        }
        let points = write(&folder, &format!("{name}.csv"), &csv(&rows));
        let mut all =
            vec!["rig", "--detections", &points, "--sigma-px", "0.2", "--json", "--joint-covariance", "-q"];
        all.extend(arguments.iter().map(String::as_str));
        write(&folder, &format!("{name}.json"), &resight(&all).stdout)
    };
    let monday = solved("monday", 31, None);
    let same = compare(&monday, &solved("tuesday", 32, None), &["--json"]);
    assert_eq!((same.code, &json_lines(&same)[0]["joint_covariance"]), (0, &true.into()), "{}", same.stdout);
    let knock = Pose::exp(&Vector6::new(0.0, 0.0, 0.01, 0.0, 0.005, 0.0));
    let answer = compare(&monday, &solved("wednesday", 33, Some(knock)), &["--json"]);
    let moved = &json_lines(&answer)[0]["moved"];
    assert_eq!(
        (answer.code, moved[0]["camera"].as_str(), moved[1].is_null()),
        (3, Some("left"), true),
        "{moved}"
    );
    let found = pose_of(&moved[0]["old_from_new"]);
    assert!(distance2(&found, &knock, &moved[0]["covariance"]) < 27.9, "{moved}");
}

/// The true place of a point in the left camera, from the seed of its recording.
fn lens_point(seen: &Observed, seed: u64) -> resight::core::Point {
    let mut chance = Chance(seed);
    for view in 0.. {
        let rig_from_target = rig_from_board(view, &mut chance);
        if view == seen.view {
            return rig_from_target * seen.x;
        }
        // Two normal numbers a point and camera, two uniform ones each.
        (0..4 * board().len() * cameras().len()).for_each(|_| {
            chance.uniform();
        });
    }
    unreachable!()
}

#[test]
fn poses_of_a_view_are_compared() {
    let folder = folder("compare_poses");
    let run = resight(&["solve", &data("points.csv"), "--camera", &data("camera.toml"), "--json"]);
    let before = write(&folder, "before.jsonl", &run.stdout);
    let run = compare(&before, &before, &["--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(
        json_lines(&run).iter().all(|a| a["verdict"] == "unmoved" && a["chi2"].as_f64().unwrap() < 1e-12)
    );
    // The first view's camera 0.2 m to the side.
    let mut lines =
        json_lines(&resight(&["solve", &data("points.csv"), "--camera", &data("camera.toml"), "--json"]));
    let translation = &mut lines[0]["cam_from_target"]["translation_m"];
    translation[0] = Value::from(translation[0].as_f64().unwrap() + 0.2);
    let text: String = lines.iter().map(|l| format!("{l}\n")).collect();
    let after = write(&folder, "after.jsonl", &text);
    let run = compare(&before, &after, &["--json"]);
    let answers = json_lines(&run);
    assert_eq!((run.code, answers.len()), (3, lines.len()));
    assert_eq!((&answers[0]["verdict"], &answers[1]["verdict"]), (&"moved".into(), &"unmoved".into()));
    assert!((answers[0]["moved_m"].as_f64().unwrap() - 0.2).abs() < 1e-9);
}

#[test]
fn what_is_no_pair_is_refused() {
    let folder = folder("compare_refused");
    let rig = write(&folder, "rig.toml", &rig_text(None, "left", true));
    let solved = resight(&["solve", &data("points.csv"), "--camera", &data("camera.toml"), "--json"]);
    let poses = write(&folder, "poses.jsonl", &solved.stdout);
    let other = write(&folder, "other.jsonl", &solved.stdout.replace("\"view\":\"", "\"view\":\"x"));
    let refused =
        write(&folder, "refused.json", "{\"status\":\"not_connected\",\"message\":\"nothing connects\"}\n");
    let renamed = write(
        &folder,
        "renamed.toml",
        &rig_text(None, "left", true).replace("left", "port").replace("right", "starboard"),
    );
    for (a, b, extra, wanted) in [
        (&rig, &poses, vec![], "compare two of a kind"),
        (&poses, &other, vec![], "views are matched by name"),
        (&rig, &refused, vec![], "holds no rig and no poses: nothing connects"),
        (&rig, &renamed, vec![], "the files share 1 camera(s)"),
        (&rig, &data("camera.toml"), vec![], "states no poses, only intrinsics"),
        (&rig, &rig, vec!["--alpha", "2"], "a chance between 0 and 1"),
        (&rig, &"rig.tml".to_string(), vec![], "no such file"),
    ] {
        let run = compare(a, b, &extra);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}: {}", run.stderr);
        assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
    }
    assert!(resight(&["compare", "--help"]).stdout.contains("Examples:"));
}

/// The page shows what the program says.
#[test]
fn the_page_shows_a_real_answer() {
    let folder = folder("compare_page");
    let before = write(&folder, "before.toml", &rig_text(None, "left", true));
    let after = write(&folder, "after.toml", &rig_text(Some("right"), "left", true));
    let page =
        std::fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join("../../docs/compare.md")).unwrap();
    let shown = page.split("```text\n").nth(1).unwrap().split("```").next().unwrap();
    let said = compare(&before, &after, &[]).stdout;
    assert!(same(&said, shown), "said\n{said}\nshown\n{shown}");
}

/// Comparisons of every kind of rig file in which nothing moved: the cameras share the error of the one whose frame is the rig's, as calibrations do. With
/// the joint covariance alarms are as frequent as stated, without it rarer.
#[test]
fn files_in_which_nothing_moved_raise_no_alarm() {
    use nalgebra::DMatrix;
    use resight::core::camera::ImageSize;
    use resight::core::temporal::compare::{RigPoses, compare_rigs};
    use resight::core::{Camera, Matrix6};
    use resight::formats::{JointCovariance, NamedCamera, Placement, own_rig_file, read_cameras_from_bytes};
    use resight::rig::places::{PlacedRig, placed};
    let size = Some(ImageSize { width_px: 640, height_px: 480 });
    let names: Vec<String> = cameras().iter().map(|(name, _)| name.to_string()).collect();
    let truth: Vec<Pose> = cameras().into_iter().map(|(_, pose)| pose).collect();
    let sigma = Vector6::new(5e-4, 5e-4, 5e-4, 1e-3, 1e-3, 1e-3);
    let own = Matrix6::from_diagonal(&sigma.component_mul(&sigma));
    let joint = DMatrix::from_fn(18, 18, |i, j| {
        let carried = |i: usize| truth[i / 6].adjoint();
        let shared = (carried(i) * own * carried(j).transpose())[(i % 6, j % 6)] * 2.0;
        let alone = if i / 6 == j / 6 { own[(i % 6, j % 6)] } else { 0.0 };
        if i < 6 || j < 6 { 0.0 } else { shared + alone }
    });
    let read = |chance: &mut Chance, with_joint: bool| -> RigPoses {
        let mut drawn = || Vector6::from_fn(|i, _| sigma[i] * chance.normal());
        let common = drawn() * 2f64.sqrt();
        let camera = |i: usize| {
            let noise = if i == 0 { Vector6::zeros() } else { drawn() + truth[i].adjoint() * common };
            let covariance = Some(joint.fixed_view::<6, 6>(6 * i, 6 * i).into());
            let (b, a, b_from_a) = (names[i].clone(), "rig".to_string(), truth[i].moved(&noise));
            let placement = Some(Placement { b, a, b_from_a, covariance });
            NamedCamera {
                name: names[i].clone(),
                camera: Camera { size, ..lens() },
                placement,
                intrinsics_covariance: None,
            }
        };
        let all: Vec<NamedCamera> = (0..3).map(camera).collect();
        let text = own_rig_file(&all, with_joint.then(|| JointCovariance::of(&names, &joint))).unwrap();
        let file = read_cameras_from_bytes(Path::new("rig.toml"), text.into_bytes()).unwrap();
        let cameras = placed(&file.cameras).unwrap();
        let rig = match &file.joint {
            Some(joint) => PlacedRig::with_joint(cameras, &joint.cameras, &joint.rows()).unwrap(),
            None => PlacedRig { cameras, joint: None, noise_degrees_of_freedom: None },
        };
        rig.places(&names, None).unwrap()
    };
    let n_trials = 1000;
    for (before, after) in [(true, true), (true, false), (false, false)] {
        let mut chance = Chance(77);
        let (mut often, mut seldom) = (0, 0);
        for _ in 0..n_trials {
            let both = (read(&mut chance, before), read(&mut chance, after));
            let alarms =
                |level: f64| usize::from(!compare_rigs(&both.0, &both.1, level).unwrap().moved.is_empty());
            often += alarms(0.05);
            seldom += alarms(1e-3);
        }
        println!(
            "joint covariance {before} {after}: {often} alarms at 0.05, {seldom} at 0.001 of {n_trials}"
        );
        // 25 to 50 of 1000 by the rule that splits the chance; 3.3 standard deviations.
        assert!(often <= 73 && seldom <= 5, "{often} {seldom}");
        assert!(!(before && after) || 9 <= often, "{often}");
    }
}

/// A thousand views in which nothing moved, through the program: chances are uniform, and at most as many alarms as stated.
#[test]
fn views_in_which_nothing_moved_raise_no_alarm() {
    let folder = folder("compare_null_views");
    let mut chance = Chance(78);
    let sigma = [5e-4, 4e-4, 6e-4, 1e-3, 2e-3, 5e-3];
    let rows: Vec<Vec<f64>> =
        (0..6).map(|i| (0..6).map(|j| if i == j { sigma[i] * sigma[i] } else { 0.0 }).collect()).collect();
    let mut file = |name: &str| {
        let line = |view: usize| {
            let noise = Vector6::from_fn(|i, _| sigma[i] * chance.normal());
            let place = Vector6::new(0.3, -0.2, 0.001 * view as f64, 0.1, 0.2, 1.5);
            let pose = Pose::exp(&place).moved(&noise);
            let object = serde_json::json!({
                "view": format!("v{view}"),
                "status": "ok",
                "cam_from_target": {
                    "rotation_wxyz": pose.quaternion_wxyz(),
                    "translation_m": <[f64; 3]>::from(pose.translation),
                },
                "covariance": rows,
            });
            format!("{object}\n")
        };
        let text: String = (0..1000).map(line).collect();
        write(&folder, name, &text)
    };
    let (before, after) = (file("before.jsonl"), file("after.jsonl"));
    let run = compare(&before, &after, &["--json", "--alpha", "0.05"]);
    let answers = json_lines(&run);
    let below = |level: f64| answers.iter().filter(|a| a["p"].as_f64().unwrap() < level).count();
    println!(
        "of 1000 views {} below 0.5, {} below 0.05, {} below 0.001",
        below(0.5),
        below(0.05),
        below(1e-3)
    );
    assert_eq!(answers.len(), 1000);
    assert!((448..=552).contains(&below(0.5)) && (28..=73).contains(&below(0.05)) && below(1e-3) <= 5);
    // The chance of an alarm is shared among the views.
    assert_eq!(run.code, if below(0.05 / 1000.0) == 0 { 0 } else { 3 });
}
