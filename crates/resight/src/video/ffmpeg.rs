//! Uses the system's `ffmpeg` as a decoder: grey frames arrive through one pipe, messages about them through another; none of its libraries and
//! no temporary file is used.
//!
//! Frames arrive as YUV4MPEG2 on stdout: one header line (`YUV4MPEG2 W1280 H720 F30:1 … Cmono`), then for each frame a line `FRAME` and W × H
//! bytes. The filter `showinfo` reports on stderr, before each frame is written, its time (its stamp, exact, in units of the stream's time base)
//! and its size. After that filter, frames are stamped 0, 1, 2, … and passed through, so that none is dropped or duplicated: the n-th line
//! belongs to the n-th frame. Containers with stamps (NUT, Matroska) are not suitable: their muxers round to a time base of their own, refuse
//! decreasing stamps, and state the image's size only once.

mod release;
mod torn;
mod words;

use crate::GrayImage;
pub use release::Release;
use std::cmp::Ordering;
use std::ffi::OsStr;
use std::io::{BufRead, BufReader, Read, Write};
use std::process::{Child, ChildStderr, ChildStdout, Command, ExitStatus, Stdio};
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, SyncSender, channel, sync_channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};
use torn::Torn;
use words::Reported;

/// Largest frame accepted, pixels, as for images.
const MAX_PIXELS: u64 = 64_000_000;
/// Amount by which the decoder's priority is below ours: it gets a tenth of the processor where both need it.
const BEHIND: &str = "10";
/// Longest header line, bytes.
const MAX_HEADER_BYTES: u64 = 1024;
/// Longest message of ffmpeg, bytes; longer ones are cut.
const MAX_WORDS_BYTES: u64 = 1 << 16;
/// Protocols that the entry of a playlist may use.
const PROTOCOLS: &str = "pipe,fd,crypto,data,http,https,httpproxy,tcp,tls,udp,rtp,srtp,rtsp,rtsps,rtmp,rtmps,rtmpt,rtmpe,rtmpte,rtmpts,srt,rist,ftp,sftp,mmsh,mmst";
/// Number of decoded frames that are buffered; then ffmpeg waits.
const WAITING: usize = 2;
/// The line about a frame is written before the frame, so that it only has to be read.
const LINE_PATIENCE: Duration = Duration::from_secs(1);
/// Time that ffmpeg may need to end after its last message.
const ENDING: Duration = Duration::from_secs(2);
/// Longest time between ffmpeg's message that no more frames will come and the last frames.
const AHEAD: Duration = Duration::from_secs(2);

/// An `ffmpeg` that is installed.
#[derive(Debug, Clone, Copy)]
pub struct Ffmpeg {
    /// The release, because the spelling of options differs.
    pub release: Release,
}

/// An item from a decoder.
#[derive(Debug)]
pub enum Decoded {
    /// A frame.
    Frame(Shot),
    /// Data that could not be decoded, with ffmpeg's message.
    Damaged(String),
    /// A frame of another size than the first.
    Resized {
        /// Columns and rows of the first frame.
        from_px: [u32; 2],
        /// Columns and rows of this frame.
        to_px: [u32; 2],
    },
    /// Nothing yet.
    Nothing,
    /// The end, with ffmpeg's last message where something went wrong.
    End(Option<String>),
}

/// A decoded frame.
#[derive(Debug)]
pub struct Shot {
    /// Presentation time, seconds of the stream's own clock; `None` where the stream states none.
    pub time_s: Option<f64>,
    /// The unit of such times, seconds; for an input without times, the unit in which ffmpeg counts frames instead.
    pub tick_s: Option<f64>,
    /// The time when its last byte came out of the decoder.
    pub arrived: Instant,
    /// Whether it is a key frame: decoded without any other. The errors of a still scene change with each.
    pub is_key: bool,
    /// The frame.
    pub image: GrayImage,
}

/// A running `ffmpeg`, which is killed when this is dropped.
#[derive(Debug)]
pub struct Decoder {
    process: Child,
    decoded: Receiver<Decoded>,
    to_reader: Sender<GrayImage>,
    last_words: Arc<Mutex<Option<Words>>>,
}

/// Runs `ffmpeg` at a lower priority than the searches that take its frames, because decoding ahead delays a search without any gain.
fn command() -> Command {
    match Command::new("nice").stdin(Stdio::null()).stdout(Stdio::null()).status() {
        Ok(_) => {
            let mut command = Command::new("nice");
            command.args(["-n", BEHIND, "ffmpeg"]);
            command
        }
        Err(_) => Command::new("ffmpeg"),
    }
}

/// The messages with which ffmpeg complained.
#[derive(Debug, Clone)]
struct Words {
    said: Instant,
    words: String,
}

