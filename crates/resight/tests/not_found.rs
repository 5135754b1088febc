//! What is said of an image that does not show the target: what was looked for, and what is there instead.

use resight::GrayImage;
use resight::core::target::{AprilGrid, Charuco, Chessboard, LinePlusOne, MapTag, Tag, TagMap};
use resight::core::{Camera, CameraMatrix, Lens, Point, Pose, Target, Vector6};
use resight::detect::absent::not_found;
use resight::detect::every_tag::EveryTagFinder;
use resight::detect::{DetectError, Detector};
use resight::render::{Finish, Scene, Style, render};

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 319.5, cy_px: 239.5 };
    let size = Some(resight::core::camera::ImageSize { width_px: 640, height_px: 480 });
    Camera { lens: Lens::Pinhole(resight::core::camera::Pinhole { matrix }), size }
}

/// The target before the camera, its middle in the middle of the image.
fn photograph(target: &Target, distance_m: f64) -> GrayImage {
    let points: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    let middle = points.iter().sum::<Point>() / points.len() as f64;
    let turn = Pose::exp(&Vector6::new(0.15, -0.2, 0.05, 0.0, 0.0, 0.0)).rotation;
    let flip = match target {
        // It has z towards the camera.
        Target::AprilGrid(_) => nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0)),
        _ => nalgebra::Matrix3::identity(),
    };
    let rotation = turn * flip;
    let pose = Pose::new(rotation, Point::new(0.0, 0.0, distance_m) - rotation * middle);
    render(&Scene::of(target.clone(), pose, Style::default()), &camera(), &Finish::default()).unwrap()
}

fn tag(family: &str, id: u32) -> Target {
    Target::Tag(Tag { family: family.into(), id, size_m: 0.16 })
}

fn chessboard(rows: u32, columns: u32) -> Target {
    Target::Chessboard(Chessboard { rows, columns, square_m: 0.05 })
}

fn charuco(dictionary: &str) -> Target {
    let board = Charuco {
        rows: 5,
        columns: 7,
        square_m: 0.06,
        marker_m: 0.045,
        dictionary: dictionary.into(),
        legacy_pattern: false,
    };
    Target::Charuco(board)
}

fn grid(family: &str, first_id: u32) -> Target {
    let (rows, columns) = (3, 4);
    Target::AprilGrid(AprilGrid {
        rows,
        columns,
        tag_size_m: 0.08,
        tag_spacing_ratio: 0.3,
        first_id,
        family: family.into(),
    })
}

/// `wanted` is not found in a photograph of `shown`; each of `words` is said.
fn is_said(wanted: &Target, shown: &Target, distance_m: f64, words: &[&str]) {
    let image = photograph(shown, distance_m);
    assert!(
        Detector::new(shown).unwrap().detect(&image).unwrap().len() >= 4,
        "the image shows its own target"
    );
    assert!(Detector::new(wanted).unwrap().detect(&image).unwrap().is_empty(), "the wanted one is not there");
    let said = not_found(wanted, &image);
    for word in words {
        assert!(said.contains(word), "{word:?} is missing in: {said}");
    }
}

#[test]
fn other_ids_families_and_dictionaries_are_named() {
    is_said(&tag("tag36h11", 7), &tag("tag36h11", 76), 0.8, &["tag36h11 id 7", "none with id 7: 76"]);
    is_said(&tag("tag36h11", 7), &tag("tag25h9", 7), 0.8, &["no tag of tag36h11", "tags of tag25h9 are: 7"]);
    is_said(&tag("tag36h11", 7), &tag("DICT_5X5_50", 9), 0.8, &["tags of DICT_5X5_1000 are: 9"]);
    is_said(
        &charuco("DICT_5X5_50"),
        &charuco("DICT_4X4_50"),
        0.7,
        &["DICT_5X5_50", "tags of DICT_4X4_50 are: 0, 1, 2"],
    );
    is_said(&grid("tag36h11", 0), &grid("tag36h11", 40), 0.8, &["none with ids 0 to 11: 40, 41"]);
    is_said(
        &grid("tag25h9", 0),
        &grid("tag36h11", 0),
        0.8,
        &["no tag of tag25h9", "tags of tag36h11 are: 0, 1, 2"],
    );
}

