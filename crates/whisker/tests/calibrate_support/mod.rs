//! Rigs that are wrong on purpose, and what they read.

use nalgebra::{Matrix2, Vector2};
use resight_whisker::calibrate::{Calibrated, Calibration, Parameter, Priors, Values};
use resight_whisker::estimate::Mode;
use resight_whisker::simulate::{Motion, Spacing, TruthContact, add_noise, standard_sweeps, sweep};
use resight_whisker::{Cell, HubLoad, PlanarPose, Rod, Sample, Shape};

/// Steel wire of 1 mm and 0.25 m.
pub fn steel() -> Rod {
    Rod::uniform(0.25, 9.817_477e-3).expect("a rod")
}

/// A cell of 1/320 N and 1/64 N·mm, a 14-bit encoder, a stage of 10 µm.
pub fn cell() -> Cell {
    Cell {
        force_sigma_n: 1.0 / 320.0,
        torque_sigma_n_m: 1e-3 / 64.0,
        hub_angle_sigma_rad: 0.0,
        hub_xy_sigma_m: 1e-5,
        force_step_n: 1.0 / 320.0,
        torque_step_n_m: 1e-3 / 64.0,
        hub_angle_step_rad: std::f64::consts::TAU / 16384.0,
    }
}

/// A record without noise, with its truth.
pub struct Ideal {
    pub rod: Rod,
    pub samples: Vec<Sample>,
    pub truth: Vec<Option<TruthContact>>,
}

/// The standard sweeps over an object.
pub fn ideal(rod: &Rod, object: &Shape, mu: f64) -> Ideal {
    ideal_along(rod, object, mu, &standard_sweeps())
}

pub fn ideal_along(rod: &Rod, object: &Shape, mu: f64, motions: &[Motion]) -> Ideal {
    let records: Vec<_> = motions
        .iter()
        .enumerate()
        .flat_map(|(i, motion)| {
            sweep(rod, object, mu, i as u32, motion, &Spacing::default()).expect("a sweep").samples
        })
        .collect();
    Ideal {
        rod: rod.clone(),
        samples: records.iter().map(|r| r.sample).collect(),
        truth: records.iter().map(|r| r.truth).collect(),
    }
}

pub fn circle() -> Shape {
    Shape::Circle { centre_m: Vector2::new(0.0, 0.16), radius_m: 0.025 }
}

pub fn square(degrees: f64) -> Shape {
    Shape::square(Vector2::new(0.0, 0.165), 0.06, degrees.to_radians())
}

/// What a rig with errors `wrong` reads where an ideal one reads `sample`: docs/math/whisker_calibrate.md eqs. (1)–(3) backwards.
/// The rod's own errors (stiffness, curvature) and friction are in what is simulated.
pub fn as_read(wrong: &Values, sample: &Sample) -> Sample {
    let v = |p: Parameter| wrong[p.index()];
    let force = sample.load.force_n();
    let moment =
        sample.load.mz_n_m - v(Parameter::CellOriginX) * force.y + v(Parameter::CellOriginY) * force.x;
    let (sin, cos) = v(Parameter::CellAngle).sin_cos();
    let in_cell = Matrix2::new(cos, sin, -sin, cos) * force / v(Parameter::ForceGain).exp();
    let hub = sample.world_from_hub;
    Sample {
        load: HubLoad {
            fx_n: in_cell.x + v(Parameter::ForceXZero),
            fy_n: in_cell.y + v(Parameter::ForceYZero),
            mz_n_m: moment / v(Parameter::TorqueGain).exp() + v(Parameter::TorqueZero),
        },
        world_from_hub: PlanarPose {
            x_m: hub.x_m - v(Parameter::HubX),
            y_m: hub.y_m - v(Parameter::HubY),
            angle_rad: hub.angle_rad - v(Parameter::HubAngle),
        },
        ..*sample
    }
}

