//! `whisker stream`: one line in, one line out, before the next arrives.

use super::input::{self, WhiskerArgs};
use super::solving::{MethodArg, parse_mu};
use super::{answer, summary};
use crate::output::{Outcome, print};
use anyhow::{Context, Result, bail};
use clap::{Args, ValueEnum};
use resight::formats::write_atomically;
use resight_whisker::estimate::{Status, estimate};
use resight_whisker::events::TouchDetector;
use resight_whisker::files::contacts::{self, ContactObject, RowStatus};
use resight_whisker::files::hub::Conventions;
use resight_whisker::files::line::is_silent;
use resight_whisker::files::{ContactRow, HubFormat, HubRow, TextError};
use resight_whisker::friction::{Mu, Online};
use resight_whisker::solve::prediction::{self, WINDOW_READINGS};
use resight_whisker::solve::rig::{Rig, SIX_AXES};
use resight_whisker::sweep;
use resight_whisker::sweep::fixed_lag::{FixedLag, Settled};
use resight_whisker::{ContactEstimate, Sample};
use std::collections::VecDeque;
use std::io::{BufRead, Read};
use std::path::PathBuf;
use std::time::Instant;

/// One line in, one line out, before the next arrives.
///
/// Hub readings on stdin (CSV under a header, or JSON Lines), contacts on stdout in the same layout. A line that cannot be read is
/// answered by a row of status `error` that names the line; the stream continues.
#[derive(Debug, Args)]
pub struct Stream {
    #[command(flatten)]
    whisker: WhiskerArgs,
    /// What is used beyond the reading itself; --lag uses the sweep as well.
    #[arg(long, value_name = "MODE", value_enum, default_value_t = StreamMode::Constrained, conflicts_with = "lag")]
    mode: StreamMode,
    /// Coulomb's coefficient of friction: `auto` estimates it as readings come.
    #[arg(long, value_name = "auto|MU", default_value = "auto", allow_negative_numbers = true, value_parser = parse_mu)]
    mu: Mu,
    /// Predict slip-off at every contact (columns steps_to_slip_off …): some milliseconds a reading.
    #[arg(long, conflicts_with = "lag")]
    predict: bool,
    /// Use friction, tip and the sweep so far, over a window of the last N readings; each answer is still given at once.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..))]
    lag: Option<u16>,
    /// With --lag: what the N readings after it add to every contact, written at the end.
    #[arg(long, value_name = "CONTACTS.csv", requires = "lag")]
    settled: Option<PathBuf>,
    /// Readings of the untouched whisker: their mean is taken off.
    #[arg(long, value_name = "FREE.csv")]
    tare: Option<PathBuf>,
    /// How contacts are found from loads.
    #[arg(long, value_name = "METHOD", value_enum, default_value_t = MethodArg::Auto)]
    method: MethodArg,
    /// Answer in JSON Lines whatever comes in.
    #[arg(long)]
    json: bool,
    /// At the end, on stderr: how long an answer took from its line to its flush.
    #[arg(long)]
    timing: bool,
}

/// Longest line, bytes.
const MAX_LINE_BYTES: u64 = 1 << 20;

/// See `Stream`.
pub fn run(args: &Stream) -> Result<Outcome> {
    if let Some(path) = &args.settled {
        crate::files::must_be_writable(path)?;
    }
    let mut stream = Answering::new(args)?;
    let mut stdin = std::io::stdin().lock();
    let mut text = Vec::new();
    for line in 1.. {
        text.clear();
        // A line without an end is cut; its parts are no readings.
        if stdin.by_ref().take(MAX_LINE_BYTES).read_until(b'\n', &mut text).context("stdin")? == 0 {
            break;
        }
        stream.line(line, &String::from_utf8_lossy(&text))?;
    }
    stream.finish()
}

/// What is used beyond the reading itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq, ValueEnum)]
enum StreamMode {
    /// Nothing: each reading for itself.
    Raw,
    /// Where it holds: the tip's arc length, or Coulomb's friction between clamp and tip; from the readings so far.
    Constrained,
}

