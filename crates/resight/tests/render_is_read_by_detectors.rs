//! What is rendered is what the established detectors read: ids, corner order and sub-pixel place.
//!
//! The bounds are the detectors' own errors (about 0.02 to 0.1 px on such images), so a shift of a tenth of a pixel,
//! a mirrored code or a half-pixel origin fails.
#![allow(unsafe_code)] // The AprilTag detector is a C library.

use apriltag_sys as sys;
use calib_targets_charuco::{CharucoBoardSpec, CharucoDetector, CharucoParams, MarkerLayout};
use calib_targets_chessboard::{ChessboardDetector, detect_corner_frame};
use calib_targets_core::{GrayImageView, default_chess_config};
use resight::GrayImage;
use resight::render::{Finish, Placed, Scene, Style, family, render, true_pixels};
use resight_core::camera::{CameraMatrix, ImageSize, Pinhole};
use resight_core::target::{AprilGrid, Charuco, Chessboard, Feature, MapTag, Tag, TagMap};
use resight_core::{Camera, Lens, Pixel, Point, Pose, Target, Vector6};

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 905.0, cx_px: 650.3, cy_px: 470.8 };
    let size = Some(ImageSize { width_px: 1280, height_px: 960 });
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
}

fn pose(rotation: [f64; 3], translation: [f64; 3]) -> Pose {
    let [a, b, c] = rotation;
    let turn = Pose::exp(&Vector6::new(a, b, c, 0.0, 0.0, 0.0));
    Pose::new(turn.rotation, Point::from(translation))
}

/// (id, corners top-left, top-right, bottom-right, bottom-left of the upright tag, px).
fn apriltags(image: &GrayImage) -> Vec<(u32, [Pixel; 4])> {
    let (w, h) = (image.width_px, image.height_px);
    let mut found = Vec::new();
    // SAFETY: every object is created by the library, used while alive and destroyed once; the copied rows fit the stride.
    unsafe {
        let made = sys::tag36h11_create();
        let detector = sys::apriltag_detector_create();
        sys::apriltag_detector_add_family_bits(detector, made, 1);
        (*detector).quad_decimate = 1.0;
        let picture = sys::image_u8_create(w, h);
        for v in 0..h {
            let from = image.data[(v * w) as usize..].as_ptr();
            std::ptr::copy_nonoverlapping(
                from,
                (*picture).buf.add((v as i32 * (*picture).stride) as usize),
                w as usize,
            );
        }
        let detections = sys::apriltag_detector_detect(detector, picture);
        for i in 0..(*detections).size {
            let entry = (*detections).data.add((i * 8) as usize) as *mut *mut sys::apriltag_detection_t;
            let detection = &**entry;
            let corner = |k: usize| Pixel::new(detection.p[k][0] - 0.5, detection.p[k][1] - 0.5);
            // The library counts from the bottom left, through the bottom right.
            found.push((detection.id as u32, [corner(3), corner(2), corner(1), corner(0)]));
        }
        sys::apriltag_detections_destroy(detections);
        sys::image_u8_destroy(picture);
        sys::apriltag_detector_destroy(detector);
        sys::tag36h11_destroy(made);
    }
    found
}

fn worst_corner_px(placed: &Placed, seen: &[(u32, [Pixel; 4])]) -> (usize, f64) {
    let truth = true_pixels(placed, &camera());
    let at = |id: u32, corner: u8| truth.iter().find(|(f, _)| *f == Feature { id, corner }).map(|t| t.1);
    let mut worst: f64 = 0.0;
    for (id, corners) in seen {
        for corner in 0..4u8 {
            let true_pixel = at(*id, corner).expect("a tag that is not in the scene was detected");
            worst = worst.max((true_pixel - corners[corner as usize]).norm());
        }
    }
    (seen.len(), worst)
}

#[test]
fn apriltag_corners_are_where_the_pose_puts_them() {
    let tag = Tag { family: "tag36h11".into(), id: 42, size_m: 0.2 };
    for (rotation, z) in
        [([0.0; 3], 0.9), ([0.3, -0.5, 0.2], 1.0), ([0.5, 0.2, 1.9], 1.2), ([-0.4, 0.1, 3.0], 0.8)]
    {
        let at = pose(rotation, [0.05, -0.03, z]);
        let scene = Scene::of(Target::Tag(tag.clone()), at, Style::default());
        let image = render(&scene, &camera(), &Finish::default()).unwrap();
        let (n, worst) = worst_corner_px(&scene.placed[0], &apriltags(&image));
        assert_eq!(n, 1, "{rotation:?}");
        assert!(worst < 0.15, "{rotation:?}: {worst} px");
    }
}

#[test]
fn tag_map_shows_each_tag_in_its_place() {
    let at = |x: f64, y: f64, turn: f64| pose([0.0, turn, 0.3], [x, y, 0.2 * turn]);
    let tag = |id: u32, world_from_tag: Pose| MapTag {
        id,
        size_m: 0.15,
        world_from_tag,
        sigma_m: 0.0,
        sigma_rad: 0.0,
    };
    let tags = vec![tag(3, at(-0.3, -0.1, 0.4)), tag(17, at(0.0, 0.1, 0.0)), tag(99, at(0.3, 0.0, -0.4))];
    let map = Target::TagMap(TagMap { family: "tag36h11".into(), tags, joint_covariance: None });
    let scene = Scene::of(map, pose([0.1, 0.2, 0.1], [0.0, 0.0, 1.1]), Style::default());
    let image = render(&scene, &camera(), &Finish::default()).unwrap();
    let (n, worst) = worst_corner_px(&scene.placed[0], &apriltags(&image));
    assert_eq!(n, 3);
    assert!(worst < 0.15, "{worst} px");
}

