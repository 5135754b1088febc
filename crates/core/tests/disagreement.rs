//! Points of a target that contradict each other about a motion, and motions that are none of that.

use crate::common::Rng;
use nalgebra::Vector2;
use resight_core::camera::Pinhole;
use resight_core::temporal::disagreement::{Disagreement, Expected};
use resight_core::{Camera, CameraMatrix, Correspondence, Lens, Matrix6, Point, Pose, Vector6};

const SIGMA_PX: f64 = 0.2;

fn camera() -> Camera {
    let matrix = CameraMatrix { fx_px: 800.0, fy_px: 800.0, cx_px: 320.0, cy_px: 240.0 };
    Camera { lens: Lens::Pinhole(Pinhole::new(matrix).expect("a lens")), size: None }
}

fn home() -> Pose {
    Pose::exp(&Vector6::new(0.25, -0.45, 0.1, 0.12, -0.08, 1.2))
}

/// Returns the corners of a tag of 120 mm from a pose, each displaced by `fault`.
fn corners(pose: &Pose, seed: u64, fault: impl Fn(usize) -> Vector2<f64>) -> Vec<Correspondence> {
    let mut chance = Rng::new(seed);
    let corner = |(i, (x, y)): (usize, (f64, f64))| {
        let point = Point::new(0.06 * x, 0.06 * y, 0.0);
        let noise = Vector2::from_fn(|_, _| SIGMA_PX * chance.normal());
        let pixel = camera().project(&(*pose * point)).expect("in front") + noise + fault(i);
        Correspondence::new(&camera(), point, pixel, SIGMA_PX).expect("a point")
    };
    [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)].into_iter().enumerate().map(corner).collect()
}

fn says(seen: &[Correspondence]) -> bool {
    let estimate = resight_core::locate::locate(seen, &camera(), &Default::default()).expect("a pose");
    let known = Vector6::new(1e-8, 1e-8, 1e-8, 1e-9, 1e-9, 1e-9).map(|variance| 1.0 / variance);
    let information = Matrix6::from_diagonal(&known);
    let expected = Expected { lens: &camera(), cam_from_target: home(), information, noise: 1.0 };
    Disagreement::default().is_in(seen, &expected, &estimate.cam_from_target)
}

/// After a gap errors may have grown to 0.04° and 0.5 mm: a roll of 0.15° to 0.4° with that is a motion, one or two corners that are off
/// are still a fault.
#[test]
fn a_small_roll_after_a_gap_is_no_disagreement() {
    let sigma = Vector6::new(7e-4, 7e-4, 7e-4, 5e-4, 5e-4, 5e-4);
    let information = Matrix6::from_diagonal(&sigma.map(|s| 1.0 / (s * s)));
    let says = |seen: &[Correspondence]| {
        let estimate = resight_core::locate::locate(seen, &camera(), &Default::default()).expect("a pose");
        let expected = Expected { lens: &camera(), cam_from_target: home(), information, noise: 1.0 };
        Disagreement::default().is_in(seen, &expected, &estimate.cam_from_target)
    };
    let (mut false_ones, mut found, mut all) = (0, 0, 0);
    for seed in 0..100 {
        let mut chance = Rng::new(500 + seed);
        let error = sigma.map(|s| s * chance.normal());
        let roll = f64::to_radians(0.15 + 0.25 * (seed as f64 / 100.0));
        let now = Pose::exp(&(error + Vector6::ith(2, roll))) * home();
        false_ones += u32::from(says(&corners(&now, seed, |_| Vector2::zeros())));
        let here = Pose::exp(&error) * home();
        for pair in [[0, 1], [1, 2], [0, 2], [1, 1]] {
            let angle = 0.7 * f64::from(all);
            let off = 1.5 * Vector2::new(angle.cos(), angle.sin());
            let fault = |i: usize| if pair.contains(&i) { off } else { Vector2::zeros() };
            found += u32::from(says(&corners(&here, 3000 + seed, fault)));
            all += 1;
        }
    }
    println!("{false_ones} of 100 rolls are faults, {found} of {all} faults are found");
    assert!(false_ones <= 2 && 80 * all < 100 * found, "{false_ones}, {found} of {all}");
}

/// One or two corners off by a pixel and a third, in any direction and any pair: found in nearly all views, and in none where nothing is.
#[test]
fn corners_that_are_off_alone_are_found() {
    let (mut found, mut all, mut false_ones) = (0, 0, 0);
    for seed in 0..40 {
        false_ones += u32::from(says(&corners(&home(), seed, |_| Vector2::zeros())));
        for pair in [[0, 1], [1, 2], [2, 3], [3, 0], [0, 2], [1, 1]] {
            let angle = 0.7 * f64::from(all);
            let off = 1.3 * Vector2::new(angle.cos(), angle.sin());
            let fault = |i: usize| if pair.contains(&i) { off } else { Vector2::zeros() };
            found += u32::from(says(&corners(&home(), 1000 + seed, fault)));
            all += 1;
        }
    }
    println!("{found} of {all} found, {false_ones} of 40 falsely");
    assert!(90 * all < 100 * found && false_ones == 0, "{found} of {all}, {false_ones} falsely");
}

/// Turns about and shifts along each axis: a motion that one view shows never counts as a fault; one that is just visible may, in one of
/// its views, seldom enough not to be late by more than a view.
#[test]
fn a_motion_is_no_disagreement() {
    let (mut false_ones, mut all) = (0, 0);
    for seed in 0..20 {
        for (axis, least) in [(0, 5e-4), (1, 5e-4), (2, 5e-3), (3, 5e-4), (4, 5e-4), (5, 3e-3)] {
            for size in [1.0, 2.0, 5.0, 20.0, -1.5, -6.0] {
                let now = Pose::exp(&Vector6::ith(axis, size * least)).inverse() * home();
                let seen = corners(&now, 7000 + seed, |_| Vector2::zeros());
                let is_large = 5.0 < f64::abs(size);
                assert!(!(is_large && says(&seen)), "{seed}: {size} × {least} of {axis}");
                false_ones += u32::from(says(&seen));
                all += 1;
            }
        }
    }
    assert!(20 * false_ones < all, "{false_ones} of {all}");
}
