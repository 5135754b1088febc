//! Intrinsics from many frames: the check alarms as rarely as it says and sees what it should, the refinement is the joint
//! maximum-likelihood estimate with a true covariance, and what the frames leave open is refused.
//!
//! A flat grid of 4 × 3 points, 0.6 m wide, 0.8–2.5 m away, tilted up to 50°, f = 800 px, 0.3 px, unless a test says otherwise.

use crate::common::Rng;
use crate::common::views::looking_at;
use nalgebra::{DMatrix, DVector, Vector2, Vector3};
use resight_core::camera::{BrownConrady, Pinhole};
use resight_core::multiview::intrinsics_check::{
    FALSE_ALARM_RATE, Focal, Free, Group, MAX_RELATIVE_SIGMA, RefinedIntrinsics, check_intrinsics,
    refine_intrinsics,
};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Point, Pose, Vector6};
use std::f64::consts::TAU;

const SIGMA_PX: f64 = 0.3;
const TRUE: CameraMatrix = CameraMatrix { fx_px: 800.0, fy_px: 790.0, cx_px: 319.5, cy_px: 239.5 };

fn pinhole() -> Camera {
    Camera { lens: Lens::Pinhole(Pinhole::new(TRUE).expect("a camera")), size: None }
}

fn distorted() -> Camera {
    let lens = BrownConrady::new(TRUE, &[-0.25, 0.08, 1e-3, -5e-4]).expect("a camera");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

/// The camera with a parameter multiplied and moved.
fn altered(camera: &Camera, changes: &[(&str, f64, f64)]) -> Camera {
    let value = |(name, value): &(&str, f64)| {
        let of_name = changes.iter().filter(|(changed, ..)| changed == name);
        of_name.fold(*value, |value, (_, times, plus)| value * times + plus)
    };
    let values: Vec<f64> = camera.parameters().iter().map(value).collect();
    camera.with_parameters(&values).expect("a camera")
}

fn board() -> Vec<Point> {
    let at = |i: usize| Point::new(0.2 * (i % 4) as f64 - 0.3, 0.2 * (i / 4) as f64 - 0.2, 0.0);
    (0..12).map(at).collect()
}

/// A view tilted by up to `tilt_rad`, the board within the central part of the image, turned at will.
fn tilted_view(rng: &mut Rng, tilt_rad: f64) -> Pose {
    let (distance, tilt) = (rng.uniform(0.8, 2.5), rng.uniform(0.3, 1.0) * tilt_rad);
    let (about, turn) = (rng.uniform(0.0, TAU), rng.uniform(0.0, TAU));
    let spin = |w: Vector3<f64>| Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
    let rotation =
        spin(Vector3::new(about.cos(), about.sin(), 0.0) * tilt) * spin(Vector3::new(0.0, 0.0, turn));
    let aside = Vector3::new(rng.uniform(-0.12, 0.12), rng.uniform(-0.1, 0.1), 1.0);
    Pose::new(rotation, aside * distance)
}

fn seen_by(rng: &mut Rng, camera: &Camera, pose: &Pose, sigma_px: f64) -> Vec<Correspondence> {
    let noisy = |x: &Point| {
        let pixel = camera.project(&(pose * x)).expect("in the field");
        let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * sigma_px;
        Correspondence::new(camera, *x, pixel, sigma_px).expect("in the field")
    };
    board().iter().map(noisy).collect()
}

fn frames(rng: &mut Rng, camera: &Camera, n: usize, tilt_rad: f64) -> (Vec<Pose>, Vec<Vec<Correspondence>>) {
    let poses: Vec<Pose> = (0..n).map(|_| tilted_view(rng, tilt_rad)).collect();
    let seen = poses.iter().map(|pose| seen_by(rng, camera, pose, SIGMA_PX)).collect();
    (poses, seen)
}

const TILT_RAD: f64 = 0.9;
const ALL: Free = Free { focal: Focal::Separate, principal_point: true, distortion: true };

/// With the right intrinsics p is uniform: 5 % of checks fall below 0.05, 1 % below 0.01, and one in a thousand blames.
/// Four standard deviations of a binomial count each. Views a few noise widths from frontal are in the next test.
#[test]
fn false_alarm_rate_is_as_stated() {
    for (camera, seed) in [(pinhole(), 31), (distorted(), 32)] {
        let (mut rng, trials) = (Rng::new(seed), 6000);
        let mut below = [0usize; 3];
        for _ in 0..trials {
            let (_, seen) = frames(&mut rng, &camera, 6, TILT_RAD);
            let check = check_intrinsics(&seen, &camera).expect("a check");
            for (count, level) in below.iter_mut().zip([0.05, 0.01, FALSE_ALARM_RATE]) {
                *count += usize::from(check.p_value < level);
            }
            assert_eq!(check.fits(), FALSE_ALARM_RATE <= check.p_value);
        }
        println!("{}: p below 0.05, 0.01, 0.001 in {below:?} of {trials}", camera.model_name());
        for (count, level) in below.iter().zip([0.05, 0.01, FALSE_ALARM_RATE]) {
            let expected = level * trials as f64;
            let off = (*count as f64 - expected).abs();
            assert!(off < 4.0 * (expected * (1.0 - level)).sqrt(), "{level}: {count}");
        }
    }
}

/// A board that is bent by up to 2 % of its half width is not taken for a lens (200 boards of each bend, one in a thousand may be), and a focal length
/// that is 5 % off is seen with up to 1 %. With 2 % ten views of twelve points hardly tell one from the other.
#[test]
fn a_bent_board_is_no_wrong_lens() {
    let (camera, mut rng) = (distorted(), Rng::new(33));
    let wrong = altered(&camera, &[("fx_px", 1.05, 0.0), ("fy_px", 1.05, 0.0)]);
    let half = board().iter().map(|x| x.x.abs()).fold(0.0, f64::max);
    for bend in [0.0, 0.005, 0.01, 0.02] {
        let (mut refused, mut named) = (0, 0);
        for _ in 0..200 {
            let bent = |x: &Point| Point::new(x.x, x.y, bend * half * (1.0 - (x.x / half).powi(2)));
            let mut view = || {
                let pose = tilted_view(&mut rng, TILT_RAD);
                let point = |x: &Point| {
                    let off = Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
                    let pixel = camera.project(&(pose * bent(x))).expect("in the field") + off;
                    Correspondence::new(&camera, *x, pixel, SIGMA_PX).expect("a correspondence")
                };
                board().iter().map(point).collect::<Vec<_>>()
            };
            let seen: Vec<_> = (0..10).map(|_| view()).collect();
            refused += usize::from(!check_intrinsics(&seen, &camera).expect("a check").fits());
            named += usize::from(!check_intrinsics(&seen, &wrong).expect("a check").fits());
        }
        println!(
            "bent by {:.1} %: refused {refused} of 200, 5 % of focal length named {named}",
            100.0 * bend
        );
        assert!(refused <= 2 && (0.01 < bend || 190 <= named), "{bend}: {refused} {named}");
    }
}

/// One per cent of focal length in sixty views of twelve points is seen every time and named, by as much as it is off.
/// (How many views it takes follows from the standard deviation stated for the offset: here 0.85 px, of 8.)
#[test]
fn one_per_cent_of_focal_length_is_seen() {
    let (mut rng, trials) = (Rng::new(33), 300);
    let (mut seen_it, mut named_it, mut squared, mut sigma) = (0, 0, 0.0, 0.0);
    for _ in 0..trials {
        let (_, seen) = frames(&mut rng, &pinhole(), 60, TILT_RAD);
        let wrong = altered(&pinhole(), &[("fx_px", 1.01, 0.0), ("fy_px", 1.01, 0.0)]);
        let check = check_intrinsics(&seen, &wrong).expect("a check");
        seen_it += usize::from(!check.fits());
        if check.blamed.iter().map(|b| b.group).eq([Group::FocalLength]) {
            named_it += 1;
            let fx = check.blamed[0].parameters[0];
            squared += ((fx.offset + 8.0) / fx.sigma).powi(2);
            sigma += fx.sigma;
        }
    }
    let mean = squared / named_it as f64;
    println!(
        "f × 1.01: seen {seen_it}, named alone {named_it} of {trials}; offset² over variance {mean:.3}, sigma {:.2} px",
        sigma / named_it as f64
    );
    assert_eq!(seen_it, trials);
    assert!(named_it * 100 >= trials * 97, "{named_it}");
    assert!(mean < 1.5, "one step from 1 % away is right to first order: {mean}");
}

/// A principal point 4 px off, and a k1 off by a tenth, are blamed and nothing else is.
#[test]
fn what_is_off_is_named() {
    let cases = [
        (pinhole(), [("cx_px", 1.0, 4.0), ("cy_px", 1.0, -4.0)], Group::PrincipalPoint),
        (distorted(), [("k1", 1.1, 0.0), ("k2", 1.0, 0.0)], Group::Distortion),
    ];
    for (camera, changes, group) in cases {
        let (mut rng, trials) = (Rng::new(34), 200);
        let (mut seen_it, mut named_it) = (0, 0);
        for _ in 0..trials {
            let (_, seen) = frames(&mut rng, &camera, 40, TILT_RAD);
            let check = check_intrinsics(&seen, &altered(&camera, &changes)).expect("a check");
            seen_it += usize::from(!check.fits());
            named_it += usize::from(check.blamed.iter().map(|b| b.group).eq([group]));
        }
        println!("{group:?}: seen {seen_it}, named alone {named_it} of {trials}");
        assert!(seen_it * 100 >= trials * 95, "{group:?}: {seen_it}");
        assert!(named_it * 100 >= seen_it * 90, "{group:?}: {named_it}");
    }
}

/// Pixels twice as bad as stated are no evidence against the intrinsics: the residual is put down to noise.
#[test]
fn underestimated_noise_blames_no_intrinsics() {
    let (mut rng, trials) = (Rng::new(35), 1000);
    let mut blamed = 0;
    for _ in 0..trials {
        let poses: Vec<Pose> = (0..8).map(|_| tilted_view(&mut rng, TILT_RAD)).collect();
        let mut seen = |pose| seen_by(&mut rng, &pinhole(), pose, 2.0 * SIGMA_PX);
        let mut seen: Vec<_> = poses.iter().map(&mut seen).collect();
        seen.iter_mut().flatten().for_each(|c| c.sigma_px = SIGMA_PX);
        let check = check_intrinsics(&seen, &pinhole()).expect("a check");
        assert!((2.5..6.0).contains(&check.noise_scale), "{}", check.noise_scale);
        blamed += usize::from(!check.fits());
    }
    assert!(blamed <= 6, "one in a thousand is stated: {blamed}");
}

/// Frontal views of a plane cannot tell focal length from distance: the check tests what remains, the refinement refuses.
#[test]
fn frontal_planes_leave_the_focal_length_open() {
    let (mut rng, mut blamed, mut least) = (Rng::new(36), 0, f64::INFINITY);
    for _ in 0..300 {
        let (_, seen) = frames(&mut rng, &pinhole(), 8, 0.0);
        if let Ok(check) = check_intrinsics(&seen, &pinhole()) {
            assert!(
                check.undetermined.contains(&"fx_px") || check.undetermined.contains(&"fy_px"),
                "{check}"
            );
            blamed += usize::from(!check.fits());
        }
        let refined = refine_intrinsics(&seen, &pinhole(), Free::default());
        let Err(Error::UndeterminedIntrinsics { parameter, seen, needed }) = refined else {
            panic!("{refined:?}")
        };
        assert!(parameter == "fx_px" && needed < seen && needed == MAX_RELATIVE_SIGMA);
        least = f64::min(least, seen);
    }
    println!("frontal planes: relative sigma of f at least {least:.3}, {blamed} of 300 blamed");
    assert!(blamed <= 3, "one in a thousand is stated: {blamed} of 300");
}

/// Residuals of all frames, whitened, as a function of all poses (left motions) and the parameters; by plain projection.
fn residuals(
    refined: &RefinedIntrinsics,
    seen: &[Vec<Correspondence>],
    motion: &DVector<f64>,
    free: &[usize],
) -> DVector<f64> {
    let n_poses = refined.frames.len();
    let mut values: Vec<f64> = refined.camera.parameters().iter().map(|(_, v)| *v).collect();
    for (at, i) in free.iter().enumerate() {
        values[*i] += motion[6 * n_poses + at];
    }
    let camera = refined.camera.with_parameters(&values).expect("a camera");
    let mut all = Vec::new();
    for (at, frame) in refined.frames.iter().enumerate() {
        let xi = Vector6::from_iterator(motion.rows(6 * at, 6).iter().copied());
        let pose = Pose::exp(&xi) * frame.cam_from_target;
        for c in &seen[frame.frame] {
            let e = c.pixel - camera.project(&(pose * c.x_in_target)).expect("in the field");
            all.extend([e.x / c.sigma_px, e.y / c.sigma_px]);
        }
    }
    DVector::from_vec(all)
}

/// The answer is a minimum of the whole cost, and its covariances are blocks of the inverse of the dense 6v + k normal matrix,
/// with derivatives by central differences: an independent, dense implementation without Schur complement or analytic Jacobian.
#[test]
fn minimum_and_covariance_agree_with_a_dense_solution() {
    let mut rng = Rng::new(37);
    let camera = distorted();
    let (_, seen) = frames(&mut rng, &camera, 10, TILT_RAD);
    let start = altered(&camera, &[("fx_px", 1.02, 0.0), ("fy_px", 1.02, 0.0), ("cx_px", 1.0, 6.0)]);
    let refined = refine_intrinsics(&seen, &start, ALL).expect("refined");
    let (n_poses, free) = (refined.frames.len(), (0..8).collect::<Vec<_>>());
    let n = 6 * n_poses + free.len();
    // Steps of a thousandth of a standard deviation: truncation and rounding both stay below 1e-6 of a derivative.
    let step = |i: usize| match i.checked_sub(6 * n_poses) {
        Some(i) => 1e-3 * refined.sigmas()[i],
        None => 1e-3 * refined.frames[i / 6].covariance[(i % 6, i % 6)].sqrt(),
    };
    let at = |i: usize, h: f64| {
        let mut motion = DVector::zeros(n);
        motion[i] = h;
        residuals(&refined, &seen, &motion, &free)
    };
    let columns: Vec<DVector<f64>> = (0..n).map(|i| (at(i, step(i)) - at(i, -step(i))) / 2e-3).collect();
    let jacobian = DMatrix::from_columns(&columns);
    let gradient = jacobian.tr_mul(&at(0, 0.0));
    assert!(gradient.amax() < 2e-3, "in standard deviations: {}", gradient.amax());
    let dense = (jacobian.transpose() * &jacobian).try_inverse().expect("determined");
    let unit = |i: usize| 1e3 * step(i);
    for (i, _) in free.iter().enumerate() {
        for (j, _) in free.iter().enumerate() {
            let (a, b) = (6 * n_poses + i, 6 * n_poses + j);
            let expected = dense[(a, b)] * unit(a) * unit(b);
            let scale = unit(a) * unit(b);
            assert!((refined.covariance[i * 8 + j] - expected).abs() < 1e-4 * scale, "{i} {j}");
        }
    }
    for (at, frame) in refined.frames.iter().enumerate() {
        for (i, j) in (0..36).map(|ij| (ij / 6, ij % 6)) {
            let (a, b) = (6 * at + i, 6 * at + j);
            let expected = dense[(a, b)] * unit(a) * unit(b);
            assert!((frame.covariance[(i, j)] - expected).abs() < 1e-4 * unit(a) * unit(b), "{at} {i} {j}");
        }
    }
    println!(
        "10 views, 8 intrinsics, from 2 % and 6 px away: gradient {:.1e} standard deviations",
        gradient.amax()
    );
}

/// NEES of the intrinsics (k) and of one pose (6), and the mean squared error of the focal length over its Cramér–Rao variance
/// (the inverse of the dense normal matrix is the bound; the last test says that the stated covariance is that inverse).
fn covariance_is_true(name: &str, camera: &Camera, free: Free, sigma_m: f64, n: usize, seed: u64) {
    let (mut rng, trials) = (Rng::new(seed), 1500);
    let truth: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
    let (mut nees, mut pose_nees, mut focal, mut used, mut k) = (0.0, 0.0, 0.0, 0, 0);
    for _ in 0..trials {
        let poses: Vec<Pose> = (0..n).map(|_| tilted_view(&mut rng, TILT_RAD)).collect();
        let mut seen: Vec<Vec<Correspondence>> = Vec::new();
        for pose in &poses {
            let mut one = seen_by(&mut rng, camera, pose, SIGMA_PX);
            for c in &mut one {
                c.x_in_target += Vector3::new(rng.normal(), rng.normal(), rng.normal()) * sigma_m;
                c.sigma_m = sigma_m;
            }
            seen.push(one);
        }
        let Ok(refined) = refine_intrinsics(&seen, camera, free) else { continue };
        let parameters = refined.camera.parameters();
        let error: Vec<f64> =
            parameters.iter().zip(&truth).map(|((_, value), truth)| value - truth).collect();
        let freed: Vec<usize> = (0..truth.len()).filter(|i| 0.0 < refined.sigmas()[*i]).collect();
        // fx and fy tied together are one parameter.
        let freed = if free.focal == Focal::Common { [&freed[..1], &freed[2..]].concat() } else { freed };
        k = freed.len();
        let covariance = DMatrix::from_fn(k, k, |i, j| refined.covariance[freed[i] * truth.len() + freed[j]]);
        let error = DVector::from_fn(k, |i, _| error[freed[i]]);
        nees += error.dot(&covariance.clone().cholesky().expect("positive").solve(&error));
        focal += error[0] * error[0] / covariance[(0, 0)];
        let frame = &refined.frames[0];
        let xi = (frame.cam_from_target * poses[frame.frame].inverse()).log();
        pose_nees += xi.dot(&frame.covariance.cholesky().expect("positive").solve(&xi));
        used += 1;
    }
    let [nees, pose_nees, focal] = [nees, pose_nees, focal].map(|sum| sum / f64::from(used));
    println!(
        "{name}: {used} of {trials}; NEES intrinsics {nees:.3} (k = {k}), pose {pose_nees:.3} (6); f: variance over bound {focal:.3}"
    );
    assert!(trials * 99 <= used * 100);
    // Standard deviations of the means: √(2k/1500), √(12/1500), √(2/1500); four of them, and 3 % for the bend of the problem.
    let close = |mean: f64, k: f64| (mean - k).abs() < 4.0 * (2.0 * k / 1500.0).sqrt() + 0.03 * k;
    assert!(close(nees, k as f64) && close(pose_nees, 6.0) && close(focal, 1.0));
}

#[test]
fn covariance_is_true_for_the_focal_length() {
    covariance_is_true("f", &pinhole(), Free::default(), 0.0, 5, 41);
}

#[test]
fn covariance_is_true_for_focal_lengths_and_principal_point() {
    covariance_is_true("fx fy cx cy", &pinhole(), Free { distortion: false, ..ALL }, 0.0, 8, 42);
}

#[test]
fn covariance_is_true_for_all_parameters() {
    covariance_is_true("all of brown_conrady 4", &distorted(), ALL, 0.0, 12, 43);
}

#[test]
fn covariance_is_true_for_surveyed_points() {
    covariance_is_true("f, points ±0.5 mm", &pinhole(), Free::default(), 5e-4, 8, 44);
}

/// From a focal length 30 % off in either direction the same minimum is reached as from the truth, to a hundredth of its sigma.
#[test]
fn wrong_focal_lengths_lead_to_the_same_minimum() {
    let mut rng = Rng::new(38);
    let mut reached = 0;
    for _ in 0..100 {
        let (_, seen) = frames(&mut rng, &pinhole(), 8, TILT_RAD);
        let near = refine_intrinsics(&seen, &pinhole(), Free::default()).expect("refined");
        for times in [0.7, 1.3] {
            let far = altered(&pinhole(), &[("fx_px", times, 0.0), ("fy_px", times, 0.0)]);
            let far = refine_intrinsics(&seen, &far, Free::default()).expect("refined");
            let off = (far.camera.parameters()[0].1 - near.camera.parameters()[0].1).abs();
            reached += usize::from(off < 0.01 * near.sigmas()[0]);
        }
    }
    println!("from ±30 % of f: {reached} of 200 reach the minimum");
    assert_eq!(reached, 200);
}

/// One focal length keeps the ratio of fx and fy; what is held stays to the last bit.
#[test]
fn what_is_held_stays() {
    let mut rng = Rng::new(39);
    let (_, seen) = frames(&mut rng, &distorted(), 6, TILT_RAD);
    let refined = refine_intrinsics(&seen, &distorted(), Free::default()).expect("refined");
    let (old, new) = (distorted().parameters(), refined.camera.parameters());
    assert!((new[0].1 / new[1].1 - TRUE.fx_px / TRUE.fy_px).abs() < 1e-14 && new[0].1 != old[0].1);
    assert_eq!(old[2..], new[2..]);
    assert!(
        refined.sigmas()[..2].iter().all(|s| 0.0 < *s) && refined.sigmas()[2..].iter().all(|s| *s == 0.0)
    );
    let nothing = Free { focal: Focal::Held, principal_point: false, distortion: false };
    assert_eq!(refine_intrinsics(&seen, &distorted(), nothing).expect("poses only").camera, distorted());
}

/// The same input gives the same bits; a frame that cannot be used is named and changes nothing.
#[test]
fn bad_frames_are_skipped_and_the_answer_repeats() {
    let mut rng = Rng::new(40);
    let (_, mut seen) = frames(&mut rng, &pinhole(), 5, TILT_RAD);
    let clean = refine_intrinsics(&seen, &pinhole(), Free::default()).expect("refined");
    assert_eq!(clean, refine_intrinsics(&seen, &pinhole(), Free::default()).expect("refined"));
    let mut broken = seen[1].clone();
    broken[3].pixel.x = f64::NAN;
    seen.insert(2, broken);
    seen.insert(4, seen[0][..2].to_vec());
    let refined = refine_intrinsics(&seen, &pinhole(), Free::default()).expect("refined");
    assert_eq!(refined.skipped.iter().map(|s| s.frame).collect::<Vec<_>>(), [2, 4]);
    assert_eq!(refined.frames.iter().map(|f| f.frame).collect::<Vec<_>>(), [0, 1, 3, 5, 6]);
    assert_eq!((refined.camera, refined.covariance), (clean.camera, clean.covariance));
    let none: [Vec<Correspondence>; 0] = [];
    assert_eq!(check_intrinsics(&none, &pinhole()), Err(Error::TooFewFrames { seen: 0, needed: 1 }));
}

/// The sentence a user reads names the parameter, its value and by how much it is off.
#[test]
fn the_verdict_reads_as_a_sentence() {
    let mut rng = Rng::new(45);
    let (_, seen) = frames(&mut rng, &pinhole(), 12, TILT_RAD);
    let wrong = altered(&pinhole(), &[("cx_px", 1.0, 10.0)]);
    let verdict = check_intrinsics(&seen, &wrong).expect("a check").to_string();
    println!("{verdict}");
    assert!(verdict.starts_with("the intrinsics do not fit (χ² "), "{verdict}");
    assert!(verdict.contains("the principal point is off: cx_px 329.5 by -"), "{verdict}");
    let verdict = check_intrinsics(&seen, &pinhole()).expect("a check").to_string();
    assert!(verdict.starts_with("the intrinsics fit (χ² "), "{verdict}");
}

/// Points in space seen once determine focal length and pose together; the camera looks along the diagonal of a box.
#[test]
fn one_view_of_points_in_space_is_enough_for_a_focal_length() {
    let mut rng = Rng::new(46);
    let pose = looking_at(Point::new(0.9, -0.8, 0.7), Point::new(0.0, 0.0, 0.0));
    let corner = |i: usize| Point::new((i & 1) as f64, (i >> 1 & 1) as f64, (i >> 2) as f64) * 0.4;
    let mut seen = Vec::new();
    for i in 0..8 {
        let pixel = pinhole().project(&(pose * corner(i))).expect("in front");
        let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
        seen.push(Correspondence::new(&pinhole(), corner(i), pixel, SIGMA_PX).expect("in the field"));
    }
    let start = altered(&pinhole(), &[("fx_px", 1.1, 0.0), ("fy_px", 1.1, 0.0)]);
    let refined = refine_intrinsics(&[seen], &start, Free::default()).expect("refined");
    let off = (refined.camera.parameters()[0].1 - TRUE.fx_px).abs();
    assert!(off < 4.0 * refined.sigmas()[0], "{off} ± {}", refined.sigmas()[0]);
}
