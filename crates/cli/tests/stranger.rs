//! What people get wrong first: each mistake is named before any work is done, with the way out.

use crate::support::{Run, data, demo, folder, json_lines, resight};

fn locate(image: &str, extra: &[&str]) -> Run {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    resight(&[&["locate", image, "--camera", &camera, "--target", &target], extra].concat())
}

fn refused(run: &Run, wanted: &str) {
    assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}: {}", run.stderr);
    assert!(run.stderr.contains(wanted), "{wanted}: {}", run.stderr);
}

#[test]
fn results_that_could_not_be_written_stop_before_any_work() {
    let (image, folder) = (demo("left.png"), folder("stranger_output"));
    let path = |name: &str| folder.join(name).display().to_string();
    refused(&locate(&image, &["-o", &path("none/x.jsonl")]), "make it first");
    refused(&locate(&image, &["-o", &path("")]), "this is a folder; give a file");
    std::fs::write(folder.join("file"), "").unwrap();
    refused(&locate(&image, &["--overlay", &path("file")]), "this is a file; give a folder");
    refused(&resight(&["demo", "-o", &path("file")]), "this is a file; give a folder");
}

#[test]
fn folders_and_empty_patterns_are_named() {
    let folder = folder("stranger_patterns").display().to_string();
    refused(&locate(&folder, &[]), "is a folder; give its images");
    refused(&locate(&format!("{folder}/*.png"), &[]), "no file matches");
    refused(&locate("[", &[]), "[: not a file, and no pattern either");
    refused(&resight(&["explain", &folder]), "is a folder; give a file in it");
}

/// A file of points with this text, solved with the camera of the test data.
fn solve(name: &str, text: &str) -> Run {
    let path = folder("stranger_points").join(name);
    std::fs::write(&path, text).unwrap();
    resight(&["solve", path.to_str().unwrap(), "--camera", &data("camera.toml"), "--json"])
}

const ROWS: &str = "x_m,y_m,z_m,u_px,v_px\n0,0,0,665.1,429.9\n0.5,0,0,871.2,443.1\n1,0,0,1043.3,453.7\n0,0.8,0,606.7,778.4\n";

/// One test: its files share a folder.
#[test]
fn tables_from_other_programs() {
    let windows = solve("windows.csv", &format!("\u{feff}{}", ROWS.replace('\n', "\r\n")));
    assert_eq!((windows.code, json_lines(&windows)[0]["status"].as_str()), (0, Some("ok")));
    for (name, text, remark) in [
        ("semicolons.csv", ROWS.replace(',', ";"), "separated by semicolons"),
        ("decimal_commas.csv", ROWS.replace(',', ";").replace('.', ","), "read as its decimal point"),
        ("tabs.csv", ROWS.replace(',', "\t"), "separated by tabs"),
    ] {
        let other = solve(name, &text);
        let [ours, theirs] = [&windows, &other].map(|run| json_lines(run)[0]["cam_from_target"].clone());
        assert_eq!((other.code, theirs), (0, ours), "{}", other.stderr);
        assert!(other.stderr.contains(remark), "{}", other.stderr);
        assert!(json_lines(&other)[0]["remarks"].to_string().contains(remark));
    }
    refused(&solve("empty.csv", ""), "the file is empty; a header line");

    let huge = solve("huge.csv", &ROWS.replace("0.8", "1e300"));
    let message = json_lines(&huge)[0]["message"].as_str().unwrap().to_string();
    assert!(huge.code == 1 && message.contains("line 5: column `y_m` is 1e300"), "{message}");

    let same = solve("same.csv", &ROWS.replace("0,0.8,0", "1,0,0"));
    let message = json_lines(&same)[0]["message"].as_str().unwrap().to_string();
    assert!(message.contains("all points lie on one line"), "{message}");

    let named = ROWS.replace("x_m", "id,x_m").replace("\n0", "\na,0").replace("\n1", "\nb,1");
    let duplicates = solve("twins.csv", &named);
    assert_eq!(json_lines(&duplicates).len(), 1);
    assert!(duplicates.stderr.contains("lines 2 and 3 both have id `a`"), "{}", duplicates.stderr);
}

/// A principal point a third of the image's width off its middle: each command that takes a camera says so, in JSON too.
#[test]
fn a_camera_that_hardly_exists_is_remarked_on_by_every_command() {
    let folder = folder("stranger_camera");
    let path = |name: &str| folder.join(name).display().to_string();
    let camera = std::fs::read_to_string(demo("left.toml")).unwrap();
    let line = camera.lines().find(|line| line.starts_with("cx_px")).expect("cx_px");
    std::fs::write(path("odd.toml"), camera.replace(line, "cx_px = 40.0")).unwrap();
    std::fs::write(path("points.csv"), ROWS).unwrap();
    let (image, target, odd, points) =
        (demo("left.png"), demo("dots.toml"), path("odd.toml"), path("points.csv"));
    let rig = |name: &str| format!("{}/../../examples/rig/{name}", env!("CARGO_MANIFEST_DIR"));
    let cameras = std::fs::read_to_string(rig("cameras.toml")).unwrap();
    std::fs::write(path("odd_rig.toml"), cameras.replacen("cx_px = 639.5", "cx_px = 200.0", 1)).unwrap();
    let (odd_rig, detections) = (path("odd_rig.toml"), rig("detections.csv"));
    let wanted = "the principal point is";
    for words in [
        vec!["solve", &points, "--camera", &odd, "--json"],
        vec!["locate", &image, "--camera", &odd, "--target", &target, "--json"],
        vec!["rig", "--camera", &odd_rig, "--detections", &detections],
    ] {
        let run = resight(&words);
        assert!(run.stderr.contains(wanted), "{words:?}: {}", run.stderr);
        if words[0] != "rig" {
            assert!(json_lines(&run)[0]["remarks"].to_string().contains(wanted), "{words:?}: {}", run.stdout);
        }
    }
}

/// One folder given for two cameras, or one camera's rows under two names, is no rig of two.
#[test]
fn the_images_of_one_camera_are_no_second_camera() {
    let photo = |name: &str| format!("{}/../../examples/photo/{name}", env!("CARGO_MANIFEST_DIR"));
    let (lens, board) = (photo("left.yml"), photo("board.toml"));
    let (left, right) =
        (format!("left={}", photo("left0[13].jpg")), format!("right={}", photo("left0[13].jpg")));
    let lenses = [format!("left={lens}"), format!("right={lens}")];
    let words = [
        "rig", "--camera", &lenses[0], &lenses[1], "--target", &board, "--images", &left, "--images", &right,
    ];
    refused(&resight(&words), "show every point they share in the same pixel");
}
