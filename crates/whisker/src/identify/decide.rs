//! The verdict: the best hypothesis, if every other that means something different is excluded.

use super::candidates::{Candidate, Candidates, Evidence, cost_of_axes, cost_of_sides};
use super::fit::{covariance, verdicts};
use super::report::natural;
use super::row::{OUTLIER_COST, Row};
use super::start::{arc, lines};
use super::state::State;
use super::{Class, Config, Model, Reason};
use nalgebra::Matrix2;

/// Contacts below which nothing is said: an ellipse has five parameters, and one contact must be left to contradict it.
pub(super) const NEEDED: usize = 6;

/// A class, or why there is none; with the candidate that stands for it.
pub(super) fn decide<'a>(
    evidence: &Evidence,
    candidates: &'a Candidates,
    config: &Config,
) -> Result<(Class, &'a Candidate), Reason> {
    let too_few = Reason::TooFewContacts { seen: evidence.rows.len(), needed: NEEDED };
    let best = candidates.list.first().ok_or(too_few)?;
    fits(best, evidence.rows.len(), config)?;
    not_one_corner(evidence, candidates, config)?;
    families_apart(candidates, config)?;
    match best.score.model.is_smooth() {
        true => smooth(evidence, candidates, config),
        false => cornered(evidence, candidates, config),
    }
}

/// Whether the best explains the contacts.
pub(super) fn fits(best: &Candidate, n_rows: usize, config: &Config) -> Result<(), Reason> {
    let outlier_share = best.score.n_outliers as f64 / n_rows as f64;
    let chi2_per_degree_of_freedom = best.score.chi2_per_degree_of_freedom;
    if chi2_per_degree_of_freedom <= config.fits_chi2_per_degree_of_freedom
        && outlier_share <= config.fits_outlier_share
    {
        return Ok(());
    }
    Err(Reason::NothingFits { chi2_per_degree_of_freedom, outlier_share })
}

/// One point explains everything about as well as the best does.
fn not_one_corner(evidence: &Evidence, candidates: &Candidates, config: &Config) -> Result<(), Reason> {
    let corner = candidates.best(|model| model == Model::Corner);
    let (Some(corner), Some(best)) = (corner, candidates.list.first()) else { return Ok(()) };
    if config.decided_bic <= corner.score.bic - best.score.bic {
        return Ok(());
    }
    let (corner_in_world, _, _) = corner.fit.state.frame();
    let loose = Matrix2::identity() * f64::INFINITY;
    let covariance_of = |state: &State| covariance(evidence.rows, state);
    let covariance = covariance_of(&corner.fit.state)
        .map_or(loose, |c| c.fixed_view::<2, 2>(0, 0).into_owned() * candidates.excess);
    let radius_bound_m = candidates
        .best(|model| model == Model::Circle)
        .and_then(|circle| {
            let (_, [radius, _], _) = circle.fit.state.frame();
            let variance = covariance_of(&circle.fit.state)?[(2, 2)];
            Some(radius + (config.decided_bic * candidates.excess * variance).sqrt())
        })
        .unwrap_or(f64::INFINITY);
    Err(Reason::OneCorner { corner_in_world, covariance, radius_bound_m })
}

/// A smooth outline and one with corners must not explain the contacts about equally well.
fn families_apart(candidates: &Candidates, config: &Config) -> Result<(), Reason> {
    let best = &candidates.list[0].score;
    let alternative = candidates.best(|model| model.is_smooth() != best.model.is_smooth());
    alternative.map_or(Ok(()), |alternative| apart(best, &alternative.score, config))
}

fn apart(best: &super::Score, alternative: &super::Score, config: &Config) -> Result<(), Reason> {
    let (delta_bic, needed) = (alternative.bic - best.bic, config.decided_bic);
    if needed <= delta_bic {
        return Ok(());
    }
    Err(Reason::TwoHypotheses { best: best.model, alternative: alternative.model, delta_bic, needed })
}

