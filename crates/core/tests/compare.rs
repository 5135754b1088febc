//! What moved: rates, gauge, sets and motions, on simulated calibrations whose noise is what their covariances say.

use crate::common::Rng;
use nalgebra::{Cholesky, DMatrix, DVector};
use resight_core::multiview::pose_graph::{
    PairNoise, PoseGraph, PoseGraphConfig, RelativePose, solve_pose_graph,
};
use resight_core::temporal::compare::{Correlation, RigPoses, compare_poses, compare_rigs};
use resight_core::{Error, Matrix6, Pose, Vector6};

fn motion(rng: &mut Rng, sigma_rad: f64, sigma_m: f64) -> Vector6 {
    Vector6::from_fn(|i, _| rng.normal() * if i < 3 { sigma_rad } else { sigma_m })
}

/// Cameras on a ring of 1 m that look inwards.
fn ring(n: usize) -> Vec<Pose> {
    let camera = |i: usize| {
        let turn = std::f64::consts::TAU * i as f64 / n as f64;
        let facing = Pose::exp(&Vector6::new(0.0, turn, 0.0, 0.0, 0.0, 0.0));
        let away = Pose::exp(&Vector6::new(0.1, 0.0, 0.05 * i as f64, 0.0, 0.02, 1.0));
        away * facing
    };
    (0..n).map(camera).collect()
}

/// A covariance with correlations between all cameras but the reference, which has none: turns of about 0.5 mrad, places of 1 mm.
fn covariance(n: usize, reference: usize, rng: &mut Rng) -> DMatrix<f64> {
    let scale = |i: usize| if i % 6 < 3 { 5e-4 } else { 1e-3 };
    let mix = DMatrix::from_fn(6 * n, 6 * n, |i, j| {
        let own = if i == j { 1.0 } else { 0.0 };
        scale(i) * (own + 0.15 * rng.normal())
    });
    let mut covariance = &mix * mix.transpose();
    for i in 6 * reference..6 * reference + 6 {
        covariance.row_mut(i).fill(0.0);
        covariance.column_mut(i).fill(0.0);
    }
    covariance
}

/// The true places as a calibration with this covariance finds them.
fn calibrated(truth: &[Pose], covariance: &DMatrix<f64>, reference: usize, rng: &mut Rng) -> RigPoses {
    // In the frame of the reference, as such calibrations are.
    let to_reference = truth[reference].inverse();
    let lifted = covariance + DMatrix::identity(covariance.nrows(), covariance.nrows()) * 1e-18;
    let root = Cholesky::new(lifted).unwrap().l();
    let noise = root * DVector::from_fn(covariance.nrows(), |_, _| rng.normal());
    let noisy = |(i, pose): (usize, &Pose)| {
        let motion = Vector6::from_iterator(noise.rows(6 * i, 6).iter().copied());
        if i == reference { Pose::identity() } else { (*pose * to_reference).moved(&motion) }
    };
    RigPoses {
        cam_from_rig: truth.iter().enumerate().map(noisy).collect(),
        covariance: covariance.clone(),
        correlation: Correlation::Known,
        noise_degrees_of_freedom: None,
    }
}

/// The same places seen from another frame: nothing physical changes.
fn in_other_frame(places: &RigPoses, rig_from_other: &Pose) -> RigPoses {
    let cam_from_rig = places.cam_from_rig.iter().map(|p| *p * *rig_from_other).collect();
    RigPoses { cam_from_rig, ..places.clone() }
}

/// The truth with some cameras moved by a motion in their own frames.
fn with_moved(truth: &[Pose], cameras: &[usize], new_from_old: &Pose) -> Vec<Pose> {
    let moved = |(i, pose): (usize, &Pose)| if cameras.contains(&i) { *new_from_old * *pose } else { *pose };
    truth.iter().enumerate().map(moved).collect()
}

