//! Determines which frames were decoded from damaged data.
//!
//! Up to release 6 decoder and filter alternate: the complaint about a frame comes right before its line. Since 7.0 the decoder is a thread of
//! its own and up to about eight frames ahead; the lines of those frames come in between. There it reports the stamp of each frame
//! (`-debug_ts`), right after the complaint.

use std::collections::VecDeque;

/// Complaints about frames that never arrive (cut off by `-t`) are discarded, the oldest first.
const MOST: usize = 64;

/// Complaints about frames that have not arrived yet.
#[derive(Debug, Default)]
pub(super) struct Torn {
    /// Whether the decoder reports the frames that it decodes.
    is_named: bool,
    /// The complaint about the next frame that is reported, or about the next frame.
    complaint: Option<String>,
    /// The complaints with stamps in seconds, where there are stamps.
    frames: VecDeque<(Option<f64>, String)>,
}

impl Torn {
    /// Records a complaint of the decoder.
    pub fn complain(&mut self, words: String) {
        self.complaint = Some(words);
    }

    /// Records that the decoder reported a frame.
    pub fn name(&mut self, time_s: Option<f64>) {
        self.is_named = true;
        if let Some(words) = self.complaint.take() {
            self.frames.truncate(MOST - 1);
            self.frames.push_front((time_s, words));
        }
    }

    /// Returns why the frame of this stamp cannot be trusted; a tick has `tick_s` seconds.
    pub fn take(&mut self, time_s: Option<f64>, tick_s: f64) -> Option<String> {
        if !self.is_named {
            return self.complaint.take();
        }
        let is_it = |stamp_s: &Option<f64>| match (stamp_s, time_s) {
            (Some(a), Some(b)) => (a - b).abs() <= 0.5 * tick_s,
            (None, None) => true,
            _ => false,
        };
        let place = self.frames.iter().rposition(|(stamp_s, _)| is_it(stamp_s))?;
        self.frames.remove(place).map(|(_, words)| words)
    }

    /// Returns the complaint for a frame whose line was not understood: it may be any of those.
    pub fn take_any(&mut self) -> Option<String> {
        if self.is_named { self.frames.pop_back().map(|(_, words)| words) } else { self.complaint.take() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_complaint_is_about_the_frame_named_behind_it() {
        let mut torn = Torn::default();
        torn.name(Some(0.0));
        torn.name(Some(0.1));
        torn.complain("torn".to_string());
        torn.name(Some(0.2));
        torn.name(Some(0.3));
        let taken: Vec<bool> = [0.0, 0.1, 0.2, 0.3].map(|t| torn.take(Some(t), 1e-5).is_some()).to_vec();
        assert_eq!(taken, [false, false, true, false]);
    }

    #[test]
    fn without_names_it_is_about_the_next() {
        let mut torn = Torn::default();
        assert_eq!(torn.take(Some(0.0), 1e-5), None);
        torn.complain("torn".to_string());
        assert_eq!(torn.take(Some(0.1), 1e-5).as_deref(), Some("torn"));
        assert_eq!(torn.take(Some(0.2), 1e-5), None);
    }

    #[test]
    fn frames_that_never_come_are_forgotten() {
        let mut torn = Torn::default();
        for i in 0..1000 {
            torn.complain(i.to_string());
            torn.name(None);
        }
        assert_eq!(torn.frames.len(), MOST);
        assert_eq!(torn.take(None, 1e-5).as_deref(), Some("936"));
        assert_eq!(torn.take_any().as_deref(), Some("937"));
    }
}
