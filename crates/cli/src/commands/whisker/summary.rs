//! A record in a few lines, and as one JSON object.

use resight::report::verdict::Status;
use resight_whisker::estimate::Status as Contact;
use resight_whisker::files::ContactRow;
use resight_whisker::files::contacts::{RowStatus, mode_name};
use resight_whisker::solve::Solved;
use resight_whisker::solve::prediction::{self, ForecastObject};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// `298 ok, 63 no_contact`: words in their own order, those without a row left out.
fn counts(
    rows: &[ContactRow],
    words: &[&'static str],
    word: impl Fn(&ContactRow) -> &'static str,
) -> Vec<(&'static str, usize)> {
    let count = |name: &'static str| (name, rows.iter().filter(|row| word(row) == name).count());
    words.iter().map(|name| count(name)).filter(|(_, n)| 0 < *n).collect()
}

fn statuses(rows: &[ContactRow]) -> Vec<(&'static str, usize)> {
    counts(rows, &RowStatus::names(), |row| row.status.name())
}

fn modes(rows: &[ContactRow]) -> Vec<(&'static str, usize)> {
    let ok: Vec<ContactRow> = rows.iter().filter(|row| row.is_ok()).cloned().collect();
    counts(&ok, &["mid", "tip"], |row| mode_name(row.mode))
}

/// `298 ok, 63 no_contact`.
pub fn statuses_in_words(rows: &[ContactRow]) -> String {
    list(&statuses(rows))
}

/// The same for a program.
pub fn statuses_by_name(rows: &[ContactRow]) -> BTreeMap<&'static str, usize> {
    statuses(rows).into_iter().collect()
}

fn list(counts: &[(&'static str, usize)]) -> String {
    counts.iter().map(|(name, n)| format!("{n} {name}")).collect::<Vec<_>>().join(", ")
}

/// Half the contacts have a smaller error bar (one standard deviation of the worst direction), metres.
fn median_sigma_m(rows: &[ContactRow]) -> Option<f64> {
    let sigma = |row: &ContactRow| {
        let c = row.figures.filter(|_| row.is_ok())?.covariance;
        let (mean, half) = (0.5 * (c[(0, 0)] + c[(1, 1)]), 0.5 * (c[(0, 0)] - c[(1, 1)]));
        Some((mean + half.hypot(c[(0, 1)])).sqrt())
    };
    let mut sigmas: Vec<f64> = rows.iter().filter_map(sigma).collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).copied()
}

/// For a person.
pub fn words(name: &str, solved: &Solved) -> String {
    let rows = &solved.rows;
    let n_sweeps = rows.chunk_by(|a, b| a.sweep == b.sweep).count();
    let sweeps = if n_sweeps == 1 { "1 sweep".to_string() } else { format!("{n_sweeps} sweeps") };
    let mut out = format!("{name}   {} readings in {sweeps}\n", rows.len());
    crate::text::line(&mut out, "status", &list(&statuses(rows)));
    let modes = modes(rows);
    if !modes.is_empty() {
        crate::text::line(&mut out, "mode", &list(&modes));
    }
    if let Some(friction) = &solved.friction {
        let text = match friction.is_estimated {
            true => format!("mu {:.4} ± {:.4}, estimated", friction.mu, friction.mu_sigma),
            false => format!("mu {}, as given", friction.mu),
        };
        crate::text::line(&mut out, "friction", &text);
    }
    if let Some(sigma_m) = median_sigma_m(rows) {
        let text = format!("{:.2} mm, median standard deviation in the worst direction", 1e3 * sigma_m);
        crate::text::line(&mut out, "error bar", &text);
    }
    for forecast in &solved.forecasts {
        crate::text::line(&mut out, "slip-off", &prediction::words(forecast));
    }
    solved.warnings.iter().for_each(|warning| crate::text::line(&mut out, "warning", warning));
    out
}

/// Of the record as a whole.
pub fn status(solved: &Solved) -> Status {
    if solved.is_consistent { Status::Ok } else { Status::Inconsistent }
}

/// What a reading's word means for the exit status: that nothing is touched, or too lightly to say where, is as good an answer as a place.
pub fn status_of(row: RowStatus) -> Status {
    match row {
        RowStatus::Read(Contact::Ok | Contact::NoContact | Contact::LowForce) => Status::Ok,
        RowStatus::Read(Contact::NoZero | Contact::BeyondTip | Contact::Inconsistent) => Status::Inconsistent,
        RowStatus::Missing | RowStatus::Error => Status::Error,
    }
}

/// A record of readings as a whole; comes after its contacts.
#[derive(Serialize, JsonSchema)]
pub struct RecordObject {
    /// Tells it from a contact.
    #[schemars(extend("const" = "record"))]
    kind: &'static str,
    /// Whether readings and whisker agree.
    status: Status,
    /// With and without a contact.
    n_readings: usize,
    /// Readings by their status.
    statuses: BTreeMap<&'static str, usize>,
    /// Contacts that are ok by where on the whisker they are.
    modes: BTreeMap<&'static str, usize>,
    /// Coulomb's coefficient of friction; null where it is not used.
    mu: Option<f64>,
    /// Its standard deviation; 0 where it was given.
    mu_sigma: Option<f64>,
    /// Whether it was estimated from the record.
    mu_is_estimated: Option<bool>,
    /// Half the contacts have a smaller standard deviation in the worst direction, metres.
    median_sigma_m: Option<f64>,
    /// Of each sweep that ends in contact.
    prediction: Vec<ForecastObject>,
    /// What the user should know.
    warnings: Vec<String>,
}

impl From<&Solved> for RecordObject {
    fn from(solved: &Solved) -> Self {
        RecordObject {
            kind: "record",
            status: status(solved),
            n_readings: solved.rows.len(),
            statuses: statuses_by_name(&solved.rows),
            modes: modes(&solved.rows).into_iter().collect(),
            mu: solved.friction.map(|f| f.mu),
            mu_sigma: solved.friction.map(|f| f.mu_sigma),
            mu_is_estimated: solved.friction.map(|f| f.is_estimated),
            median_sigma_m: median_sigma_m(&solved.rows),
            prediction: solved.forecasts.iter().map(ForecastObject::from).collect(),
            warnings: solved.warnings.clone(),
        }
    }
}
