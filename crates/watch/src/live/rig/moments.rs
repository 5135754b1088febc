//! Frame sets from the frames of several cameras: each camera is read at its own pace, and some are ahead.

use crate::live::pace::Pace;
use resight::rig::synchronise::{TimedFrame, by_time};
use resight_core::locate::PoseEstimate;
use resight_core::{Camera, Correspondence};
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The points of one target in one camera.
#[derive(Debug, Clone)]
pub(super) struct TargetPoints {
    pub target: usize,
    pub points: Vec<Correspondence>,
    /// The lens at the size of the image.
    pub lens: Camera,
    pub estimate: PoseEstimate,
}

/// One frame of one camera.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    pub camera: usize,
    pub t_s: f64,
    pub seen: Vec<TargetPoints>,
}

/// All observations at one time.
#[derive(Debug, Clone)]
pub(super) struct SynchronisedFrames {
    pub t_s: f64,
    pub frames: Vec<Shown>,
}

/// A live camera without frames for this long is not waited for;
const PATIENCE: Duration = Duration::from_secs(1);
/// nor is a recording that has had nothing to provide for this long (a front end that hangs). While it is read it is waited for.
const PATIENCE_RECORDED: Duration = Duration::from_secs(10);
/// Number of a camera's frames that wait for the others. Beyond it other live cameras are not waited for, and a recording is held.
const WAITING: usize = 2000;
/// Largest number of frames of a recording that is held, or whose frames all have one time.
const WAITING_RECORDED: usize = 2 * WAITING;

/// Frames that wait for those of other cameras.
pub(super) struct FrameSetQueue {
    tolerance_s: f64,
    cameras: Vec<Queue>,
    pace: Arc<Pace>,
    held: Vec<bool>,
}

struct Queue {
    waiting: VecDeque<Shown>,
    /// Capture time of the newest frame; none before the first.
    newest_s: Option<f64>,
    is_live: bool,
    has_ended: bool,
    spoke: Instant,
}

impl FrameSetQueue {
    pub fn new(is_live: &[bool], tolerance_s: f64, pace: &Arc<Pace>, now: Instant) -> Self {
        let queue = |is_live: &bool| Queue {
            waiting: VecDeque::new(),
            newest_s: None,
            is_live: *is_live,
            has_ended: false,
            spoke: now,
        };
        let cameras: Vec<Queue> = is_live.iter().map(queue).collect();
        FrameSetQueue { tolerance_s, held: vec![false; cameras.len()], cameras, pace: Arc::clone(pace) }
    }

    pub fn ended(&mut self, camera: usize) {
        self.cameras[camera].has_ended = true;
    }

    /// Adds a frame. A frame older than the camera's last is of a clock that stepped back, and is left out.
    pub fn push(&mut self, frame: Shown, now: Instant) {
        let queue = &mut self.cameras[frame.camera];
        queue.spoke = now;
        if queue.newest_s.is_some_and(|newest_s| frame.t_s < newest_s) {
            return;
        }
        queue.newest_s = Some(frame.t_s);
        queue.waiting.push_back(frame);
    }

    /// Returns the frames that wait for those of other cameras, those of each camera in order.
    pub fn waiting(&self) -> impl Iterator<Item = &Shown> {
        self.cameras.iter().flat_map(|queue| &queue.waiting)
    }

    /// Returns the frame sets to which nothing can be added any more, in order of time.
    pub fn complete(&mut self, now: Instant) -> Vec<SynchronisedFrames> {
        let horizon_s = self.horizon_s(now);
        let until_s = horizon_s - self.tolerance_s;
        let is_any = self.cameras.iter().any(|q| q.waiting.front().is_some_and(|first| first.t_s < until_s));
        let complete = if is_any { self.taken(until_s) } else { Vec::new() };
        self.hold(horizon_s);
        complete
    }

    /// Holds every recording that is far ahead of the others until they have reached it.
    fn hold(&mut self, horizon_s: f64) {
        let is_ahead = |queue: &Queue| queue.newest_s.is_some_and(|newest_s| horizon_s < newest_s);
        let is_held = |queue: &Queue| !queue.is_live && WAITING <= queue.waiting.len() && is_ahead(queue);
        let held: Vec<bool> = self.cameras.iter().map(is_held).collect();
        if held != self.held {
            self.pace.hold(&held);
            self.held = held;
        }
    }

    /// Returns the time up to which every camera that is waited for has provided its frames.
    fn horizon_s(&self, now: Instant) -> f64 {
        let is_full = self.cameras.iter().any(Queue::is_full);
        let is_waited_for = |(camera, queue): &(usize, &Queue)| {
            !queue.has_ended && !self.is_silent(*camera, queue, now) && !is_full
        };
        let waited_for = self.cameras.iter().enumerate().filter(is_waited_for);
        let newest = waited_for.map(|(_, queue)| queue.newest_s.unwrap_or(f64::NEG_INFINITY));
        newest.fold(f64::INFINITY, f64::min)
    }

    fn is_silent(&self, camera: usize, queue: &Queue, now: Instant) -> bool {
        if queue.is_live {
            return PATIENCE < now.saturating_duration_since(queue.spoke);
        }
        let since = self.pace.silent_since(camera).map(|since| since.max(queue.spoke));
        since.is_some_and(|since| PATIENCE_RECORDED < now.saturating_duration_since(since))
    }

