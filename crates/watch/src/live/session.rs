//! The threads of a session: for each camera one that reads its source and one that processes its frames.

use super::guard::{Ending, guarded};
use super::look::{CameraWatcher, CameraWatcherError};
use super::memory::Memory;
use super::outlet::Outlet;
use super::pace::Pace;
use super::queue::Queue;
use super::reader::{PATIENCE, Reader};
use super::rig::{Nodes, Relations};
use super::state::{StateFile, rig_settings};
use super::turns::Turns;
use super::watcher::Watcher;
use super::{Event, LiveCamera, LiveConfig};
use crate::source::Source;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::thread;
use std::time::Instant;

/// Events that may wait for the listener; a slow listener makes the cameras wait, and their queues drop frames.
const EVENTS: usize = 256;

/// Runs until every source has ended or `stop` is set, and passes each event to `listener`. After `stop` no more is read, and what was read is
/// still processed and reported. A return of false from the listener ends the session at once; it receives nothing more.
///
/// # Errors
/// A camera that cannot be watched, before anything has started.
pub fn run(
    cameras: Vec<LiveCamera>,
    config: &LiveConfig,
    stop: &Arc<AtomicBool>,
    listener: impl FnMut(&Event) -> bool,
) -> Result<(), CameraWatcherError> {
    run_from(cameras, config, stop, None, listener)
}

/// Runs as `run`, continues from the state in a file, and keeps that file at most about a second behind.
///
/// # Errors
/// Those of `run`; a state of other cameras is no error but starts anew.
pub fn run_from(
    cameras: Vec<LiveCamera>,
    config: &LiveConfig,
    stop: &Arc<AtomicBool>,
    state: Option<&StateFile>,
    mut listener: impl FnMut(&Event) -> bool,
) -> Result<(), CameraWatcherError> {
    let mut nodes = nodes(&cameras, config);
    // The cameras of a rig continue from the rig's last frames, and the state is the rig's.
    let own = state.filter(|_| config.rig.is_none());
    let mut prepared =
        cameras.into_iter().map(|camera| prepare(camera, config, own)).collect::<Result<Vec<_>, _>>()?;
    nodes.references = prepared.iter().flat_map(|camera| camera.look.references()).collect();
    nodes.monitors = prepared.iter().flat_map(|camera| camera.look.monitors()).collect();
    let pace = Arc::clone(&nodes.pace);
    let mut relations = Relations::new(nodes, config, state);
    for (camera, Prepared { look, memory, .. }) in prepared.iter_mut().enumerate() {
        if let Some(resumed) = relations.resumed(camera) {
            look.resume(resumed.0);
            memory.resumed = Some(resumed);
        }
    }
    let (sender, events) = sync_channel(EVENTS);
    let turns = Turns::new();
    thread::scope(|scope| {
        let _ending = Ending { stop, state };
        if let Some(state) = state {
            scope.spawn(|| state.keep());
        }
        for (camera, Prepared { look, source, memory }) in prepared.into_iter().enumerate() {
            let queue = Arc::new(Queue::new(config.queue_frames));
            let (to_look, event_sender, resumed, pace) =
                (Arc::clone(&queue), sender.clone(), memory.resumed, Arc::clone(&pace));
            scope.spawn(move || {
                let reader = Reader {
                    camera,
                    config,
                    queue: &queue,
                    event_sender: &event_sender,
                    stop,
                    pace: &pace,
                    resumed,
                };
                if let Err(reason) = guarded(|| reader.read(source)) {
                    queue.fail(reason);
                }
            });
            let (event_sender, turns) = (sender.clone(), &turns);
            scope.spawn(move || {
                let shared = (turns, config.relearn.clone());
                let mut watcher = Watcher::new(camera, (look, memory), &to_look, shared, event_sender);
                if let Err(reason) = guarded(|| watcher.watch()) {
                    watcher.fail(reason);
                }
            });
        }
        drop(sender); // drop(sender); // The channel ends with the last thread.
        hear(events, &mut relations, state, &mut |event| {
            let goes_on = listener(event);
            if !goes_on {
                stop.store(true, Ordering::Relaxed);
            }
            goes_on
        });
    });
    Ok(())
}

/// Runs until all threads have ended, or `tell` returns false, after which the threads find their receiver gone.
fn hear(
    events: Receiver<Event>,
    relations: &mut Relations,
    state: Option<&StateFile>,
    tell: &mut impl FnMut(&Event) -> bool,
) {
    let mut outlet = Outlet::default();
    loop {
        let event_sender = match events.recv_timeout(PATIENCE) {
            Ok(event) => relations.take(event),
            Err(RecvTimeoutError::Timeout) => relations.idle(),
            Err(RecvTimeoutError::Disconnected) => break,
        };
        let late = if event_sender.is_empty() { outlet.idle(Instant::now()) } else { Vec::new() };
        let due = event_sender.into_iter().flat_map(|event| outlet.take(event)).chain(late);
        if !due.into_iter().all(|event| tell(&event)) {
            return; // return; // What was not reported is not kept in the state: it is processed again.
        }
        relations.keep(state, false);
    }
    let last: Vec<Event> = relations.finish().into_iter().flat_map(|event| outlet.take(event)).collect();
    if last.iter().chain(&outlet.finish()).all(tell) {
        relations.keep(state, true);
    }
}

/// Returns the cameras and targets common to all threads. Every camera watches the same targets.
fn nodes(cameras: &[LiveCamera], config: &LiveConfig) -> Nodes {
    let targets = cameras.first().map(|camera| camera.targets.as_slice()).unwrap_or_default();
    Nodes {
        cameras: cameras.iter().map(|camera| camera.name.clone()).collect(),
        lenses: cameras.iter().map(|camera| camera.camera.clone()).collect(),
        targets: targets.iter().map(|watched| watched.name.clone()).collect(),
        is_live: cameras.iter().map(|camera| camera.source.is_live()).collect(),
        settings: config.rig.as_ref().map(|rig| rig_settings(cameras, rig, config)).unwrap_or_default(),
        references: Vec::new(),
        monitors: Vec::new(),
        pace: Arc::new(Pace::new(cameras.len())),
    }
}

struct Prepared<'a> {
    look: CameraWatcher,
    source: Box<dyn Source>,
    memory: Memory<'a>,
}

fn prepare<'a>(
    camera: LiveCamera,
    config: &LiveConfig,
    state: Option<&'a StateFile>,
) -> Result<Prepared<'a>, CameraWatcherError> {
    let mut look = CameraWatcher::new(&camera, config)?;
    let memory = Memory::restore(&mut look, &camera, state);
    Ok(Prepared { look, source: camera.source, memory })
}
