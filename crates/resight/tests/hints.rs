//! Each hint of an image without its target is true: followed, it finds the target.

use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{AprilGrid, Charuco, Chessboard, Tag};
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target, Vector6};
use resight::detect::Detector;
use resight::detect::absent::{Explainer, missing, not_found};
use resight::detect::every_tag::EveryTagFinder;
use resight::detect::job::{detect_target, explain, points};
use resight::intrinsics::{IntrinsicsRequest, IntrinsicsSource};
use resight::render::{Finish, Pcg, Scene, Style, render};
use resight::{Status, intrinsics};

fn photograph(target: &Target, seed: u64) -> GrayImage {
    photograph_at(target, Vector6::new(0.2, -0.25, 0.15, 0.0, 0.0, 0.55), seed)
}

/// `pose` is the rotation and position of the middle of the target, seen from the front.
fn photograph_at(target: &Target, pose: Vector6, seed: u64) -> GrayImage {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 900.0, cx_px: 479.5, cy_px: 359.5 };
    let size = Some(ImageSize { width_px: 960, height_px: 720 });
    let camera = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size };
    let points: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    let middle = points.iter().sum::<Point>() / points.len() as f64;
    let facing = if matches!(target, Target::AprilGrid(_)) { -1.0 } else { 1.0 };
    let flip = nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, facing, facing));
    let rotation = Pose::exp(&Vector6::new(pose[0], pose[1], pose[2], 0.0, 0.0, 0.0)).rotation * flip;
    let pose = Pose::new(rotation, Point::new(pose[3], pose[4], pose[5]) - rotation * middle);
    render(&Scene::of(target.clone(), pose, Style::default()), &camera, &Finish { seed, ..Finish::default() })
        .unwrap()
}

fn mirrored(image: &GrayImage) -> GrayImage {
    let rows = image.data.chunks(image.width_px as usize);
    GrayImage { data: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..image.clone() }
}

fn inverted(image: &GrayImage) -> GrayImage {
    GrayImage { data: image.data.iter().map(|gray| 255 - gray).collect(), ..image.clone() }
}

fn charuco(rows: u32, columns: u32, marker_m: f64, legacy_pattern: bool) -> Target {
    let dictionary = "DICT_5X5_100".into();
    Target::Charuco(Charuco { rows, columns, square_m: 0.03, marker_m, dictionary, legacy_pattern })
}

fn grid(rows: u32, columns: u32, first_id: u32, family: &str) -> Target {
    let family = family.into();
    Target::AprilGrid(AprilGrid {
        rows,
        columns,
        tag_size_m: 0.045,
        tag_spacing_ratio: 0.3,
        first_id,
        family,
    })
}

fn tag(family: &str, id: u32) -> Target {
    Target::Tag(Tag { family: family.into(), id, size_m: 0.1 })
}

fn n_found(target: &Target, image: &GrayImage) -> usize {
    Detector::new(target).unwrap().detect(image).map_or(0, |found| found.len())
}

