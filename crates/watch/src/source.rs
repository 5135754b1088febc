//! Where images and detections come from: files, folders that fill up, streams, recordings, lines of text.
//!
//! A source is read on a thread of its own (`live`) and gives frames in order of capture. What cannot be read is a frame with a
//! reason, never the end of the source.

pub mod video;
pub mod stream;
pub mod pictures;
pub mod lines;
pub mod mcap;

use resight::{FileError, GrayImage};
use resight_core::correspondence::Detection;
use std::time::Duration;

/// One image of one camera, or what was found in it.
#[derive(Debug, Clone, PartialEq)]
pub struct Frame {
    /// Its number in the source, counted from 0.
    pub number: u64,
    /// When it was taken (not when it arrived), seconds since 1970, or since the start of a recording without a date.
    pub capture_s: f64,
    /// What to call it: a file's name, a topic and number.
    pub name: String,
    /// What came.
    pub content: Content,
}

/// What came.
#[derive(Debug, Clone, PartialEq)]
pub enum Content {
    /// An image.
    Image(GrayImage),
    /// Features found by another program.
    Detections(Vec<Detection>),
    /// A frame that could not be read, and why.
    Unreadable(String),
}

/// What the next look at a source gave.
#[derive(Debug)]
pub enum Next {
    /// A frame.
    Frame(Frame),
    /// Nothing yet; look again (a folder, a pipe that is silent).
    Nothing,
    /// The source is gone: camera unplugged, stream broken; it will be tried again.
    Lost(FileError),
    /// No more will come.
    End,
}

/// Anything that gives frames. It lives on the thread that reads it.
pub trait Source: Send {
    /// The next frame, waiting at most about `patience` for it.
    fn next(&mut self, patience: Duration) -> Next;

    /// Whether frames come at their own pace, so that a slow reader must drop some; recordings wait.
    fn is_live(&self) -> bool;

    /// Takes back an image that has been looked at: its memory may hold one to come. Megabytes asked of the system anew for each frame
    /// cost time, and leave it in pieces.
    fn reuse(&mut self, _spent: GrayImage) {}
}
