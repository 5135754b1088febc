//! Live streams and cameras, through the system's `ffmpeg`: RTSP, HTTP, TCP, UDP, RTMP and its other protocols, V4L2.
//!
//! A stream that ends, stalls or changes the size of its frames is lost; the next read opens it again.

mod address;
mod clock;

use super::{Content, Frame, Next, Source};
use address::Address;
pub use address::is_stream;
use clock::StreamClock;
use resight::video::ffmpeg::{Decoded, Decoder, Ffmpeg};
use resight::video::resized;
use resight::{FileError, GrayImage};
use std::ffi::OsStr;
use std::time::{Duration, Instant};

/// Further time for the first frame, seconds: the connection, the analysis of the stream, and the wait for a key frame.
const OPENING_S: f64 = 15.0;

/// Settings of a stream.
#[derive(Debug, Clone, PartialEq)]
pub struct StreamConfig {
    /// Further options of ffmpeg for its input, one word each.
    pub input_options: Vec<String>,
    /// Time without a frame after which the stream is lost, seconds; the first frame may take 15 s longer.
    pub lost_after_s: f64,
    /// Whether the source ends where the stream ends or is lost; otherwise it is opened again.
    pub ends: bool,
}

impl Default for StreamConfig {
    fn default() -> Self {
        StreamConfig { input_options: Vec::new(), lost_after_s: 10.0, ends: false }
    }
}

/// A live stream.
pub struct Stream {
    ffmpeg: Ffmpeg,
    address: Address,
    config: StreamConfig,
    connection: Option<Connection>,
    /// Number of frames so far, over all connections.
    number: u64,
    /// Number of key frames of the connections before.
    key_frames: u64,
    is_over: bool,
}

struct Connection {
    decoder: Decoder,
    clock: StreamClock,
    /// Time of its last sign of life.
    alive: Instant,
    has_given: bool,
    /// Number of its key frames so far.
    key_frames: u64,
}

impl Stream {
    /// Opens a stream without connecting before the first read.
    ///
    /// # Errors
    /// A missing `ffmpeg`; the message states how to get it. An `ffmpeg` that cannot verify the certificate of a TLS server.
    pub fn open(address: &str, config: StreamConfig) -> Result<Self, FileError> {
        let address = Address::new(address);
        let ffmpeg = Ffmpeg::find().map_err(|reason| FileError::new(&address.shown, reason))?;
        if address.is_tls() && !ffmpeg.verifies_certificates() {
            let reason = "this ffmpeg does not verify certificates, so anybody could be at the other end; install one with \
                          TLS that knows -tls_verify and -ca_file";
            return Err(FileError::new(&address.shown, reason));
        }
        address.tls_options().map_err(|reason| FileError::new(&address.shown, reason))?;
        Ok(Stream { ffmpeg, address, config, connection: None, number: 0, key_frames: 0, is_over: false })
    }

    fn connect(&self) -> Result<Connection, FileError> {
        let decoder = self.decoder();
        let now = Instant::now();
        Ok(Connection {
            decoder: decoder.map_err(|reason| FileError::new(&self.address.shown, reason))?,
            clock: StreamClock::started(now),
            alive: now,
            has_given: false,
            key_frames: 0,
        })
    }

    fn decoder(&self) -> Result<Decoder, String> {
        let options = self.address.input_options(self.config.lost_after_s, self.ffmpeg.release);
        let options = [options, self.address.tls_options()?, self.config.input_options.clone()].concat();
        if !self.address.is_secret() {
            return self.ffmpeg.decode(&options, OsStr::new(&self.address.input));
        }
        let (playlist, options) = self.address.playlist(&options)?;
        self.ffmpeg.decode_without_arguments(&options, playlist, &self.address.input)
    }

