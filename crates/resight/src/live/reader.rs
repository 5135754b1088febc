//! The thread that reads a source: frames into the queue, losses and steps of the clock told.

use super::clock::{CaptureClock, Stamp};
use super::queue::Queue;
use super::{Event, LiveConfig};
use crate::source::{Content, Frame, Next, Source};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::{Duration, Instant};

/// How long a thread waits before it looks whether the session is to end, and whether a camera has been silent too long.
pub(super) const PATIENCE: Duration = Duration::from_millis(100);
/// Longest pause before a lost source is tried again, in first pauses.
const LONGEST_RETRY: f64 = 32.0;
/// Frames left out are told at once, then together for this long.
const TELL_AGAIN: Duration = Duration::from_secs(60);

/// Reads one source until it ends.
pub(super) struct Reader<'a> {
    pub camera: usize,
    pub config: &'a LiveConfig,
    pub queue: &'a Queue<(Instant, Frame)>,
    pub told: &'a SyncSender<Event>,
    pub stop: &'a AtomicBool,
}

/// What is remembered between frames.
struct Progress {
    is_there: bool,
    pause_s: f64,
    clock: CaptureClock,
    started: Instant,
    /// Whether the source made us wait for the next frame.
    waited: bool,
    left_out: LeftOut,
}

/// Frames left out that are not yet told.
#[derive(Default)]
struct LeftOut {
    frames: u64,
    reason: String,
    told: Option<Instant>,
}

impl Reader<'_> {
    pub fn read(&self, mut source: Box<dyn Source>) {
        let mut progress = Progress {
            is_there: true,
            pause_s: self.config.retry_s,
            clock: CaptureClock::default(),
            started: Instant::now(),
            waited: false,
            left_out: LeftOut::default(),
        };
        while !self.stop.load(Ordering::Relaxed) {
            for (_, spent) in self.queue.take_back() {
                if let Content::Image(picture) = spent.content {
                    source.reuse(picture);
                }
            }
            match source.next(PATIENCE) {
                Next::Frame(frame) => {
                    if !self.take(frame, source.is_live(), &mut progress) {
                        break;
                    }
                }
                Next::Nothing => progress.waited = true,
                Next::Lost(reason) => self.lost(&reason.to_string(), &mut progress),
                Next::End => break,
            }
        }
        self.left_out(&mut progress.left_out, Duration::ZERO);
        self.queue.close();
    }

    /// A listener that is gone needs no telling.
    fn tell(&self, event: Event) {
        let _ = self.told.send(event);
    }

    /// False when nobody looks at the frames any more.
    fn take(&self, mut frame: Frame, is_live: bool, progress: &mut Progress) -> bool {
        if !progress.is_there {
            self.tell(Event::Source { camera: self.camera, is_there: true, reason: None });
        }
        (progress.is_there, progress.pause_s) = (true, self.config.retry_s);
        let arrived = Instant::now();
        self.stamp(&mut frame, arrived, is_live, progress);
        if let Content::Unreadable(reason) = &frame.content {
            progress.left_out.frames += 1;
            progress.left_out.reason.clone_from(reason);
        }
        self.left_out(&mut progress.left_out, TELL_AGAIN);
        if is_live {
            self.queue.push_dropping((arrived, frame));
            return true;
        }
        self.queue.push_waiting((arrived, frame))
    }

    /// Puts the frame on the clock that only goes forward.
    fn stamp(&self, frame: &mut Frame, arrived: Instant, is_live: bool, progress: &mut Progress) {
        let arrived_s = arrived.saturating_duration_since(progress.started).as_secs_f64();
        let at_own_pace = is_live || std::mem::take(&mut progress.waited);
        match progress.clock.stamp(frame.capture_s, arrived_s, at_own_pace) {
            Stamp::At { t_s } => frame.capture_s = t_s,
            Stamp::Stepped { t_s, step_s } => {
                frame.capture_s = t_s;
                self.tell(Event::Clock { camera: self.camera, t_s, step_s });
            }
            Stamp::Late { t_s, by_s } => {
                frame.capture_s = t_s;
                let reason =
                    format!("{}: taken {by_s:.3} s before the frame that came before it", frame.name);
                frame.content = Content::Unreadable(reason);
            }
        }
    }

    fn left_out(&self, left_out: &mut LeftOut, again: Duration) {
        let is_due = left_out.told.is_none_or(|told| again <= told.elapsed());
        if 0 < left_out.frames && is_due {
            let reason = std::mem::take(&mut left_out.reason);
            self.tell(Event::LeftOut { camera: self.camera, frames: left_out.frames, reason });
            *left_out = LeftOut { told: Some(Instant::now()), ..LeftOut::default() };
        }
    }

    fn lost(&self, reason: &str, progress: &mut Progress) {
        if progress.is_there {
            let reason = Some(reason.to_string());
            self.tell(Event::Source { camera: self.camera, is_there: false, reason });
        }
        progress.is_there = false;
        self.rest(progress.pause_s);
        progress.pause_s = (2.0 * progress.pause_s).min(LONGEST_RETRY * self.config.retry_s);
    }

    /// Sleeps, but not through the end of the session.
    fn rest(&self, seconds: f64) {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < until && !self.stop.load(Ordering::Relaxed) {
            thread::sleep(PATIENCE.min(until.saturating_duration_since(Instant::now())));
        }
    }
}
