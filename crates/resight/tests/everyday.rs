//! Everyday mistakes and surroundings before the detectors: copies of a target, boards of another size or symmetry, tags cut at their border, a tag
//! of a grid.

use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{AprilGrid, Charuco, Chessboard, LinePlusOne, Tag};
use resight::core::{Camera, CameraMatrix, Lens, Pixel, Point, Pose, Target, Vector6};
use resight::detect::dots::DotError;
use resight::detect::follow::Follower;
use resight::detect::{DetectError, Detector};
use resight::locate::{LocateOptions, locate_image};
use resight::render::{Finish, Pcg, Placed, Scene, Style, render, true_pixels};
use resight::{GrayImage, Status};

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 639.5, cy_px: 479.5 };
    let size = Some(ImageSize { width_px: 1280, height_px: 960 });
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size }
}

fn tag(id: u32) -> Target {
    Target::Tag(Tag { family: "tag36h11".into(), id, size_m: 0.08 })
}

fn chessboard(rows: u32, columns: u32) -> Target {
    Target::Chessboard(Chessboard { rows, columns, square_m: 0.03 })
}

fn charuco() -> Target {
    let dictionary = "DICT_4X4_50".into();
    Target::Charuco(Charuco {
        rows: 5,
        columns: 7,
        square_m: 0.04,
        marker_m: 0.03,
        dictionary,
        legacy_pattern: false,
    })
}

fn grid() -> Target {
    let family = "tag36h11".into();
    Target::AprilGrid(AprilGrid {
        rows: 3,
        columns: 4,
        tag_size_m: 0.06,
        tag_spacing_ratio: 0.3,
        first_id: 0,
        family,
    })
}

/// Its middle at a place before the camera, metres, rotated by `[x, y, z]` from facing the camera.
fn placed(target: &Target, middle: [f64; 3], rotated: [f64; 3]) -> Placed {
    let points: Vec<Point> =
        target.features().iter().filter_map(|f| target.point(*f)).map(|p| p.position).collect();
    let own = points.iter().sum::<Point>() / points.len() as f64;
    let flip = match target {
        // It has z towards the camera.
        Target::AprilGrid(_) => nalgebra::Matrix3::from_diagonal(&nalgebra::Vector3::new(1.0, -1.0, -1.0)),
        _ => nalgebra::Matrix3::identity(),
    };
    let rotation =
        Pose::exp(&Vector6::new(rotated[0], rotated[1], rotated[2], 0.0, 0.0, 0.0)).rotation * flip;
    let pose = Pose::new(rotation, Point::from(middle) - rotation * own);
    Placed { target: target.clone(), cam_from_target: pose, style: Style::default() }
}

fn photograph(placed: Vec<Placed>, background: f64, seed: u64) -> GrayImage {
    let finish = Finish { seed, ..Finish::default() };
    render(&Scene { placed, background, clutter: Vec::new() }, &camera(), &finish).unwrap()
}

fn dots() -> Target {
    Target::LinePlusOne(LinePlusOne { line_m: [0.0, 0.15, 0.25], off_m: [0.1, 0.125] })
}

/// Three tags of one id, two boards of each kind, of like and of unlike size: always an error that counts them, never one of them.
#[test]
fn copies_are_counted_before_anything_is_accepted() {
    let mut pcg = Pcg::new(4);
    for scene in 0..6 {
        let mut turn = || [pcg.between(-0.4, 0.4), pcg.between(-0.4, 0.4), pcg.between(-0.6, 0.6)];
        let far = [1.0, 1.3, 1.6][scene % 3];
        let tags = vec![
            placed(&tag(7), [-0.25, -0.1, 0.8], turn()),
            placed(&tag(7), [0.3 * far, 0.1 * far, far], turn()),
            placed(&tag(7), [0.1, 0.25, 1.1], turn()),
        ];
        let found = Detector::new(&tag(7)).unwrap().detect(&photograph(tags, 120.0, scene as u64));
        assert_eq!(found, Err(DetectError::Copies { id: 7, count: 3 }), "scene {scene}");
        for target in [chessboard(6, 9), grid(), charuco()] {
            let boards = vec![
                placed(&target, [-0.3, 0.0, 0.9], turn()),
                placed(&target, [0.3 * far, 0.05 * far, far], turn()),
            ];
            let image = photograph(boards, 120.0, scene as u64);
            let found = Detector::new(&target).unwrap().detect(&image);
            let is_counted = matches!(found, Err(DetectError::BoardCopies { count: 2, .. }));
            assert!(is_counted, "scene {scene}, {}: {:?}", target.kind(), found.map(|found| found.len()));
        }
    }
}