    /// Returns the result of a connection: a frame's time and content, or none while there is none.
    fn look(&self, connection: &mut Connection, patience: Duration) -> Result<Option<(f64, Content)>, Gone> {
        let came = match connection.decoder.next(patience) {
            Decoded::Frame(shot) => {
                connection.has_given = true;
                connection.key_frames += u64::from(shot.is_key);
                let stamp_s = shot.time_s.filter(|_| !shot.tick_s.is_some_and(is_count));
                Some((connection.clock.capture_s(stamp_s, shot.arrived), Content::Image(shot.image)))
            }
            Decoded::Damaged(words) => {
                let reason =
                    format!("{}: a frame is damaged ({})", self.address.shown, self.address.hide(&words));
                Some((connection.clock.last_s(), Content::Unreadable(reason)))
            }
            Decoded::Resized { from_px, to_px } => return Err(Gone::Lost(resized(from_px, to_px))),
            Decoded::End(reason) => return Err(Gone::Ended(self.last_words(connection, reason))),
            Decoded::Nothing => None,
        };
        if came.is_some() {
            connection.alive = Instant::now();
            return Ok(came);
        }
        let patience_s = self.config.lost_after_s + if connection.has_given { 0.0 } else { OPENING_S };
        if Duration::from_secs_f64(patience_s) < connection.alive.elapsed() {
            let words = self.last_words(connection, None);
            return Err(Gone::Lost(format!("no frame for {patience_s} s{words}")));
        }
        Ok(None)
    }

    /// Returns `reason`, or ffmpeg's last message where there is none, in brackets and without secrets.
    fn last_words(&self, connection: &Connection, reason: Option<String>) -> String {
        let words = reason.or_else(|| connection.decoder.last_words_since(connection.alive));
        words.map_or(String::new(), |words| format!(" ({})", self.address.hide(&words)))
    }

    /// Returns the result of a lost connection. With `StreamConfig::ends` the source is over at the first loss, instead of opening a silent camera for ever.
    fn lost(&mut self, gone: Gone, has_given: bool) -> Next {
        self.is_over = self.config.ends;
        let reason = match gone {
            Gone::Ended(_) if self.config.ends && has_given => return Next::End,
            Gone::Ended(words) if has_given => format!("the stream ended{words}"),
            Gone::Ended(words) => format!("no stream{words}"),
            Gone::Lost(reason) => reason,
        };
        Next::Lost(FileError::new(&self.address.shown, reason))
    }
}

/// Returns whether stamps in these units count frames: for formats without times ffmpeg generates 25 a second.
fn is_count(tick_s: f64) -> bool {
    COUNTED_IN_S.iter().any(|count_s| (tick_s / count_s - 1.0).abs() < 1e-9)
}

/// Units of parts of a multipart document (consecutive images) and of bare streams of a codec. No format with times of its own has these units.
const COUNTED_IN_S: [f64; 2] = [1.0 / 25.0, 1.0 / 1_200_000.0];

/// The reason why a connection is unusable.
enum Gone {
    /// ffmpeg has ended, with its last message.
    Ended(String),
    /// ffmpeg still runs, but is of no use.
    Lost(String),
}

impl Source for Stream {
    fn next(&mut self, patience: Duration) -> Next {
        if self.is_over {
            return Next::End;
        }
        let connected = self.connection.take().map_or_else(|| self.connect(), Ok);
        let mut connection = match connected {
            Ok(connection) => connection,
            Err(reason) => {
                self.is_over = self.config.ends;
                return Next::Lost(reason);
            }
        };
        match self.look(&mut connection, patience) {
            Err(gone) => {
                self.key_frames += connection.key_frames;
                self.lost(gone, connection.has_given)
            }
            Ok(came) => {
                self.connection = Some(connection);
                let Some((capture_s, content)) = came else { return Next::Nothing };
                let (number, name) = (self.number, format!("{}#{}", self.address.shown, self.number));
                self.number += 1;
                Next::Frame(Frame { number, capture_s, name, content })
            }
        }
    }

    fn is_live(&self) -> bool {
        true
    }

    fn key_frames(&self) -> Option<u64> {
        Some(self.key_frames + self.connection.as_ref().map_or(0, |connection| connection.key_frames))
    }

    fn reuse(&mut self, spent: GrayImage) {
        if let Some(connection) = &mut self.connection {
            connection.decoder.reuse(spent);
        }
    }
}
