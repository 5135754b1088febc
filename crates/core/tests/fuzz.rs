//! A hundred thousand random inputs, sane and insane: never a panic, never a number in an answer that is none.

use crate::common::{Rng, views};
use nalgebra::Unit;
use resight_core::locate::choose::{Ambiguity, Minimum};
use resight_core::locate::consistency::Consistency;
use resight_core::locate::{Config, Method, PoseEstimate, locate};
use resight_core::solve::line_plus_one::Weakness;
use resight_core::{Correspondence, Point};

const N: usize = 100_000;
const METHODS: [Method; 6] =
    [Method::Auto, Method::Wang2004, Method::LinePlusOne, Method::P3p, Method::Planar, Method::Sqpnp];

/// Numbers that break formulas, and any magnitude there is.
fn wild(rng: &mut Rng) -> f64 {
    const SPECIAL: [f64; 12] = [
        f64::NAN,
        f64::INFINITY,
        f64::NEG_INFINITY,
        0.0,
        -0.0,
        f64::MAX,
        f64::MIN,
        f64::MIN_POSITIVE,
        5e-324,
        1.0,
        -1.0,
        f64::EPSILON,
    ];
    match rng.index(4) {
        0 => SPECIAL[rng.index(SPECIAL.len())],
        1 => rng.normal() * 10f64.powf(rng.uniform(-308.0, 308.0)),
        _ => rng.normal() * 10f64.powf(rng.uniform(-20.0, 20.0)),
    }
}

/// As `wild` but finite and, for a sigma, positive, so that more than the input checks are reached.
fn finite(rng: &mut Rng) -> f64 {
    loop {
        let x = wild(rng);
        if x.is_finite() {
            return x;
        }
    }
}

fn changed(rng: &mut Rng, c: &mut Correspondence, number: fn(&mut Rng) -> f64) {
    match rng.index(6) {
        0 | 1 => c.x_in_target[rng.index(3)] = number(rng),
        2 => c.pixel[rng.index(2)] = number(rng),
        3 => {
            let mut b = c.bearing.into_inner();
            b[rng.index(3)] = number(rng);
            c.bearing = Unit::new_unchecked(b);
        }
        4 => c.sigma_px = number(rng).abs(),
        _ => c.sigma_m = number(rng).abs(),
    }
}

/// A scene of some configuration, then some of its numbers replaced; or no scene at all.
fn input(rng: &mut Rng) -> Vec<Correspondence> {
    let number = if rng.index(3) == 0 { wild } else { finite };
    if rng.index(4) == 0 {
        let n = rng.index(10);
        let blank = views::seen_from(&views::oblique(), &views::three(), 1.0)[0];
        let any = |rng: &mut Rng| {
            let mut c = blank;
            c.x_in_target = Point::new(number(rng), number(rng), number(rng));
            c.pixel = resight_core::Pixel::new(number(rng), number(rng));
            c.sigma_px = number(rng).abs();
            c.bearing = Unit::new_normalize(Point::new(rng.normal(), rng.normal(), rng.normal()));
            c
        };
        return (0..n).map(|_| any(rng)).collect();
    }
    let (_, points) = views::all()[rng.index(4)].clone();
    let mut seen = views::seen_from(&views::oblique(), &points, 10f64.powf(rng.uniform(-6.0, 3.0)));
    if rng.index(2) == 0 {
        seen = views::disturbed(rng, &seen);
    }
    for _ in 0..rng.index(4) {
        let i = rng.index(seen.len());
        changed(rng, &mut seen[i], number);
    }
    if rng.index(4) == 0 {
        let scale = 10f64.powf(rng.uniform(-150.0, 150.0));
        seen.iter_mut().for_each(|c| c.x_in_target *= scale);
    }
    seen
}

fn minimum_numbers(m: &Minimum) -> Vec<f64> {
    let pose = m.cam_from_target;
    let rotation = pose.rotation.iter().chain(pose.translation.iter());
    rotation.chain(m.covariance.iter()).chain([&m.chi2, &m.rms_px, &m.log_determinant]).copied().collect()
}

fn numbers(e: &PoseEstimate) -> Vec<f64> {
    let first = Minimum {
        cam_from_target: e.cam_from_target,
        covariance: e.covariance,
        chi2: e.chi2,
        rms_px: e.rms_px,
        log_determinant: e.log_determinant,
    };
    let mut all = minimum_numbers(&first);
    match &e.ambiguity {
        Ambiguity::Ambiguous { ratio, other } => {
            all.push(*ratio);
            all.extend(minimum_numbers(other));
        }
        Ambiguity::Unique { ratio } => all.extend(ratio),
    }
    if let Consistency::Inconsistent { chi2_per_degree_of_freedom, worst_px, .. } = e.consistency {
        all.extend([chi2_per_degree_of_freedom, worst_px]);
    }
    match e.weakness {
        Some(Weakness::CriticalPlane { separation_sigma, needed_sigma }) => {
            all.extend([separation_sigma, needed_sigma]);
        }
        Some(Weakness::LineEndOn { length_sigma, needed_sigma }) => all.extend([length_sigma, needed_sigma]),
        Some(_) | None => {}
    }
    all
}

#[test]
fn garbage_gives_an_error_or_finite_numbers() {
    let camera = views::camera();
    let mut rng = Rng::new(20_040);
    let (mut answered, mut not_finite) = (0, 0);
    for i in 0..N {
        let seen = input(&mut rng);
        let method = METHODS[rng.index(METHODS.len())];
        let given: Vec<f64> = (0..16).map(|k| if k % 5 == 0 { wild(&mut rng).abs() } else { 0.0 }).collect();
        let intrinsics_covariance = (rng.index(4) == 0).then_some(given.as_slice());
        let config = Config { method, intrinsics_covariance, ..Config::default() };
        let Ok(e) = locate(&seen, &camera, &config) else { continue };
        answered += 1;
        if !numbers(&e).iter().all(|x| x.is_finite()) || (0..6).any(|k| e.covariance[(k, k)] < 0.0) {
            not_finite += 1;
            if not_finite < 6 {
                println!("input {i}: {seen:?}\n{config:?}\n{e:?}\n");
            }
        }
    }
    println!("{answered} of {N} answered");
    assert_eq!(not_finite, 0);
    assert!(N / 20 < answered, "the inputs are too wild to reach the solvers");
}
