//! The threads of a session: for each camera one that reads its source and one that looks at its frames.

use super::look::{Look, LookError, Looked};
use super::queue::{Queue, Taken};
use super::reader::{PATIENCE, Reader};
use super::rig::{Nodes, Relations};
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
    mut listener: impl FnMut(&Event) -> bool,
) -> Result<(), LookError> {
    let mut relations = Relations::new(nodes(&cameras), config);
    let prepared =
        cameras.into_iter().map(|camera| prepare(camera, config)).collect::<Result<Vec<_>, _>>()?;
    let (sender, events) = sync_channel(EVENTS);
    thread::scope(|scope| {
        for (index, (look, source)) in prepared.into_iter().enumerate() {
            let queue = Arc::new(Queue::new(config.queue_frames));
            let (to_look, told) = (Arc::clone(&queue), sender.clone());
            scope.spawn(move || {
                Reader { camera: index, config, queue: &queue, told: &told, stop }.read(source);
            });
            let told = sender.clone();
            scope.spawn(move || watch(look, index, &to_look, &told));
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
        references: cameras
            .iter()
            .flat_map(|camera| &camera.targets)
            .map(|watched| watched.reference)
            .collect(),
    }
}

fn prepare(camera: LiveCamera, config: &LiveConfig) -> Result<(Look, Box<dyn Source>), LookError> {
    Ok((Look::new(&camera, config)?, camera.source))
}

/// Looks at the frames until the queue is closed and empty.
fn watch(mut look: Look, camera: usize, queue: &Queue<(Instant, Frame)>, told: &SyncSender<Event>) {
    let mut teller = Teller { camera, told, states: Vec::new() };
    // Capture time and arrival of the last frame: what the clock of the frames says while none comes.
    let mut last: Option<(f64, Instant)> = None;
    loop {
        let is_told = match queue.take(PATIENCE) {
            Taken::Item((arrived, frame)) => {
                last = Some((frame.capture_s, arrived));
                let looked = look.take(&frame, arrived.elapsed().as_secs_f64() * 1e6);
                teller.looked(frame.capture_s, looked) && teller.dropped(queue.take_dropped())
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
        if !is_told {
            queue.close();
            return;
        }
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
