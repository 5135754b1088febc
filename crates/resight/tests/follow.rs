//! Following a target: the same corners as in the whole image, and nothing that leaves its place is lost.

use crate::film_support::{TAG_M, camera, film, map, tag, tag_pose, trembling};
use nalgebra::Vector6;
use resight::GrayImage;
use resight::core::correspondence::Detection;
use resight::core::target::{AprilGrid, Charuco, Chessboard, Feature};
use resight::core::{Pixel, Pose, Target};
use resight::detect::follow::{Extent, Follower, ROUND_S};
use resight::detect::{DetectError, Detector};
use resight::render::{Finish, Placed, Scene, Style, clutter, render};

const FRAME_S: f64 = 1.0 / 30.0;

/// Where a pose puts the features, as a tracker would expect them.
fn expected(target: &Target, cam_from_target: &Pose) -> Vec<(Feature, Pixel)> {
    let pixel = |feature| {
        let x_in_target = target.point(feature)?.position;
        Some((feature, camera().project(&(*cam_from_target * x_in_target))?))
    };
    target.features().into_iter().filter_map(pixel).collect()
}

/// What is found in each image, and how much of it was searched.
fn follow(
    follower: &mut Follower,
    pictures: &[GrayImage],
    first: usize,
) -> Vec<(Result<Vec<Detection>, DetectError>, Extent)> {
    let look = |(i, picture): (usize, &GrayImage)| {
        let found = follower.detect(picture, &camera(), (first + i) as f64 * FRAME_S, &[]);
        (found, follower.extent())
    };
    pictures.iter().enumerate().map(look).collect()
}

/// What is measured where it was starts from other places than in the whole image: so far apart in each coordinate, root mean square in
/// their stated sigma, may boards be,
const RESTARTED_SIGMAS: f64 = 0.5;
/// and tags, all of whose print is laid on the image at once.
const RESTARTED_TAG_SIGMAS: f64 = 0.1;

/// Largest difference in pixels, root mean square in sigmas, and the mean one, of corners found near from those found in the whole image.
fn differences_px(target: &Target, pictures: &[GrayImage]) -> ([f64; 2], Pixel) {
    let mut follower = Follower::new(target).expect("a follower");
    let mut whole = Detector::new(target).expect("a detector");
    let (mut largest, mut squares, mut sum, mut n) = (0.0f64, 0.0, Pixel::zeros(), 0.0);
    for (i, (near, extent)) in follow(&mut follower, pictures, 0).into_iter().enumerate() {
        assert_eq!(extent, if i == 0 { Extent::Whole } else { Extent::Near }, "frame {i}");
        let (near, whole) = (near.expect("found"), whole.detect(&pictures[i]).expect("found"));
        assert!(!near.is_empty(), "nothing near in frame {i}");
        let features = |all: &[Detection]| all.iter().map(|d| d.feature).collect::<Vec<_>>();
        assert_eq!(features(&near), features(&whole), "frame {i}");
        for (a, b) in near.iter().zip(&whole) {
            let difference = a.pixel - b.pixel;
            largest = largest.max(difference.amax());
            squares += in_sigmas2(a, b);
            (sum, n) = (sum + difference, n + 1.0);
        }
    }
    ([largest, (squares / n).sqrt()], sum / n)
}

/// Squared distance in sigmas, mean of both coordinates.
fn in_sigmas2(a: &Detection, b: &Detection) -> f64 {
    0.5 * (a.pixel - b.pixel).norm_squared() / (b.sigma_px * b.sigma_px)
}

