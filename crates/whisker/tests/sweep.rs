//! Sweeps smoothed: how exact, how honest, on the recorded sets and on their readings noised anew.

mod real_support;

use nalgebra::{Matrix2, Vector2};
use real_support::{Set, Truth, sets};
use resight_whisker::estimate::{ContactEstimate, Mode, Status};
use resight_whisker::sweep::{Friction, Options, Sweep, smooth};
use resight_whisker::{Cell, Sample};

/// Errors of one record over contacts with |F| ≥ 0.1 N.
#[derive(Default, Clone)]
struct Errors {
    squares_m2: Vec<f64>,
    nees: Vec<f64>,
    tip_squares_m2: Vec<f64>,
    modes_right: usize,
    modes: usize,
    missing: usize,
}

impl Errors {
    fn of(estimates: &[ContactEstimate], truth: &[Truth]) -> Self {
        let mut out = Errors::default();
        for (estimate, truth) in estimates.iter().zip(truth).filter(|(_, t)| t.contact) {
            if truth.force_world_n[0].hypot(truth.force_world_n[1]) < 0.1 {
                continue;
            }
            let Some(contact) = &estimate.contact else {
                out.missing += 1;
                continue;
            };
            let error = contact.x_in_world - Vector2::new(truth.x_m, truth.y_m);
            let covariance: Matrix2<f64> = contact.covariance.fixed_view::<2, 2>(0, 0).into_owned();
            out.nees.push(error.dot(&(covariance.try_inverse().expect("positive definite") * error)));
            out.squares_m2.push(error.norm_squared());
            let tip = truth.mode.starts_with("tip");
            if tip {
                out.tip_squares_m2.push(error.norm_squared());
            }
            out.modes += 1;
            out.modes_right += usize::from(tip == (estimate.mode == Mode::Tip));
        }
        out
    }

    fn add(&mut self, other: Errors) {
        self.squares_m2.extend(other.squares_m2);
        self.nees.extend(other.nees);
        self.tip_squares_m2.extend(other.tip_squares_m2);
        self.modes_right += other.modes_right;
        self.modes += other.modes;
        self.missing += other.missing;
    }

    fn rms_mm(&self) -> f64 {
        1e3 * mean(&self.squares_m2).sqrt()
    }

    fn median_mm(&self) -> f64 {
        1e3 * median(&self.squares_m2).sqrt()
    }

