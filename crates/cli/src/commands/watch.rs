//! `watch`: cameras watched over time, an alarm when one moved.

mod alarm;
mod landmarks;
mod lens;
mod motion;
mod outputs;
mod rig;
pub mod session;
pub mod sources;

use crate::args::TagArgs;
use crate::output::Outcome;
use crate::page::{PageArgs, run_beside};
use alarm::AlarmArgs;
use anyhow::{Result, bail};
use clap::Args;
use landmarks::LandmarkArgs;
use lens::LensArgs;
use motion::MotionArgs;
use outputs::OutputArgs;
use resight::core::temporal::monitor::learn::LEAST_READINGS;
use resight::formats::{self, NamedCamera};
use resight::locate::IntrinsicsCovariance;
use resight_serve::{Live, Server};
use resight_watch::live::{CameraWatcherError, LiveCamera, LiveConfig, Watched, WatchedLandmarks, reference};
use resight_watch::names::{Names, by_name, split};
use resight_watch::outputs::said::{self, EventText, Verdict};
use resight_watch::source::Source;
use resight_watch::{Ended, Error, Log, Request, signals};
use rig::RigArgs;
use sources::SourceArgs;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// Watches cameras: a pose for every frame, and an alarm, at a stated rate of false ones, when a camera moved.
#[derive(Debug, Args)]
#[command(
    after_help = "Example: resight watch --camera gate.yaml --target tag.toml --source 'night/*.png' --reference gate.ref.toml --once"
)]
#[command(after_long_help = "Examples:\n  \
    resight watch session.toml\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate=snapshots/ --print-session > session.toml\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate=snapshots/ --learn 50 --save-reference gate=gate.ref.toml\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate='night/*.png' --period-s 1 --reference gate=gate.ref.toml --once\n  \
    resight watch --camera gate=gate.yaml --target tag.toml --source gate=rtsp://cam.local/stream1 --reference gate=gate.ref.toml\n  \
    resight watch --camera gate=run.mcap#/gate/camera_info --target tag.toml --source gate=run.mcap#/gate/image_raw --once --tf poses.mcap\n  \
    detector | resight watch --camera gate.yaml --target tag.toml --source - --json\n  \
    detector | resight watch --rig rig.toml --moving-target --target board.toml --source - --once\n  \
    resight watch --camera gate=gate.yaml --landmarks gate=reference.png --source gate=night.mp4 --once\n\n\
    Exit status with --once: 0 all steady, 3 something moved (also while it was learned), 1 of a camera it cannot be said: not seen, contradicts itself, still learning or checking.")]
pub struct Watch {
    /// Session file: its keys are the flags, with _ for -.
    ///
    /// A flag beside it takes the place of its key.
    #[arg(value_name = "SESSION.toml")]
    pub session: Option<PathBuf>,
    /// Prints the session file that the given flags mean, and ends.
    ///
    /// Every other key is there with its default, as a comment.
    #[arg(long, hide_short_help = true)]
    pub print_session: bool,
    /// That file.
    #[arg(skip)]
    pub printed: Option<String>,
    /// Camera file in any supported format; NAME=FILE where there are several.
    #[arg(long, value_name = "[NAME=]FILE")]
    camera: Vec<String>,
    #[command(flatten)]
    lens: LensArgs,
    /// Target file: own TOML, Kalibr YAML or WPILib JSON; NAME=FILE where there are several.
    ///
    /// Not needed with landmarks.
    #[arg(long, help_heading = None, value_name = "[NAME=]FILE")]
    target: Vec<String>,
    #[command(flatten)]
    tags: TagArgs,
    #[command(flatten)]
    landmarks: LandmarkArgs,
    #[command(flatten)]
    pub sources: SourceArgs,
    /// What a camera is compared with, written by --save-reference [default: learned].
    ///
    /// NAME is a camera, or CAMERA/TARGET where there are several targets.
    #[arg(long, help_heading = None, value_name = "[NAME=]FILE")]
    reference: Vec<String>,
    /// Readings from which a missing reference is learned; with --moving-target, synchronised frame sets.
    #[arg(
        long,
        hide_short_help = true,
        value_name = "N",
        default_value_t = 50,
        help_heading = "Reference and state"
    )]
    learn: usize,
    /// Where a learned reference is written.
    #[arg(long, hide_short_help = true, value_name = "[NAME=]FILE", help_heading = "Reference and state")]
    save_reference: Vec<String>,
    /// Keeps the state of the session in FILE, so that a restart loses nothing.
    ///
    /// Trackers, monitors and what is learned so far, about a second behind at most (the more cameras --moving-target has, the more: eight,
    /// fifteen seconds). One session at a time.
    #[arg(long, hide_short_help = true, value_name = "FILE", help_heading = "Reference and state")]
    state: Option<PathBuf>,
    /// Reads the sources to their end and ends with a verdict.
    #[arg(long, help_heading = None)]
    once: bool,
    #[command(flatten)]
    motion: MotionArgs,
    #[command(flatten)]
    rig: RigArgs,
    #[command(flatten)]
    alarm: AlarmArgs,
    #[command(flatten)]
    pub outputs: OutputArgs,
    #[command(flatten, next_help_heading = "Outputs")]
    page: PageArgs,
}

