//! The fit's derivatives against differences, the nearest contact against a search.
//! Compiled under `#[cfg(test)]` alone, as identify.rs declares it; no product code.

use super::fit::{correlation, equations};
use super::outline::{Outline, Place};
use super::row::{Loss, Row};
use super::state::State;
use super::{Config, Touch};
use crate::estimate::{Mode, Status};
use nalgebra::{DVector, Matrix2, Matrix3, Vector2, Vector3};
use resight_core::statistics::SplitMix64;
use std::f64::consts::FRAC_PI_2;

/// SplitMix64.
struct Chance(SplitMix64);

impl Chance {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }
}

fn touch(x: Vector2<f64>, beta: f64, mode: Mode, chance: &mut Chance) -> Touch {
    let (along, across) = (chance.between(5e-4, 3e-3), chance.between(1e-4, 3e-4));
    let t = Vector2::new(-beta.sin(), beta.cos());
    let n = Vector2::new(beta.cos(), beta.sin());
    let v = Vector3::new(along * t.x, along * t.y, chance.between(-2e-3, 2e-3));
    let u = Vector3::new(across * n.x, across * n.y, chance.between(-2e-3, 2e-3));
    let covariance = v * v.transpose() + u * u.transpose() + Matrix3::from_diagonal_element(1e-9);
    let theta_rad = beta - FRAC_PI_2;
    Touch { sweep: 0, x_in_world: x, theta_rad, side: 1.0, mode, covariance, status: Status::Ok }
}

/// Contacts a few standard deviations about a circle of 30 mm.
fn rows(chance: &mut Chance, n: usize) -> Vec<Row> {
    let touches: Vec<Touch> = (0..n)
        .map(|k| {
            let beta = chance.between(-3.0, 0.5);
            let radius = 0.03 + chance.between(-5e-4, 5e-4);
            let x = Vector2::new(0.01, 0.16) + radius * Vector2::new(beta.cos(), beta.sin());
            let mode = if k % 5 == 0 { Mode::Tip } else { Mode::Mid };
            touch(x, beta + chance.between(-0.02, 0.02), mode, chance)
        })
        .collect();
    (0..n).map(|i| Row::new(i, &touches, &Config::default()).expect("a row")).collect()
}

fn states() -> Vec<State> {
    let centre = Vector2::new(0.0098, 0.1603);
    let corner = |angle: f64| centre + 0.031 * Vector2::new(f64::cos(angle), f64::sin(angle));
    vec![
        State::Circle { centre, radius: 0.0301 },
        State::Root { centre, root: Matrix2::new(0.0305, 0.0008, 0.0008, 0.0295) },
        State::Axes { centre, axes: [0.0307, 0.0296], angle: 0.4 },
        State::AxesOfRatio { centre, mean: 0.0302, angle: 1.1, ratio: 1.05 },
        State::Rectangle { centre, sides: [0.055, 0.061], angle: 0.3 },
        State::RectangleOfRatio { centre, mean: 0.058, angle: -0.2, ratio: 0.9 },
        State::Chain((0..7).map(|k| corner(0.2 + 0.9 * f64::from(k))).collect()),
        State::Chain(vec![centre, centre + Vector2::new(0.02, -0.01)]),
        State::Chain(vec![centre]),
    ]
}

/// The cost falls along the gradient: χ²' = −2 Jᵀ w r, the way along the outline taken out of J by eq. (6). Central differences err
/// by the step's square; where a contact changes its piece on the way the cost has a kink, so a step is short.
#[test]
fn gradient_matches_central_difference() {
    let rows = rows(&mut Chance(SplitMix64::new(1)), 60);
    for state in states() {
        for loss in [Loss::Leading, Loss::Final] {
            let at = equations(&rows, &state, loss).expect("an outline");
            for k in 0..state.n_parameters() {
                let moved = |step: f64| {
                    let by = DVector::from_fn(state.n_parameters(), |i, _| if i == k { step } else { 0.0 });
                    equations(&rows, &state.moved(&by).expect("a state"), loss).expect("an outline").chi2
                };
                let step = 1e-8;
                let difference = (moved(step) - moved(-step)) / (2.0 * step);
                let scale = 1e-4 * at.information[(k, k)].sqrt() * at.chi2.sqrt() + 1e-9 * at.chi2 / step;
                let error = (difference + 2.0 * at.gradient[k]).abs();
                assert!(error < scale, "{state:?} {loss:?} {k}: {difference} {}", -2.0 * at.gradient[k]);
            }
        }
    }
}

