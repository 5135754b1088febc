//! The answer of `identify` as a JSON object.

use super::{CLASSES, model_name, verdict_name};
use crate::files::object::OutlineObject;
use crate::identify::{Coverage, Identification, Parameter, Reason, Score, Verdict};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// The object behind the contacts, world frame, or what is missing to name it. Numbers that are not bounded are null.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct IdentificationObject {
    /// Its class, or `insufficient_coverage`.
    #[schemars(extend("enum" = verdicts()))]
    verdict: &'static str,
    /// Its outline; without a class that of the best hypothesis, null where none fits.
    object: Option<OutlineObject>,
    /// The parameters of the outline by their names, which end in their units.
    parameters: BTreeMap<String, ParameterObject>,
    /// Rows and columns of `covariance`.
    parameter_order: Vec<String>,
    /// Of the parameters, row by row: m², m rad, rad².
    covariance: Vec<Vec<Option<f64>>>,
    /// All hypotheses, the best first.
    scores: Vec<HypothesisObject>,
    /// The part of the object that was touched.
    coverage: CoverageObject,
    /// χ² per degree of freedom of the best hypothesis.
    #[serde(rename = "chi2_per_dof")]
    chi2_per_degree_of_freedom: Option<f64>,
    /// Whether the best hypothesis explains the contacts.
    fits: bool,
    /// Why nothing is decided; null with a class.
    reason: Option<ReasonObject>,
    /// A further sweep that would decide; empty with a class.
    advice: String,
}

/// A parameter of the outline.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct ParameterObject {
    /// In `unit`.
    value: f64,
    /// Standard deviation.
    sigma: Option<f64>,
    /// Of both.
    #[schemars(extend("enum" = ["m", "rad"]))]
    unit: &'static str,
}

/// How one hypothesis fares.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct HypothesisObject {
    /// A class, `corner`, or `polygon_N` with N corners.
    model: String,
    /// Of its outline.
    n_parameters: usize,
    /// Bayesian information criterion; lower is better.
    bic: Option<f64>,
    /// Sum of the squared distances to the outline in standard deviations, each bounded as an outlier's is.
    chi2: Option<f64>,
    /// The same over the contacts that are no outliers to it, by degree of freedom.
    #[serde(rename = "chi2_per_dof")]
    chi2_per_degree_of_freedom: Option<f64>,
    /// Contacts that are outliers to it.
    n_outliers: usize,
}

/// The part of the object that was touched.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
struct CoverageObject {
    /// Directions of outward normals seen between clamp and tip: from, to, counter-clockwise from the world's x axis, radians.
    normals_range_rad: Option<[f64; 2]>,
    /// Arcs inside that range without a contact: from, to, radians.
    gaps_rad: Vec<[f64; 2]>,
    /// Corners that the whisker rotated about: x and y, metres.
    corners_seen_m: Vec<[f64; 2]>,
    /// Faces that the whisker lay on.
    faces_seen: usize,
    /// Contacts at the tip among those used.
    tip_contacts: usize,
    /// Contacts used.
    used: usize,
    /// Contacts not used: their status, their uncertainty, or outliers.
    gated: usize,
}

/// Why nothing is decided.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum ReasonObject {
    /// Fewer contacts than any class needs, or none between clamp and tip.
    TooFewContacts {
        /// Usable ones.
        seen: usize,
        /// Usable ones that are needed.
        needed: usize,
    },
    /// Everything seen is one place that the whisker leaned on: a corner of anything, or a small disc.
    OneCorner {
        /// x and y, metres.
        corner_m: [f64; 2],
        /// m².
        covariance_m2: [[f64; 2]; 2],
        /// The radius of curvature there is below this, metres.
        radius_bound_m: Option<f64>,
    },
    /// Two hypotheses explain the contacts about equally well.
    TwoHypotheses {
        /// The better hypothesis.
        best: String,
        /// The second one.
        #[serde(rename = "rival")]
        alternative: String,
        /// How much worse its BIC is.
        delta_bic: Option<f64>,
        /// How much worse it would have to be.
        needed: f64,
    },
    /// The ratio of the axes, or of the sides, is not known well enough to call them equal or different.
    RatioOpen {
        /// The better hypothesis.
        best: String,
        /// The ratio that is not excluded, or its inverse.
        ratio: f64,
        /// How much worse that ratio explains the contacts.
        delta_chi2: Option<f64>,
        /// How much worse it would have to be.
        needed: f64,
    },
    /// Fewer sides of the object were touched than a polygon needs to be closed.
    SidesUnseen {
        /// Arc of outward normals seen, radians.
        seen_rad: f64,
        /// Radians.
        needed_rad: f64,
    },
    /// No hypothesis explains the contacts.
    NothingFits {
        /// Of the best.
        #[serde(rename = "chi2_per_dof")]
        chi2_per_degree_of_freedom: Option<f64>,
        /// Share of the contacts that are outliers to it, 0 to 1.
        outlier_share: f64,
    },
}

