//! The threads of a session: for each camera one that reads its source and one that looks at its frames.

use super::look::{Look, LookError, Looked};
use super::queue::{Queue, Taken};
use super::reader::{PATIENCE, Reader};
use super::rig::{Nodes, Relations};
use super::state::{EVERY, StateFile, unix_s};
use super::{Event, LiveCamera, LiveConfig, State};
use crate::source::{Frame, Source};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{SyncSender, sync_channel};
use std::thread;
use std::time::Instant;

/// Events waiting to be taken; a slow listener makes the cameras wait, and their queues drop.
const EVENTS: usize = 256;

/// Runs until every source has ended or `stop` is set, telling `listener` each event. False from the listener ends the session too.
///
/// # Errors
/// A camera that cannot be watched, before anything has started.
pub fn run(
    cameras: Vec<LiveCamera>,
    config: &LiveConfig,
    stop: &Arc<AtomicBool>,
    listener: impl FnMut(&Event) -> bool,
) -> Result<(), LookError> {
    run_from(cameras, config, stop, None, listener)
}

/// As `run`, going on from the state in a file, and keeping that file up to date: never more than about a second behind.
///
/// # Errors
/// As `run`; a state that is not one of these cameras is no error but begins anew.
pub fn run_from(
    cameras: Vec<LiveCamera>,
    config: &LiveConfig,
    stop: &Arc<AtomicBool>,
    state: Option<&StateFile>,
    mut listener: impl FnMut(&Event) -> bool,
) -> Result<(), LookError> {
    let mut nodes = nodes(&cameras);
    let prepared =
        cameras.into_iter().map(|camera| prepare(camera, config, state)).collect::<Result<Vec<_>, _>>()?;
    nodes.references = prepared.iter().flat_map(|(look, ..)| look.references()).collect();
    let mut relations = Relations::new(nodes, config);
    let (sender, events) = sync_channel(EVENTS);
    thread::scope(|scope| {
        if let Some(state) = state {
            scope.spawn(|| state.keep());
        }
        for (index, (look, source, memory)) in prepared.into_iter().enumerate() {
            let queue = Arc::new(Queue::new(config.queue_frames));
            let (to_look, told) = (Arc::clone(&queue), sender.clone());
            scope.spawn(move || {
                Reader { camera: index, config, queue: &queue, told: &told, stop }.read(source);
            });
            let told = sender.clone();
            scope.spawn(move || watch(look, memory, index, &to_look, &told));
        }
        drop(sender); // The channel ends with the last thread.
        let mut tell = |event: &Event| {
            if !stop.load(Ordering::Relaxed) && !listener(event) {
                stop.store(true, Ordering::Relaxed);
            }
        };
        for event in events {
            relations.take(event).iter().for_each(&mut tell);
        }
        relations.finish().iter().for_each(&mut tell);
        if let Some(state) = state {
            state.close();
        }
    });
    Ok(())
}

/// What all threads together are about. Every camera watches the same targets.
fn nodes(cameras: &[LiveCamera]) -> Nodes {
    let targets = cameras.first().map(|camera| camera.targets.as_slice()).unwrap_or_default();
    Nodes {
        cameras: cameras.iter().map(|camera| camera.name.clone()).collect(),
        lenses: cameras.iter().map(|camera| camera.camera.clone()).collect(),
        targets: targets.iter().map(|watched| watched.name.clone()).collect(),
        is_live: cameras.iter().map(|camera| camera.source.is_live()).collect(),
        references: Vec::new(),
    }
}

fn prepare<'a>(
    camera: LiveCamera,
    config: &LiveConfig,
    state: Option<&'a StateFile>,
) -> Result<(Look, Box<dyn Source>, Memory<'a>), LookError> {
    let mut look = Look::new(&camera, config)?;
    let mut memory = Memory { name: camera.name.clone(), state, resumed: None, due: Instant::now() };
    memory.restore(&mut look, &camera);
    Ok((look, camera.source, memory))
}

/// What a camera remembers from one session to the next.
struct Memory<'a> {
    name: String,
    state: Option<&'a StateFile>,
    /// Capture time of the earlier session's last frame, and how long ago that was, seconds.
    resumed: Option<(f64, f64)>,
    due: Instant,
}

