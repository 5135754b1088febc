//! Follows a target through the images of one camera: searches where it is expected, and everywhere once it is not there.
//!
//! A target found nearby is found with the same reductions, on the same tiles of pixels, as in the whole image, so that its corners are equal;
//! corners measured at their last position agree to a fraction of their sigma.
//! A target that left its position is searched for in the whole image at once. Slow searches (for copies and for displaced tags, for small tags
//! at full size) are done strip by strip, a share of the image for the time that has passed, so that no frame waits for them. Capture times and
//! images alone determine what is searched, not the duration of the search: the same film gives the same answers.

mod board;
mod tags;

use super::{DetectError, Detector, Finder};
use crate::GrayImage;
use board::BoardFollower;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use resight_core::{Camera, Pixel, Target};
use tags::TagFollower;

/// The part of an image that was searched.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Extent {
    /// The parts where the target was expected, and possibly a strip.
    Near,
    /// The whole image.
    Whole,
    /// The last position, and a share of the rest: the target has been missing for long.
    Share,
}

/// Finds one target in the images of one camera, in order; built once per camera and target.
pub struct Follower {
    kind: Kind,
    clock: Clock,
    extent: Extent,
}

enum Kind {
    Tags(Box<TagFollower>),
    Board(Box<BoardFollower>),
    /// Dots and circles are found among all spots of an image, which takes few milliseconds.
    Spots(Box<Detector>),
}

impl Follower {
    /// Starts without a known position.
    ///
    /// # Errors
    /// As of [`Detector::new`].
    pub fn new(target: &Target) -> Result<Self, DetectError> {
        let Detector { finder, grid, copies } = Detector::new(target)?;
        let kind = match finder {
            Finder::Tag(finder) => Kind::Tags(Box::new(TagFollower::new(finder, false))),
            Finder::TagMap(finder) => Kind::Tags(Box::new(TagFollower::new(finder, true))),
            finder @ (Finder::Dots(_) | Finder::CircleGrid(_)) => {
                Kind::Spots(Box::new(Detector { finder, grid, copies }))
            }
            finder => Kind::Board(Box::new(BoardFollower::new(Detector { finder, grid, copies }, target))),
        };
        Ok(Follower { kind, clock: Clock::default(), extent: Extent::Whole })
    }

    /// Finds the features in the image taken at `t_s`, sorted by id, then corner; empty when the target is not visible. `expected` are their
    /// predicted positions from a pose, in pixels; empty where no pose is known.
    ///
    /// # Errors
    /// As of [`Detector::detect`]. Copies of a tag outside the parts searched are noticed within [`ROUND_S`].
    pub fn detect(
        &mut self,
        image: &GrayImage,
        camera: &Camera,
        t_s: f64,
        expected: &[(Feature, Pixel)],
    ) -> Result<Vec<Detection>, DetectError> {
        super::check_buffer(image)?;
        let elapsed_s = self.clock.tick(t_s);
        let found = match &mut self.kind {
            Kind::Tags(follower) => follower.detect(image, elapsed_s, expected),
            Kind::Board(follower) => follower.detect(image, elapsed_s, expected),
            Kind::Spots(detector) => Ok((detector.detect_with_camera(image, camera)?, Extent::Whole)),
        };
        let (found, extent) = found?;
        self.extent = extent;
        Ok(found)
    }

    /// Returns the part of the last image that was searched.
    pub fn extent(&self) -> Extent {
        self.extent
    }
}

/// Time in which the whole image is searched once, seconds, while the target is found near its last position.
pub const ROUND_S: f64 = 2.0;
/// A missing target is searched for in every whole image for this time, seconds,
const SOON_S: f64 = 1.0;
/// and then once in this time (small tags, which are found at full size only, within [`SMALL_ROUND_S`]; boards at half the size of the image),
const TAG_EVERY_S: f64 = 0.2;
/// or, for a board at full size, once in this time: searching a whole image for its corners takes some tenths of a second.
const BOARD_EVERY_S: f64 = 1.0;
/// Time in which the whole image is searched once at full size, seconds, while a tag is missing.
const SMALL_ROUND_S: f64 = 1.0;

/// Images closer in time than this have no capture times (copied files); each is treated as the first one.
const UNTIMED_S: f64 = 1e-3;