fn verdicts() -> Vec<&'static str> {
    let all = CLASSES.map(Verdict::Is).into_iter().chain([Verdict::InsufficientCoverage]);
    all.map(verdict_name).collect()
}

/// JSON has no word for infinity.
fn finite(x: f64) -> Option<f64> {
    Some(x).filter(|x| x.is_finite())
}

fn rows(m: &DMatrix<f64>) -> Vec<Vec<Option<f64>>> {
    m.row_iter().map(|row| row.iter().copied().map(finite).collect()).collect()
}

impl From<&Identification> for IdentificationObject {
    fn from(answer: &Identification) -> Self {
        IdentificationObject {
            verdict: verdict_name(answer.verdict),
            object: answer.shape.as_ref().map(OutlineObject::from),
            parameters: answer.parameters.iter().map(|p| (p.name.clone(), p.into())).collect(),
            parameter_order: answer.parameters.iter().map(|p| p.name.clone()).collect(),
            covariance: rows(&answer.covariance),
            scores: answer.scores.iter().map(HypothesisObject::from).collect(),
            coverage: (&answer.coverage).into(),
            chi2_per_degree_of_freedom: finite(answer.chi2_per_degree_of_freedom),
            fits: answer.fits,
            reason: answer.reason.as_ref().map(ReasonObject::from),
            advice: answer.advice.clone(),
        }
    }
}

impl From<&Parameter> for ParameterObject {
    fn from(p: &Parameter) -> Self {
        ParameterObject { value: p.value, sigma: finite(p.sigma), unit: p.unit }
    }
}

impl From<&Score> for HypothesisObject {
    fn from(score: &Score) -> Self {
        HypothesisObject {
            model: model_name(score.model),
            n_parameters: score.n_parameters,
            bic: finite(score.bic),
            chi2: finite(score.chi2),
            chi2_per_degree_of_freedom: finite(score.chi2_per_degree_of_freedom),
            n_outliers: score.n_outliers,
        }
    }
}

impl From<&Coverage> for CoverageObject {
    fn from(coverage: &Coverage) -> Self {
        CoverageObject {
            normals_range_rad: coverage.normals_range_rad,
            gaps_rad: coverage.gaps_rad.clone(),
            corners_seen_m: coverage.corners_seen.iter().map(|corner| (*corner).into()).collect(),
            faces_seen: coverage.faces_seen,
            tip_contacts: coverage.tip_contacts,
            used: coverage.used,
            gated: coverage.gated,
        }
    }
}

impl From<&Reason> for ReasonObject {
    fn from(reason: &Reason) -> Self {
        match *reason {
            Reason::TooFewContacts { seen, needed } => ReasonObject::TooFewContacts { seen, needed },
            Reason::OneCorner { corner_in_world, covariance, radius_bound_m } => ReasonObject::OneCorner {
                corner_m: corner_in_world.into(),
                covariance_m2: covariance.into(), // Symmetric: columns are rows.
                radius_bound_m: finite(radius_bound_m),
            },
            Reason::TwoHypotheses { best, alternative, delta_bic, needed } => ReasonObject::TwoHypotheses {
                best: model_name(best),
                alternative: model_name(alternative),
                delta_bic: finite(delta_bic),
                needed,
            },
            Reason::RatioOpen { best, ratio, delta_chi2, needed } => ReasonObject::RatioOpen {
                best: model_name(best),
                ratio,
                delta_chi2: finite(delta_chi2),
                needed,
            },
            Reason::SidesUnseen { seen_rad, needed_rad } => {
                ReasonObject::SidesUnseen { seen_rad, needed_rad }
            }
            Reason::NothingFits { chi2_per_degree_of_freedom, outlier_share } => ReasonObject::NothingFits {
                chi2_per_degree_of_freedom: finite(chi2_per_degree_of_freedom),
                outlier_share,
            },
        }
    }
}
