//! Quadruples of real corners, three on a line and one off it, against an independent four-point solver.
//!
//! Its answers `p4` (chosen) and `p4b` (the other local minimum) ended where its optimiser stopped, up to 10⁻³ from the
//! minimum on flat ridges. So each is first followed to the minimum it belongs to; where it was there already, the answers
//! must agree as they stand.

use crate::real_support::*;
use crate::recorded::recorded;
use nalgebra::Vector3;
use resight::core::correspondence::Correspondence;
use resight::core::locate::choose::{AMBIGUITY_GATE_CHI2, Hypothesis};
use resight::core::locate::refine::{refine, residual_px};
use resight::core::locate::{Config, Method, locate};
use resight::core::{Camera, Pixel, Pose};
use std::collections::HashSet;

/// Standard deviation in normalised coordinates: 0.2 px of these cameras. Equal for all points, so it moves no minimum.
const SIGMA: f64 = 3e-4;
/// So small a sigma makes the refinement go on to rounding.
const FINE_SIGMA: f64 = 1e-9;
/// The bar, radians and parts of the distance.
const SAME: f64 = 1e-6;
/// A reference that moves less than this was at its minimum.
const SETTLED: f64 = 1e-7;

fn quadruple(row: &Row, sigma: f64) -> Vec<Correspondence> {
    let camera = Camera::normalized();
    let one = |i: u32| {
        let value = |name: &str| number(row, &format!("{name}{i}"));
        let x = Vector3::new(value("X"), value("Y"), value("Z"));
        Correspondence::new(&camera, x, Pixel::new(value("xn"), value("yn")), sigma).unwrap()
    };
    (1..=4).map(one).collect()
}

/// Radians or parts of the distance between two poses, whichever is more.
fn gap(a: &Pose, b: &Pose) -> f64 {
    a.angle_to_rad(b).max((a.translation - b.translation).norm() / b.translation.norm())
}

/// Followed to its minimum.
fn polished(pose: &Pose, fine: &[Correspondence]) -> Pose {
    let step = |p: Pose| refine(&p, fine, &Camera::normalized()).map_or(p, |m| m.cam_from_target);
    (0..30).fold(*pose, |p, _| step(p))
}

fn chi2(pose: &Pose, seen: &[Correspondence]) -> f64 {
    let camera = Camera::normalized();
    let whitened = |c: &Correspondence| {
        residual_px(pose, c, &camera).map_or(f64::INFINITY, |e| e.norm_squared() / (SIGMA * SIGMA))
    };
    seen.iter().map(whitened).sum()
}

#[derive(Debug, Default)]
struct Tally {
    n: usize,
    /// Equal to p4 or p4b as they stand.
    as_it_stands: usize,
    /// The reference was at its minimum; and not equal all the same.
    settled: usize,
    settled_apart: usize,
    /// Equal once the reference is at its minimum.
    same: usize,
    /// Lower than both of the reference's minima, or higher than one.
    lower: usize,
    higher: usize,
    /// p4 is within the gate and not among our answers.
    unreturned: usize,
    errors_deg: Vec<f64>,
}

