//! Zones moved with a camera that rotates: rendered turns, measured from the images as a user measures them, within the stated limit; what a rotation does
//! not explain is said.

use nalgebra::Vector2;
use resight::answer::compare::CompareAnswer;
use resight::answer::{Status, ZoneAnswer};
use resight::compare::{CompareOptions, Compared, ViewPoses, compare};
use resight::core::camera::{BrownConrady, ImageSize, KannalaBrandt};
use resight::core::target::AprilGrid;
use resight::core::{Camera, CameraMatrix, Lens, Matrix6, Pixel, Point, Pose, Target, Vector6};
use resight::render::{Finish, Placed, Scene, Style, render, true_pixels};
use resight::zones::{CameraMotion, ZoneOptions, move_zones, read_motion, read_zones};
use std::path::{Path, PathBuf};

const SIZE: ImageSize = ImageSize { width_px: 1280, height_px: 960 };

/// A wide lens whose corners are displaced by more than a hundred pixels.
fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 700.0, fy_px: 705.0, cx_px: 645.3, cy_px: 474.8 };
    let lens = BrownConrady::new(matrix, &[-0.28, 0.08, 4e-4, -3e-4, 0.0]).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: Some(SIZE) }
}

/// A wall of tags, as large as a house front.
fn wall() -> Target {
    Target::AprilGrid(AprilGrid {
        family: "tag36h11".into(),
        rows: 5,
        columns: 7,
        tag_size_m: 0.8,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    })
}

fn scene(cam_from_target: Pose) -> Scene {
    let placed = Placed { target: wall(), cam_from_target, style: Style::default() };
    Scene { placed: vec![placed], background: 120.0, clutter: Vec::new() }
}

fn turn(rotation_deg: [f64; 3], shift_m: [f64; 3]) -> Pose {
    let [a, b, c] = rotation_deg.map(f64::to_radians);
    Pose { translation: Point::from(shift_m), ..Pose::exp(&Vector6::new(a, b, c, 0.0, 0.0, 0.0)) }
}

fn at_wall(distance_m: f64) -> Pose {
    let middle = Point::new(0.5 * 7.0 * 1.04 - 0.12, 0.5 * 5.0 * 1.04 - 0.12, 0.0);
    // y of the grid points up.
    let upright = Pose::exp(&Vector6::new(std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0)).rotation;
    Pose { rotation: upright, translation: Point::new(0.0, 0.0, distance_m) - upright * middle }
}

fn file(name: &str, text: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("zones-{name}"));
    std::fs::write(&path, text).expect("written");
    path
}

/// The pose of the camera in a rendered image, as a view of a file of answers.
fn located(cam_from_target: Pose) -> Compared {
    let image = render(&scene(cam_from_target), &camera(), &Finish::default()).expect("an image");
    let answer = resight::locate_image(&image, &camera(), &wall(), &Default::default()).expect("a detector");
    let estimate = answer.estimate.expect("a pose");
    let poses = vec![(estimate.cam_from_target, estimate.covariance)];
    Compared::Poses { name: "rendered".into(), views: vec![ViewPoses { view: "gate".into(), poses }] }
}

/// The motion that `compare` finds between two rendered images, through its JSON.
fn measured(name: &str, before: Pose, after: Pose) -> CameraMotion {
    let answer =
        compare(&located(before), &located(after), &CompareOptions::default()).expect("a comparison");
    let CompareAnswer::Views(views) = answer else { panic!("views are compared") };
    let json = serde_json::to_string(&views[0]).expect("JSON");
    read_motion(file(name, &json), None).expect("a motion")
}

/// A zone around four tags of the wall, its corners where they are in the image.
fn corners(cam_from_target: Pose) -> Vec<Pixel> {
    let placed = &scene(cam_from_target).placed[0];
    let truth = true_pixels(placed, &camera());
    let corner = |id: u32, corner: u8| {
        truth.iter().find(|(f, _)| f.id == id && f.corner == corner).expect("in the image").1
    };
    // Bottom left, bottom right, top right, top left tag; rows count upwards.
    vec![corner(8, 3), corner(12, 2), corner(26, 1), corner(22, 0)]
}

