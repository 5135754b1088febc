//! The system's `ffmpeg` as a decoder: grey frames through one pipe, what it says of them through another; no library of its, no
//! temporary file.
//!
//! Frames arrive as YUV4MPEG2 on stdout: one header line (`YUV4MPEG2 W1280 H720 F30:1 … Cmono`), then for each frame a line `FRAME` and
//! W × H bytes. The filter `showinfo` says on stderr, before each frame goes out, when it was taken (its stamp, exact, in units of the
//! stream's time base) and how large it was. Behind that filter frames are stamped 0, 1, 2, … and passed through, so that nothing drops
//! or doubles one: the n-th line is that of the n-th frame. Containers that carry stamps (NUT, Matroska) do not do: their muxers round
//! to a time base of their own, refuse a stamp that goes back, and the image's size is stated only once.

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
/// How far the decoder's priority is below ours: a tenth of the processor where both want it.
const BEHIND: &str = "10";
/// A longer line is no header.
const MAX_HEADER_BYTES: u64 = 1024;
/// A longer line of ffmpeg's words is cut.
const MAX_WORDS_BYTES: u64 = 1 << 16;
/// What the entry of a playlist may be opened by.
const PROTOCOLS: &str = "pipe,fd,crypto,data,http,https,httpproxy,tcp,tls,udp,rtp,srtp,rtsp,rtsps,rtmp,rtmps,rtmpt,rtmpe,rtmpte,rtmpts,srt,rist,ftp,sftp,mmsh,mmst";
/// Decoded frames waiting to be taken; then ffmpeg waits.
const WAITING: usize = 2;
/// The line about a frame is written before the frame; it only has to be read.
const LINE_PATIENCE: Duration = Duration::from_secs(1);
/// How long ffmpeg may take to end after its last word.
const ENDING: Duration = Duration::from_secs(2);
/// The last frames may come this long after ffmpeg has said why no more will.
const AHEAD: Duration = Duration::from_secs(2);

/// An `ffmpeg` that is installed.
#[derive(Debug, Clone, Copy)]
pub struct Ffmpeg {
    /// Options are spelt differently.
    pub release: Release,
}

/// What came out of a decoder.
#[derive(Debug)]
pub enum Decoded {
    /// A frame.
    Frame(Shot),
    /// What could not be decoded, in ffmpeg's words.
    Damaged(String),
    /// A frame of another size than the first.
    Resized {
        /// Columns and rows of the first.
        from_px: [u32; 2],
        /// And of this one.
        to_px: [u32; 2],
    },
    /// Nothing yet.
    Nothing,
    /// No more will come; ffmpeg's last words where something went wrong.
    End(Option<String>),
}

/// A decoded frame.
#[derive(Debug)]
pub struct Shot {
    /// Presentation time, seconds of the stream's own clock; none where the stream states none.
    pub time_s: Option<f64>,
    /// The unit of such times, seconds: of an input without any, the one in which ffmpeg counts frames instead.
    pub tick_s: Option<f64>,
    /// When its last byte came out of the decoder.
    pub arrived: Instant,
    /// The frame.
    pub image: GrayImage,
}

/// A running `ffmpeg`; dropped, it is killed.
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

/// What ffmpeg complained of.
#[derive(Debug, Clone)]
struct Words {
    said: Instant,
    words: String,
}

impl Ffmpeg {
    /// Looks for it.
    ///
    /// # Errors
    /// Not installed (how to get it is said), or it does not run.
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

    /// The same of an input that holds a password, which every user of the machine could read in the list of processes: ffmpeg gets it
    /// through its stdin, as a playlist of one entry. `shown` is what stands in its words otherwise.
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

    /// Whether its TLS verifies certificates when asked to.
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
            // Far below what a pipe holds. An ffmpeg that has ended already says why itself.
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
    /// What comes next, waiting at most about `patience` for it.
    pub fn next(&mut self, patience: Duration) -> Decoded {
        match self.decoded.recv_timeout(patience) {
            Ok(Decoded::End(Some(reason))) => Decoded::End(Some(reason)),
            Ok(Decoded::End(None)) | Err(RecvTimeoutError::Disconnected) => Decoded::End(self.end()),
            Ok(decoded) => decoded,
            Err(RecvTimeoutError::Timeout) => Decoded::Nothing,
        }
    }