/// At 5 % the rule, which splits the chance between two tests that overlap, must alarm in 2.5 to 5 % of calibrations without motion:
/// 4000 trials give it to ± 0.35 % (one standard deviation).
#[test]
fn false_alarm_rate_is_as_stated() {
    let (n_trials, level) = (4000, 0.05);
    for n in [2, 4] {
        let mut rng = Rng::new(7 + n as u64);
        let truth = ring(n);
        let covariances = [covariance(n, 0, &mut rng), covariance(n, n - 1, &mut rng)];
        let mut alarms = 0;
        for _ in 0..n_trials {
            let before = calibrated(&truth, &covariances[0], 0, &mut rng);
            let after = calibrated(&truth, &covariances[1], n - 1, &mut rng);
            alarms += usize::from(!compare_rigs(&before, &after, level).unwrap().moved.is_empty());
        }
        let rate = alarms as f64 / n_trials as f64;
        println!("{n} cameras: {alarms} false alarms in {n_trials} at {level}");
        let least = if n == 2 { 0.05 } else { 0.025 };
        assert!(least - 0.011 < rate && rate < 0.05 + 0.011, "{n}: {rate}");
    }
}

/// Each camera's own error, and that of the reference camera, which all the others share.
fn shared(truth: &[Pose], rng: &mut Rng) -> DMatrix<f64> {
    let n = truth.len();
    let spread = |scale: f64, rng: &mut Rng| {
        let root = Matrix6::from_fn(|i, _| scale * rng.normal() * if i < 3 { 2e-4 } else { 4e-4 });
        root * root.transpose() + Matrix6::identity() * 1e-9
    };
    let reference = spread(2.0, rng);
    let mut covariance = DMatrix::zeros(6 * n, 6 * n);
    for i in 1..n {
        for j in 1..n {
            let carried = |k: usize| (truth[k] * truth[0].inverse()).adjoint();
            let block = carried(i) * reference * carried(j).transpose();
            let own = if i == j { spread(1.0, rng) } else { Matrix6::zeros() };
            covariance.fixed_view_mut::<6, 6>(6 * i, 6 * j).copy_from(&(block + own));
        }
    }
    covariance
}

/// Only the blocks of the cameras themselves.
fn own_blocks(places: &RigPoses, correlation: Correlation) -> RigPoses {
    let covariance = places.covariance.clone();
    let n = covariance.nrows();
    let covariance = DMatrix::from_fn(n, n, |i, j| if i / 6 == j / 6 { covariance[(i, j)] } else { 0.0 });
    RigPoses { covariance, correlation, ..places.clone() }
}

/// What all cameras share with the reference counts once with the joint covariance, once a camera without it: counted as independent it
/// raises false alarms, tested for any correlation it raises none too many, and a sudden motion is found all the same.
#[test]
fn an_error_that_all_share_raises_no_false_alarms() {
    let (n, n_trials) = (4, 1000);
    for level in [0.05, 1e-3] {
        let mut rng = Rng::new(23);
        let truth = ring(n);
        let knock = Pose::exp(&Vector6::new(0.0, 0.01, 0.0, 0.02, 0.0, 0.0));
        let (mut joint, mut independent, mut any, mut found) = (0, 0, 0, 0);
        for _ in 0..n_trials {
            let cov = shared(&truth, &mut rng);
            let before = calibrated(&truth, &cov, 0, &mut rng);
            let after = calibrated(&truth, &cov, 0, &mut rng);
            let alarm = |a: &RigPoses, b: &RigPoses| !compare_rigs(a, b, level).unwrap().moved.is_empty();
            let own =
                |correlation| alarm(&own_blocks(&before, correlation), &own_blocks(&after, correlation));
            joint += usize::from(alarm(&before, &after));
            independent += usize::from(own(Correlation::Known));
            any += usize::from(own(Correlation::Unknown));
            // One of the two files may be from before.
            any += usize::from(alarm(&before, &own_blocks(&after, Correlation::Unknown)));
            let moved = calibrated(&with_moved(&truth, &[2], &knock), &cov, 0, &mut rng);
            let unknown = |places: &RigPoses| own_blocks(places, Correlation::Unknown);
            let reported = compare_rigs(&unknown(&before), &unknown(&moved), level).unwrap();
            found += usize::from(reported.moved.len() == 1 && reported.moved[0].camera == 2);
        }
        println!(
            "at {level}: joint {joint}, independent {independent}, any {any} of 2; {found} found of {n_trials}"
        );
        let most = |trials: f64| trials * level + 3.3 * (trials * level).sqrt() + 1.0;
        assert!(joint as f64 <= most(n_trials as f64) && any as f64 <= most(2.0 * n_trials as f64));
        assert!(level < 0.01 || 25 <= joint, "the level is used: {joint}");
        assert!(most(n_trials as f64) < independent as f64, "{independent}");
        assert!(990 <= found, "{found}");
    }
}