fn moved(zones: &str, motion: &CameraMotion, nearest_m: Option<f64>) -> Vec<ZoneAnswer> {
    let file = read_zones(file("zones.toml", zones), camera().size).expect("zones");
    move_zones(&file, &camera(), motion, &ZoneOptions { limit_px: 2.0, nearest_m, shift_sigma_m: None })
        .expect("answers")
        .answers
}

fn zone(polygon: &[Pixel]) -> String {
    let corners: Vec<String> = polygon.iter().map(|p| format!("[{}, {}]", p.x, p.y)).collect();
    format!("[[zone]]\nname = \"wall\"\npolygon_px = [{}]\n", corners.join(", "))
}

fn nearest_px(polygon: &[[f64; 2]], to: &Pixel) -> f64 {
    polygon.iter().map(|p| (Vector2::from(*p) - to).norm()).fold(f64::INFINITY, f64::min)
}

/// Rotations up to 12° about every axis, measured in the images: corners of the zone are on the same corners of the wall within the limit of 2 px.
#[test]
fn rendered_turns_are_followed_within_two_pixels() {
    let before = at_wall(12.0);
    let zone = zone(&corners(before));
    for (i, rotation) in [
        [0.5, 0.0, 0.0],
        [0.0, 0.5, 0.0],
        [0.0, 0.0, 0.5],
        [3.0, -2.0, 1.0],
        [-5.0, 6.0, -4.0],
        [2.0, 12.0, 8.0],
    ]
    .into_iter()
    .enumerate()
    {
        let after = turn(rotation, [0.0; 3]).inverse() * before;
        let motion = measured(&format!("turn-{i}.json"), before, after);
        let answer = &moved(&zone, &motion, Some(10.0))[0];
        assert_eq!(answer.status, Status::Ok, "{rotation:?}: {}", answer.message);
        let polygon = answer.polygon_px.as_ref().expect("moved");
        let worst = corners(after).iter().map(|to| nearest_px(polygon, to)).fold(0.0, f64::max);
        assert!(worst < 2.0 && worst < answer.error_px.expect("known"), "{rotation:?}: {worst} {answer:?}");
    }
}

/// With a shift of 30 cm the wall at 12 m is displaced by 17 px: the zone is not moved, and the stated distance is where a rotation explains 2 px.
#[test]
fn a_shift_that_moves_a_zone_is_said() {
    let before = at_wall(12.0);
    let zone = zone(&corners(before));
    let after = turn([1.0, -2.0, 0.0], [0.3, 0.0, 0.0]).inverse() * before;
    let motion = measured("shift.json", before, after);
    let answer = &moved(&zone, &motion, Some(12.0))[0];
    assert_eq!((answer.status, answer.polygon_px.as_ref()), (Status::Undecided, None), "{}", answer.message);
    let from_m = answer.holds_from_m.expect("a distance");
    // 0.3 m · 700 px / 2 px = 105 m were the rotation exact; its own uncertainty takes a part of the limit.
    assert!(80.0 < from_m, "{from_m}");
    assert!(answer.message.contains("draw the zone again"), "{}", answer.message);
    let unknown = &moved(&zone, &motion, None)[0];
    assert_eq!(unknown.status, Status::Undecided);
    assert!(unknown.message.contains("--nearest-m"), "{}", unknown.message);
    let far = &moved(&zone, &motion, Some(1.01 * from_m))[0];
    assert_eq!(far.status, Status::Ok, "{}", far.message);
    // Truth: on the wall, which is nearer, the moved zone would have been off by more than the limit.
    let polygon = far.polygon_px.as_ref().expect("moved");
    let worst = corners(after).iter().map(|to| nearest_px(polygon, to)).fold(0.0, f64::max);
    assert!(2.0 < worst, "{worst}");
}