impl Memory<'_> {
    fn restore(&mut self, look: &mut Look, camera: &LiveCamera) {
        let Some((state, record)) = self.state.and_then(|state| Some((state, state.of(&camera.name)?)))
        else {
            return;
        };
        let refused = |target: usize, reason: String| {
            let target = camera.targets.get(target).map_or("landmarks", |watched| watched.name.as_str());
            state.say(&format!("{} with {target} begins anew: {reason}", camera.name));
        };
        if look.restore(&record, refused) {
            let ago_s = (unix_s() - record.last_unix_s).max(0.0);
            state.say(&format!("{} goes on from {:.3} s, {ago_s:.1} s ago", camera.name, record.last_s));
            self.resumed = Some((record.last_s, ago_s));
        }
    }

    /// Hands the state over when it is time; at the end it always is.
    /// True when it did.
    fn keep(&mut self, look: &Look, last: Option<(f64, Instant)>, is_end: bool) -> bool {
        let (Some(state), Some((last_s, arrived))) = (self.state, last) else { return false };
        let is_due = is_end || self.due <= Instant::now();
        if is_due {
            self.due = Instant::now() + EVERY;
            state.put(look.record(&self.name, last_s, arrived.elapsed().as_secs_f64()));
        }
        is_due
    }
}

/// Looks at the frames until the queue is closed and empty.
fn watch(
    mut look: Look,
    mut memory: Memory,
    camera: usize,
    queue: &Queue<(Instant, Frame)>,
    told: &SyncSender<Event>,
) {
    let mut teller = Teller { camera, told, states: Vec::new() };
    // Capture time and arrival of the last frame: what the clock of the frames says while none comes.
    let mut last: Option<(f64, Instant)> = None;
    if let Some((last_s, ago_s)) = memory.resumed {
        // How things stand after the pause: what was not looked at was not seen.
        let is_told = teller.states(last_s + ago_s, look.states(last_s + ago_s));
        last = is_told.then(|| (last_s + ago_s, Instant::now()));
    }
    let mut is_new = false;
    loop {
        let is_told = match queue.take(PATIENCE) {
            Taken::Item((arrived, frame)) => {
                let t_s = look.time_s(&frame);
                (last, is_new) = (Some((t_s, arrived)), true);
                let looked = look.take(&frame, arrived.elapsed().as_secs_f64() * 1e6);
                queue.give_back((arrived, frame));
                teller.looked(t_s, looked) && teller.dropped(queue.take_dropped())
            }
            Taken::Nothing => {
                let now_s = last.map(|(capture_s, arrived)| capture_s + arrived.elapsed().as_secs_f64());
                now_s.is_none_or(|now_s| teller.states(now_s, look.states(now_s)))
            }
            Taken::Closed => {
                if let Some((t_s, _)) = last {
                    teller.at_the_end(t_s, look.states(t_s));
                }
                break;
            }
        };
        is_new = is_new && !memory.keep(&look, last, !is_told);
        if !is_told {
            queue.close();
            return;
        }
    }
    if is_new {
        memory.keep(&look, last, true);
    }
    teller.tell(Event::Ended { camera });
}

/// Tells what is new. Every method is false once nobody listens.
struct Teller<'a> {
    camera: usize,
    told: &'a SyncSender<Event>,
    /// As last told, for each target.
    states: Vec<Option<State>>,
}

impl Teller<'_> {
    fn tell(&self, event: Event) -> bool {
        self.told.send(event).is_ok()
    }

    fn looked(&mut self, t_s: f64, looked: Vec<Looked>) -> bool {
        let camera = self.camera;
        looked.into_iter().enumerate().all(|(target, looked)| {
            let observation = Box::new(looked.observation);
            let learned = looked.learned.map(|reference| Event::Learned { camera, target, reference });
            self.tell(Event::Observed { camera, target, observation })
                && learned.is_none_or(|event| self.tell(event))
                && self.state(target, t_s, looked.state)
        })
    }

    fn states(&mut self, t_s: f64, states: Vec<State>) -> bool {
        states.into_iter().enumerate().all(|(target, state)| self.state(target, t_s, state))
    }

    /// A change of kind, or of a drift's size: not the seconds that something has been unseen, nor each reading learned.
    fn state(&mut self, target: usize, t_s: f64, state: State) -> bool {
        self.states.resize(self.states.len().max(target + 1), None);
        let is_new = match (&self.states[target], &state) {
            (Some(State::Learning { .. }), State::Learning { .. })
            | (Some(State::Unseen { .. }), State::Unseen { .. }) => false,
            (Some(State::Drifted(before)), State::Drifted(now)) => before.began_s != now.began_s,
            (before, now) => before.as_ref() != Some(now),
        };
        self.states[target] = Some(state.clone());
        !is_new || self.tell(Event::StateChanged { camera: self.camera, target, t_s, state })
    }

    /// A drift is known better at the end than when it was told.
    fn at_the_end(&self, t_s: f64, states: Vec<State>) {
        let camera = self.camera;
        for (target, state) in states.into_iter().enumerate() {
            if matches!(state, State::Drifted(_)) {
                self.tell(Event::StateChanged { camera, target, t_s, state });
            }
        }
    }

    fn dropped(&mut self, frames: u64) -> bool {
        frames == 0 || self.tell(Event::Dropped { camera: self.camera, frames })
    }
}
