//! The same four cameras as H.264 films, each decoded by an ffmpeg of its own at the pace of a camera.

use crate::cameras::{CAMERAS, RATE_HZ, pictures, target};
use crate::live_support::{HEIGHT_PX, WIDTH_PX, watched};
use resight::live::LiveCamera;
use resight::source::video::Video;
use resight::source::{Content, Frame, Next, Source};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Seconds of a film; it is decoded again and again.
const FILM_S: f64 = 20.0;

pub fn cameras(seconds: f64) -> Result<Vec<LiveCamera>, String> {
    let camera = |i: usize| {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("live-{i}.mp4"));
        encode(i, &path)?;
        Ok(watched(
            &target(i),
            Camera { path, video: None, started: None, next: 0, n: (seconds * RATE_HZ) as u64 },
        ))
    };
    (0..CAMERAS).map(camera).collect()
}

/// Writes a camera's pictures as a film, at the quality of a surveillance camera.
fn encode(camera: usize, path: &Path) -> Result<(), String> {
    let size = format!("{WIDTH_PX}x{HEIGHT_PX}");
    let rate = RATE_HZ.to_string();
    let mut encoder = Command::new("ffmpeg")
        .args([
            "-nostdin", "-v", "fatal", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", &size, "-r", &rate,
        ])
        .args(["-i", "-", "-c:v", "libx264", "-preset", "veryfast", "-crf", "23", "-pix_fmt", "yuv420p"])
        .arg(path)
        .stdin(Stdio::piped())
        .spawn()
        .map_err(|reason| format!("ffmpeg cannot be started: {reason}"))?;
    let pictures = pictures(camera);
    let mut pipe = encoder.stdin.take().ok_or("ffmpeg takes no input")?;
    for i in 0..(FILM_S * RATE_HZ) as usize {
        let picture = &pictures[i % pictures.len()];
        pipe.write_all(&picture.data).map_err(|reason| format!("ffmpeg takes no more: {reason}"))?;
    }
    drop(pipe);
    let ended = encoder.wait().map_err(|reason| reason.to_string())?;
    if ended.success() { Ok(()) } else { Err("ffmpeg has no libx264".to_string()) }
}

/// A film given frame by frame as a camera would.
struct Camera {
    path: PathBuf,
    video: Option<Video>,
    started: Option<Instant>,
    next: u64,
    n: u64,
}

impl Source for Camera {
    fn next(&mut self, patience: Duration) -> Next {
        if self.n <= self.next {
            return Next::End;
        }
        let capture_s = self.next as f64 / RATE_HZ;
        let due = *self.started.get_or_insert_with(Instant::now) + Duration::from_secs_f64(capture_s);
        let wait = due.saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(patience));
        if patience < wait {
            return Next::Nothing;
        }
        let picture = loop {
            let video = match &mut self.video {
                Some(video) => video,
                None => match Video::open(&self.path) {
                    Ok(video) => self.video.insert(video),
                    Err(reason) => return Next::Lost(reason),
                },
            };
            match video.next() {
                Some(Ok(picture)) => break picture,
                Some(Err(reason)) => return Next::Lost(reason),
                None => self.video = None,
            }
        };
        let (number, name) = (self.next, String::new());
        self.next += 1;
        Next::Frame(Frame { number, capture_s, name, content: Content::Image(picture) })
    }

    fn is_live(&self) -> bool {
        true
    }
}
