//! What an uncertain lens does to a change of pose: reference and readings see through the same lens, so nothing of it moves, and a motion is
//! found, though its size is off with the lens.
//!
//! A reading holds the pixels' covariance alone, for the lens's share is common to all; its verdict is the one that the lens's covariance allows,
//! for through a lens taken as exact most readings of a lens by its data sheet contradict themselves and say nothing of motion.

use crate::common::{Rng, views};
use nalgebra::{Matrix6, Vector2, Vector6};
use resight_core::advise::expect::{View, expect};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, locate};
use resight_core::target::KnownPoint;
use resight_core::temporal::monitor::learn::{LearnConfig, learn};
use resight_core::temporal::monitor::{Drift, Monitor, MonitorConfig, Reading, Watch};
use resight_core::{Camera, Correspondence, Point, Pose};

const SIGMA_PX: f64 = 0.1;
/// Two parts in a hundred of the focal length, and six pixels of the principal point: a lens by its data sheet.
const LENS_SIGMA_PX: [f64; 2] = [16.0, 6.0];

/// Images of a tag through a lens that is not the one known.
struct Stream {
    took: Camera,
    rng: Rng,
    second: u32,
}

fn cam_from_tag() -> Pose {
    Pose::exp(&Vector6::new(0.35, -0.3, 0.2, -0.1, 0.05, 1.3))
}

impl Stream {
    fn new(seed: u64) -> Self {
        let mut rng = Rng::new(seed);
        let f = LENS_SIGMA_PX[0] * rng.normal();
        let by = [f, f, LENS_SIGMA_PX[1] * rng.normal(), LENS_SIGMA_PX[1] * rng.normal()];
        let known = views::camera();
        let values: Vec<f64> = known.parameters().iter().zip(by).map(|(p, by)| p.1 + by).collect();
        Stream { took: known.with_parameters(&values).unwrap(), rng, second: 0 }
    }

    /// The camera moved in its own old frame; located through the lens as it is known.
    fn next(&mut self, moved: &Vector6<f64>) -> Reading {
        self.second += 1;
        let pose = Pose::exp(moved).inverse() * cam_from_tag();
        let corners = [[-0.15, -0.15], [0.15, -0.15], [0.15, 0.15], [-0.15, 0.15]];
        let seen = corners.map(|[x, y]| {
            let x = Point::new(x, y, 0.0);
            let noise = Vector2::new(self.rng.normal(), self.rng.normal()) * SIGMA_PX;
            let pixel = self.took.project(&(pose * x)).unwrap() + noise;
            Correspondence::new(&views::camera(), x, pixel, SIGMA_PX).unwrap()
        });
        let camera = views::camera();
        let [f, c] = LENS_SIGMA_PX.map(|sigma| sigma * sigma);
        let lens = [f, f, 0.0, 0.0, f, f, 0.0, 0.0, 0.0, 0.0, c, 0.0, 0.0, 0.0, 0.0, c];
        let e = locate(&seen, &camera, &Config { intrinsics_covariance: Some(&lens), ..Config::default() })
            .unwrap();
        let points = seen.map(|c| KnownPoint { position: c.x_in_target, sigma_m: 0.0 });
        let exact = View {
            camera: &camera,
            cam_from_target: e.cam_from_target,
            points: &points,
            sigma_px: SIGMA_PX,
            intrinsics_covariance: None,
        };
        Reading {
            t_s: f64::from(self.second),
            a_from_b: e.cam_from_target,
            covariance: expect(&exact).unwrap().covariance,
            is_consistent: e.consistency == Consistency::Consistent,
        }
    }

    fn learned(&mut self) -> Monitor {
        let known = LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
        let readings: Vec<Reading> = (0..100).map(|_| self.next(&Vector6::zeros())).collect();
        let reference = learn(&readings, &known).expect("a reference");
        Monitor::new(&reference, &MonitorConfig::default(), f64::from(self.second)).expect("a monitor")
    }
}

/// Half an hour without motion through each of six lenses, then a pan of 0.3° with 4 mm: no alarm before, one within seconds. The change that is
/// found is off by up to 14 % of its rotation and 23 % of its translation, several times the lens's 2 %, and the drift's own ± does not hold it.
#[test]
fn an_uncertain_lens_raises_no_alarm_and_hides_no_motion() {
    let true_motion = Vector6::new(0.0, 0.3f64.to_radians(), 0.0, 4e-3, 0.0, 0.0);
    let (mut largest, mut least_off_sigmas, mut slowest) = (0.0f64, f64::INFINITY, 0);
    for seed in 0..6 {
        let mut stream = Stream::new(0x1e_0000 + seed);
        let mut monitor = stream.learned();
        let reference = monitor.reference();
        let off = (reference.a_from_b * cam_from_tag().inverse()).log();
        let nees = off.dot(&reference.noise.reference.cholesky().expect("a covariance").solve(&off));
        least_off_sigmas = least_off_sigmas.min(nees.sqrt());
        for _ in 0..1800 {
            let said = monitor.push(&stream.next(&Vector6::zeros()));
            assert!(matches!(said, Watch::Steady | Watch::Checking), "lens {seed}: {said:?}");
        }
        let (mut alarm, mut drift): (Option<u32>, Option<Drift>) = (None, None);
        for second in 0..300 {
            if let Watch::Drifted(found) = monitor.push(&stream.next(&true_motion)) {
                alarm = alarm.or(Some(second));
                drift = Some(found);
            }
        }
        slowest = slowest.max(alarm.unwrap_or_else(|| panic!("lens {seed}: no alarm")));
        let found = drift.expect("it does not come back").old_from_new;
        let part = |at: usize| {
            let of = |v: &Vector6<f64>| v.fixed_rows::<3>(at).into_owned();
            (of(&found) - of(&true_motion)).norm() / of(&true_motion).norm()
        };
        largest = largest.max(part(0));
        println!(
            "lens {seed}: alarm after {alarm:?} s, rotation off by {:.3}, position by {:.3}",
            part(0),
            part(3)
        );
    }
    println!(
        "least NEES^½ of a pose {least_off_sigmas:.1}, rotation off by {largest:.3} at most, alarm within {slowest} s"
    );
    assert!(slowest < 30 && largest < 0.2, "{slowest} s, {largest}");
    assert!(3.0 < least_off_sigmas, "{least_off_sigmas}");
}
