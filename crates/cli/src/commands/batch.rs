//! `batch`: millions of views to poses.

mod spark;

use crate::args::{positive, seconds};
use crate::output::{Outcome, print_answer, remark};
use crate::stdio::is_quiet;
use anyhow::{Result, bail};
use clap::{Args, ValueEnum};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use resight_fleet::answer::ColumnsObject;
use resight_fleet::job::{BatchRequest, News, batch};
use resight_fleet::run::Progress;
use resight_fleet::source::{expand, explain_file};
use std::io::IsTerminal;
use std::path::PathBuf;

/// Computes the poses of millions of views, of a fleet of cameras, in bounded memory and on all cores.
///
/// A row is a view: camera, time_s, u0_px, v0_px, u1_px, … (or a list points_px), and optionally view and sigma_px; where the points are stand
/// in x0_m, y0_m, z0_m, … of the row or of its camera, or in --target. Files with a row a point have the columns of `solve` and camera.
/// Parquet, CSV and JSON Lines are read. Each row gets its pose, covariance, probability, χ² and status, in the order of the input; what is
/// wrong with a row is in its status and reason, and the others are not affected. The exit status is 0 when every row is ok, 1 when a row is
/// anything else, 2 when a file, or a row of the table of cameras, could not be read; the others are solved.
///
/// A run that was cut off is continued by the same command: its output is the same to the last bit as that of an undisturbed run.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight batch views/ --cameras cameras.csv -o poses.parquet")]
#[command(after_long_help = "Examples:
  resight batch views/ --cameras cameras.csv -o poses.parquet
  resight batch 'day-*.parquet' --cameras rig.toml --target target.toml -o poses.parquet --drift cameras.jsonl
  resight batch --explain views/000.parquet
  resight batch 's3a://fleet/day/' --cameras cameras.csv --engine spark --master spark://host:7077 -o s3a://fleet/poses")]
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
    /// What does the work: this machine, or a cluster of Apache Spark (with the Python package and PySpark).
    #[arg(long, hide_short_help = true, value_name = "ENGINE", default_value = "embedded")]
    engine: Engine,
    /// The cluster for --engine spark, such as spark://host:7077 or local[2] [default: that of the environment].
    #[arg(long, hide_short_help = true, value_name = "URL")]
    master: Option<String>,
    /// Only says which columns the files have, what each is taken for, and what is missing.
    #[arg(long)]
    explain: bool,
    /// Prints the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// What does the work.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Engine {
    /// This machine.
    Embedded,
    /// A cluster.
    Spark,
}

/// See `Batch`.
pub fn run(args: &Batch) -> Result<Outcome> {
    if args.explain {
        return explain(&expand(&args.inputs)?, args.json);
    }
    let request = request(args)?;
    if args.engine == Engine::Spark {
        return spark::run(&request, args.master.as_deref(), args.json);
    }
    crate::files::must_be_writable(&request.output)?;
    if let Some(drift) = &request.drift {
        crate::files::can_be_written("--drift", drift)?;
    }
    if let Some(target) = &request.target {
        crate::files::must_exist(target)?;
    }
    let bar = bar();
    let answer = batch(&request, &|news| {
        match news {
            News::Warning(text) => bar.suspend(|| remark(&format!("warning: {text}"))),
            News::Progress(progress) => show(&bar, progress),
        }
        true
    });
    bar.finish_and_clear();
    let answer = answer?;
    print_answer(args.json, &answer, &answer.in_words(), answer.status())?;
    Ok(if answer.is_damaged() { Outcome::Damaged } else { Outcome::of([answer.status()]) })
}

fn request(args: &Batch) -> Result<BatchRequest> {
    let (Some(cameras), Some(output)) = (&args.cameras, &args.output) else {
        bail!("--cameras and -o are needed");
    };
    if args.master.is_some() && args.engine != Engine::Spark {
        bail!("--master is the address of a cluster; add --engine spark");
    }
    Ok(BatchRequest {
        inputs: args.inputs.clone(),
        cameras: cameras.clone(),
        target: args.target.clone(),
        output: output.clone(),
        drift: args.drift.clone(),
        sigma_px: args.sigma_px,
        period_s: args.period_s,
        threads: args.threads.unwrap_or(0),
    })
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
