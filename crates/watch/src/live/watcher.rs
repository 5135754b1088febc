//! The thread that processes the frames of one camera and reports observations and states.

use super::look::{CameraWatcher, FrameResult};
use super::memory::Memory;
use super::queue::{Queue, Taken};
use super::reader::{Arrived, PATIENCE};
use super::relearn::Relearn;
use super::sparingly::Sparingly;
use super::turns::Turns;
use super::{CheckingReason, Event, State};
use crate::source::Content;
use std::sync::mpsc::SyncSender;
use std::time::Instant;

/// Processes frames until their queue is closed and empty.
pub(super) struct Watcher<'a> {
    look: CameraWatcher,
    memory: Memory<'a>,
    queue: &'a Queue<Arrived>,
    turns: &'a Turns,
    relearn: Relearn,
    teller: Teller,
    /// Capture time and arrival of the last processed frame: they give the time of the frames' clock while none arrives.
    last: Option<(f64, Instant)>,
    /// Whether a frame could be read; before that no time is certain to be of this camera's clock.
    has_begun: bool,
    /// Whether there is something that the state file does not contain yet.
    is_new: bool,
    /// Number of images that were not used, copies of the one before, and the reason for the last.
    unused: (u64, String),
}

impl<'a> Watcher<'a> {
    pub fn new(
        camera: usize,
        (look, memory): (CameraWatcher, Memory<'a>),
        queue: &'a Queue<Arrived>,
        (turns, relearn): (&'a Turns, Relearn),
        event_sender: SyncSender<Event>,
    ) -> Self {
        let teller = Teller { camera, event_sender, states: Vec::new(), dropped: Sparingly::default() };
        let unused = (0, String::new());
        let (last, has_begun, is_new) = (None, false, false);
        Watcher { look, memory, queue, turns, relearn, teller, last, has_begun, is_new, unused }
    }

    pub fn watch(&mut self) {
        let mut is_reported = self.resume();
        while is_reported {
            is_reported = match self.queue.take(PATIENCE) {
                Taken::Item(arrived) => self.frame(arrived),
                Taken::Nothing => self.silence(),
                Taken::Closed => return self.end(),
            };
            // What was not reported is not kept in the state: it is processed again.
            self.is_new = self.is_new && !(is_reported && self.memory.keep(&self.look, self.last, false));
        }
        self.queue.close();
    }

    /// Reports that this thread or the reading one has failed, so that the state is unknown.
    pub fn fail(&mut self, reason: String) {
        self.queue.close();
        let camera = self.teller.camera;
        self.teller.tell(Event::Source { camera, connected: false, reason: Some(reason) });
        let t_s = self.now_s().unwrap_or(0.0);
        let stale = |_: &Option<State>| State::Stale { for_s: 0.0, reason: None };
        self.teller.states(t_s, self.teller.states.iter().map(stale).collect());
        self.teller.tell(Event::Ended { camera });
    }

    fn now_s(&self) -> Option<f64> {
        self.last.map(|(capture_s, arrived)| capture_s + arrived.elapsed().as_secs_f64())
    }

    /// Reports the states after the pause: what was not processed was not observed.
    fn resume(&mut self) -> bool {
        let Some((last_s, ago_s)) = self.memory.resumed else { return true };
        self.last = Some((last_s + ago_s, Instant::now()));
        self.teller.states(last_s + ago_s, self.look.states(last_s + ago_s))
    }

    fn frame(&mut self, mut came: Arrived) -> bool {
        let (arrived, frame) = (came.at, &mut came.frame);
        let turn = self.turns.take();
        let waited_us = arrived.elapsed().as_secs_f64() * 1e6;
        if self.relearn.take(self.teller.camera) {
            self.look.learn_anew();
        }
        self.look.count_key_frames(came.key_frames);
        let now_s = self.now_s().filter(|_| self.memory.resumed.is_some());
        let (t_s, looked) = match now_s {
            // A frame processed long ago does not show the present state.
            Some(now_s) if self.look.is_old(frame) => (now_s, self.look.passed_over(frame, waited_us, now_s)),
            now_s => {
                self.has_begun |= !matches!(frame.content, Content::Unreadable(_));
                frame.capture_s = now_s.filter(|_| !self.has_begun).unwrap_or(frame.capture_s);
                if self.has_begun || now_s.is_none() {
                    self.last = Some((frame.capture_s, arrived));
                }
                self.is_new |= self.has_begun;
                (frame.capture_s, self.look.take(frame, waited_us))
            }
        };
        let is_image = matches!(frame.content, Content::Image(_));
        if let Some(observation) = looked.first().map(|looked| &looked.observation)
            && is_image
            && !observation.is_readable
        {
            self.unused = (self.unused.0 + 1, observation.reason.clone().unwrap_or_default());
        }
        drop(turn); // The receiver of the event may be slow.
        self.queue.give_back(came);
        self.teller.looked(t_s, looked)
            && self.compared(t_s, false)
            && self.promised(t_s)
            && self.dropped(false)
    }

    fn compared(&mut self, t_s: f64, is_end: bool) -> bool {
        let (camera, compared) = (self.teller.camera, self.look.compared(is_end));
        compared.into_iter().all(|(target, deviation)| {
            let deviation = Box::new(deviation);
            self.teller.tell(Event::Compared { camera, target, t_s, deviation })
        })
    }

    fn promised(&mut self, t_s: f64) -> bool {
        let (camera, promised) = (self.teller.camera, self.look.promised(t_s));
        promised.into_iter().all(|(target, promise)| {
            self.teller.tell(Event::Promised { camera, target, t_s, promise: Box::new(promise) })
        })
    }

    fn silence(&mut self) -> bool {
        let now_s = self.now_s();
        now_s.is_none_or(|now_s| self.teller.states(now_s, self.look.states(now_s))) && self.dropped(false)
    }

    fn dropped(&mut self, is_end: bool) -> bool {
        self.teller.dropped(self.queue.take_dropped(), is_end)
    }

    fn end(&mut self) {
        if let Some(reason) = self.queue.take_failure() {
            return self.fail(reason);
        }
        self.dropped(true);
        let (frames, reason) = std::mem::take(&mut self.unused);
        if 0 < frames {
            self.teller.tell(Event::LeftOut { camera: self.teller.camera, frames, reason });
        }
        if let Some((t_s, _)) = self.last {
            self.compared(t_s, true);
            self.promised(t_s);
            self.teller.at_the_end(t_s, self.look.states_at_the_end(t_s));
        }
        if self.is_new {
            self.memory.keep(&self.look, self.last, true);
        }
        self.teller.tell(Event::Ended { camera: self.teller.camera });
    }
}

/// Reports events. Every method returns false once the receiver is gone.
struct Teller {
    camera: usize,
    event_sender: SyncSender<Event>,
    /// The last reported state of each target.
    states: Vec<Option<State>>,
    dropped: Sparingly,
}

impl Teller {
    fn tell(&self, event: Event) -> bool {
        self.event_sender.send(event).is_ok()
    }

    fn looked(&mut self, t_s: f64, looked: Vec<FrameResult>) -> bool {
        let camera = self.camera;
        looked.into_iter().enumerate().all(|(target, looked)| {
            let observation = Box::new(looked.observation);
            let promise = looked.promise;
            let learned =
                looked.learned.map(|reference| Event::Learned { camera, target, reference, promise });
            let moved = looked.unsettled.map(|unsettled| Event::MovedWhileLearning {
                camera,
                target,
                alternatives: Vec::new(),
                unsettled,
            });
            self.tell(Event::Observed { camera, target, observation })
                && moved.is_none_or(|event| self.tell(event))
                && learned.is_none_or(|event| self.tell(event))
                && self.state(target, t_s, looked.state)
        })
    }

    fn states(&mut self, t_s: f64, states: Vec<State>) -> bool {
        states.into_iter().enumerate().all(|(target, state)| self.state(target, t_s, state))
    }

    /// Reports a change of kind, or of a drift's size; not the duration of a stale state, nor each reading learned.
    fn state(&mut self, target: usize, t_s: f64, state: State) -> bool {
        self.states.resize(self.states.len().max(target + 1), None);
        let is_new = match (&self.states[target], &state) {
            (Some(State::Learning { .. }), State::Learning { .. })
            | (Some(State::Stale { .. }), State::Stale { .. }) => false,
            (Some(State::Drifted(before)), State::Drifted(now)) => before.began_s != now.began_s,
            (Some(State::Checking(CheckingReason::Away(_))), State::Checking(CheckingReason::Away(_))) => {
                false
            }
            (before, now) => before.as_ref() != Some(now),
        };
        self.states[target] = Some(state.clone());
        !is_new || self.tell(Event::StateChanged { camera: self.camera, target, t_s, state })
    }

    /// Reports drifts and deviations again at the end, where their estimates are better, and stale states, where their reasons are.
    fn at_the_end(&self, t_s: f64, states: Vec<State>) {
        let camera = self.camera;
        for (target, state) in states.into_iter().enumerate() {
            let is_news = match (&state, self.states.get(target)) {
                (State::Stale { reason, .. }, Some(Some(State::Stale { reason: before, .. }))) => {
                    reason != before
                }
                (State::Stale { .. }, before) => matches!(before, Some(Some(State::Learning { .. }))),
                (State::Drifted(_) | State::Checking(CheckingReason::Away(_)), _) => true,
                _ => false,
            };
            if is_news {
                self.tell(Event::StateChanged { camera, target, t_s, state });
            }
        }
    }

    fn dropped(&mut self, frames: u64, is_end: bool) -> bool {
        self.dropped.add(frames);
        let due = self.dropped.due(Instant::now(), is_end);
        due.is_none_or(|frames| self.tell(Event::Dropped { camera: self.camera, frames }))
    }
}
