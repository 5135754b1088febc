//! The size of a motion where errors of points stay as long as the camera does: simulated points of a board, each with an error of its own at
//! each place beside that of each image. Left out: what detectors make of images, resight-watch `film`.

use crate::common::Rng;
use nalgebra::Vector2;
use resight_core::camera::Pinhole;
use resight_core::locate::refine::residual_px;
use resight_core::locate::{Config, locate};
use resight_core::temporal::monitor::{
    Drift, Monitor, MonitorConfig, PointErrors, Reading, covariance_by_image, learn,
};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Matrix6, Point, Pose, Vector6};

/// Standard deviations of a point's coordinates, px: from image to image, and by the lens, which is the same at both places.
const SCATTER_PX: f64 = 0.02;
const LENS_PX: f64 = 0.16;
/// Detectors state a variance by a third too large, on the average.
const CAUTION: f64 = 1.15;
const LEARNED: usize = 50;
const BEFORE: usize = 100;

/// A board of twelve points 1.2 m away.
struct Room {
    camera: Camera,
    points: Vec<Point>,
    old: Pose,
    /// Standard deviation of the error of a place, px, and what the detector states of the image.
    place_px: f64,
    stated_px: f64,
}

impl Room {
    fn new(place_px: f64) -> Self {
        let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 320.0, cy_px: 240.0 };
        let camera = Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None };
        let at = |i: i32| Point::new(0.1 * f64::from(i % 4) - 0.15, 0.1 * f64::from(i / 4) - 0.1, 0.0);
        let old = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.05, -0.03, 1.2))
            * Pose::exp(&Vector6::new(0.3, -0.5, 0.2, 0.0, 0.0, 0.0));
        let stated_px = SCATTER_PX.hypot(place_px) * CAUTION;
        Room { camera, points: (0..12).map(at).collect(), old, place_px, stated_px }
    }

    /// Errors of all points.
    fn errors(&self, random: &mut Rng, sigma_px: f64) -> Vec<Vector2<f64>> {
        self.points.iter().map(|_| Vector2::from_fn(|_, _| sigma_px * random.normal())).collect()
    }

    fn seen(&self, cam_from_target: &Pose, errors: [&[Vector2<f64>]; 3]) -> Vec<Correspondence> {
        let sigma_px = self.stated_px.hypot(LENS_PX);
        let point = |(i, x): (usize, &Point)| {
            let pixel = self.camera.project(&(*cam_from_target * *x)).expect("in the image");
            let off = errors.iter().map(|errors| errors[i]).sum::<Vector2<f64>>();
            Correspondence::new(&self.camera, *x, pixel + off, sigma_px).expect("in the field")
        };
        self.points.iter().enumerate().map(point).collect()
    }

    /// The drift at the alarm and `after` readings later.
    fn watched(&self, old_from_new: &Vector6, after: usize, seed: u64) -> [Drift; 2] {
        let mut random = Rng::new(seed);
        let lens = self.errors(&mut random, LENS_PX);
        let places = [self.errors(&mut random, self.place_px), self.errors(&mut random, self.place_px)];
        let poses = [self.old, Pose::exp(old_from_new).inverse() * self.old];
        let (mut errors, mut learned, mut monitor) = (PointErrors::default(), Vec::new(), None);
        let mut found = None;
        for i in 0..LEARNED + BEFORE + after {
            let place = usize::from(LEARNED + BEFORE <= i);
            let own = self.errors(&mut random, SCATTER_PX);
            let seen = self.seen(&poses[place], [&lens, &places[place], &own]);
            let pose = locate(&seen, &self.camera, &Config::default()).expect("a pose");
            let (a_from_b, covariance) = (pose.cam_from_target, pose.covariance);
            let reading = Reading { t_s: i as f64, a_from_b, covariance, is_consistent: true };
            errors.push(seen.iter().zip(0..).map(|(c, name)| {
                let residual = residual_px(&a_from_b, c, &self.camera).expect("in the image");
                (name, residual / self.stated_px)
            }));
            if i < LEARNED {
                learned.push(reading);
                continue;
            }
            let monitor = monitor.get_or_insert_with(|| beginning(&learned));
            let of_image = vec![self.stated_px; seen.len()];
            let by_image = covariance_by_image(&a_from_b, &seen, &of_image, &self.camera).expect("a pose");
            monitor.stays(&(by_image * errors.staying(false)));
            monitor.push(&reading);
            if let (None, Some(drift)) = (found, monitor.drift()) {
                found = Some(drift);
                errors.moved();
            }
        }
        let end = monitor.and_then(|monitor| monitor.drift());
        [found.expect("an alarm"), end.expect("no way back")]
    }
}

fn beginning(learned: &[Reading]) -> Monitor {
    let config = learn::LearnConfig { bias: Matrix6::zeros(), bias_time_s: 60.0, diurnal: Matrix6::zeros() };
    let reference = learn::learn(learned, &config).expect("a reference");
    let began_s = LEARNED as f64;
    let mut monitor = Monitor::new(&reference, &MonitorConfig::default(), began_s).expect("a monitor");
    monitor.measure_noise(learned);
    monitor
}

fn nees(drift: &Drift, truth: &Vector6) -> f64 {
    let error = (Pose::exp(truth).inverse() * Pose::exp(&drift.old_from_new)).log();
    error.dot(&drift.covariance.cholesky().expect("a covariance").solve(&error))
}

/// Six on the average, at the alarm and long after it, whether a place's errors are half of an image's or twice as large; a rotation is named
/// as one.
#[test]
fn a_motion_is_known_no_better_than_its_places() {
    const RUNS: u64 = 16;
    let rotation = Vector6::new(0.0, f64::to_radians(0.3), 0.0, 0.0, 0.0, 0.0);
    for place_px in [0.01, 0.02, 0.04] {
        let room = Room::new(place_px);
        let drifts: Vec<[Drift; 2]> = (0..RUNS).map(|seed| room.watched(&rotation, 60, seed)).collect();
        for when in [0, 1] {
            let mean = drifts.iter().map(|drifts| nees(&drifts[when], &rotation)).sum::<f64>() / RUNS as f64;
            let pure = drifts.iter().filter(|drifts| drifts[when].pure_rotation().is_some()).count();
            println!("{place_px} px, {when}: NEES {mean:.2}, {pure} of {RUNS} named as rotations");
            assert!(4.0 < mean && mean < 9.0, "{place_px} px, {when}: {mean}");
            assert!(15 <= pure, "{place_px} px, {when}: {pure} of {RUNS} named as rotations");
        }
    }
}

/// A shift that its places do not explain is no rotation.
#[test]
fn a_shift_is_told_as_one() {
    let (room, shift) = (Room::new(0.02), Vector6::new(0.0, 0.0, 0.0, 0.02, 0.0, 0.0));
    for seed in 0..4 {
        let drifts = room.watched(&shift, 60, seed);
        assert!(drifts.iter().all(|drift| drift.pure_rotation().is_none()), "{seed}: {drifts:?}");
    }
}
