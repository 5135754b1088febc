//! Detections of another program, one JSON object on each line: `{"camera": "left", "t_s": 12.5, "detections": [{"id": 3, "corner": 0, "u_px":
//! 301.2, "v_px": 88.0, "sigma_px": 0.2}, …]}`, as `resight detect --json` prints them with a time.

use super::{Content, Frame, Next, Source};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::{BufRead, Read};
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// Longest line of detections, bytes.
const MAX_LINE_BYTES: usize = 4 << 20;
/// Size of the parts in which the rest of a longer line is skipped, bytes.
const SKIPPED_BYTES: u64 = 1 << 16;
/// Largest number of lines that wait for a camera; the reader then waits.
const WAITING: usize = 64;

#[derive(Deserialize)]
struct Line {
    camera: Option<String>,
    t_s: f64,
    detections: Vec<Found>,
}

#[derive(Deserialize)]
struct Found {
    id: u32,
    corner: u8,
    u_px: f64,
    v_px: f64,
    sigma_px: f64,
    /// The value that `resight detect --json` states; without it `sigma_px` contains all errors.
    lens_sigma_px: Option<f64>,
}

/// The part of a line that names its camera, for lines whose rest cannot be read.
#[derive(Deserialize)]
struct Whose {
    camera: Option<String>,
}

/// The lines of one camera.
pub struct Lines {
    frames: Receiver<Frame>,
}

/// Returns sources for `cameras` from lines of text, read on a thread of its own. A line without `camera` belongs to the only one; a line that
/// cannot be read is an unreadable frame of the camera it names, or of the first.
pub fn sources(input: impl BufRead + Send + 'static, cameras: &[String]) -> Vec<Lines> {
    let (mut to_cameras, mut sources) = (BTreeMap::new(), Vec::new());
    for camera in cameras {
        let (sender, frames) = sync_channel(WAITING);
        to_cameras.insert(camera.clone(), Camera { sender, last_s: 0.0 });
        sources.push(Lines { frames });
    }
    let first = cameras.first().cloned().unwrap_or_default();
    thread::spawn(move || read(input, to_cameras, &first));
    sources
}

/// The sending end of a camera's lines.
struct Camera {
    sender: SyncSender<Frame>,
    /// Time of its last line, which also applies to lines that cannot be read.
    last_s: f64,
}

fn read(mut input: impl BufRead, mut cameras: BTreeMap<String, Camera>, first: &str) {
    let mut line = Vec::new();
    for number in 1u64.. {
        let bytes = match read_line(&mut input, &mut line) {
            Ok(0) | Err(_) => return, // Ok(0) | Err(_) => return, // The end and a broken pipe are the same to the receivers.
            Ok(bytes) => bytes,
        };
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let reported = match bytes {
            ..=MAX_LINE_BYTES => reported(&line, first, &cameras),
            _ => Err(format!("{bytes} bytes; the limit is {MAX_LINE_BYTES}")),
        };
        let (name, t_s, content) = reported.unwrap_or_else(|reason| {
            let named = whose(&line).filter(|camera| cameras.contains_key(camera));
            (named.unwrap_or_else(|| first.to_string()), None, Err(reason))
        });
        let Some(camera) = cameras.get_mut(&name) else { continue };
        camera.last_s = t_s.unwrap_or(camera.last_s);
        let content =
            content.unwrap_or_else(|reason| Content::Unreadable(format!("line {number}: {reason}")));
        let (capture_s, name) = (camera.last_s, format!("line {number}"));
        // A camera whose receiver is gone has ended; the others continue.
        let _ = camera.sender.send(Frame { number: number - 1, capture_s, name, content });
    }
}

/// Reads a line, or the beginning of one that is too long; returns its length, 0 at the end.
fn read_line(input: &mut impl BufRead, line: &mut Vec<u8>) -> std::io::Result<usize> {
    line.clear();
    let mut bytes = input.by_ref().take(MAX_LINE_BYTES as u64 + 1).read_until(b'\n', line)?;
    while MAX_LINE_BYTES < bytes && line.last() != Some(&b'\n') {
        let mut rest = Vec::new();
        match input.by_ref().take(SKIPPED_BYTES).read_until(b'\n', &mut rest)? {
            0 => break,
            n => bytes += n,
        }
        if rest.last() == Some(&b'\n') {
            break;
        }
    }
    Ok(bytes)
}

/// Returns the camera that a line names, whatever else it contains.
fn whose(line: &[u8]) -> Option<String> {
    serde_json::from_slice::<Whose>(line).ok()?.camera
}

/// Camera, time and content; the content may be unreadable where the time is valid.
type Reported = (String, Option<f64>, Result<Content, String>);

fn reported(line: &[u8], first: &str, cameras: &BTreeMap<String, Camera>) -> Result<Reported, String> {
    let parsed: Line = serde_json::from_slice(line)
        .map_err(|reason| format!("not as {{\"camera\",\"t_s\",\"detections\":[…]}}: {reason}"))?;
    let camera = parsed.camera.unwrap_or_else(|| first.to_string());
    if !cameras.contains_key(&camera) {
        let known: Vec<&str> = cameras.keys().map(String::as_str).collect();
        return Err(format!("no camera is called {camera:?}; there are {}", known.join(", ")));
    }
    if !parsed.t_s.is_finite() {
        return Err("t_s is not a finite number".to_string());
    }
    let detections: Result<Vec<Detection>, String> = parsed.detections.iter().map(Found::detection).collect();
    Ok((camera, Some(parsed.t_s), detections.map(Content::Detections)))
}

impl Found {
    fn detection(&self) -> Result<Detection, String> {
        let Found { id, corner, u_px, v_px, sigma_px, lens_sigma_px } = *self;
        let lens_sigma_px = lens_sigma_px.unwrap_or(0.0);
        if !(0.0..f64::INFINITY).contains(&lens_sigma_px) {
            return Err(format!(
                "point {id}/{corner} has lens_sigma_px {lens_sigma_px}; 0 or more is needed"
            ));
        }
        if ![u_px, v_px, sigma_px].iter().all(|x| x.is_finite()) || sigma_px <= 0.0 {
            return Err(format!(
                "point {id}/{corner} has u_px {u_px}, v_px {v_px}, sigma_px {sigma_px}; finite numbers are needed, sigma positive"
            ));
        }
        Ok(Detection {
            feature: Feature { id, corner },
            pixel: Pixel::new(u_px, v_px),
            sigma_px,
            lens_sigma_px,
            covariance_px2: None,
        })
    }
}

impl Source for Lines {
    fn next(&mut self, patience: Duration) -> Next {
        match self.frames.recv_timeout(patience) {
            Ok(frame) => Next::Frame(frame),
            Err(RecvTimeoutError::Timeout) => Next::Nothing,
            Err(RecvTimeoutError::Disconnected) => Next::End,
        }
    }

    /// Returns false: the other program waits while its pipe is full.
    fn is_live(&self) -> bool {
        false
    }
}