/// See `Watch`.
pub fn run(args: &Watch) -> Result<Outcome> {
    if let Some(text) = &args.printed {
        crate::output::print(text)?;
        return Ok(Outcome::Answered);
    }
    let (names, cameras, config) = parts(args)?;
    watch(args, &names, cameras, config)
}

/// Flags that contradict each other.
fn check(args: &Watch) -> Result<()> {
    if args.learn < LEAST_READINGS {
        bail!("--learn {}: at least {LEAST_READINGS} readings are needed", args.learn);
    }
    if args.rig.rig.is_empty() && stand_for_cameras(args).is_empty() {
        bail!(
            "no camera is given: give --camera FILE and --target FILE; or, without files and without a target, its horizontal field of view and where the first image is kept: --hfov-deg DEG --save-landmarks FILE.png"
        );
    }
    if args.target.is_empty() && !(args.reference.is_empty() && args.save_reference.is_empty()) {
        bail!(
            "--reference and --save-reference belong to a --target; landmarks have --landmarks and --save-landmarks"
        );
    }
    if args.motion.moves() && !(args.reference.is_empty() && args.save_reference.is_empty()) {
        bail!("--motion moving compares with no reference; leave --reference and --save-reference out");
    }
    if args.motion.moves() && args.landmarks.count() != 0 {
        bail!(
            "--motion moving follows a pose; landmarks watch cameras that stand still: leave --landmarks and --save-landmarks out"
        );
    }
    Ok(())
}

/// Names, cameras and settings.
fn parts(args: &Watch) -> Result<(Names, Vec<LiveCamera>, LiveConfig)> {
    check(args)?;
    let rig = args.rig.cameras()?;
    let names = match &rig {
        Some(rig) => Names::of_rig(rig, &args.target),
        None => Names::new(&stand_for_cameras(args), &args.target),
    };
    let names = names.distinct()?;
    let config = config(args, &names, rig.as_deref())?;
    let cameras = cameras(args, &names, rig)?;
    Ok((names, cameras, config))
}

/// Runs the session, and says how it ended.
fn watch(args: &Watch, names: &Names, cameras: Vec<LiveCamera>, config: LiveConfig) -> Result<Outcome> {
    let (log, stop) = (Log::new(crate::output::remark), Arc::new(AtomicBool::new(false)));
    signals::stop_at_request(&stop)?;
    let mut request = request(args, names, cameras, config)?;
    let shown = args.page.server()?.map(|server| show(server, &mut request)).transpose()?;
    let text = EventText::new(names);
    let printer = args.outputs.printer(names);
    let ended = resight_watch::run(request, &log, &stop, |event| {
        if let Some(live) = &shown {
            live.take(&text, event);
        }
        printer.as_ref().map_or(Ok(()), |printer| printer.take(event))
    });
    let ended = ended.map_err(|reason| with_file(args, names, reason))?;
    let outcome = verdict(args, names, &ended, &log)?;
    match (outcome, ended.unsaved) {
        (Outcome::Moved, Some(reason)) => {
            log.say("watch", &format!("{:#}", anyhow::Error::new(reason)));
            Ok(Outcome::Moved) // What moved matters more than a file.
        }
        (_, Some(reason)) => Err(reason.into()),
        (outcome, None) => Ok(outcome),
    }
}

