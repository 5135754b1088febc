//! Thirteen photographs of a chessboard, against the poses OpenCV published for them with its intrinsics.
//!
//! The published poses come from corners refined in a window of 23 px, which on this small board takes neighbouring corners
//! in: single corners are up to 6.4 px off in views 2 and 13 (outliers on purpose), 1.1 px in 7 and 1.6 px in 9.

use crate::real_support::*;
use crate::recorded::recorded;
use resight::GrayImage;
use resight::core::correspondence::{Correspondence, Detection};
use resight::core::locate::refine::residual_px;
use resight::core::locate::{Config, PoseEstimate, locate};
use resight::core::target::Chessboard;
use resight::core::{Camera, Pose, Target};
use resight::detect::{CornerWindow, Detector};
use std::path::Path;

/// Views whose published corners are bad.
const BAD: [u32; 2] = [2, 13];
/// Sigma of a published corner, px: the detector's own for such images.
const SIGMA_PX: f64 = 0.12;
/// Half the window of the published corners, px.
const PUBLISHED_HALF_WINDOW_PX: u32 = 11;
/// A corner this far from the pose of all others is not where the board's corner is: four sigmas.
const MISPLACED_PX: f64 = 0.5;

struct Views {
    camera: Camera,
    target: Target,
    views: Vec<View>,
}

struct View {
    number: u32,
    image: GrayImage,
    published: Pose,
    published_corners: Vec<Correspondence>,
}

fn views(folder: &Path) -> Views {
    let truth = json(&folder.join("truth.json"));
    let left = &truth["published_left"];
    let camera = brown_conrady(matrix_of(&left["K"]), &left["D_k1k2p1p2k3"]);
    let rows = table(&folder.join("detections.csv"));
    let corners = |view: &str| {
        let of_view = rows.iter().filter(|row| row["camera"] == "left" && row["view"] == view);
        let seen = |row| Correspondence::new(&camera, point_of(row), pixel_of(row), SIGMA_PX).unwrap();
        of_view.map(seen).collect()
    };
    let view = |row: &Row| {
        let number = row["view"].parse().unwrap();
        View {
            number,
            image: GrayImage::read(folder.join(format!("left{number:02}.jpg"))).unwrap(),
            published: pose_of(row, "pub_").unwrap(),
            published_corners: corners(&row["view"]),
        }
    };
    let views: Vec<View> = table(&folder.join("published_views.csv")).iter().map(view).collect();
    assert_eq!(views.len(), 13);
    let target = Target::Chessboard(Chessboard { rows: 6, columns: 9, square_m: 0.025 });
    Views { camera, target, views }
}

fn pose_from(seen: &[Correspondence], camera: &Camera) -> PoseEstimate {
    locate(seen, camera, &Config::default()).unwrap()
}

/// Largest angle and distance from the published poses, over the views with good corners; the bad ones must say so.
fn check_against_published(name: &str, answers: &[(&View, PoseEstimate)], bars: (f64, f64)) {
    let good = || answers.iter().filter(|(view, _)| !BAD.contains(&view.number));
    let off: Vec<(f64, f64)> = good().map(|(v, e)| apart(&e.cam_from_target, &v.published)).collect();
    let (angle_deg, distance_mm) = (largest(off.iter().map(|o| o.0)), largest(off.iter().map(|o| o.1)));
    println!(
        "chessboard, {name}: {} views within {angle_deg:.4}° and {distance_mm:.4} mm of the published poses",
        off.len()
    );
    for (view, estimate) in answers {
        let inconsistent = is_inconsistent(estimate);
        if BAD.contains(&view.number) {
            println!(
                "chessboard, {name}: view {} has χ²/dof {:.1}, {:?}",
                view.number,
                chi2_per_degree_of_freedom(estimate),
                estimate.consistency
            );
        }
        assert_eq!(inconsistent, BAD.contains(&view.number), "view {}", view.number);
    }
    assert_eq!(off.len(), 11);
    assert!(angle_deg < bars.0 && distance_mm < bars.1, "{angle_deg}° {distance_mm} mm");
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn published_corners_give_the_published_poses() {
    let folder = recorded("opencv_stereo_chessboard");
    let Views { camera, views, .. } = views(&folder);
    let answers: Vec<_> = views.iter().map(|v| (v, pose_from(&v.published_corners, &camera))).collect();
    check_against_published("published corners", &answers, (0.01, 0.02));
}

/// From the image to the pose, only the window of the refinement being OpenCV's.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn images_in_opencvs_window_give_the_published_poses() {
    let folder = recorded("opencv_stereo_chessboard");
    let Views { camera, target, views } = views(&folder);
    let window = CornerWindow::Half(PUBLISHED_HALF_WINDOW_PX);
    let mut detector = Detector::with_corner_window(&target, window).unwrap();
    let mut answer = |view: &View| located(&detector.detect(&view.image).unwrap(), &target, &camera);
    let answers: Vec<_> = views.iter().map(|v| (v, answer(v))).collect();
    check_against_published("images in OpenCV's window", &answers, (0.02, 0.1));
}

/// The published corners without those that miss the pose of the others, found without a look at ours.
fn trimmed(view: &View, camera: &Camera) -> (PoseEstimate, usize) {
    let mut kept = view.published_corners.clone();
    loop {
        let estimate = pose_from(&kept, camera);
        let miss = |c: &Correspondence| residual_px(&estimate.cam_from_target, c, camera).unwrap().norm();
        let (worst, miss_px) = (0..kept.len())
            .map(|i| (i, miss(&kept[i])))
            .fold((0, 0.0), |worst, next| if worst.1 < next.1 { next } else { worst });
        if miss_px < MISPLACED_PX {
            return (estimate, view.published_corners.len() - kept.len());
        }
        kept.remove(worst);
    }
}

