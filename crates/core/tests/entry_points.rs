//! Random numbers, of any bits and any magnitude, among those of good problems, into every entry point that takes covariances: never a
//! panic, never a number in an answer that is none, never a covariance that is none.
//!
//! How much: `common/wild.rs`. Surveys, batches, turns and advice: `entry_points_jobs.rs`.

use crate::common::Rng;
use crate::common::views;
use crate::common::wild::{covariance, feed, is_whole, number, pose, seen, spoil};
use nalgebra::{DMatrix, Matrix6, Vector6};
use resight_core::Pose;
use resight_core::covariance::is_covariance;
use resight_core::locate::refine::refine;
use resight_core::locate::{Config, locate};
use resight_core::multiview::hand_eye::{
    Candidate as HandCandidate, HandEyeConfig, HandEyeView, Mounting, solve_hand_eye,
};
use resight_core::multiview::pose_graph::{
    PairNoise, PoseGraph, PoseGraphConfig, RelativePose, solve_pose_graph,
};
use resight_core::multiview::rig::{Observation, RigConfig, RigProblem, solve_rig};
use resight_core::multiview::rig_pose::{RigView, locate_rig};
use resight_core::multiview::triangulate::{PointView, isotropic, triangulate};
use resight_core::temporal::compare::{Correlation, RigPoses, compare_poses, compare_rigs};
use resight_core::temporal::monitor::DriftNoise;
use resight_core::temporal::monitor::{Monitor, MonitorConfig, Reading, Reference, Watch};
use resight_core::temporal::track::{Candidate, TrackConfig, Tracker};

