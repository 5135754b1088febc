//! Detections of another program, one JSON object a line: `{"camera": "left", "t_s": 12.5, "detections": [{"id": 3, "corner": 0,
//! "u_px": 301.2, "v_px": 88.0, "sigma_px": 0.2}, …]}`, as `resight detect --json` prints them with a time.

use super::{Content, Frame, Next, Source};
use resight_core::Pixel;
use resight_core::correspondence::Detection;
use resight_core::target::Feature;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::io::BufRead;
use std::sync::mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::Duration;

/// A longer line is no list of detections.
const MAX_LINE_BYTES: usize = 4 << 20;
/// Lines waiting for a camera that looks at them; then the reader waits.
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
}

/// The lines that belong to one camera.
pub struct Lines {
    frames: Receiver<Frame>,
}

/// Sources for `cameras` from lines of text, read on a thread of its own. A line without `camera` belongs to the only one; a line that
/// cannot be read is an unreadable frame of the camera it names, or of the first.
pub fn sources(input: impl BufRead + Send + 'static, cameras: &[String]) -> Vec<Lines> {
    let (mut senders, mut sources) = (BTreeMap::new(), Vec::new());
    for camera in cameras {
        let (sender, frames) = sync_channel(WAITING);
        senders.insert(camera.clone(), sender);
        sources.push(Lines { frames });
    }
    let first = cameras.first().cloned().unwrap_or_default();
    thread::spawn(move || read(input, &senders, &first));
    sources
}

fn read(mut input: impl BufRead, cameras: &BTreeMap<String, SyncSender<Frame>>, first: &str) {
    let (mut number, mut last_s) = (0, 0.0);
    let mut line = Vec::new();
    loop {
        line.clear();
        match input.read_until(b'\n', &mut line) {
            Ok(0) | Err(_) => return, // The end, or a pipe that broke: the same to whoever listens.
            Ok(_) => number += 1,
        }
        if line.iter().all(u8::is_ascii_whitespace) {
            continue;
        }
        let (camera, frame) = frame(&line, number, first, cameras, last_s);
        last_s = frame.capture_s;
        // A camera that no longer listens has ended; the others go on.
        if let Some(sender) = cameras.get(&camera) {
            let _ = sender.send(frame);
        }
    }
}

/// The camera and its frame; one that cannot be read has the time of the line before.
fn frame(
    line: &[u8],
    number: u64,
    first: &str,
    cameras: &BTreeMap<String, SyncSender<Frame>>,
    last_s: f64,
) -> (String, Frame) {
    let name = format!("line {number}");
    let unreadable = |reason: String| {
        let content = Content::Unreadable(format!("line {number}: {reason}"));
        (first.to_string(), Frame { number: number - 1, capture_s: last_s, name: name.clone(), content })
    };
    if MAX_LINE_BYTES < line.len() {
        return unreadable(format!("{} bytes; the limit is {MAX_LINE_BYTES}", line.len()));
    }
    let parsed: Line = match serde_json::from_slice(line) {
        Ok(parsed) => parsed,
        Err(reason) => {
            return unreadable(format!("not as {{\"camera\",\"t_s\",\"detections\":[…]}}: {reason}"));
        }
    };
    let camera = parsed.camera.unwrap_or_else(|| first.to_string());
    if !cameras.contains_key(&camera) {
        let known: Vec<&str> = cameras.keys().map(String::as_str).collect();
        return unreadable(format!("no camera is called {camera:?}; there are {}", known.join(", ")));
    }
    if !parsed.t_s.is_finite() {
        return unreadable("t_s is not a finite number".to_string());
    }
    let content = match parsed.detections.iter().map(Found::detection).collect() {
        Ok(detections) => Content::Detections(detections),
        Err(reason) => Content::Unreadable(format!("line {number}: {reason}")),
    };
    (camera, Frame { number: number - 1, capture_s: parsed.t_s, name, content })
}

impl Found {
    fn detection(&self) -> Result<Detection, String> {
        let Found { id, corner, u_px, v_px, sigma_px } = *self;
        if ![u_px, v_px, sigma_px].iter().all(|x| x.is_finite()) || sigma_px <= 0.0 {
            return Err(format!(
                "point {id}/{corner} has u_px {u_px}, v_px {v_px}, sigma_px {sigma_px}; finite numbers are needed, sigma positive"
            ));
        }
        Ok(Detection {
            feature: Feature { id, corner },
            pixel: Pixel::new(u_px, v_px),
            sigma_px,
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

    /// The other program waits while its pipe is full.
    fn is_live(&self) -> bool {
        false
    }
}
