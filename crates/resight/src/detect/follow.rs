//! Following a target through the images of one camera: searched where it is expected, everywhere once it is not there.
//!
//! What is found near is found with the same reductions, on the same tiles of pixels, as in the whole image, so corners are the same; those of
//! what is measured where it was, to a fraction of their sigma.
//! A target that left its place is searched in the whole image at once. What takes long (a look for copies and for tags out of
//! place, small tags at full size) goes strip by strip, a share of the image for the time that has passed, so no frame waits for it.
//! Capture times and images alone decide what is searched, not how long it took: the same film gives the same answers.

mod board;
mod tags;

use super::dots::DotDetector;
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
    /// Where the target was expected, and perhaps a strip besides.
    Near,
    /// All of it.
    Whole,
    /// Where it was last, and a share of the rest: it has been away for long.
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
    /// Dots are found by comparing all spots of an image.
    Dots(Box<DotDetector>),
}

impl Follower {
    /// No position is known yet.
    ///
    /// # Errors
    /// As of [`Detector::new`].
    pub fn new(target: &Target) -> Result<Self, DetectError> {
        let kind = match Detector::new(target)?.finder {
            Finder::Tag(finder) => Kind::Tags(Box::new(TagFollower::new(finder, false))),
            Finder::TagMap(finder) => Kind::Tags(Box::new(TagFollower::new(finder, true))),
            Finder::Dots(finder) => Kind::Dots(finder),
            board => Kind::Board(Box::new(BoardFollower::new(
                Detector { finder: board, copies: Vec::new() },
                target,
            ))),
        };
        Ok(Follower { kind, clock: Clock::default(), extent: Extent::Whole })
    }

    /// Features found in the image taken at `t_s`, ids then corners ascending; empty when the target is not there. `expected` is where
    /// they would be by what is known of the pose, in pixels; empty where nothing is known.
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
            Kind::Dots(finder) => Ok((finder.detect_with_camera(image, camera)?, Extent::Whole)),
        };
        let (found, extent) = found?;
        self.extent = extent;
        Ok(found)
    }

    /// The part of the last image that was searched.
    pub fn extent(&self) -> Extent {
        self.extent
    }
}

/// The whole image is looked through once in this time, seconds, while the target is found near its place.
pub const ROUND_S: f64 = 2.0;
/// A target that is gone is looked for in every whole image for this long, seconds,
const SOON_S: f64 = 1.0;
/// and then once in this time (small tags, which show at full size only, within [`SMALL_ROUND_S`]; boards at half the size of the image),
const TAG_EVERY_S: f64 = 0.2;
/// or once in this time, of a board at full size: looking through a whole image for its corners takes some tenths of a second.
const BOARD_EVERY_S: f64 = 1.0;
/// The whole image is looked through at full size once in this time, seconds, while a tag is gone.
const SMALL_ROUND_S: f64 = 1.0;

/// Images nearer than this have no times of their own (copied files): each is taken for the first of its kind.
const UNTIMED_S: f64 = 1e-3;

/// The seconds between images; infinite where none are known.
#[derive(Debug, Default)]
struct Clock {
    last_s: Option<f64>,
}

impl Clock {
    fn tick(&mut self, t_s: f64) -> f64 {
        let elapsed_s = self.last_s.map_or(f64::INFINITY, |last_s| t_s - last_s);
        self.last_s = Some(t_s);
        // Also a clock that was set back, or is none.
        if UNTIMED_S <= elapsed_s { elapsed_s } else { f64::INFINITY }
    }
}

/// When to look through the whole image for a target that is not near its place.
#[derive(Debug)]
struct Absence {
    /// Since it was last found.
    gone_s: f64,
    /// Since the last look through the whole image.
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

    /// Whether this image is looked through; then the next wait begins.
    fn is_due(&mut self) -> bool {
        // The sum of the times of thirty frames may fall short of a second by its rounding.
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

/// Parts searched in turn, as many in each image as belong to the time that has passed.
#[derive(Debug)]
struct Round {
    count: u32,
    period_s: f64,
    next: u32,
    /// Parts that are due, and a fraction.
    due: f64,
}

impl Round {
    fn new(count: u32, period_s: f64) -> Self {
        Round { count, period_s, next: 0, due: 0.0 }
    }

    /// The parts due now: all of them after a long time.
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

    /// Files copied at once have one time, clocks are set back, and time may be missing altogether.
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
