//! A video file as a source.

use super::{Content, Frame, Next, Source};
use resight::FileError;
use resight::GrayImage;
use resight::video::complaint;
use resight::video::ffmpeg::Decoded;
pub use resight::video::{Video, is_video};
use std::path::Path;
use std::time::Duration;

/// A video file as a source: every frame at its presentation time, seconds since the start of the recording.
pub struct Film {
    video: Video,
    name: String,
    number: u64,
    /// Number of key frames so far.
    key_frames: u64,
    /// Time of the last frame, and its interval from the one before it.
    last_s: f64,
    period_s: f64,
}

impl Film {
    /// # Errors
    /// Opens a file like `Video::open`.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let (video, name) = (Video::open(path)?, path.display().to_string());
        Ok(Film { video, name, number: 0, key_frames: 0, last_s: 0.0, period_s: 0.0 })
    }

    /// Returns the capture time; a frame without a stamp continues the last interval.
    fn capture_s(&mut self, time_s: Option<f64>) -> f64 {
        let capture_s = time_s.unwrap_or(self.last_s + self.period_s);
        if 0 < self.number {
            self.period_s = capture_s - self.last_s;
        }
        self.last_s = capture_s;
        capture_s
    }
}

impl Source for Film {
    fn next(&mut self, patience: Duration) -> Next {
        let decoded = self.video.decoded(patience);
        let complaint = complaint(&decoded);
        let (capture_s, content) = match decoded {
            Decoded::Nothing => return Next::Nothing,
            Decoded::End(None) => return Next::End,
            Decoded::Frame(shot) => {
                self.key_frames += u64::from(shot.is_key);
                (self.capture_s(shot.time_s), Content::Image(shot.image))
            }
            _ => (
                self.last_s,
                Content::Unreadable(format!("{}: {}", self.name, complaint.unwrap_or_default())),
            ),
        };
        let (number, name) = (self.number, format!("{}#{}", self.name, self.number));
        self.number += 1;
        Next::Frame(Frame { number, capture_s, name, content })
    }

    fn is_live(&self) -> bool {
        false
    }

    fn key_frames(&self) -> Option<u64> {
        Some(self.key_frames)
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.video.reuse(spent);
    }
}
