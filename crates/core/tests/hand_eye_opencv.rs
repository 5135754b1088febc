//! Hand–eye beside OpenCV: the same noisy problems, its answers as recorded.

use crate::common::hands::squared;
use nalgebra::{Matrix6, Vector3, Vector6};
use resight_core::Pose;
use resight_core::multiview::hand_eye::{Candidate, HandEye, HandEyeConfig, HandEyeView, solve_hand_eye};

/// A row of the table: what, of which problem, 3×4.
fn table_rows() -> Vec<(&'static str, usize, Pose)> {
    let row = |line: &'static str| {
        let mut words = line.split(' ');
        let (name, number) = (words.next().unwrap(), words.next().unwrap().parse().unwrap());
        let v: Vec<f64> = words.map(|word| word.parse().unwrap()).collect();
        let rotation = nalgebra::Matrix3::from_fn(|i, j| v[4 * i + j]);
        (name, number, Pose::new(rotation, Vector3::new(v[3], v[7], v[11])))
    };
    include_str!("hand_eye_tables/opencv.txt").lines().filter(|l| !l.starts_with('#')).map(row).collect()
}

/// Root mean square angle and distance of `hand_from_cam` from the truth over all problems.
fn rms_off(found: &[Pose], truth: &[Pose]) -> (f64, f64) {
    let n = truth.len() as f64;
    let turn = found.iter().zip(truth).map(|(f, t)| f.angle_to_rad(t).powi(2)).sum::<f64>() / n;
    let shift =
        found.iter().zip(truth).map(|(f, t)| (f.origin() - t.origin()).norm_squared()).sum::<f64>() / n;
    (turn.sqrt(), shift.sqrt())
}

/// Sixty noisy problems and the seven methods of OpenCV 4.12: in units of the stated covariance (6 is what it promises) none is as near to
/// the truth. Turn and place alone differ by chance from problem to problem, so there a method may be ahead by 5 %: over 1000 problems we have
/// 0.147° and 2.67 mm, the best of theirs 0.154° and 2.79 mm. How the table was made: docs/math/check/hand_eye.py.
#[test]
fn no_method_of_opencv_is_better() {
    let rows = table_rows();
    let of = |name: &str, number: usize| -> Vec<Pose> {
        rows.iter().filter(|r| r.0 == name && r.1 == number).map(|r| r.2).collect()
    };
    let all = |name: &str| -> Vec<Pose> { rows.iter().filter(|r| r.0 == name).map(|r| r.2).collect() };
    let isotropic = |rad: f64, m: f64| {
        Matrix6::from_diagonal(&Vector6::new(rad, rad, rad, m, m, m).map(|sigma| sigma * sigma))
    };
    let solve = |number: usize| {
        let view = |(base_from_gripper, cam_from_target): (Pose, Pose)| HandEyeView {
            base_from_gripper,
            gripper_covariance: Some(isotropic(5e-4, 5e-4)),
            written: None,
            candidates: vec![Candidate {
                cam_from_target,
                covariance: isotropic(2e-3, 1.5e-3),
                delta_chi2: 0.0,
            }],
            seen: &[],
        };
        let views: Vec<HandEyeView> =
            of("hand", number).into_iter().zip(of("seen", number)).map(view).collect();
        solve_hand_eye(&views, &HandEyeConfig::default()).unwrap()
    };
    let truth = all("truth_x");
    assert_eq!(truth.len(), 60);
    let found: Vec<HandEye> = (0..truth.len()).map(solve).collect();
    let normalised = |poses: &[Pose]| {
        let one = |i: usize| squared(&(poses[i] * truth[i].inverse()).log(), &found[i].carrier_covariance);
        (0..truth.len()).map(one).sum::<f64>() / truth.len() as f64
    };
    let ours: Vec<Pose> = found.iter().map(|f| f.cam_from_carrier).collect();
    let (own, own_off) = (normalised(&ours), rms_off(&ours, &truth));
    println!("ours: {own:.2}, {:.4}° {:.3} mm", own_off.0.to_degrees(), 1e3 * own_off.1);
    for method in ["Tsai", "Park", "Horaud", "Andreff", "Daniilidis", "Shah", "Li"] {
        let theirs = all(method);
        let (other, off) = (normalised(&theirs), rms_off(&theirs, &truth));
        println!("{method}: {other:.2}, {:.4}° {:.3} mm", off.0.to_degrees(), 1e3 * off.1);
        assert!(own < other, "{method}: {other}, ours {own}");
        assert!(own_off.0 < 1.05 * off.0 && own_off.1 < 1.05 * off.1, "{method} {own_off:?} {off:?}");
    }
    // 6 ± 0.45 for 60 problems.
    assert!((4.6..7.4).contains(&own), "{own}");
}
