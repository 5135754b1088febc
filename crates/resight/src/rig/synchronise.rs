//! Finds frames that were taken at the same time, by their time stamps.

use std::collections::BTreeSet;

/// One frame of one camera.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TimedFrame {
    /// Index of the camera.
    pub camera: usize,
    /// When it was taken, s, on a clock that all cameras share.
    pub t_s: f64,
}

/// Returns the view of each frame, with views numbered in the order of time. A view has frames of different cameras, all within `tolerance_s` of
/// each other. Neighbours in time are joined, the closest first, so that a frame between two others is joined to the nearer one; the result does
/// not depend on the order of the frames.
///
/// `t_s` and `tolerance_s` must be finite.
pub fn by_time(frames: &[TimedFrame], tolerance_s: f64) -> Vec<usize> {
    let mut order: Vec<usize> = (0..frames.len()).collect();
    let key = |i: usize| (frames[i].t_s, frames[i].camera);
    order.sort_by(|a, b| key(*a).0.total_cmp(&key(*b).0).then(key(*a).1.cmp(&key(*b).1)));
    let mut runs = Runs::new(frames, &order);
    let mut gaps: Vec<usize> = (1..order.len()).collect();
    let gap_s = |i: &usize| frames[order[*i]].t_s - frames[order[*i - 1]].t_s;
    gaps.sort_by(|a, b| gap_s(a).total_cmp(&gap_s(b)).then(a.cmp(b)));
    for i in gaps {
        if tolerance_s < gap_s(&i) {
            break;
        }
        runs.join(i - 1, i, tolerance_s);
    }
    runs.views(&order)
}

/// Runs of frames adjacent in time; each run is a view.
struct Runs<'a> {
    frames: &'a [TimedFrame],
    order: &'a [usize],
    /// For the first and the last position of a run: the other end.
    end: Vec<usize>,
    /// Cameras of a run, stored at its first position.
    cameras: Vec<BTreeSet<usize>>,
    /// Whether a run starts at this position.
    starts: Vec<bool>,
}

impl<'a> Runs<'a> {
    fn new(frames: &'a [TimedFrame], order: &'a [usize]) -> Self {
        let cameras = order.iter().map(|i| BTreeSet::from([frames[*i].camera])).collect();
        Runs { frames, order, end: (0..order.len()).collect(), cameras, starts: vec![true; order.len()] }
    }

    /// Joins the run that ends at `last` with the one that starts at `next`, if they fit in one view.
    fn join(&mut self, last: usize, next: usize, tolerance_s: f64) {
        let (first, end) = (self.end[last], self.end[next]);
        let span_s = self.frames[self.order[end]].t_s - self.frames[self.order[first]].t_s;
        if tolerance_s < span_s || !self.cameras[first].is_disjoint(&self.cameras[next]) {
            return;
        }
        let joined = std::mem::take(&mut self.cameras[next]);
        self.cameras[first].extend(joined);
        self.starts[next] = false;
        (self.end[first], self.end[end]) = (end, first);
    }

    fn views(&self, order: &[usize]) -> Vec<usize> {
        let mut views = vec![0; order.len()];
        let mut n_started = 0;
        for (place, frame) in order.iter().enumerate() {
            n_started += usize::from(self.starts[place]);
            views[*frame] = n_started - 1;
        }
        views
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn views(frames: &[(usize, f64)], tolerance_s: f64) -> Vec<usize> {
        let frames: Vec<TimedFrame> =
            frames.iter().map(|(camera, t_s)| TimedFrame { camera: *camera, t_s: *t_s }).collect();
        by_time(&frames, tolerance_s)
    }

    #[test]
    fn frames_within_the_tolerance_are_one_view() {
        let frames = [(0, 1.000), (1, 1.004), (2, 0.996), (0, 1.100), (1, 1.160), (2, 1.102)];
        assert_eq!(views(&frames, 0.010), [0, 0, 0, 1, 2, 1]);
        assert_eq!(views(&frames, 0.003), [1, 2, 0, 3, 4, 3]);
        assert_eq!(views(&[], 1.0), Vec::<usize>::new());
    }

    /// A frame between two of another camera is joined to the nearer one, although both are within the tolerance.
    #[test]
    fn the_nearer_frame_wins() {
        assert_eq!(views(&[(0, 0.0), (1, 0.6), (0, 1.0), (1, 1.6)], 0.9), [0, 1, 1, 2]);
    }

    /// Neighbours may form chains, but no view is longer than the tolerance, and none has a camera twice.
    #[test]
    fn no_view_is_longer_than_the_tolerance() {
        let chain: Vec<(usize, f64)> = (0..10).map(|i| (i, 0.006 * i as f64)).collect();
        let found = views(&chain, 0.010);
        for (i, a) in chain.iter().enumerate() {
            for (j, b) in chain.iter().enumerate() {
                assert!(found[i] != found[j] || (a.1 - b.1).abs() <= 0.010);
            }
        }
        assert_eq!(views(&[(0, 0.0), (0, 0.001), (0, 0.002)], 1.0), [0, 1, 2]);
    }

    #[test]
    fn the_order_of_frames_does_not_matter() {
        let frames: Vec<(usize, f64)> =
            (0..40).map(|i| (i % 4, (i / 4) as f64 * 0.1 + 0.007 * ((i * 7) % 5) as f64)).collect();
        let straight = views(&frames, 0.03);
        let shuffled: Vec<usize> = (0..40).map(|i| (i * 17 + 5) % 40).collect();
        let moved: Vec<(usize, f64)> = shuffled.iter().map(|i| frames[*i]).collect();
        let found = views(&moved, 0.03);
        assert!(shuffled.iter().zip(&found).all(|(i, view)| straight[*i] == *view));
    }
}