/// The estimator that answers.
#[allow(clippy::large_enum_variant)] // One a run.
enum Answerer {
    Raw,
    Constrained(Online),
    Lagged(FixedLag),
}

/// A stream under way.
struct Answering<'a> {
    args: &'a Stream,
    conventions: Conventions,
    rig: Rig,
    /// Known from the first line that says something.
    format: Option<HubFormat>,
    detector: TouchDetector,
    answerer: Answerer,
    /// With --predict: the last readings of the contact under way, and their answers.
    phase: (Vec<Sample>, Vec<ContactEstimate>),
    /// With --settled: readings that wait for their final answer, and those that have it.
    waiting: VecDeque<(Sample, Sample)>,
    settled: Vec<ContactRow>,
    outcome: Outcome,
    taken_us: Vec<f64>,
}

impl<'a> Answering<'a> {
    fn new(args: &'a Stream) -> Result<Self> {
        let file = args.whisker.read()?;
        file.warnings.iter().for_each(|warning| crate::output::remark(&format!("warning: {warning}")));
        let tare = args.tare.as_deref().map(|path| input::tare(path, &file)).transpose()?;
        let rig = Rig::new(&file, tare.as_ref());
        if args.predict && args.mode == StreamMode::Raw {
            bail!("--predict needs contacts under constraints; leave out --mode raw");
        }
        let answerer = answerer(args, &rig)?;
        Ok(Answering {
            args,
            conventions: file.conventions,
            format: None,
            detector: TouchDetector::new(&rig.cell),
            answerer,
            phase: (Vec::new(), Vec::new()),
            waiting: VecDeque::new(),
            settled: Vec::new(),
            outcome: Outcome::Answered,
            taken_us: Vec::new(),
            rig,
        })
    }

