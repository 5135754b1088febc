//! `watch`: cameras watched over time, an alarm when one moved.

mod alarm;
mod log;
mod names;
mod outputs;
mod rig;
mod sources;

use crate::output::Outcome;
use alarm::AlarmArgs;
use anyhow::{Context, Result, bail};
use clap::Args;
use log::Log;
use names::{Names, by_name, split};
use outputs::OutputArgs;
use outputs::said::Moved;
use resight::core::Camera;
use resight::core::monitor::learn::LEAST_READINGS;
use resight::core::track::TrackConfig;
use resight::formats::NamedCamera;
use resight::live::{self, Event, LiveCamera, LiveConfig, State, Watched, reference};
use rig::RigArgs;
use sources::SourceArgs;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Watches cameras: a pose for every frame, and an alarm, at a stated rate of false ones, when a camera moved.
#[derive(Debug, Args)]
#[command(after_help = "Examples:\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate=snapshots/ --learn 50 --save-reference gate=gate.ref.toml\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate='night/*.png' --period-s 1 --reference gate=gate.ref.toml --once\n  \
    detector | resight watch --camera gate.yaml --target tag.toml --source - --json\n  \
    detector | resight watch --rig rig.toml --moving-target --target board.toml --source - --once\n\n\
    Exit status with --once: 0 all steady, 3 something moved, 1 a camera was not seen or contradicts itself.")]
pub struct Watch {
    /// Camera file in any supported format; NAME=FILE where there are several.
    #[arg(long, required_unless_present = "rig", value_name = "[NAME=]FILE")]
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
    /// Readings from which a missing reference is learned; with --moving-target, moments.
    #[arg(long, value_name = "N", default_value_t = 50)]
    learn: usize,
    /// Where a learned reference is written.
    #[arg(long, value_name = "[NAME=]FILE")]
    save_reference: Vec<String>,
    /// Reads the sources to their end and ends with a verdict.
    #[arg(long)]
    once: bool,
    #[command(flatten)]
    rig: RigArgs,
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
    let rig = args.rig.cameras()?;
    let names = match &rig {
        Some(rig) => Names::of_rig(rig, &args.target),
        None => Names::new(&args.camera, &args.target),
    };
    let config = config(args, &names, rig.as_deref())?;
    let cameras = cameras(args, &names, rig)?;
    let saved = by_name("--save-reference", &args.save_reference, &names.pairs())?;
    let log = Log;
    let mut outputs = outputs::open(&args.outputs, &names, &log)?;
    let mut states: Vec<Option<State>> = vec![None; names.pairs().len()];
    let (mut failed, mut moved) = (None, Moved::default());
    let stop = Arc::new(AtomicBool::new(false));
    live::run(cameras, &config, &stop, |event| {
        moved.take(event);
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
        None => finished.and_then(|()| verdict(args, &names, &states, &moved)),
    }
}

fn verdict(args: &Watch, names: &Names, states: &[Option<State>], moved: &Moved) -> Result<Outcome> {
    match args.once {
        true => outputs::said::verdict(names, args.outputs.json, states, moved),
        false => Ok(Outcome::Answered),
    }
}

fn cameras(args: &Watch, names: &Names, rig: Option<Vec<NamedCamera>>) -> Result<Vec<LiveCamera>> {
    let lenses = lenses(args, names, rig)?;
    let targets = targets(args)?;
    let references = by_name("--reference", &args.reference, &names.pairs())?;
    let opened = sources::open(&args.sources, &names.cameras, args.once)?;
    let mut cameras = Vec::new();
    for (i, ((name, source), camera)) in names.cameras.iter().zip(opened).zip(lenses).enumerate() {
        let watched = |(j, target): (usize, &Arc<resight::core::Target>)| {
            let file = references[names.pair_index(i, j)].as_ref();
            let reference = file.map(|file| reference::read(file.as_ref())).transpose()?;
            Ok(Watched { name: names.targets[j].clone(), target: Arc::clone(target), reference })
        };
        let targets = targets.iter().enumerate().map(watched).collect::<Result<Vec<_>>>()?;
        cameras.push(LiveCamera { name: name.clone(), camera, targets, source });
    }
    Ok(cameras)
}

/// The lenses, from the rig's file or each from its own.
fn lenses(args: &Watch, names: &Names, rig: Option<Vec<NamedCamera>>) -> Result<Vec<Camera>> {
    if let Some(rig) = rig {
        return Ok(rig.into_iter().map(|camera| camera.camera).collect());
    }
    let files = by_name("--camera", &args.camera, &names.cameras)?;
    files.iter().map(|file| super::camera(file.as_deref().context("a camera without a file")?)).collect()
}

fn targets(args: &Watch) -> Result<Vec<Arc<resight::core::Target>>> {
    let read =
        |argument: &String| super::target(split(argument).1.as_ref(), |warning| eprintln!("{warning}"));
    args.target.iter().map(|argument| Ok(Arc::new(read(argument)?))).collect()
}

fn config(args: &Watch, names: &Names, cameras: Option<&[NamedCamera]>) -> Result<LiveConfig> {
    let rig = args.rig.config(cameras, names.cameras.len())?;
    if rig.is_some() && !(args.reference.is_empty() && args.save_reference.is_empty()) {
        bail!(
            "--reference and --save-reference are of cameras against targets that stand still; with --moving-target give --rig"
        );
    }
    // A rig is one test, pairs are one each.
    let tests = if rig.is_some() { 1 } else { names.pairs().len() };
    Ok(LiveConfig {
        monitor: args.alarm.monitor(tests),
        track: TrackConfig::default(),
        learn_readings: args.learn,
        lasting: args.alarm.lasting(rig.is_some()),
        queue_frames: 2,
        retry_s: 1.0,
        rig,
    })
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
