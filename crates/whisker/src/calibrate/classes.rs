//! An object of unknown class: every class is fitted together with the rig, and the one that explains the record is taken, if only
//! one does. A wrong class would turn its misfit into a wrong rig; so where none or two explain it, the object is left out.

use super::fit::Fitted;
use super::job::Job;
use super::outline::Outline;
use super::{Doubt, Object, Role, roles};
use crate::estimate::{Mode, Status, estimate};
use crate::identify::{Class, Config, Touch, identify};
use crate::{Sample, Shape};
use resight_core::frames::chi_square::tail;

/// A class is excluded where its BIC is this much worse: odds of 148 to 1, as for identification.
const DECIDED_BIC: f64 = 10.0;

/// A fit with one class of object.
pub struct Candidate {
    /// The object at the start of the fit.
    pub object: Object,
    /// Its outline.
    pub outline: Outline,
    /// The fit.
    pub fitted: Fitted,
    /// What every sample was taken for.
    pub roles: Vec<Role>,
}

/// The fit with the class that explains the record, or why there is none.
pub fn classified(job: &Job, before: &Fitted, roles: &[Role]) -> Result<Candidate, Doubt> {
    let touches = touches(job, before, roles);
    let fits = [Class::Circle, Class::Ellipse, Class::Rectangle].into_iter().filter_map(|class| {
        let object = Object::KnownClass(start(&touches, class)?);
        let outline = Outline::of(&object)?;
        let (fitted, roles) = job.with_object(&outline, before, roles.to_vec()).ok()?;
        Some(Candidate { object, outline, fitted, roles })
    });
    let mut fits: Vec<(f64, Candidate)> = fits.map(|fit| (bic(&fit), fit)).collect();
    fits.sort_by(|a, b| a.0.total_cmp(&b.0));
    let mut fits = fits.into_iter();
    let Some((best_bic, best)) = fits.next() else { return Err(Doubt::NoShapeFits { p_value: 0.0 }) };
    let p_value = tail(best.fitted.degrees_of_freedom, best.fitted.chi2);
    let lost = roles.iter().zip(&best.roles).filter(|(before, after)| before != after).count();
    let contacts = roles.iter().filter(|role| matches!(role, Role::Mid | Role::Tip)).count();
    if p_value < job.options.false_alarm_rate || LOST * (contacts as f64) < lost as f64 {
        return Err(Doubt::NoShapeFits { p_value });
    }
    let rival = fits.find(|(_, fit)| best.outline.is_smooth() != fit.outline.is_smooth());
    match rival {
        Some((bic, _)) if bic - best_bic < DECIDED_BIC => {
            Err(Doubt::TwoShapesFit { delta_bic: bic - best_bic, needed: DECIDED_BIC })
        }
        _ => Ok(best),
    }
}

/// A class that has to leave out more than this share of the contacts does not explain them.
const LOST: f64 = 0.05;

/// Misfit beyond its expectation, what was left out at the gate, and the price of the parameters.
fn bic(fit: &Candidate) -> f64 {
    let equations = fit.fitted.degrees_of_freedom as f64;
    let unused = fit.roles.iter().filter(|role| **role == Role::Unused).count() as f64;
    fit.fitted.chi2 - equations + unused * roles::GATE + fit.outline.count() as f64 * equations.max(1.0).ln()
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
fn touches(job: &Job, fitted: &Fitted, roles: &[Role]) -> Vec<Touch> {
    let calibration = job.calibration(fitted);
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
        // The role was decided along the whole sweep, the estimate's own mode and status from one sample.
        Some(Touch { mode, status: Status::Ok, ..touch })
    };
    job.samples.iter().zip(roles).filter_map(touch).collect()
}
