//! The sources of images and detections: files, growing folders, streams, recordings, lines of text.
//!
//! A source is read on a thread of its own (`live`) and provides frames in order of capture. What cannot be read becomes a frame with a reason,
//! never the end of the source.

pub mod video;
pub mod stream;
pub mod pictures;
pub mod lines;
pub mod mcap;

use resight::{FileError, GrayImage};
use resight_core::camera::ImageSize;
use resight_core::correspondence::Detection;
use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// One image of one camera, or the detections in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its number in the source, counted from 0.
    pub number: u64,
    /// Capture time (not arrival), seconds since 1970, or since the start of a recording without a date.
    pub capture_s: f64,
    /// Its name: that of a file, or a topic and number.
    pub name: String,
    /// Its content.
    pub content: Content,
}

/// The content of a frame.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// An image.
    Image(GrayImage),
    /// Features found by another program.
    Detections(Vec<Detection>),
    /// A frame that could not be read, and why.
    Unreadable(String),
}

/// The result of one read of a source.
#[derive(Debug)]
pub enum Next {
    /// A frame.
    Frame(Frame),
    /// Nothing yet; read again (a folder, a silent pipe).
    Nothing,
    /// The source is lost: camera unplugged, stream broken; it will be tried again.
    Lost(FileError),
    /// The source has ended.
    End,
}

/// A source of frames. It stays on the thread that reads it.
pub trait Source: Send {
    /// Returns the next frame, after waiting at most about `patience`.
    fn next(&mut self, patience: Duration) -> Next;

    /// Returns whether frames arrive at their own pace, so that a slow reader must drop some; recordings wait.
    fn is_live(&self) -> bool;

    /// Returns whether its images are photographs, each taken for itself, instead of a sequence that shows how something moves.
    fn are_photographs(&self) -> bool {
        false
    }

    /// Returns how EXIF asks viewers to show the image that was given last, where that is rotated or mirrored; its pixels are as stored.
    fn orientation(&self) -> Option<&'static str> {
        None
    }

    /// Returns the number of key frames of the video up to the frame given last; `None` where frames do not depend on each other.
    fn key_frames(&self) -> Option<u64> {
        None
    }

    /// Takes back a processed image, whose memory may hold a later one. Requesting megabytes from the system for each frame costs time and
    /// fragments the memory.
    fn reuse(&mut self, _spent: GrayImage) {}
}

/// Returns the size of a source's first image, and the source with all of its frames still to come.
///
/// # Errors
/// A source that ends or is silent for `patience` before its first image, with what it gave instead.
pub fn size_of_first(
    mut source: Box<dyn Source>,
    patience: Duration,
) -> Result<(ImageSize, Box<dyn Source>), String> {
    let (until, mut reason) = (Instant::now() + patience, String::from("it gives no image"));
    let mut held = VecDeque::new();
    while Instant::now() < until {
        match source.next(Duration::from_millis(100)) {
            Next::Frame(frame) => {
                let size = match &frame.content {
                    Content::Image(image) => {
                        Some(ImageSize { width_px: image.width_px, height_px: image.height_px })
                    }
                    Content::Unreadable(why) => {
                        reason.clone_from(why);
                        None
                    }
                    Content::Detections(_) => return Err("it gives detections, not images".to_string()),
                };
                held.push_back(frame);
                if let Some(size) = size {
                    return Ok((size, Box::new(Begun { held, rest: source })));
                }
            }
            Next::Nothing => {}
            Next::Lost(why) => reason = why.to_string(),
            Next::End => return Err(reason),
        }
    }
    Err(format!("{reason} ({} s)", patience.as_secs()))
}

/// A source of which the first frames have been read ahead.
struct Begun {
    held: VecDeque<Frame>,
    rest: Box<dyn Source>,
}

impl Source for Begun {
    fn next(&mut self, patience: Duration) -> Next {
        self.held.pop_front().map_or_else(|| self.rest.next(patience), Next::Frame)
    }

    fn is_live(&self) -> bool {
        self.rest.is_live()
    }

    fn are_photographs(&self) -> bool {
        self.rest.are_photographs()
    }

    fn orientation(&self) -> Option<&'static str> {
        self.rest.orientation()
    }

    fn key_frames(&self) -> Option<u64> {
        self.rest.key_frames()
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.rest.reuse(spent);
    }
}