/// Two or three of the same dots, of like and of unlike size, with and without a known lens, in one image and in a film.
#[test]
fn copies_of_dots_are_counted() {
    let mut pcg = Pcg::new(6);
    for (scene, far) in [0.9, 1.3, 2.2].into_iter().enumerate() {
        let mut turn = || [pcg.between(-0.4, 0.4), pcg.between(-0.4, 0.4), pcg.between(-0.6, 0.6)];
        let mut all = vec![
            placed(&dots(), [-0.25, -0.15, 0.9], turn()),
            placed(&dots(), [0.3 * far, 0.1 * far, far], turn()),
            placed(&dots(), [-0.3, 0.3, 1.2], turn()),
        ];
        for count in [3, 2] {
            all.truncate(count);
            let image = photograph(all.clone(), 120.0, scene as u64);
            let error = Err(DetectError::Dots(DotError::Copies { count }));
            assert_eq!(Detector::new(&dots()).unwrap().detect(&image), error, "scene {scene}");
            assert_eq!(Detector::new(&dots()).unwrap().detect_with_camera(&image, &camera()), error);
            let mut follower = Follower::new(&dots()).unwrap();
            assert_eq!(follower.detect(&image, &camera(), 0.0, &[]), error);
        }
        all.truncate(1);
        let one = photograph(all, 120.0, scene as u64);
        assert_eq!(Detector::new(&dots()).unwrap().detect(&one).unwrap().len(), 4);
    }
}

/// A tag hangs beside an AprilGrid that has the same tag, as another copy of it.
#[test]
fn a_tag_beside_a_grid_with_the_same_tag_is_a_copy() {
    for (scene, far) in [0.9, 1.5].into_iter().enumerate() {
        let board = placed(&grid(), [-0.25 * far, 0.0, far], [0.1, 0.2, 0.1]);
        let beside = |id| placed(&tag(id), [0.3, 0.1, 0.9], [0.2, 0.1, 0.1]);
        let image = photograph(vec![board.clone(), beside(7)], 120.0, scene as u64);
        let found = Detector::new(&tag(7)).unwrap().detect(&image);
        assert_eq!(found, Err(DetectError::Copies { id: 7, count: 2 }), "{far} m");
        // The grid has no tag 12.
        let image = photograph(vec![board, beside(12)], 120.0, scene as u64);
        assert_eq!(Detector::new(&tag(12)).unwrap().detect(&image).unwrap().len(), 4, "{far} m");
    }
}

/// A tag with the id of one of the grid's hangs beside it: the grid is found, that tag plays no part.
#[test]
fn a_lone_tag_beside_a_board_is_no_copy() {
    let scene =
        vec![placed(&grid(), [-0.1, 0.0, 0.9], [0.2, -0.1, 0.1]), placed(&tag(5), [0.4, 0.1, 1.0], [0.0; 3])];
    let found = Detector::new(&grid()).unwrap().detect(&photograph(scene.clone(), 120.0, 1)).unwrap();
    assert_eq!(found.len(), 48);
    for (feature, pixel) in true_pixels(&scene[0], &camera()) {
        let seen = found.iter().find(|d| d.feature == feature).unwrap();
        assert!((seen.pixel - pixel).norm() < 0.5, "{feature:?}");
    }
}

