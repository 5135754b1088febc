//! What is said: figures in words and as JSON.

use crate::output::print;
use anyhow::Result;
use resight::advise::words;
use resight::core::advise::layout::Concern;
use resight::core::advise::volume::{Outlook, Spread};
use resight::core::advise::{Doubt, Expectation};
use serde::Serialize;

/// One object, or its words.
pub fn say(json: bool, object: &impl Serialize, text: &str) -> Result<()> {
    match json {
        true => print(&format!("{}\n", serde_json::to_string(object)?)),
        false => print(text),
    }
}

/// Standard deviations of a view.
#[derive(Debug, Clone, Serialize)]
pub struct Figures {
    /// Greatest of the camera's place over all directions; null where the points do not determine it.
    pub sigma_place_m: Option<f64>,
    /// Greatest of its rotation over all axes.
    pub sigma_rotation_rad: Option<f64>,
    /// Of the length asked for.
    pub sigma_length_m: Option<f64>,
    /// How far apart the nearest other pose shows the points, in standard deviations; null where there is none.
    pub separation_sigma: Option<f64>,
    /// Probability that the answer will be ambiguous.
    pub chance_ambiguous: f64,
    /// Whether these first-order figures hold within 5 %.
    pub holds: bool,
    /// Why not.
    pub doubts: Vec<String>,
    /// What is wrong with the layout.
    pub concerns: Vec<String>,
}

impl Figures {
    pub fn new(e: &Expectation, sigma_length_m: Option<f64>, concerns: &[Concern]) -> Self {
        let (rotation, place) = resight::core::advise::expect::worst_sigmas(&e.covariance);
        let doubts: Vec<String> = e.doubts().iter().map(words::doubt).collect();
        Figures {
            sigma_place_m: Some(place),
            sigma_rotation_rad: Some(rotation),
            sigma_length_m,
            separation_sigma: Some(e.separation_sigma).filter(|d| d.is_finite()),
            chance_ambiguous: e.chance_ambiguous(),
            holds: doubts.is_empty(),
            doubts,
            concerns: concerns.iter().map(words::concern).collect(),
        }
    }

    /// `place ± 31 mm   rotation ± 0.21°   length ± 19 mm`.
    pub fn words(&self) -> String {
        let place = self.sigma_place_m.map_or("unknown".into(), words::sigma_m);
        let rotation = self.sigma_rotation_rad.map_or("unknown".into(), words::sigma_rad);
        let length =
            self.sigma_length_m.map_or(String::new(), |s| format!("   length ± {}", words::sigma_m(s)));
        format!("place ± {place}   rotation ± {rotation}{length}")
    }

    /// Doubts and faults, one a line.
    pub fn warnings(&self) -> String {
        self.concerns.iter().chain(&self.doubts).map(|text| format!("    ! {text}\n")).collect()
    }
}

/// Why a view's figures are in doubt, in sentences.
pub fn doubts(doubts: &[Doubt]) -> Vec<String> {
    doubts.iter().map(words::doubt).collect()
}

#[derive(Debug, Clone, Serialize)]
pub struct SpreadObject {
    median: f64,
    p95: f64,
    worst: f64,
}

impl From<Spread> for SpreadObject {
    fn from(s: Spread) -> Self {
        SpreadObject { median: s.median, p95: s.p95, worst: s.worst }
    }
}

/// What a target is worth over a volume.
#[derive(Debug, Clone, Serialize)]
pub struct OutlookObject {
    n_views: usize,
    n_out_of_sight: usize,
    n_undetermined: usize,
    sigma_place_m: Option<SpreadObject>,
    sigma_rotation_rad: Option<SpreadObject>,
    ambiguous: f64,
    wrong: f64,
    first_order_fails: f64,
}

impl From<&Outlook> for OutlookObject {
    fn from(o: &Outlook) -> Self {
        OutlookObject {
            n_views: o.n_views,
            n_out_of_sight: o.n_out_of_sight,
            n_undetermined: o.n_undetermined,
            sigma_place_m: o.place_m.map(SpreadObject::from),
            sigma_rotation_rad: o.rotation_rad.map(SpreadObject::from),
            ambiguous: o.ambiguous,
            wrong: o.wrong,
            first_order_fails: o.doubtful,
        }
    }
}

/// One row of the table of a target: place (median, 95 %), rotation, shares.
pub fn outlook_row(name: &str, o: &Outlook) -> String {
    let pair = |s: Option<Spread>, write: fn(f64) -> String| match s {
        Some(s) => (write(s.median), write(s.p95)),
        None => ("–".into(), "–".into()),
    };
    let (place, place95) = pair(o.place_m, words::sigma_m);
    let (turn, turn95) = pair(o.rotation_rad, words::sigma_rad);
    let unseen = (o.n_out_of_sight + o.n_undetermined) as f64 / o.n_views.max(1) as f64;
    format!(
        "  {name:<40} {place:>9} {place95:>9}   {turn:>8} {turn95:>8}   {:>8} {:>8} {:>8}\n",
        share(o.ambiguous),
        share(o.wrong),
        share(unseen)
    )
}

pub fn outlook_header(name: &str) -> String {
    format!(
        "  {name:<40} {:>9} {:>9}   {:>8} {:>8}   {:>8} {:>8} {:>8}\n",
        "place ±", "95 %", "turn ±", "95 %", "ambig.", "wrong", "unseen"
    )
}

fn share(part: f64) -> String {
    format!("{:.1} %", 100.0 * part)
}