impl Tally {
    fn add(&mut self, row: &Row) {
        let (seen, fine) = (quadruple(row, SIGMA), quadruple(row, FINE_SIGMA));
        let estimate = locate(&seen, &Camera::normalized(), &Config::default()).unwrap();
        assert_eq!(estimate.method, Method::LinePlusOne);
        // The more probable pose leads; what is compared is the lowest minimum.
        let by_chi2 = |a: &Hypothesis, b: &Hypothesis| a.minimum.chi2.total_cmp(&b.minimum.chi2);
        let best = estimate.minima().min_by(by_chi2).unwrap().minimum;
        let ours = &best.cam_from_target;
        let reference: Vec<Pose> = ["p4_", "p4b_"].iter().filter_map(|name| pose_of(row, name)).collect();
        let minima: Vec<Pose> = reference.iter().map(|p| polished(p, &fine)).collect();
        let nearest =
            |poses: &[Pose], p: &Pose| poses.iter().map(|q| gap(p, q)).fold(f64::INFINITY, f64::min);
        let lowest = minima.iter().map(|p| chi2(p, &seen)).fold(f64::INFINITY, f64::min);
        let as_it_stands = nearest(&reference, ours) < SAME;
        let settled = reference.iter().zip(&minima).all(|(p, q)| gap(p, q) < SETTLED);
        let higher = lowest + SAME < best.chi2;
        let returned: Vec<Pose> = answers(&estimate).iter().map(|p| polished(p, &fine)).collect();
        let returned = nearest(&returned, &minima[0]) < SAME;
        self.n += 1;
        self.as_it_stands += usize::from(as_it_stands);
        self.settled += usize::from(settled);
        let lower = best.chi2 + SAME < lowest;
        self.settled_apart += usize::from(settled && !as_it_stands && !lower);
        self.same += usize::from(nearest(&minima, &polished(ours, &fine)) < SAME);
        self.lower += usize::from(lower);
        self.higher += usize::from(higher);
        let within_gate = chi2(&minima[0], &seen) < best.chi2 + AMBIGUITY_GATE_CHI2;
        self.unreturned += usize::from(within_gate && !returned);
        self.errors_deg.push(apart(ours, &pose_of(row, "ref_").unwrap()).0);
    }

    /// The answer is the reference's minimum, or a lower one that it did not find; never a higher one.
    fn check(&self, set: &str, n: usize, lower_allowed: usize, median_deg: f64) {
        let median_seen = median(self.errors_deg.clone());
        println!(
            "four points, {set}: {} rows; equal to 1e-6 as it stands {}, {} of {} settled rows apart; at the minimum {}; lower \
             {}, higher {}; p4 within the gate but not returned {}; median error {median_seen:.4}° (bar {median_deg})",
            self.n,
            self.as_it_stands,
            self.settled_apart,
            self.settled,
            self.same,
            self.lower,
            self.higher,
            self.unreturned
        );
        assert_eq!(self.n, n);
        assert_eq!((self.higher, self.settled_apart), (0, 0));
        assert_eq!(self.same + self.lower, n);
        assert!(self.lower <= lower_allowed && self.unreturned <= lower_allowed, "{}", self.lower);
        assert!(median_seen <= median_deg, "{median_seen}");
    }
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn chessboard_quadruples_have_the_reference_minimum() {
    let folder = recorded("opencv_stereo_chessboard");
    let mut tally = Tally::default();
    table(&folder.join("four_point.csv")).iter().for_each(|row| tally.add(row));
    tally.check("chessboard", 104, 0, 0.42);
}

#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn aprilgrid_quadruples_have_the_reference_minimum() {
    let folder = recorded("aprilgrid_tumvi_euroc");
    let mut tally = Tally::default();
    table(&folder.join("four_point.csv")).iter().for_each(|row| tally.add(row));
    tally.check("aprilgrid", 44, 0, 0.24);
}

/// Rows whose reference pose (all corners of one view) is on the wrong branch are left out: it is more than 10° from the
/// bundle adjustment there.
#[test]
#[cfg_attr(not(recordings), ignore = "needs recordings: RESIGHT_DATA=FOLDER ./test.sh")]
fn charuco_quadruples_have_the_reference_minimum() {
    let folder = recorded("caliscope_4cam_charuco");
    let frames = table(&folder.join("frame_poses.csv"));
    let wrong = frames.iter().filter(|row| 10.0 < number(row, "pnp_vs_ba_rot_deg"));
    let wrong: HashSet<(String, String)> =
        wrong.map(|row| (row["sync_index"].clone(), format!("cam{}", row["cam"]))).collect();
    let mut tally = Tally::default();
    let rows = table(&folder.join("four_point.csv"));
    let kept = rows.iter().filter(|row| !wrong.contains(&(row["view"].clone(), row["camera"].clone())));
    kept.for_each(|row| tally.add(row));
    println!("four points, charuco: {} of {} rows have a reference on the right branch", tally.n, rows.len());
    let n = tally.n;
    assert!(500 < n);
    tally.check("charuco", n, n / 50, 0.95);
}
