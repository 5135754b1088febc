//! Contacts under constraints: automatic modes, the coefficient of friction, bounds. The records, where RESIGHT_DATA names them.

mod real_support;

use nalgebra::Vector2;
use real_support::{Set, Truth, sets};
use resight_whisker::contact::Method;
use resight_whisker::estimate::{Contact, Mode, Status};
use resight_whisker::friction::{FrictionAngle, Mu, Record, constrain, solve_record};
use resight_whisker::{ContactEstimate, Sample};

/// Sums over contacts of at least a tenth of a newton.
#[derive(Default, Clone)]
struct Sums {
    count: f64,
    squared_m2: f64,
    bound_m2: f64,
    nees: f64,
    tips: f64,
    tip_squared_m2: f64,
    mode_right: f64,
    mode_right_all: f64,
    all: f64,
}

impl Sums {
    fn add(&mut self, other: &Sums) {
        self.count += other.count;
        self.squared_m2 += other.squared_m2;
        self.bound_m2 += other.bound_m2;
        self.nees += other.nees;
        self.tips += other.tips;
        self.tip_squared_m2 += other.tip_squared_m2;
        self.mode_right += other.mode_right;
        self.mode_right_all += other.mode_right_all;
        self.all += other.all;
    }

    fn rms_mm(&self) -> f64 {
        1e3 * (self.squared_m2 / self.count).sqrt()
    }

    fn bound_mm(&self) -> f64 {
        1e3 * (self.bound_m2 / self.count).sqrt()
    }

    fn tip_rms_mm(&self) -> f64 {
        1e3 * (self.tip_squared_m2 / self.tips.max(1.0)).sqrt()
    }

    fn print(&self, name: &str) {
        println!(
            "{name}: {} contacts, rms {:.3} mm, bound {:.3} mm ({:.3}), NEES {:.3}, tip rms {:.3} mm of {}, mode {:.2} % (all {:.2} %)",
            self.count,
            self.rms_mm(),
            self.bound_mm(),
            self.rms_mm() / self.bound_mm(),
            self.nees / self.count,
            self.tip_rms_mm(),
            self.tips,
            100.0 * self.mode_right / self.count,
            100.0 * self.mode_right_all / self.all,
        );
    }
}

fn true_mode(truth: &Truth) -> Mode {
    match truth.mode.as_str() {
        mode if mode.starts_with("tip") => Mode::Tip,
        "free" => Mode::Free,
        _ => Mode::Mid,
    }
}

fn true_mu(set: &Set) -> f64 {
    if set.name.contains("mu03") { 0.3 } else { 0.0 }
}

/// The covariance at the true load with mode and friction known, per sample.
fn bounds(set: &Set) -> Vec<f64> {
    let friction = FrictionAngle::of_mu(true_mu(set), 0.0, 1.0);
    let bound = |(sample, truth): (&Sample, &Truth)| {
        let estimate =
            constrain(&set.rod, &set.cell, sample, true_mode(truth), friction, Method::Auto).ok()?;
        Some(trace(&estimate.contact?))
    };
    set.clean.iter().zip(&set.truth).map(|pair| bound(pair).unwrap_or(0.0)).collect()
}

fn trace(contact: &Contact) -> f64 {
    contact.covariance[(0, 0)] + contact.covariance[(1, 1)]
}

fn sums(set: &Set, estimates: &[ContactEstimate], bounds: &[f64]) -> Sums {
    let mut sums = Sums::default();
    for ((truth, estimate), bound) in set.truth.iter().zip(estimates).zip(bounds) {
        if !truth.contact {
            continue;
        }
        let right = f64::from(estimate.mode == true_mode(truth));
        sums.all += 1.0;
        sums.mode_right_all += right;
        if truth.force_world_n[0].hypot(truth.force_world_n[1]) < 0.1 {
            continue;
        }
        let contact = estimate.contact.as_ref().expect("a contact");
        let error = contact.x_in_world - Vector2::new(truth.x_m, truth.y_m);
        let covariance = contact.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        if estimate.mode != true_mode(truth) {
            println!(
                "WRONG {} p {} s {} truth s {} phi {} est {:?}",
                truth.mode,
                estimate.mode_probability,
                contact.s_m,
                truth.s_m,
                truth.friction_angle_rad,
                estimate
            );
        }
        sums.count += 1.0;
        sums.mode_right += right;
        sums.squared_m2 += error.norm_squared();
        sums.bound_m2 += bound;
        sums.nees += (error.transpose() * covariance.try_inverse().expect("regular") * error)[0];
        if true_mode(truth) == Mode::Tip {
            sums.tips += 1.0;
            sums.tip_squared_m2 += error.norm_squared();
        }
    }
    sums
}

fn solve(set: &Set, samples: &[Sample], mu: Mu) -> Record {
    solve_record(&set.rod, &set.cell, samples, mu, Method::Auto).expect("a record")
}

/// Mode and friction estimated: within 3 % of the bound where both are known.
#[test]
fn automatic_modes_reach_the_constrained_bound() {
    let Some(sets) = sets() else { return };
    let mut pooled = Sums::default();
    for set in sets.iter().filter(|s| !s.name.contains("taper")) {
        let record = solve(set, &set.noisy, Mu::Auto);
        let sums = sums(set, &record.estimates, &bounds(set));
        sums.print(set.name);
        let inconsistent = record.estimates.iter().filter(|e| e.status == Status::Inconsistent).count();
        println!(
            "  mu {:.4} ± {:.4}, {} states, {inconsistent} inconsistent",
            record.mu,
            record.mu_sigma,
            record.states.len()
        );
        assert!((record.mu - true_mu(set)).abs() < 0.002, "{}: {}", set.name, record.mu);
        pooled.add(&sums);
    }
    pooled.print("all sets");
    assert!(pooled.rms_mm() < 1.03 * pooled.bound_mm());
    assert!(pooled.tip_rms_mm() < 0.35);
    assert!(0.98 * pooled.count < pooled.mode_right);
}
