//! Whether a record agrees with itself: constraints pooled over it, and the effect of a wrong calibration on them.
//!
//! Rows: the friction and tip residual of every sample; the outline of one sweep where another has the same normals. Faults: gains, zeros, angles and offsets, each by the score of the rows along its
//! derivative. One fault explains a record better than noise: the record is inconsistent, and so is every contact that the fault
//! would have moved by more than its own uncertainty. docs/math/whisker_events.md eqs. (16)–(19).

mod fault;
mod rows;

pub use fault::Fault;

use crate::contact::Method;
use crate::estimate::{Contact, Mode, Status};
use crate::friction::{Constraint, Mu, Record, project, solve_record, sound};
use crate::{Cell, Rod, Sample};
use nalgebra::{DVector, SMatrix, Vector3};
use resight_core::statistics::chi_square;
use rows::Rows;

/// Chance that a right record is called inconsistent: of all its tests together.
pub const FALSE_ALARM: f64 = 1e-3;
/// A contact that the fault would have moved further than this many of its own sigmas is not ok.
pub const MOVED_SIGMAS: f64 = 1.0;

/// Nine faults by nine.
pub type FaultMatrix = SMatrix<f64, 9, 9>;

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

/// The consistency of a record.
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
    /// Information of the record on all faults together, in the order of [`Fault::ALL`], per square of their units, the friction angle
    /// fitted.
    pub information: FaultMatrix,
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
    let by_faults: Vec<(Fault, DVector<f64>)> = Fault::ALL
        .into_iter()
        .filter_map(|fault| {
            let by_fault = rows.whitened(rows.by_fault(samples, record.friction.rad, fault)?)?;
            Some((fault, by_fault))
        })
        .collect();
    let mut suspicions: Vec<Suspicion> =
        by_faults.iter().filter_map(|(fault, by)| whitened.suspicion(*fault, by)).collect();
    suspicions.sort_by(|a, b| b.chi2.total_cmp(&a.chi2));
    let tests = 1 + suspicions.len();
    let least = suspicions.first().map_or(1.0, |first| chi_square::tail(1, first.chi2)).min(p_value);
    let is_inconsistent = least < FALSE_ALARM / tests as f64;
    let information = whitened.information(&by_faults);
    Some(Consistency { chi2, degrees_of_freedom, p_value, suspicions, information, is_inconsistent })
}

/// Marks what the verdict takes from a record's contacts: where the record, solved again without the most likely fault, has a contact
/// elsewhere by more than [`MOVED_SIGMAS`] of its uncertainty, or where no single fault explains the contradiction, an ok contact
/// becomes `Inconsistent`. Returns how many did.
pub fn flag(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    record: &mut Record,
    verdict: &Consistency,
    mu: Mu,
    method: Method,
) -> usize {
    if !verdict.is_inconsistent {
        return 0;
    }
    let gate = FALSE_ALARM / (1 + verdict.suspicions.len()) as f64;
    let likely = verdict.suspicions.first().filter(|first| chi_square::tail(1, first.chi2) < gate);
    let right = likely.and_then(|suspicion| {
        let right: Vec<_> = samples.iter().map(|s| suspicion.fault.taken_off(s, suspicion.size)).collect();
        solve_record(rod, cell, &right, mu, method).ok()
    });
    let mut marked = 0;
    for (i, estimate) in record.estimates.iter_mut().enumerate() {
        let (Status::Ok, Some(contact)) = (estimate.status, &estimate.contact) else { continue };
        let moved =
            right.as_ref().and_then(|right| moved_chi2(contact, right.estimates[i].contact.as_ref()?));
        if moved.is_none_or(|moved| MOVED_SIGMAS.powi(2) < moved) {
            estimate.status = Status::Inconsistent;
            marked += 1;
        }
    }
    marked
}

/// Squared distance of a contact from where it was, in its own covariance.
fn moved_chi2(contact: &Contact, right: &Contact) -> Option<f64> {
    let shift = right.x_in_world - contact.x_in_world;
    let weight = contact.covariance.fixed_view::<2, 2>(0, 0).into_owned().try_inverse()?;
    Some(shift.dot(&(weight * shift)))
}

/// Widens the contacts' covariances by what the record cannot exclude of faults that are known to lie within `tolerances` (standard
/// deviations in the order of [`Fault::ALL`]; [`Fault::tolerance`] gives typical ones): their covariance after the record, through the
/// contacts' derivatives by them, eq. (19). Contacts then are as sure as calibration and record together make them.
pub fn widen(
    rod: &Rod,
    cell: &Cell,
    samples: &[Sample],
    record: &mut Record,
    verdict: &Consistency,
    tolerances: &[f64; 9],
    method: Method,
) {
    let cell = sound(rod, cell);
    let known = FaultMatrix::from_fn(|i, j| if i == j { tolerances[i].max(1e-12).powi(-2) } else { 0.0 });
    let Some(left) = (verdict.information + known).try_inverse() else { return };
    for (sample, estimate) in samples.iter().zip(record.estimates.iter_mut()) {
        let constraint = rows::constraint(estimate.mode == Mode::Tip, record.friction);
        let (Status::Ok, Some(contact)) = (estimate.status, estimate.contact.as_mut()) else { continue };
        let by_faults = by_faults(rod, &cell, sample, constraint, method);
        contact.covariance += by_faults * left * by_faults.transpose();
    }
}

/// Derivatives of a contact's `[x, y, θ]` by every fault; zero where a neighbour has no contact.
fn by_faults(
    rod: &Rod,
    cell: &Cell,
    sample: &Sample,
    constraint: Constraint,
    method: Method,
) -> SMatrix<f64, 3, 9> {
    let place = |fault: Fault, size: f64| -> Option<Vector3<f64>> {
        let right = fault.taken_off(sample, size);
        let at = project(rod, cell, &right, constraint, method).ok()?.at;
        let x = right.world_from_hub.apply(at.x_in_hub);
        Some(Vector3::new(x.x, x.y, right.world_from_hub.angle_rad + at.theta_rad))
    };
    let columns = Fault::ALL.map(|fault| {
        let step = fault.step(cell);
        let ends = (place(fault, -step), place(fault, step));
        ends.0.zip(ends.1).map_or(Vector3::zeros(), |(plus, minus)| (plus - minus) / (2.0 * step))
    });
    SMatrix::from_columns(&columns)
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

    fn information(&self, by_faults: &[(Fault, DVector<f64>)]) -> FaultMatrix {
        let rows: Vec<(usize, DVector<f64>)> = by_faults
            .iter()
            .filter_map(|(fault, by)| {
                let index = Fault::ALL.iter().position(|other| other == fault)?;
                Some((index, self.without_friction(by)))
            })
            .collect();
        let mut information = FaultMatrix::zeros();
        for (i, by_i) in &rows {
            for (j, by_j) in &rows {
                information[(*i, *j)] = by_i.dot(by_j);
            }
        }
        information
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