#[test]
fn other_sizes_of_grid_are_named() {
    is_said(
        &chessboard(7, 10),
        &chessboard(6, 9),
        0.8,
        &["7 × 10 inner corners", "a grid of 6 × 9", "one less than squares"],
    );
    is_said(&chessboard(6, 9), &chessboard(5, 8), 0.8, &["a grid of 5 × 8", "count inner corners"]);
    is_said(&chessboard(6, 9), &grid("tag36h11", 0), 0.8, &["tags of tag36h11", "`aprilgrid`"]);
}

#[test]
fn dots_that_are_not_the_target_are_counted() {
    let dots = |off: f64| Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.1, 0.15], off_m: [off, 0.15] });
    is_said(&dots(0.14), &dots(0.0), 0.7, &["4 dark", "`line_m` and `off_m`"]);
    let blank = GrayImage::filled(320, 240, 128);
    assert!(not_found(&dots(0.0), &blank).contains("sharp and evenly lit"));
}

/// Every tag of any family: each once, under the family that it was printed in.
#[test]
fn tags_of_any_family_are_listed() {
    let mut finder = EveryTagFinder::new("any").unwrap();
    for family in
        ["tag36h11", "tag25h9", "tagStandard41h12", "DICT_4X4_50", "DICT_6X6_250", "DICT_ARUCO_ORIGINAL"]
    {
        let found = finder.find(&photograph(&tag(family, 5), 0.8));
        let seen: Vec<(&str, Vec<u32>)> =
            found.iter().map(|f| (f.family.as_str(), f.tags.iter().map(|t| t.id).collect())).collect();
        let name = if family == "DICT_6X6_250" { "DICT_6X6_1000" } else { family };
        assert_eq!(seen, [(name, vec![5])], "{family}");
    }
    let in_grid = finder.find(&photograph(&grid("tag36h11", 0), 0.8));
    let ids: Vec<u32> = in_grid[0].tags.iter().map(|t| t.id).collect();
    assert_eq!((in_grid.len(), in_grid[0].family.as_str(), ids), (1, "tag36h11", (0..12).collect()));
    assert!(finder.find(&GrayImage::filled(320, 240, 128)).is_empty());
    assert!(matches!(EveryTagFinder::new("tag99h1").map(|_| ()), Err(DetectError::UnknownFamily { .. })));
}

/// A copy of a tag of a map is left out and told; where nothing else is left, that is an error as for a single tag.
#[test]
fn copies_of_tags_of_a_map_are_reported() {
    let place = |id, x: f64| MapTag {
        id,
        size_m: 0.12,
        world_from_tag: Pose::new(nalgebra::Matrix3::identity(), Point::new(x, 0.0, 0.0)),
        sigma_m: 0.0,
        sigma_rad: 0.0,
    };
    let map = |tags| Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None });
    let mut shown = photograph(&map(vec![place(1, -0.15), place(2, 0.15)]), 0.9);
    let mut own = Detector::new(&map(vec![place(1, -0.15), place(2, 0.15)])).unwrap();
    assert_eq!((own.detect(&shown).unwrap().len(), own.copies().len()), (8, 0));
    // The left half, tag 1, in the place of the right one too.
    let half = shown.width_px as usize / 2;
    for row in shown.data.chunks_mut(2 * half) {
        let (left, right) = row.split_at_mut(half);
        right.copy_from_slice(left);
    }
    let both = [place(1, -0.15), place(2, 0.15)];
    let mut detector = Detector::new(&map(both.to_vec())).unwrap();
    assert_eq!(detector.detect(&shown), Err(DetectError::Copies { id: 1, count: 2 }));
    let mut three = GrayImage::filled(640, 960, 128);
    three.data[..640 * 480].copy_from_slice(&shown.data);
    three.data[640 * 480..].copy_from_slice(&photograph(&map(vec![place(2, 0.0)]), 0.9).data);
    assert_eq!(detector.detect(&three).unwrap().len(), 4);
    assert_eq!(detector.copies(), [(1, 2)]);
    assert!(detector.remarks().next().unwrap().contains("tag 1 is seen 2 times"));
}