#[test]
fn tags_found_near_have_the_corners_of_the_whole_picture() {
    for (edge_px, seed) in [(24.0, 10), (45.0, 20), (110.0, 30), (320.0, 40)] {
        let pictures = film(&tag(), &trembling(tag_pose(edge_px, 150.3, -80.7), 6), seed);
        let ([largest_px, sigmas], mean) = differences_px(&tag(), &pictures);
        println!("tag of {edge_px} px: largest difference {largest_px:.1e} px, {sigmas:.3} sigma");
        assert!(sigmas < RESTARTED_TAG_SIGMAS && mean.amax() < 1e-3, "{edge_px}: {sigmas} {mean}");
    }
    let pose = Pose::exp(&Vector6::new(0.25, -0.3, 0.1, 0.05, 0.0, 2.2));
    let ([largest_px, sigmas], mean) = differences_px(&map(), &film(&map(), &trembling(pose, 6), 50));
    println!("map of 12 tags: largest difference {largest_px:.1e} px, {sigmas:.3} sigma");
    assert!(sigmas < RESTARTED_TAG_SIGMAS && mean.amax() < 1e-3, "{sigmas} {mean}");
}

/// A small board in a large image: the part that is searched has its margin.
#[test]
fn boards_found_near_have_the_corners_of_the_whole_picture() {
    let dictionary = "DICT_4X4_50".to_string();
    let boards = [
        Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.02 }),
        Target::Charuco(Charuco {
            rows: 5,
            columns: 7,
            square_m: 0.03,
            marker_m: 0.022,
            dictionary,
            legacy_pattern: false,
        }),
        Target::AprilGrid(AprilGrid {
            family: "tag36h11".to_string(),
            rows: 3,
            columns: 4,
            tag_size_m: 0.04,
            tag_spacing_ratio: 0.3,
            first_id: 0,
        }),
    ];
    for (target, flip_rad) in boards.into_iter().zip([0.0, 0.0, std::f64::consts::PI]) {
        let pose = Pose::exp(&Vector6::new(0.2, 0.25, 0.1, -0.1, 0.05, 0.7))
            * Pose::exp(&Vector6::new(flip_rad, 0.0, 0.0, 0.0, 0.0, 0.0));
        let pictures = film(&target, &trembling(pose, 3), 60);
        let ([largest_px, sigmas], mean) = differences_px(&target, &pictures);
        println!("{}: largest difference {largest_px:.1e} px, {sigmas:.2} sigma", target.kind());
        assert!(sigmas < RESTARTED_SIGMAS && mean.amax() < 1e-3, "{}: {sigmas} {mean}", target.kind());
    }
}

fn grid(first_id: u32) -> Target {
    let family = "tag36h11".to_string();
    let size = AprilGrid { family, rows: 3, columns: 4, tag_size_m: 0.04, tag_spacing_ratio: 0.3, first_id };
    Target::AprilGrid(size)
}

/// Between two images a board moves by whole squares along its own plane: what stays in place is its pattern, and the outer corners tell.
#[test]
fn a_board_that_moves_by_whole_squares_keeps_its_ids() {
    let charuco = Target::Charuco(Charuco {
        rows: 5,
        columns: 7,
        square_m: 0.03,
        marker_m: 0.022,
        dictionary: "DICT_4X4_50".to_string(),
        legacy_pattern: false,
    });
    let flip = Pose::exp(&Vector6::new(std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0));
    for (target, pitch_m, from) in
        [(chessboard(), 0.03, Pose::identity()), (charuco, 0.03, Pose::identity()), (grid(0), 0.052, flip)]
    {
        for squares in [-2.0, -1.0, 1.0, 2.0] {
            let poses = [0.0, 0.0, squares].map(|n| at(-0.1 + n * pitch_m, -0.05, 0.8) * from);
            let pictures = film(&target, &poses, 120);
            let mut follower = Follower::new(&target).expect("a follower");
            for ((found, _), pose) in follow(&mut follower, &pictures, 0).into_iter().zip(&poses) {
                let (found, truth) = (found.expect("found"), expected(&target, pose));
                // What left the part that is searched is missing in this image; what is found is what it says.
                assert!(truth.len() <= 2 * found.len(), "{} by {squares}", target.kind());
                let is_right = |d: &Detection| {
                    truth
                        .iter()
                        .any(|(feature, pixel)| d.feature == *feature && (d.pixel - pixel).norm() < 0.3)
                };
                assert!(found.iter().all(is_right), "{} by {squares}", target.kind());
            }
        }
    }
}

