//! Detectors on images of known geometry: ids, corner order, pixel origin, accuracy, and what is not there.

use crate::detect_support::*;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::*;
use resight::core::{Pixel, Point, Pose, Target};
use resight::detect::families::{APRILTAG_FAMILIES, marker_pattern};
use resight::detect::{CornerWindow, DetectError, Detector};

fn detect(target: Target, image: &GrayImage) -> Vec<Detection> {
    Detector::new(&target).unwrap().detect(image).unwrap()
}

fn tag(family: &str, id: u32) -> Target {
    Target::Tag(Tag { family: family.into(), id, size_m: 1.0 })
}

/// Errors of all detections against the target's own geometry; `plane` maps target metres to plane units.
fn errors(
    target: &Target,
    found: &[Detection],
    view: &View,
    plane: impl Fn(Point) -> (f64, f64),
) -> Vec<Pixel> {
    let place = |d: &Detection| plane(target.point(d.feature).expect("a feature of the target").position);
    found.iter().map(|d| (place(d), d.pixel)).map(|((x, y), pixel)| pixel - view.at(x, y)).collect()
}

fn mean(differences: &[Pixel]) -> Pixel {
    differences.iter().sum::<Pixel>() / differences.len() as f64
}

/// Proves ids, corner order and pixel origin at once: a wrong order is off by an edge, a wrong origin by 0.5 px.
#[test]
fn every_family_is_read_in_every_orientation() {
    let dictionaries = [
        "DICT_4X4_50",
        "DICT_5X5_100",
        "DICT_6X6_250",
        "DICT_7X7_1000",
        "DICT_ARUCO_ORIGINAL",
        "DICT_APRILTAG_36h11",
    ];
    let mut all = Vec::new();
    for family in APRILTAG_FAMILIES.iter().chain(&dictionaries) {
        for (k, roll) in [0.0, 75.0, 170.0, 290.0].into_iter().enumerate() {
            let id = [3, 11, 17, 29][k];
            let view = View::new(Pixel::new(161.3, 118.8), 90.0, roll, 25.0);
            let image = photograph(320, 240, &view, lone_marker(family, id));
            let target = tag(family, id);
            let found = detect(target.clone(), &image);
            assert_eq!(found.len(), 4, "{family} id {id} at {roll}°");
            let errors = errors(&target, &found, &view, |x| (x.x, x.y));
            assert!(rms_px(&errors) < 0.10, "{family} id {id} at {roll}°: {errors:?}");
            all.extend(errors);
        }
    }
    println!("tags: {} corners, rms {:.3} px, mean {:?}", all.len(), rms_px(&all), mean(&all));
    assert!(rms_px(&all) < 0.04 && mean(&all).norm() < 0.02);
}

#[test]
fn another_id_is_not_the_one_looked_for() {
    let view = View::new(Pixel::new(160.0, 120.0), 90.0, 10.0, 0.0);
    let image = photograph(320, 240, &view, lone_marker("tag36h11", 5));
    assert!(detect(tag("tag36h11", 6), &image).is_empty());
    assert!(detect(tag("DICT_4X4_50", 5), &image).is_empty());
}

#[test]
fn copies_of_the_tag_are_named() {
    let ink = lone_marker("tag36h11", 2);
    let two = move |x: f64, y: f64| if x < 0.0 { ink(x + 1.5, y) } else { ink(x - 1.5, y) };
    let image = photograph(480, 240, &View::new(Pixel::new(240.0, 120.0), 80.0, 0.0, 0.0), two);
    let error = Detector::new(&tag("tag36h11", 2)).unwrap().detect(&image).unwrap_err();
    assert_eq!(error, DetectError::Copies { id: 2, count: 2 });
}

