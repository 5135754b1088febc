//! Answers on stdout and in the results file, and how a command ended.

use crate::args::OutputArgs;
use crate::stdio::is_quiet;
pub use crate::stdio::{be_quiet, error, print, remark};
use anstream::{AutoStream, ColorChoice};
use anstyle::AnsiColor;
use anyhow::Result;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use resight::report::verdict::Status;
use serde::Serialize;
use std::io::IsTerminal;
use std::time::Duration;

/// How a command ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Outcome {
    /// Every result is `ok`.
    Answered,
    /// Some result is anything else; each says why.
    SomeUnanswered,
    /// Something could not be read; the others have their results.
    Damaged,
    /// Something moved.
    Moved,
}

impl Outcome {
    /// Of results of these statuses. The one place that decides exit status 0: a pose that is ambiguous or inconsistent is an answer, but
    /// none that a script may use unseen.
    pub fn of(statuses: impl IntoIterator<Item = Status>) -> Self {
        match statuses.into_iter().all(|status| status == Status::Ok) {
            true => Outcome::Answered,
            false => Outcome::SomeUnanswered,
        }
    }

    /// The exit status.
    pub fn status(self) -> u8 {
        match self {
            Outcome::Answered => 0,
            Outcome::SomeUnanswered => 1,
            Outcome::Damaged => 2,
            Outcome::Moved => 3,
        }
    }

    /// Of two parts of one run.
    pub fn and(self, other: Outcome) -> Self {
        match (self, other) {
            (Outcome::Moved, _) | (_, Outcome::Moved) => Outcome::Moved,
            (Outcome::Damaged, _) | (_, Outcome::Damaged) => Outcome::Damaged,
            (Outcome::SomeUnanswered, _) | (_, Outcome::SomeUnanswered) => Outcome::SomeUnanswered,
            (Outcome::Answered, Outcome::Answered) => Outcome::Answered,
        }
    }
}

/// Collects results in input order.
pub struct Printer {
    args: OutputArgs,
    lines: Vec<u8>,
    bar: ProgressBar,
    statuses: Vec<Status>,
}

impl Printer {
    /// For `n` inputs; the progress bar shows only on a terminal and for more than one input.
    pub fn new(args: &OutputArgs, n: usize) -> Self {
        let shown = !is_quiet() && 1 < n && std::io::stderr().is_terminal();
        let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
        let bar = ProgressBar::with_draw_target(Some(n as u64), target);
        if let Ok(style) = ProgressStyle::with_template("{bar:30} {pos}/{len}  {per_sec}  {eta} left") {
            bar.set_style(style);
        }
        Printer { args: args.clone(), lines: Vec::new(), bar, statuses: Vec::new() }
    }

    /// One more result, in words or as JSON, and its status, which the exit status rests on.
    pub fn result(&mut self, json: &impl Serialize, words: &str, status: Status) -> Result<()> {
        let line = serde_json::to_string(json)?;
        let separator = if self.statuses.is_empty() { "" } else { "\n" };
        match self.args.json {
            true => self.print(&format!("{line}\n"))?,
            false => self.print(&format!("{separator}{}", coloured(words, status)))?,
        }
        if self.args.output.is_some() {
            self.lines.extend(line.as_bytes());
            self.lines.push(b'\n');
        }
        self.statuses.push(status);
        self.bar.inc(1);
        Ok(())
    }

    /// A remark on stderr, unless quiet.
    pub fn remark(&self, text: &str) {
        self.bar.suspend(|| remark(text));
    }

    /// Writes the results file and says how it went.
    pub fn finish(self) -> Result<Outcome> {
        self.bar.finish_and_clear();
        if let Some(path) = &self.args.output {
            resight::formats::write_atomically(path, &self.lines)?;
        }
        Ok(Outcome::of(self.statuses))
    }

    fn print(&self, text: &str) -> Result<()> {
        self.bar.suspend(|| print(text))
    }
}

/// Runs a job that takes its time. On a terminal it shows how many of its images are done and how long the others will take, before and after
/// them that it works and for how long.
pub fn with_progress<T>(job: impl FnOnce() -> T) -> T {
    let shown = !is_quiet() && std::io::stderr().is_terminal();
    let target = if shown { ProgressDrawTarget::stderr() } else { ProgressDrawTarget::hidden() };
    let bar = ProgressBar::with_draw_target(None, target);
    let style = |template: &str| {
        ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar())
    };
    let (working, counting) = (
        style("{spinner} computing for {elapsed}"),
        style("{bar:30} {pos}/{len} images  {per_sec}  {eta} left"),
    );
    bar.set_style(working.clone());
    bar.enable_steady_tick(TICK);
    let of_job = bar.clone();
    let observer = move |n_done: usize, n_all: usize| {
        of_job.set_style(if n_done < n_all { counting.clone() } else { working.clone() });
        of_job.set_length(n_all as u64);
        of_job.set_position(n_done as u64);
        true
    };
    let answer = resight::parallel::observed(observer, job);
    bar.finish_and_clear();
    answer
}

/// How often a terminal shows that a job continues.
const TICK: Duration = Duration::from_millis(200);

/// An answer, as one JSON object or in words.
pub fn print_answer(as_json: bool, answer: &impl Serialize, words: &str, status: Status) -> Result<()> {
    match as_json {
        true => print(&format!("{}\n", serde_json::to_string(answer)?)),
        false => print(&coloured(words, status)),
    }
}

/// The words with their status in colour, where stdout is a terminal that wants it (`NO_COLOR` is respected).
fn coloured(words: &str, status: Status) -> String {
    let wants_colour = AutoStream::choice(&std::io::stdout()) != ColorChoice::Never;
    if wants_colour { with_colour(words, status) } else { words.to_owned() }
}

fn with_colour(words: &str, status: Status) -> String {
    let colour = match status {
        Status::Ok => AnsiColor::Green,
        Status::Ambiguous | Status::Undecided | Status::NotFound => AnsiColor::Yellow,
        _ => AnsiColor::Red,
    };
    let style = colour.on_default().bold();
    let name = status.name().to_uppercase().replace('_', " ");
    words.replacen(&name, &format!("{style}{name}{style:#}"), 1)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_status_and_nothing_else_has_a_colour() {
        let words = "left.png   AMBIGUOUS\n  camera at x 1 mm\n";
        assert_eq!(
            with_colour(words, Status::Ambiguous),
            "left.png   \u{1b}[1m\u{1b}[33mAMBIGUOUS\u{1b}[0m\n  camera at x 1 mm\n"
        );
        assert_eq!(with_colour("no word of it", Status::Ok), "no word of it");
    }
}