/// A file that states something else than the image shows, what is said, and the file as it is after the hint.
#[test]
fn each_hint_is_true_when_followed() {
    let whole = charuco(8, 5, 0.022, false);
    let cases: Vec<(Target, Target, &str)> = vec![
        (whole.clone(), charuco(5, 8, 0.022, false), "rows and columns exchanged: `rows` 8, `columns` 5"),
        (whole.clone(), charuco(8, 5, 0.022, true), "`legacy_pattern` false"),
        (whole.clone(), charuco(8, 5, 0.015, false), "`marker_m` about 0.02"),
        (whole.clone(), charuco(7, 6, 0.022, false), "`rows` 8 and `columns` 5"),
        (charuco(8, 5, 0.022, true), charuco(8, 5, 0.022, false), "`legacy_pattern` true"),
        (
            grid(3, 4, 0, "tag36h11"),
            grid(4, 3, 0, "tag36h11"),
            "exchanged: correct `rows` to 3 and `columns` to 4",
        ),
        (grid(3, 4, 0, "tag36h11"), grid(3, 5, 0, "tag36h11"), "`columns` to 4"),
        (grid(3, 4, 20, "tag36h11"), grid(3, 4, 0, "tag36h11"), "correct `first_id` to 20"),
        (grid(3, 4, 0, "tag36h11"), grid(3, 4, 0, "DICT_APRILTAG_36h11"), "each tag is turned by half"),
        (grid(3, 4, 0, "DICT_APRILTAG_36h11"), grid(3, 4, 0, "tag36h11"), "each tag is turned by half"),
        // Two mistakes at once.
        (
            grid(3, 4, 0, "tag36h11"),
            grid(4, 3, 0, "DICT_APRILTAG_36h11"),
            "turned by half, as AprilTag prints them, and rows and columns are exchanged: correct `rows` to 3 and `columns` to 4, `family` to tag36h11",
        ),
        (
            grid(3, 4, 0, "DICT_APRILTAG_36h11"),
            grid(5, 5, 0, "tag36h11"),
            "turned by half, as OpenCV prints them, and it has 4 tags a row: correct `rows` to 3 and `columns` to 4, `family` to DICT_APRILTAG_36h11",
        ),
        (
            grid(3, 4, 0, "tag36h11"),
            grid(3, 5, 0, "tag25h9"),
            "correct `rows` to 3 and `columns` to 4, `family` to tag36h11",
        ),
        (
            grid(3, 4, 12, "DICT_APRILTAG_36h11"),
            grid(3, 4, 0, "tag36h11"),
            "as OpenCV prints them: correct `first_id` to 12, `family` to DICT_APRILTAG_36h11",
        ),
    ];
    for (shown, stated, words) in cases {
        let image = photograph(&shown, 1);
        assert!(12 <= n_found(&shown, &image), "the image shows its own target: {shown:?}");
        assert_eq!(n_found(&stated, &image), 0, "{stated:?}");
        let said = not_found(&stated, &image);
        assert!(said.contains(words), "{words:?} is missing in: {said}");
    }
}

/// A hint that would not find the target is not given.
#[test]
fn no_hint_is_given_that_would_not_help() {
    let image = photograph(&grid(3, 4, 0, "tag36h11"), 1);
    let said = not_found(&charuco(8, 5, 0.022, false), &image);
    assert!(said.contains("tags of tag36h11 are: 0, 1, 2") && said.contains("kind `aprilgrid`"), "{said}");
    assert!(!said.contains("correct"), "{said}");
    let said = not_found(&tag("tag25h9", 7), &photograph(&tag("tag36h11", 9), 2));
    assert!(said.contains("tags of tag36h11 are: 9; none has id 7") && !said.contains("correct"), "{said}");
}

/// A mirrored or inverted image is named as such, and no family is advised that a few bits of it happen to fit.
#[test]
fn mirrored_and_inverted_images_are_named_and_chance_is_no_hint() {
    for target in [tag("tag36h11", 7), tag("tag36h11", 0), grid(3, 4, 0, "tag36h11")] {
        let image = photograph(&target, 2);
        for (changed, word) in [(mirrored(&image), "mirrored"), (inverted(&image), "inverted")] {
            assert_eq!(n_found(&target, &changed), 0);
            let said = not_found(&target, &changed);
            assert!(said.contains(&format!("it is there {word}")) && !said.contains("tag16h5"), "{said}");
        }
        let any = EveryTagFinder::new("any").unwrap().find(&mirrored(&image));
        assert!(any.is_empty(), "{:?}", any.iter().map(|f| (&f.family, f.tags.len())).collect::<Vec<_>>());
    }
    let board = Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.025 });
    let any = EveryTagFinder::new("any").unwrap().find(&photograph(&board, 3));
    assert!(any.is_empty(), "tags on a chessboard: {:?}", any.first().map(|f| &f.family));
}

