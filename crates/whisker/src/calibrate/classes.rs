//! An object of unknown class: every class is fitted together with the rig, and the one that explains the record is taken, if only
//! one does. A wrong class would turn its misfit into a wrong rig; so where none or two explain it, the object is left out.

use super::job::{Job, Outcome};
use super::outline::Outline;
use super::{Object, Role, UnknownReason, roles};
use crate::estimate::{Mode, Status, estimate};
use crate::identify::{Class, Config, Touch, identify};
use crate::{Sample, Shape};

/// A class is excluded where its BIC is this much worse: odds of 148 to 1, as for identification.
const DECIDED_BIC: f64 = 10.0;

/// A fit with one class of object.
pub struct Candidate {
    /// The object at the start of the fit.
    pub object: Object,
    /// Its outline.
    pub outline: Outline,
    /// The fit.
    pub outcome: Outcome,
}

/// The fit with the class that explains the record, or why there is none.
pub fn classified(job: &Job, before: &Outcome) -> Result<Candidate, UnknownReason> {
    let touches = touches(job, before);
    let fits = [Class::Circle, Class::Ellipse, Class::Rectangle].into_iter().filter_map(|class| {
        let object = Object::KnownClass(start(&touches, class)?);
        let outline = Outline::of(&object)?;
        let outcome = job.with_object(&outline, &before.fitted, &before.roles).ok()?;
        Some(Candidate { object, outline, outcome })
    });
    let mut fits: Vec<(f64, Candidate)> = fits.map(|fit| (bic(&fit), fit)).collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut fits = fits.into_iter();
    let Some((best_bic, best)) = fits.next() else { return Err(UnknownReason::NoShapeFits { p_value: 0.0 }) };
    if !best.outcome.is_consistent(job.options.false_alarm_rate) {
        return Err(UnknownReason::NoShapeFits { p_value: best.outcome.p_value() });
    }
    let alternative = fits.find(|(_, fit)| best.outline.is_smooth() != fit.outline.is_smooth());
    match alternative {
        Some((bic, _)) if bic - best_bic < DECIDED_BIC => {
            Err(UnknownReason::TwoShapesFit { delta_bic: bic - best_bic, needed: DECIDED_BIC })
        }
        _ => Ok(best),
    }
}

/// Misfit beyond its expectation, what was left out at the gate, and the price of the parameters.
fn bic(fit: &Candidate) -> f64 {
    let equations = fit.outcome.fitted.degrees_of_freedom as f64;
    let contradicted = fit.outcome.contradicted as f64;
    fit.outcome.fitted.chi2 - equations
        + contradicted * roles::GATE
        + fit.outline.count() as f64 * equations.max(1.0).ln()
}

/// The best shape of one class, where the contacts have one.
fn start(touches: &[Touch], class: Class) -> Option<Shape> {
    let config = Config { classes: vec![class], ..Config::default() };
    let shape = identify(touches, &config).ok()?.shape?;
    let is_of_class = match class {
        Class::Circle => matches!(shape, Shape::Circle { .. }),
        Class::Ellipse => matches!(shape, Shape::Ellipse { .. }),
        _ => matches!(shape, Shape::Rectangle { .. }),
    };
    is_of_class.then_some(shape)
}

/// The contacts as evidence for identification, under the rig as fitted without an object.
fn touches(job: &Job, before: &Outcome) -> Vec<Touch> {
    let calibration = job.calibration(&before.fitted);
    let (rod, cell) = (calibration.rod(), calibration.apply_to_cell(job.cell));
    let touch = |(sample, role): (&Sample, &Role)| {
        let mode = match role {
            Role::Mid => Mode::Mid,
            Role::Tip => Mode::Tip,
            Role::Free | Role::Unused => return None,
        };
        let meant = calibration.apply(sample);
        let seen = estimate(&rod, &cell, &meant, job.options.method);
        let touch = Touch::from_estimate(sample.sweep, meant.load.mz_n_m, &seen, &rod)?;
        // The role was decided along the whole sweep, whereas the estimate's own mode and status use one sample.
        Some(Touch { mode, status: Status::Ok, ..touch })
    };
    job.samples.iter().zip(&before.roles).filter_map(touch).collect()
}
