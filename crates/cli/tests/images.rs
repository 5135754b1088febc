//! `locate`, `detect`, `explain` and `demo` on the shipped images.

use crate::support::{demo, folder, json_lines, matches_golden, resight};

#[test]
fn locate_answers_in_input_order_and_draws() {
    let pictures = folder("locate_overlay");
    let (left, critical) = (demo("left.png"), demo("critical.png"));
    let arguments =
        ["locate", &critical, &left, "--camera", &demo("left.toml"), "--target", &demo("dots.toml")];
    let run = resight(&[&arguments[..], &["--json", "--overlay", pictures.to_str().unwrap()]].concat());
    assert_eq!((run.code, run.stderr.as_str()), (1, ""), "one of the two is ambiguous");
    let answers = json_lines(&run);
    assert_eq!(
        (&answers[0]["view"], &answers[1]["view"]),
        (&critical.as_str().into(), &left.as_str().into())
    );
    assert_eq!((&answers[0]["status"], &answers[1]["status"]), (&"ambiguous".into(), &"ok".into()));
    let other = &answers[0]["ambiguity"]["other"];
    assert!(other["cam_from_target"]["matrix"].is_array() && other["rms_px"].is_number());
    // The more probable pose leads, and it is the true one.
    let (first, second) = (&answers[0]["probability"], &other["probability"]);
    assert!(0.5 < first.as_f64().unwrap() && second.as_f64().unwrap() < 0.5, "{first} {second}");
    let place = &answers[0]["target_from_cam"]["translation_m"];
    assert!((place[1].as_f64().unwrap() + 0.265).abs() < 1e-3, "{place}");
    assert!(other["sigma_m"].is_array() && other["sigma_rad"].is_array());
    for name in ["critical.png", "left.png"] {
        let picture = resight::GrayImage::read(pictures.join(name)).unwrap();
        assert!(
            picture.width_px == 800 && 600 < picture.height_px,
            "{name} has its caption below the photograph"
        );
    }
}

#[test]
fn a_target_that_is_not_there_is_not_found() {
    let folder = folder("not_found");
    let blank = folder.join("without_that_tag.png");
    std::fs::copy(demo("left.png"), &blank).unwrap();
    let target = folder.join("tag.toml");
    std::fs::write(&target, "kind = \"tag\"\nfamily = \"tag25h9\"\nid = 3\nsize_m = 0.1\n").unwrap();
    let (blank, target) = (blank.display().to_string(), target.display().to_string());
    let run = resight(&["locate", &blank, "--camera", &demo("left.toml"), "--target", &target, "--json"]);
    let answer = &json_lines(&run)[0];
    assert_eq!((run.code, &answer["status"]), (1, &"not_found".into()));
    assert!(
        answer["cam_from_target"].is_null() && answer["message"].as_str().unwrap().contains("no tag target")
    );
}

#[test]
fn an_image_of_another_shape_and_a_broken_one_are_errors_of_their_own() {
    let folder = folder("bad_images");
    let camera = folder.join("camera.toml");
    let text =
        std::fs::read_to_string(demo("left.toml")).unwrap().replace("height_px = 600", "height_px = 800");
    std::fs::write(&camera, text).unwrap();
    let broken = folder.join("broken.png");
    std::fs::write(&broken, b"not an image").unwrap();
    let broken = broken.display().to_string();
    let arguments = ["locate", &demo("left.png"), &broken, "--camera", camera.to_str().unwrap(), "--json"];
    let run = resight(&[&arguments[..], &["--target", &demo("grid.toml")]].concat());
    assert_eq!(run.code, 1);
    let answers = json_lines(&run);
    assert!(answers.iter().all(|a| a["status"] == "error"));
    assert!(answers[0]["message"].as_str().unwrap().contains("600"), "{}", answers[0]);
    assert!(answers[1]["message"].as_str().unwrap().contains("broken.png"), "{}", answers[1]);
}

#[test]
fn unreadable_arguments_stop_before_any_work() {
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    let cases = [
        (
            vec![demo("lfet.png"), "--camera".into(), camera.clone(), "--target".into(), target.clone()],
            "did you mean",
        ),
        (
            vec![demo("left.png"), "--camera".into(), demo("left.tml"), "--target".into(), target.clone()],
            "left.toml?",
        ),
        (
            vec![demo("left.png"), "--camera".into(), target.clone(), "--target".into(), target.clone()],
            "--target",
        ),
        (vec![demo("*.jpg"), "--camera".into(), camera, "--target".into(), target], "no file matches"),
    ];
    for (arguments, wanted) in cases {
        let arguments: Vec<&str> =
            std::iter::once("locate").chain(arguments.iter().map(String::as_str)).collect();
        let run = resight(&arguments);
        assert_eq!((run.code, run.stdout.as_str()), (2, ""), "{wanted}");
        assert!(run.stderr.contains(wanted), "{}", run.stderr);
    }
}

