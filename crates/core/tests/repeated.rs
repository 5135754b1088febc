//! Places of the target that are seen more than once, and places that lie on one line of sight: observations like any others.

use crate::common::{Rng, views};
use nalgebra::Vector2;
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::{Correspondence, Error, Pixel, Point};

const SIGMA_PX: f64 = 0.3;

fn solve(seen: &[Correspondence]) -> Result<PoseEstimate, Error> {
    locate(seen, &views::camera(), &Config::default())
}

fn noisy(points: &[Point], rng: &mut Rng) -> Vec<Correspondence> {
    let exact = views::seen_from(&views::oblique(), points, SIGMA_PX);
    exact
        .iter()
        .map(|c| at(c, c.pixel + Vector2::new(rng.normal(), rng.normal()) * SIGMA_PX, SIGMA_PX))
        .collect()
}

fn at(c: &Correspondence, pixel: Pixel, sigma_px: f64) -> Correspondence {
    Correspondence::new(&views::camera(), c.x_in_target, pixel, sigma_px).expect("in the field")
}

/// Two pixels of one place are worth their mean at a standard deviation smaller by √2: the sum of squares about it is that of the two less
/// half the square of their difference, whatever the pose.
#[test]
fn two_pixels_of_a_place_are_worth_their_mean() {
    let mut rng = Rng::new(7);
    for (name, points) in views::all() {
        for again in [1, 2, points.len()] {
            let seen = noisy(&points, &mut rng);
            let (mut all, mut means, mut apart) = (seen.clone(), seen.clone(), 0.0);
            for (i, second) in noisy(&points, &mut rng).into_iter().enumerate().take(again) {
                let mean = (seen[i].pixel + second.pixel) * 0.5;
                means[i] = at(&seen[i], mean, SIGMA_PX / 2f64.sqrt());
                apart += 0.5 * (seen[i].pixel - second.pixel).norm_squared() / (SIGMA_PX * SIGMA_PX);
                all.insert(2 * i, second); // Beside its duplicate.
            }
            let (a, b) = (solve(&all).expect("a pose"), solve(&means).expect("a pose"));
            let what = format!("{name}, {again} again");
            assert_eq!(a.n_alternatives(), b.n_alternatives(), "{what}");
            assert_eq!(a.degrees_of_freedom, b.degrees_of_freedom + 2 * again, "{what}");
            assert!(
                (a.chi2 - b.chi2 - apart).abs() < 1e-6 * (1.0 + a.chi2),
                "{what}: {} {} {apart}",
                a.chi2,
                b.chi2
            );
            let off = (a.cam_from_target * b.cam_from_target.inverse()).log();
            let largest = b.covariance.diagonal().max().sqrt();
            assert!(off.norm() < 1e-4 * largest, "{what}: {off} of {largest}");
            assert!((a.covariance - b.covariance).amax() < 1e-3 * b.covariance.amax(), "{what}");
            assert!(
                (a.probability - b.probability).abs() < 1e-3,
                "{what}: {} {}",
                a.probability,
                b.probability
            );
        }
    }
}

/// Whatever the number of rows: 33 and more were accepted before, 32 and fewer refused.
#[test]
fn many_rows_of_few_places_are_answered() {
    let mut rng = Rng::new(8);
    for (name, points) in views::all() {
        for times in [2, 5, 20] {
            let seen: Vec<Correspondence> = (0..times).flat_map(|_| noisy(&points, &mut rng)).collect();
            let e = solve(&seen).unwrap_or_else(|reason| panic!("{name} {times} times: {reason}"));
            assert_eq!(
                (e.consistency, e.n_points),
                (Consistency::Consistent, points.len() * times),
                "{name}"
            );
            let truth = views::oblique();
            let nees = |h: resight_core::locate::choose::Hypothesis| {
                let off = (truth * h.minimum.cam_from_target.inverse()).log();
                let information = h.minimum.covariance.try_inverse().expect("a covariance");
                (off.transpose() * information * off)[(0, 0)]
            };
            let least = e.minima().filter(|h| h.is_alternative).map(nees).fold(f64::INFINITY, f64::min);
            assert!(least < 27.9, "{name} {times} times: {least}"); // χ² of 6, one in 10⁴.
        }
    }
}

/// A place behind another, exactly on its line of sight.
#[test]
fn two_places_on_one_line_of_sight_are_answered() {
    let truth = views::oblique();
    for (name, points) in views::all().into_iter().skip(1) {
        let centre = truth.origin();
        for (near, far) in [(0, 1), (1, 3), (3, 2)] {
            let mut points = points.clone();
            points[far] = points[near] + (points[near] - centre) * 0.2;
            let mut seen = views::seen_from(&truth, &points, SIGMA_PX);
            (seen[far].pixel, seen[far].bearing) = (seen[near].pixel, seen[near].bearing);
            let e = solve(&seen).unwrap_or_else(|reason| panic!("{name} {near} {far}: {reason}"));
            let off = |h: resight_core::locate::choose::Hypothesis| {
                (truth * h.minimum.cam_from_target.inverse()).log().norm()
            };
            let nearest = e.minima().filter(|h| h.is_alternative).map(off).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-5, "{name} {near} {far}: {nearest}");
        }
    }
}