impl Ffmpeg {
    /// Finds the installed `ffmpeg`.
    ///
    /// # Errors
    /// It is not installed (with how to get it), or it does not run.
    pub fn find() -> Result<Self, String> {
        let reported =
            Command::new("ffmpeg").arg("-version").stdin(Stdio::null()).output().map_err(cannot_start)?;
        Ok(Ffmpeg { release: Release::read(&String::from_utf8_lossy(&reported.stdout)) })
    }

    /// Starts to decode the first video stream of an input.
    ///
    /// # Errors
    /// It cannot be started.
    pub fn decode(&self, input_options: &[String], input: &OsStr) -> Result<Decoder, String> {
        self.start(input_options, input, &input.to_string_lossy(), None)
    }

    /// Starts to decode an input whose address has a password, which every user of the machine could read in the list of processes: ffmpeg
    /// receives it through its stdin, as a playlist with one entry. `shown` replaces it in messages.
    ///
    /// # Errors
    /// It cannot be started, or is too old for this address.
    pub fn decode_without_arguments(
        &self,
        options: &[String],
        playlist: String,
        input: &str,
    ) -> Result<Decoder, String> {
        if !self.release.takes_options_in_playlists() {
            return Err(
                "this ffmpeg can be given a password only where everybody sees it; install 5.0 or newer"
                    .into(),
            );
        }
        let playlist_options = ["-safe", "0", "-protocol_whitelist", PROTOCOLS, "-f", "concat"];
        let options: Vec<String> =
            options.iter().cloned().chain(playlist_options.map(str::to_string)).collect();
        self.start(&options, OsStr::new("pipe:0"), input, Some(playlist))
    }

    /// Returns whether its TLS can verify certificates.
    pub fn verifies_certificates(&self) -> bool {
        let reported = Command::new("ffmpeg")
            .args(["-hide_banner", "-h", "protocol=tls"])
            .stdin(Stdio::null())
            .output()
            .map(|reported| String::from_utf8_lossy(&reported.stdout).into_owned())
            .unwrap_or_default();
        reported.contains("-tls_verify") && reported.contains("-ca_file")
    }

    fn start(
        &self,
        input_options: &[String],
        input: &OsStr,
        name: &str,
        playlist: Option<String>,
    ) -> Result<Decoder, String> {
        let mut process = command()
            .args(["-nostdin", "-hide_banner", "-nostats", "-v", "repeat+level+info"])
            .args(self.release.decoder_says())
            .args(input_options)
            .arg("-i")
            .arg(input)
            .args(["-map", "0:v:0", "-vf", "showinfo=checksum=0,settb=1/30,setpts=N"])
            .args(["-enc_time_base", "1/30"])
            .args(self.release.each_frame_once())
            .args(["-pix_fmt", "gray", "-strict", "-1", "-flush_packets", "1", "-f", "yuv4mpegpipe", "-"])
            .stdin(if playlist.is_some() { Stdio::piped() } else { Stdio::null() })
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .map_err(cannot_start)?;
        if let (Some(playlist), Some(mut stdin)) = (playlist, process.stdin.take()) {
            // The playlist is far shorter than the capacity of a pipe. If ffmpeg has ended already, it reports the reason itself.
            let _ = stdin.write_all(playlist.as_bytes());
        }
        let pipes = (process.stdout.take(), process.stderr.take());
        let (to_taker, decoded) = sync_channel(WAITING);
        let (to_reader, spent) = channel();
        let last_words = Arc::new(Mutex::new(None));
        if let (Some(stdout), Some(stderr)) = pipes {
            let (to_pictures, reported) = channel();
            let words = Arc::clone(&last_words);
            let input = name.to_string();
            thread::spawn(move || {
                listen(stderr, &input, &words, |reported| {
                    // The reader of the images may have stopped; ffmpeg's messages are still read to the end.
                    let _ = to_pictures.send(reported);
                });
            });
            thread::spawn(move || ImageFiles::new(stdout, to_taker, spent).read(reported));
        }
        Ok(Decoder { process, decoded, to_reader, last_words })
    }
}

impl Decoder {
    /// Returns the next item, waiting at most about `patience` for it.
    pub fn next(&mut self, patience: Duration) -> Decoded {
        match self.decoded.recv_timeout(patience) {
            Ok(Decoded::End(Some(reason))) => Decoded::End(Some(reason)),
            Ok(Decoded::End(None)) | Err(RecvTimeoutError::Disconnected) => Decoded::End(self.end()),
            Ok(decoded) => decoded,
            Err(RecvTimeoutError::Timeout) => Decoded::Nothing,
        }
    }