/// A board is exchanged for one with other ids in the very same place, without an image in between: its ids are read again within half a second.
#[test]
fn an_exchanged_board_is_noticed() {
    let pose = at(-0.1, 0.05, 0.8) * Pose::exp(&Vector6::new(std::f64::consts::PI, 0.0, 0.0, 0.0, 0.0, 0.0));
    let (ours, other) = (film(&grid(0), &[pose], 125), film(&grid(40), &[pose], 126));
    let mut follower = Follower::new(&grid(0)).expect("a follower");
    let pictures: Vec<GrayImage> =
        (0..20).map(|i| if i < 2 { ours[0].clone() } else { other[0].clone() }).collect();
    let seen = follow(&mut follower, &pictures, 0);
    assert_eq!(seen[1].0.as_ref().expect("found").len(), 48);
    assert!(seen[17..].iter().all(|(found, _)| found.as_ref().is_ok_and(Vec::is_empty)));
}

fn tag_of(id: u32) -> Target {
    Target::Tag(resight::core::target::Tag { family: "tag36h11".to_string(), id, size_m: TAG_M })
}

/// Between two images a tag moves by whole cells of its print, along its plane: what is measured is where it is, not the cells that fit next.
#[test]
fn a_tag_that_moves_by_whole_cells_is_where_it_is() {
    for (edge_px, cells) in [(32.0, 1.0), (64.0, 1.0), (64.0, -2.0), (120.0, 1.0), (120.0, 0.5)] {
        let moved = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, cells * TAG_M / 8.0, 0.0, 0.0));
        let here = tag_pose(edge_px, 100.0, -60.0);
        let poses = [here, here, here * moved, here, here * moved.inverse()];
        let mut follower = Follower::new(&tag()).expect("a follower");
        let seen = follow(&mut follower, &film(&tag(), &poses, 150), 0);
        for ((found, _), pose) in seen.iter().zip(&poses) {
            let (found, truth) = (found.as_ref().expect("found"), expected(&tag(), pose));
            assert_eq!(found.len(), 4, "{edge_px} {cells}");
            let is_right = |(a, (_, pixel)): (&Detection, &(Feature, Pixel))| (a.pixel - pixel).norm() < 0.1;
            assert!(found.iter().zip(&truth).all(is_right), "{edge_px} {cells}: {found:?} {truth:?}");
        }
    }
}

/// A tag is exchanged for another of its family in the very same place, or turned by a quarter, without an image in between: its bits do not fit.
#[test]
fn an_exchanged_tag_is_noticed_and_a_turned_one_found() {
    let here = tag_pose(60.0, 100.0, -60.0);
    let turned = here * Pose::exp(&Vector6::new(0.0, 0.0, std::f64::consts::FRAC_PI_2, 0.0, 0.0, 0.0));
    let ours = film(&tag(), &[here, here], 160);
    for id in [0, 9, 77, 400] {
        let mut follower = Follower::new(&tag()).expect("a follower");
        assert_eq!(follow(&mut follower, &ours, 0)[1].0.as_ref().expect("found").len(), 4);
        let other = follow(&mut follower, &film(&tag_of(id), &[here], 161), 2);
        assert!(other[0].0.as_ref().expect("an answer").is_empty(), "tag {id} is taken for another");
    }
    let mut follower = Follower::new(&tag()).expect("a follower");
    follow(&mut follower, &ours, 0);
    let seen = follow(&mut follower, &film(&tag(), &[turned], 162), 2);
    let (found, truth) = (seen[0].0.as_ref().expect("found"), expected(&tag(), &turned));
    assert_eq!(found.len(), 4);
    assert!(found.iter().zip(&truth).all(|(a, (_, pixel))| (a.pixel - pixel).norm() < 0.1));
}