    fn line(&self) -> String {
        let tip = 1e3 * mean(&self.tip_squares_m2).sqrt();
        format!(
            "rms {:.3} mm, median {:.3}, worst {:.2}, tip {tip:.3}, NEES {:.2}, modes {:.2} %, {} contacts, {} missing",
            self.rms_mm(),
            self.median_mm(),
            1e3 * self.squares_m2.iter().copied().fold(0.0, f64::max).sqrt(),
            mean(&self.nees),
            100.0 * self.modes_right as f64 / self.modes.max(1) as f64,
            self.squares_m2.len(),
            self.missing,
        )
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn median(values: &[f64]) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    sorted.get(sorted.len() / 2).copied().unwrap_or(f64::NAN)
}

/// SplitMix64 and the sum of twelve uniforms: tails end at 6σ, which no test here reaches.
struct Chance(u64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

fn rounded(value: f64, step: f64) -> f64 {
    if step == 0.0 { value } else { (value / step).round() * step }
}

/// The readings without noise, read again by the instruments of `cell`.
fn noised(clean: &[Sample], cell: &Cell, seed: u64) -> Vec<Sample> {
    let mut chance = Chance(seed);
    let mut read = |value: f64, sigma: f64, step: f64| rounded(value + sigma * chance.normal(), step);
    clean
        .iter()
        .map(|sample| {
            let mut s = *sample;
            s.load.fx_n = read(s.load.fx_n, cell.force_sigma_n, cell.force_step_n);
            s.load.fy_n = read(s.load.fy_n, cell.force_sigma_n, cell.force_step_n);
            s.load.mz_n_m = read(s.load.mz_n_m, cell.torque_sigma_n_m, cell.torque_step_n_m);
            let hub = &mut s.world_from_hub;
            hub.angle_rad = read(hub.angle_rad, cell.hub_angle_sigma_rad, cell.hub_angle_step_rad);
            hub.x_m = read(hub.x_m, cell.hub_xy_sigma_m, 0.0);
            hub.y_m = read(hub.y_m, cell.hub_xy_sigma_m, 0.0);
            s
        })
        .collect()
}

fn smoothed(set: &Set, samples: &[Sample]) -> Sweep {
    smooth(&set.rod, &set.cell, samples, &Options::default()).expect("a smoothed record")
}

/// μ of the set's truth.
fn true_mu(set: &Set) -> f64 {
    if set.name.contains("mu03") { 0.3 } else { 0.0 }
}

/// The bars of the feature: 0.25 mm without friction, 0.30 mm with μ = 0.3, median 0.12 mm, μ within 0.002.
#[test]
fn recorded_sweeps_are_within_a_quarter_millimetre() {
    let Some(sets) = sets() else { return };
    for set in &sets {
        let sweep = smoothed(set, &set.noisy);
        let errors = Errors::of(&sweep.estimates, &set.truth);
        println!(
            "{}: mu {:.4} ± {:.4}, jumps {:?}, χ² {:.0}/{}, {} steps",
            set.name,
            sweep.mu,
            sweep.mu_sigma,
            sweep.jumps,
            sweep.chi2,
            3 * sweep.contacts,
            sweep.iterations
        );
        println!("    {}", errors.line());
        for number in 0..3 {
            let keep: Vec<usize> = (0..set.truth.len()).filter(|&i| set.noisy[i].sweep == number).collect();
            let estimates: Vec<_> = keep.iter().map(|&i| sweep.estimates[i].clone()).collect();
            let truth: Vec<_> = keep.iter().map(|&i| set.truth[i].clone()).collect();
            println!("    sweep {number}: {}", Errors::of(&estimates, &truth).line());
        }
        let bar_mm = if true_mu(set) == 0.0 { 0.25 } else { 0.30 };
        assert_eq!(errors.missing, 0, "{}", set.name);
        assert!(errors.rms_mm() < bar_mm, "{}: {}", set.name, errors.line());
        assert!(errors.median_mm() < 0.12, "{}: {}", set.name, errors.line());
        assert!((sweep.mu - true_mu(set)).abs() < 0.002, "{}: mu {}", set.name, sweep.mu);
    }
}

/// One noise is luck: twenty more of every set. The covariance holds besides: with rounding of the hub's angle, which a linear
/// ramp spreads evenly and so averages better than chance would, and with Gaussian noise of the same size in its place.
#[test]
fn noised_anew_the_bars_hold_and_so_do_the_covariances() {
    let Some(sets) = sets() else { return };
    for set in sets.iter() {
        let mut gaussian = set.cell;
        gaussian.hub_angle_sigma_rad = set.cell.hub_angle_step_rad / 12.0_f64.sqrt();
        gaussian.hub_angle_step_rad = 0.0;
        for (name, cell) in [("as recorded", set.cell), ("Gaussian hub", gaussian)] {
            let (mut pooled, mut mu_nees, mut mu_worst, mut jumps) = (Errors::default(), 0.0, 0.0_f64, 0);
            for seed in 1..=20 {
                let sweep = smooth(&set.rod, &cell, &noised(&set.clean, &cell, seed), &Options::default())
                    .expect("a smoothed record");
                let off = sweep.mu - true_mu(set);
                mu_nees += (off / sweep.mu_sigma).powi(2) / 20.0;
                mu_worst = mu_worst.max(off.abs());
                jumps += sweep.jumps.len();
                pooled.add(Errors::of(&sweep.estimates, &set.truth));
            }
            println!("{} {name}: {}", set.name, pooled.line());
            println!(
                "    NEES median {:.2} (of χ²₂: 1.39), mu worst {mu_worst:.4}, NEES {mu_nees:.2}, jumps {jumps}",
                median(&pooled.nees)
            );
            let bar_mm = if true_mu(set) == 0.0 { 0.25 } else { 0.30 };
            assert!(pooled.rms_mm() < bar_mm, "{} {name}: {}", set.name, pooled.line());
            assert!(pooled.median_mm() < 0.12, "{} {name}: {}", set.name, pooled.line());
        }
    }
}

/// Every row is answered, whatever it holds.
#[test]
fn rows_that_are_no_numbers_are_told_not_dropped() {
    let Some(sets) = sets() else { return };
    let set = &sets[2];
    let mut samples = set.noisy.clone();
    samples[60].load.fx_n = f64::NAN;
    samples[200].world_from_hub.x_m = f64::INFINITY;
    let sweep = smoothed(set, &samples);
    assert_eq!(sweep.estimates.len(), samples.len());
    assert_eq!(sweep.estimates[60].status, Status::Inconsistent);
    let numbers = |e: &ContactEstimate| {
        e.contact
            .as_ref()
            .is_none_or(|c| c.covariance.iter().chain(c.x_in_world.iter()).all(|v| v.is_finite()))
    };
    assert!(sweep.estimates.iter().all(numbers));
}

/// A negative coefficient and a load cell without noise are refused by name.
#[test]
fn impossible_instruments_are_refused() {
    let rod = resight_whisker::Rod::uniform(0.25, 0.01).expect("a rod");
    let cell = Cell { force_sigma_n: 1e-3, torque_sigma_n_m: 1e-5, ..Cell::default() };
    let negative = Options { friction: Friction::Given { mu: -0.1 }, ..Options::default() };
    assert!(smooth(&rod, &cell, &[], &negative).is_err());
    assert!(smooth(&rod, &Cell::default(), &[], &Options::default()).is_err());
    assert!(smooth(&rod, &cell, &[], &Options::default()).is_ok_and(|sweep| sweep.estimates.is_empty()));
}