/// Circle or ellipse: an ellipse where a circle is excluded, a circle where a material ellipse is.
fn smooth<'a>(
    evidence: &Evidence,
    candidates: &'a Candidates,
    config: &Config,
) -> Result<(Class, &'a Candidate), Reason> {
    let circle = candidates.best(|model| model == Model::Circle);
    let ellipse = candidates.best(|model| model == Model::Ellipse);
    let (simple, general) = match (circle, ellipse) {
        (Some(circle), Some(ellipse)) => (circle, ellipse),
        (Some(circle), None) => return Ok((Class::Circle, circle)),
        (None, Some(ellipse)) => return Ok((Class::Ellipse, ellipse)),
        (None, None) => return Err(Reason::TooFewContacts { seen: 0, needed: NEEDED }),
    };
    let is_material = differs_materially(&general.fit.state, config);
    if is_material && general.score.bic + config.decided_bic <= simple.score.bic {
        thick(evidence, general, candidates, config)?;
        return Ok((Class::Ellipse, general));
    }
    if is_material {
        not_doubtful(simple, general, config)?;
    }
    fits(simple, evidence.rows.len(), config)?;
    let ratio = material_ratio(&simple.fit.state, config);
    let cost = cost_of_axes(evidence, &simple.fit.state, ratio);
    ratio_excluded((ratio, cost), simple, general, candidates, config)?;
    Ok((Class::Circle, simple))
}

/// Square, rectangle or polygon.
fn cornered<'a>(
    evidence: &Evidence,
    candidates: &'a Candidates,
    config: &Config,
) -> Result<(Class, &'a Candidate), Reason> {
    let is_polygon = |model| matches!(model, Model::Polygon { .. });
    let square = candidates.best(|model| model == Model::Square);
    let rectangle = candidates.best(|model| model == Model::Rectangle);
    let polygon = candidates.best(is_polygon);
    let special = candidates.best(|model| matches!(model, Model::Square | Model::Rectangle));
    let replacing =
        polygon.filter(|polygon| special.is_none_or(|special| replaces(polygon, special, config)));
    if let Some(polygon) = replacing {
        return closed(evidence, polygon, config).map(|()| (Class::Polygon, polygon));
    }
    let (simple, general) = match (square, rectangle) {
        (Some(square), Some(rectangle)) => (square, rectangle),
        (Some(square), None) => return Ok((Class::Square, square)),
        (None, Some(rectangle)) => return Ok((Class::Rectangle, rectangle)),
        (None, None) => return Err(Reason::TooFewContacts { seen: 0, needed: NEEDED }),
    };
    let is_material = differs_materially(&general.fit.state, config);
    if is_material && general.score.bic + config.decided_bic <= simple.score.bic {
        sides_known(evidence, general, candidates, config)?;
        return Ok((Class::Rectangle, general));
    }
    if is_material {
        not_doubtful(simple, general, config)?;
    }
    fits(simple, evidence.rows.len(), config)?;
    let ratio = material_ratio(&simple.fit.state, config);
    let near = [&simple.fit.state, &general.fit.state];
    let cost = cost_of_sides(&evidence.search, &near, ratio);
    ratio_excluded((ratio, cost), simple, general, candidates, config)?;
    Ok((Class::Square, simple))
}

/// The ratio at which axes or sides are materially different: a share of their size, and not less than a length.
fn material_ratio(simple: &State, config: &Config) -> f64 {
    let (_, [size, _], _) = simple.frame();
    config.material_ratio.max(1.0 + config.material_difference_m / size)
}

/// Whether axes or sides differ by more than what is called equal: a difference that is only significant may be an error common to
/// the contacts of a sweep, which their covariances do not name.
fn differs_materially(general: &State, config: &Config) -> bool {
    let (_, [a, b], _) = natural(general).frame();
    config.material_difference_m <= (a - b).abs()
}

/// Half way to being excluded, the simpler hypothesis is not reported either: by chance the general one gets so far once in a thousand.
fn not_doubtful(simple: &Candidate, general: &Candidate, config: &Config) -> Result<(), Reason> {
    let delta_bic = simple.score.bic - general.score.bic;
    if delta_bic < 0.5 * config.decided_bic {
        return Ok(());
    }
    let (best, alternative) = (general.score.model, simple.score.model);
    Err(Reason::TwoHypotheses { best, alternative, delta_bic, needed: config.decided_bic })
}