fn chessboard() -> Target {
    Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.03 })
}

/// A board with its first corner so far from the optical axis, at a depth; metres.
fn at(x_m: f64, y_m: f64, depth_m: f64) -> Pose {
    Pose::exp(&Vector6::new(0.0, 0.0, 0.0, x_m, y_m, depth_m))
}

/// A board of usual size is elsewhere in the next image, and found in it, with the corners that the whole image at full size shows.
#[test]
fn a_board_that_moved_is_found_in_the_same_frame() {
    let target = chessboard();
    let poses = [at(-0.3, -0.1, 0.8), at(-0.3, -0.1, 0.8), at(0.05, 0.0, 0.8), at(0.05, 0.0, 0.8)];
    let pictures = film(&target, &poses, 130);
    let mut follower = Follower::new(&target).expect("a follower");
    let mut whole = Detector::new(&target).expect("a detector");
    let seen = follow(&mut follower, &pictures, 0);
    let extents: Vec<Extent> = seen.iter().map(|(_, extent)| *extent).collect();
    assert_eq!(extents, [Extent::Whole, Extent::Near, Extent::Whole, Extent::Near]);
    for ((found, _), picture) in seen.iter().zip(pictures.iter()) {
        let (found, whole) = (found.as_ref().expect("found"), whole.detect(picture).expect("found"));
        assert_eq!(found.len(), 54);
        // Every edge lies along the pixels, where the print is drawn to 1/128 px: the same for all, so it does not average out.
        assert!(found.iter().zip(&whole).all(|(a, b)| (a.pixel - b.pixel).amax() < 2.5 / 128.0));
    }
}

/// A board that only the full size shows, gone and back elsewhere, is found within the time between two searches at full size; one of usual
/// size at once, or within 0.2 s after a long time.
#[test]
fn a_board_that_was_gone_is_found_again() {
    let target = chessboard();
    let empty = film(&target, &[at(0.0, 0.0, -5.0)], 140);
    // Squares of 7 px: half of that shows no board.
    for (depth_m, n_gone, most) in [(0.8, 12, 0), (0.8, 60, 6), (3.6, 12, 8), (3.6, 60, 30)] {
        let there = film(&target, &[at(-0.3, -0.1, depth_m), at(0.05, 0.0, depth_m)], 141);
        let mut follower = Follower::new(&target).expect("a follower");
        let gone: Vec<GrayImage> = std::iter::repeat_n(empty[0].clone(), n_gone).collect();
        let back: Vec<GrayImage> = std::iter::repeat_n(there[1].clone(), most + 1).collect();
        assert_eq!(follow(&mut follower, &there[..1], 0)[0].0.as_ref().expect("found").len(), 54);
        assert!(
            follow(&mut follower, &gone, 1).iter().all(|(found, _)| found.as_ref().is_ok_and(Vec::is_empty))
        );
        let found = follow(&mut follower, &back, 1 + n_gone)
            .iter()
            .position(|(found, _)| found.as_ref().is_ok_and(|f| f.len() == 54));
        println!("depth {depth_m} m, gone for {n_gone} frames: found again after {found:?}");
        assert!(found.is_some(), "depth {depth_m} m, gone for {n_gone} frames");
    }
}

/// The sudden motion that the change detector is for: the tag is elsewhere in the next frame, and found in that frame.
#[test]
fn a_step_is_found_in_the_same_frame() {
    for edge_px in [45.0, 150.0] {
        let mut poses = vec![tag_pose(edge_px, -300.0, 100.0); 3];
        poses.extend([tag_pose(edge_px, 250.0, -150.0); 3]);
        let mut follower = Follower::new(&tag()).expect("a follower");
        let seen = follow(&mut follower, &film(&tag(), &poses, 70), 0);
        let extents: Vec<Extent> = seen.iter().map(|(_, extent)| *extent).collect();
        let (near, whole) = (Extent::Near, Extent::Whole);
        assert_eq!(extents, [whole, near, near, whole, near, near]);
        for (i, (found, _)) in seen.iter().enumerate() {
            let truth = expected(&tag(), &poses[i]);
            let found = found.as_ref().expect("found");
            assert_eq!(found.len(), 4, "frame {i}");
            assert!(found.iter().zip(&truth).all(|(a, b)| (a.pixel - b.1).norm() < 0.3), "frame {i}");
        }
    }
}