    /// Returns the memory of an image for reuse.
    pub fn reuse(&mut self, spent: GrayImage) {
        // The reader may have ended.
        let _ = self.to_reader.send(spent);
    }

    /// Returns ffmpeg's last complaint.
    pub fn last_words(&self) -> Option<String> {
        self.words().map(|last| last.words)
    }

    /// Returns ffmpeg's last complaint, unless it was followed by frames: `alive` is the time of its last output.
    pub fn last_words_since(&self, alive: Instant) -> Option<String> {
        self.words().filter(|last| alive <= last.said + AHEAD).map(|last| last.words)
    }

    fn words(&self) -> Option<Words> {
        self.last_words.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Waits for the end, and returns its reason; `None` where nothing went wrong.
    fn end(&mut self) -> Option<String> {
        let is_well = self.status().is_some_and(|status| status.success());
        let words = self.last_words();
        if is_well { None } else { Some(words.unwrap_or("`ffmpeg -i FILE -f null -` says more".to_string())) }
    }

    fn status(&mut self) -> Option<ExitStatus> {
        let until = Instant::now() + ENDING;
        while Instant::now() < until {
            match self.process.try_wait() {
                Ok(None) => thread::sleep(Duration::from_millis(2)),
                Ok(status) => return status,
                Err(_) => return None,
            }
        }
        None
    }
}

impl Drop for Decoder {
    fn drop(&mut self) {
        // A decoder whose output is no longer read would wait for ever. It may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Passes on ffmpeg's messages about an input until there are no more.
fn listen(
    stderr: ChildStderr,
    input: &str,
    last_words: &Mutex<Option<Words>>,
    mut hand_on: impl FnMut(Reported),
) {
    let mut stderr = BufReader::new(stderr);
    let mut line = Vec::new();
    loop {
        line.clear();
        match (&mut stderr).take(MAX_WORDS_BYTES).read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return,
            Ok(_) => {}
        }
        let line = String::from_utf8_lossy(&line);
        if let Some(words) = words::complaint(&line) {
            let mut last = last_words.lock().unwrap_or_else(PoisonError::into_inner);
            if !last.as_ref().is_some_and(|last| words::sums_up(&words, &last.words, input)) {
                *last = Some(Words { said: Instant::now(), words });
            }
        }
        words::reported(&line).into_iter().for_each(&mut hand_on);
    }
}

/// What ffmpeg reports of a frame.
#[derive(Debug, Clone, Copy)]
struct FrameReport {
    ticks: Option<i64>,
    size_px: [u32; 2],
    is_key: bool,
}

/// The pipe of frames.
struct ImageFiles {
    pipe: BufReader<ChildStdout>,
    to_taker: SyncSender<Decoded>,
    /// Images whose memory can be reused.
    spent: Receiver<GrayImage>,
    /// Columns and rows, once the header has come.
    size_px: Option<[u32; 2]>,
    /// Index of the next frame, and the index at which ffmpeg began to count.
    next_number: u64,
    first_number: u64,
    /// A message about a later frame.
    kept: Option<Reported>,
    time_base_s: Option<f64>,
    /// Frames with damaged data.
    torn: Torn,
}

impl ImageFiles {
    fn new(stdout: ChildStdout, to_taker: SyncSender<Decoded>, spent: Receiver<GrayImage>) -> Self {
        let pipe = BufReader::with_capacity(1 << 20, stdout);
        ImageFiles {
            pipe,
            to_taker,
            spent,
            size_px: None,
            next_number: 0,
            first_number: 0,
            kept: None,
            time_base_s: None,
            torn: Torn::default(),
        }
    }

    /// Passes on every frame with ffmpeg's messages about it, until the pipe ends or the reader stops. The pipe of frames determines the pace:
    /// ffmpeg waits while it is full, whatever happened to a line.
    fn read(mut self, reported: Receiver<Reported>) {
        loop {
            let decoded = match self.frame(&reported) {
                Ok(decoded) => decoded,
                Err(reason) => Decoded::End(reason),
            };
            let is_over = matches!(decoded, Decoded::End(_));
            if is_over {
                self.report_of_next(&reported); // What was reported after the last frame.
            }
            // The receiver may have ended.
            if self.to_taker.send(decoded).is_err() || is_over {
                return;
            }
        }
    }