/// A coarse look must not cost accuracy: large and small tags of one image size.
#[test]
fn tags_of_all_sizes_are_placed_within_their_sigma() {
    for edge_px in [18.0, 24.0, 40.0, 90.0, 200.0, 330.0] {
        let view = View::new(Pixel::new(330.4, 241.7), edge_px, 33.0, 20.0);
        let image = photograph(640, 480, &view, lone_marker("tag36h11", 9));
        let target = tag("tag36h11", 9);
        let found = detect(target.clone(), &image);
        assert_eq!(found.len(), 4, "edge {edge_px} px");
        let errors = errors(&target, &found, &view, |x| (x.x, x.y));
        println!("edge {edge_px} px: rms {:.3} px, sigma {:.3} px", rms_px(&errors), found[0].sigma_px);
        assert!(rms_px(&errors) < found[0].total_sigma_px().min(0.25), "edge {edge_px} px: {errors:?}");
    }
}

#[test]
fn only_the_tags_of_a_map_are_reported() {
    let ink = [lone_marker("tag25h9", 1), lone_marker("tag25h9", 4)];
    let two = move |x: f64, y: f64| if x < 0.0 { ink[0](x + 1.5, y) } else { ink[1](x - 1.5, y) };
    let image = photograph(480, 240, &View::new(Pixel::new(240.0, 120.0), 80.0, 0.0, 0.0), two);
    let map_tag =
        |id| MapTag { id, size_m: 1.0, world_from_tag: Pose::identity(), sigma_m: 0.0, sigma_rad: 0.0 };
    let map = TagMap { family: "tag25h9".into(), tags: vec![map_tag(4), map_tag(8)], joint_covariance: None };
    let found = detect(Target::TagMap(map), &image);
    assert_eq!(
        found.iter().map(|d| (d.feature.id, d.feature.corner)).collect::<Vec<_>>(),
        [(4, 0), (4, 1), (4, 2), (4, 3)]
    );
}

/// The grid as Kalibr prints it: tags with a border of `border` cells, corner squares of the width of the gap.
fn aprilgrid_ink(grid: &AprilGrid, border: usize) -> impl Fn(f64, f64) -> Option<f64> + use<> {
    let (rows, columns, gap) = (grid.rows as f64, grid.columns as f64, grid.tag_spacing_ratio);
    let patterns: Vec<_> =
        (0..grid.rows * grid.columns).map(|id| marker_pattern("tag36h11", id).unwrap()).collect();
    // One unit is a tag; y up, tag 0 at the bottom left.
    move |x: f64, y: f64| {
        let pitch = 1.0 + gap;
        let on_paper = -0.8 < x && -0.8 < y && x < columns * pitch + 0.5 && y < rows * pitch + 0.5;
        let (column, row) = ((x / pitch).floor(), (y / pitch).floor());
        let (dx, dy) = (x - column * pitch, y - row * pitch);
        let square =
            1.0 <= dx && 1.0 <= dy && -1.0 <= column && -1.0 <= row && column < columns && row < rows;
        let on_tag = dx < 1.0 && dy < 1.0 && 0.0 <= column && 0.0 <= row && column < columns && row < rows;
        if !on_tag {
            return on_paper.then_some(if square { BLACK } else { WHITE });
        }
        let pattern = &patterns[row as usize * columns as usize + column as usize];
        // Stretch so that the six data cells fill the tag but for its border.
        let stretch = (6.0 + 2.0 * border as f64) / 8.0;
        let (mx, my) = ((dx - 0.5) * stretch, (0.5 - dy) * stretch);
        let inside = mx.abs() < 0.5 && my.abs() < 0.5;
        Some(if inside { marker_ink(pattern, mx, my).unwrap_or(BLACK) } else { BLACK })
    }
}