/// What is asked of the session.
fn request(args: &Watch, names: &Names, cameras: Vec<LiveCamera>, config: LiveConfig) -> Result<Request> {
    Ok(Request {
        names: names.clone(),
        cameras,
        config,
        state: args.state.clone(),
        save_references: saved("--save-reference", &args.save_reference, &names.pairs())?,
        save_landmarks: writable("--save-landmarks", args.landmarks.saved(names)?)?,
        outputs: args.outputs.config()?,
        false_alarms_per_day: args.alarm.false_alarms_per_day,
        is_once: args.once,
    })
}

/// The session of a session file.
///
/// # Errors
/// What is wrong with the file.
pub fn request_of(args: &Watch) -> Result<Request> {
    let (names, cameras, config) = parts(args)?;
    request(args, &names, cameras, config)
}

/// A page that shows this session, on a thread of its own.
fn show(mut server: Server, request: &mut Request) -> Result<Arc<Live>> {
    let live = Arc::new(Live::new(request));
    live.tap(request);
    server.show(Arc::clone(&live));
    crate::output::remark(&format!("the page of this session is http://{}/", server.place()));
    run_beside(server)?;
    Ok(live)
}

fn saved(flag: &str, given: &[String], names: &[String]) -> Result<Vec<Option<String>>> {
    writable(flag, by_name(flag, given, names)?)
}

/// Files that can be written, as far as can be known now.
fn writable(flag: &str, files: Vec<Option<String>>) -> Result<Vec<Option<String>>> {
    files.iter().flatten().try_for_each(|file| crate::files::can_be_written(flag, Path::new(file)))?;
    Ok(files)
}

/// Which reference image it is that a camera cannot be watched by.
fn with_file(args: &Watch, names: &Names, reason: Error) -> anyhow::Error {
    let file = match &reason {
        Error::Camera { camera, source: CameraWatcherError::Landmarks(_), .. } => {
            args.landmarks.file(names, *camera)
        }
        _ => None,
    };
    let reason = anyhow::Error::new(reason);
    match file {
        Some(file) => reason.context(format!("--landmarks {file}")),
        None => reason,
    }
}

fn verdict(args: &Watch, names: &Names, ended: &Ended, log: &Log) -> Result<Outcome> {
    if !args.once {
        return Ok(Outcome::Answered);
    }
    if args.outputs.is_printed() {
        for line in said::verdict_lines(names, args.outputs.json, &ended.states, &ended.moved) {
            outputs::print(&line)?;
        }
    } else {
        for (name, state) in names.pairs().iter().zip(&ended.states) {
            log.say("verdict", &format!("{name}: {}", state.as_ref().map_or("stale", said::word)));
        }
    }
    Ok(match ended.verdict() {
        Verdict::Steady => Outcome::Answered,
        Verdict::Unclear => Outcome::SomeUnanswered,
        Verdict::Moved => Outcome::Moved,
    })
}

fn cameras(args: &Watch, names: &Names, rig: Option<Vec<NamedCamera>>) -> Result<Vec<LiveCamera>> {
    let targets = targets(args)?;
    let references = by_name("--reference", &args.reference, &names.pairs())?;
    let mut landmarks = args.landmarks.read(names)?;
    let opened = sources::open(&args.sources, &names.cameras, args.once)?;
    let lenses = lenses(args, names, rig, &landmarks, opened)?;
    let mut cameras = Vec::new();
    for (i, (name, (camera, source))) in names.cameras.iter().zip(lenses).enumerate() {
        let watched = |(j, target): (usize, &Arc<resight::core::Target>)| {
            let file = references[names.pair_index(i, j)].as_ref();
            let reference = file.map(reference::read).transpose()?;
            Ok(Watched { name: names.targets[j].clone(), target: Arc::clone(target), reference })
        };
        let targets = targets.iter().enumerate().map(watched).collect::<Result<Vec<_>>>()?;
        let (landmarks, intrinsics) = (landmarks[i].take(), IntrinsicsCovariance::of(&camera));
        let camera = camera.camera;
        if targets.is_empty() && landmarks.is_none() {
            bail!("camera {name} has nothing to go by; give --target, or --landmarks {name}=PICTURE");
        }
        cameras.push(LiveCamera { name: name.clone(), camera, intrinsics, targets, landmarks, source });
    }
    Ok(cameras)
}