/// Relative poses of pairs with errors of 0.5 mrad and 1 mm.
fn pairs(truth: &[Pose], joined: &[(usize, usize)], noise: PairNoise, rng: &mut Rng) -> Vec<RelativePose> {
    let pair = |(a, b): &(usize, usize)| {
        let b_from_a = (truth[*b] * truth[*a].inverse()).moved(&motion(rng, 5e-4, 1e-3));
        RelativePose { a: *a, b: *b, b_from_a, noise }
    };
    joined.iter().map(pair).collect()
}

/// A rig from pairs, as `pose-graph` writes it.
fn from_pairs(n: usize, pairs: &[RelativePose]) -> RigPoses {
    let graph = PoseGraph { n_cameras: n, pairs };
    let found =
        solve_pose_graph(&graph, &PoseGraphConfig { reference_camera: 0, median_sigma: None }).unwrap();
    RigPoses {
        cam_from_rig: found.cameras.iter().map(|camera| camera.cam_from_rig).collect(),
        covariance: found.joint_covariance,
        correlation: Correlation::Known,
        noise_degrees_of_freedom: found.noise_degrees_of_freedom.map(|degrees| degrees as f64),
    }
}

/// At most so many of `trials` at this rate, once in two thousand.
fn most(trials: usize, rate: f64) -> usize {
    let mean = trials as f64 * rate;
    (mean + 3.3 * mean.sqrt() + 1.0) as usize
}

/// Rigs from pairs whose noise only their loops tell: from one loop to many, alarms when nothing moved are no more than stated. Counted as known
/// the noise of one loop raises alarms in most comparisons.
#[test]
fn noise_estimated_from_few_loops_raises_no_false_alarms() {
    let few = [(0, 1), (1, 2), (2, 0)];
    let ring_of_four = [(0, 1), (1, 2), (2, 3), (3, 0)];
    let all_of_four = [(0, 1), (1, 2), (2, 3), (3, 0), (0, 2), (1, 3)];
    let all_of_six: Vec<(usize, usize)> = (0..6).flat_map(|a| (0..a).map(move |b| (a, b))).collect();
    let usual: usize = std::env::var("RESIGHT_RUNS").ok().and_then(|n| n.parse().ok()).unwrap_or(1000);
    let cases: [(usize, &[(usize, usize)]); 4] =
        [(3, &few), (4, &ring_of_four), (4, &all_of_four), (6, &all_of_six)];
    for (n, joined) in cases {
        let n_trials = if n < 6 { usual } else { usual / 4 }; // Many sets of cameras take time.
        for (is_open, noise) in [
            (true, PairNoise::Error(1.0)),
            (
                false,
                PairNoise::Covariance(Matrix6::from_fn(|i, j| match (i == j, i < 3) {
                    (true, true) => 2.5e-7,
                    (true, false) => 1e-6,
                    _ => 0.0,
                })),
            ),
        ] {
            let mut rng = Rng::new(31 + joined.len() as u64);
            let truth = ring(n);
            let (mut often, mut seldom, mut by_chi2, mut whole, mut apart) = (0, 0, 0, 0, 0);
            for _ in 0..n_trials {
                let both = [0; 2].map(|_| from_pairs(n, &pairs(&truth, joined, noise, &mut rng)));
                let alarm = |a: &RigPoses, b: &RigPoses, level: f64| {
                    usize::from(!compare_rigs(a, b, level).unwrap().moved.is_empty())
                };
                often += alarm(&both[0], &both[1], 0.05);
                seldom += alarm(&both[0], &both[1], 1e-3);
                whole += usize::from(compare_rigs(&both[0], &both[1], 0.5).unwrap().probability < 0.05);
                let known = both.each_ref().map(|b| RigPoses { noise_degrees_of_freedom: None, ..b.clone() });
                by_chi2 += alarm(&known[0], &known[1], 0.05);
                // `rig --json` without --joint-covariance.
                let own = both.each_ref().map(|b| own_blocks(b, Correlation::Unknown));
                apart += alarm(&own[0], &own[1], 0.05);
            }
            println!(
                "{n} cameras, {} pairs, noise estimated {is_open}: of {n_trials} at 0.05 {often} alarms ({whole} by all together, {apart} without the joint covariance, {by_chi2} by χ²), at 0.001 {seldom}",
                joined.len()
            );
            let few = most(n_trials, 0.05);
            assert!(often <= few && whole <= few && apart <= few, "{often} {whole} {apart}");
            assert!(seldom <= most(n_trials, 1e-3), "{seldom}");
            // The chance is used, not only kept.
            assert!(6 <= n || n_trials / 50 <= whole, "{whole}");
            assert!(
                !is_open || 6 < joined.len() || few < by_chi2,
                "the noise of few loops is no known noise: {by_chi2}"
            );
        }
    }
}

