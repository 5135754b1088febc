//! `whisker stream`: one line in, one line out, before the next arrives.

use super::input::WhiskerArgs;
use super::record::MethodArg;
use crate::output::{Outcome, print};
use anyhow::{Context, Result, bail};
use clap::Args;
use resight_whisker::ContactEstimate;
use resight_whisker::Sample;
use resight_whisker::estimate::estimate;
use resight_whisker::files::contacts::{self, RowStatus};
use resight_whisker::files::line::is_silent;
use resight_whisker::files::{ContactRow, HubFormat, TextError, WhiskerFile};
use std::io::BufRead;
use std::time::Instant;

/// One line in, one line out, before the next arrives.
///
/// Hub readings on stdin (CSV under a header, or JSON Lines), contacts on stdout in the same layout. A line that cannot be read is
/// answered by a row of status `error` that names the line; the stream goes on.
#[derive(Debug, Args)]
pub struct Stream {
    #[command(flatten)]
    whisker: WhiskerArgs,
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

/// See `Stream`.
pub fn run(args: &Stream) -> Result<Outcome> {
    let file = args.whisker.read()?;
    file.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let mut stream = Answering { args, file, format: None, n_unanswered: 0, taken_us: Vec::new() };
    let mut stdin = std::io::stdin().lock();
    let mut text = Vec::new();
    for line in 1.. {
        text.clear();
        if stdin.read_until(b'\n', &mut text).context("stdin")? == 0 {
            break;
        }
        stream.line(line, &String::from_utf8_lossy(&text))?;
    }
    stream.finish()
}

/// A stream under way.
struct Answering<'a> {
    args: &'a Stream,
    file: WhiskerFile,
    /// Known from the first line that says something.
    format: Option<HubFormat>,
    n_unanswered: usize,
    taken_us: Vec<f64>,
}

impl Answering<'_> {
    fn line(&mut self, line: u64, text: &str) -> Result<()> {
        let begun = Instant::now();
        if is_silent(text) {
            return Ok(());
        }
        let Some(format) = self.format.as_mut() else { return self.first_line(line, text) };
        let row = match format.row(line, text) {
            Ok(reading) => match reading.reading {
                Ok(sample) => ContactRow::new(&self.file.rod, &sample, &self.answer(&sample)),
                Err(cells) => ContactRow::missing(reading.sweep, reading.sample, reading.t_s, &cells),
            },
            Err(reason) => unread(&reason),
        };
        self.n_unanswered += usize::from(matches!(row.status, RowStatus::Missing | RowStatus::Error));
        self.print(&row)?;
        if self.args.timing {
            self.taken_us.push(1e6 * begun.elapsed().as_secs_f64());
        }
        Ok(())
    }

    /// A header is answered by a header, a first object by its contact.
    fn first_line(&mut self, line: u64, text: &str) -> Result<()> {
        let format = match HubFormat::of_first_line(line, text, self.file.conventions) {
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

    fn answer(&self, sample: &Sample) -> ContactEstimate {
        estimate(&self.file.rod, &self.file.cell, sample, self.args.method.into())
    }

    fn print(&self, row: &ContactRow) -> Result<()> {
        let is_json = self.args.json || self.format.as_ref().is_some_and(HubFormat::is_json_lines);
        print(&match is_json {
            true => format!("{}\n", contacts::to_json(row)),
            false => contacts::to_csv(row) + "\n",
        })
    }

    fn finish(mut self) -> Result<Outcome> {
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
        Ok(if self.n_unanswered == 0 { Outcome::Answered } else { Outcome::SomeUnanswered })
    }
}

fn unread(reason: &TextError) -> ContactRow {
    ContactRow { note: reason.to_string(), ..ContactRow::blank(0, 0, None, RowStatus::Error) }
}
