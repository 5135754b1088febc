//! A pair of frames as the estimate needs it.

use crate::core::multiview::two_view::{BearingPair, TwoView};
use crate::core::temporal::vehicle::{FrameMotion, ground_plane};

/// What a pair of frames has besides its images.
pub(super) struct PairTimes {
    /// The middle between both frames, seconds.
    pub t_s: f64,
    /// Time between them, seconds.
    pub duration_s: f64,
    /// Speed of the vehicle; `None` where none is stated.
    pub speed_m_s: Option<f64>,
}

impl PairTimes {
    pub fn motion(&self, pairs: &[BearingPair], view: &TwoView) -> FrameMotion {
        let ground = ground_plane(pairs, view, self.speed_m_s.is_none_or(|speed| 0.0 <= speed));
        FrameMotion { ground, speed_m_s: self.speed_m_s, ..FrameMotion::new(self.t_s, self.duration_s, view) }
    }

    pub fn still(&self) -> FrameMotion {
        let still = FrameMotion::without_direction(self.t_s, self.duration_s);
        FrameMotion { speed_m_s: self.speed_m_s, ..still }
    }
}