#[test]
fn detect_lists_the_points_of_every_image_a_pattern_matches() {
    let run = resight(&["detect", &demo("[lr]*t.png"), "--target", &demo("grid.toml"), "--json"]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    for found in json_lines(&run) {
        let detections = found["detections"].as_array().unwrap();
        assert_eq!(detections.len(), 64);
        let keys = ["id", "corner", "u_px", "v_px", "sigma_px", "lens_sigma_px"];
        assert!(detections.iter().all(|d| keys.iter().all(|key| d[key].is_number())));
    }
}

#[test]
fn explain_speaks_in_sentences() {
    let run = resight(&["explain", &demo("left.toml"), &demo("dots.toml")]);
    assert_eq!(run.code, 0, "{}", run.stderr);
    assert!(run.stdout.contains("x right, y down, z forward"), "{}", run.stdout);
}

#[test]
fn every_help_has_an_example() {
    for command in ["demo", "locate", "detect", "solve", "explain"] {
        let run = resight(&[command, "--help"]);
        assert!(
            run.code == 0 && run.stdout.contains(&format!("  resight {command}")),
            "{command}: {}",
            run.stdout
        );
    }
    assert_eq!(resight(&[]).code, 2);
}

#[test]
fn demo_tells_its_story_and_writes_a_page() {
    let out = folder("demo");
    let run = resight(&["demo", "-o", out.to_str().unwrap()]);
    assert_eq!((run.code, run.stderr.as_str()), (0, ""));
    matches_headings(&run.stdout);
    let page = std::fs::read_to_string(out.join("report.html")).unwrap();
    assert!(page.matches("data:image/png;base64,").count() == 6);
    // With its colon: images hold any four letters.
    assert!(!page.contains("http:") && !page.contains("https:"));
    let results = std::fs::read_to_string(out.join("results.jsonl")).unwrap();
    let statuses: Vec<serde_json::Value> =
        results.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(statuses.len(), 8);
    assert_eq!(statuses[7]["causes"][0]["cause"], "distorted", "{}", statuses[7]["message"]);
}

/// The headings and statuses in order; the numbers are held against the truth by the demo itself (exit status 0).
fn matches_headings(stdout: &str) {
    let kept = |line: &&str| {
        line.starts_with(|c: char| c.is_ascii_digit()) || line.trim_start().starts_with("status")
    };
    let text: String = stdout.lines().filter(kept).map(|line| format!("{line}\n")).collect();
    matches_golden("demo.txt", &text);
}

#[test]
fn demo_json_is_json_only() {
    let out = folder("demo_json");
    let run = resight(&["demo", "--json", "-o", out.to_str().unwrap()]);
    assert_eq!((run.code, json_lines(&run).len()), (0, 8));
}

/// The window reaches the detector, which has no use for it here.
#[test]
fn corner_window_is_for_boards() {
    for command in ["detect", "locate"] {
        let camera = demo("left.toml");
        let camera: &[&str] = if command == "locate" { &["--camera", &camera] } else { &[] };
        let picture = [demo("left.png"), demo("dots.toml")];
        let arguments = [command, &picture[0], "--target", &picture[1], "--corner-window-px", "11"];
        let run = resight(&[&arguments[..], camera].concat());
        assert_eq!(run.code, 2, "{}", run.stderr);
        assert!(run.stderr.contains("leave it out"), "{}", run.stderr);
    }
}

/// Without a target file: every tag of a family, or of whatever family.
#[test]
fn detect_lists_the_tags_of_a_family_or_of_any() {
    let grid = demo("left.png");
    let any = resight(&["detect", &grid, "--family", "any", "--json"]);
    let found = &json_lines(&any)[0];
    let first = &found["detections"][0];
    assert_eq!((any.code, first["family"].as_str()), (0, Some("tag36h11")), "{found}");
    let one = resight(&["detect", &grid, "--family", "tag25h9"]);
    assert!(one.code == 1 && one.stdout.contains("no tag tag25h9"), "{}", one.stdout);
    let unknown = resight(&["detect", &grid, "--family", "tag99h1"]);
    assert!(unknown.code == 2 && unknown.stderr.contains("unknown tag family"), "{}", unknown.stderr);
    let neither = resight(&["detect", &grid]);
    assert!(neither.code == 2 && neither.stderr.contains("--family"), "{}", neither.stderr);
}

/// Every command that reads images names what is none, with the way out.
#[test]
fn files_that_are_no_images_are_named_by_every_command() {
    let folder = folder("no_images");
    let (camera, target) = (demo("left.toml"), demo("dots.toml"));
    for (name, bytes, said) in [
        (
            "phone.jpg",
            &b"\0\0\0\x18ftypheic\0\0\0\0mif1heic"[..],
            "a HEIC image, not a PNG or JPEG image; convert it",
        ),
        ("scan.png", b"%PDF-1.7\n", "a PDF, not a PNG or JPEG image; export its page"),
        ("array.png", b"\x93NUMPY\x01\0", "a NumPy array (.npy), not a PNG or JPEG image"),
        ("camera.png", b"[camera]\nmodel = \"pinhole\"\n", "a text file, not a PNG or JPEG image"),
        ("nothing.png", b"", "an empty file, not a PNG or JPEG image"),
        ("picture.webp", b"RIFF\x24\0\0\0WEBPVP8 ", "save it as PNG or JPEG"),
    ] {
        let file = folder.join(name);
        std::fs::write(&file, bytes).unwrap();
        let file = file.display().to_string();
        let (one, two) = (format!("a={file}"), format!("b={file}"));
        let (camera_a, camera_b) = (format!("a={camera}"), format!("b={camera}"));
        for command in [
            &["detect", &file, "--family", "tag36h11"][..],
            &["locate", &file, "--camera", &camera, "--target", &target],
            &["intrinsics", &file, "--target", &target],
            &[
                "rig", "--images", &one, &two, "--camera", &camera_a, "--camera", &camera_b, "--target",
                &target,
            ],
            &["watch", "--source", &file, "--camera", &camera, "--target", &target, "--once"],
        ] {
            let run = resight(command);
            // Where lines are broken depends on the length of the path.
            let words: Vec<&str> =
                run.stdout.split_whitespace().chain(run.stderr.split_whitespace()).collect();
            let text = words.join(" ");
            assert!(run.code != 0 && text.contains(said), "{command:?}: {text}");
        }
    }
    let video = folder.join("film.jpg");
    std::fs::write(&video, b"\0\0\0\x18ftypisom\0\0\0\0isomavc1").unwrap();
    let video = video.display().to_string();
    let run = resight(&["locate", &video, "--camera", &camera, "--target", &target, "--json"]);
    let message = json_lines(&run)[0]["message"].to_string();
    assert!(message.contains("a video, not a PNG or JPEG image; `resight watch --source`"), "{message}");
    let run = resight(&["watch", &video]);
    assert!(
        run.code == 2 && run.stderr.contains("a video, not a text file; `resight watch --source FILE`"),
        "{}",
        run.stderr
    );
}

/// An image that EXIF asks viewers to rotate is taken as stored, and every command that reads images says so.
#[test]
fn an_orientation_of_exif_is_a_remark_of_every_command() {
    let folder = folder("exif_orientation");
    let photo = |name: &str| format!("{}/../../examples/photo/{name}", env!("CARGO_MANIFEST_DIR"));
    let (camera, target) = (photo("left.yml"), photo("board.toml"));
    for name in ["left01.jpg", "left03.jpg", "left04.jpg", "left05.jpg"] {
        let mut bytes = std::fs::read(photo(name)).unwrap();
        if ["left03.jpg", "left04.jpg"].contains(&name) {
            let exif =
                b"\xff\xe1\x00\x22Exif\0\0MM\0*\0\0\0\x08\0\x01\x01\x12\0\x03\0\0\0\x01\0\x03\0\0\0\0\0\0";
            bytes.splice(2..2, exif.iter().copied());
        }
        std::fs::write(folder.join(name), bytes).unwrap();
    }
    let (one, all) = (folder.join("left03.jpg"), folder.join("left0*.jpg"));
    let (one, all, here) =
        (one.display().to_string(), all.display().to_string(), folder.display().to_string());
    let of_rig = [format!("left={all}"), format!("right={}", photo("right0[1-5].jpg"))];
    let cameras = [format!("left={camera}"), format!("right={}", photo("right.yml"))];
    let watch = |source| {
        let lens = ["watch", "--camera", &camera, "--target", &target];
        [&lens[..], &["--source", source, "--period-s", "1", "--once"]].concat()
    };
    for (command, which) in [
        (&["locate", &one, "--camera", &camera, "--target", &target][..], "this image"),
        (&["detect", &one, "--target", &target], "this image"),
        (&["intrinsics", &all, "--target", &target], "2 images of camera"),
        (&["capture", &all, "--target", &target], "2 images of camera"),
        (
            &[
                "rig",
                "--images",
                &of_rig[0],
                &of_rig[1],
                "--camera",
                &cameras[0],
                &cameras[1],
                "--target",
                &target,
            ],
            "2 images of camera left",
        ),
        (&watch(&all), "its images"),
        (&watch(&here), "its images"),
    ] {
        let run = resight(command);
        let words: Vec<&str> = run.stdout.split_whitespace().chain(run.stderr.split_whitespace()).collect();
        let (words, said) = (words.join(" "), format!("EXIF asks viewers to show {which}"));
        assert_eq!(words.matches(&said).count(), 1, "{command:?}: {}{}", run.stdout, run.stderr);
        assert!(words.contains("rotated by 180°; pixels are taken as stored"), "{}", run.stdout);
    }
}
