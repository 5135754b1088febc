//! The thread that reads a source: it puts frames into the queue and reports losses and steps of the clock.

use super::clock::{CaptureClock, Stamp};
use super::pace::Pace;
use super::queue::Queue;
use super::sparingly::Sparingly;
use super::{Event, LiveConfig};
use crate::source::{Content, Frame, Next, Source};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::SyncSender;
use std::thread;
use std::time::{Duration, Instant};

/// Longest wait before a thread checks whether the session ends and whether a camera has been silent too long.
pub(super) const PATIENCE: Duration = Duration::from_millis(100);
/// Longest pause before a lost source is tried again, in first pauses.
const LONGEST_RETRY: f64 = 32.0;

/// A frame in the queue.
pub(super) struct Arrived {
    pub at: Instant,
    pub frame: Frame,
    /// Number of key frames of a video up to it.
    pub key_frames: Option<u64>,
}

/// Reads one source until it ends.
pub(super) struct Reader<'a> {
    pub camera: usize,
    pub config: &'a LiveConfig,
    pub queue: &'a Queue<Arrived>,
    pub event_sender: &'a SyncSender<Event>,
    pub stop: &'a AtomicBool,
    pub pace: &'a Pace,
    /// Capture time of an earlier session's last frame, and its age, seconds.
    pub resumed: Option<(f64, f64)>,
}

/// The state kept between frames.
struct Progress {
    connected: bool,
    pause_s: f64,
    clock: CaptureClock,
    started: Instant,
    /// Whether the reader had to wait for the next frame.
    waited: bool,
    /// A frame of a recording whose time may be wrong; the next frame decides.
    doubtful: Option<Frame>,
    left_out: Sparingly,
    /// Reason why the last frame left out was left out.
    reason: String,
    /// Whether an orientation of EXIF has been reported.
    is_oriented: bool,
    key_frames: Option<u64>,
}

