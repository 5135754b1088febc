//! Sweeps smoothed on simulated objects none of the recorded sets has: no data needed.

use nalgebra::{Matrix2, Vector2};
use resight_core::statistics::SplitMix64;
use resight_whisker::estimate::ContactEstimate;
use resight_whisker::simulate::{Record, record};
use resight_whisker::sweep::fixed_lag::FixedLag;
use resight_whisker::sweep::{Options, Sweep, smooth};
use resight_whisker::{Cell, PlanarPose, Rod, Sample, Shape};

const CELL: Cell = Cell {
    force_sigma_n: 1.0 / 320.0,
    torque_sigma_n_m: 1.0 / 64_000.0,
    hub_angle_sigma_rad: 1e-4,
    hub_xy_sigma_m: 1e-5,
    force_step_n: 1.0 / 320.0,
    torque_step_n_m: 1.0 / 64_000.0,
    hub_angle_step_rad: 0.0,
};

fn rod() -> Rod {
    Rod::uniform(0.25, 0.009_817).expect("a rod")
}

/// SplitMix64 and the sum of twelve uniforms.
struct Chance(SplitMix64);

impl Chance {
    fn uniform(&mut self) -> f64 {
        self.0.uniform()
    }

    fn normal(&mut self) -> f64 {
        (0..12).map(|_| self.uniform()).sum::<f64>() - 6.0
    }
}

/// What `CELL` and a hub of its noise read of a simulated record.
fn read(record: &Record, chance: &mut Chance) -> Vec<Sample> {
    let rounded = |value: f64, step: f64| (value / step).round() * step;
    let mut read = |simulated: &Sample| {
        let mut s = *simulated;
        s.load.fx_n = rounded(s.load.fx_n + CELL.force_sigma_n * chance.normal(), CELL.force_step_n);
        s.load.fy_n = rounded(s.load.fy_n + CELL.force_sigma_n * chance.normal(), CELL.force_step_n);
        s.load.mz_n_m =
            rounded(s.load.mz_n_m + CELL.torque_sigma_n_m * chance.normal(), CELL.torque_step_n_m);
        s.world_from_hub.angle_rad += CELL.hub_angle_sigma_rad * chance.normal();
        s.world_from_hub.x_m += CELL.hub_xy_sigma_m * chance.normal();
        s.world_from_hub.y_m += CELL.hub_xy_sigma_m * chance.normal();
        s
    };
    record.samples.iter().map(|simulated| read(&simulated.sample)).collect()
}