/// With a noise that is estimated from few numbers a large motion is still found, and one that the noise hides is not.
#[test]
fn a_knock_is_found_whose_noise_is_estimated() {
    let all: Vec<(usize, usize)> = (0..5).flat_map(|a| (0..a).map(move |b| (a, b))).collect();
    let (truth, mut rng) = (ring(5), Rng::new(41));
    let knock = Pose::exp(&Vector6::new(0.0, 0.01, 0.0, 0.03, 0.0, 0.0));
    let mut found = 0;
    for _ in 0..40 {
        let noise = PairNoise::Error(1.0);
        let before = from_pairs(5, &pairs(&truth, &all, noise, &mut rng));
        let after = from_pairs(5, &pairs(&with_moved(&truth, &[3], &knock), &all, noise, &mut rng));
        let answer = compare_rigs(&before, &after, 1e-3).unwrap();
        let degrees = answer.noise_degrees_of_freedom.unwrap();
        assert!((18.0..=36.0 + 1e-9).contains(&degrees), "{degrees}");
        found += usize::from(
            answer.moved.len() == 1 && answer.moved[0].camera == 3 && answer.alternatives.is_empty(),
        );
    }
    println!("a sudden motion of 30 mm is found in {found} of 40");
    assert!(38 <= found, "{found}");
}

/// χ² of unmoved rigs is χ² distributed: its mean over 2000 trials is the degrees of freedom, to five standard deviations.
#[test]
fn chi2_has_its_mean() {
    let n = 5;
    let mut rng = Rng::new(99);
    let truth = ring(n);
    let (first, second) = (covariance(n, 3, &mut rng), covariance(n, 2, &mut rng));
    let n_trials = 2000;
    let mut sum = 0.0;
    for _ in 0..n_trials {
        let before = calibrated(&truth, &first, 3, &mut rng);
        let after = calibrated(&truth, &second, 2, &mut rng);
        sum += compare_rigs(&before, &after, 1e-3).unwrap().chi2;
    }
    let (mean, degrees_of_freedom) = (sum / n_trials as f64, 6.0 * (n - 1) as f64);
    println!("mean χ² {mean:.2} for {degrees_of_freedom}");
    assert!(
        (mean - degrees_of_freedom).abs() < 5.0 * (2.0 * degrees_of_freedom / n_trials as f64).sqrt(),
        "{mean}"
    );
}

/// The choice of the reference does not affect which camera moved: a sudden motion of the reference camera is found as such.
#[test]
fn a_knocked_reference_is_named() {
    let n = 4;
    let mut rng = Rng::new(3);
    let truth = ring(n);
    let knock = Pose::exp(&Vector6::new(0.0, 0.01, 0.0, 0.02, 0.0, 0.0));
    for knocked in 0..n {
        let cov = covariance(n, 0, &mut rng);
        let before = calibrated(&truth, &cov, 0, &mut rng);
        let after = calibrated(&with_moved(&truth, &[knocked], &knock), &cov, 0, &mut rng);
        let found = compare_rigs(&before, &after, 1e-3).unwrap();
        assert_eq!(found.moved.iter().map(|m| m.camera).collect::<Vec<_>>(), [knocked]);
        assert!(found.alternatives.is_empty() && found.moved[0].probability < 1e-3);
    }
}