    /// Takes back an image whose memory may hold one to come.
    pub fn reuse(&mut self, spent: GrayImage) {
        // The reader may have ended.
        let _ = self.to_reader.send(spent);
    }

    /// What ffmpeg last complained of.
    pub fn last_words(&self) -> Option<String> {
        self.words().map(|last| last.words)
    }

    /// The same, unless it went on well afterwards: `alive` is when it last gave something.
    pub fn last_words_since(&self, alive: Instant) -> Option<String> {
        self.words().filter(|last| alive <= last.said + AHEAD).map(|last| last.words)
    }

    fn words(&self) -> Option<Words> {
        self.last_words.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Why it ended; none where all went well.
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
        // A decoder that is no longer read would wait for ever. It may have ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Hands on what ffmpeg says of an input, until it says no more.
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

/// The pipe of frames.
struct ImageFiles {
    pipe: BufReader<ChildStdout>,
    to_taker: SyncSender<Decoded>,
    /// Images that were looked at.
    spent: Receiver<GrayImage>,
    /// Columns and rows, once the header has come.
    size_px: Option<[u32; 2]>,
    /// Frames so far, and how many there were when ffmpeg began to count.
    next_number: u64,
    first_number: u64,
    /// What was said of a later frame.
    kept: Option<Reported>,
    time_base_s: Option<f64>,
    /// Frames that are not to be trusted.
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

    /// Passes on every frame with ffmpeg's messages about it, until the pipe ends or the reader stops. The pipe of frames leads: ffmpeg waits while it
    /// is full, whatever became of a line.
    fn read(mut self, reported: Receiver<Reported>) {
        loop {
            let decoded = match self.frame(&reported) {
                Ok(decoded) => decoded,
                Err(reason) => Decoded::End(reason),
            };
            let is_over = matches!(decoded, Decoded::End(_));
            if is_over {
                self.said_of_next(&reported); // What was said after the last frame.
            }
            // The taker may be gone.
            if self.to_taker.send(decoded).is_err() || is_over {
                return;
            }
        }
    }

    /// The next frame; an error, with or without a reason of its own, where the pipe ends instead.
    fn frame(&mut self, reported: &Receiver<Reported>) -> Result<Decoded, Option<String>> {
        let size_px = match self.size_px {
            Some(size_px) => size_px,
            None => self.header()?,
        };
        self.size_px = Some(size_px);
        let data = self.pixels(size_px)?;
        let arrived = Instant::now();
        let said = self.said_of_next(reported);
        self.next_number += 1;
        // ffmpeg scales every later frame to the size of the first.
        if let Some((_, to_px)) = said
            && to_px != size_px
        {
            return Ok(Decoded::Resized { from_px: size_px, to_px });
        }
        let ticks = said.and_then(|(ticks, _)| ticks);
        let time_s = self.time_base_s.zip(ticks).map(|(base_s, ticks)| base_s * ticks as f64);
        let torn = match said {
            Some(_) => self.torn.take(time_s, self.time_base_s.unwrap_or_default()),
            None => self.torn.take_any(),
        };
        if let Some(words) = torn {
            return Ok(Decoded::Damaged(words));
        }
        let image = GrayImage { width_px: size_px[0], height_px: size_px[1], data };
        Ok(Decoded::Frame(Shot { time_s, tick_s: self.time_base_s, arrived, image }))
    }

    /// Stamp and size of the next frame; none where its line was not understood, because those of several threads ran into each other.
    fn said_of_next(&mut self, reported: &Receiver<Reported>) -> Option<(Option<i64>, [u32; 2])> {
        loop {
            let next = self.kept.take().or_else(|| reported.recv_timeout(LINE_PATIENCE).ok())?;
            match next {
                // Numbers begin again with every configuration of the filter.
                Reported::TimeBase { seconds } => {
                    (self.time_base_s, self.first_number) = (Some(seconds), self.next_number);
                }
                Reported::CorruptFrame(words) => self.torn.complain(words),
                Reported::Decoded { time_s } => self.torn.name(time_s),
                Reported::NoFrame(words) => {
                    // The taker may be gone.
                    let _ = self.to_taker.send(Decoded::Damaged(words));
                }
                Reported::Frame { number, ticks, size_px } => {
                    match (self.first_number.saturating_add(number)).cmp(&self.next_number) {
                        Ordering::Less => {}
                        Ordering::Equal => return Some((ticks, size_px)),
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

/// W and H of a YUV4MPEG2 header; none where it is not one of grey frames.
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
