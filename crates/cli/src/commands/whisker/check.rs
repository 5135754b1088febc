//! `whisker check`: contacts beside the truth.

use super::answer;
use super::input::{self, ReadingArgs};
use super::solving::SolvingArgs;
use crate::output::{Outcome, print};
use anyhow::{Result, anyhow, bail};
use clap::Args;
use resight_whisker::files::score::{Comparison, Group, Score, compare};
use resight_whisker::files::{ContactRow, contacts, truth};
use resight_whisker::solve;
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Contacts beside the truth: errors, whether the error bars hold, modes, what was missed.
///
/// A file of contacts is compared as it is; hub readings are solved first, which needs --whisker.
#[derive(Debug, Args)]
pub struct Check {
    /// For hub readings: the whisker file.
    #[arg(long, value_name = "META.json")]
    whisker: Option<PathBuf>,
    #[command(flatten)]
    readings: ReadingArgs,
    /// What `whisker solve` wrote, or hub readings.
    #[arg(value_name = "CONTACTS.csv|HUB.csv")]
    measured: PathBuf,
    /// The truth: columns sweep, sample, contact, x, y, s, theta_c, fx_world, fy_world, friction_angle, mode.
    #[arg(value_name = "TRUTH.csv")]
    truth: PathBuf,
    #[command(flatten)]
    solving: SolvingArgs,
    /// One JSON object on stdout.
    #[arg(long)]
    json: bool,
}

/// See `Check`.
pub fn run(args: &Check) -> Result<Outcome> {
    let truth = truth::read(&input::text(&args.truth)?).map_err(|e| input::located(&args.truth, &e))?;
    let rows = rows(args)?;
    let comparison = compare(&rows, &truth);
    if comparison.n_unmatched == truth.len() {
        bail!("{} and {} have no sweep and sample in common", args.measured.display(), args.truth.display());
    }
    match args.json {
        true => print(&answer::line(CheckObject::new(&rows, &comparison))?)?,
        false => print(&words(&rows, &comparison))?,
    }
    Ok(Outcome::Answered)
}

fn rows(args: &Check) -> Result<Vec<ContactRow>> {
    let text = input::text(&args.measured)?;
    match (contacts::is_contacts(&text), &args.whisker) {
        (true, _) => contacts::read(&text).map_err(|e| input::located(&args.measured, &e)),
        (false, Some(whisker)) => {
            let file = input::whisker_file(whisker, &args.readings)?;
            let readings = input::readings(&args.measured, file.conventions)?;
            Ok(solve::solve(&file, &readings, None, &(&args.solving).into())?.rows)
        }
        (false, None) => Err(anyhow!(
            "{}: no contacts (there is no column `status`); to solve hub readings give --whisker META.json",
            args.measured.display()
        )),
    }
}

fn name(group: Group) -> &'static str {
    match group {
        Group::All => "all",
        Group::Firm => "firm",
        Group::FirmMid => "firm_mid",
        Group::FirmTip => "firm_tip",
    }
}

fn title(group: Group) -> &'static str {
    match group {
        Group::All => "all contacts",
        Group::Firm => "0.1 N or more",
        Group::FirmMid => "  mid-whisker",
        Group::FirmTip => "  tip",
    }
}

fn words(rows: &[ContactRow], comparison: &Comparison) -> String {
    let mut out = format!(
        "{:14} {:>5} {:>6} {:>9} {:>9} {:>9} {:>9} {:>6} {:>10}\n",
        "true contacts", "n", "ok", "rms mm", "median mm", "max mm", "theta deg", "NEES", "mode right"
    );
    for s in &comparison.scores {
        let figures = match s.n_scored {
            0 => String::new(),
            _ => format!(
                " {} {} {} {} {:>6.2} {:>8.1} %",
                millimetres(s.rms_m),
                millimetres(s.median_m),
                millimetres(s.max_m),
                figure(s.theta_rms_rad.to_degrees()),
                s.nees,
                100.0 * s.mode_right
            ),
        };
        out += &format!("{:14} {:>5} {:>6}{figures}\n", title(s.group), s.n_true, s.n_scored);
    }
    out += &format!(
        "\nNEES is 2 where error bars are right. {} of 0.1 N or more without a place that is ok, {} false.\n",
        comparison.n_firm_unanswered, comparison.n_false
    );
    out + &format!("status: {}\n", super::summary::statuses_in_words(rows))
}

fn millimetres(metres: f64) -> String {
    figure(1e3 * metres)
}

fn figure(value: f64) -> String {
    if value != 0.0 && value < 1e-3 { format!("{value:>9.1e}") } else { format!("{value:>9.3}") }
}

/// Contacts beside the truth.
#[derive(Serialize, JsonSchema)]
pub struct CheckObject {
    /// By group of true contacts.
    scores: Vec<GroupScore>,
    /// True contacts of 0.1 N or more to which no place, or a status other than ok, was given.
    n_firm_unanswered: usize,
    /// Contacts stated with status ok where nothing is touched.
    n_false: usize,
    /// Rows of the truth without a contact of their sweep and sample.
    n_unmatched: usize,
    /// Rows by their status.
    statuses: BTreeMap<&'static str, usize>,
}

/// How far the contacts of a group that are ok are from the truth; null where there is none.
#[derive(Serialize, JsonSchema)]
struct GroupScore {
    /// `firm` are those with a true force of 0.1 N or more: `firm_mid` between clamp and tip, `firm_tip` at the tip.
    #[schemars(extend("enum" = Group::ALL.map(name)))]
    group: &'static str,
    /// True contacts.
    n_true: usize,
    /// Of those, with a place and status ok.
    n_ok: usize,
    /// Root mean square of the distance to the true point, metres.
    rms_m: Option<f64>,
    /// Half are nearer, metres.
    median_m: Option<f64>,
    /// The farthest, metres.
    max_m: Option<f64>,
    /// Root mean square error of the arc length, metres.
    s_rms_m: Option<f64>,
    /// Root mean square error of the whisker's direction, radians.
    theta_rms_rad: Option<f64>,
    /// Mean squared error in units of its covariance, two degrees of freedom: 2 where error bars are right.
    nees: Option<f64>,
    /// Share whose mode is right, 0 to 1.
    mode_right: Option<f64>,
}

impl CheckObject {
    fn new(rows: &[ContactRow], comparison: &Comparison) -> Self {
        CheckObject {
            scores: comparison.scores.iter().map(GroupScore::from).collect(),
            n_firm_unanswered: comparison.n_firm_unanswered,
            n_false: comparison.n_false,
            n_unmatched: comparison.n_unmatched,
            statuses: super::summary::statuses_by_name(rows),
        }
    }
}

impl From<&Score> for GroupScore {
    fn from(s: &Score) -> Self {
        let finite = |x: f64| Some(x).filter(|x| x.is_finite());
        GroupScore {
            group: name(s.group),
            n_true: s.n_true,
            n_ok: s.n_scored,
            rms_m: finite(s.rms_m),
            median_m: finite(s.median_m),
            max_m: finite(s.max_m),
            s_rms_m: finite(s.s_rms_m),
            theta_rms_rad: finite(s.theta_rms_rad),
            nees: finite(s.nees),
            mode_right: finite(s.mode_right),
        }
    }
}