/// Scene points of any distance beyond the nearest, and motions that scatter as their covariance states: moved zones are within the stated error in
/// 95 % and more of all cases, and the bound is not idle: in some cases it is nearly reached.
#[test]
fn the_stated_error_holds() {
    let mut seed = 3_u64;
    let mut uniform = move || {
        seed = seed.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        ((seed >> 11) as f64 + 0.5) / (1_u64 << 53) as f64
    };
    let sigma = Vector6::new(4e-4, 3e-4, 6e-4, 0.004, 0.006, 0.003);
    let nearest_m = 9.0;
    let (mut n_within, mut most, mut n) = (0, 0.0_f64, 0);
    for _ in 0..300 {
        let truth = turn([3.0 * uniform(), 5.0 * uniform(), 2.0 * uniform()], [0.008, 0.004, 0.006]);
        let noise =
            sigma.map(|s| s * (-2.0 * uniform().ln()).sqrt() * (std::f64::consts::TAU * uniform()).cos());
        let motion = CameraMotion {
            name: "gate".into(),
            old_from_new: truth.moved(&noise),
            covariance: Matrix6::from_diagonal(&sigma.map(|s| s * s)),
            shift_px: None,
            remarks: Vec::new(),
        };
        let old = Pixel::new(400.0 + 300.0 * uniform(), 300.0 + 300.0 * uniform());
        let square = [[-5.0, -5.0], [5.0, -5.0], [5.0, 5.0], [-5.0, 5.0]].map(|d| old + Vector2::from(d));
        let file = read_zones(file("one.toml", &zone(&square)), camera().size).expect("zones");
        let options = ZoneOptions { limit_px: 50.0, nearest_m: Some(nearest_m), shift_sigma_m: None };
        let answer = move_zones(&file, &camera(), &motion, &options).expect("answers").answers.swap_remove(0);
        let polygon = answer.polygon_px.expect("moved");
        let distance_m = nearest_m / uniform();
        let x_in_old = camera().bearing(&square[0]).expect("in the field").into_inner() * distance_m;
        let seen = camera().project(&(truth.inverse() * x_in_old)).expect("in front");
        let share = nearest_px(&polygon, &seen) / answer.error_px.expect("known");
        n += 1;
        n_within += usize::from(share <= 1.0);
        most = most.max(share);
    }
    assert!(95 * n <= 100 * n_within && 0.7 < most, "{n_within} of {n}, {most}");
}

/// One target shows a rotation and a shift badly apart: errors as correlated as those of a tag make the rotation useless alone, and what is known of
/// the mount makes it good again. A camera that did shift contradicts it.
#[test]
fn what_is_known_of_the_mount_narrows_the_motion() {
    let truth = turn([0.0, 0.5, 0.0], [0.0; 3]);
    // A rotation about y of 0.3° and the shift of 20 mm along x that has the same effect on a target 4 m away.
    let along = Vector6::new(0.0, 0.005, 0.0, -0.02, 0.0, 0.0);
    let small = Matrix6::from_diagonal(&Vector6::new(1e-10, 1e-10, 1e-10, 1e-8, 1e-8, 1e-8));
    let motion = |shift_m: f64| CameraMotion {
        name: "gate".into(),
        old_from_new: Pose { translation: Point::new(0.0, shift_m, 0.0), ..truth }.moved(&(along * 0.8)),
        covariance: along * along.transpose() + small,
        shift_px: None,
        remarks: Vec::new(),
    };
    let square = [[300.0, 300.0], [700.0, 300.0], [700.0, 700.0], [300.0, 700.0]].map(Pixel::from);
    let file = read_zones(file("mount.toml", &zone(&square)), camera().size).expect("zones");
    let answer = |motion: &CameraMotion, shift_sigma_m| {
        let options = ZoneOptions { limit_px: 2.0, nearest_m: Some(5.0), shift_sigma_m };
        move_zones(&file, &camera(), motion, &options).expect("answers").answers.swap_remove(0)
    };
    let free = answer(&motion(0.0), None);
    assert_eq!(free.status, Status::Undecided);
    assert!(free.message.contains("the rotation itself is known to"), "{}", free.message);
    let held = answer(&motion(0.0), Some(0.0));
    assert_eq!(held.status, Status::Ok, "{}", held.message);
    let polygon = held.polygon_px.expect("moved");
    for corner in square {
        let x = camera().bearing(&corner).expect("in the field").into_inner();
        let there = camera().project(&(truth.inverse() * x)).expect("in front");
        assert!(nearest_px(&polygon, &there) < held.error_px.expect("known"));
    }
    let shifted = answer(&motion(0.05), Some(0.001));
    assert_eq!(shifted.status, Status::Inconsistent);
    assert!(shifted.message.contains("did shift"), "{}", shifted.message);
}

