//! The object that was touched: the simplest convex one that explains the contacts, or the data that are missing.
//!
//! A contact between clamp and tip gives a supporting line: the object lies on one side of the whisker's tangent and touches it.
//! The contact's worst error, along the whisker, moves the line along itself (docs/math/whisker_identify.md).

pub mod touch;
mod row;
mod outline;
mod state;
mod fit;
mod start;
mod candidates;
mod report;
mod decide;
#[cfg(test)]
mod tests;

pub use touch::Touch;

use crate::{Error, Shape};
use candidates::{Candidate, Candidates, Evidence};
use fit::Search;
use nalgebra::{DMatrix, Vector2};
use row::Row;
use start::Lines;

/// The classes of objects.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    /// A disc.
    Circle,
    /// An ellipse that is no circle.
    Ellipse,
    /// A rectangle of equal sides.
    Square,
    /// A rectangle that is no square.
    Rectangle,
    /// A convex polygon that is no rectangle.
    Polygon,
}

/// The answer in one word.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Verdict {
    /// The object is of this class.
    Is(Class),
    /// The contacts do not decide; `Coverage` states what is known and what is missing.
    InsufficientCoverage,
}

/// How one hypothesis fares.
#[derive(Debug, Clone, PartialEq)]
pub struct Score {
    /// The hypothesis.
    pub model: Model,
    /// Its parameters' number.
    pub n_parameters: usize,
    /// Sum over the contacts of the squared distance to the outline in standard deviations, each bounded as an outlier's is.
    pub chi2: f64,
    /// The same over the contacts that are no outliers to it, by degree of freedom.
    pub chi2_per_degree_of_freedom: f64,
    /// Contacts that are outliers to it.
    pub n_outliers: usize,
    /// Bayesian information criterion: chi2, divided by the excess noise, + n_parameters · ln(contacts). Lower is better; a
    /// difference of 2 ln(odds).
    pub bic: f64,
}

/// A hypothesis.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Model {
    /// One point that every whisker leans on: a sharp corner, or a circle of no radius.
    Corner,
    /// Disc: centre, radius.
    Circle,
    /// Ellipse: centre, semi-axes, angle.
    Ellipse,
    /// Square: centre, side, angle.
    Square,
    /// Rectangle: centre, sides, angle.
    Rectangle,
    /// Hull of so many corners: their places.
    Polygon {
        /// How many; 2: a thin plate.
        corners: usize,
    },
}

/// A parameter of the answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Parameter {
    /// Its name, with its unit.
    pub name: String,
    /// Its value.
    pub value: f64,
    /// Its standard deviation.
    pub sigma: f64,
    /// `m` or `rad`.
    pub unit: &'static str,
}

/// The result of a touch, in the order given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Use {
    /// It counts.
    Used,
    /// Its status is not ok.
    NotOk,
    /// Its place along the whisker, or its covariance, is too uncertain to be linearised.
    TooUncertain,
    /// It contradicts the best hypothesis.
    Outlier,
}

/// The part of the object that was touched.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Coverage {
    /// Directions of outward normals seen between clamp and tip: the shortest arc that holds them, `[from, to]`, world, radians,
    /// from < to; none without such a contact.
    pub normals_range_rad: Option<[f64; 2]>,
    /// Arcs inside that range without a contact, wider than [`Config::gap_rad`].
    pub gaps_rad: Vec<[f64; 2]>,
    /// Corners that the whisker rotated about, world, metres; of the answer, or of the best polygon where there is none.
    pub corners_seen: Vec<Vector2<f64>>,
    /// Faces the whisker lay on; of the same polygon.
    pub faces_seen: usize,
    /// Contacts at the tip among those used.
    pub tip_contacts: usize,
    /// Contacts used.
    pub used: usize,
    /// Contacts not used: status, uncertainty, outliers.
    pub gated: usize,
}

