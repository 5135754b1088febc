//! Maps of tags and units at the command line: what is assumed is said, what is wrong is named, and no slip of unit goes unremarked.

use crate::support::{data, folder, json_lines, resight};
use resight::core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight::core::target::{MapTag, TagMap};
use resight::core::{Camera, Lens, Point, Pose, Target};
use resight::render::{Finish, Scene, Style, render};

const CAMERA: &str = "model = \"pinhole\"\nwidth_px = 800\nheight_px = 600\nfx_px = 700.0\nfy_px = 700.0\ncx_px = 399.5\ncy_px = 299.5\n";

/// Four tags in a plane 1.5 m away; tag 4 hangs `off_m` to the right of where the map says.
fn image_of_field(off_m: f64) -> resight::GrayImage {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 700.0, cx_px: 399.5, cy_px: 299.5 };
    let size = Some(ImageSize { width_px: 800, height_px: 600 });
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size };
    let tag = |(id, x, y): (u32, f64, f64)| {
        let turn = Pose::exp(&resight::core::Vector6::new(0.2, 0.3 - 0.15 * id as f64, 0.0, 0.0, 0.0, 0.0));
        MapTag {
            id,
            size_m: 0.15,
            world_from_tag: Pose::new(turn.rotation, Point::new(x, y, 0.0)),
            sigma_m: 0.0,
            sigma_rad: 0.0,
        }
    };
    let places = [(1, -0.4, -0.25), (2, 0.4, -0.25), (3, -0.4, 0.25), (4, 0.4 + off_m, 0.25)];
    let target = Target::TagMap(TagMap {
        family: "tag36h11".into(),
        tags: places.map(tag).to_vec(),
        joint_covariance: None,
    });
    let cam_from_target = Pose::exp(&resight::core::Vector6::new(0.15, -0.2, 0.05, 0.0, 0.0, 1.5));
    render(&Scene::of(target, cam_from_target, Style::default()), &camera, &Finish::default()).unwrap()
}

/// The map as a file, its translations times `unit`.
fn map_text(unit: f64, keys: &str) -> String {
    let mut text = format!("kind = \"tag_map\"\n{keys}\n");
    for (id, x, y) in [(1, -0.4, -0.25), (2, 0.4, -0.25), (3, -0.4, 0.25), (4, 0.4, 0.25)] {
        let turn = Pose::exp(&resight::core::Vector6::new(0.2, 0.3 - 0.15 * id as f64, 0.0, 0.0, 0.0, 0.0));
        text += &format!(
            "[[tag]]\nid = {id}\nsize_m = 0.15\nworld_from_tag = {{ rotation_wxyz = {:?}, translation_m = [{:?}, {:?}, 0.0] }}\n",
            turn.quaternion_wxyz(),
            x * unit,
            y * unit
        );
    }
    text
}

#[test]
fn tag_out_of_place_is_left_out_and_named() {
    let folder = folder("tag_maps");
    let path = |name: &str| folder.join(name).display().to_string();
    std::fs::write(path("camera.toml"), CAMERA).unwrap();
    std::fs::write(path("map.toml"), map_text(1.0, "sigma_m = 0.005")).unwrap();
    std::fs::write(path("millimetres.toml"), map_text(1000.0, "")).unwrap();
    std::fs::write(path("family.toml"), map_text(1.0, "family = \"tag25h9\"")).unwrap();
    std::fs::write(path("good.png"), image_of_field(0.0).png().unwrap()).unwrap();
    std::fs::write(path("off.png"), image_of_field(0.06).png().unwrap()).unwrap();
    let locate = |image: &str, map: &str, extra: &[&str]| {
        let (image, camera, map) = (path(image), path("camera.toml"), path(map));
        resight(&[&["locate", &image, "--camera", &camera, "--target", &map], extra].concat())
    };

    let good = locate("good.png", "map.toml", &["--json"]);
    let answer = &json_lines(&good)[0];
    assert_eq!(
        (good.code, answer["status"].as_str(), answer["n_points"].as_u64()),
        (0, Some("ok"), Some(16))
    );
    assert!(answer.get("left_out_tags").is_none() && answer.get("remarks").is_none(), "{answer}");

    let off = locate("off.png", "map.toml", &["--json"]);
    let answer = &json_lines(&off)[0];
    assert_eq!((answer["status"].as_str(), answer["n_points"].as_u64()), (Some("ok"), Some(12)));
    assert_eq!(answer["left_out_tags"][0]["id"].as_u64(), Some(4));
    let distance_m = answer["left_out_tags"][0]["distance_m"].as_f64().unwrap();
    assert!((distance_m - 0.06).abs() < 0.02, "{distance_m}");
    let words = locate("off.png", "map.toml", &[]);
    assert!(words.stdout.contains("Tag 4 is") && words.stdout.contains("left out"), "{}", words.stdout);

    let millimetres = locate("good.png", "millimetres.toml", &["--json"]);
    let answer = &json_lines(&millimetres)[0];
    assert_ne!(answer["status"].as_str(), Some("ok"), "{answer}");
    let remark = answer["remarks"][0].as_str().unwrap();
    assert!(remark.contains("millimetres") && millimetres.stderr.contains(remark), "{remark}");

    let family = locate("good.png", "family.toml", &["--json"]);
    let answer = &json_lines(&family)[0];
    assert_eq!((family.code, answer["status"].as_str()), (1, Some("not_found")));
    let message = answer["message"].as_str().unwrap();
    assert!(message.contains("tag36h11") && message.contains("1, 2, 3, 4"), "{message}");

    let stated = locate("good.png", "family.toml", &["--tag-family", "tag36h11"]);
    assert_eq!(stated.code, 2);
    assert!(stated.stderr.contains("states `family` itself"), "{}", stated.stderr);
    let silent = locate("good.png", "map.toml", &["--tag-family", "tag25h9", "--json"]);
    assert_eq!(json_lines(&silent)[0]["status"].as_str(), Some("not_found"));
}