/// A polygon replaces a rectangle where it is better and explains at least half of the rectangle's outliers: more corners always
/// explain a few stray contacts, an outline that is no rectangle leaves a row of them.
fn replaces(polygon: &Candidate, special: &Candidate, config: &Config) -> bool {
    polygon.score.bic + config.decided_bic <= special.score.bic
        && (2 * polygon.score.n_outliers <= special.score.n_outliers
            || config.fits_chi2_per_degree_of_freedom < special.score.chi2_per_degree_of_freedom)
}

/// An ellipse whose smaller axis may be nothing is a plate, which has corners.
fn thick(
    evidence: &Evidence,
    ellipse: &Candidate,
    candidates: &Candidates,
    config: &Config,
) -> Result<(), Reason> {
    let state = natural(&ellipse.fit.state);
    let (_, [_, smaller], _) = state.frame();
    let variance = covariance(evidence.rows, &state).map_or(f64::INFINITY, |c| c[(3, 3)] * candidates.excess);
    let delta_bic = smaller * smaller / variance;
    if config.decided_bic <= delta_bic {
        return Ok(());
    }
    let (best, alternative) = (Model::Ellipse, Model::Polygon { corners: 2 });
    Err(Reason::TwoHypotheses { best, alternative, delta_bic, needed: config.decided_bic })
}

/// Shapes of the material ratio must cost more than the best by what decides.
fn ratio_excluded(
    (ratio, cost): (f64, f64),
    simple: &Candidate,
    general: &Candidate,
    candidates: &Candidates,
    config: &Config,
) -> Result<(), Reason> {
    let least = simple.fit.cost.min(general.fit.cost);
    let delta_chi2 = (cost - least) / candidates.excess;
    if config.decided_bic <= delta_chi2 {
        return Ok(());
    }
    let best = if simple.score.bic <= general.score.bic { simple } else { general };
    let needed = config.decided_bic;
    Err(Reason::RatioOpen { best: best.score.model, ratio, delta_chi2, needed })
}

/// A rectangle one of whose sides has no end is half a rectangle.
fn sides_known(
    evidence: &Evidence,
    rectangle: &Candidate,
    candidates: &Candidates,
    config: &Config,
) -> Result<(), Reason> {
    let (_, sides, _) = rectangle.fit.state.frame();
    let tolerance = config.material_ratio - 1.0;
    let covariance = covariance(evidence.rows, &rectangle.fit.state);
    // The wider side's χ² at the tolerance.
    let delta_chi2 = covariance.map_or(0.0, |c| {
        let at = |k: usize| (tolerance * sides[k]).powi(2) / (c[(2 + k, 2 + k)] * candidates.excess);
        at(0).min(at(1))
    });
    if config.decided_bic <= delta_chi2 {
        return Ok(());
    }
    let (ratio, needed) = (config.material_ratio, config.decided_bic);
    Err(Reason::RatioOpen { best: Model::Rectangle, ratio, delta_chi2, needed })
}

/// A polygon needs normals from enough sides, and all its corners.
fn closed(evidence: &Evidence, polygon: &Candidate, config: &Config) -> Result<(), Reason> {
    let seen = verdicts(evidence.rows, &polygon.fit.state).squared;
    let inliers: Vec<Row> = evidence
        .rows
        .iter()
        .zip(&seen)
        .filter(|(_, squared)| **squared < OUTLIER_COST)
        .map(|(row, _)| *row)
        .collect();
    let lines = lines(&inliers, evidence.lines.origin);
    let seen_rad = arc(&lines, config.gap_rad).map_or(0.0, |([from, to], _)| to - from);
    let is_plate = polygon.fit.state.n_parameters() < 6;
    let limit = config.along_sigma_limit_m.powi(2);
    let is_known = covariance(evidence.rows, &polygon.fit.state)
        .is_some_and(|c| c.diagonal().iter().all(|variance| *variance <= limit));
    if config.polygon_arc_rad <= seen_rad && is_known && !is_plate {
        return Ok(());
    }
    Err(Reason::SidesUnseen { seen_rad, needed_rad: config.polygon_arc_rad })
}