/// Nothing depends on the frames that the two calibrations use, nor on the order of the cameras.
#[test]
fn frame_and_order_do_not_matter() {
    let n = 4;
    let mut rng = Rng::new(11);
    let truth = ring(n);
    let cov = covariance(n, 1, &mut rng);
    let before = calibrated(&truth, &cov, 1, &mut rng);
    let knock = Pose::exp(&Vector6::new(0.01, 0.0, 0.0, 0.0, 0.0, 0.02));
    let after = calibrated(&with_moved(&truth, &[2], &knock), &cov, 1, &mut rng);
    let plain = compare_rigs(&before, &after, 1e-3).unwrap();
    let frame = Pose::exp(&Vector6::new(1.0, -0.4, 2.0, 3.0, 0.0, -5.0));
    let turned = compare_rigs(&in_other_frame(&before, &frame), &after, 1e-3).unwrap();
    assert_eq!(plain.unmoved, turned.unmoved);
    assert!((plain.chi2 / turned.chi2 - 1.0).abs() < 1e-8);
    let reversed = |places: &RigPoses| RigPoses {
        cam_from_rig: places.cam_from_rig.iter().rev().copied().collect(),
        covariance: DMatrix::from_fn(6 * n, 6 * n, |i, j| {
            let at = |k: usize| 6 * (n - 1 - k / 6) + k % 6;
            places.covariance[(at(i), at(j))]
        }),
        ..places.clone()
    };
    let backwards = compare_rigs(&reversed(&before), &reversed(&after), 1e-3).unwrap();
    assert_eq!(backwards.moved[0].camera, n - 1 - 2);
    // χ² of the unmoved set does not depend on its first camera to first order; noise and covariance are about 1e-3.
    let (a, b) = (&plain.moved[0], &backwards.moved[0]);
    assert!((a.chi2 / b.chi2 - 1.0).abs() < 0.02, "{} {}", a.chi2, b.chi2);
    assert!((a.old_from_new.translation - b.old_from_new.translation).norm() < 1e-4);
}

/// Two cameras on one bar that moved together are both named; with two against two, or with two cameras in all, it is undecidable.
#[test]
fn groups_that_move_together() {
    let mut rng = Rng::new(21);
    // A rotation of the rig's frame by which several cameras move as one body.
    let bar = Pose::exp(&Vector6::new(0.0, 0.02, 0.0, 0.03, 0.0, 0.0));
    for (n, group, decided) in [(5, vec![1, 3], true), (4, vec![0, 1], false), (2, vec![1], false)] {
        let truth = ring(n);
        let cov = covariance(n, 0, &mut rng);
        let before = calibrated(&truth, &cov, 0, &mut rng);
        let moved: Vec<Pose> =
            truth.iter().enumerate().map(|(i, p)| if group.contains(&i) { *p * bar } else { *p }).collect();
        let after = calibrated(&moved, &cov, 0, &mut rng);
        let found = compare_rigs(&before, &after, 1e-3).unwrap();
        let named: Vec<usize> = found.moved.iter().map(|m| m.camera).collect();
        if decided {
            assert_eq!((named, found.alternatives.len()), (group, 0));
        } else {
            assert_eq!(found.alternatives.len(), 1, "{found:?}");
            assert_eq!((named.len(), found.alternatives[0].len()), (n / 2, n / 2));
        }
    }
}

/// The motion found, less the true one, is as large as its covariance says: mean of 600 squared Mahalanobis distances 6 ± 5 · 0.14.
#[test]
fn the_motion_found_has_its_covariance() {
    // At the usual level one of a thousand trials would suspect a second camera.
    const LEVEL: f64 = 1e-9;
    let n = 4;
    let mut rng = Rng::new(5);
    let truth = ring(n);
    let new_from_old = Pose::exp(&Vector6::new(0.005, 0.02, -0.01, 0.03, 0.0, 0.01));
    let cov = covariance(n, 1, &mut rng);
    let moved = with_moved(&truth, &[3], &new_from_old);
    let (mut sum, n_trials) = (0.0, 600);
    for _ in 0..n_trials {
        let before = calibrated(&truth, &cov, 1, &mut rng);
        let after = calibrated(&moved, &cov, 1, &mut rng);
        let found = compare_rigs(&before, &after, LEVEL).unwrap();
        assert_eq!(found.moved.len(), 1);
        let m = &found.moved[0];
        let error = (m.old_from_new * new_from_old).log();
        sum += error.dot(&m.covariance.cholesky().unwrap().solve(&error));
    }
    let nees = sum / n_trials as f64;
    println!("NEES of the motion {nees:.2}");
    assert!((nees - 6.0).abs() < 5.0 * (12.0 / n_trials as f64).sqrt(), "{nees}");
}