/// A board seen in a mirror is found with its ids, and `detect` says that it is not to be relied on.
#[test]
fn detect_has_a_verdict_of_mirrored_boards() {
    let board = charuco(8, 5, 0.022, false);
    let image = photograph(&board, 4);
    let mut detector = Detector::new(&board).unwrap();
    assert_eq!(detect_target(&mut detector, &board, "a", &image).status, Status::Ok);
    let answer = detect_target(&mut detector, &board, "a", &mirrored(&image));
    assert_eq!(answer.status, Status::Inconsistent);
    assert!(
        answer.message.is_some_and(|message| message.contains("seen mirrored"))
            && !answer.detections.is_empty()
    );
    assert!(points(&board, &image).is_ok_and(|found| !found.is_empty()));
    assert!(points(&board, &mirrored(&image)).is_err_and(|reason| reason.contains("seen mirrored")));
}

/// Grids whose tags are turned by half against the file, whole and in part: no view is `ok`, and the convention is named wherever two tags show it.
#[test]
fn detect_accepts_no_grid_of_the_other_convention() {
    let (mut pcg, mut n_named) = (Pcg::new(5), 0);
    for seed in 0..16 {
        let names = ["tag36h11", "DICT_APRILTAG_36h11"];
        let [shown, stated] = [seed % 2, 1 - seed % 2].map(|k| grid(3, 4, 0, names[k as usize]));
        let mut within = |reach: f64| pcg.between(-reach, reach);
        let pose = Vector6::new(
            within(0.5),
            within(0.5),
            within(3.0),
            within(0.3),
            within(0.25),
            0.6 + within(0.15),
        );
        let image = photograph_at(&shown, pose, seed);
        let n_tags = n_found(&shown, &image) / 4;
        let mut detector = Detector::new(&stated).unwrap();
        let mut answer = detect_target(&mut detector, &stated, "a", &image);
        explain(&mut answer, &stated, &mut Explainer::default(), || Some(image.clone()));
        println!(
            "{seed}: {n_tags} tags; {:?} {} {:?}",
            answer.status,
            answer.detections.len(),
            answer.message
        );
        if 2 <= n_tags {
            assert_eq!(answer.status, Status::NotFound, "view {seed}: {} points", answer.detections.len());
        }
        if 4 <= n_tags {
            let message = answer.message.unwrap_or_default();
            assert!(message.contains("each tag is turned by half"), "view {seed}: {message}");
            n_named += 1;
        }
    }
    assert!(8 <= n_named, "{n_named} views show four tags");
}

/// A session explains what its first image shows instead, and no other image.
#[test]
fn a_session_explains_one_image() {
    let (stated, image) = (tag("tag36h11", 3), photograph(&tag("tag36h11", 4), 5));
    let mut explainer = Explainer::default();
    assert!(explainer.explain(&stated, || Some(image.clone())).contains("none with id 3: 4"));
    let said = explainer.explain(&stated, || panic!("the second image is not searched"));
    assert_eq!(said, missing(&stated));
}

/// `intrinsics` says what `detect` says, and that a single tag is too little.
#[test]
fn intrinsics_says_what_is_there_instead() {
    let image = photograph(&charuco(8, 5, 0.022, false), 6);
    let of = |target: Target, image: GrayImage| {
        let images =
            (0..3).map(|k| resight::rig::CameraImage::in_memory("camera", format!("{k}"), image.clone()));
        let source = IntrinsicsSource::Images { images: images.collect(), options: Default::default() };
        let mut request = IntrinsicsRequest::new(source);
        request.targets.push(("board".into(), target));
        request.cameras.push("camera".into());
        let answer = intrinsics(&request).unwrap();
        (answer.cameras[0].status, answer.cameras[0].message.clone())
    };
    let (status, message) = of(charuco(5, 8, 0.022, false), image);
    assert_eq!(status, Status::NotFound);
    assert!(message.contains("in any of 3 images; in the first one, no ChArUco board"), "{message}");
    assert!(message.contains("rows and columns exchanged"), "{message}");
    let (status, message) = of(tag("tag36h11", 3), photograph(&tag("tag36h11", 3), 7));
    assert_eq!(status, Status::Degenerate);
    assert!(message.contains("4 points at most, 6 are needed") && message.contains("--id 0-11"), "{message}");
}