/// The plain AprilTag detector loses some tags that touch corner squares; those it finds must be right.
#[test]
fn april_grid_has_kalibrs_ids_and_frame() {
    let grid = AprilGrid {
        family: "tag36h11".into(),
        rows: 3,
        columns: 4,
        tag_size_m: 0.1,
        tag_spacing_ratio: 0.3,
        first_id: 0,
    };
    // Kalibr's y runs up: half a turn about x brings the board upright before the camera.
    let upright = pose([std::f64::consts::PI, 0.0, 0.0], [-0.25, 0.2, 0.6]);
    let style = Style { tag_border_bits: Some(1), ..Style::default() };
    let scene = Scene::of(Target::AprilGrid(grid), pose([0.1, 0.1, 0.0], [0.0; 3]) * upright, style);
    let image = render(&scene, &camera(), &Finish::default()).unwrap();
    let (n, worst) = worst_corner_px(&scene.placed[0], &apriltags(&image));
    assert!(3 <= n, "only {n} tags");
    assert!(worst < 0.5, "{worst} px");
}

/// An image as the detectors of `calib-targets` take it.
fn view(image: &GrayImage) -> GrayImageView<'_> {
    GrayImageView { width: image.width_px as usize, height: image.height_px as usize, data: &image.data }
}

#[test]
fn charuco_corners_are_where_the_pose_puts_them() {
    let name = "DICT_4X4_50";
    let board = Charuco {
        rows: 7,
        columns: 5,
        square_m: 0.04,
        marker_m: 0.03,
        dictionary: name.into(),
        legacy_pattern: false,
    };
    let at = pose([0.3, -0.2, 0.4], [-0.05, -0.15, 0.45]);
    let scene = Scene::of(Target::Charuco(board), at, Style::default());
    let image = render(&scene, &camera(), &Finish::default()).unwrap();
    let dictionary = calib_targets_aruco::resolve_dictionary(name).unwrap();
    let spec =
        CharucoBoardSpec::new(7, 5, 1.0, 0.75, dictionary).with_marker_layout(MarkerLayout::OpenCvCharuco);
    let detector = CharucoDetector::new(CharucoParams::for_board(spec)).unwrap();
    let found = detector.detect(&view(&image)).unwrap();
    assert_eq!(found.corners.len(), 24);
    let truth = true_pixels(&scene.placed[0], &camera());
    for corner in &found.corners {
        let (_, p) = truth.iter().find(|(f, _)| f.id == corner.id).unwrap();
        let off = (p - Pixel::new(corner.position.x as f64, corner.position.y as f64)).norm();
        assert!(off < 0.4, "corner {}: {off} px", corner.id);
    }
}

#[test]
fn chessboard_corners_are_where_the_pose_puts_them() {
    let board = Chessboard { rows: 5, columns: 8, square_m: 0.03 };
    let scene =
        Scene::of(Target::Chessboard(board), pose([0.2, 0.3, -0.3], [-0.1, -0.05, 0.4]), Style::default());
    let image = render(&scene, &camera(), &Finish::default()).unwrap();
    let corners = detect_corner_frame(&view(&image), &default_chess_config()).corners;
    let found = ChessboardDetector::new(Default::default()).unwrap().detect(&corners).unwrap();
    assert_eq!(found.corners.len(), 40);
    for (feature, p) in true_pixels(&scene.placed[0], &camera()) {
        let distance = |c: &Pixel| (p - c).norm();
        let seen = found.corners.iter().map(|c| Pixel::new(c.position.x as f64, c.position.y as f64));
        let off = seen.map(|c| distance(&c)).fold(f64::INFINITY, f64::min);
        assert!(off < 0.4, "corner {}: {off} px", feature.id);
    }
}

/// Two sources of the same codes agree cell by cell; OpenCV's `DICT_APRILTAG_36h11` is `tag36h11` upside down.
#[test]
fn both_code_sources_print_the_same_tags() {
    let turned = |cells: &family::Cells, quarter: usize| {
        let n = cells.per_side;
        let at = |r: usize, c: usize| match quarter {
            0 => cells.is_white(r, c),
            1 => cells.is_white(c, n - 1 - r),
            2 => cells.is_white(n - 1 - r, n - 1 - c),
            _ => cells.is_white(n - 1 - c, r),
        };
        (0..n * n).map(|i| at(i / n, i % n)).collect::<Vec<_>>()
    };
    for (own, opencv) in [("tag36h11", "DICT_APRILTAG_36h11"), ("tag25h9", "DICT_APRILTAG_25h9")] {
        for id in [0, 7, 20] {
            let (a, b) = (family::cells(own, id).unwrap(), family::cells(opencv, id).unwrap());
            let quarters: Vec<usize> = (0..4).filter(|q| turned(&b, *q) == a.white).collect();
            assert_eq!(quarters, [2], "{own} {id}");
        }
    }
}

/// A frame of two bits around the same code, as Kalibr prints it.
#[test]
fn wider_border_keeps_the_code() {
    let narrow = family::cells("tag36h11", 5).unwrap();
    let wide = narrow.with_border(2);
    assert_eq!((narrow.per_size, wide.per_size), (8, 10));
    for row in 0..6 {
        for column in 0..6 {
            assert_eq!(narrow.is_white(row + 2, column + 2), wide.is_white(row + 3, column + 3));
        }
    }
    assert!(wide.has_black_frame() && !wide.is_white(2, 5) && wide.is_white(0, 5));
}
