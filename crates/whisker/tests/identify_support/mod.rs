//! Simulated trials: an object of a class, swept as the recorded sets are, felt by a load cell of their class.

use nalgebra::Vector2;
use resight_core::statistics::SplitMix64;
use resight_whisker::contact::Method;
use resight_whisker::estimate::{ContactEstimate, estimate};
use resight_whisker::friction::{Mu, solve_record};
use resight_whisker::identify::{Class, Touch};
use resight_whisker::simulate::{Spacing, add_noise, standard_sweeps, sweep};
use resight_whisker::sweep::fixed_lag::FixedLag;
use resight_whisker::sweep::{Options, smooth};
use resight_whisker::{Cell, Error, Rod, Sample, Shape};

/// Steel, 1 mm, 0.25 m.
pub fn rod() -> Rod {
    Rod::uniform(0.25, 9.817_477_042_468_105e-3).expect("a rod")
}

/// A load cell of 1/320 N and 1/64 N·mm, a 14-bit encoder, a stage of 10 µm.
pub fn cell() -> Cell {
    Cell {
        force_sigma_n: 1.0 / 320.0,
        torque_sigma_n_m: 1.0 / 64_000.0,
        hub_angle_sigma_rad: 0.0,
        hub_xy_sigma_m: 1e-5,
        force_step_n: 1.0 / 320.0,
        torque_step_n_m: 1.0 / 64_000.0,
        hub_angle_step_rad: std::f64::consts::TAU / 16_384.0,
    }
}

/// SplitMix64.
pub struct Chance(pub SplitMix64);

impl Chance {
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0.between(low, high)
    }
}

/// An object of the class, within the whisker's reach from below.
pub fn object(class: Class, chance: &mut Chance) -> Shape {
    let centre_m = Vector2::new(chance.between(-0.01, 0.01), chance.between(0.155, 0.17));
    let angle_rad = chance.between(0.0, std::f64::consts::FRAC_PI_2);
    match class {
        Class::Circle => Shape::Circle { centre_m, radius_m: chance.between(0.010, 0.050) },
        Class::Ellipse => {
            let a = chance.between(0.025, 0.050);
            Shape::Ellipse {
                centre_m,
                semi_axes_m: [a, a * chance.between(0.4, 0.8)],
                angle_rad: 2.0 * angle_rad,
            }
        }
        Class::Square => Shape::square(centre_m, chance.between(0.040, 0.080), angle_rad),
        Class::Rectangle => {
            let a = chance.between(0.045, 0.080);
            Shape::Rectangle {
                centre_m,
                sides_m: [a, a * chance.between(0.4, 0.8)],
                angle_rad: 2.0 * angle_rad,
            }
        }
        Class::Polygon => polygon(centre_m, angle_rad, chance),
    }
}

/// Five corners on a circle, none near a rectangle.
fn polygon(centre_m: Vector2<f64>, angle_rad: f64, chance: &mut Chance) -> Shape {
    let radius = chance.between(0.030, 0.045);
    let corner = |k: u32, jitter: f64| {
        let angle = angle_rad + (f64::from(k) + jitter) * std::f64::consts::TAU / 5.0;
        centre_m + radius * Vector2::new(angle.cos(), angle.sin())
    };
    Shape::Polygon { corners_m: (0..5).map(|k| corner(k, chance.between(-0.15, 0.15))).collect() }
}

/// The readings of the three standard sweeps, without noise.
pub fn readings(object: &Shape, mu: f64) -> Result<Vec<Vec<Sample>>, Error> {
    let sweeps = standard_sweeps();
    let one = |(number, motion)| {
        let record = sweep(&rod(), object, mu, number as u32, motion, &Spacing::default())?;
        Ok(record.samples.iter().map(|simulated| simulated.sample).collect())
    };
    sweeps.iter().enumerate().map(one).collect()
}

/// How contacts are estimated from readings.
// The bench takes one of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum How {
    /// Sample by sample.
    Raw,
    /// Under constraints with this friction.
    Constrained(Mu),
    /// All samples of each sweep together, friction estimated.
    Sweep,
    /// As a stream does it: each sample with those before it and a window of those after it.
    Lag,
}

fn lagged(rod: &Rod, cell: &Cell, samples: &[Sample]) -> Vec<ContactEstimate> {
    let mut smoother = FixedLag::new(rod, cell, &Options::default()).expect("instruments");
    let mut settled: Vec<_> = samples.iter().flat_map(|sample| smoother.push(*sample).settled).collect();
    settled.extend(smoother.finish());
    assert_eq!(settled.len(), samples.len(), "every reading has its answer");
    settled.into_iter().map(|settled| settled.estimate).collect()
}

/// What a user's program makes of readings: noise added, contacts estimated.
pub fn felt(samples: &[Sample], how: How, seed: u64) -> Vec<Touch> {
    let (rod, cell) = (rod(), cell());
    touches(&rod, &cell, &add_noise(samples, &cell, seed), how)
}

/// The contacts of readings as they are.
pub fn touches(rod: &Rod, cell: &Cell, noisy: &[Sample], how: How) -> Vec<Touch> {
    let estimates = match how {
        How::Raw => noisy.iter().map(|sample| estimate(rod, cell, sample, Method::Auto)).collect(),
        How::Constrained(mu) => solve_record(rod, cell, noisy, mu, Method::Auto).expect("a record").estimates,
        How::Sweep => smooth(rod, cell, noisy, &Options::default()).expect("a record").estimates,
        How::Lag => lagged(rod, cell, noisy),
    };
    let touch = |(sample, estimate): (&Sample, _)| {
        Touch::from_estimate(sample.sweep, sample.load.mz_n_m, estimate, rod)
    };
    noisy.iter().zip(&estimates).filter_map(touch).collect()
}
