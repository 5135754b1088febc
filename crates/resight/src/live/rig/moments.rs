//! Frames of several cameras put together into moments: each camera reads at its own pace, and some run ahead.

use crate::rig::synchronise::{TimedFrame, by_time};
use resight_core::Correspondence;
use resight_core::locate::PoseEstimate;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// What one camera saw of one target.
#[derive(Debug, Clone)]
pub(super) struct Seen {
    pub target: usize,
    pub points: Vec<Correspondence>,
    pub estimate: PoseEstimate,
}

/// One frame of one camera.
#[derive(Debug, Clone)]
pub(super) struct Shown {
    pub camera: usize,
    pub t_s: f64,
    pub seen: Vec<Seen>,
}

/// What all cameras saw at one time.
#[derive(Debug, Clone)]
pub(super) struct Together {
    pub t_s: f64,
    pub frames: Vec<Shown>,
}

/// A live camera that says nothing for this long is not waited for; nor a recorded one, which may only be slow.
const PATIENCE: Duration = Duration::from_secs(1);
const PATIENCE_RECORDED: Duration = Duration::from_secs(10);
/// Frames of a camera that wait for the others; then the others are not waited for.
const WAITING: usize = 2000;

/// Frames that wait for those of other cameras.
pub(super) struct Moments {
    tolerance_s: f64,
    cameras: Vec<Queue>,
}

struct Queue {
    waiting: VecDeque<Shown>,
    /// Capture time of the newest frame; none before the first.
    newest_s: Option<f64>,
    is_live: bool,
    has_ended: bool,
    spoke: Instant,
}

impl Moments {
    pub fn new(is_live: &[bool], tolerance_s: f64, now: Instant) -> Self {
        let queue = |is_live: &bool| Queue {
            waiting: VecDeque::new(),
            newest_s: None,
            is_live: *is_live,
            has_ended: false,
            spoke: now,
        };
        Moments { tolerance_s, cameras: is_live.iter().map(queue).collect() }
    }

    pub fn ended(&mut self, camera: usize) {
        self.cameras[camera].has_ended = true;
    }

    /// A frame. One from before the camera's last is of a clock that stepped back, and left out.
    pub fn push(&mut self, frame: Shown, now: Instant) {
        let queue = &mut self.cameras[frame.camera];
        queue.spoke = now;
        if queue.newest_s.is_some_and(|newest_s| frame.t_s < newest_s) {
            return;
        }
        queue.newest_s = Some(frame.t_s);
        queue.waiting.push_back(frame);
    }

    /// Moments to which nothing can be added any more, in order of time.
    pub fn complete(&mut self, now: Instant) -> Vec<Together> {
        let until_s = self.horizon_s(now) - self.tolerance_s;
        let is_any = self.cameras.iter().any(|q| q.waiting.front().is_some_and(|first| first.t_s < until_s));
        if is_any { self.taken(until_s) } else { Vec::new() }
    }

    /// Up to when every camera that is waited for has shown its frames.
    fn horizon_s(&self, now: Instant) -> f64 {
        let is_full = self.cameras.iter().any(|queue| WAITING <= queue.waiting.len());
        let is_waited_for = |queue: &&Queue| {
            let patience = if queue.is_live { PATIENCE } else { PATIENCE_RECORDED };
            let is_silent = patience < now.saturating_duration_since(queue.spoke);
            !queue.has_ended && !is_silent && !is_full
        };
        let newest =
            self.cameras.iter().filter(is_waited_for).map(|q| q.newest_s.unwrap_or(f64::NEG_INFINITY));
        newest.fold(f64::INFINITY, f64::min)
    }

    fn taken(&mut self, until_s: f64) -> Vec<Together> {
        // Frames a little later may belong to a moment that is not over: they are looked at, and stay.
        let near = |frame: &&Shown| frame.t_s <= until_s + 2.0 * self.tolerance_s;
        let frames = self.cameras.iter().flat_map(|queue| queue.waiting.iter().take_while(near));
        let timed: Vec<TimedFrame> =
            frames.map(|frame| TimedFrame { camera: frame.camera, t_s: frame.t_s }).collect();
        let views = by_time(&timed, self.tolerance_s);
        let n = views.iter().max().map_or(0, |last| last + 1);
        let mut first_s = vec![f64::INFINITY; n];
        timed.iter().zip(&views).for_each(|(frame, view)| first_s[*view] = first_s[*view].min(frame.t_s));
        let mut together: Vec<Together> =
            first_s.iter().map(|t_s| Together { t_s: *t_s, frames: Vec::new() }).collect();
        for (frame, view) in timed.iter().zip(&views).filter(|(_, view)| first_s[**view] < until_s) {
            together[*view].frames.extend(self.cameras[frame.camera].waiting.pop_front());
        }
        together.retain(|moment| !moment.frames.is_empty());
        together
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(camera: usize, t_s: f64) -> Shown {
        Shown { camera, t_s, seen: Vec::new() }
    }

    fn cameras(moments: &[Together]) -> Vec<Vec<usize>> {
        moments.iter().map(|moment| moment.frames.iter().map(|frame| frame.camera).collect()).collect()
    }

    /// One camera is far ahead of the other; its frames wait.
    #[test]
    fn a_moment_is_told_when_nothing_can_join_it() {
        let now = Instant::now();
        let mut moments = Moments::new(&[false, false], 0.02, now);
        (0..5).for_each(|i| moments.push(frame(0, f64::from(i)), now));
        assert!(moments.complete(now).is_empty());
        moments.push(frame(1, 0.01), now);
        moments.push(frame(1, 1.01), now);
        assert_eq!(cameras(&moments.complete(now)), [[0, 1]]);
        moments.push(frame(1, 3.5), now);
        assert_eq!(cameras(&moments.complete(now)), [vec![0, 1], vec![0], vec![0]]);
        moments.ended(1);
        assert_eq!(cameras(&moments.complete(now)), [vec![1]]);
        moments.ended(0);
        assert_eq!(cameras(&moments.complete(now)), [vec![0]]);
    }

    #[test]
    fn a_live_camera_that_hangs_is_not_waited_for() {
        let now = Instant::now();
        let mut moments = Moments::new(&[true, true], 0.02, now);
        (0..5).for_each(|i| moments.push(frame(0, f64::from(i)), now));
        assert!(moments.complete(now).is_empty());
        let later = now + PATIENCE + Duration::from_millis(1);
        moments.push(frame(0, 5.0), later);
        assert_eq!(moments.complete(later).len(), 5);
    }
}