/// A tag smaller than half the image's size shows, gone for long, is back at another place.
#[test]
fn what_was_gone_for_long_is_found_again() {
    let away = film(
        &Target::Tag(resight::core::target::Tag { family: "tag36h11".to_string(), id: 9, size_m: 0.16 }),
        &[tag_pose(60.0, 0.0, 0.0)],
        80,
    );
    for edge_px in [20.0, 100.0] {
        let there = film(&tag(), &[tag_pose(edge_px, -300.0, 100.0), tag_pose(edge_px, 200.0, -200.0)], 81);
        let mut follower = Follower::new(&tag()).expect("a follower");
        assert_eq!(follow(&mut follower, &there[..1], 0)[0].0.as_ref().expect("found").len(), 4);
        let gone: Vec<GrayImage> = std::iter::repeat_n(away[0].clone(), 90).collect();
        let seen = follow(&mut follower, &gone, 1);
        assert!(seen.iter().all(|(found, _)| found.as_ref().is_ok_and(Vec::is_empty)));
        assert!(seen[..20].iter().all(|(_, extent)| *extent == Extent::Whole));
        let whole = seen[45..].iter().filter(|(_, extent)| *extent == Extent::Whole).count();
        assert!((7..=12).contains(&whole), "{whole} of 45 frames were searched whole");
        let back: Vec<GrayImage> = std::iter::repeat_n(there[1].clone(), 34).collect();
        let found = follow(&mut follower, &back, 91)
            .iter()
            .position(|(found, _)| found.as_ref().is_ok_and(|f| f.len() == 4));
        println!("tag of {edge_px} px: found again after {found:?} frames");
        assert!(found.is_some_and(|frames| frames <= if edge_px < 30.0 { 32 } else { 7 }), "{found:?}");
    }
}

/// A tag that comes back where the pose expects it is found there at once, however small it is.
#[test]
fn what_is_expected_is_found_at_once() {
    let pose = tag_pose(22.0, 220.0, 140.0);
    let pictures = film(&tag(), &[pose], 90);
    let mut follower = Follower::new(&tag()).expect("a follower");
    let empty = GrayImage::filled(1280, 960, 120);
    for i in 0..60 {
        let found = follower.detect(&empty, &camera(), i as f64 * FRAME_S, &expected(&tag(), &pose));
        assert!(found.expect("an answer").is_empty());
    }
    let found = follower.detect(&pictures[0], &camera(), 60.0 * FRAME_S, &expected(&tag(), &pose));
    assert_eq!(found.expect("found").len(), 4);
}

/// Somebody carries a copy of the tag through the view: its place is not known while both are seen.
#[test]
fn a_copy_elsewhere_is_noticed_and_stays_noticed() {
    let style = Style::default();
    let placed = |pose| Placed { target: tag(), cam_from_target: pose, style };
    let draw = |placed: Vec<Placed>| {
        let scene =
            Scene { placed, background: 120.0, clutter: clutter::words(40, [1280, 960], 14.0, 30.0, 7) };
        render(&scene, &camera(), &Finish::default()).expect("an image")
    };
    for copy_px in [40.0, 200.0] {
        let here = placed(tag_pose(60.0, -200.0, 50.0));
        let alone = draw(vec![here.clone()]);
        let both = draw(vec![here, placed(tag_pose(copy_px, 300.0, -200.0))]);
        let mut follower = Follower::new(&tag()).expect("a follower");
        follow(&mut follower, &[alone.clone(), alone.clone()], 0);
        let pictures: Vec<GrayImage> = std::iter::repeat_n(both, 70).collect();
        let seen = follow(&mut follower, &pictures, 2);
        let first = seen.iter().position(|(found, _)| found.is_err()).expect("the copy is noticed");
        assert!(first as f64 * FRAME_S <= ROUND_S + FRAME_S, "after {first} frames");
        assert!(
            seen[first..]
                .iter()
                .all(|(found, _)| matches!(found, Err(DetectError::Copies { id: 3, count: 2 })))
        );
        let seen = follow(&mut follower, &[alone], 72);
        assert_eq!(seen[0].0.as_ref().expect("alone again").len(), 4);
    }
}