#[test]
fn aprilgrid_is_found_whole_with_either_border() {
    let grid = AprilGrid {
        family: "tag36h11".into(),
        rows: 4,
        columns: 5,
        tag_size_m: 1.0,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    };
    let target = Target::AprilGrid(grid.clone());
    for border in [1, 2] {
        // The plane's y runs up: mirror the view's rows.
        let mut view = View::new(Pixel::new(110.0, 410.0), 62.0, 4.0, 20.0);
        view.0 *= nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0);
        let image = photograph(640, 480, &view, aprilgrid_ink(&grid, border));
        let found = detect(target.clone(), &image);
        let ids: Vec<u32> = found.iter().map(|d| d.feature.id).collect();
        assert_eq!(found.len(), 4 * 20, "border {border}: {ids:?}");
        let errors = errors(&target, &found, &view, |x| (x.x, x.y));
        println!("aprilgrid border {border}: rms {:.3} px", rms_px(&errors));
        assert!(
            rms_px(&errors) < 0.08 && mean(&errors).norm() < 0.02,
            "border {border}: {}",
            rms_px(&errors)
        );
    }
}

/// The bits of tag 7 are covered, its joints are not: the tags around it say which joints they are.
#[test]
fn aprilgrid_tag_that_cannot_be_read_is_completed() {
    let grid = AprilGrid {
        family: "tag36h11".into(),
        rows: 4,
        columns: 5,
        tag_size_m: 1.0,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    };
    let target = Target::AprilGrid(grid.clone());
    let mut view = View::new(Pixel::new(110.0, 410.0), 62.0, 4.0, 20.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0);
    let ink = aprilgrid_ink(&grid, 2);
    let covered = |x: f64, y: f64| 2.7 < x && x < 3.5 && 1.4 < y && y < 2.2;
    let image = photograph(640, 480, &view, |x, y| if covered(x, y) { Some(BLACK) } else { ink(x, y) });
    let found = detect(target.clone(), &image);
    assert_eq!(found.len(), 80);
    assert!(rms_px(&errors(&target, &found, &view, |x| (x.x, x.y))) < 0.08);
}

/// A cover hides the right half of a column of tags, so none of them is read: their left corners are seen by their print.
#[test]
fn aprilgrid_corners_of_half_covered_tags_are_found() {
    let (rows, columns, first_id) = (4, 5, 0);
    let family = "tag36h11".into();
    let grid = AprilGrid { family, rows, columns, tag_size_m: 1.0, tag_spacing_ratio: 0.3, first_id };
    let mut view = View::new(Pixel::new(110.0, 410.0), 62.0, 4.0, 20.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, 0.0, 0.0, -1.0, 0.0, 0.0, 0.0, 1.0);
    let ink = aprilgrid_ink(&grid, 2);
    let image = photograph(640, 480, &view, |x, y| if 3.1 < x { Some(120.0) } else { ink(x, y) });
    let target = Target::AprilGrid(grid);
    let found = detect(target.clone(), &image);
    let half_covered = |d: &&Detection| d.feature.id % columns == 2;
    let corners: Vec<u8> = found.iter().filter(half_covered).map(|d| d.feature.corner).collect();
    assert_eq!(corners, [0, 3, 0, 3, 0, 3, 0, 3]);
    assert_eq!(found.len(), 40);
    assert!(rms_px(&errors(&target, &found, &view, |x| (x.x, x.y))) < 0.08);
}

fn chessboard(rows: u32, columns: u32) -> Target {
    Target::Chessboard(Chessboard { rows, columns, square_m: 1.0 })
}

/// Corner 0 is an inner corner: plane point (1, 1); the square on its inner side, (1, 1), is black.
fn chessboard_ink(rows: u32, columns: u32) -> impl Fn(f64, f64) -> Option<f64> {
    board_ink(rows as i32 + 1, columns as i32 + 1, |column, row| (column + row) % 2 == 0)
}

