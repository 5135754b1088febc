//! `watch`: cameras watched over time, an alarm when one moved.

mod said;
mod sources;

use crate::output::Outcome;
use anyhow::{Context, Result, bail};
use clap::Args;
use nalgebra::{Matrix6, Vector6};
use resight::core::monitor::MonitorConfig;
use resight::core::monitor::learn::{LEAST_READINGS, LearnConfig};
use resight::core::track::TrackConfig;
use resight::live::{self, Event, LiveCamera, LiveConfig, State, reference};
use said::Teller;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Watches cameras: a pose for every frame, and an alarm, at a stated rate of false ones, when a camera moved.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate=snapshots/ --learn 50 --save-reference gate=gate.ref.toml\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate='night/*.png' --period-s 1 --reference gate=gate.ref.toml --once\n  \
    detector | resight watch --camera gate.yaml --target tag.toml --source - --json\n\n\
    Exit status with --once: 0 all steady, 3 something moved, 1 a camera was not seen or contradicts itself.")]
pub struct Watch {
    /// Camera file in any supported format; NAME=FILE where there are several.
    #[arg(long, required = true, value_name = "[NAME=]FILE")]
    camera: Vec<String>,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON.
    #[arg(long, value_name = "FILE")]
    target: PathBuf,
    /// Where frames come from: a folder that fills up, pictures ('night/*.png'), a video file, or - for detections as JSON Lines
    /// on stdin. NAME=SOURCE where there are several cameras.
    #[arg(long, required = true, value_name = "[NAME=]SOURCE")]
    source: Vec<String>,
    /// Pictures are this far apart [default: as their files' times say].
    #[arg(long, value_name = "SECONDS", value_parser = crate::args::positive)]
    period_s: Option<f64>,
    /// What a camera is compared with, written by --save-reference [default: learned].
    #[arg(long, value_name = "[NAME=]FILE")]
    reference: Vec<String>,
    /// Readings from which a missing reference is learned.
    #[arg(long, value_name = "N", default_value_t = 50)]
    learn: usize,
    /// Where a learned reference is written.
    #[arg(long, value_name = "[NAME=]FILE")]
    save_reference: Vec<String>,
    /// Reads the sources to their end and ends with a verdict.
    #[arg(long)]
    once: bool,
    /// False alarms a day, on average at most, for all cameras together.
    #[arg(long, value_name = "N", default_value_t = 1.0 / 30.0, value_parser = crate::args::positive)]
    false_alarms_per_day: f64,
    /// A camera without a usable reading for this long is unseen.
    #[arg(long, value_name = "SECONDS", default_value_t = 5.0, value_parser = crate::args::positive)]
    unseen_after_s: f64,
    /// Turns below this are no drift.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    tolerance_deg: f64,
    /// Shifts below this are no drift.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    tolerance_mm: f64,
    /// Errors of the pose that last from frame to frame, as far as they are known beforehand: of the rotation.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    bias_deg: f64,
    /// The same of the place.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    bias_mm: f64,
    /// How long such errors last.
    #[arg(long, value_name = "SECONDS", default_value_t = 60.0, value_parser = crate::args::positive)]
    bias_time_s: f64,
    /// The wobble of every day (sun, load), as a standard deviation: of the rotation.
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0)]
    daily_deg: f64,
    /// The same of the place.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    daily_mm: f64,
    /// JSON Lines on stdout, one object per event and nothing else.
    #[arg(long)]
    json: bool,
    /// Also says what every frame showed.
    #[arg(long)]
    frames: bool,
}

/// See `Watch`.
pub fn run(args: &Watch) -> Result<Outcome> {
    if args.learn < LEAST_READINGS {
        bail!("--learn {}: at least {LEAST_READINGS} readings are needed", args.learn);
    }
    let names = sources::names(&args.camera);
    let cameras = cameras(args, &names)?;
    let saved = sources::by_name("--save-reference", &args.save_reference, &names)?;
    let mut teller = Teller::new(&names, args.json, args.frames);
    let mut states: Vec<Option<State>> = vec![None; names.len()];
    let mut failed = None;
    let stop = Arc::new(AtomicBool::new(false));
    live::run(cameras, &config(args, names.len()), &stop, |event| {
        if let Event::StateChanged { camera, state, .. } = event {
            states[*camera] = Some(state.clone());
        }
        let done = save(event, &saved).and_then(|()| teller.tell(event));
        failed = done.err();
        failed.is_none()
    })?;
    match failed {
        Some(reason) => Err(reason),
        None if args.once => teller.verdict(&states),
        None => Ok(Outcome::Answered),
    }
}

fn cameras(args: &Watch, names: &[String]) -> Result<Vec<LiveCamera>> {
    let files = sources::by_name("--camera", &args.camera, names)?;
    let references = sources::by_name("--reference", &args.reference, names)?;
    let target = Arc::new(super::target(&args.target, |warning| eprintln!("{warning}"))?);
    let opened = sources::open(&args.source, names, args.period_s, args.once)?;
    let mut cameras = Vec::new();
    for (i, (name, source)) in names.iter().zip(opened).enumerate() {
        let file = files[i].as_deref().context("a camera without a file")?;
        let reference = references[i].as_ref().map(|file| reference::read(file.as_ref())).transpose()?;
        let (camera, target) = (super::camera(file)?, Arc::clone(&target));
        cameras.push(LiveCamera { name: name.clone(), camera, target, source, reference });
    }
    Ok(cameras)
}

fn config(args: &Watch, cameras: usize) -> LiveConfig {
    let monitor = MonitorConfig {
        // Shared among the cameras, so that the rate holds for all of them together.
        false_alarms_per_day: args.false_alarms_per_day / cameras as f64,
        unseen_after_s: args.unseen_after_s,
        tolerance_rotation_rad: args.tolerance_deg.to_radians(),
        tolerance_translation_m: 1e-3 * args.tolerance_mm,
        ..MonitorConfig::default()
    };
    LiveConfig {
        monitor,
        track: TrackConfig::default(),
        learn_readings: args.learn,
        lasting: LearnConfig {
            bias: spread(args.bias_deg, args.bias_mm),
            bias_time_s: args.bias_time_s,
            daily: spread(args.daily_deg, args.daily_mm),
        },
        queue_frames: 2,
        retry_s: 1.0,
    }
}

/// The same about and along every axis.
fn spread(degrees: f64, mm: f64) -> Matrix6<f64> {
    let (r, t) = (degrees.to_radians().powi(2), (1e-3 * mm).powi(2));
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}

fn save(event: &Event, files: &[Option<String>]) -> Result<()> {
    let Event::Learned { camera, reference } = event else { return Ok(()) };
    let Some(file) = files.get(*camera).and_then(Option::as_ref) else { return Ok(()) };
    let text = reference::to_text(reference).map_err(|reason| anyhow::anyhow!("{file}: {reason}"))?;
    Ok(resight::formats::write_atomically(file.as_ref(), text.as_bytes())?)
}