/// Images far apart in time, or without times, are each searched for copies and small tags as a single image would be.
#[test]
fn slow_pictures_are_searched_whole() {
    let poses = [tag_pose(60.0, -200.0, 50.0), tag_pose(22.0, 100.0, 150.0), tag_pose(22.0, -350.0, -250.0)];
    let pictures = film(&tag(), &poses, 95);
    for times_s in [[0.0, 3600.0, 7200.0], [5.0, 5.0, 5.0], [9.0, 4.0, 2.0]] {
        let mut follower = Follower::new(&tag()).expect("a follower");
        for (picture, t_s) in pictures.iter().zip(times_s) {
            assert_eq!(follower.detect(picture, &camera(), t_s, &[]).expect("found").len(), 4, "{times_s:?}");
        }
    }
}

/// Tags come into view as the camera turns; each is searched where the pose puts it.
#[test]
fn tags_of_a_map_are_found_as_they_come_into_view() {
    let target = map();
    let turn = |i: usize| Pose::exp(&Vector6::new(0.0, 0.02 * i as f64, 0.0, 0.0, 0.0, 0.0));
    let start = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, -1.2, 0.0, 1.8));
    let poses: Vec<Pose> = (0..8).map(|i| turn(i) * start).collect();
    let pictures = film(&target, &poses, 100);
    let mut follower = Follower::new(&target).expect("a follower");
    let mut whole = Detector::new(&target).expect("a detector");
    let (mut counts, mut before) = (Vec::new(), Vec::new());
    for (i, picture) in pictures.iter().enumerate() {
        let known = expected(&target, &poses[i.saturating_sub(1)]);
        let found = follower.detect(picture, &camera(), i as f64 * FRAME_S, &known).expect("found");
        let whole = whole.detect(picture).expect("found");
        // What comes into view in this frame may lie beyond the reach of the pose of the last one; in the next it is found.
        let stayed = whole.iter().filter(|a| before.contains(&a.feature));
        stayed.for_each(|a| {
            assert!(found.iter().any(|b| a.feature == b.feature), "frame {i}: {:?}", a.feature)
        });
        before = whole.iter().map(|a| a.feature).collect();
        counts.push(found.len());
    }
    assert!(counts[0] < counts[7], "no tag came into view: {counts:?}");
}

#[test]
fn a_torn_buffer_is_an_error() {
    let torn = GrayImage { width_px: 640, height_px: 480, data: vec![0; 1000] };
    let found = Follower::new(&tag()).expect("a follower").detect(&torn, &camera(), 0.0, &[]);
    assert!(matches!(found, Err(DetectError::ImageBuffer { seen: 1000, .. })));
    // A stream that changes its size continues.
    let mut follower = Follower::new(&tag()).expect("a follower");
    let pictures = film(&tag(), &[tag_pose(60.0, 500.0, 350.0)], 110);
    assert_eq!(follow(&mut follower, &pictures, 0)[0].0.as_ref().expect("found").len(), 4);
    for small in [GrayImage::filled(320, 240, 9), GrayImage::filled(0, 0, 0), GrayImage::filled(1, 1, 0)] {
        assert!(follower.detect(&small, &camera(), 1.0, &[]).expect("an answer").is_empty());
    }
}
