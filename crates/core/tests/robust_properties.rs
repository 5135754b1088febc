//! What `robust::consensus` promises of every answer: never wrong with a green light, the same for the same input, inliers that are
//! those of the returned pose, named errors for what cannot be.

use crate::common::outliers::{Scene, any_pixel, camera, scene};
use crate::common::{Rng, views};
use resight_core::camera::{BrownConrady, KannalaBrandt};
use resight_core::locate::choose::Ambiguity;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::refine::residual_px;
use resight_core::locate::{self, locate};
use resight_core::robust::{Config, Consensus, consensus};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Pixel, Point};

fn at_4_px() -> Config<'static> {
    Config::with_threshold_px(4.0)
}

fn is_green(found: &Consensus) -> bool {
    let e = &found.estimate;
    matches!(e.ambiguity, Ambiguity::Unique { .. }) && e.consistency == Consistency::Consistent
}

/// Scenes of 6 to 1,000 points, 0 to 95 % of them wrong: of the answers without a warning at most one in a thousand is off by more
/// than 5° or a tenth of the mean distance (12 m). How often there is an answer is printed, not promised: too few right points
/// are an error.
#[test]
fn never_wrong_with_a_green_light() {
    let mut rng = Rng::new(11);
    let (mut green, mut wrong) = (0, 0);
    for n in [6, 7, 8, 10, 15, 20, 30, 50, 100, 300, 1000] {
        let mut answered = String::new();
        for percent in [0, 10, 20, 30, 40, 50, 60, 70, 80, 90, 95] {
            let trials = if n < 300 { 300 } else { 30 };
            let mut answers = 0;
            for seed in 0..trials {
                let scene = scene(&mut rng, n, (n * percent).div_ceil(100), 1.0);
                let config = Config { seed, max_samples: 3000, ..at_4_px() };
                let Ok(found) = consensus(&scene.seen, &camera(), &config) else { continue };
                answers += 1;
                let (turn_deg, shift_m) = scene.errors(&found.estimate.cam_from_target);
                green += usize::from(is_green(&found));
                wrong += usize::from(is_green(&found) && !(turn_deg < 5.0 && shift_m < 1.2));
            }
            answered += &format!(" {percent} %: {:.0},", 100.0 * answers as f64 / trials as f64);
        }
        println!("{n} points, answers (in 100) by share of wrong ones:{answered}");
    }
    println!("{wrong} of {green} answers without a warning are wrong");
    assert!(10_000 < green && 1000 * wrong <= green, "{wrong} of {green}");
}

/// The same input gives the same bits; another order of the rows the same consensus, in at least 999 of 1,000 trials, and another seed
/// too.
#[test]
fn neither_rows_nor_seed_have_a_say() {
    let mut rng = Rng::new(12);
    let (mut differ_by_rows, mut differ_by_seed) = (0, 0);
    for trial in 0..1000 {
        let n = [20, 100, 400][trial % 3];
        let scene = scene(&mut rng, n, n / 2, 1.0);
        let found = consensus(&scene.seen, &camera(), &at_4_px()).expect("a pose");
        assert_eq!(Ok(&found), consensus(&scene.seen, &camera(), &at_4_px()).as_ref());
        let mut rows: Vec<usize> = (0..n).collect();
        (1..n).rev().for_each(|i| rows.swap(i, rng.index(i + 1)));
        let seen: Vec<Correspondence> = rows.iter().map(|row| scene.seen[*row]).collect();
        let permuted = consensus(&seen, &camera(), &at_4_px()).expect("a pose");
        let mut inliers: Vec<usize> = permuted.inliers.iter().map(|i| rows[*i]).collect();
        inliers.sort_unstable();
        differ_by_rows += usize::from(inliers != found.inliers);
        let reseeded = consensus(&scene.seen, &camera(), &Config { seed: 77, ..at_4_px() }).expect("a pose");
        differ_by_seed += usize::from(reseeded.inliers != found.inliers);
    }
    println!("of 1,000: {differ_by_rows} differ by the order of rows, {differ_by_seed} by the seed");
    assert!(differ_by_rows <= 1 && differ_by_seed <= 5);
}

