//! Four real robots: halves of a session agree within their covariances, right files are called right, and no wrong file gives a wrong answer that is
//! called right, whatever noise of the pixels is stated (all figures: RESIGHT_RUNS=1). Needs the folder named by RESIGHT_DATA.
//!
//! What it leaves out: errors that the right files have themselves.

use crate::common::Rng;
use crate::common::sessions::solved;
use crate::recorded::recorded;
use nalgebra::{Vector2, Vector3};
use resight_core::camera::BrownConrady;
use resight_core::multiview::hand_eye::{HandEye, Mounting};
use resight_core::{Camera, CameraMatrix, Correspondence, Error, Lens, Matrix6, Point, Pose, Vector6};
use std::collections::BTreeMap;
use std::path::Path;

/// Smaller differences are irrelevant.
const SMALL_RAD: f64 = 0.1 * std::f64::consts::PI / 180.0;
const SMALL_M: f64 = 1e-3;

#[derive(Clone)]
struct Session {
    camera: Camera,
    mounting: Mounting,
    hands: Vec<Pose>,
    seen: Vec<Vec<(Point, Vector2<f64>)>>,
}

fn camera(matrix: CameraMatrix, distortion: &[f64]) -> Camera {
    let lens = BrownConrady::new(matrix, distortion).expect("a lens");
    Camera { lens: Lens::BrownConrady(lens), size: None }
}

fn sessions() -> Vec<(&'static str, Session)> {
    let root = recorded("hand_eye_real");
    let published = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 640.0, cy_px: 480.0 };
    let fitted = CameraMatrix {
        fx_px: 613.322_435_236,
        fy_px: 611.472_645_871,
        cx_px: 317.107_889_295,
        cy_px: 264.053_783_080,
    };
    let of_jones = [0.210_489_094_6, -0.651_841_604_1, 0.002_126_050_349, -0.004_886_249_022, 0.0];
    let (of_board, of_tag) = (camera(published, &[0.0; 5]), camera(fitted, &of_jones));
    let (eye, base) = (Mounting::CameraOnGripper, Mounting::TargetOnGripper);
    [
        ("aubo_i10", &of_board, eye),
        ("aubo_i5", &of_board, eye),
        ("camodocal", &of_board, base),
        ("jones", &of_tag, eye),
    ]
    .map(|(name, camera, mounting)| (name, read(&root.join(name), camera, mounting)))
    .into()
}

fn read(folder: &Path, camera: &Camera, mounting: Mounting) -> Session {
    let rows = |name: &str| -> Vec<(Vec<String>, Vec<f64>)> {
        let text = std::fs::read_to_string(folder.join(name)).expect("a file");
        let row = |line: &str| {
            let cells: Vec<String> = line.split(',').map(|cell| cell.trim().to_owned()).collect();
            let numbers = cells.iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect();
            (cells, numbers)
        };
        text.lines().skip(1).map(row).collect()
    };
    let mut by_view: BTreeMap<String, Vec<(Point, Vector2<f64>)>> = BTreeMap::new();
    for (cells, x) in rows("det.csv") {
        let points = by_view.entry(cells[1].clone()).or_default();
        points.push((Point::new(x[3], x[4], x[5]), Vector2::new(x[6], x[7])));
    }
    let (mut hands, mut seen) = (Vec::new(), Vec::new());
    for (cells, x) in rows("motions.csv") {
        if let Some(points) = by_view.remove(&cells[0]) {
            let position = Vector3::new(x[5], x[6], x[7]);
            hands.push(Pose::from_quaternion_wxyz([x[1], x[2], x[3], x[4]], position));
            seen.push(points);
        }
    }
    Session { camera: camera.clone(), mounting, hands, seen }
}

impl Session {
    fn solved(&self, sigma_px: f64) -> Result<HandEye, Error> {
        let one =
            |(x, pixel): &(Point, Vector2<f64>)| Correspondence::new(&self.camera, *x, *pixel, sigma_px).ok();
        let seen: Vec<Vec<Correspondence>> =
            self.seen.iter().map(|view| view.iter().filter_map(one).collect()).collect();
        solved(&self.hands, &seen, &self.camera, self.mounting)
    }

