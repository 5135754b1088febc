//! Random numbers, of any bits and any magnitude, among those of good problems, for the suites that feed entry points with them.

use super::{Rng, views};
use nalgebra::Matrix6;
use resight_core::{Correspondence, Pose};
use std::time::{Duration, Instant};

/// No single call may take longer: the machine may be busy, the input is tiny.
const DEADLINE: Duration = Duration::from_secs(20);

/// A number of any kind: none, infinite, of any bits, of any magnitude.
pub fn number(rng: &mut Rng) -> f64 {
    match rng.index(6) {
        0 => [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, f64::MAX, f64::MIN_POSITIVE, 5e-324, -1.0]
            [rng.index(8)],
        1 => {
            let half = |rng: &mut Rng| rng.uniform(0.0, 4_294_967_296.0) as u64;
            f64::from_bits(half(rng) << 32 | half(rng))
        }
        2 => rng.normal() * 10f64.powf(rng.uniform(-300.0, 300.0)),
        _ => rng.normal() * 10f64.powf(rng.uniform(-12.0, 12.0)),
    }
}

/// Up to three numbers of a good one replaced; often none.
pub fn spoil(rng: &mut Rng, numbers: &mut [f64]) {
    for _ in 0..rng.index(4).saturating_sub(1) {
        let i = rng.index(numbers.len());
        numbers[i] =
            if rng.index(3) == 0 { numbers[i] * 10f64.powf(rng.uniform(-9.0, 9.0)) } else { number(rng) };
    }
}

/// A pose; one in six is spoilt.
pub fn pose(rng: &mut Rng) -> Pose {
    let mut pose = Pose::new(rng.rotation(), rng.unit_vector() * rng.uniform(0.1, 3.0));
    if rng.index(6) == 0 {
        spoil(rng, pose.translation.as_mut_slice());
        spoil(rng, pose.rotation.as_mut_slice());
    }
    pose
}

/// A covariance; half of them are spoilt or none.
pub fn covariance(rng: &mut Rng) -> Matrix6<f64> {
    let factor = Matrix6::from_fn(|_, _| rng.normal()) * 10f64.powf(rng.uniform(-6.0, -1.0));
    let mut covariance = factor * factor.transpose();
    covariance = (covariance + covariance.transpose()) * 0.5;
    match rng.index(4) {
        0 => spoil(rng, covariance.as_mut_slice()),
        1 => {
            // Symmetric, and no covariance: what a program gets that reads columns in another order.
            let (i, j) = (rng.index(6), rng.index(6));
            let entry = number(rng);
            (covariance[(i, j)], covariance[(j, i)]) = (entry, entry);
        }
        _ => {}
    }
    covariance
}

/// Points of any configuration as a pose shows them; some spoilt.
pub fn seen(rng: &mut Rng, cam_from_target: &Pose) -> Vec<Correspondence> {
    let (_, points) = views::all()[rng.index(4)].clone();
    let sigma_px = 10f64.powf(rng.uniform(-3.0, 1.0));
    let mut seen = views::seen_from(cam_from_target, &points, sigma_px);
    if rng.index(2) == 0 {
        seen = views::disturbed(rng, &seen);
    }
    for _ in 0..rng.index(3) {
        let i = rng.index(seen.len());
        match rng.index(4) {
            0 => spoil(rng, seen[i].x_in_target.as_mut_slice()),
            1 => spoil(rng, seen[i].pixel.as_mut_slice()),
            2 => seen[i].sigma_px = number(rng).abs(),
            _ => seen[i].sigma_m = number(rng).abs(),
        }
    }
    seen
}

/// Feeds one entry point for `RESIGHT_FUZZ_SECONDS`, two without it, or with `RESIGHT_FUZZ_INPUTS` inputs where that is given; `one`
/// says whether there was an answer, and checks it.
pub fn feed(name: &str, seed: u64, mut one: impl FnMut(&mut Rng) -> bool) {
    let given = |name: &str| std::env::var(name).ok().and_then(|s| s.parse::<f64>().ok());
    let inputs = given("RESIGHT_FUZZ_INPUTS");
    let seconds = given("RESIGHT_FUZZ_SECONDS").unwrap_or(2.0);
    let (begin, mut rng) = (Instant::now(), Rng::new(seed));
    let (mut n, mut answered, mut slowest) = (0u64, 0u64, Duration::ZERO);
    while inputs.map_or(begin.elapsed().as_secs_f64() < seconds, |inputs| (n as f64) < inputs) {
        let call = Instant::now();
        answered += u64::from(one(&mut rng));
        slowest = slowest.max(call.elapsed());
        assert!(slowest < DEADLINE, "{name}, input {n}: {slowest:?}");
        n += 1;
    }
    println!("{name}: {n} inputs, {answered} answered, the slowest {slowest:?}");
    assert!(0 < answered, "{name}: the inputs are too wild to be answered");
}

/// Whether a pose holds numbers.
pub fn is_whole(pose: &Pose) -> bool {
    (pose.rotation.sum() + pose.translation.sum()).is_finite()
}