/// Why nothing is decided.
#[derive(Debug, Clone, PartialEq)]
pub enum Reason {
    /// Fewer contacts than any class needs, or none between clamp and tip.
    TooFewContacts {
        /// Usable ones.
        seen: usize,
        /// Needed.
        needed: usize,
    },
    /// Everything seen is one place that the whisker leaned on: a corner of anything, or a small disc.
    OneCorner {
        /// Where, world, metres.
        corner_in_world: Vector2<f64>,
        /// Its covariance, m².
        covariance: nalgebra::Matrix2<f64>,
        /// Its radius of curvature is below this, at the confidence of [`Config::decided_bic`], metres.
        radius_bound_m: f64,
    },
    /// Two hypotheses explain the contacts about equally well.
    TwoHypotheses {
        /// The better one.
        best: Model,
        /// The other one.
        alternative: Model,
        /// The excess of the other one.
        delta_bic: f64,
        /// The excess that is needed.
        needed: f64,
    },
    /// The ratio of the axes, or of the sides, is not known well enough to call them equal or different.
    RatioOpen {
        /// The better hypothesis.
        best: Model,
        /// The ratio that is not excluded (or its inverse).
        ratio: f64,
        /// The excess with that ratio.
        delta_chi2: f64,
        /// The excess that is needed.
        needed: f64,
    },
    /// Fewer sides of the object were touched than a polygon needs to be closed.
    SidesUnseen {
        /// Arc of normals seen, radians.
        seen_rad: f64,
        /// Needed.
        needed_rad: f64,
    },
    /// No hypothesis explains the contacts.
    NothingFits {
        /// χ² per degree of freedom of the best.
        chi2_per_degree_of_freedom: f64,
        /// Share of contacts that are outliers to it.
        outlier_share: f64,
    },
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Identification {
    /// In one word.
    pub verdict: Verdict,
    /// Why nothing is decided; none with a class.
    pub reason: Option<Reason>,
    /// A further sweep that would decide; empty with a class.
    pub advice: String,
    /// The object; without a verdict the best hypothesis, if any fits.
    pub shape: Option<Shape>,
    /// Parameters of `shape`, in the order of `covariance`.
    pub parameters: Vec<Parameter>,
    /// Their covariance, m², m·rad, rad²; scaled by the excess noise.
    pub covariance: DMatrix<f64>,
    /// All hypotheses, best first.
    pub scores: Vec<Score>,
    /// What was touched.
    pub coverage: Coverage,
    /// χ² per degree of freedom of the best hypothesis.
    pub chi2_per_degree_of_freedom: f64,
    /// Whether the best hypothesis explains the contacts.
    pub fits: bool,
    /// The result of each touch, in the order given.
    pub uses: Vec<Use>,
}

/// The hypotheses, and the limits of the decision.
#[derive(Debug, Clone, PartialEq)]
pub struct Config {
    /// Classes that may be answered.
    pub classes: Vec<Class>,
    /// A hypothesis is excluded where its BIC is this much worse: odds of exp(10/2) = 148 to 1.
    pub decided_bic: f64,
    /// Axes or sides of this ratio are different things: "circle" and "square" are said only where it is excluded.
    pub material_ratio: f64,
    /// Axes or sides that differ by less than this are not different things, whatever their ratio and however significant, metres.
    pub material_difference_m: f64,
    /// Most corners of a polygon.
    pub max_corners: usize,
    /// A contact whose place along the whisker has a larger standard deviation is not used, metres.
    pub along_sigma_limit_m: f64,
    /// Normals further apart than this leave a gap, radians.
    pub gap_rad: f64,
    /// A polygon is closed only where normals over at least this arc were seen, radians.
    pub polygon_arc_rad: f64,
    /// A model fits where χ² per degree of freedom is at most this.
    pub fits_chi2_per_degree_of_freedom: f64,
    /// A model fits where at most this share of the contacts are outliers to it.
    pub fits_outlier_share: f64,
}

impl Default for Config {
    fn default() -> Self {
        Config {
            classes: vec![Class::Circle, Class::Ellipse, Class::Square, Class::Rectangle, Class::Polygon],
            decided_bic: 10.0,
            material_ratio: 1.15,
            material_difference_m: 1e-3,
            max_corners: 8,
            along_sigma_limit_m: 0.02,
            gap_rad: 10_f64.to_radians(),
            polygon_arc_rad: 150_f64.to_radians(),
            fits_chi2_per_degree_of_freedom: 2.5,
            fits_outlier_share: 0.2,
        }
    }
}

/// The simplest object that explains the touches, or why none is reported.
///
/// Fails only on a configuration that asks for nothing; touches of any kind and number have an answer.
pub fn identify(touches: &[Touch], config: &Config) -> Result<Identification, Error> {
    config.check()?;
    let (rows, mut uses) = prepare(touches, config);
    let origin = Vector2::new(
        start::quantile(rows.iter().map(|row| row.x.x), 0.5),
        start::quantile(rows.iter().map(|row| row.x.y), 0.5),
    );
    let list = start::lines(&rows, origin);
    // Most contacts may crowd at one corner: the far ones say how large the object is.
    let spread =
        start::quantile(rows.iter().map(|row| (row.x - origin).norm()), 0.95).max(start::SMALLEST_SPREAD_M);
    let lines = Lines { list: &list, origin, spread };
    let evidence = Evidence { rows: &rows, search: Search::new(&rows), lines };
    if rows.len() < decide::NEEDED || list.is_empty() {
        let seen = if list.is_empty() { 0 } else { rows.len() };
        return Ok(nothing(&evidence, Reason::TooFewContacts { seen, needed: decide::NEEDED }, uses, config));
    }
    let candidates = Candidates::of(&evidence, config);
    if candidates.list.is_empty() {
        let reason = Reason::NothingFits { chi2_per_degree_of_freedom: f64::INFINITY, outlier_share: 1.0 };
        return Ok(nothing(&evidence, reason, uses, config));
    }
    let decided = decide::decide(&evidence, &candidates, config);
    Ok(answer(&evidence, &candidates, decided, &mut uses, config))
}

impl Config {
    fn check(&self) -> Result<(), Error> {
        if self.classes.is_empty() {
            let way_out = "name at least one of circle, ellipse, square, rectangle, polygon";
            return Err(Error::TooFew { what: "classes", seen: 0, needed: 1, way_out });
        }
        let above_one = self.material_ratio - 1.0;
        let positive = [
            ("the BIC difference that decides", self.decided_bic),
            ("the material ratio less 1", above_one),
            ("the limit of the standard deviation along the whisker", self.along_sigma_limit_m),
        ];
        let wrong = positive.into_iter().find(|(_, seen)| !(0.0 < *seen && seen.is_finite()));
        wrong.map_or(Ok(()), |(what, seen)| Err(Error::NotPositive { what, seen }))
    }
}

fn prepare(touches: &[Touch], config: &Config) -> (Vec<Row>, Vec<Use>) {
    let made: Vec<_> = (0..touches.len()).map(|i| Row::new(i, touches, config)).collect();
    let uses = made.iter().map(|row| row.as_ref().err().copied().unwrap_or(Use::Used)).collect();
    (made.into_iter().flatten().collect(), uses)
}

/// No hypothesis at all.
fn nothing(evidence: &Evidence, reason: Reason, uses: Vec<Use>, config: &Config) -> Identification {
    let mut coverage = report::coverage(evidence, &vec![true; evidence.rows.len()], None, config);
    coverage.gated = uses.len() - coverage.used;
    Identification {
        verdict: Verdict::InsufficientCoverage,
        advice: report::advice(&reason, &coverage),
        reason: Some(reason),
        shape: None,
        parameters: Vec::new(),
        covariance: DMatrix::zeros(0, 0),
        scores: Vec::new(),
        coverage,
        chi2_per_degree_of_freedom: 0.0,
        fits: false,
        uses,
    }
}

fn answer(
    evidence: &Evidence,
    candidates: &Candidates,
    decided: Result<(Class, &Candidate), Reason>,
    uses: &mut Vec<Use>,
    config: &Config,
) -> Identification {
    let chosen = decided.as_ref().map_or(&candidates.list[0], |(_, chosen)| chosen);
    let state = report::natural(&chosen.fit.state);
    let squared = fit::verdicts(evidence.rows, &state).squared;
    let is_used: Vec<bool> = squared.iter().map(|squared| *squared < row::OUTLIER_COST).collect();
    for (row, _) in evidence.rows.iter().zip(&is_used).filter(|(_, used)| !**used) {
        uses[row.index] = Use::Outlier;
    }
    let cornered = match decided {
        Ok(_) => Some(chosen),
        Err(_) => candidates.best(|model| !model.is_smooth()),
    };
    let mut coverage = report::coverage(evidence, &is_used, cornered, config);
    coverage.gated = uses.len() - coverage.used;
    let (parameters, covariance) = report::parameters(evidence, &state, candidates.excess);
    let verdict = decided.as_ref().map_or(Verdict::InsufficientCoverage, |(class, _)| Verdict::Is(*class));
    let reason = decided.as_ref().err().cloned();
    Identification {
        verdict,
        advice: reason.as_ref().map_or(String::new(), |reason| report::advice(reason, &coverage)),
        reason,
        shape: report::shape(&state),
        parameters,
        covariance,
        scores: candidates.list.iter().map(|candidate| candidate.score.clone()).collect(),
        coverage,
        chi2_per_degree_of_freedom: chosen.score.chi2_per_degree_of_freedom,
        fits: decide::fits(chosen, evidence.rows.len(), config).is_ok(),
        uses: std::mem::take(uses),
    }
}