    fn of(&self, is_in: impl Fn(usize) -> bool) -> Session {
        let views = (0..self.hands.len()).filter(|view| is_in(*view));
        let (hands, seen) = views.map(|view| (self.hands[view], self.seen[view].clone())).unzip();
        Session { hands, seen, ..self.clone() }
    }

    fn with_lens(&self, change: impl Fn(&str, f64) -> f64) -> Session {
        let values: Vec<f64> = self.camera.parameters().iter().map(|(name, x)| change(name, *x)).collect();
        Session { camera: self.camera.with_parameters(&values).expect("a lens"), ..self.clone() }
    }

    fn with_target(&self, size: f64) -> Session {
        let mut changed = self.clone();
        changed.seen.iter_mut().flatten().for_each(|(x, _)| *x *= size);
        changed
    }

    fn with_hands(&self, hand: impl Fn(usize) -> Pose) -> Session {
        Session { hands: (0..self.hands.len()).map(hand).collect(), ..self.clone() }
    }

    /// Wrong files of the lens and of the target.
    fn faults(&self) -> Vec<(String, Session)> {
        let is_focal = |name: &str| name.starts_with('f');
        let mut all: Vec<(String, Session)> = Vec::new();
        for factor in [1.1, 0.9, 1.05, 0.95, 1.03, 0.97] {
            let scaled = self.with_lens(|name, x| if is_focal(name) { factor * x } else { x });
            all.push((format!("focal length × {factor}"), scaled));
        }
        for (axis, factor) in [("fx_px", 1.05), ("fy_px", 0.95)] {
            let scaled = self.with_lens(|name, x| if name == axis { factor * x } else { x });
            all.push((format!("{axis} × {factor}"), scaled));
        }
        let far_px = 0.055 * self.camera.matrix().expect("a camera matrix").fx_px / 2f64.sqrt();
        for [right, down] in [[40.0, 0.0], [-40.0, 0.0], [0.0, 40.0], [far_px, far_px]] {
            let moved = self.with_lens(|name, x| match name {
                "cx_px" => x + right,
                "cy_px" => x + down,
                _ => x,
            });
            all.push((format!("centre + {right:.0} {down:.0} px"), moved));
        }
        for k1 in [-0.2, 0.2] {
            let other = self.with_lens(|name, x| if name == "k1" { x + k1 } else { x });
            all.push((format!("k1 + {k1}"), other));
        }
        for size in [1.1, 0.9, 1.03, 0.97] {
            all.push((format!("target × {size}"), self.with_target(size)));
        }
        all
    }

    /// Gripper poses that are wrong, and units: the noise of the pixels does not matter there.
    fn gross_faults(&self) -> Vec<(String, Session)> {
        let n = self.hands.len();
        let hand = |view: usize| self.hands[view];
        let reordered = |view: usize| {
            let [w, x, y, z] = hand(view).quaternion_wxyz();
            Pose::from_quaternion_wxyz([x, y, z, w], hand(view).translation)
        };
        let millimetres = |view: usize| Pose::new(hand(view).rotation, hand(view).translation * 1e3);
        let keeps = |name: &str| name.starts_with('f') || name == "cx_px" || name == "cy_px";
        vec![
            ("rows out of step".into(), self.with_hands(|view| hand((view + 1) % n))),
            ("inverted".into(), self.with_hands(|view| hand(view).inverse())),
            ("quaternion".into(), self.with_hands(reordered)),
            ("millimetres".into(), self.with_hands(millimetres)),
            ("target × 1000".into(), self.with_target(1e3)),
            ("half the size".into(), self.with_lens(|name, x| if keeps(name) { 0.5 * x } else { x })),
        ]
    }
}

fn apart(a: &HandEye, b: &HandEye) -> Vector6 {
    (a.cam_from_carrier * b.cam_from_carrier.inverse()).log()
}

/// Squared difference over its covariance, 6 expected.
fn nees(a: &HandEye, b: &HandEye) -> f64 {
    let covariance: Matrix6 = a.carrier_covariance + b.carrier_covariance;
    let off = apart(a, b);
    off.dot(&covariance.cholesky().expect("a covariance").solve(&off))
}

