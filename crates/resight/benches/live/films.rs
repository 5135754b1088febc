//! The same four cameras as H.264 films, each decoded by an ffmpeg of its own at the pace of a camera.

use crate::cameras::{CAMERAS, RATE_HZ, pictures, target};
use crate::live_support::{HEIGHT_PX, WIDTH_PX, watched};
use resight::live::LiveCamera;
use resight::source::video::Video;
use resight::source::{Content, Frame, Next, Source};
use resight::{FileError, GrayImage};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

/// Seconds of a film; it is decoded again and again.
const FILM_S: f64 = 20.0;

pub fn cameras(seconds: f64) -> Result<Vec<LiveCamera>, String> {
    let camera = |i: usize| {
        let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("live-{i}.mp4"));
        encode(i, &path)?;
        Ok(watched(&target(i), Camera::new(path, (seconds * RATE_HZ) as u64)))
    };
    (0..CAMERAS).map(camera).collect()
}

/// Writes a camera's pictures as a film with the bits of a network camera, 4 Mbit/s.
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
    for i in 0..(FILM_S * RATE_HZ) as usize {
        let picture = &pictures[i % pictures.len()];
        pipe.write_all(&picture.data).map_err(|reason| format!("ffmpeg takes no more: {reason}"))?;
    }
    drop(pipe);
    let ended = encoder.wait().map_err(|reason| reason.to_string())?;
    if ended.success() { Ok(()) } else { Err("ffmpeg has no libx264".to_string()) }
}

/// A film given frame by frame as a camera would, again and again.
struct Camera {
    path: PathBuf,
    video: Option<Video>,
    /// The next run of the film, started beforehand: a camera does not pause while a program starts.
    upcoming: Option<JoinHandle<Result<Video, FileError>>>,
    started: Option<Instant>,
    next: u64,
    n: u64,
}

impl Camera {
    fn new(path: PathBuf, n: u64) -> Self {
        let upcoming = Some(opening(&path));
        Camera { path, video: None, upcoming, started: None, next: 0, n }
    }

    fn picture(&mut self) -> Result<GrayImage, FileError> {
        loop {
            if let Some(picture) = self.video.as_mut().and_then(Iterator::next) {
                return picture;
            }
            let opening = self.upcoming.replace(opening(&self.path));
            let opened = opening.and_then(|opening| opening.join().ok());
            self.video =
                Some(opened.unwrap_or_else(|| Err(FileError::new(&self.path, "cannot be opened again")))?);
        }
    }
}

fn opening(path: &Path) -> JoinHandle<Result<Video, FileError>> {
    let path = path.to_path_buf();
    std::thread::spawn(move || Video::open(&path))
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
        match self.picture() {
            Ok(picture) => {
                // The first picture sets the clock.
                self.started.get_or_insert_with(Instant::now);
                let (number, name) = (self.next, String::new());
                self.next += 1;
                Next::Frame(Frame { number, capture_s, name, content: Content::Image(picture) })
            }
            Err(reason) => Next::Lost(reason),
        }
    }

    fn is_live(&self) -> bool {
        true
    }

    fn reuse(&mut self, spent: GrayImage) {
        if let Some(video) = &mut self.video {
            video.reuse(spent);
        }
    }
}