/// A count that is off by one in either direction finds nothing and names the grid that is there, and so do exchanged squares and corners.
#[test]
fn a_count_off_by_one_is_not_found_and_named() {
    for (k, rotated) in [[0.3, -0.2, 0.1], [-0.4, 0.2, 1.4]].into_iter().enumerate() {
        let image = photograph(vec![placed(&chessboard(6, 9), [0.0, 0.0, 0.5], rotated)], 120.0, k as u64);
        let found = Detector::new(&chessboard(6, 9)).unwrap().detect(&image).unwrap();
        assert_eq!(found.len(), 54, "{rotated:?}");
        for (rows, columns) in [(5, 9), (6, 8), (7, 9), (6, 10), (10, 7)] {
            let target = chessboard(rows, columns);
            let answer = locate_image(&image, &camera(), &target, &LocateOptions::default()).unwrap();
            let message = answer.verdict.message.clone();
            assert_eq!(answer.status(), Status::NotFound, "{rows} × {columns}, {rotated:?}: {message}");
            assert!(
                message.contains("a grid of 6 × 9 inner corners is there"),
                "{rows} × {columns}: {message}"
            );
        }
    }
}

/// A board that looks the same after half a turn has two poses, and the true one is among them, whichever way up it is seen.
#[test]
fn a_symmetric_board_is_ambiguous() {
    for (rows, columns, n) in [(5, 7, 2), (6, 6, 4), (7, 7, 2)] {
        for roll in [0.1, 3.0, -1.5] {
            let board = placed(&chessboard(rows, columns), [0.0, 0.0, 0.5], [0.3, -0.2, roll]);
            let truth = board.cam_from_target;
            let image = photograph(vec![board], 120.0, 3);
            let answer =
                locate_image(&image, &camera(), &chessboard(rows, columns), &LocateOptions::default())
                    .unwrap();
            assert_eq!(answer.status(), Status::Ambiguous, "{}", answer.verdict.message);
            assert!(answer.verdict.message.contains("looks the same after"), "{}", answer.verdict.message);
            let estimate = answer.estimate.unwrap();
            assert!((estimate.probability - 1.0 / n as f64).abs() < 1e-6, "{}", estimate.probability);
            let off = |pose: &Pose| (pose.translation - truth.translation).norm();
            let alike = estimate.minima().filter(|h| h.is_alternative);
            let minima: Vec<f64> = alike.map(|h| off(&h.minimum.cam_from_target)).collect();
            let nearest = minima.iter().copied().fold(f64::INFINITY, f64::min);
            assert!(nearest < 5e-3 && minima.len() == n, "{rows} × {columns}: {minima:?}");
        }
    }
    let image = photograph(vec![placed(&chessboard(6, 9), [0.0, 0.0, 0.5], [0.3, -0.2, 0.1])], 120.0, 3);
    let answer = locate_image(&image, &camera(), &chessboard(6, 9), &LocateOptions::default()).unwrap();
    assert_eq!(answer.status(), Status::Ok, "{}", answer.verdict.message);
}

/// A tag cut at its black border, on grounds of any brightness that shows it: its corners are within their sigma, in the mean of many.
#[test]
fn a_tag_without_a_white_margin_is_measured_where_it_is() {
    let mut worst = 0.0f64;
    for (k, background) in [230.0, 180.0, 150.0, 120.0, 100.0, 90.0].into_iter().enumerate() {
        let (mut squares, mut n) = (0.0, 0.0);
        for (scene, [distance, tilt]) in
            [[0.8, 0.2], [1.6, 0.3], [2.4, 0.1], [1.2, -0.6]].into_iter().enumerate()
        {
            let mut one = placed(&tag(7), [0.1, -0.05, distance], [tilt, 0.2, 0.4]);
            one.style.margin_m = Some(0.0);
            let truth = true_pixels(&one, &camera());
            let image = photograph(vec![one], background, (10 * k + scene) as u64);
            let Ok(found) = Detector::new(&tag(7)).unwrap().detect(&image) else { panic!("copies") };
            for d in found {
                let pixel = truth.iter().find(|(feature, _)| *feature == d.feature).unwrap().1;
                squares += (d.pixel - pixel).norm_squared() / (2.0 * d.total_sigma_px().powi(2));
                worst = worst.max((d.pixel - pixel).amax());
                n += 1.0;
            }
        }
        assert!(8.0 <= n && squares / n < 2.0, "ground {background}: {n} corners, NEES {}", squares / n);
    }
    println!("worst corner {worst:.3} px off");
    assert!(worst < 0.3, "{worst}");
}