fn brown_conrady() -> Camera {
    let matrix = CameraMatrix { fx_px: 900.0, fy_px: 905.0, cx_px: 639.5, cy_px: 479.5 };
    let lens = BrownConrady::new(matrix, &[-0.2, 0.05, 1e-3, -5e-4]).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

fn fisheye() -> Camera {
    let matrix = CameraMatrix { fx_px: 380.0, fy_px: 380.0, cx_px: 639.5, cy_px: 479.5 };
    let lens = KannalaBrandt::new(matrix, &[-0.01, 0.002, 0.0, 0.0]).expect("a lens");
    Camera { lens: Lens::KannalaBrandt(lens), size: None }
}

/// The scene's rays, seen through another lens. Pixels outside its field are drawn again.
fn through(camera: &Camera, rng: &mut Rng, n: usize, n_wrong: usize) -> Scene {
    let mut scene = scene(rng, n, n_wrong, 1.0);
    for (c, good) in scene.seen.iter_mut().zip(&scene.is_good) {
        *c = loop {
            let place = any_pixel(rng);
            let Ok(ray) = camera.bearing(&place) else { continue };
            let x_in_cam = ray.into_inner() * rng.uniform(4.0, 20.0);
            let x_in_target = scene.cam_from_target.inverse() * x_in_cam;
            let noise = nalgebra::Vector2::new(rng.normal(), rng.normal());
            let pixel = if *good { place + noise } else { any_pixel(rng) };
            if let Ok(c) = Correspondence::new(camera, x_in_target, pixel, 1.0) {
                break c;
            }
        };
    }
    scene
}

/// Every lens, fisheye beyond 90° included: the inliers are exactly the rows within the threshold of the returned pose, through the
/// lens itself, and the pose is that of maximum likelihood on them.
#[test]
fn inliers_are_those_of_the_returned_pose() {
    let mut rng = Rng::new(13);
    for camera in [camera(), brown_conrady(), fisheye()] {
        for trial in 0..100 {
            let n = [12, 60, 300][trial % 3];
            let scene = through(&camera, &mut rng, n, n / 2);
            let found = consensus(&scene.seen, &camera, &at_4_px());
            let found = found.unwrap_or_else(|e| panic!("{} {trial}: {e}", camera.model_name()));
            let pose = found.estimate.cam_from_target;
            let near = |c: &Correspondence| residual_px(&pose, c, &camera).is_some_and(|e| e.norm() < 4.0);
            let rows: Vec<usize> = (0..n).filter(|row| near(&scene.seen[*row])).collect();
            assert_eq!(rows, found.inliers);
            assert_eq!(found.estimate.n_points, rows.len());
            let chosen: Vec<Correspondence> = rows.iter().map(|row| scene.seen[*row]).collect();
            let again = locate(&chosen, &camera, &locate::Config::default()).expect("a pose");
            assert_eq!(again.cam_from_target, pose);
            assert!(scene.errors(&pose).0 < 1.0, "{} {trial}", camera.model_name());
        }
    }
}

/// Tags of four corners on a wall and around, of which some carry another's label: all four corners fall together.
fn tags(rng: &mut Rng, n_tags: usize, n_wrong: usize) -> (Scene, Vec<u32>) {
    let camera = camera();
    let mut scene = scene(rng, 1, 0, 1.0);
    let target_from_cam = scene.cam_from_target.inverse();
    let mut corners = Vec::new();
    while corners.len() < n_tags {
        let Ok(ray) = camera.bearing(&any_pixel(rng)) else { continue };
        let (centre, turn) = (ray.into_inner() * rng.uniform(2.0, 6.0), rng.rotation());
        let in_cam = [[-0.1, -0.1], [0.1, -0.1], [0.1, 0.1], [-0.1, 0.1]]
            .map(|[x, y]| centre + turn * Point::new(x, y, 0.0));
        corners.push(in_cam);
    }
    let mut labels = Vec::new();
    (scene.seen, scene.is_good) = (Vec::new(), Vec::new());
    for (tag, in_cam) in corners.iter().enumerate() {
        // A wrong tag is seen where its neighbour is.
        let seen = if tag < n_wrong { &corners[(tag + 1) % n_tags] } else { in_cam };
        for (x, seen) in in_cam.iter().zip(seen) {
            let pixel = camera.project(seen).unwrap_or(Pixel::new(640.0, 480.0));
            let noise = nalgebra::Vector2::new(rng.normal(), rng.normal()) * 0.3;
            let c = Correspondence::new(&camera, &target_from_cam * x, pixel + noise, 0.3);
            scene.seen.push(c.expect("in the field"));
            scene.is_good.push(n_wrong <= tag);
            labels.push(tag as u32 + 100);
        }
    }
    (scene, labels)
}

/// Mislabelled tags: found, and taken out whole. Samples are of tags: half wrong takes some tens of them.
#[test]
fn groups_fall_together() {
    let mut rng = Rng::new(14);
    for (n_tags, n_wrong) in [(3, 0), (6, 2), (12, 6), (40, 28)] {
        let mut most = 0;
        for seed in 0..200 {
            let (scene, labels) = tags(&mut rng, n_tags, n_wrong);
            let config = Config { groups: Some(&labels), seed, ..Config::with_threshold_px(2.0) };
            let found = consensus(&scene.seen, &camera(), &config)
                .unwrap_or_else(|e| panic!("{n_tags} {n_wrong} {seed}: {e}"));
            let good: Vec<usize> = (0..scene.seen.len()).filter(|row| scene.is_good[*row]).collect();
            assert_eq!(found.inliers, good, "{n_tags} {n_wrong} {seed}");
            most = most.max(found.n_samples);
        }
        println!("{n_wrong} of {n_tags} tags wrong: at most {most} samples");
        assert!(most < 300);
    }
    let (scene, labels) = tags(&mut rng, 2, 1);
    let config = Config { groups: Some(&labels), ..Config::with_threshold_px(2.0) };
    let refusal = consensus(&scene.seen, &camera(), &config);
    assert!(matches!(refusal, Err(Error::NoConsensus { what: "groups", .. })), "{refusal:?}");
}

/// With a threshold of 2.5 σ the tail beyond it is missing: χ² per degree of freedom is the stated truncation, not 1, and the covariance,
/// corrected for it, still agrees with the errors: the mean of εᵀ Σ⁻¹ ε over 600 trials is 6 within 0.6 (four standard
/// deviations, √(12/600) = 0.14); without the correction it would be 6.9.
#[test]
fn a_narrow_threshold_is_accounted_for() {
    let mut rng = Rng::new(15);
    let (mut nees, mut chi2_per_degree_of_freedom, mut truncation) = (0.0, 0.0, 0.0);
    let trials = 600;
    for _ in 0..trials {
        let scene = scene(&mut rng, 200, 60, 1.0);
        let found = consensus(&scene.seen, &camera(), &Config::with_threshold_px(2.5)).expect("a pose");
        let error = (found.estimate.cam_from_target * scene.cam_from_target.inverse()).log();
        let information = found.estimate.covariance.try_inverse().expect("positive");
        nees += error.dot(&(information * error)) / f64::from(trials);
        chi2_per_degree_of_freedom +=
            found.estimate.chi2 / found.estimate.degrees_of_freedom as f64 / f64::from(trials);
        truncation += found.truncation / f64::from(trials);
    }
    println!("NEES {nees:.2}, χ²/dof {chi2_per_degree_of_freedom:.4}, truncation {truncation:.4}");
    assert!((nees - 6.0).abs() < 0.6, "{nees}");
    assert!(
        (chi2_per_degree_of_freedom - truncation).abs() < 0.01,
        "{chi2_per_degree_of_freedom} {truncation}"
    );
}

/// What cannot be is named, by its row.
#[test]
fn hostile_input_is_an_error_and_never_a_panic() {
    let mut rng = Rng::new(16);
    let scene = scene(&mut rng, 40, 10, 1.0);
    let with = |row: usize, change: &dyn Fn(&mut Correspondence)| {
        let mut seen = scene.seen.clone();
        change(&mut seen[row]);
        consensus(&seen, &camera(), &at_4_px())
    };
    let not_finite = |what| Err(Error::NotFinite { what, index: 7 });
    assert_eq!(with(7, &|c| c.x_in_target.y = f64::NAN), not_finite("the position"));
    assert_eq!(with(7, &|c| c.pixel.x = f64::INFINITY), not_finite("the pixel"));
    assert_eq!(with(7, &|c| c.sigma_px = 0.0), Err(Error::NotPositive { index: 7, seen: 0.0 }));
    // A wrong row may be as wild as it likes: the others still agree.
    for size in [1e9, 1e30, 1e150, 1e300] {
        let found = with(3, &|c| c.x_in_target = Point::new(size, -size, size));
        assert!(found.is_ok_and(|f| scene.errors(&f.estimate.cam_from_target).0 < 1.0), "{size}");
    }
    for n in 0..5 {
        assert!(consensus(&scene.seen[10..10 + n], &camera(), &at_4_px()).is_err(), "{n} points");
    }
    let settings: [fn(&mut Config); 6] = [
        |c| c.threshold_px = f64::NAN,
        |c| c.threshold_px = -1.0,
        |c| c.confidence = 1.0,
        |c| c.max_false_alarms = 0.0,
        |c| c.groups = Some(&[1, 2]),
        |c| c.max_samples = 0,
    ];
    for change in settings {
        let mut config = at_4_px();
        change(&mut config);
        let answer = consensus(&scene.seen, &camera(), &config);
        assert!(
            matches!(answer, Err(Error::InvalidSetting { .. } | Error::NoConsensus { .. })),
            "{answer:?}"
        );
    }
}

/// Layouts no pose can be had from, and repeated rows: an answer or an error, no panic, no NaN.
#[test]
fn degenerate_layouts_are_survived() {
    let mut rng = Rng::new(17);
    let pose = views::oblique();
    let lines: Vec<Point> = (0..30).map(|i| Point::new(0.1 * f64::from(i), 0.0, 0.0)).collect();
    let one_place = vec![Point::new(0.3, 0.2, 0.1); 30];
    let spread = |rng: &mut Rng| Point::new(rng.uniform(0.0, 1.0), rng.uniform(0.0, 1.0), 0.0);
    let flat: Vec<Point> = (0..30).map(|_| spread(&mut rng)).collect();
    for (points, answers) in [(lines, false), (one_place, false), (flat.clone(), true)] {
        let seen = views::disturbed(&mut rng, &views::seen_from(&pose, &points, 0.3));
        let found = consensus(&seen, &views::camera(), &Config::with_threshold_px(1.5));
        assert_eq!(found.is_ok(), answers, "{found:?}");
        let twice: Vec<Correspondence> = seen.iter().chain(&seen).copied().collect();
        let found = consensus(&twice, &views::camera(), &Config::with_threshold_px(1.5));
        assert_eq!(found.is_ok(), answers, "{found:?}");
    }
    // Survey coordinates of millions of metres.
    let far: Vec<Point> = flat.iter().map(|x| x + Point::new(5e6, -3e6, 1e3)).collect();
    let moved =
        resight_core::Pose::new(pose.rotation, pose.translation - pose.rotation * Point::new(5e6, -3e6, 1e3));
    let seen = views::disturbed(&mut rng, &views::seen_from(&moved, &far, 0.3));
    let found = consensus(&seen, &views::camera(), &Config::with_threshold_px(1.5)).expect("a pose");
    assert!(found.inliers.len() == 30 && found.estimate.cam_from_target.angle_to_rad(&moved) < 0.02);
}