/// Twelve cameras of which one moved by five standard deviations: the test of single cameras finds what the whole χ² drowns.
#[test]
fn small_motions_in_large_rigs_are_found() {
    let n = 12;
    let truth = ring(n);
    let cov = DMatrix::from_diagonal_element(6 * n, 6 * n, 1e-6);
    let (mut found_n, n_trials) = (0, 40);
    let mut rng = Rng::new(17);
    let push = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 8e-3, 0.0, 0.0));
    for _ in 0..n_trials {
        let place = |pose: &Pose, rng: &mut Rng| pose.moved(&motion(rng, 1e-3, 1e-3));
        let before: Vec<Pose> = truth.iter().map(|p| place(p, &mut rng)).collect();
        let after: Vec<Pose> = with_moved(&truth, &[4], &push).iter().map(|p| place(p, &mut rng)).collect();
        let places = |cam_from_rig: Vec<Pose>| RigPoses {
            cam_from_rig,
            covariance: cov.clone(),
            correlation: Correlation::Known,
            noise_degrees_of_freedom: None,
        };
        let found = compare_rigs(&places(before), &places(after), 1e-3).unwrap();
        found_n += usize::from(found.moved.len() == 1 && found.moved[0].camera == 4);
    }
    println!("a push of 5.4 σ is found in {found_n} of {n_trials}");
    assert!(20 <= found_n, "{found_n}");
}

#[test]
fn one_pose_and_another() {
    let pose = Pose::exp(&Vector6::new(0.3, -0.2, 0.1, 0.5, 0.0, 2.0));
    let covariance = Matrix6::from_diagonal_element(1e-6);
    let same = compare_poses((&pose, &covariance), (&pose, &covariance)).unwrap();
    assert!(same.chi2 < 1e-20 && same.probability == 1.0);
    let (mut rng, n_trials, mut sum) = (Rng::new(1), 2000, 0.0);
    for _ in 0..n_trials {
        let noisy = |rng: &mut Rng| pose.moved(&motion(rng, 1e-3, 1e-3));
        let found = compare_poses((&noisy(&mut rng), &covariance), (&noisy(&mut rng), &covariance));
        sum += found.unwrap().chi2;
    }
    let mean = sum / n_trials as f64;
    assert!((mean - 6.0).abs() < 5.0 * (12.0 / n_trials as f64).sqrt(), "{mean}");
    let motion = Vector6::new(0.02, 0.0, 0.0, 0.0, 0.01, 0.0);
    let old_from_new = compare_poses((&pose, &covariance), (&(Pose::exp(&-motion) * pose), &covariance));
    assert!((old_from_new.unwrap().old_from_new.log() - motion).norm() < 1e-12);
}

#[test]
fn what_cannot_be_compared_is_refused() {
    let places = |n: usize, sigma: f64| RigPoses {
        cam_from_rig: ring(n),
        covariance: DMatrix::from_diagonal_element(6 * n, 6 * n, sigma * sigma),
        correlation: Correlation::Known,
        noise_degrees_of_freedom: None,
    };
    let good = places(3, 1e-3);
    let message = |after: &RigPoses, level: f64| compare_rigs(&good, after, level).unwrap_err().to_string();
    assert!(message(&places(2, 1e-3), 1e-3).contains("2 cameras given for 3"));
    assert!(message(&good, 0.0).contains("false_alarm is 0"));
    assert!(
        message(&RigPoses { covariance: DMatrix::zeros(6, 6), ..good.clone() }, 1e-3).contains("6 a camera")
    );
    let groundless = RigPoses { noise_degrees_of_freedom: Some(0.0), ..good.clone() };
    assert!(message(&groundless, 1e-3).contains("noise_degrees_of_freedom"));
    let mut torn = good.clone();
    torn.cam_from_rig[1].translation.x = f64::NAN;
    assert!(message(&torn, 1e-3).contains("finite"));
    let exact = RigPoses { covariance: DMatrix::zeros(18, 18), ..good.clone() };
    let refused = compare_rigs(&exact, &exact, 1e-3);
    assert!(matches!(refused, Err(Error::InvalidSetting { setting: "covariance", .. })), "{refused:?}");
    let one = places(1, 1e-3);
    assert!(compare_rigs(&one, &one, 1e-3).unwrap_err().to_string().contains("two or more"));
}