/// The errors of the requirement, all at once: 1 % of torque gain, 0.2° of clamp error (which turns whisker and cell against each
/// other), 0.5 mm of hub offset, zeros of some steps of the cell.
pub fn wrong() -> Values {
    values(&[
        (Parameter::ForceXZero, 3.2 / 320.0),
        (Parameter::ForceYZero, -1.9 / 320.0),
        (Parameter::TorqueZero, 3.3e-3 / 64.0),
        (Parameter::TorqueGain, 0.01),
        (Parameter::CellAngle, -0.2_f64.to_radians()),
        (Parameter::HubAngle, 0.2_f64.to_radians()),
        (Parameter::HubX, 5e-4),
        (Parameter::HubY, -3e-4),
    ])
}

pub fn values(given: &[(Parameter, f64)]) -> Values {
    let mut values = Values::zeros();
    given.iter().for_each(|(parameter, value)| values[parameter.index()] = *value);
    values
}

/// The record as the wrong rig reads it, with noise; the encoder's marks lie anywhere.
pub fn read(wrong: &Values, ideal: &[Sample], cell: &Cell, seed: u64) -> Vec<Sample> {
    let mark = cell.hub_angle_step_rad * (seed as f64 * 0.618_033_988_75).fract();
    let turned = |sample: &Sample, by: f64| {
        let mut turned = *sample;
        turned.world_from_hub.angle_rad += by;
        turned
    };
    let readings: Vec<Sample> = ideal.iter().map(|sample| turned(&as_read(wrong, sample), mark)).collect();
    add_noise(&readings, cell, seed).iter().map(|sample| turned(sample, -mark)).collect()
}

/// Squared error over its covariance of the parameters named, and how many they are.
pub fn nees(calibrated: &Calibrated, truth: &Values, which: &[Parameter]) -> (f64, f64) {
    let calibration = &calibrated.calibration;
    let e =
        nalgebra::DVector::from_fn(which.len(), |i, _| calibration.value(which[i]) - truth[which[i].index()]);
    let c = nalgebra::DMatrix::from_fn(which.len(), which.len(), |i, j| {
        calibration.covariance[(which[i].index(), which[j].index())]
    });
    (e.dot(&c.cholesky().expect("a covariance").solve(&e)), which.len() as f64)
}

/// Mean squared error of raw contacts over their covariance, noise and calibration together, x and y: 2 where both are right. Of
/// contacts of 0.1 N and more. `with_systematic` off leaves the calibration's own uncertainty out.
pub fn contact_nees(
    calibration: &Calibration,
    cell: &Cell,
    samples: &[Sample],
    truth: &[Option<Vector2<f64>>],
    with_systematic: bool,
) -> f64 {
    use resight_whisker::contact::Method;
    use resight_whisker::estimate::estimate;
    let (rod, own_cell) = (calibration.rod(), calibration.apply_to_cell(cell));
    let (mut sum, mut count) = (0.0, 0.0);
    for (sample, truth) in samples.iter().zip(truth) {
        let (Some(truth), meant) = (truth, calibration.apply(sample)) else { continue };
        if meant.load.force_n().norm() < 0.1 {
            continue;
        }
        let Some(contact) = estimate(&rod, &own_cell, &meant, Method::Auto).contact else { continue };
        let mut covariance = contact.covariance;
        if with_systematic {
            covariance += calibration.systematic_covariance(cell, sample, Mode::Free).expect("a contact");
        }
        let e = contact.x_in_world - truth;
        let c = covariance.fixed_view::<2, 2>(0, 0).into_owned();
        sum += e.dot(&(c.try_inverse().expect("a covariance") * e));
        count += 1.0;
    }
    sum / count
}

/// The parameters a record can determine: all that are free, without those named.
pub fn free_but(priors: &Priors, without: &[Parameter]) -> Vec<Parameter> {
    priors.free().into_iter().filter(|p| !without.contains(p)).collect()
}

pub const HUB: [Parameter; 3] = [Parameter::HubAngle, Parameter::HubX, Parameter::HubY];