/// Long edges become curves: every point of an edge, moved by itself, is within half a pixel of the polygon.
#[test]
fn long_edges_follow_the_lens() {
    let motion = CameraMotion {
        name: "gate".into(),
        old_from_new: turn([4.0, -3.0, 20.0], [0.0; 3]),
        covariance: Matrix6::zeros(),
        shift_px: None,
        remarks: Vec::new(),
    };
    let polygon = [[150.0, 150.0], [1150.0, 200.0], [1100.0, 800.0], [200.0, 700.0]].map(Pixel::from);
    let answer = &moved(&zone(&polygon), &motion, None)[0];
    assert_eq!((answer.status, answer.error_px, answer.holds_from_m), (Status::Ok, Some(0.0), Some(0.0)));
    let found = answer.polygon_px.as_ref().expect("moved");
    assert!(12 < found.len(), "{}", found.len());
    let (mut worst, mut of_corners) = (0.0_f64, 0.0_f64);
    for i in 0..4 {
        let (a, b) = (polygon[i], polygon[(i + 1) % 4]);
        for k in 0..50 {
            let x = camera().bearing(&a.lerp(&b, f64::from(k) / 50.0)).expect("in the field").into_inner();
            let there = camera().project(&(motion.old_from_new.inverse() * x)).expect("in front");
            if !camera().contains(&there) {
                continue;
            }
            worst = worst.max(distance_px(found, &there));
            let four: Vec<[f64; 2]> = polygon
                .iter()
                .map(|p| camera().bearing(p).expect("in the field").into_inner())
                .map(|x| camera().project(&(motion.old_from_new.inverse() * x)).expect("in front").into())
                .collect();
            of_corners = of_corners.max(distance_px(&four, &there));
        }
    }
    assert!(worst < 0.5 && 5.0 < of_corners, "{worst} {of_corners}");
}

/// The distance from a polygon's border.
fn distance_px(polygon: &[[f64; 2]], to: &Pixel) -> f64 {
    let edge = |i: usize| {
        let (a, b) = (Vector2::from(polygon[i]), Vector2::from(polygon[(i + 1) % polygon.len()]));
        let along = ((to - a).dot(&(b - a)) / (b - a).norm_squared()).clamp(0.0, 1.0);
        (a.lerp(&b, along) - to).norm()
    };
    (0..polygon.len()).map(edge).fold(f64::INFINITY, f64::min)
}

fn pure(rotation_deg: [f64; 3]) -> CameraMotion {
    CameraMotion {
        name: "gate".into(),
        old_from_new: turn(rotation_deg, [0.0; 3]),
        covariance: Matrix6::zeros(),
        shift_px: None,
        remarks: Vec::new(),
    }
}

