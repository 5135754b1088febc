//! Frames of a video file, decoded by the system's `ffmpeg` and read from a pipe: no library of its, no temporary file.
//!
//! Grey frames arrive as YUV4MPEG2: one header line (`YUV4MPEG2 W1280 H720 F30:1 … Cmono`), then for each frame a line `FRAME` and
//! W × H bytes.

use crate::{FileError, GrayImage};
use std::io::{BufRead, BufReader, Read};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdout, Command, Stdio};

/// Largest frame accepted, pixels, as for pictures.
const MAX_PIXELS: u64 = 64_000_000;
/// A longer line is no header.
const MAX_LINE_BYTES: u64 = 1024;

/// Frame N at N/30 s, thirty a second: each frame once, whatever its time stamp. (The options that say so directly changed their
/// names between ffmpeg's releases.)
const EVENLY: [&str; 2] = ["setpts=N/30/TB", "30"];

/// A video being decoded; iterate over its frames, in recording order, none dropped and none doubled.
#[derive(Debug)]
pub struct Video {
    path: PathBuf,
    decoder: Child,
    frames: BufReader<ChildStdout>,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    is_over: bool,
}

/// Whether a file's first bytes are those of a container of videos: MP4 and QuickTime, Matroska and WebM, AVI, MPEG, Ogg.
pub fn is_video(path: &Path) -> bool {
    let mut head = [0; 12];
    let read = std::fs::File::open(path).and_then(|mut file| file.read_exact(&mut head));
    let starts = |magic: &[u8]| head.starts_with(magic);
    read.is_ok()
        && (&head[4..8] == b"ftyp"
            || starts(&[0x1a, 0x45, 0xdf, 0xa3])
            || (starts(b"RIFF") && &head[8..12] == b"AVI ")
            || starts(&[0, 0, 1, 0xba])
            || starts(b"OggS"))
}

impl Video {
    /// Starts `ffmpeg` on a file.
    ///
    /// # Errors
    /// No `ffmpeg` (how to get it is said), a file without a video, frames beyond 64 Mpx.
    pub fn open(path: &Path) -> Result<Self, FileError> {
        // `file:` keeps a name with a colon from being taken for a protocol, and one with a dash for an option.
        let mut input = std::ffi::OsString::from("file:");
        input.push(path);
        let mut decoder = Command::new("ffmpeg")
            .args(["-nostdin", "-v", "fatal", "-i"])
            .arg(input)
            .args(["-map", "0:v:0", "-vf", EVENLY[0], "-r", EVENLY[1], "-pix_fmt", "gray"])
            .args(["-strict", "-1", "-f", "yuv4mpegpipe", "-"])
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(|reason| FileError::new(path, cannot_start(&reason)))?;
        let told = |reason: &str| FileError::new(path, reason);
        let stdout = decoder.stdout.take().ok_or_else(|| told("ffmpeg gives no output"))?;
        let frames = BufReader::with_capacity(1 << 20, stdout);
        let (path, width_px, height_px) = (path.to_path_buf(), 0, 0);
        let mut video = Video { path, decoder, frames, width_px, height_px, is_over: false };
        let header = video.line()?;
        let (width_px, height_px) = size(&header).ok_or_else(|| video.failure("no video in this file"))?;
        if MAX_PIXELS < u64::from(width_px) * u64::from(height_px) {
            let size = format!("frames are {width_px}×{height_px} px; the limit is 64 Mpx, reduce them");
            return Err(FileError::new(&video.path, size));
        }
        (video.width_px, video.height_px) = (width_px, height_px);
        Ok(video)
    }

    /// The next frame; none after the last.
    fn frame(&mut self) -> Result<Option<GrayImage>, FileError> {
        let mark = self.line()?;
        if mark.is_empty() {
            return self.end().map(|()| None);
        }
        if !mark.starts_with("FRAME") {
            return Err(self.failure("not a frame where one is due"));
        }
        let mut data = vec![0; self.width_px as usize * self.height_px as usize];
        match self.frames.read_exact(&mut data) {
            Ok(()) => Ok(Some(GrayImage { width_px: self.width_px, height_px: self.height_px, data })),
            Err(_) => Err(self.failure("the last frame is torn")),
        }
    }

