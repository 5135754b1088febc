//! A whole session: what it watches, its outputs, what it saves, and its result.

use crate::error::Error;
use crate::live::{self, Event, LiveCamera, LiveConfig, State, StateFile};
use crate::log::Log;
use crate::names::Names;
use crate::outputs::said::{Moved, Verdict, verdict};
use crate::outputs::{self, OutputsConfig, Session};
use crate::saved::Saved;
use resight::FileError;
use resight::core::temporal::monitor::Reference;
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::AtomicBool;

/// The settings of a session.
pub struct Request {
    /// Names of cameras and targets, in the order of `cameras`.
    pub names: Names,
    /// The cameras, with their targets and sources.
    pub cameras: Vec<LiveCamera>,
    /// Settings of tracking and of the test of motion.
    pub config: LiveConfig,
    /// The file that keeps the session's state, so that a restart loses nothing.
    pub state: Option<PathBuf>,
    /// Files for learned references, by the indices of `Names::pairs`; pairs beyond the end are not written.
    pub save_references: Vec<Option<String>>,
    /// Files for reference images of landmarks, by camera.
    pub save_landmarks: Vec<Option<String>>,
    /// The outputs of events, besides the listener.
    pub outputs: OutputsConfig,
    /// Number of false alarms allowed per day; outputs state it.
    pub false_alarms_per_day: f64,
    /// Whether the session ends with its sources, without waiting until its outputs have been viewed.
    pub is_once: bool,
}

impl Request {
    /// Watches these cameras, all of the same targets, with no output but the listener.
    pub fn new(cameras: Vec<LiveCamera>, config: LiveConfig) -> Self {
        let target = |first: &LiveCamera| first.targets.iter().map(|target| target.name.clone()).collect();
        let targets: Vec<String> = cameras.first().map(target).unwrap_or_default();
        let targets = if targets.is_empty() { vec!["landmarks".to_string()] } else { targets };
        let names = Names { cameras: cameras.iter().map(|camera| camera.name.clone()).collect(), targets };
        Request {
            names,
            cameras,
            config,
            state: None,
            save_references: Vec::new(),
            save_landmarks: Vec::new(),
            outputs: OutputsConfig::default(),
            false_alarms_per_day: 0.0,
            is_once: true,
        }
    }
}

/// The result of a session.
#[derive(Debug)]
pub struct Ended {
    /// The last state of each pair, by the indices of `Names::pairs`; none for those without a state.
    pub states: Vec<Option<State>>,
    /// What moved, according to the last report.
    pub moved: Moved,
    /// The error of a reference or reference image that could not be written even at the end.
    pub unsaved: Option<FileError>,
}

impl Ended {
    /// Returns the result in one word.
    pub fn verdict(&self) -> Verdict {
        verdict(&self.states, &self.moved)
    }
}

/// Runs until every source has ended or `stop` is set. Each event goes to `listener` first, then to the outputs; an error of any of them ends
/// the session, after all have received the event.
///
/// # Errors
/// Before anything has started: a camera that cannot be watched, an output that cannot be used, a file of another kind as state. Later: the
/// error of a listener or an output.
pub fn run(
    request: Request,
    log: &Log,
    stop: &Arc<AtomicBool>,
    mut listener: impl FnMut(&Event) -> std::io::Result<()>,
) -> Result<Ended, Error> {
    let Request { names, cameras, config, .. } = request;
    let mut saved = Saved::new(&names, request.save_references, request.save_landmarks, log);
    let state = request.state.map(|path| remembered(&path, log)).transpose()?;
    let session = Session {
        names: &names,
        references: references(&cameras, &config, state.as_ref())?,
        false_alarms_per_day: request.false_alarms_per_day,
        log,
        stop,
        is_once: request.is_once,
    };
    let mut outputs = outputs::open(&request.outputs, &session)?;
    let (mut states, mut moved) = (vec![None; names.pairs().len()], Moved::default());
    let mut reported = Ok(());
    live::run_from(cameras, &config, stop, state.as_ref(), |event| {
        moved.take(event);
        if let Event::StateChanged { camera, target, state, .. } = event {
            states[names.pair_index(*camera, *target)] = Some(state.clone());
        }
        saved.take(event);
        let heard = listener(event).map_err(Error::from);
        reported = heard.and(outputs::tell(&mut outputs, |output| output.take(event)).map_err(Error::from));
        reported.is_ok()
    })?;
    let finished = outputs::tell(&mut outputs, |output| output.finish());
    let unsaved = saved.finish().err();
    reported.and(finished.map_err(Error::from))?;
    Ok(Ended { states, moved, unsaved })
}

/// Returns the reference of each pair where it is known before the first frame; fails for a camera that cannot be watched.
fn references(
    cameras: &[LiveCamera],
    config: &LiveConfig,
    state: Option<&StateFile>,
) -> Result<Vec<Option<Reference>>, Error> {
    let mut all = Vec::new();
    for (camera, watched) in cameras.iter().enumerate() {
        let name = || watched.name.clone();
        let known = live::references(watched, config, state);
        all.extend(known.map_err(|source| Error::Camera { camera, name: name(), source })?);
    }
    Ok(all)
}

fn remembered(path: &std::path::Path, log: &Log) -> Result<StateFile, FileError> {
    let log = log.clone();
    StateFile::open(path, move |text| log.say("state", text))
}