#[test]
fn chessboard_numbering_follows_the_black_corner_through_all_turns() {
    let target = chessboard(5, 8);
    // Not along the axes, where the image's own 4 × 4 samples are an eighth of a pixel coarse.
    for roll in [7.0, 97.0, 187.0, 277.0] {
        let mut view = View::new(Pixel::new(320.0, 240.0), 42.0, roll, 15.0);
        // Origin to the middle of the 9 × 6 squares.
        view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -4.5, 0.0, 1.0, -3.0, 0.0, 0.0, 1.0);
        let found = detect(target.clone(), &photograph(640, 480, &view, chessboard_ink(5, 8)));
        assert_eq!(found.len(), 40, "at {roll}°");
        let errors = errors(&target, &found, &view, |x| (x.x + 1.0, x.y + 1.0));
        println!("chessboard at {roll}°: rms {:.3} px", rms_px(&errors));
        assert!(rms_px(&errors) < 0.06 && mean(&errors).norm() < 0.02, "at {roll}°: {}", rms_px(&errors));
    }
}

/// With an even sum of rows and columns half a turn looks the same: the upright numbering is returned.
#[test]
fn symmetric_chessboard_is_numbered_upright() {
    let target = chessboard(4, 6);
    let mut view = View::new(Pixel::new(320.0, 240.0), 45.0, 165.0, 0.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -3.5, 0.0, 1.0, -2.5, 0.0, 0.0, 1.0);
    let found = detect(target, &photograph(640, 480, &view, chessboard_ink(4, 6)));
    assert_eq!(found.len(), 24);
    assert!(found[0].pixel.y < found[23].pixel.y && found[0].pixel.x < found[5].pixel.x);
}

#[test]
fn board_of_another_size_is_not_found() {
    let mut view = View::new(Pixel::new(320.0, 240.0), 42.0, 0.0, 15.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -4.5, 0.0, 1.0, -3.0, 0.0, 0.0, 1.0);
    let image = photograph(640, 480, &view, chessboard_ink(5, 8));
    assert!(detect(chessboard(6, 9), &image).is_empty());
}

fn charuco(rows: u32, columns: u32, legacy_pattern: bool) -> Charuco {
    let dictionary = "DICT_5X5_50".to_string();
    Charuco { rows, columns, square_m: 1.0, marker_m: 0.7, dictionary, legacy_pattern }
}

/// Drawn from OpenCV's description: markers along the rows of white squares; the legacy pattern of an even number of
/// rows starts with a white square.
fn charuco_ink(board: &Charuco) -> impl Fn(f64, f64) -> Option<f64> + use<> {
    let first_white = if board.legacy_pattern && board.rows.is_multiple_of(2) { 0 } else { 1 };
    let (rows, columns, size) = (board.rows as i32, board.columns as i32, board.marker_m);
    let white = move |column: i32, row: i32| (column + row) % 2 == first_white;
    let squares =
        (0..rows * columns).map(move |k| (k % columns, k / columns)).filter(move |s| white(s.0, s.1));
    let markers: std::collections::HashMap<_, _> =
        squares.zip(0..).map(|(square, id)| (square, marker_pattern("DICT_5X5_50", id).unwrap())).collect();
    let plain = board_ink(rows, columns, move |column, row| !white(column, row));
    move |x, y| {
        let square = (x.floor() as i32, y.floor() as i32);
        let local = |x: f64| (x - x.floor() - 0.5) / size;
        let marker = markers.get(&square).filter(|_| local(x).abs() < 0.5 && local(y).abs() < 0.5);
        marker.and_then(|pattern| marker_ink(pattern, local(x), local(y))).or_else(|| plain(x, y))
    }
}

#[test]
fn charuco_corners_carry_opencv_ids_in_both_patterns() {
    for (rows, legacy) in [(5, false), (6, false), (6, true), (5, true)] {
        let board = charuco(rows, 7, legacy);
        let target = Target::Charuco(board.clone());
        let mut view = View::new(Pixel::new(320.0, 240.0), 56.0, 20.0, 20.0);
        view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -3.5, 0.0, 1.0, -0.5 * rows as f64, 0.0, 0.0, 1.0);
        let found = detect(target.clone(), &photograph(640, 480, &view, charuco_ink(&board)));
        assert_eq!(found.len() as u32, (rows - 1) * 6, "{rows} rows, legacy {legacy}");
        let errors = errors(&target, &found, &view, |x| (x.x, x.y));
        println!("charuco {rows} rows, legacy {legacy}: rms {:.3} px", rms_px(&errors));
        assert!(rms_px(&errors) < 0.06 && mean(&errors).norm() < 0.02, "{rows} rows, legacy {legacy}");
        // The other pattern of an even board has other markers in other squares.
        if rows == 6 {
            let other = Target::Charuco(charuco(rows, 7, !legacy));
            assert!(detect(other, &photograph(640, 480, &view, charuco_ink(&board))).len() < 4);
        }
    }
}

