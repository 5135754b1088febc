//! Calibration from sweeps: stiffness, zeros, gains, angles, offsets and friction, each with its uncertainty, from contacts with an
//! object that is known, known in part, or unknown.
//!
//! Samples in free air must read nothing; a sliding mid-whisker contact has its force at the friction angle from the whisker's normal;
//! a contact at the tip is one whisker's length away; and with an object the tangents must support it. One maximum-likelihood fit takes
//! them all. What the record leaves open is named, keeps its prior uncertainty, and goes into the covariance of every contact
//! ([`Calibration::systematic_covariance`]): an uncalibrated rig never gives a confident wrong contact.
//! Derivation: docs/math/whisker_calibrate.md.

mod parameters;
mod model;
mod outline;
mod constraints;
mod calibration;
mod fit;
mod stretches;
mod tare;
mod roles;
mod undetermined;
mod job;
mod classes;
mod drift;

pub use calibration::Calibration;
pub use constraints::Role;
pub use drift::{Change, Drift, DriftMonitor, DriftOptions, Watch, drift};
pub use model::{Gravity, unit_weight};
pub use parameters::{COUNT, Covariance, Parameter, Priors, Values};
pub use tare::{Tare, tare};
pub use undetermined::Undetermined;

use crate::contact::Method;
use crate::{Cell, Error, Rod, Sample, Shape};
use job::Job;
use nalgebra::DMatrix;
use outline::Outline;

/// The knowledge of the object that was touched.
#[derive(Debug, Clone, PartialEq)]
pub enum Object {
    /// Nothing: only what holds for every object is used.
    Unknown,
    /// Shape, size and place: its clamp-side errors show, too.
    Known(Shape),
    /// Shape and size; the place given is a start.
    KnownSize(Shape),
    /// The kind of shape; size and place given are a start.
    KnownClass(Shape),
    /// It is one and the same circle, ellipse or rectangle throughout the record.
    Unclassified,
}

/// Why an object of unknown class was left out.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum UnknownReason {
    /// No circle, ellipse or rectangle explains the contacts.
    NoShapeFits {
        /// p-value of the best class.
        p_value: f64,
    },
    /// A smooth outline and one with corners explain them about equally well.
    TwoShapesFit {
        /// The difference between the BIC of the worse class and that of the better.
        delta_bic: f64,
        /// The difference that would decide.
        needed: f64,
    },
}

/// The settings of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct Options {
    /// The priors of all parameters.
    pub priors: Priors,
    /// μ, where it is known; `None` to estimate it.
    pub mu: Option<f64>,
    /// Gravity in the plane, to model the whisker's weight; `None` where the plane is level or a tare has been subtracted.
    pub gravity: Option<Gravity>,
    /// The method for computing contacts.
    pub method: Method,
    /// Probability with which a record that keeps the model is called inconsistent.
    pub false_alarm_rate: f64,
}

impl Options {
    /// For a rig as it is delivered.
    pub fn of_a_new_rig(cell: &Cell) -> Self {
        Options {
            priors: Priors::of_a_new_rig(cell),
            mu: None,
            gravity: None,
            method: Method::Auto,
            false_alarm_rate: 1e-3,
        }
    }
}

/// The number of samples of each role.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Counts {
    /// Free.
    pub free: usize,
    /// Between clamp and tip.
    pub mid: usize,
    /// At the tip.
    pub tip: usize,
    /// Not used.
    pub unused: usize,
}

/// A calibration with the tests of its record.
#[derive(Debug, Clone, PartialEq)]
pub struct Calibrated {
    /// The rig.
    pub calibration: Calibration,
    /// Its prior.
    pub priors: Priors,
    /// The combinations that the record does not determine.
    pub undetermined: Vec<Undetermined>,
    /// The parameters that were held.
    pub held: Vec<Parameter>,
    /// The object as fitted; as given where it was known, none where unknown.
    pub object: Option<Shape>,
    /// Covariance of its free parameters: shift x, shift y, turn (not of a circle), sizes; m, rad.
    pub object_covariance: DMatrix<f64>,
    /// Why an object of unknown class was left out; `None` where it was not.
    pub unknown_reason: Option<UnknownReason>,
    /// Squared misfit of the samples, in the noise stated.
    pub chi2: f64,
    /// Degrees of freedom of that sum.
    pub degrees_of_freedom: usize,
    /// Probability that a record which keeps the model fits as badly.
    pub p_value: f64,
    /// The number of contacts that were left out because they contradict the object.
    pub contradicted: usize,
    /// Whether the record agrees with the model, at the requested false-alarm rate, and the object explains 95 % of the contacts.
    pub is_consistent: bool,
    /// The role of every sample.
    pub roles: Vec<Role>,
}

fn check(rod: &Rod, object: &Object, options: &Options) -> Result<(), Error> {
    rod.check()?;
    options.priors.check()?;
    match options.mu {
        Some(seen) if seen.is_nan() => return Err(Error::NotFinite { what: "the coefficient of friction" }),
        Some(seen) if seen < 0.0 => {
            return Err(Error::Negative { what: "the coefficient of friction", seen });
        }
        _ => {}
    }
    match object {
        Object::Known(shape) | Object::KnownSize(shape) | Object::KnownClass(shape) => shape.check(),
        Object::Unknown | Object::Unclassified => Ok(()),
    }
}

/// Calibrates the rig of `rod` and `cell` from `samples`, in the order they were taken.
///
/// The roles of the samples (free, mid or tip) are determined. With an [`Object`], a first fit is made without it, then one with it.
///
/// # Errors
/// An invalid rod, shape, prior or μ; fewer than three informative samples; equations that do not converge.
pub fn calibrate(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    object: &Object,
    options: &Options,
) -> Result<Calibrated, Error> {
    check(rod, object, options)?;
    let job = Job::new(rod, cell, samples, options);
    let before = job.without_object()?;
    if *object == Object::Unclassified {
        return Ok(match classes::classified(&job, &before) {
            Ok(best) => job.answer(best.outcome, &best.object, Some(&best.outline)),
            Err(unknown_reason) => Calibrated {
                unknown_reason: Some(unknown_reason),
                ..job.answer(before, &Object::Unknown, None)
            },
        });
    }
    let Some(outline) = Outline::of(object) else { return Ok(job.answer(before, object, None)) };
    let outcome = job.with_object(&outline, &before.fitted, &before.roles)?;
    Ok(job.answer(outcome, object, Some(&outline)))
}

impl Calibrated {
    /// The number of samples of each role.
    pub fn counts(&self) -> Counts {
        let of = |role: Role| self.roles.iter().filter(|r| **r == role).count();
        Counts { free: of(Role::Free), mid: of(Role::Mid), tip: of(Role::Tip), unused: of(Role::Unused) }
    }
}