/// 25 m squares, a 160 m tag, points in millimetres: a remark with the likely meaning, from `explain` and in JSON.
#[test]
fn slips_of_unit_are_remarked_on() {
    let folder = folder("units");
    let path = |name: &str| folder.join(name).display().to_string();
    let remarked = |name: &str, text: &str, wanted: &str| {
        std::fs::write(path(name), text).unwrap();
        let words = resight(&["explain", &path(name)]);
        assert!(words.code == 0 && words.stdout.contains(wanted), "{}", words.stdout);
        let json = resight(&["explain", &path(name), "--json"]);
        assert!(json.stderr.contains(wanted), "{}", json.stderr);
        assert!(json_lines(&json)[0]["remarks"][0].as_str().unwrap().contains(wanted));
    };
    remarked(
        "board.toml",
        "kind = \"chessboard\"\nrows = 6\ncolumns = 9\nsquare_m = 25.0\n",
        "square_m is 25 m: did you mean 0.025?",
    );
    remarked(
        "tag.toml",
        "kind = \"tag\"\nfamily = \"tag36h11\"\nid = 3\nsize_m = 160\n",
        "size_m is 160 m: did you mean 0.16?",
    );

    let rows = [[0, 0, 0], [3500, 0, 0], [3500, 6000, 0], [0, 6000, 0], [1700, 3000, 400]];
    let written = |per_m: f64| {
        rows.iter().enumerate().fold("x_m,y_m,z_m,u_px,v_px\n".to_string(), |text, (i, row)| {
            let [x, y, z] = row.map(|mm| f64::from(mm) * 1e-3 * per_m);
            let (u, v) = ([200, 700, 690, 230, 450][i], [150, 160, 640, 630, 400][i]);
            text + &format!("{x},{y},{z},{u},{v}\n")
        })
    };
    std::fs::write(path("road.csv"), written(1e3)).unwrap();
    let road = resight(&["solve", &path("road.csv"), "--camera", &data("camera.toml"), "--json"]);
    let remark = json_lines(&road)[0]["remarks"][0].as_str().unwrap().to_string();
    assert!(
        remark.contains("millimetres") && remark.contains("millimetres (6 m: divide by 1000)"),
        "{remark}"
    );
    assert!(road.stderr.contains(&remark), "{}", road.stderr);
    std::fs::write(path("metres.csv"), written(1.0)).unwrap();
    let metres = resight(&["solve", &path("metres.csv"), "--camera", &data("camera.toml"), "--json"]);
    assert!(json_lines(&metres)[0].get("remarks").is_none());
}

/// A target a thousand times too large answers in a frame a thousand times too large: `implausible`, with the likely meaning in the message.
#[test]
fn a_target_of_no_size_is_implausible() {
    let folder = folder("implausible");
    let demo = |file: &str| format!("{}/../../testdata/demo/{file}", env!("CARGO_MANIFEST_DIR"));
    let text = std::fs::read_to_string(demo("grid.toml")).unwrap();
    let line = text.lines().find(|line| line.starts_with("tag_size_m")).unwrap();
    let size_m: f64 = line.split_once(" = ").unwrap().1.trim().parse().unwrap();
    let large = folder.join("large.toml").display().to_string();
    std::fs::write(&large, text.replace(line, &format!("tag_size_m = {}", 1e3 * size_m))).unwrap();
    let (image, camera) = (demo("left.png"), demo("left.toml"));
    let located =
        |target: &str| resight(&["locate", &image, "--camera", &camera, "--target", target, "--json", "-q"]);
    let (right, wrong) = (located(&demo("grid.toml")), located(&large));
    let [a, b] = [&right, &wrong].map(|run| json_lines(run)[0].clone());
    assert_eq!((right.code, a["status"].as_str()), (0, Some("ok")), "{a}");
    assert_eq!((wrong.code, b["status"].as_str()), (1, Some("implausible")), "{b}");
    assert!(b["message"].as_str().unwrap().contains(&format!("did you mean {size_m}?")), "{b}");
    assert!(b["cam_from_target"].is_object() && b["covariance"].is_array(), "the pose is given");
    let words = resight(&["locate", &image, "--camera", &camera, "--target", &large, "-q"]);
    assert!(words.stdout.contains("IMPLAUSIBLE"), "{}", words.stdout);
}