    /// Reads the next frame; an error, with or without a reason of its own, where the pipe ends instead.
    fn frame(&mut self, reported: &Receiver<Reported>) -> Result<Decoded, Option<String>> {
        let size_px = match self.size_px {
            Some(size_px) => size_px,
            None => self.header()?,
        };
        self.size_px = Some(size_px);
        let data = self.pixels(size_px)?;
        let arrived = Instant::now();
        let report = self.report_of_next(reported);
        self.next_number += 1;
        // ffmpeg scales every later frame to the size of the first.
        if let Some(FrameReport { size_px: to_px, .. }) = report
            && to_px != size_px
        {
            return Ok(Decoded::Resized { from_px: size_px, to_px });
        }
        let (ticks, is_key) = report.map_or((None, false), |report| (report.ticks, report.is_key));
        let time_s = self.time_base_s.zip(ticks).map(|(base_s, ticks)| base_s * ticks as f64);
        let torn = match report {
            Some(_) => self.torn.take(time_s, self.time_base_s.unwrap_or_default()),
            None => self.torn.take_any(),
        };
        if let Some(words) = torn {
            return Ok(Decoded::Damaged(words));
        }
        let image = GrayImage { width_px: size_px[0], height_px: size_px[1], data };
        Ok(Decoded::Frame(Shot { time_s, tick_s: self.time_base_s, arrived, is_key, image }))
    }

    /// Returns what is reported of the next frame; `None` where its line was not understood, because lines of several threads were mixed.
    fn report_of_next(&mut self, reported: &Receiver<Reported>) -> Option<FrameReport> {
        loop {
            let next = self.kept.take().or_else(|| reported.recv_timeout(LINE_PATIENCE).ok())?;
            match next {
                // Numbers start again with every configuration of the filter.
                Reported::TimeBase { seconds } => {
                    (self.time_base_s, self.first_number) = (Some(seconds), self.next_number);
                }
                Reported::CorruptFrame(words) => self.torn.complain(words),
                Reported::Decoded { time_s } => self.torn.name(time_s),
                Reported::NoFrame(words) => {
                    // The receiver may have ended.
                    let _ = self.to_taker.send(Decoded::Damaged(words));
                }
                Reported::Frame { number, ticks, size_px, is_key } => {
                    match (self.first_number.saturating_add(number)).cmp(&self.next_number) {
                        Ordering::Less => {}
                        Ordering::Equal => return Some(FrameReport { ticks, size_px, is_key }),
                        Ordering::Greater => {
                            self.kept = Some(next);
                            return None;
                        }
                    }
                }
            }
        }
    }

    fn pixels(&mut self, size_px: [u32; 2]) -> Result<Vec<u8>, Option<String>> {
        if !self.line()?.starts_with("FRAME") {
            return Err(None);
        }
        let mut data = self.spent.try_recv().map_or_else(|_| Vec::new(), |spent| spent.data);
        data.resize(size_px[0] as usize * size_px[1] as usize, 0);
        self.pipe.read_exact(&mut data).map_err(|_| None)?;
        Ok(data)
    }

    fn header(&mut self) -> Result<[u32; 2], Option<String>> {
        let line = self.line()?;
        let [width_px, height_px] = size(&line).ok_or(None)?;
        if MAX_PIXELS < u64::from(width_px) * u64::from(height_px) {
            return Err(Some(format!(
                "frames are {width_px}×{height_px} px; the limit is 64 Mpx, reduce them"
            )));
        }
        Ok([width_px, height_px])
    }

    fn line(&mut self) -> Result<String, Option<String>> {
        let mut line = Vec::new();
        let read = (&mut self.pipe).take(MAX_HEADER_BYTES).read_until(b'\n', &mut line);
        read.map_err(|_| None)?;
        Ok(String::from_utf8_lossy(&line).trim_end().to_string())
    }
}

fn cannot_start(reason: std::io::Error) -> String {
    match reason.kind() {
        std::io::ErrorKind::NotFound => {
            "videos and streams are decoded by the program ffmpeg, which is not installed; install it \
             (apt install ffmpeg, brew install ffmpeg, winget install ffmpeg) or give the frames as PNG or JPEG images"
                .to_string()
        }
        _ => format!("ffmpeg cannot be started: {reason}"),
    }
}

/// Returns W and H of a YUV4MPEG2 header; `None` where it is not one of grey frames.
fn size(header: &str) -> Option<[u32; 2]> {
    let fields = header.strip_prefix("YUV4MPEG2 ")?;
    let field = |letter: char| fields.split(' ').find_map(|field| field.strip_prefix(letter));
    let number = |letter: char| field(letter)?.parse().ok().filter(|n| 0 < *n);
    (field('C')? == "mono").then_some([number('W')?, number('H')?])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read() {
        assert_eq!(size("YUV4MPEG2 W1280 H720 F30:1 Ip A1:1 Cmono XCOLORRANGE=FULL"), Some([1280, 720]));
        for bad in ["", "YUV4MPEG2 W1280 F30:1 Cmono", "YUV4MPEG2 W0 H720 Cmono", "YUV4MPEG2 W2 H2 C420jpeg"]
        {
            assert_eq!(size(bad), None, "{bad}");
        }
    }
}