#[test]
fn what_leaves_the_image_is_cut_or_named() {
    let square = [[20.0, 300.0], [220.0, 300.0], [220.0, 500.0], [20.0, 500.0]].map(Pixel::from);
    // The camera rotates to the right: things move to the left.
    let half = &moved(&zone(&square), &pure([0.0, 10.0, 0.0]), None)[0];
    assert_eq!(half.status, Status::Ok);
    assert!(
        half.share_in_image.is_some_and(|share| (0.1..0.9).contains(&share))
            && half.message.contains("is cut off"),
        "{half:?}"
    );
    let inside = |p: &[f64; 2]| (-0.5..=1279.5).contains(&p[0]) && (-0.5..=959.5).contains(&p[1]);
    assert!(half.polygon_px.as_ref().is_some_and(|polygon| polygon.iter().all(inside)));
    let gone = &moved(&zone(&square), &pure([0.0, 60.0, 0.0]), None)[0];
    assert_eq!((gone.status, gone.share_in_image), (Status::NotFound, Some(0.0)), "{}", gone.message);
    assert!(gone.message.contains("left the image"));
    let whole = [[0.0, 0.0], [1279.0, 0.0], [1279.0, 959.0], [0.0, 959.0]].map(Pixel::from);
    let whole = &moved(&zone(&whole), &pure([0.0, 1.0, 0.0]), None)[0];
    assert!(whole.message.contains("border of the old image"), "{}", whole.message);
}

/// A fisheye of 180°, turned by 80°: corners that were near its edge are beyond its field.
#[test]
fn zones_of_a_fisheye_end_where_its_image_ends() {
    let matrix = CameraMatrix { fx_px: 300.0, fy_px: 300.0, cx_px: 639.5, cy_px: 479.5 };
    let lens = Lens::KannalaBrandt(KannalaBrandt::new(matrix, &[0.0; 4]).expect("a lens"));
    let camera = Camera { lens, size: Some(SIZE) };
    let strip = [[200.0, 400.0], [1080.0, 400.0], [1080.0, 560.0], [200.0, 560.0]].map(Pixel::from);
    let file = read_zones(file("fisheye.toml", &zone(&strip)), camera.size).expect("zones");
    for angle in [30.0, 80.0, 140.0, 179.0] {
        let answer = &move_zones(&file, &camera, &pure([0.0, angle, 0.0]), &ZoneOptions::default())
            .expect("answers")
            .answers[0];
        let polygon = answer.polygon_px.clone().unwrap_or_default();
        assert!(polygon.iter().flatten().all(|x| x.is_finite()), "{answer:?}");
    }
}

/// The motions of `landmarks` and `watch` are read like those of `compare`.
#[test]
fn motions_of_every_command_are_read() {
    let rows: Vec<Vec<f64>> =
        (0..6).map(|i| (0..6).map(|j| if i == j { 1e-6 } else { 0.0 }).collect()).collect();
    let rows = serde_json::to_string(&rows).expect("JSON");
    let three = "[[1e-8,0,0],[0,1e-8,0],[0,0,1e-8]]";
    let landmarks = format!(
        "{{\"view\":\"night.png\",\"rotation_rad\":[0.0,0.01,0.0],\"rotation_covariance_rad2\":{three},\"is_consistent\":true}}"
    );
    let drifted = format!(
        "{{\"event\":\"state\",\"camera\":\"gate\",\"state\":\"drifted\",\"old_from_new\":[0,0.01,0,0.1,0,0],\"covariance\":{rows}}}"
    );
    let rigs = format!(
        "{{\"kind\":\"rigs\",\"moved\":[{{\"camera\":\"left\",\"old_from_new\":{{\"rotation_wxyz\":[1,0,0,0],\"translation_m\":[0,0,0.1]}},\"covariance\":{rows}}}]}}"
    );
    let verdict = format!(
        "{{\"event\":\"moved\",\"moved\":[\"gate\"],\"motions\":[{{\"name\":\"gate\",\"old_from_new\":[0,0.02,0,0,0,0],\"covariance\":{rows}}}]}}"
    );
    for (name, text, shift_m) in [
        ("night.png", &landmarks, 0.0),
        ("gate", &drifted, 0.1),
        ("left", &rigs, 0.1),
        ("gate", &verdict, 0.0),
    ] {
        let motion = read_motion(file("motion.json", text), None).expect(text);
        assert_eq!(motion.name, name);
        assert!((motion.old_from_new.translation.norm() - shift_m).abs() < 1e-5);
    }
    let both = file("both.json", &format!("{drifted}\n{{\"event\":\"ended\"}}\n{rigs}\n{verdict}\n"));
    assert!(read_motion(&both, None).expect_err("two").to_string().contains("--name"));
    // The last motion of a camera holds.
    let last = read_motion(&both, Some("gate")).expect("a motion");
    assert!((last.old_from_new.log()[1] - 0.02).abs() < 1e-12);
    for (text, wanted) in [
        ("{\"event\":\"ended\"}", "holds no motion"),
        ("no JSON", "line 1"),
        (&landmarks.replace("true", "false"), "contradict"),
        (&drifted.replace("1e-6", "-1"), "covariance"),
    ] {
        let said = read_motion(file("motion.json", text), None).expect_err(text).to_string();
        assert!(said.contains(wanted), "{said}");
    }
}

