//! `batch`: millions of views to poses.

use crate::args::{positive, seconds};
use crate::output::{Outcome, print_answer, remark};
use crate::stdio::is_quiet;
use anyhow::{Result, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use resight::formats::{read_target, write_atomically};
use resight_fleet::answer::{BatchObject, ColumnsObject, FleetCameraObject};
use resight_fleet::assess::{AssessConfig, assess};
use resight_fleet::run::{Job, Progress, run as solve};
use resight_fleet::source::{expand, explain_file};
use resight_fleet::{Cameras, FleetState, Solver};
use std::io::IsTerminal;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Computes the poses of millions of views, of a fleet of cameras, in bounded memory and on all cores.
///
/// A row is a view: camera, time_s, u0_px, v0_px, u1_px, … (or a list points_px), and optionally view and sigma_px; where the points are stand
/// in x0_m, y0_m, z0_m, … of the row or of its camera, or in --target. Files with a row a point have the columns of `solve` and camera.
/// Parquet, CSV and JSON Lines are read. Each row gets its pose, covariance, probability, χ² and status, in the order of the input; what is
/// wrong with a row is in its status and reason, and the others are not affected.
///
/// A run that was cut off is continued by the same command: its output is the same to the last bit as that of an undisturbed run.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight batch views/ --cameras cameras.csv -o poses.parquet")]
#[command(after_long_help = "Examples:
  resight batch views/ --cameras cameras.csv -o poses.parquet
  resight batch 'day-*.parquet' --cameras rig.toml --target target.toml -o poses.parquet --drift cameras.jsonl
  resight batch --explain views/000.parquet")]
pub struct Batch {
    /// Files of views, folders of them, or patterns.
    #[arg(value_name = "IN", required = true)]
    inputs: Vec<String>,
    /// Cameras by name: a CSV table, a camera file that names several, or a folder of camera files.
    #[arg(long, value_name = "FILE", required_unless_present = "explain")]
    cameras: Option<PathBuf>,
    /// The points that all cameras see, where neither rows nor cameras state them.
    #[arg(long, value_name = "FILE")]
    target: Option<PathBuf>,
    /// Where the poses go, .parquet or .csv; complete or not at all.
    #[arg(long, short, value_name = "FILE", required_unless_present = "explain")]
    output: Option<PathBuf>,
    /// Writes what became of each camera (moved, dead, wrong map, …) to FILE, as JSON Lines.
    #[arg(long, value_name = "FILE")]
    drift: Option<PathBuf>,
    /// Standard deviation of u and v where a row states none.
    #[arg(long, value_name = "S", default_value = "0.5", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: f64,
    /// Rows of a camera within so many seconds are joined to one reading of --drift.
    #[arg(long, hide_short_help = true, value_name = "S", default_value = "900", value_parser = seconds)]
    period_s: f64,
    /// Threads [default: one for each core].
    #[arg(long, hide_short_help = true, value_name = "N")]
    threads: Option<usize>,
    /// Only says which columns the files have, what each is taken for, and what is missing.
    #[arg(long)]
    explain: bool,
    /// Prints the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// See `Batch`.
pub fn run(args: &Batch) -> Result<Outcome> {
    let inputs = expand(&args.inputs)?;
    if args.explain {
        return explain(&inputs, args.json);
    }
    let (Some(cameras), Some(output)) = (&args.cameras, &args.output) else {
        bail!("--cameras and -o are needed");
    };
    crate::files::must_be_writable(output)?;
    if let Some(drift) = &args.drift {
        crate::files::can_be_written("--drift", drift)?;
    }
    if let Some(same) = inputs.iter().find(|input| is_same(input, output)) {
        bail!("-o {}: this is one of the inputs; write elsewhere", same.display());
    }
    let mut cameras = Cameras::read(cameras)?;
    if let Some(target) = &args.target {
        crate::files::must_exist(target)?;
        cameras = cameras.with_target(&read_target(target)?.target)?;
    }
    cameras.warnings.iter().for_each(|text| remark(&format!("warning: {text}")));
    let solver = Solver { cameras, sigma_px: args.sigma_px };
    let threads = args.threads.unwrap_or(0);
    let job = Job { inputs: &inputs, solver: &solver, output, period_s: args.period_s, threads };
    let (bar, begun) = (bar(), Instant::now());
    let done = solve(&job, &|progress| show(&bar, progress));
    bar.finish_and_clear();
    let done = done?;
    let counts = done.state.counts();
    let answer = BatchObject::of(&done, counts, solver.cameras.len(), output, begun.elapsed().as_secs_f64());
    if let Some(drift) = &args.drift {
        write_drift(drift, done.state, &solver.cameras)?;
    }
    print_answer(args.json, &answer, &answer.in_words(), answer.status())?;
    Ok(Outcome::of([answer.status()]))
}

fn is_same(a: &Path, b: &Path) -> bool {
    let (a, b) = (a.canonicalize(), b.canonicalize());
    a.is_ok_and(|a| b.is_ok_and(|b| a == b))
}

fn explain(inputs: &[PathBuf], json: bool) -> Result<Outcome> {
    let mut statuses = Vec::new();
    for path in inputs {
        let (columns, rows) = explain_file(path)?;
        let answer = ColumnsObject::of(path, columns, rows);
        print_answer(json, &answer, &answer.in_words(), answer.status())?;
        statuses.push(answer.status());
    }
    Ok(Outcome::of(statuses))
}

fn write_drift(path: &Path, state: FleetState, cameras: &Cameras) -> Result<()> {
    let fleet = assess(state, Some(cameras), &AssessConfig::default())?;
    let mut lines = Vec::new();
    for camera in &fleet.cameras {
        serde_json::to_writer(&mut lines, &FleetCameraObject::from(camera))?;
        lines.push(b'\n');
    }
    write_atomically(path, &lines)?;
    Ok(())
}

/// On a terminal only.
fn bar() -> ProgressBar {
    let shown = !is_quiet() && std::io::stderr().is_terminal();
    let target = if shown { ProgressDrawTarget::stderr_with_hz(5) } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(None, target);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {human_pos} rows  {per_sec}  {eta} left") {
        bar.set_style(style);
    }
    bar
}

fn show(bar: &ProgressBar, progress: Progress) {
    if let Some(of) = progress.of {
        bar.set_length(of);
    }
    bar.set_position(progress.rows);
}
