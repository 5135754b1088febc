//! Does a record agree with itself? Constraints pooled over it, and what a wrong calibration would do to them.
//!
//! Rows: the friction and tip residual of every sample; the outline of one sweep where another has the same normals. Faults: gains, zeros, angles and offsets, each by the score of the rows along its
//! derivative. One fault explains a record better than noise: the record is inconsistent, and so is every contact that the fault
//! would have moved by more than its own uncertainty. docs/math/whisker_events.md eqs. (15)–(19).

mod fault;
mod rows;

pub use fault::Fault;

use crate::contact::Method;
use crate::estimate::{Mode, Status};
use crate::friction::{Record, sound};
use crate::{Cell, Rod, Sample};
use nalgebra::{DVector, Vector2};
use resight_core::frames::chi_square;
use rows::Rows;

/// Chance that a right record is called inconsistent: of all its tests together.
pub const FALSE_ALARM: f64 = 1e-3;
/// A contact that the fault would have moved further than this many of its own sigmas is not ok.
pub const MOVED_SIGMAS: f64 = 1.0;

/// One fault against the record.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Suspicion {
    /// Which.
    pub fault: Fault,
    /// Its size that explains the record best, in the fault's own unit.
    pub size: f64,
    /// Standard deviation of `size`: three times this is what the record would have shown. Infinite sizes are left out: a fault
    /// that the record cannot show has no suspicion.
    pub sigma: f64,
    /// (size/sigma)², χ² with 1 degree of freedom for a right record.
    pub chi2: f64,
}

/// What a record says of itself.
#[derive(Debug, Clone, PartialEq)]
pub struct Consistency {
    /// χ² of all rows, the friction angle fitted.
    pub chi2: f64,
    /// Its degrees of freedom.
    pub degrees_of_freedom: usize,
    /// Chance of such a χ² in a right record.
    pub p_value: f64,
    /// Every fault that the record can show, the most likely first.
    pub suspicions: Vec<Suspicion>,
    /// Whether the record contradicts itself: with probability [`FALSE_ALARM`] though it be right.
    pub is_inconsistent: bool,
}

/// Tests a record. `same_object` says that all sweeps touch one object that does not move: then their outlines must agree. None with
/// fewer than ten usable contacts: so few say nothing.
pub fn consistency(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    record: &Record,
    same_object: bool,
    method: Method,
) -> Option<Consistency> {
    let cell = sound(rod, cell);
    let rows = Rows::new(rod, &cell, samples, record, same_object, method)?;
    let values = rows.whitened(rows.values(samples, record.friction.rad)?)?;
    let by_friction = rows.whitened(rows.by_friction(samples, record.friction.rad)?)?;
    let whitened = Whitened::new(values, by_friction, record.mu_sigma);
    let chi2 = whitened.chi2();
    let degrees_of_freedom = rows.len().saturating_sub(usize::from(0.0 < record.mu_sigma));
    let p_value = chi_square::tail(degrees_of_freedom, chi2);
    let mut suspicions: Vec<Suspicion> = Fault::ALL
        .into_iter()
        .filter_map(|fault| {
            let by_fault = rows.whitened(rows.by_fault(samples, record.friction.rad, fault)?)?;
            whitened.suspicion(fault, &by_fault)
        })
        .collect();
    suspicions.sort_by(|a, b| b.chi2.total_cmp(&a.chi2));
    let tests = 1 + suspicions.len();
    let least = suspicions.first().map_or(1.0, |first| chi_square::tail(1, first.chi2)).min(p_value);
    let is_inconsistent = least < FALSE_ALARM / tests as f64;
    Some(Consistency { chi2, degrees_of_freedom, p_value, suspicions, is_inconsistent })
}

/// Marks what the verdict takes from a record's contacts: where the most likely fault would have moved a contact by more than
/// [`MOVED_SIGMAS`] of its uncertainty, or where no single fault explains the contradiction, an ok contact becomes `Inconsistent`.
/// Returns how many did.
pub fn mark(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    record: &mut Record,
    verdict: &Consistency,
    method: Method,
) -> usize {
    if !verdict.is_inconsistent {
        return 0;
    }
    let cell = sound(rod, cell);
    let first = verdict.suspicions.first();
    let explains =
        first.filter(|first| chi_square::tail(1, first.chi2) < FALSE_ALARM / verdict.suspicions.len() as f64);
    let mut marked = 0;
    for (sample, estimate) in samples.iter().zip(record.estimates.iter_mut()) {
        let (Status::Ok, Some(contact)) = (estimate.status, &estimate.contact) else { continue };
        let moved = explains.and_then(|suspicion| {
            let right = suspicion.fault.taken_off(sample, suspicion.size);
            let constraint = rows::constraint(estimate.mode == Mode::Tip, record.friction);
            let at = crate::friction::project(rod, &cell, &right, constraint, method).ok()?;
            let shift: Vector2<f64> = right.world_from_hub.apply(at.at.x_in_hub) - contact.x_in_world;
            let weight = contact.covariance.fixed_view::<2, 2>(0, 0).into_owned().try_inverse()?;
            Some(shift.dot(&(weight * shift)))
        });
        if moved.is_none_or(|moved| MOVED_SIGMAS.powi(2) < moved) {
            estimate.status = Status::Inconsistent;
            marked += 1;
        }
    }
    marked
}

/// Rows of unit variance, the friction angle's share taken out where it was fitted.
struct Whitened {
    residual: DVector<f64>,
    /// Of unit length; none where μ was given.
    by_friction: Option<DVector<f64>>,
}

impl Whitened {
    fn new(values: DVector<f64>, by_friction: DVector<f64>, mu_sigma: f64) -> Self {
        let is_fitted = 0.0 < mu_sigma && 0.0 < by_friction.norm();
        let mut whitened =
            Whitened { residual: values, by_friction: is_fitted.then(|| by_friction.normalize()) };
        whitened.residual = whitened.without_friction(&whitened.residual);
        whitened
    }

    fn without_friction(&self, rows: &DVector<f64>) -> DVector<f64> {
        match &self.by_friction {
            Some(by) => rows - by * by.dot(rows),
            None => rows.clone(),
        }
    }

    fn chi2(&self) -> f64 {
        self.residual.norm_squared()
    }

    /// Eq. (18): the score along the fault's derivative.
    fn suspicion(&self, fault: Fault, by_fault: &DVector<f64>) -> Option<Suspicion> {
        let by = self.without_friction(by_fault);
        let information = by.norm_squared();
        // What the friction angle mimics to a part in a thousand is not the fault's to show.
        if !(1e-6 * by_fault.norm_squared() < information) {
            return None;
        }
        let size = by.dot(&self.residual) / information;
        let sigma = information.powf(-0.5);
        Some(Suspicion { fault, size, sigma, chi2: (size / sigma).powi(2) })
    }
}
