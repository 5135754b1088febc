//! Decodes the frames of a video file with the system's `ffmpeg`.

pub mod ffmpeg;

use crate::input::what_is_it::{self, FileKind};
use crate::{FileError, GrayImage};
use ffmpeg::{Decoded, Decoder, Ffmpeg};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Time to wait for a frame before checking again.
const PATIENCE: Duration = Duration::from_secs(1);

/// Returns whether a file's first bytes are those of a video container: MP4 and QuickTime, Matroska and WebM, AVI, MPEG program and transport
/// streams, Ogg, Flash, NUT, IVF, YUV4MPEG2.
pub fn is_video(path: impl AsRef<Path>) -> bool {
    let path = path.as_ref();
    let mut head = Vec::new();
    let most = what_is_it::HEAD_BYTES as u64;
    let read = std::fs::File::open(path).and_then(|file| file.take(most).read_to_end(&mut head));
    read.is_ok() && what_is_it::what_is_it(&head).is_some_and(FileKind::is_video)
}

/// A video that is being decoded: an iterator over its frames in recording order, none dropped and none duplicated. A frame that cannot be
/// decoded is an error at its position.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    decoder: Decoder,
    /// The frame that was decoded when the file was opened.
    first: Option<Decoded>,
    is_over: bool,
}

impl Video {
    /// Starts `ffmpeg` on a file and waits for its first frame.
    ///
    /// # Errors
    /// A missing `ffmpeg` (with how to get it), a file without a video, frames larger than 64 Mpx.
    pub fn open(path: impl AsRef<Path>) -> Result<Self, FileError> {
        let path = path.as_ref();
        let reported = |reason: String| FileError::new(path, reason);
        // `file:` prevents a name with a colon from being interpreted as a protocol, and one with a dash as an option.
        let mut input = std::ffi::OsString::from("file:");
        input.push(path);
        let mut decoder = Ffmpeg::find().and_then(|ffmpeg| ffmpeg.decode(&[], &input)).map_err(reported)?;
        let mut first = Decoded::Nothing;
        while matches!(first, Decoded::Nothing) {
            first = decoder.next(PATIENCE);
        }
        if let Decoded::End(reason) = first {
            let words = reason.or_else(|| decoder.last_words()).unwrap_or("it is empty".to_string());
            return Err(reported(format!("no video in this file ({words})")));
        }
        Ok(Video { path: path.to_path_buf(), decoder, first: Some(first), is_over: false })
    }

    /// Returns the memory of a frame for reuse.
    pub fn reuse(&mut self, spent: GrayImage) {
        self.decoder.reuse(spent);
    }

    /// Returns the next item, waiting at most about `patience` for it.
    pub fn decoded(&mut self, patience: Duration) -> Decoded {
        if self.is_over {
            return Decoded::End(None);
        }
        let decoded = self.first.take().unwrap_or_else(|| self.decoder.next(patience));
        self.is_over = matches!(decoded, Decoded::End(_));
        decoded
    }
}

/// Explains why there is no frame; `None` where there is one, or where nothing is wrong.
pub fn complaint(decoded: &Decoded) -> Option<String> {
    match decoded {
        Decoded::Damaged(words) => Some(format!("a frame is damaged ({words})")),
        Decoded::Resized { from_px, to_px } => Some(resized(*from_px, *to_px)),
        Decoded::End(Some(words)) => Some(format!("decoding stopped ({words})")),
        Decoded::End(None) | Decoded::Frame(_) | Decoded::Nothing => None,
    }
}

/// Returns the message about a frame of another size.
pub fn resized(from_px: [u32; 2], to_px: [u32; 2]) -> String {
    let [from, to] = [from_px, to_px].map(|[width, height]| format!("{width}×{height}"));
    format!("frames changed from {from} to {to} px; one size is needed")
}

impl Iterator for Video {
    type Item = Result<GrayImage, FileError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            let decoded = self.decoded(PATIENCE);
            let complaint = complaint(&decoded).map(|reason| Err(FileError::new(&self.path, reason)));
            match decoded {
                Decoded::Nothing => {}
                Decoded::Frame(shot) => return Some(Ok(shot.image)),
                _ => return complaint,
            }
        }
    }
}
