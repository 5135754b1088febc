//! object.json: what was touched, as `identify` says it; `read` of `object` takes it back.

mod object;

pub use object::IdentificationObject;

use super::contacts::{ContactRow, RowStatus};
use crate::estimate::Status;
use crate::identify::{Class, Model, Reason, Touch, Verdict};
use nalgebra::Vector2;

const CLASSES: [Class; 5] = [Class::Circle, Class::Ellipse, Class::Square, Class::Rectangle, Class::Polygon];

/// The word for a class.
pub fn class_name(class: Class) -> &'static str {
    match class {
        Class::Circle => "circle",
        Class::Ellipse => "ellipse",
        Class::Square => "square",
        Class::Rectangle => "rectangle",
        Class::Polygon => "polygon",
    }
}

/// The class of a word; `rect` is short for rectangle.
pub fn parse_class(word: &str) -> Option<Class> {
    let word = if word == "rect" { "rectangle" } else { word };
    CLASSES.into_iter().find(|class| class_name(*class) == word)
}

/// The word for a hypothesis.
pub fn model_name(model: Model) -> String {
    match model {
        Model::Corner => "corner".to_string(),
        Model::Circle => "circle".to_string(),
        Model::Ellipse => "ellipse".to_string(),
        Model::Square => "square".to_string(),
        Model::Rectangle => "rectangle".to_string(),
        Model::Polygon { corners } => format!("polygon_{corners}"),
    }
}

/// The word for a verdict.
pub fn verdict_name(verdict: Verdict) -> &'static str {
    match verdict {
        Verdict::Is(class) => class_name(class),
        Verdict::InsufficientCoverage => "insufficient_coverage",
    }
}

/// A row as evidence; none where it has no place. The outline is the whisker's radius off its centre line.
pub fn touch(row: &ContactRow) -> Option<Touch> {
    let (figures, side) = (row.figures?, row.side?.moment_sign());
    let RowStatus::Read(status) = row.status else { return None };
    let (sin, cos) = figures.theta_rad.sin_cos();
    let normal = Vector2::new(-sin, cos) * side;
    let c = figures.covariance;
    let is_known = c.iter().all(|x| x.is_finite());
    let covariance =
        if is_known { c } else { Touch::covariance_without_theta(&c.fixed_view::<2, 2>(0, 0).into_owned()) };
    Some(Touch {
        sweep: row.sweep,
        x_in_world: figures.x_in_world - normal * figures.radius_m,
        theta_rad: figures.theta_rad,
        side,
        mode: row.mode,
        covariance,
        status: if covariance.iter().all(|x| x.is_finite()) { status } else { Status::LowForce },
    })
}

/// Why nothing is decided, as a sentence.
pub fn reason_in_words(reason: &Reason) -> String {
    match reason {
        Reason::TooFewContacts { seen, needed } => format!("{seen} usable contacts, {needed} are needed"),
        Reason::OneCorner { corner_in_world, radius_bound_m, .. } => format!(
            "the whisker leaned on one place only: a corner at ({:.2}, {:.2}) mm, or an outline whose radius there is below {:.2} mm",
            1e3 * corner_in_world.x,
            1e3 * corner_in_world.y,
            1e3 * radius_bound_m
        ),
        Reason::TwoHypotheses { best, alternative, delta_bic, needed } => format!(
            "{} and {} explain the contacts about equally well (BIC difference {delta_bic:.1}, {needed:.1} needed)",
            model_name(*best),
            model_name(*alternative)
        ),
        Reason::RatioOpen { best, ratio, delta_chi2, needed } => format!(
            "{} fits best, but an aspect ratio of {ratio:.2} is not excluded (chi2 difference {delta_chi2:.1}, {needed:.1} needed)",
            model_name(*best)
        ),
        Reason::SidesUnseen { seen_rad, needed_rad } => format!(
            "outward normals over {:.0}° were seen, {:.0}° are needed to close a polygon",
            seen_rad.to_degrees(),
            needed_rad.to_degrees()
        ),
        Reason::NothingFits { chi2_per_degree_of_freedom, outlier_share } => format!(
            "no outline explains the contacts (chi2 per degree of freedom {chi2_per_degree_of_freedom:.2}, {:.0} % outliers): wrong stiffness, zeros or gains, or no single convex object; calibrate first",
            100.0 * outlier_share
        ),
    }
}
