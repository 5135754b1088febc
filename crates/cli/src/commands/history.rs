//! `history`: what `watch --history` wrote, in words or as a table for other programs.

mod when;

use crate::output::{Outcome, print};
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::SchemaNumber;
use resight_watch::history::export::{Table, export};
use resight_watch::history::{History as File, PairSummary, Selection, StateShare, StoredEvent};
use schemars::JsonSchema;
use serde::Serialize;
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Summarises the file that `watch --history` wrote, or exports it as CSV or Parquet.
///
/// The summary has cameras, times, states and motions.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    resight history gate.sqlite\n  \
    resight history gate.sqlite --export gate.csv --camera gate --from 2026-11-20 --to 2026-11-21T06:00:00\n  \
    resight history gate.sqlite --export gate.parquet\n  \
    resight history gate.sqlite --export events.csv --events\n\n\
    Times are UTC; in the tables, seconds as the frames had them (since 1970, or since the start of a recording).")]
pub struct History {
    /// The history: a file written by `resight watch --history`, also while it is being written.
    file: PathBuf,
    /// Writes rows to FILE, .csv or .parquet, complete or not at all.
    #[arg(long, value_name = "FILE")]
    export: Option<PathBuf>,
    /// Exports events (states, references learned, sources lost) instead of frames.
    #[arg(long, requires = "export")]
    events: bool,
    /// Only this camera; may be given several times.
    #[arg(long, value_name = "NAME")]
    camera: Vec<String>,
    /// Only from this time on: seconds, 2026-11-22, or 2026-11-22T06:30:00 (UTC).
    #[arg(long, value_name = "TIME", value_parser = when::parse, allow_hyphen_values = true)]
    from: Option<f64>,
    /// Only before this time.
    #[arg(long, value_name = "TIME", value_parser = when::parse, allow_hyphen_values = true)]
    to: Option<f64>,
    /// Prints the summary as one JSON object.
    #[arg(long)]
    json: bool,
}

/// A table written.
#[derive(Serialize, JsonSchema)]
pub struct ExportedObject {
    schema: SchemaNumber,
    event: &'static str,
    rows: u64,
    file: String,
}

/// A history in figures.
#[derive(Serialize, JsonSchema)]
pub struct HistoryObject {
    schema: SchemaNumber,
    event: &'static str,
    bytes: u64,
    sessions: u64,
    sessions_ended: u64,
    pairs: Vec<PairObject>,
    /// How many of each kind.
    events: BTreeMap<String, u64>,
    /// The events of the state `drifted`, as the session printed them.
    drifts: Vec<Value>,
}

/// A camera with a target, or with landmarks.
#[derive(Serialize, JsonSchema)]
struct PairObject {
    camera: String,
    target: String,
    from_s: f64,
    to_s: f64,
    rows: RowsObject,
    rms_px: Option<f64>,
    /// By the state's name.
    states: BTreeMap<String, StateObject>,
}

/// Rows of single frames, and of the means of minutes and hours.
#[derive(Serialize, JsonSchema)]
struct RowsObject {
    frames: u64,
    minutes: u64,
    hours: u64,
}

/// Frames in a state, those with a pose, and those with a rotation by landmarks.
#[derive(Serialize, JsonSchema)]
struct StateObject {
    frames: u64,
    readings: u64,
    rotations: u64,
}

/// See `History`.
pub fn run(args: &History) -> Result<Outcome> {
    let history = File::open(&args.file)?;
    let pairs = history.pairs()?;
    for name in &args.camera {
        if !pairs.iter().any(|pair| pair.camera == *name) {
            let known: Vec<&str> = pairs.iter().map(|pair| pair.camera.as_str()).collect();
            bail!("--camera {name}: the history has no rows of it; there are {}", known.join(", "));
        }
    }
    let selection = Selection { cameras: args.camera.clone(), from_s: args.from, to_s: args.to };
    match &args.export {
        Some(path) => {
            let table = if args.events { Table::Events } else { Table::Frames };
            let rows = export(&history, table, &selection, path)?;
            let file = path.display().to_string();
            let exported = ExportedObject { schema: SchemaNumber, event: "exported", rows, file };
            print(&if args.json {
                format!("{}\n", serde_json::to_string(&exported)?)
            } else {
                format!("{rows} rows in {}\n", path.display())
            })?;
        }
        None => summary(args, &history, &pairs, &selection)?,
    }
    Ok(Outcome::Answered)
}