#[test]
fn locate_answers_in_numbers() {
    let camera = views::camera();
    feed("locate", 1, |rng| {
        let seen = seen(rng, &views::oblique());
        let mut given = [4.0, 4.0, 0.0, 0.0, 4.0, 4.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        spoil(rng, &mut given);
        let intrinsics_covariance = (rng.index(2) == 0).then_some(&given[..]);
        let Ok(e) = locate(&seen, &camera, &Config { intrinsics_covariance, ..Config::default() }) else {
            return false;
        };
        assert!(is_covariance(&e.covariance), "{seen:?} {intrinsics_covariance:?} {e:?}");
        for h in e.minima().filter(|h| h.is_alternative) {
            let m = h.minimum;
            assert!(
                is_whole(&m.cam_from_target) && (m.chi2 + m.rms_px + h.probability).is_finite(),
                "{seen:?} {m:?}"
            );
            assert!(m.covariance.sum().is_finite(), "{seen:?} {intrinsics_covariance:?} {m:?}");
        }
        true
    });
}

#[test]
fn refine_answers_in_numbers() {
    let camera = views::camera();
    feed("refine", 2, |rng| {
        let start = pose(rng) * views::oblique();
        let seen = seen(rng, &views::oblique());
        let start = if rng.index(2) == 0 { start } else { views::oblique() };
        let Ok(m) = refine(&start, &seen, &camera) else { return false };
        assert!(is_whole(&m.cam_from_target) && (m.chi2 + m.rms_px).is_finite(), "{seen:?} {m:?}");
        assert!(is_covariance(&m.covariance), "{seen:?} {m:?}");
        true
    });
}

#[test]
fn locate_rig_answers_in_numbers() {
    let camera = views::camera();
    feed("locate_rig", 3, |rng| {
        let places = [Pose::identity(), pose(rng)];
        let truth = views::oblique();
        let seen = [seen(rng, &truth), if rng.index(2) == 0 { seen(rng, &truth) } else { Vec::new() }];
        let lens: [f64; 16] =
            core::array::from_fn(|i| if i % 5 == 0 { covariance(rng)[(0, 0)] } else { 0.0 });
        let views: Vec<RigView> = (0..2)
            .map(|i| RigView {
                camera: &camera,
                cam_from_rig: places[i],
                cam_from_rig_covariance: (rng.index(2) == 0).then(|| covariance(rng)),
                intrinsics_covariance: (rng.index(2) == 0).then_some(&lens[..]),
                seen: &seen[i],
            })
            .collect();
        let Ok(e) = locate_rig(&views) else { return false };
        assert!(
            is_whole(&e.rig_from_target) && (e.chi2 + e.rms_px).is_finite() && is_covariance(&e.covariance),
            "{e:?}"
        );
        true
    });
}

#[test]
fn solve_rig_answers_in_numbers() {
    feed("solve_rig", 4, |rng| {
        let mut observations = Vec::new();
        for view in 0..3 {
            let body = Pose::exp(&Vector6::from_fn(|_, _| 0.1 * rng.normal())) * views::oblique();
            for camera in 0..2 {
                let shift = Pose::exp(&(Vector6::new(0.0, 0.05, 0.0, 0.2, 0.0, 0.0) * camera as f64));
                observations.push(Observation { camera, view, target: 0, seen: seen(rng, &(shift * body)) });
            }
        }
        let cameras = [views::camera(), views::camera()];
        let problem =
            RigProblem { cameras: &cameras, body_of_target: &[0], n_views: 3, observations: &observations };
        let Ok(s) = solve_rig(&problem, &RigConfig::default()) else { return false };
        assert!((s.rms_px + s.chi2 + s.noise_scale).is_finite());
        assert!(
            s.cameras.iter().all(|c| is_whole(&c.cam_from_rig) && is_covariance(&c.covariance)),
            "{:?}",
            s.cameras
        );
        true
    });
}

#[test]
fn compare_poses_answers_in_numbers() {
    feed("compare_poses", 5, |rng| {
        let (a, b) = (pose(rng), Pose::exp(&Vector6::from_fn(|_, _| 1e-3 * rng.normal())));
        let (p, q) = (covariance(rng), covariance(rng));
        let Ok(m) = compare_poses((&a, &p), (&(b * a), &q)) else { return false };
        assert!(m.chi2.is_finite() && 0.0 <= m.chi2 && is_covariance(&m.covariance), "{m:?}");
        true
    });
}

#[test]
fn compare_rigs_answers_in_numbers() {
    feed("compare_rigs", 6, |rng| {
        let places = |rng: &mut Rng| {
            let mut covariance = DMatrix::<f64>::zeros(18, 18);
            for i in 1..3 {
                covariance.view_mut((6 * i, 6 * i), (6, 6)).copy_from(&self::covariance(rng));
            }
            let correlation = if rng.normal() < 0.0 { Correlation::Known } else { Correlation::Unknown };
            RigPoses {
                cam_from_rig: (0..3).map(|_| pose(rng)).collect(),
                covariance,
                correlation,
                noise_degrees_of_freedom: None,
            }
        };
        let (before, after) = (places(rng), places(rng));
        let Ok(c) = compare_rigs(&before, &after, 0.01) else { return false };
        assert!(
            c.chi2.is_finite() && 0.0 <= c.chi2 && c.moved.iter().all(|m| is_covariance(&m.covariance)),
            "{c:?}"
        );
        true
    });
}

#[test]
fn solve_pose_graph_answers_in_numbers() {
    feed("solve_pose_graph", 7, |rng| {
        let truth: Vec<Pose> = (0..3).map(|_| pose(rng)).collect();
        let pairs: Vec<RelativePose> = [(0, 1), (1, 2), (0, 2)]
            .iter()
            .map(|(a, b)| {
                let off = Pose::exp(&Vector6::from_fn(|_, _| 1e-3 * rng.normal()));
                let noise = PairNoise::Covariance(covariance(rng));
                RelativePose { a: *a, b: *b, b_from_a: off * truth[*b] * truth[*a].inverse(), noise }
            })
            .collect();
        let config = PoseGraphConfig { reference_camera: 0, median_sigma: None };
        let Ok(s) = solve_pose_graph(&PoseGraph { n_cameras: 3, pairs: &pairs }, &config) else {
            return false;
        };
        assert!(
            s.chi2.is_finite()
                && s.cameras.iter().all(|c| is_whole(&c.cam_from_rig) && is_covariance(&c.covariance)),
            "{pairs:?} {s:?}"
        );
        true
    });
}

#[test]
fn solve_hand_eye_answers_in_numbers() {
    feed("solve_hand_eye", 8, |rng| {
        let (x, y) = (pose(rng), pose(rng));
        let views: Vec<HandEyeView> = (0..5)
            .map(|_| {
                let base_from_gripper = pose(rng);
                let off = Pose::exp(&Vector6::from_fn(|_, _| 1e-3 * rng.normal()));
                let cam_from_target = off * x * base_from_gripper.inverse() * y;
                let candidate =
                    HandCandidate { cam_from_target, covariance: covariance(rng), delta_chi2: 0.0 };
                let gripper_covariance = (rng.index(3) == 0).then(|| covariance(rng));
                HandEyeView {
                    base_from_gripper,
                    gripper_covariance,
                    written: None,
                    candidates: vec![candidate],
                    seen: &[],
                }
            })
            .collect();
        let config = HandEyeConfig { mounting: Mounting::CameraOnGripper, ..HandEyeConfig::default() };
        let Ok(h) = solve_hand_eye(&views, &config) else { return false };
        assert!(is_whole(&h.cam_from_carrier) && h.chi2.is_finite(), "{h:?}");
        assert!(is_covariance(&h.carrier_covariance) && is_covariance(&h.holder_covariance), "{h:?}");
        true
    });
}

#[test]
fn triangulate_answers_in_numbers() {
    feed("triangulate", 9, |rng| {
        let camera = views::camera();
        let views: Vec<PointView> = (0..3)
            .map(|_| {
                let mut pixel =
                    resight_core::Pixel::new(320.0 + 50.0 * rng.normal(), 240.0 + 50.0 * rng.normal());
                spoil(rng, pixel.as_mut_slice());
                let covariance = (rng.index(2) == 0).then(|| covariance(rng));
                let sigma_px = if rng.index(4) == 0 { number(rng) } else { 0.5 };
                PointView {
                    camera: &camera,
                    cam_from_world: pose(rng),
                    covariance,
                    intrinsics_covariance: None,
                    pixel,
                    covariance_px2: isotropic(sigma_px),
                }
            })
            .collect();
        let Ok(p) = triangulate(&views) else { return false };
        assert!(
            (p.chi2 + p.rms_px + p.x_in_world.sum()).is_finite() && is_covariance(&p.covariance_m2),
            "{views:?} {p:?}"
        );
        true
    });
}

#[test]
fn tracker_answers_in_numbers() {
    feed("tracker", 10, |rng| {
        let mut tracker = Tracker::new(&TrackConfig::default()).expect("a tracker");
        let mut answered = false;
        for i in 0..5 {
            let candidate =
                Candidate { cam_from_target: pose(rng), covariance: covariance(rng), probability: 1.0 };
            let Some(t) = tracker.push(f64::from(i), &[candidate]) else { continue };
            answered = true;
            assert!(
                is_whole(&t.cam_from_target) && is_covariance(&t.covariance) && t.probability.is_finite(),
                "{t:?}"
            );
        }
        answered
    });
}

#[test]
fn monitor_answers_in_numbers() {
    feed("monitor", 11, |rng| {
        let a_from_b = views::oblique();
        let noise = DriftNoise {
            reference: covariance(rng),
            reading: covariance(rng),
            bias: covariance(rng),
            bias_time_s: 60.0,
            diurnal: Matrix6::zeros(),
        };
        let given = [noise.reference, noise.reading, noise.bias];
        let Ok(mut monitor) = Monitor::new(&Reference { a_from_b, noise }, &MonitorConfig::default(), 0.0)
        else {
            return false;
        };
        assert!(given.iter().all(is_covariance), "{given:?}");
        for i in 0..20 {
            let off = Pose::exp(&Vector6::from_fn(|_, _| 1e-2 * rng.normal()));
            let reading = Reading {
                t_s: f64::from(i),
                a_from_b: off * a_from_b,
                covariance: covariance(rng),
                is_consistent: true,
            };
            if let Watch::Drifted(drift) = monitor.push(&reading) {
                assert!(is_covariance(&drift.covariance), "{drift:?}");
            }
        }
        true
    });
}
