//! Frames of a video file, decoded by the system's `ffmpeg`.

pub mod ffmpeg;

use crate::{FileError, GrayImage};
use ffmpeg::{Decoded, Decoder, Ffmpeg};
use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// How long to wait for a frame before looking again.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whether a file's first bytes are those of a container of videos: MP4 and QuickTime, Matroska and WebM, AVI, MPEG program and
/// transport streams, Ogg, Flash, NUT, IVF, YUV4MPEG2.
pub fn is_video(path: &Path) -> bool {
    let mut head = Vec::new();
    let read = std::fs::File::open(path).and_then(|file| file.take(HEAD_BYTES).read_to_end(&mut head));
    let starts = |magic: &[u8]| head.starts_with(magic);
    let at = |place: usize, magic: &[u8]| head.get(place..).is_some_and(|rest| rest.starts_with(magic));
    read.is_ok()
        && (at(4, b"ftyp")
            || starts(&[0x1a, 0x45, 0xdf, 0xa3])
            || (starts(b"RIFF") && at(8, b"AVI "))
            || starts(&[0, 0, 1, 0xba])
            || [0, TS_PACKET, 2 * TS_PACKET].iter().all(|place| at(*place, b"G"))
            || [&b"OggS"[..], b"FLV\x01", b"nut/multimedia container", b"DKIF", b"YUV4MPEG2 "]
                .iter()
                .any(|magic| starts(magic)))
}

/// Bytes of a packet of an MPEG transport stream; each begins with 0x47, `G`.
const TS_PACKET: usize = 188;
/// Enough for three of them.
const HEAD_BYTES: u64 = 2 * TS_PACKET as u64 + 1;

/// A video being decoded; iterate over its frames, in recording order, none dropped and none doubled. A frame that cannot be decoded
/// is an error in its place.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    decoder: Decoder,
    /// Looked at when the file was opened.
    first: Option<Decoded>,
    is_over: bool,
}

impl Video {
    /// Starts `ffmpeg` on a file and waits for its first frame.
    ///
    /// # Errors
    /// No `ffmpeg` (how to get it is said), a file without a video, frames beyond 64 Mpx.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        let reported = |reason: String| FileError::new(path, reason);
        // `file:` keeps a name with a colon from being taken for a protocol, and one with a dash for an option.
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

    /// Takes back a frame whose memory may hold one to come.
    pub fn reuse(&mut self, spent: GrayImage) {
        self.decoder.reuse(spent);
    }

    /// What comes next, waiting at most about `patience` for it.
    pub fn decoded(&mut self, patience: Duration) -> Decoded {
        if self.is_over {
            return Decoded::End(None);
        }
        let decoded = self.first.take().unwrap_or_else(|| self.decoder.next(patience));
        self.is_over = matches!(decoded, Decoded::End(_));
        decoded
    }
}

/// Why there is no frame; none where there is one, or nothing is wrong.
pub fn complaint(decoded: &Decoded) -> Option<String> {
    match decoded {
        Decoded::Damaged(words) => Some(format!("a frame is damaged ({words})")),
        Decoded::Resized { from_px, to_px } => Some(resized(*from_px, *to_px)),
        Decoded::End(Some(words)) => Some(format!("decoding stopped ({words})")),
        Decoded::End(None) | Decoded::Frame(_) | Decoded::Nothing => None,
    }
}

/// What to say of a frame of another size.
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