/// By how much the camera lies off, in the standard deviations of both answers: the right file's own has doubts too, as of a target that the robot
/// measures 2.5 % smaller. 0 where the difference is nobody's concern.
fn off(found: &HandEye, right: &HandEye) -> f64 {
    let off = apart(found, right);
    if off.fixed_rows::<3>(0).norm() < SMALL_RAD && off.fixed_rows::<3>(3).norm() < SMALL_M {
        return 0.0;
    }
    let variance = |i: usize| found.carrier_covariance[(i, i)] + right.carrier_covariance[(i, i)];
    (0..6).map(|i| off[i].abs() / variance(i).sqrt().max(1e-12)).fold(0.0, f64::max)
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn an_answer_that_is_wrong_is_not_called_right() {
    // The others give what these give: they are for the figures of docs/reliability.md.
    let sigmas_px: &[f64] =
        if std::env::var_os("RESIGHT_RUNS").is_some() { &[0.2, 0.5, 1.0, 2.0] } else { &[0.2, 2.0] };
    let (mut n, mut n_ok, mut n_right) = (0, 0, 0);
    let (mut alarms, mut silent) = (Vec::new(), Vec::new());
    for (name, session) in sessions() {
        for &sigma_px in sigmas_px {
            let right = session.solved(sigma_px).expect("an answer");
            n_right += 1;
            if right.is_inconsistent {
                alarms.push(format!("{name} {sigma_px} px: {:?}", right.causes));
            }
            let gross = if sigma_px == 2.0 { session.gross_faults() } else { Vec::new() };
            for (fault, wrong) in session.faults().into_iter().chain(gross) {
                n += 1;
                let found = wrong.solved(sigma_px);
                let Ok(found) = found else { continue };
                if found.is_inconsistent {
                    continue;
                }
                n_ok += 1;
                let off = off(&found, &right);
                let line = format!("{name} {sigma_px} px, {fault}: {off:.1} σ");
                println!("{line}");
                if 3.0 < off {
                    silent.push(line);
                }
            }
        }
    }
    println!(
        "of {n} faults {n_ok} are ok, {} of them wrong; of {n_right} right files {} are not",
        silent.len(),
        alarms.len()
    );
    // With 2 px stated more of the wrong points of one session stay in, and its lens is blamed.
    assert!(alarms.len() <= 1 && silent.is_empty(), "{alarms:#?} {silent:#?}");
}

/// Halves of twelve to twenty-one views each. What neighbouring views share makes halves by time differ more than interleaved ones.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn halves_agree() {
    let (mut by_time, mut interleaved, mut refused, mut n_halves) = (0.0, 0.0, 0, 0);
    for (name, session) in sessions() {
        let n = session.hands.len();
        let mut halves = |is_first: &dyn Fn(usize) -> bool| {
            let [a, b] = [true, false].map(|first| session.of(|view| is_first(view) == first).solved(0.5));
            let (a, b) = (a.expect("an answer"), b.expect("an answer"));
            n_halves += 2;
            refused += usize::from(a.is_inconsistent) + usize::from(b.is_inconsistent);
            nees(&a, &b)
        };
        let [time, between] = [halves(&|view| view < n / 2), halves(&|view| view % 2 == 0)];
        let mut rng = Rng::new(5);
        let mut random = || {
            let mut order: Vec<usize> = (0..n).collect();
            (1..n).rev().for_each(|i| order.swap(i, rng.index(i + 1)));
            let first: Vec<usize> = order[..n / 2].to_vec();
            halves(&|view| first.contains(&view))
        };
        let random = (0..20).map(|_| random()).sum::<f64>() / 20.0;
        println!("{name}: NEES of random halves {random:.1}, by time {time:.1}, interleaved {between:.1}");
        assert!((4.0..9.0).contains(&random), "{name}: {random}");
        by_time += time / 4.0;
        interleaved += between / 4.0;
    }
    println!("by time {by_time:.1}, interleaved {interleaved:.1}; {refused} of {n_halves} are not ok");
    assert!((4.0..9.0).contains(&by_time) && (4.0..9.0).contains(&interleaved));
    assert!(20 * refused <= n_halves, "{refused} of {n_halves}");
}
