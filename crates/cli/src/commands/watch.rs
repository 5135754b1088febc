//! `watch`: cameras watched over time, an alarm when one moved.

mod alarm;
mod log;
mod names;
mod outputs;
mod sources;

use crate::output::Outcome;
use alarm::AlarmArgs;
use anyhow::{Context, Result, bail};
use clap::Args;
use log::Log;
use names::{Names, by_name, split};
use outputs::{OutputArgs, Session};
use resight::core::monitor::learn::LEAST_READINGS;
use resight::core::track::TrackConfig;
use resight::live::{self, Event, LiveCamera, LiveConfig, State, Watched, reference};
use sources::SourceArgs;
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
    /// Target file: own TOML, Kalibr YAML or WPILib JSON; NAME=FILE where there are several.
    #[arg(long, required = true, value_name = "[NAME=]FILE")]
    target: Vec<String>,
    #[command(flatten)]
    sources: SourceArgs,
    /// What a camera is compared with, written by --save-reference [default: learned]. NAME is a camera, or CAMERA/TARGET
    /// where there are several targets.
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
    #[command(flatten)]
    alarm: AlarmArgs,
    #[command(flatten)]
    outputs: OutputArgs,
}

/// See `Watch`.
pub fn run(args: &Watch) -> Result<Outcome> {
    if args.learn < LEAST_READINGS {
        bail!("--learn {}: at least {LEAST_READINGS} readings are needed", args.learn);
    }
    let names = Names::new(&args.camera, &args.target);
    let cameras = cameras(args, &names)?;
    let saved = by_name("--save-reference", &args.save_reference, &names.pairs())?;
    let (log, stop) = (Log::default(), Arc::new(AtomicBool::new(false)));
    let references = cameras.iter().flat_map(|camera| camera.targets.iter().map(|watched| watched.reference));
    let session = Session {
        names: &names,
        references: references.collect(),
        log: &log,
        stop: &stop,
        is_once: args.once,
    };
    let mut outputs = outputs::open(&args.outputs, &session)?;
    let mut states: Vec<Option<State>> = vec![None; names.pairs().len()];
    let mut failed = None;
    live::run(cameras, &config(args, &names), &stop, |event| {
        if let Event::StateChanged { camera, target, state, .. } = event {
            states[names.pair_index(*camera, *target)] = Some(state.clone());
        }
        let told = outputs.iter_mut().try_for_each(|output| output.take(event));
        failed = save(event, &names, &saved, &log).and(told).err();
        failed.is_none()
    })?;
    let finished = outputs.iter_mut().try_for_each(|output| output.finish());
    match failed {
        Some(reason) => Err(reason),
        None => finished.and_then(|()| verdict(args, &names, &states, &log)),
    }
}

fn verdict(args: &Watch, names: &Names, states: &[Option<State>], log: &Log) -> Result<Outcome> {
    if !args.once {
        return Ok(Outcome::Answered);
    }
    if args.outputs.is_printed() {
        return outputs::said::verdict(names, args.outputs.json, states);
    }
    for (name, state) in names.pairs().iter().zip(states) {
        log.say("verdict", &format!("{name}: {}", state.as_ref().map_or("unseen", outputs::said::word)));
    }
    Ok(outputs::said::outcome(states))
}

fn cameras(args: &Watch, names: &Names) -> Result<Vec<LiveCamera>> {
    let files = by_name("--camera", &args.camera, &names.cameras)?;
    let targets = targets(args)?;
    let references = by_name("--reference", &args.reference, &names.pairs())?;
    let opened = sources::open(&args.sources, &names.cameras, args.once)?;
    let mut cameras = Vec::new();
    for (i, (name, source)) in names.cameras.iter().zip(opened).enumerate() {
        let file = files[i].as_deref().context("a camera without a file")?;
        let watched = |(j, target): (usize, &Arc<resight::core::Target>)| {
            let file = references[names.pair_index(i, j)].as_ref();
            let reference = file.map(|file| reference::read(file.as_ref())).transpose()?;
            Ok(Watched { name: names.targets[j].clone(), target: Arc::clone(target), reference })
        };
        let targets = targets.iter().enumerate().map(watched).collect::<Result<Vec<_>>>()?;
        cameras.push(LiveCamera { name: name.clone(), camera: super::camera(file)?, targets, source });
    }
    Ok(cameras)
}

fn targets(args: &Watch) -> Result<Vec<Arc<resight::core::Target>>> {
    let read =
        |argument: &String| super::target(split(argument).1.as_ref(), |warning| eprintln!("{warning}"));
    args.target.iter().map(|argument| Ok(Arc::new(read(argument)?))).collect()
}

fn config(args: &Watch, names: &Names) -> LiveConfig {
    LiveConfig {
        monitor: args.alarm.monitor(names.pairs().len()),
        track: TrackConfig::default(),
        learn_readings: args.learn,
        lasting: args.alarm.lasting(),
        queue_frames: 2,
        retry_s: 1.0,
    }
}

fn save(event: &Event, names: &Names, files: &[Option<String>], log: &Log) -> Result<()> {
    let Event::Learned { camera, target, reference } = event else { return Ok(()) };
    let Some(file) = files.get(names.pair_index(*camera, *target)).and_then(Option::as_ref) else {
        return Ok(());
    };
    let text = reference::to_text(reference).map_err(|reason| anyhow::anyhow!("{file}: {reason}"))?;
    resight::formats::write_atomically(file.as_ref(), text.as_bytes())?;
    log.say("reference", &format!("{} is saved in {file}", names.pair(*camera, *target)));
    Ok(())
}
