//! Views in which line-plus-one is weak: near its critical plane, and with the line seen end on. The answer may be poor; it must
//! say so. The tables of docs/math/line_plus_one.md are what this prints.

use crate::common::Rng;
use nalgebra::{Matrix3, Vector2};
use resight_core::camera::Pinhole;
use resight_core::locate::choose::{Ambiguity, Hypothesis};
use resight_core::locate::{Config, locate};
use resight_core::solve::line_plus_one::line_plus_one;
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Point, Pose};

const N: usize = 4000;
const SIGMA_PX: f64 = 0.3;
const GROSS_RAD: f64 = 0.2;

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 1000.0, fy_px: 1000.0, cx_px: 640.0, cy_px: 480.0 };
    Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None }
}

/// The line 1 m long, the fourth point 0.6 m off it, its foot at `foot`.
fn points(foot: f64) -> [Point; 4] {
    [[0.0, 0.0, 0.0], [0.5, 0.0, 0.0], [1.0, 0.0, 0.0], [foot, 0.6, 0.0]].map(Point::from)
}

/// The camera at `centre`, looking at the target with a random roll.
fn view(rng: &mut Rng, centre: Point) -> Pose {
    let z = (Point::new(0.5, 0.2, 0.0) - centre).normalize();
    let x = rng.unit_vector().cross(&z).normalize();
    let rotation = Matrix3::from_rows(&[x.transpose(), z.cross(&x).transpose(), z.transpose()]);
    Pose::new(rotation, -(rotation * centre))
}

#[derive(Default)]
struct Count {
    closed_form_wrong: usize,
    first_wrong: usize,
    ambiguous: usize,
    unique_and_wrong: usize,
    named: usize,
    length_sigma: f64,
}

impl Count {
    fn percent(&self) -> [f64; 5] {
        [self.closed_form_wrong, self.first_wrong, self.ambiguous, self.unique_and_wrong, self.named]
            .map(|n| 100.0 * n as f64 / N as f64)
    }
}

/// Views from random places, counted.
fn count(seed: u64, points: &[Point; 4], place: impl Fn(&mut Rng) -> Point) -> Count {
    let (camera, mut rng, mut count) = (camera(), Rng::new(seed), Count::default());
    for _ in 0..N {
        let centre = place(&mut rng);
        let truth = view(&mut rng, centre);
        let seen = points.map(|x| {
            let pixel = camera.project(&(truth * x)).expect("in front");
            let pixel = pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX;
            Correspondence::new(&camera, x, pixel, SIGMA_PX).expect("in the field")
        });
        let wrong = |pose: &Pose| GROSS_RAD < pose.angle_to_rad(&truth);
        let bearings = seen.map(|c| c.bearing);
        count.closed_form_wrong += usize::from(line_plus_one(&bearings, points).iter().all(wrong));
        count.length_sigma += bearings[0].cross(&bearings[2]).norm() * 1000.0 / SIGMA_PX / N as f64;
        let Ok(e) = locate(&seen, &camera, &Config::default()) else { continue };
        let unique = matches!(e.ambiguity, Ambiguity::Unique { .. });
        // By χ² alone: which of two poses is the more probable is a matter of all views, not of these.
        let by_chi2 = |a: &Hypothesis, b: &Hypothesis| a.minimum.chi2.total_cmp(&b.minimum.chi2);
        let lowest = e.minima().min_by(by_chi2).expect("a minimum").minimum;
        count.first_wrong += usize::from(wrong(&lowest.cam_from_target));
        count.ambiguous += usize::from(!unique);
        // Wrong against what it claims: a wide covariance is an honest answer.
        let error = e.cam_from_target.angle_to_rad(&truth);
        let sigma = e.covariance.fixed_view::<3, 3>(0, 0).trace().sqrt();
        count.unique_and_wrong += usize::from(unique && wrong(&e.cam_from_target) && 5.0 * sigma < error);
        count.named += usize::from(e.weakness.is_some());
    }
    count
}

#[test]
fn near_the_critical_plane_the_answer_says_so() {
    let target = points(0.4);
    println!("offset m | lowest pose wrong | ambiguous | unique and wrong | critical plane named, %");
    for offset in [0.0, 0.02, 0.05, 0.1, 0.2] {
        let c = count(61, &target, |rng| {
            let tilt = rng.uniform(0.5, 1.2);
            Point::new(0.4 + offset, 3.0 * tilt.sin(), -3.0 * tilt.cos())
        });
        let [_, first, ambiguous, unique_and_wrong, named] = c.percent();
        println!("{offset} | {first:.1} | {ambiguous:.1} | {unique_and_wrong:.2} | {named:.1}");
        // The gate lets Φ(−3) = 0.135 % pass at worst (refine.md eq. (16)): 5.4 of these, 13 with one chance in a thousand.
        assert!(unique_and_wrong <= 0.33, "{offset} m: {unique_and_wrong} %");
        if offset == 0.0 {
            assert!(99.0 < ambiguous && 99.0 < named, "{ambiguous} {named}");
        }
    }
}

#[test]
fn a_fourth_point_over_an_end_keeps_the_plane_away() {
    println!("foot | lowest pose wrong | ambiguous, %");
    for (foot, limit) in [(0.5, 60.0), (0.4, 10.0), (0.2, 0.1), (0.0, 0.1)] {
        let c = count(62, &points(foot), |rng| {
            let tilt = rng.uniform(0.5, 1.2);
            Point::new(0.5, 3.0 * tilt.sin(), -3.0 * tilt.cos())
        });
        let [_, first, ambiguous, ..] = c.percent();
        println!("{foot} | {first:.1} | {ambiguous:.1}");
        assert!(first <= limit, "foot {foot}: {first} % wrong");
    }
}

#[test]
fn a_line_seen_end_on_is_named() {
    let target = points(0.0);
    println!(
        "length σ | both candidates wrong | lowest pose wrong | ambiguous | unique and wrong | end on named, %"
    );
    for degrees in [0.5, 1.0, 2.0, 3.0, 5.0, 10.0] {
        let off_axis = f64::to_radians(degrees);
        let c = count(63, &target, |rng| {
            let turn = rng.uniform(0.0, std::f64::consts::TAU);
            let across = 3.0 * off_axis.sin();
            Point::new(0.5 + 3.0 * off_axis.cos(), across * turn.cos(), across * turn.sin())
        });
        let [closed, first, ambiguous, unique_and_wrong, named] = c.percent();
        println!(
            "{:.1} | {closed:.1} | {first:.1} | {ambiguous:.1} | {unique_and_wrong:.2} | {named:.1}",
            c.length_sigma
        );
        if c.length_sigma < 12.0 {
            assert!(99.0 < named, "{degrees}°: {named} %");
        }
    }
}