/// Nothing on the outline is nearer than the nearest contact; and what is named is on it.
#[test]
fn no_contact_of_the_outline_is_nearer() {
    let rows = rows(&mut Chance(SplitMix64::new(2)), 40);
    for state in states() {
        let outline = state.outline().expect("an outline");
        for row in rows.iter().filter(|row| !row.tip) {
            let found = outline.distance(row).e.norm_squared();
            let least = contacts(&outline).map(|(x, beta)| {
                let off = x - row.x;
                let turn = super::outline::nearest_revolution(beta - row.beta);
                (row.w * Vector3::new(off.x, off.y, turn)).norm_squared()
            });
            let least = least.fold(f64::INFINITY, f64::min);
            // The grid misses the minimum by its spacing; the search may not miss it at all.
            assert!(found <= least * (1.0 + 1e-9) + 1e-6, "{state:?}: {found} {least}");
        }
    }
}

/// Many contacts the outline allows.
fn contacts(outline: &Outline) -> Box<dyn Iterator<Item = (Vector2<f64>, f64)> + '_> {
    const N: usize = 4000;
    let at = |k: usize| -std::f64::consts::PI + std::f64::consts::TAU * k as f64 / N as f64;
    match outline {
        Outline::Smooth(smooth) => Box::new((0..N).map(move |k| {
            let n = Vector2::new(at(k).cos(), at(k).sin());
            (smooth.centre + smooth.root * smooth.root * n / (smooth.root * n).norm(), at(k))
        })),
        Outline::Corners(polygon) => {
            let corners = &polygon.corners;
            let m = corners.len();
            let turning = (0..N).map(move |k| {
                let n = Vector2::new(at(k).cos(), at(k).sin());
                let height = |c: &&Vector2<f64>| n.dot(c);
                let corner = corners.iter().max_by(|a, b| height(a).total_cmp(&height(b))).expect("a corner");
                (*corner, at(k))
            });
            let along = (0..m).flat_map(move |k| {
                let edge = corners[(k + 1) % m] - corners[k];
                let beta = (-edge.x).atan2(edge.y);
                (0..=N / 8).map(move |j| (corners[k] + edge * (8 * j) as f64 / N as f64, beta))
            });
            if m == 1 { Box::new(turning) } else { Box::new(turning.chain(along)) }
        }
    }
}

/// A tip contact touches only a face that looks at the whisker.
#[test]
fn a_tip_does_not_reach_the_far_face() {
    let state = State::Rectangle { centre: Vector2::zeros(), sides: [0.04, 0.002], angle: 0.0 };
    let outline = state.outline().expect("an outline");
    let touch = touch(Vector2::new(0.0, 0.0009), -FRAC_PI_2, Mode::Tip, &mut Chance(SplitMix64::new(3)));
    let row = Row::new(0, &[touch], &Config::default()).expect("a row");
    let Outline::Corners(polygon) = &outline else { panic!("corners") };
    let Place::Face(k, _) = outline.distance(&row).place else { panic!("a face") };
    assert!(polygon.corners[k].y < 0.0 && polygon.corners[(k + 1) % 4].y < 0.0);
}

/// Rows about a circle whose errors, in radius and direction, follow e' = φ e + √(1 − φ²) times a new one.
fn remembering(phi: f64, chance: &mut Chance) -> Vec<Row> {
    const N: usize = 400;
    let mut e = [0.0; 2];
    let touches: Vec<Touch> = (0..N)
        .map(|k| {
            // Uniform, of variance 1.
            e = e.map(|e| phi * e + (1.0 - phi * phi).sqrt() * chance.between(-1.0, 1.0) * 3_f64.sqrt());
            let beta = -3.0 + 3.0 * k as f64 / N as f64;
            let x = (0.03 + 2e-4 * e[0]) * Vector2::new(beta.cos(), beta.sin());
            Touch {
                covariance: Matrix3::from_diagonal(&Vector3::new(4e-8, 4e-8, 1e-4)),
                ..touch(x, beta + 1e-2 * e[1], Mode::Mid, &mut Chance(SplitMix64::new(0)))
            }
        })
        .collect();
    (0..N).map(|i| Row::new(i, &touches, &Config::default()).expect("a row")).collect()
}

/// Eq. (16) finds eq. (17) to its scatter: correlations of N = 400 rows scatter by 1/√(2N) = 0.035 a lag, some ten of them count.
#[test]
fn errors_that_last_are_noticed() {
    let circle = State::Circle { centre: Vector2::zeros(), radius: 0.03 };
    for (phi, expected) in [(0.0, 1.0), (0.5, 3.0), (0.8, 9.0)] {
        let found: Vec<f64> = (1..=20)
            .map(|seed| correlation(&remembering(phi, &mut Chance(SplitMix64::new(seed))), &circle))
            .collect();
        let mean = found.iter().sum::<f64>() / found.len() as f64;
        assert!((mean / expected - 1.0).abs() < 0.2, "{phi}: {mean}, expected {expected}");
    }
}
