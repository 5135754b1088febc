//! The same four cameras as H.264 films, each decoded by an ffmpeg of its own at the pace of a camera.

use crate::cameras::{CAMERAS, RATE_HZ, pictures, target};
use crate::live_support::{HEIGHT_PX, WIDTH_PX, watched};
use resight::GrayImage;
use resight_watch::live::LiveCamera;
use resight_watch::source::video::Video;
use resight_watch::source::{Content, Frame, Next, Source};
use std::io::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

/// Seconds that are encoded; a film repeats them, whole, for as long as is asked. One ffmpeg a camera decodes it from beginning to end:
/// no camera starts programs while it runs.
const SCENE_S: f64 = 20.0;

pub fn cameras(seconds: f64) -> Result<Vec<LiveCamera>, String> {
    let camera = |i: usize| {
        let file = |name: &str| Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("live-{name}-{i}.mp4"));
        let (scene, film) = (file("scene"), file("film"));
        encode(i, &scene)?;
        repeat(&scene, &film, seconds)?;
        let video = Video::open(&film).map_err(|reason| reason.to_string())?;
        Ok(watched(&target(i), Camera::new(video, (seconds * RATE_HZ) as u64)))
    };
    (0..CAMERAS).map(camera).collect()
}

/// Writes a camera's images as a film with the bits of a network camera, 4 Mbit/s.
fn encode(camera: usize, path: &Path) -> Result<(), String> {
    let size = format!("{WIDTH_PX}x{HEIGHT_PX}");
    let rate = RATE_HZ.to_string();
    let mut encoder = Command::new("ffmpeg")
        .args([
            "-nostdin", "-v", "fatal", "-y", "-f", "rawvideo", "-pix_fmt", "gray", "-s", &size, "-r", &rate,
        ])
        .args(["-i", "-", "-c:v", "libx264", "-preset", "veryfast", "-b:v", "4M", "-pix_fmt", "yuv420p"])
        .arg(path)
        .stdin(Stdio::piped())
        .spawn()
        .map_err(|reason| format!("ffmpeg cannot be started: {reason}"))?;
    let pictures = pictures(camera);
    let mut pipe = encoder.stdin.take().ok_or("ffmpeg takes no input")?;
    for i in 0..(SCENE_S * RATE_HZ) as usize {
        let picture = &pictures[i % pictures.len()];
        pipe.write_all(&picture.data).map_err(|reason| format!("ffmpeg takes no more: {reason}"))?;
    }
    drop(pipe);
    let ended = encoder.wait().map_err(|reason| reason.to_string())?;
    if ended.success() { Ok(()) } else { Err("ffmpeg has no libx264".to_string()) }
}

/// Writes a film of at least these seconds, the scene again and again.
fn repeat(scene: &Path, film: &Path, seconds: f64) -> Result<(), String> {
    let again = (seconds / SCENE_S).ceil() as u64;
    let mut copier = Command::new("ffmpeg");
    copier.args(["-nostdin", "-v", "fatal", "-y", "-stream_loop", &again.to_string(), "-i"]).arg(scene);
    let copied = copier.args(["-c", "copy"]).arg(film).status().map_err(|reason| reason.to_string())?;
    if copied.success() { Ok(()) } else { Err("ffmpeg cannot repeat a film".to_string()) }
}

/// A film given frame by frame as a camera would.
struct Camera {
    video: Video,
    started: Option<Instant>,
    next: u64,
    n: u64,
}

impl Camera {
    fn new(video: Video, n: u64) -> Self {
        Camera { video, started: None, next: 0, n }
    }
}

impl Source for Camera {
    fn next(&mut self, patience: Duration) -> Next {
        if self.n <= self.next {
            return Next::End;
        }
        let capture_s = self.next as f64 / RATE_HZ;
        if let Some(started) = self.started {
            let due = started + Duration::from_secs_f64(capture_s);
            let wait = due.saturating_duration_since(Instant::now());
            std::thread::sleep(wait.min(patience));
            if patience < wait {
                return Next::Nothing;
            }
        }
        match self.video.next() {
            None => Next::End,
            Some(Ok(picture)) => {
                // The first image sets the clock.
                self.started.get_or_insert_with(Instant::now);
                let (number, name) = (self.next, String::new());
                self.next += 1;
                Next::Frame(Frame { number, capture_s, name, content: Content::Image(picture) })
            }
            Some(Err(reason)) => Next::Lost(reason),
        }
    }

    fn is_live(&self) -> bool {
        true
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.video.reuse(spent);
    }
}