impl Reader<'_> {
    pub fn read(&self, mut source: Box<dyn Source>) {
        let mut progress = self.start(source.is_live());
        while !self.stop.load(Ordering::Relaxed) {
            for spent in self.queue.take_back() {
                if let Content::Image(picture) = spent.frame.content {
                    source.reuse(picture);
                }
            }
            if !self.pace.may_read(self.camera, PATIENCE) {
                continue;
            }
            let is_read = match source.next(PATIENCE) {
                Next::Frame(frame) => {
                    self.orient(source.orientation(), &mut progress);
                    progress.key_frames = source.key_frames();
                    self.take(frame, source.is_live(), &mut progress)
                }
                Next::Nothing => {
                    progress.waited = true;
                    self.pace.fell_silent(self.camera, Instant::now());
                    self.believe(&mut progress)
                }
                Next::Lost(reason) => {
                    let is_read = self.believe(&mut progress);
                    self.lost(&reason.to_string(), &mut progress);
                    is_read
                }
                Next::End => break,
            };
            if !is_read {
                break;
            }
        }
        self.believe(&mut progress);
        self.left_out(&mut progress, true);
        self.queue.close();
    }

    /// Starts the clock. That of live frames continues from an earlier session; a recording read again has its own times.
    fn start(&self, is_live: bool) -> Progress {
        let resumed = self.resumed.filter(|_| is_live);
        Progress {
            connected: true,
            pause_s: self.config.retry_s,
            clock: resumed
                .map_or_else(CaptureClock::default, |(last_s, ago_s)| CaptureClock::after(last_s, ago_s)),
            started: Instant::now(),
            waited: false,
            doubtful: None,
            left_out: Sparingly::default(),
            reason: String::new(),
            is_oriented: false,
            key_frames: None,
        }
    }

    /// A send to a receiver that is gone needs no error.
    fn tell(&self, event: Event) {
        let _ = self.event_sender.send(event);
    }

    fn orient(&self, how: Option<&'static str>, progress: &mut Progress) {
        if let Some(how) = how
            && !std::mem::replace(&mut progress.is_oriented, true)
        {
            self.tell(Event::Oriented { camera: self.camera, how });
        }
    }

    /// Returns false when the frames are no longer processed.
    fn take(&self, frame: Frame, is_live: bool, progress: &mut Progress) -> bool {
        if !progress.connected {
            self.tell(Event::Source { camera: self.camera, connected: true, reason: None });
        }
        (progress.connected, progress.pause_s) = (true, self.config.retry_s);
        self.pace.gave(self.camera);
        let at_own_pace = is_live || std::mem::take(&mut progress.waited);
        if matches!(frame.content, Content::Unreadable(_)) {
            return self.pass(frame, at_own_pace, is_live, progress);
        }
        if let Some(doubtful) = progress.doubtful.take() {
            let doubtful = match progress.clock.refutes(frame.capture_s, doubtful.capture_s) {
                true => wrongly_timed(doubtful, frame.capture_s),
                false => doubtful,
            };
            if !self.pass(doubtful, false, is_live, progress) {
                return false;
            }
        }
        if !at_own_pace && progress.clock.is_implausible(frame.capture_s) {
            progress.doubtful = Some(frame);
            return true;
        }
        self.pass(frame, at_own_pace, is_live, progress)
    }

    /// Accepts a doubtful frame after a pause. Returns false when the frames are no longer processed.
    fn believe(&self, progress: &mut Progress) -> bool {
        let doubtful = progress.doubtful.take();
        doubtful.is_none_or(|doubtful| self.pass(doubtful, false, false, progress))
    }

    /// Puts a frame into the queue. Returns false when frames are no longer processed.
    fn pass(&self, mut frame: Frame, at_own_pace: bool, is_live: bool, progress: &mut Progress) -> bool {
        let at = Instant::now();
        self.stamp(&mut frame, at, at_own_pace, progress);
        if let Content::Unreadable(reason) = &frame.content {
            progress.left_out.add(1);
            progress.reason.clone_from(reason);
        }
        self.left_out(progress, false);
        let arrived = Arrived { at, frame, key_frames: progress.key_frames };
        match is_live {
            true => self.queue.push_dropping(arrived),
            false => self.queue.push_waiting(arrived),
        }
    }

    /// Converts the time of the frame to the monotonic clock.
    fn stamp(&self, frame: &mut Frame, arrived: Instant, at_own_pace: bool, progress: &mut Progress) {
        let arrived_s = arrived.saturating_duration_since(progress.started).as_secs_f64();
        if !frame.capture_s.is_finite() {
            frame.content = Content::Unreadable(format!("{}: its time is not a number", frame.name));
        }
        if matches!(frame.content, Content::Unreadable(_)) {
            frame.capture_s = progress.clock.guess(frame.capture_s, arrived_s, at_own_pace);
            return;
        }
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

    fn left_out(&self, progress: &mut Progress, is_end: bool) {
        if let Some(frames) = progress.left_out.due(Instant::now(), is_end) {
            let reason = std::mem::take(&mut progress.reason);
            self.tell(Event::LeftOut { camera: self.camera, frames, reason });
        }
    }

    fn lost(&self, reason: &str, progress: &mut Progress) {
        if progress.connected {
            let reason = Some(reason.to_string());
            self.tell(Event::Source { camera: self.camera, connected: false, reason });
        }
        progress.connected = false;
        self.pace.fell_silent(self.camera, Instant::now());
        self.rest(progress.pause_s);
        progress.pause_s = (2.0 * progress.pause_s).min(LONGEST_RETRY * self.config.retry_s);
    }

    /// Sleeps, but not beyond the end of the session.
    fn rest(&self, seconds: f64) {
        let until = Instant::now() + Duration::from_secs_f64(seconds);
        while Instant::now() < until && !self.stop.load(Ordering::Relaxed) {
            thread::sleep(PATIENCE.min(until.saturating_duration_since(Instant::now())));
        }
    }
}

/// Marks a frame whose successor has an earlier time.
fn wrongly_timed(frame: Frame, next_s: f64) -> Frame {
    let content = Content::Unreadable(format!(
        "{}: its time is {:.3} s after that of the next frame, so it is wrong",
        frame.name,
        frame.capture_s - next_s
    ));
    Frame { content, ..frame }
}