/// Squared errors, metres², and normalised squared errors of contacts with |F| ≥ 0.1 N.
fn errors(estimates: &[ContactEstimate], record: &Record) -> (Vec<f64>, Vec<f64>) {
    let (mut squares, mut nees) = (Vec::new(), Vec::new());
    for (estimate, simulated) in estimates.iter().zip(&record.samples) {
        let Some(truth) = &simulated.truth else { continue };
        if truth.force_in_world_n.norm() < 0.1 {
            continue;
        }
        let contact = estimate.contact.as_ref().expect("a contact where the force is clear");
        let off = contact.x_in_world - truth.x_in_world;
        let covariance: Matrix2<f64> = contact.covariance.fixed_view::<2, 2>(0, 0).into_owned();
        squares.push(off.norm_squared());
        nees.push(off.dot(&(covariance.try_inverse().expect("positive definite") * off)));
    }
    (squares, nees)
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// Turning from 150° by `steps` of 1.2°.
fn turning(steps: usize) -> Vec<PlanarPose> {
    (0..steps)
        .map(|k| PlanarPose { x_m: -0.06, y_m: 0.0, angle_rad: (150.0 - 1.2 * k as f64).to_radians() })
        .collect()
}

/// Moving along x from −0.14 m by `steps` of 2.5 mm, the whisker along y.
fn moving(steps: usize) -> Vec<PlanarPose> {
    let angle_rad = std::f64::consts::FRAC_PI_2;
    (0..steps).map(|k| PlanarPose { x_m: -0.14 + 2.5e-3 * k as f64, y_m: 0.0, angle_rad }).collect()
}

fn smoothed(samples: &[Sample]) -> Sweep {
    smooth(&rod(), &CELL, samples, &Options::default()).expect("a smoothed record")
}

/// Ellipses, rectangles and triangles at random places and angles, friction from 0 to 0.4, turned over and moved over: pooled
/// rms and the share of honest covariances. No object class, orientation or friction was tuned for.
#[test]
fn objects_never_seen_before_are_within_the_bar() {
    let mut chance = Chance(SplitMix64::new(11));
    let (mut squares, mut nees, mut records, mut mu_worst) = (Vec::new(), Vec::new(), 0, 0.0_f64);
    for trial in 0..24 {
        let mut within = |low: f64, high: f64| low + (high - low) * chance.uniform();
        let centre_m = Vector2::new(within(-0.01, 0.01), within(0.15, 0.17));
        let angle_rad = within(0.0, 3.1);
        let (large, small) = (within(0.03, 0.05), within(0.015, 0.03));
        let object = match trial % 3 {
            0 => Shape::Ellipse { centre_m, semi_axes_m: [large, small], angle_rad },
            1 => Shape::Rectangle { centre_m, sides_m: [2.0 * large, 2.0 * small], angle_rad },
            _ => Shape::Polygon {
                corners_m: (0..3)
                    .map(|k| {
                        let a = angle_rad + f64::from(k) * std::f64::consts::TAU / 3.0;
                        centre_m + Vector2::new(a.cos(), a.sin()) * large
                    })
                    .collect(),
            },
        };
        let mu = [0.0, 0.2, 0.4][trial / 3 % 3];
        let path = if trial % 2 == 0 { turning(110) } else { moving(100) };
        let Ok(truth) = record(&rod(), &object, mu, 0, &path) else { continue };
        let sweep = smoothed(&read(&truth, &mut chance));
        let (own, own_nees) = errors(&sweep.estimates, &truth);
        if own.len() < 20 {
            continue;
        }
        println!(
            "{trial} {object:?} μ {mu}: {:.4} ± {:.4}, rms {:.3} mm, NEES {:.2}, {} contacts, {} jumps, consistent {}",
            sweep.mu,
            sweep.mu_sigma,
            1e3 * mean(&own).sqrt(),
            mean(&own_nees),
            own.len(),
            sweep.jumps.len(),
            sweep.consistent
        );
        mu_worst = mu_worst.max((sweep.mu - mu).abs());
        records += 1;
        squares.extend(own);
        nees.extend(own_nees);
    }
    println!(
        "{records} records: rms {:.3} mm, NEES {:.2}, μ worst {mu_worst:.4}",
        1e3 * mean(&squares).sqrt(),
        mean(&nees)
    );
    assert!(18 <= records);
    assert!(mean(&squares).sqrt() < 0.25e-3 && mean(&nees) < 2.5);
}

/// The hub turns back under friction: the contact sticks for two samples, then slides the other way, the friction angle of the
/// other sign. Batch and fixed lag tell all three apart without being told μ.
#[test]
fn a_hub_that_turns_back_under_friction() {
    let object = Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 };
    let forth = turning(110);
    let path: Vec<PlanarPose> = forth.iter().chain(forth.iter().rev().skip(1)).copied().collect();
    let truth = record(&rod(), &object, 0.3, 0, &path).expect("a record");
    assert!(truth.samples.iter().any(|s| s.truth.as_ref().is_some_and(|t| t.sticks)), "nothing to tell");
    let (mut squares, mut nees, mut streamed) = (Vec::new(), Vec::new(), Vec::new());
    for seed in 1..=6 {
        let samples = read(&truth, &mut Chance(SplitMix64::new(seed)));
        let sweep = smoothed(&samples);
        let own = errors(&sweep.estimates, &truth);
        squares.extend(own.0);
        nees.extend(own.1);
        assert!(sweep.consistent && sweep.jumps.is_empty(), "{:?}", sweep.jumps);
        assert!((sweep.mu - 0.3).abs() < 0.004, "{}", sweep.mu);
        for (estimate, simulated) in sweep.estimates.iter().zip(&truth.samples) {
            if let (Some(contact), Some(true_contact)) = (&estimate.contact, &simulated.truth)
                && 0.1 < true_contact.force_in_world_n.norm()
            {
                // Sticking contacts keep their own angle, known to σ_F/F at 1 N; 5 σ.
                let off = contact.friction_angle_rad - true_contact.friction_angle_rad;
                assert!(off.abs() < 0.03, "{off}");
            }
        }
        let mut smoother = FixedLag::new(&rod(), &CELL, &Options::default()).expect("instruments");
        let mut late: Vec<_> = samples.iter().flat_map(|sample| smoother.push(*sample).settled).collect();
        late.extend(smoother.finish());
        let late: Vec<_> = late.into_iter().map(|settled| settled.estimate).collect();
        streamed.extend(errors(&late, &truth).0);
    }
    let (batch_mm, lag_mm) = (1e3 * mean(&squares).sqrt(), 1e3 * mean(&streamed).sqrt());
    println!("there and back: rms {batch_mm:.3} mm, NEES {:.2}; fixed lag {lag_mm:.3} mm", mean(&nees));
    assert!(batch_mm < 0.25 && lag_mm < 0.35 && mean(&nees) < 2.5);
}