    fn taken(&mut self, until_s: f64) -> Vec<SynchronisedFrames> {
        // Frames slightly later may belong to an incomplete frame set: they are considered, but remain in the queue.
        let near = |frame: &&Shown| frame.t_s <= until_s + 2.0 * self.tolerance_s;
        let frames = self.cameras.iter().flat_map(|queue| queue.waiting.iter().take_while(near));
        let timed: Vec<TimedFrame> =
            frames.map(|frame| TimedFrame { camera: frame.camera, t_s: frame.t_s }).collect();
        let views = by_time(&timed, self.tolerance_s);
        let n = views.iter().max().map_or(0, |last| last + 1);
        let mut first_s = vec![f64::INFINITY; n];
        timed.iter().zip(&views).for_each(|(frame, view)| first_s[*view] = first_s[*view].min(frame.t_s));
        let mut together: Vec<SynchronisedFrames> =
            first_s.iter().map(|t_s| SynchronisedFrames { t_s: *t_s, frames: Vec::new() }).collect();
        for (frame, view) in timed.iter().zip(&views).filter(|(_, view)| first_s[**view] < until_s) {
            together[*view].frames.extend(self.cameras[frame.camera].waiting.pop_front());
        }
        together.retain(|frame_set| !frame_set.frames.is_empty());
        together
    }
}

impl Queue {
    fn is_full(&self) -> bool {
        let most = if self.is_live { WAITING } else { WAITING_RECORDED };
        most <= self.waiting.len()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(camera: usize, t_s: f64) -> Shown {
        Shown { camera, t_s, seen: Vec::new() }
    }

    fn cameras(frame_sets: &[SynchronisedFrames]) -> Vec<Vec<usize>> {
        frame_sets
            .iter()
            .map(|frame_set| frame_set.frames.iter().map(|frame| frame.camera).collect())
            .collect()
    }

    fn frame_sets(is_live: &[bool], now: Instant) -> (FrameSetQueue, Arc<Pace>) {
        let pace = Arc::new(Pace::new(is_live.len()));
        (FrameSetQueue::new(is_live, 0.02, &pace, now), pace)
    }

    /// One camera is far ahead of the other; its frames wait.
    #[test]
    fn a_frame_set_is_reported_when_nothing_can_join_it() {
        let now = Instant::now();
        let (mut frame_sets, _) = frame_sets(&[false, false], now);
        (0..5).for_each(|i| frame_sets.push(frame(0, f64::from(i)), now));
        assert!(frame_sets.complete(now).is_empty());
        frame_sets.push(frame(1, 0.01), now);
        frame_sets.push(frame(1, 1.01), now);
        assert_eq!(cameras(&frame_sets.complete(now)), [[0, 1]]);
        frame_sets.push(frame(1, 3.5), now);
        assert_eq!(cameras(&frame_sets.complete(now)), [vec![0, 1], vec![0], vec![0]]);
        frame_sets.ended(1);
        assert_eq!(cameras(&frame_sets.complete(now)), [vec![1]]);
        frame_sets.ended(0);
        assert_eq!(cameras(&frame_sets.complete(now)), [vec![0]]);
    }

    #[test]
    fn a_live_camera_that_hangs_is_not_waited_for() {
        let now = Instant::now();
        let (mut frame_sets, _) = frame_sets(&[true, true], now);
        (0..5).for_each(|i| frame_sets.push(frame(0, f64::from(i)), now));
        assert!(frame_sets.complete(now).is_empty());
        let later = now + PATIENCE + Duration::from_millis(1);
        frame_sets.push(frame(0, 5.0), later);
        assert_eq!(frame_sets.complete(later).len(), 5);
    }

    /// A slow recording is waited for, however long it takes; the fast one is held, and nothing is reported without the slow one. A recording
    /// that has nothing to provide is not waited for.
    #[test]
    fn a_fast_recording_waits_for_a_slow_one() {
        let now = Instant::now();
        let (mut frame_sets, pace) = frame_sets(&[false, false], now);
        (0..WAITING).for_each(|i| frame_sets.push(frame(0, i as f64), now));
        let later = now + 10 * PATIENCE_RECORDED;
        assert!(frame_sets.complete(later).is_empty());
        assert!(!pace.may_read(0, Duration::ZERO) && pace.may_read(1, Duration::ZERO));
        frame_sets.push(frame(1, 5.5), later);
        assert_eq!(frame_sets.complete(later).len(), 6);
        assert!(pace.may_read(0, Duration::ZERO), "it was caught up with");
        pace.fell_silent(1, later);
        assert!(frame_sets.complete(later + PATIENCE_RECORDED / 2).is_empty());
        assert_eq!(frame_sets.complete(later + 2 * PATIENCE_RECORDED).len(), WAITING - 6);
    }

    /// Images without times of their own: no camera is ahead, and none waits for ever.
    #[test]
    fn recordings_of_one_time_do_not_wait_for_each_other() {
        let now = Instant::now();
        let (mut frame_sets, pace) = frame_sets(&[false, false], now);
        for _ in 0..WAITING_RECORDED {
            (0..2).for_each(|camera| frame_sets.push(frame(camera, 7.0), now));
            frame_sets.complete(now);
            assert!((0..2).all(|camera| pace.may_read(camera, Duration::ZERO)));
        }
        assert!(frame_sets.cameras.iter().all(|queue| queue.waiting.len() < WAITING_RECORDED));
    }
}