/// The arguments that name a camera each: files, or what is known of lenses; with neither, the reference images.
fn stand_for_cameras(args: &Watch) -> Vec<String> {
    let mut all: Vec<String> = args.camera.iter().chain(args.lens.arguments()).cloned().collect();
    if all.is_empty() {
        all.extend_from_slice(args.landmarks.images());
    }
    all
}

/// The lenses, with the sources whose first image one of them needed: from the rig's file, each from its own, or nominal ones where landmarks are all that is watched.
fn lenses(
    args: &Watch,
    names: &Names,
    rig: Option<Vec<NamedCamera>>,
    landmarks: &[Option<WatchedLandmarks>],
    sources: Vec<Box<dyn Source>>,
) -> Result<Vec<(NamedCamera, Box<dyn Source>)>> {
    if let Some(rig) = rig {
        return Ok(rig.into_iter().zip(sources).collect());
    }
    let files = by_name("--camera", &args.camera, &names.cameras)?;
    let lens = |(i, (file, source)): (usize, (&Option<String>, Box<dyn Source>))| match file {
        Some(file) => {
            crate::files::camera_must_exist(file)?;
            let (camera, remarks) = formats::read_camera_with_remarks(file)?;
            remarks.iter().for_each(|text| crate::output::remark(&format!("warning: {text}")));
            Ok((camera, source))
        }
        None if !args.target.is_empty() => bail!(
            "camera {} has no file; a pose from a target needs one: --camera {}=FILE",
            names.cameras[i],
            names.cameras[i]
        ),
        None => {
            let picture = args.landmarks.file(names, i);
            let (size, source) = args.lens.image_size(names, i, landmarks[i].as_ref(), source)?;
            Ok((args.lens.camera(names, i, size, picture.as_deref())?, source))
        }
    };
    files.iter().zip(sources).enumerate().map(lens).collect()
}

fn targets(args: &Watch) -> Result<Vec<Arc<resight::core::Target>>> {
    let read = |argument: &String| {
        let file: &Path = split(argument).1.as_ref();
        let (target, _) = super::target(file, &args.tags, crate::output::remark)?;
        super::warn_of_scale(file, &target, "a session");
        Ok(Arc::new(target))
    };
    args.target.iter().map(read).collect()
}

fn config(args: &Watch, names: &Names, cameras: Option<&[NamedCamera]>) -> Result<LiveConfig> {
    let rig = args.rig.config(cameras, names.cameras.len())?;
    if rig.is_some() && args.landmarks.count() != 0 {
        bail!(
            "--moving-target watches the cameras' places among each other; landmarks go with targets that stand still, or with none"
        );
    }
    if rig.is_some() && !(args.reference.is_empty() && args.save_reference.is_empty()) {
        bail!(
            "--reference and --save-reference are of cameras against targets that stand still; with --moving-target give --rig FILE (`resight rig -o` writes one), or --state to keep what is learned"
        );
    }
    // A rig is one test, pairs are one each.
    let tests = if rig.is_some() { 1 } else { monitors(args, names) };
    Ok(LiveConfig {
        monitor: args.alarm.monitor(tests),
        track: args.motion.track()?,
        learn_readings: args.learn,
        correlated: args.alarm.correlated(rig.is_some()),
        rig,
        ..LiveConfig::default()
    })
}

/// All that may raise an alarm share its rate: every pair, and the landmarks that stand in for targets.
fn monitors(args: &Watch, names: &Names) -> usize {
    match args.target.is_empty() {
        true => names.pairs().len(),
        false => names.pairs().len() + args.landmarks.count(),
    }
}