/// Seconds between images; infinite where no time is known.
#[derive(Debug, Default)]
struct Clock {
    last_s: Option<f64>,
}

impl Clock {
    fn tick(&mut self, t_s: f64) -> f64 {
        let elapsed_s = self.last_s.map_or(f64::INFINITY, |last_s| t_s - last_s);
        self.last_s = Some(t_s);
        // This includes clocks that were set back or do not run.
        if UNTIMED_S <= elapsed_s { elapsed_s } else { f64::INFINITY }
    }
}

/// Decides when to search the whole image for a target that is not near its last position.
#[derive(Debug)]
struct Absence {
    /// Time since it was last found.
    gone_s: f64,
    /// Time since the whole image was last searched.
    unlooked_s: f64,
    every_s: f64,
}

impl Absence {
    fn new(every_s: f64) -> Self {
        Absence { gone_s: 0.0, unlooked_s: f64::INFINITY, every_s }
    }

    fn passed(&mut self, elapsed_s: f64) {
        self.gone_s += elapsed_s;
        self.unlooked_s += elapsed_s;
    }

    /// Returns whether this image is searched; if so, the next wait begins.
    fn is_due(&mut self) -> bool {
        // The sum of the times of thirty frames may be less than a second because of rounding.
        let is_due = self.gone_s <= SOON_S || self.every_s - UNTIMED_S <= self.unlooked_s;
        if is_due {
            self.unlooked_s = 0.0;
        }
        is_due
    }

    fn found(&mut self) {
        self.gone_s = 0.0;
    }
}

/// Parts that are searched in turn, as many in each image as belong to the time that has passed.
#[derive(Debug)]
struct Round {
    count: u32,
    period_s: f64,
    next: u32,
    /// Number of parts that are due, with a fraction.
    due: f64,
}

impl Round {
    fn new(count: u32, period_s: f64) -> Self {
        Round { count, period_s, next: 0, due: 0.0 }
    }

    /// Returns the parts that are due now: after a long time, all of them.
    fn take(&mut self, elapsed_s: f64) -> impl Iterator<Item = u32> + use<> {
        let count = self.count;
        self.due = (self.due + count as f64 * elapsed_s / self.period_s).min(count as f64);
        let (first, n) = (self.next, self.due as u32);
        self.due -= n as f64;
        self.next = (first + n) % count;
        (first..first + n).map(move |part| part % count)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_round_takes_its_period_at_any_rate_of_frames() {
        for rate_hz in [5.0, 30.0, 333.0] {
            let mut round = Round::new(9, 2.0);
            let mut seen = [0; 9];
            for _ in 0..(8.0 * rate_hz) as usize {
                round.take(1.0 / rate_hz).for_each(|part| seen[part as usize] += 1);
            }
            assert!(seen.iter().all(|n| (3..=5).contains(n)), "{rate_hz}: {seen:?}");
        }
    }

    #[test]
    fn slow_frames_are_searched_whole() {
        let mut round = Round::new(9, 2.0);
        for elapsed_s in [f64::INFINITY, 2.0, 60.0] {
            let mut parts: Vec<u32> = round.take(elapsed_s).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..9).collect::<Vec<_>>());
        }
    }

    /// Files copied together have the same time, clocks are set back, and the time may be missing.
    #[test]
    fn no_time_is_long_ago() {
        let mut clock = Clock::default();
        assert_eq!([5.0, 5.0, 4.0, f64::NAN, 6.0].map(|t_s| clock.tick(t_s)), [f64::INFINITY; 5]);
        assert_eq!(clock.tick(6.5), 0.5);
    }

    #[test]
    fn what_is_gone_is_looked_for_at_once_and_then_seldom() {
        let mut absence = Absence::new(TAG_EVERY_S);
        let looks = |absence: &mut Absence, frames: usize| {
            let is_looked = |_: &usize| {
                absence.passed(1.0 / 30.0);
                absence.is_due()
            };
            (0..frames).filter(is_looked).count()
        };
        assert_eq!(looks(&mut absence, 29), 29);
        let _ = looks(&mut absence, 10);
        assert_eq!(looks(&mut absence, 300), 50);
        absence.found();
        assert_eq!(looks(&mut absence, 29), 29);
    }
}