/// Largest number of drifts described in words; a history may have many more.
const REPORTED: usize = 20;

fn summary(args: &History, history: &File, pairs: &[PairSummary], selection: &Selection) -> Result<()> {
    let is_asked = |pair: &&PairSummary| args.camera.is_empty() || args.camera.contains(&pair.camera);
    let pairs: Vec<&PairSummary> = pairs.iter().filter(is_asked).collect();
    let mut drifts = Vec::new();
    history.events(selection, &["state"], |event| {
        if event.state.as_deref() == Some("drifted") {
            drifts.push(event);
        }
        true
    })?;
    let mut events = BTreeMap::new();
    history.events(selection, &[], |event| {
        *events.entry(event.row.kind).or_insert(0u64) += 1;
        true
    })?;
    let (sessions, ended) = history.sessions()?;
    if args.json {
        let all = HistoryObject {
            schema: SchemaNumber,
            event: "history",
            bytes: history.bytes(),
            sessions,
            sessions_ended: ended,
            pairs: pairs.iter().map(|pair| object(pair)).collect(),
            events,
            drifts: drifts.iter().map(detail).collect(),
        };
        return print(&format!("{}\n", serde_json::to_string(&all)?));
    }
    print(&format!(
        "{}: {:.1} MB; sessions: {sessions}, cut off or still running: {}\n",
        args.file.display(),
        history.bytes() as f64 / 1e6,
        sessions - ended
    ))?;
    for pair in pairs {
        print(&words(pair))?;
    }
    let events: Vec<String> = events.iter().map(|(kind, n)| format!("{n} {kind}")).collect();
    print(&format!("events: {}\n", if events.is_empty() { "none".to_string() } else { events.join(", ") }))?;
    for drift in drifts.iter().rev().take(REPORTED).rev() {
        print(&drift_words(drift))?;
    }
    let earlier = drifts.len().saturating_sub(REPORTED);
    if 0 < earlier {
        print(&format!("and {earlier} earlier drifts; --export events.csv --events has all\n"))
    } else {
        Ok(())
    }
}

fn words(pair: &PairSummary) -> String {
    let [frames, minutes, hours] = pair.rows;
    let total: u64 = pair.states.iter().map(|share| share.frames).sum();
    let seen: u64 = pair.states.iter().map(|share| share.readings).sum();
    let rotations: u64 = pair.states.iter().map(|share| share.rotations).sum();
    let share = |n: u64| 100.0 * n as f64 / total.max(1) as f64;
    let states: Vec<String> =
        pair.states.iter().map(|s| format!("{} {:.1} %", s.state, share(s.frames))).collect();
    let rms = pair.rms_px.map_or(String::new(), |rms_px| format!(", rms {rms_px:.3} px"));
    let rotated = match rotations {
        0 => String::new(),
        _ => format!(", a rotation of landmarks in {:.1} %", share(rotations)),
    };
    format!(
        "{} with {}: {} to {}\n    {total} frames ({frames} single, the others in {minutes} rows of a minute and {hours} of an hour), a pose in {:.1} %{rms}{rotated}\n    {}\n",
        pair.camera,
        pair.target,
        when::words(pair.span_s.0),
        when::words(pair.span_s.1),
        share(seen),
        states.join(", ")
    )
}

fn object(pair: &PairSummary) -> PairObject {
    let state = |s: &StateShare| {
        let share = StateObject { frames: s.frames, readings: s.readings, rotations: s.rotations };
        (s.state.clone(), share)
    };
    let [frames, minutes, hours] = pair.rows;
    PairObject {
        camera: pair.camera.clone(),
        target: pair.target.clone(),
        from_s: pair.span_s.0,
        to_s: pair.span_s.1,
        rows: RowsObject { frames, minutes, hours },
        rms_px: pair.rms_px,
        states: pair.states.iter().map(state).collect(),
    }
}

fn detail(event: &StoredEvent) -> Value {
    serde_json::from_str(&event.row.detail).unwrap_or(Value::Null)
}

fn drift_words(event: &StoredEvent) -> String {
    let detail = detail(event);
    let message = detail["message"].as_str().unwrap_or("drifted");
    let camera = event.row.camera.as_deref().unwrap_or("?");
    format!("{camera}  {}  {message}\n", event.row.t_s.map_or("?".to_string(), when::words))
}
