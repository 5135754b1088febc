//! `fleet-report`: which cameras moved?

use crate::args::{not_negative, seconds};
use crate::output::{Outcome, print, remark};
use anyhow::Result;
use clap::Args;
use resight_fleet::answer::in_words;
use resight_fleet::assess::{AssessConfig, Found};
use resight_fleet::job::{ReportRequest, fleet_report, json_lines};
use std::path::PathBuf;

/// Says which cameras of a fleet moved, which are dead, and whose map or clock is wrong, from the poses that `batch` wrote.
///
/// Poses of a camera within a period are joined to one reading, and the readings are tested as those of `watch` are: a sudden or slow motion is
/// named with its size, its evidence and since when, at a stated rate of false alarms (one camera in 36,000 a record), whatever correlated
/// errors the readings have. The exit status is 3 when a camera moved, else 2 when a row of the table of cameras could not be read, 1 when a
/// camera's verdict is not to be relied on, 0 when all is well.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight fleet-report poses.parquet --cameras cameras.csv -o fleet.html")]
pub struct FleetReport {
    /// Parquet files that `batch` wrote, folders of them, or patterns.
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<String>,
    /// The table of cameras: also names those that were never seen, and where each stands.
    #[arg(long, value_name = "FILE")]
    cameras: Option<PathBuf>,
    /// Writes one HTML file to search and sort: motions, histories, masts, map, sites, every verdict as CSV.
    #[arg(long, short, value_name = "FILE.html")]
    output: Option<PathBuf>,
    /// The state that an earlier report wrote with --state, of the time before these poses: only what moved since then counts as moved.
    #[arg(long, value_name = "FILE")]
    since: Option<PathBuf>,
    /// Writes what is kept of each camera of these poses, for --since of the next report.
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    /// Poses of a camera within so many seconds are joined to one reading.
    #[arg(long, value_name = "S", default_value = "900", value_parser = seconds)]
    period_s: f64,
    /// Standard deviation of the diurnal variation of each angle, degrees, which is no motion.
    #[arg(long, value_name = "DEG", default_value = "0", allow_negative_numbers = true, value_parser = not_negative)]
    diurnal_deg: f64,
    /// Standard deviation of the diurnal variation of each coordinate, millimetres, which is no motion.
    #[arg(long, value_name = "MM", default_value = "0", allow_negative_numbers = true, value_parser = not_negative)]
    diurnal_mm: f64,
    /// Prints JSON Lines, one object a camera.
    #[arg(long)]
    json: bool,
}

/// Cameras listed in words.
const LISTED: usize = 40;

/// See `FleetReport`.
pub fn run(args: &FleetReport) -> Result<Outcome> {
    for output in args.output.iter().chain(&args.state) {
        crate::files::must_be_writable(output)?;
    }
    let fleet = fleet_report(&ReportRequest {
        inputs: args.inputs.clone(),
        cameras: args.cameras.clone(),
        output: args.output.clone(),
        since: args.since.clone(),
        state: args.state.clone(),
        period_s: args.period_s,
        config: AssessConfig {
            diurnal_rad: args.diurnal_deg.to_radians(),
            diurnal_m: args.diurnal_mm / 1e3,
            ..AssessConfig::default()
        },
    })?;
    match args.json {
        true => {
            for line in json_lines(&fleet)? {
                print(&(line + "\n"))?;
            }
        }
        false => print(&in_words(&fleet, LISTED))?,
    }
    let moved = fleet.cameras.iter().any(|camera| camera.found == Found::Moved);
    let others = Outcome::of(fleet.cameras.iter().map(|camera| camera.found.status()));
    for unread in &fleet.unread {
        remark(&format!("warning: {unread}"));
    }
    Ok(match (moved, fleet.unread.is_empty()) {
        (true, _) => Outcome::Moved,
        (false, true) => others,
        (false, false) => Outcome::Damaged,
    })
}