/// Squares of 17 px, or short sides of 20 px: the markers are nearer to the corners than any detector of saddle points reaches. What is
/// printed around them is known, so all are found, and better than a twentieth of a pixel.
#[test]
fn charuco_corners_close_to_their_markers_are_found() {
    let board = charuco(5, 7, false);
    let target = Target::Charuco(board.clone());
    for (scale_px, tilt_deg) in [(17.0, 10.0), (40.0, 60.0), (60.0, 70.0)] {
        let mut view = View::new(Pixel::new(240.0, 160.0), scale_px, 15.0, tilt_deg);
        view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -3.5, 0.0, 1.0, -2.5, 0.0, 0.0, 1.0);
        let found = detect(target.clone(), &photograph(480, 320, &view, charuco_ink(&board)));
        let errors = errors(&target, &found, &view, |x| (x.x, x.y));
        println!("charuco {scale_px} px, {tilt_deg}°: {} of 24, rms {:.3} px", found.len(), rms_px(&errors));
        assert!(found.len() == 24 && rms_px(&errors) < 0.05, "{scale_px} px, {tilt_deg}°: {}", found.len());
    }
}

/// What hides a corner must not move it: half of the board behind a grey sheet shows the corners of the other half.
#[test]
fn covered_charuco_corners_are_not_invented() {
    let board = charuco(5, 7, false);
    let target = Target::Charuco(board.clone());
    let mut view = View::new(Pixel::new(320.0, 240.0), 56.0, 20.0, 20.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -3.5, 0.0, 1.0, -2.5, 0.0, 0.0, 1.0);
    let ink = charuco_ink(&board);
    let covered = |x: f64, y: f64| if 3.6 < x { Some(110.0) } else { ink(x, y) };
    let found = detect(target.clone(), &photograph(640, 480, &view, covered));
    let errors = errors(&target, &found, &view, |x| (x.x, x.y));
    let hidden = found.iter().filter(|d| 3 <= d.feature.id % 6).count();
    assert!(found.len() == 12 && hidden == 0 && rms_px(&errors) < 0.05, "{} corners", found.len());
}

