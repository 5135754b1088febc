//! Sweeps as a viewer plays them, from files: the whisker's shape at every reading, the contacts with their ellipses, the object and its
//! verdict.

mod files;
mod scene;

use crate::files::identification::{IdentificationObject, reason_in_words, touch, verdict_name};
use crate::files::{ContactRow, TextError};
use crate::identify::{self, Identification, Touch, Verdict, identify};
use crate::shape::Shape;
use crate::solve::{self, Solved, solve};
use files::Given;
use scene::{PlayedReading, Stage, readings};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// Readings or contacts taken.
const MOST_READINGS: usize = 20_000;
/// Points of a drawn outline.
const OUTLINE_POINTS: usize = 240;

/// Sweeps as a viewer plays them: SI units, world frame. Null where the files do not state it.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct Replay {
    /// Whether readings and whisker agree; null where only contacts were given.
    is_consistent: Option<bool>,
    /// The whisker's length.
    length_m: Option<f64>,
    /// In their order.
    readings: Vec<PlayedReading>,
    /// Every so many readings have a shape.
    shapes_one_in: usize,
    /// Readings by their status.
    statuses: BTreeMap<&'static str, usize>,
    /// Coulomb's coefficient of friction.
    mu: Option<f64>,
    mu_sigma: Option<f64>,
    /// Half the contacts have a smaller standard deviation in the worst direction.
    median_sigma_m: Option<f64>,
    /// Remarks.
    warnings: Vec<String>,
    /// The corner of the least coordinates of everything, and that of the greatest.
    extent_m: [[f64; 2]; 2],
    /// The same of the contacts that are known well, and the outline.
    locus_extent_m: [[f64; 2]; 2],
    /// The object behind the contacts.
    found: Option<FoundObject>,
    /// Why there is none where none was sought.
    no_object: Option<String>,
    /// The outline of an object file that came along: closed, counter-clockwise.
    given_outline_m: Vec<[f64; 2]>,
}

/// The object behind the contacts, its outline, and the verdict in a sentence.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct FoundObject {
    /// Whether a class was named.
    is_named: bool,
    /// The verdict in a sentence.
    message: String,
    /// The outline as a closed counter-clockwise line; without a class that of the best hypothesis, empty where none fits.
    outline_m: Vec<[f64; 2]>,
    /// The answer of `resight whisker identify --json`.
    identification: IdentificationObject,
}

/// Solves and identifies what the files hold; each is a name and a text.
///
/// # Errors
/// The file, with what is wrong in it; files that do not belong together.
pub fn replay(files: &[(&str, &str)]) -> Result<Replay, TextError> {
    let given = Given::read(files)?;
    let config = solve::Config::default();
    let solved = match (&given.whisker, &given.readings) {
        (Some((_, whisker)), Some((name, readings))) => {
            let solved = solve(whisker, readings, None, &config);
            Some(solved.map_err(|reason| TextError::whole(format!("{name}: {reason}")))?)
        }
        _ => None,
    };
    let rows = match (&solved, &given.contacts) {
        (Some(solved), _) => &solved.rows,
        (None, Some((_, rows))) => rows,
        (None, None) => return Err(given.lacking()),
    };
    Ok(of_rows(rows, solved.as_ref(), &given))
}

fn of_rows(rows: &[ContactRow], solved: Option<&Solved>, given: &Given) -> Replay {
    let (found, no_object) = object(rows);
    let outline_m = found.as_ref().map_or(Vec::new(), |found| found.outline_m.clone());
    let given_outline_m = given.object.as_ref().map_or(Vec::new(), |(_, object)| outline(&object.shape));
    let (played, shapes_one_in) = readings(rows, solved);
    let stage = Stage { readings: &played, outlines: [&outline_m, &given_outline_m] };
    let mut warnings: Vec<String> = solved.map_or(Vec::new(), |solved| solved.warnings.clone());
    warnings.extend(given.remarks());
    Replay {
        is_consistent: solved.map(|solved| solved.is_consistent),
        length_m: solved.map(|solved| solved.rod.length_m),
        shapes_one_in,
        statuses: statuses(rows),
        mu: solved.and_then(|solved| solved.friction).map(|friction| friction.mu),
        mu_sigma: solved.and_then(|solved| solved.friction).map(|friction| friction.mu_sigma),
        median_sigma_m: scene::median_sigma_m(rows),
        warnings,
        extent_m: stage.extent_m(),
        locus_extent_m: stage.locus_extent_m(scene::typical_m(rows)),
        readings: played,
        found,
        no_object,
        given_outline_m,
    }
}

fn statuses(rows: &[ContactRow]) -> BTreeMap<&'static str, usize> {
    let mut counts = BTreeMap::new();
    for row in rows {
        *counts.entry(row.status.name()).or_insert(0) += 1;
    }
    counts
}

/// The object, or why it was not looked for.
fn object(rows: &[ContactRow]) -> (Option<FoundObject>, Option<String>) {
    if rows.iter().any(|row| row.spatial.is_some()) {
        let reason = "The contacts are in space; outlines are identified in the plane.";
        return (None, Some(reason.to_owned()));
    }
    let touches: Vec<Touch> = rows.iter().filter_map(touch).collect();
    match identify(&touches, &identify::Config::default()) {
        Ok(answer) => (Some(found(&answer)), None),
        Err(reason) => (None, Some(format!("{reason}."))),
    }
}

fn found(answer: &Identification) -> FoundObject {
    FoundObject {
        is_named: matches!(answer.verdict, Verdict::Is(_)),
        message: message(answer),
        outline_m: answer.shape.as_ref().map_or(Vec::new(), outline),
        identification: answer.into(),
    }
}

fn message(answer: &Identification) -> String {
    match &answer.reason {
        Some(reason) => format!("Not decided: {}.", reason_in_words(reason)),
        None => {
            let coverage = &answer.coverage;
            let range = coverage.normals_range_rad.map_or(0.0, |[from, to]| to - from).to_degrees();
            format!(
                "The contacts are explained by a {}; {} of them were used, and outward normals over {range:.0}° were seen.",
                verdict_name(answer.verdict),
                coverage.used
            )
        }
    }
}

/// A closed line; the first point is not repeated.
fn outline(shape: &Shape) -> Vec<[f64; 2]> {
    shape.outline_m(OUTLINE_POINTS).iter().map(|x| [x.x, x.y]).collect()
}
