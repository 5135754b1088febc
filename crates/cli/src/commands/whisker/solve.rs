//! `whisker solve`: the contact of every reading of a record.

use super::input::{self, WhiskerArgs};
use super::solving::SolvingArgs;
use super::summary::RecordObject;
use super::{answer, picture, summary};
use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::Args;
use resight::formats::write_atomically;
use resight_whisker::files::contacts::{self, ContactObject};
use resight_whisker::solve::rig::SIX_AXES;
use resight_whisker::solve::{self, Solved};
use std::path::{Path, PathBuf};

/// The contact of every reading of a record, with its covariance and a verdict.
///
/// One row out for every row in. Columns in: sweep, sample, t (optional), hub_angle, hub_x, hub_y, fx, fy, mz, in any order; units in
/// the header as in `mz[N mm]`, or by --units. Columns out, statuses and error bars: docs/whisker.md.
#[derive(Debug, Args)]
pub struct Solve {
    #[command(flatten)]
    whisker: WhiskerArgs,
    /// Hub readings, CSV or JSON Lines.
    #[arg(value_name = "HUB.csv")]
    hub: PathBuf,
    /// Contacts: CSV, or JSON Lines where the name ends in .jsonl; the file is replaced only when complete.
    #[arg(short, long, value_name = "CONTACTS.csv")]
    output: Option<PathBuf>,
    #[command(flatten)]
    solving: SolvingArgs,
    /// Readings of the untouched whisker: their mean is taken off; in place of the calibration's zeros.
    #[arg(long, value_name = "FREE.csv")]
    tare: Option<PathBuf>,
    /// Image of the sweeps: whisker shapes, contacts by mode, 2-sigma ellipses; SVG or PNG by its ending.
    #[arg(long, value_name = "OUT.svg|.png", value_parser = picture::path)]
    picture: Option<PathBuf>,
    /// Outline to draw into the image: an object file, or what `identify` wrote.
    #[arg(long, value_name = "OBJECT.json", requires = "picture")]
    object: Option<PathBuf>,
    /// JSON Lines on stdout: one object for every reading, then one for the record.
    #[arg(long)]
    json: bool,
}

/// See `Solve`.
pub fn run(args: &Solve) -> Result<Outcome> {
    for path in args.output.iter().chain(&args.picture) {
        crate::files::must_be_writable(path)?;
    }
    let file = args.whisker.read()?;
    let readings = input::readings(&args.hub, file.conventions)?;
    let object = args.object.as_deref().map(input::object).transpose()?;
    let tare = args.tare.as_deref().map(|path| input::tare(path, &file)).transpose()?;
    let solved = solve::solve(&file, &readings, tare.as_ref(), &(&args.solving).into())?;
    let is_in_space = readings.iter().any(|row| row.out_of_plane.is_some());
    if is_in_space && args.picture.is_some() {
        bail!("--picture shows the plane; {SIX_AXES}");
    }
    let mut written = Vec::new();
    if let Some(path) = &args.output {
        write_atomically(path, contacts_text(path, &solved)?.as_bytes())?;
        written.push(path.display().to_string());
    }
    if let Some(path) = &args.picture {
        let drawing = picture::sweeps(&solved, object.as_ref().map(|o| &o.shape))?;
        picture::write(path, &drawing)?;
        written.push(path.display().to_string());
    }
    match args.json {
        true => print(&(lines(&solved)? + &answer::line(RecordObject::from(&solved))?))?,
        false => print(&words(args, &solved, &written))?,
    }
    let record = summary::status(&solved);
    Ok(Outcome::of(solved.rows.iter().map(|row| summary::status_of(row.status)).chain([record])))
}

fn contacts_text(path: &Path, solved: &Solved) -> Result<String> {
    let is_json = path.extension().is_some_and(|e| e == "jsonl" || e == "ndjson" || e == "json");
    if is_json { lines(solved) } else { Ok(contacts::write_csv(&solved.rows)) }
}

fn lines(solved: &Solved) -> Result<String> {
    solved.rows.iter().map(|row| answer::line(ContactObject::from(row))).collect()
}

fn words(args: &Solve, solved: &Solved, written: &[String]) -> String {
    let mut out = summary::words(&args.hub.display().to_string(), solved);
    if !written.is_empty() {
        crate::text::line(&mut out, "written", &written.join(", "));
    }
    out
}