/// Our own corners are good in all 13 views, also in 2 and 13 (residual 0.19 and 0.18 px, published 1.22 and 0.46 px), so
/// none is called inconsistent, and there it is the published pose that is off. What holds:
/// * in every view they leave a smaller residual than the published corners;
/// * 4 views are within 0.02° and 0.1 mm of the published pose; 1, 6, 8 and 14 (0.043°, 0.035°, 0.028°, 0.0202°; 0.18 mm and less) within a tenth of their own
///   standard deviations: corners of both windows differ by 0.05 px;
/// * 2, 7, 9, 12 and 13 differ from it (0.56°, 0.06°, 0.13°, 0.03°, 0.22°) because of single published corners: without those the
///   published set gives our pose to 0.034° and 0.09 mm.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn own_corners_differ_where_the_published_ones_are_misplaced() {
    let folder = recorded("opencv_stereo_chessboard");
    let Views { camera, target, views } = views(&folder);
    let mut detector = Detector::new(&target).unwrap();
    let mut far = Vec::new();
    for view in &views {
        let ours = located(&detector.detect(&view.image).unwrap(), &target, &camera);
        let (clean, n_dropped) = trimmed(view, &camera);
        let (angle, distance) = apart(&ours.cam_from_target, &view.published);
        let (clean_angle, clean_distance) = apart(&ours.cam_from_target, &clean.cam_from_target);
        let published = pose_from(&view.published_corners, &camera);
        println!(
            "chessboard, own corners: view {:2} {angle:.4}° {distance:.4} mm from published; {n_dropped} corners dropped, \
             then {clean_angle:.4}° {clean_distance:.4} mm; rms {:.3} px (published corners {:.3})",
            view.number, ours.rms_px, published.rms_px
        );
        assert!(!is_inconsistent(&ours) && ours.rms_px < 0.25, "view {}", view.number);
        assert!(ours.rms_px < published.rms_px, "view {}", view.number);
        // Below 0.06 mm in views 5, 8, 9 and 14; both windows differ by 0.05 px.
        let clean_bar_mm = if view.number == 1 { 0.2 } else { 0.1 };
        assert!(clean_angle < 0.06 && clean_distance < clean_bar_mm, "view {}", view.number);
        if angle < 0.02 && distance < 0.1 {
            continue;
        }
        far.push(view.number);
        let of_sigma = (angle / sigmas(&ours).0).max(distance / sigmas(&ours).1);
        let within_sigma = of_sigma < 0.5;
        assert!(within_sigma || 0 < n_dropped, "view {}", view.number);
    }
    println!("chessboard, own corners: beyond 0.02° or 0.1 mm are views {far:?}");
    assert!(far.iter().all(|view| [1, 2, 6, 7, 8, 9, 12, 13, 14].contains(view)), "{far:?}");
}

/// Root mean square by which corners that a pose was not made from miss it, both halves of the board (alternating corners) in turn.
fn held_out_rms_px(seen: &[(u32, Correspondence)], camera: &Camera) -> f64 {
    let (mut squares, mut n) = (0.0, 0);
    for parity in 0..2 {
        let is_kept = |id: u32| (id / 9 + id % 9) % 2 == parity;
        let of = |kept: bool| seen.iter().filter(move |(id, _)| is_kept(*id) == kept).map(|(_, c)| *c);
        let pose = pose_from(&of(true).collect::<Vec<_>>(), camera).cam_from_target;
        for c in of(false) {
            squares += residual_px(&pose, &c, camera).unwrap().norm_squared();
            n += 2;
        }
    }
    (squares / n as f64).sqrt()
}

/// Whose corners are right does not matter here: those predict the other half of their board better that lie nearer to where the board's corners
/// are. Same camera, same weights, same method, alternating corners; in every view ours are nearer.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn own_corners_predict_each_other_better_than_the_published_ones() {
    let folder = recorded("opencv_stereo_chessboard");
    let Views { camera, target, views } = views(&folder);
    let mut detector = Detector::new(&target).unwrap();
    let (mut own2, mut published2) = (0.0, 0.0);
    for view in &views {
        let found = detector.detect(&view.image).unwrap();
        let corner = |d: &Detection| {
            let x = target.point(d.feature).unwrap().position;
            (d.feature.id, Correspondence::new(&camera, x, d.pixel, SIGMA_PX).unwrap())
        };
        let own: Vec<(u32, Correspondence)> = found.iter().map(corner).collect();
        let id = |c: &Correspondence| {
            let on_board = c.x_in_target / 0.025;
            (9.0 * on_board.y + on_board.x).round() as u32
        };
        let published: Vec<(u32, Correspondence)> =
            view.published_corners.iter().map(|c| (id(c), *c)).collect();
        let (own, published) = (held_out_rms_px(&own, &camera), held_out_rms_px(&published, &camera));
        println!(
            "chessboard, held-out corners: view {:2} own {own:.3} px, published {published:.3} px",
            view.number
        );
        assert!(own < published, "view {}: {own} {published}", view.number);
        own2 += own * own / views.len() as f64;
        published2 += published * published / views.len() as f64;
    }
    println!(
        "chessboard, held-out corners: own {:.3} px, published {:.3} px",
        own2.sqrt(),
        published2.sqrt()
    );
    assert!(own2.sqrt() < 0.2, "{own2}");
}