    fn line(&mut self) -> Result<String, FileError> {
        let mut line = Vec::new();
        let read = (&mut self.frames).take(MAX_LINE_BYTES).read_until(b'\n', &mut line);
        read.map_err(|e| FileError::new(&self.path, e.to_string()))?;
        Ok(String::from_utf8_lossy(&line).trim_end().to_string())
    }

    fn end(&mut self) -> Result<(), FileError> {
        match self.decoder.wait() {
            Ok(status) if status.success() => Ok(()),
            _ => Err(self.failure("decoding stopped")),
        }
    }

    /// What went wrong, with ffmpeg's own words where it has any.
    fn failure(&mut self, what: &str) -> FileError {
        let _ = self.decoder.kill(); // It may have ended already.
        let mut words = String::new();
        if let Some(mut stderr) = self.decoder.stderr.take() {
            let _ = stderr.read_to_string(&mut words); // Words that cannot be read explain nothing.
        }
        let last = words.lines().last().unwrap_or("`ffmpeg -i FILE -f null -` says more");
        FileError::new(&self.path, format!("{what} ({last})"))
    }
}

impl Iterator for Video {
    type Item = Result<GrayImage, FileError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.is_over {
            return None;
        }
        let frame = self.frame().transpose();
        self.is_over = !matches!(frame, Some(Ok(_)));
        frame
    }
}

impl Drop for Video {
    fn drop(&mut self) {
        // A decoder that is no longer read would wait for ever.
        let _ = self.decoder.kill();
        let _ = self.decoder.wait();
    }
}

/// Frames a second on average, as `ffprobe`, which comes with `ffmpeg`, reads them from the file.
///
/// # Errors
/// No `ffprobe`, or a file that states no rate.
pub fn frames_per_s(path: &Path) -> Result<f64, FileError> {
    let mut input = std::ffi::OsString::from("file:");
    input.push(path);
    let told = Command::new("ffprobe")
        .args(["-v", "fatal", "-select_streams", "v:0", "-show_entries", "stream=avg_frame_rate"])
        .args(["-of", "default=noprint_wrappers=1:nokey=1"])
        .arg(input)
        .output()
        .map_err(|reason| FileError::new(path, cannot_start(&reason)))?;
    let text = String::from_utf8_lossy(&told.stdout);
    let (frames, seconds) = text.trim().split_once('/').unwrap_or((text.trim(), "1"));
    match (frames.parse::<f64>(), seconds.parse::<f64>()) {
        (Ok(frames), Ok(seconds)) if 0.0 < frames && 0.0 < seconds => Ok(frames / seconds),
        _ => Err(FileError::new(
            path,
            format!("states no frame rate (ffprobe says {:?}); give the frames as pictures", text.trim()),
        )),
    }
}

fn cannot_start(reason: &std::io::Error) -> String {
    match reason.kind() {
        std::io::ErrorKind::NotFound => "videos are decoded by the program ffmpeg, which is not installed; install it \
             (apt install ffmpeg, brew install ffmpeg, winget install ffmpeg) or give the frames as PNG or JPEG images"
            .to_string(),
        _ => format!("ffmpeg cannot be started: {reason}"),
    }
}

/// W and H of a YUV4MPEG2 header; none where it is not one of grey frames.
fn size(header: &str) -> Option<(u32, u32)> {
    let fields = header.strip_prefix("YUV4MPEG2 ")?;
    let field = |letter: char| fields.split(' ').find_map(|field| field.strip_prefix(letter));
    let number = |letter: char| field(letter)?.parse().ok().filter(|n| 0 < *n);
    (field('C')? == "mono").then_some((number('W')?, number('H')?))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read() {
        assert_eq!(size("YUV4MPEG2 W1280 H720 F30:1 Ip A1:1 Cmono"), Some((1280, 720)));
        for bad in ["", "YUV4MPEG2 W1280 F30:1 Cmono", "YUV4MPEG2 W0 H720 Cmono", "YUV4MPEG2 W2 H2 C420jpeg"]
        {
            assert_eq!(size(bad), None, "{bad}");
        }
    }
}
