//! What tests and benches of the live session share: rendered cameras, and a source that gives images from memory at their own pace.

#[allow(dead_code)] // The detectors' tests use all of it.
#[path = "../../../resight/tests/film_support/mod.rs"]
mod film_support;

pub use film_support::*;
use resight::GrayImage;
use resight::core::temporal::monitor::learn::LearnConfig;
use resight::core::{Matrix6, Target};
use resight_watch::live::{LiveCamera, LiveConfig, Watched};
use resight_watch::source::{Content, Frame, Next, Source};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub fn config() -> LiveConfig {
    let known = Matrix6::identity() * 1e-8;
    let correlated = LearnConfig { bias: known, bias_time_s: 60.0, diurnal: known };
    LiveConfig { correlated, ..LiveConfig::default() }
}

pub fn watched(target: &Target, source: impl Source + 'static) -> LiveCamera {
    let watched = Watched { name: "target".to_string(), target: Arc::new(target.clone()), reference: None };
    LiveCamera {
        name: "camera".to_string(),
        camera: camera(),
        targets: vec![watched],
        intrinsics: None,
        landmarks: None,
        source: Box::new(source),
    }
}

/// When frames are given.
#[derive(Debug, Clone, Copy)]
pub enum Pace {
    /// At their capture times, whether anybody waits for them or not.
    Live,
    /// As fast as they are taken.
    AsTaken,
}

/// Images from memory, over and over, `rate_hz` of them a second of capture time.
pub struct Replay {
    pub pictures: Arc<Vec<GrayImage>>,
    pub pace: Pace,
    pub rate_hz: f64,
    pub n_frames: u64,
    pub next: u64,
    pub started: Option<Instant>,
    pub spent: Vec<GrayImage>,
}

impl Replay {
    pub fn new(pictures: &Arc<Vec<GrayImage>>, pace: Pace, rate_hz: f64, n_frames: u64) -> Self {
        let pictures = Arc::clone(pictures);
        Replay { pictures, pace, rate_hz, n_frames, next: 0, started: None, spent: Vec::new() }
    }
}

impl Source for Replay {
    fn next(&mut self, patience: Duration) -> Next {
        if self.n_frames <= self.next {
            return Next::End;
        }
        let capture_s = self.next as f64 / self.rate_hz;
        if self.is_live() {
            let started = *self.started.get_or_insert_with(Instant::now);
            let due = started + Duration::from_secs_f64(capture_s);
            let wait = due.saturating_duration_since(Instant::now());
            std::thread::sleep(wait.min(patience));
            if patience < wait {
                return Next::Nothing;
            }
        }
        let picture = &self.pictures[self.next as usize % self.pictures.len()];
        let (number, name) = (self.next, String::new());
        self.next += 1;
        let mut shown = self.spent.pop().unwrap_or_else(|| GrayImage::filled(0, 0, 0));
        (shown.width_px, shown.height_px) = (picture.width_px, picture.height_px);
        shown.data.clone_from(&picture.data);
        Next::Frame(Frame { number, capture_s, name, content: Content::Image(shown) })
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.spent.push(spent);
    }

    fn is_live(&self) -> bool {
        matches!(self.pace, Pace::Live)
    }
}