/// A single tag that is part of an AprilGrid has a pose like any other.
#[test]
fn a_tag_inside_an_april_grid_is_found() {
    let board = placed(&grid(), [0.0, 0.0, 0.6], [0.25, -0.2, 0.1]);
    let truth = true_pixels(&board, &camera());
    let image = photograph(vec![board], 120.0, 5);
    for id in [0, 5, 11] {
        let one = Target::Tag(Tag { family: "tag36h11".into(), id, size_m: 0.06 });
        let found = Detector::new(&one).unwrap().detect(&image).unwrap();
        assert_eq!(found.len(), 4, "id {id}");
        for d in found {
            let pixel: Pixel = truth.iter().find(|(feature, _)| *feature == d.feature).unwrap().1;
            assert!((d.pixel - pixel).norm() < 0.3, "id {id}: {}", d.pixel - pixel);
        }
    }
    let other = Target::Tag(Tag { family: "tag36h11".into(), id: 12, size_m: 0.06 });
    assert!(Detector::new(&other).unwrap().detect(&image).unwrap().is_empty());
}

/// Three stripes of shadow that take 40 to 70 % of the light, with soft or hard edges, across border, margin and bits of a tag.
#[test]
fn tags_under_stripes_of_shadow_are_found() {
    let mut pcg = Pcg::new(9);
    for (softness_px, least) in [(4.0, 10), (1.0, 5)] {
        let (mut n_found, mut worst) = (0, 0.0f64);
        for scene in 0..12 {
            let rotated = [pcg.between(-0.4, 0.4), pcg.between(-0.4, 0.4), pcg.between(-1.5, 1.5)];
            let one = placed(&tag(7), [0.1, -0.1, pcg.between(1.2, 2.2)], rotated);
            let truth = true_pixels(&one, &camera());
            let mut image = photograph(vec![one], 140.0, scene);
            let middle = truth.iter().map(|(_, pixel)| *pixel).sum::<Pixel>() / 4.0;
            let edge_px = (truth[0].1 - truth[1].1).norm();
            for _ in 0..3 {
                let angle = pcg.between(0.0, std::f64::consts::PI);
                let (offset, half) =
                    (edge_px * pcg.between(-0.5, 0.5), 0.5 * edge_px * pcg.between(0.2, 0.8));
                let taken = pcg.between(0.4, 0.7);
                for (k, value) in image.data.iter_mut().enumerate() {
                    let at = Pixel::new((k % 1280) as f64, (k / 1280) as f64) - middle;
                    let beyond = (at.x * angle.cos() + at.y * angle.sin() - offset).abs() - half;
                    *value = (f64::from(*value) * (1.0 - taken / (1.0 + (beyond / softness_px).exp()))) as u8;
                }
            }
            let found = Detector::new(&tag(7)).unwrap().detect(&image).unwrap();
            n_found += usize::from(found.len() == 4);
            for d in found {
                let pixel = truth.iter().find(|(feature, _)| *feature == d.feature).unwrap().1;
                worst = worst.max((d.pixel - pixel).norm() / d.total_sigma_px());
            }
        }
        println!("softness {softness_px} px: {n_found} of 12, worst corner {worst:.1} sigma");
        assert!(least <= n_found, "softness {softness_px} px: {n_found} of 12");
    }
}