/// Frigate's coordinates come back as they came, from 0 to 1 or in whole pixels; a zone that did not move stays where it is.
#[test]
fn zones_are_written_as_they_were_read() {
    let still = pure([0.0; 3]);
    let relative = "0.10000,0.20000,0.50000,0.20000,0.50000,0.70000";
    let texts = [
        format!("[[zone]]\nname = \"drive\"\ncoordinates = \"{relative}\"\n"),
        format!("{{\n  \"zone\": [\n    {{\n      \"name\": \"drive\",\n      \"coordinates\": \"{relative}\"\n    }}\n  ]\n}}\n"),
        "width_px = 640\nheight_px = 480\n\n[[zone]]\nname = \"drive\"\ncoordinates = \"64,96,320,96,320,336\"\n".to_string(),
    ];
    for text in &texts {
        let zones = read_zones(file("written", text), camera().size).expect(text);
        let moved = move_zones(&zones, &camera(), &still, &ZoneOptions::default()).expect("answers");
        assert_eq!(moved.file.as_ref(), Some(text), "{:?}", moved.answers);
    }
    let turned = read_zones(file("written", &texts[0]), camera().size).expect("zones");
    let turned =
        move_zones(&turned, &camera(), &pure([0.0, 1.0, 0.0]), &ZoneOptions::default()).expect("answers");
    let coordinates = turned.answers[0].coordinates.as_ref().expect("as they were read");
    let first: f64 = coordinates.split(',').next().and_then(|x| x.parse().ok()).expect("a number");
    let expected = turned.answers[0].polygon_px.as_ref().expect("moved")[0][0] / 1280.0;
    assert!((first - expected).abs() < 1e-5 && first < 0.1, "{first}");
    for (text, wanted) in [
        ("[[zone]]\nname = \"a\"\ncoordinates = \"0.1,0.2,0.3\"\n", "an x and a y"),
        ("[[zone]]\nname = \"a\"\ncoordinates = \"0.1,0.2,0.3,x\"\n", "`x` is not a number"),
        ("[[zone]]\nname = \"a\"\npolygon_px = [[1,2],[3,4]]\n", "2 corners"),
        (
            "[[zone]]\nname = \"a\"\npolygon_px = [[1,2],[3,4],[5000,4]]\n",
            "outside the image of 1280 × 960 px",
        ),
        ("[[zone]]\nname = \"a\"\n", "one of polygon_px and coordinates"),
        ("[[zone]]\nname = \"a\"\npolygon_px = [[1,2],[3,4],[nan,4]]\n", "outside"),
        ("zone = []\n", "0 zones"),
    ] {
        let said = read_zones(file("wrong.toml", text), camera().size).expect_err(text).to_string();
        assert!(said.contains(wanted), "{said}");
    }
    assert!(read_zones(file("written", &texts[0]), None).is_err_and(|e| e.to_string().contains("width_px")));
}