/// Half of the board is out of the image; then printed white on black; then seen in a mirror.
#[test]
fn charuco_is_found_in_part_inverted_and_mirrored() {
    let board = charuco(5, 7, false);
    let target = Target::Charuco(board.clone());
    let part = View::new(Pixel::new(330.0, 60.0), 56.0, 8.0, 10.0);
    let ink = charuco_ink(&board);
    let found = detect(target.clone(), &photograph(480, 240, &part, &ink));
    let seen = errors(&target, &found, &part, |x| (x.x, x.y));
    assert!(2 <= found.len() && found.len() < 24 && rms_px(&seen) < 0.08, "{} corners", found.len());

    let mut view = View::new(Pixel::new(320.0, 240.0), 56.0, 20.0, 20.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -3.5, 0.0, 1.0, -2.5, 0.0, 0.0, 1.0);
    let inverted = photograph(640, 480, &view, |x, y| ink(x, y).map(|light| WHITE + BLACK - light));
    let found = detect(target.clone(), &inverted);
    assert!(found.len() == 24 && rms_px(&errors(&target, &found, &view, |x| (x.x, x.y))) < 0.06);

    view.0 *= nalgebra::Matrix3::new(-1.0, 0.0, 7.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    let found = detect(target.clone(), &photograph(640, 480, &view, ink));
    assert!(found.len() == 24 && rms_px(&errors(&target, &found, &view, |x| (x.x, x.y))) < 0.06);
}

#[test]
fn empty_tiny_and_torn_images_are_no_reason_to_fail() {
    let targets = [
        tag("tag36h11", 0),
        chessboard(5, 8),
        Target::Charuco(charuco(5, 7, false)),
        Target::AprilGrid(AprilGrid {
            family: "tag36h11".into(),
            rows: 6,
            columns: 6,
            tag_size_m: 1.0,
            tag_spacing_ratio: 0.3,
            first_id: 0,
        }),
    ];
    for target in &targets {
        let mut detector = Detector::new(target).unwrap();
        for (width, height) in [(0, 0), (1, 1), (3, 200), (200, 3), (31, 31), (64, 65), (130, 257)] {
            for value in [0, 128, 255] {
                let found = detector.detect(&GrayImage::filled(width, height, value)).unwrap();
                assert!(found.is_empty(), "{} in {width}×{height}", target.kind());
            }
        }
        let torn = GrayImage { width_px: 100, height_px: 100, data: vec![0; 99] };
        assert!(matches!(detector.detect(&torn), Err(DetectError::ImageBuffer { seen: 99, .. })));
    }
}

#[test]
fn targets_that_cannot_be_detected_say_why() {
    let refused = |target: &Target| Detector::new(target).err().expect("refused").to_string();
    assert!(refused(&Target::Points(Vec::new())).contains("points"));
    assert!(refused(&tag("tag99h1", 0)).contains("tag36h11"));
    assert!(refused(&tag("tag36h11", 999)).contains("0 to 586"));
    assert!(refused(&chessboard(1, 5)).contains("rows"));
    assert!(refused(&chessboard(70_000, 70_000)).contains("70000"));
    assert!(refused(&Target::Charuco(charuco(u32::MAX, u32::MAX, false))).contains("at most"));
    assert!(refused(&Target::Charuco(charuco(60, 60, false))).contains("0 to 49"));
}

/// On squares of 16 px a window of 11 px takes neighbours in, and pulls corners away from where they are; one of 5 px does not.
#[test]
fn corner_window_takes_in_what_it_reaches() {
    let target = chessboard(5, 8);
    let mut view = View::new(Pixel::new(160.0, 120.0), 16.0, 7.0, 35.0);
    view.0 *= nalgebra::Matrix3::new(1.0, 0.0, -4.5, 0.0, 1.0, -3.0, 0.0, 0.0, 1.0);
    let image = photograph(320, 240, &view, chessboard_ink(5, 8));
    let rms = |window: CornerWindow| {
        let found = Detector::with_corner_window(&target, window).unwrap().detect(&image).unwrap();
        assert_eq!(found.len(), 40);
        rms_px(&errors(&target, &found, &view, |x| (x.x + 1.0, x.y + 1.0)))
    };
    let (clear, near, wide) =
        (rms(CornerWindow::Clear), rms(CornerWindow::Half(5)), rms(CornerWindow::Half(11)));
    println!("corner windows: clear {clear:.3}, 5 px {near:.3}, 11 px {wide:.3} px");
    assert!(clear < 0.06 && near < 0.06 && 2.0 * clear < wide, "{clear} {near} {wide}");
}

#[test]
fn corner_window_that_cannot_be_is_refused_by_name() {
    let refused = |target: &Target, half_px: u32| {
        let window = CornerWindow::Half(half_px);
        Detector::with_corner_window(target, window).err().expect("refused").to_string()
    };
    assert!(refused(&tag("tag36h11", 0), 11).contains("this target is a tag"));
    assert!(refused(&chessboard(5, 8), 1).contains("2 to 50"));
    assert!(refused(&chessboard(5, 8), 51).contains("2 to 50"));
}