    fn line(&mut self, line: u64, text: &str) -> Result<()> {
        let begun = Instant::now();
        if is_silent(text) {
            return Ok(());
        }
        let Some(format) = self.format.as_mut() else { return self.first_line(line, text) };
        let row = match format.row(line, text) {
            Ok(reading) if reading.out_of_plane.is_some() => self.in_space(line, &reading)?,
            Ok(reading) => match reading.reading {
                Ok(read) => self.answer(&read),
                Err(cells) => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, &cells),
            },
            Err(reason) => unread(&reason),
        };
        self.outcome = self.outcome.and(Outcome::of([summary::status_of(row.status)]));
        self.print(&row)?;
        if self.args.timing {
            self.taken_us.push(1e6 * begun.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// A header is answered by a header, a first object by its contact.
    fn first_line(&mut self, line: u64, text: &str) -> Result<()> {
        let format = match HubFormat::of_first_line(line, text, self.conventions) {
            Ok(format) => format,
            Err(reason) => bail!("stdin: {reason}"),
        };
        let is_json_lines = format.is_json_lines();
        self.format = Some(format);
        match is_json_lines {
            true => self.line(line, text),
            false if self.args.json => Ok(()),
            false => print(&(contacts::header() + "\n")),
        }
    }

    fn answer(&mut self, read: &Sample) -> ContactRow {
        let sample = self.rig.meant(read);
        let event = self.detector.push(&sample);
        let mut estimate = match &mut self.answerer {
            Answerer::Raw => estimate(&self.rig.rod, &self.rig.cell, &sample, self.args.method.into()),
            Answerer::Constrained(online) => online.push(&sample).0,
            Answerer::Lagged(smoother) => {
                let update = smoother.push(sample);
                if self.args.settled.is_some() {
                    self.waiting.push_back((*read, sample));
                    self.settle(update.settled);
                }
                update.now
            }
        };
        let steps_to_slip_off = self.predicted(&sample, &estimate);
        self.rig.widen(&mut estimate, read, matches!(self.answerer, Answerer::Raw));
        ContactRow { event, steps_to_slip_off, ..ContactRow::new(&self.rig.rod, &sample, &estimate) }
    }

    fn in_space(&self, line: u64, reading: &HubRow) -> Result<ContactRow> {
        self.rig.must_know_six_axes().with_context(|| format!("stdin: line {line}"))?;
        if self.args.lag.is_some() || self.args.predict {
            bail!("stdin: line {line}: --lag and --predict follow a contact in the plane; {SIX_AXES}");
        }
        Ok(self.rig.row_in_space(reading)?)
    }

    /// With --predict: hub steps until slip-off, and their standard deviation.
    fn predicted(&mut self, sample: &Sample, estimate: &ContactEstimate) -> Option<[f64; 2]> {
        let Answerer::Constrained(online) = &self.answerer else { return None };
        let (samples, estimates) = &mut self.phase;
        let is_other = samples.last().is_some_and(|last| last.sweep != sample.sweep);
        if !self.args.predict || is_other || estimate.status == Status::NoContact {
            samples.clear();
            estimates.clear();
        }
        if !self.args.predict || estimate.status == Status::NoContact {
            return None;
        }
        if samples.len() == WINDOW_READINGS {
            samples.remove(0);
            estimates.remove(0);
        }
        samples.push(*sample);
        estimates.push(estimate.clone());
        let method = self.args.method.into();
        let ahead = prediction::ahead(&self.rig, samples, estimates, online.friction(), method)?;
        prediction::steps_to_slip_off(&ahead)
    }

    /// Final answers come in the order of their readings.
    fn settle(&mut self, settled: Vec<Settled>) {
        for mut settled in settled {
            while let Some((read, sample)) = self.waiting.pop_front() {
                if (sample.sweep, sample.sample) == (settled.sweep, settled.sample) {
                    self.rig.widen(&mut settled.estimate, &read, false);
                    self.settled.push(ContactRow::new(&self.rig.rod, &sample, &settled.estimate));
                    break;
                }
            }
        }
    }

    fn print(&self, row: &ContactRow) -> Result<()> {
        let is_json = self.args.json || self.format.as_ref().is_some_and(HubFormat::is_json_lines);
        print(&match is_json {
            true => answer::line(ContactObject::from(row))?,
            false => contacts::to_csv(row) + "\n",
        })
    }

    fn finish(mut self) -> Result<Outcome> {
        if let (Answerer::Lagged(smoother), Some(path)) = (&mut self.answerer, &self.args.settled) {
            let left = smoother.finish();
            self.settle(left);
            write_atomically(path, contacts::write_csv(&self.settled).as_bytes())?;
        }
        if !self.taken_us.is_empty() {
            self.taken_us.sort_by(f64::total_cmp);
            let n = self.taken_us.len();
            let quantile = |part: f64| self.taken_us[((n - 1) as f64 * part).round() as usize];
            eprintln!(
                "{n} answers, from line to flush: median {:.1} us, 99 % within {:.1} us, slowest {:.1} us",
                quantile(0.5),
                quantile(0.99),
                quantile(1.0)
            );
        }
        Ok(self.outcome)
    }
}

fn answerer(args: &Stream, rig: &Rig) -> Result<Answerer> {
    Ok(match (args.lag, args.mode) {
        (Some(lag), _) => {
            Answerer::Lagged(FixedLag::new(&rig.rod, &rig.cell, &options(args, usize::from(lag)))?)
        }
        (None, StreamMode::Raw) => Answerer::Raw,
        (None, StreamMode::Constrained) => {
            Answerer::Constrained(Online::new(&rig.rod, &rig.cell, args.mu, args.method.into())?)
        }
    })
}

fn options(args: &Stream, lag_samples: usize) -> sweep::Options {
    let friction = match args.mu {
        Mu::Auto => sweep::Friction::Unknown,
        Mu::Known(mu) => sweep::Friction::Given { mu },
    };
    sweep::Options { friction, method: args.method.into(), lag_samples }
}

fn unread(reason: &TextError) -> ContactRow {
    ContactRow { note: reason.to_string(), ..ContactRow::blank(0, 0, None, RowStatus::Error) }
}
