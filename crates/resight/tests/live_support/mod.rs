//! What tests and benches of the live session share: rendered cameras, and a source that gives pictures from memory at their own pace.

use nalgebra::Vector6;
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{MapTag, Tag, TagMap};
use resight::core::temporal::monitor::learn::LearnConfig;
use resight::core::{Camera, CameraMatrix, Lens, Matrix6, Pose, Target};
use resight::live::{LiveCamera, LiveConfig, Watched};
use resight::render::{Finish, Scene, Style, clutter, render};
use resight::source::{Content, Frame, Next, Source};
use std::sync::Arc;
use std::time::{Duration, Instant};

pub const WIDTH_PX: u32 = 1280;
pub const HEIGHT_PX: u32 = 960;
const FOCAL_PX: f64 = 1000.0;
pub const TAG_M: f64 = 0.16;

/// 1280 × 960 pixels, 65° wide.
pub fn camera() -> Camera {
    let (cx_px, cy_px) = (0.5 * (WIDTH_PX - 1) as f64, 0.5 * (HEIGHT_PX - 1) as f64);
    let matrix = CameraMatrix { fx_px: FOCAL_PX, fy_px: FOCAL_PX, cx_px, cy_px };
    let lens = Lens::Pinhole(Pinhole::new(matrix).expect("a lens"));
    Camera { lens, size: Some(ImageSize { width_px: WIDTH_PX, height_px: HEIGHT_PX }) }
}

pub fn tag() -> Target {
    Target::Tag(Tag { family: "tag36h11".to_string(), id: 3, size_m: TAG_M })
}

/// Twelve tags on a wall, four in a row.
pub fn map() -> Target {
    let tag = |i: u32| {
        let (x_m, y_m) = (0.4 * (i % 4) as f64 - 0.6, 0.4 * (i / 4) as f64 - 0.4);
        let world_from_tag = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, x_m, y_m, 0.0));
        MapTag { id: i, size_m: TAG_M, world_from_tag, sigma_m: 0.0, sigma_rad: 0.0 }
    };
    Target::TagMap(TagMap { family: "tag36h11".to_string(), tags: (0..12).map(tag).collect() })
}

/// A tilted tag of about `edge_px`, its centre `u_px`, `v_px` from the middle of the picture.
pub fn tag_pose(edge_px: f64, u_px: f64, v_px: f64) -> Pose {
    let z_m = FOCAL_PX * TAG_M / edge_px;
    Pose::exp(&Vector6::new(0.0, 0.0, 0.0, u_px * z_m / FOCAL_PX, v_px * z_m / FOCAL_PX, z_m))
        * Pose::exp(&Vector6::new(0.3, -0.5, 0.2, 0.0, 0.0, 0.0))
}

/// The target before printed words and spots, with the noise of a good camera.
pub fn picture(target: &Target, cam_from_target: Pose, seed: u64) -> GrayImage {
    let mut all = clutter::words(80, [WIDTH_PX, HEIGHT_PX], 14.0, 30.0, 7);
    all.extend(clutter::dots(100, [WIDTH_PX, HEIGHT_PX], [3.0, 40.0], 60.0, 9));
    let scene = Scene { clutter: all, ..Scene::of(target.clone(), cam_from_target, Style::default()) };
    let finish = Finish { seed, samples_per_axis: 3, ..Finish::default() };
    render(&scene, &camera(), &finish).expect("a picture")
}

/// A picture of each pose, with a noise of its own, drawn on two threads.
pub fn film(target: &Target, poses: &[Pose], seed: u64) -> Arc<Vec<GrayImage>> {
    let half = poses.len().div_ceil(2).max(1);
    let draw = |(part, poses): (usize, &[Pose])| -> Vec<GrayImage> {
        let seed = |i: usize| seed + (part * half + i) as u64;
        poses.iter().enumerate().map(|(i, pose)| picture(target, *pose, seed(i))).collect()
    };
    let parts: Vec<Vec<GrayImage>> = std::thread::scope(|scope| {
        let threads: Vec<_> =
            poses.chunks(half).enumerate().map(|part| scope.spawn(move || draw(part))).collect();
        threads.into_iter().map(|thread| thread.join().expect("pictures")).collect()
    });
    Arc::new(parts.into_iter().flatten().collect())
}

/// A camera that trembles by a hundredth of a degree.
pub fn trembling(cam_from_target: Pose, n: usize) -> Vec<Pose> {
    let tremble = |i: usize| {
        let phase = i as f64;
        Vector6::new(phase.sin(), (1.7 * phase).sin(), (2.3 * phase).sin(), 0.0, 0.0, 0.0) * 1.7e-4
    };
    (0..n).map(|i| Pose::exp(&tremble(i)) * cam_from_target).collect()
}

pub fn config() -> LiveConfig {
    let known = Matrix6::identity() * 1e-8;
    let lasting = LearnConfig { bias: known, bias_time_s: 60.0, daily: known };
    LiveConfig { lasting, ..LiveConfig::default() }
}

pub fn watched(target: &Target, source: impl Source + 'static) -> LiveCamera {
    let watched = Watched { name: "target".to_string(), target: Arc::new(target.clone()), reference: None };
    LiveCamera {
        name: "camera".to_string(),
        camera: camera(),
        targets: vec![watched],
        landmarks: None,
        source: Box::new(source),
    }
}

/// When frames are given.
#[derive(Debug, Clone, Copy)]
pub enum Pace {
    /// At their capture times, whether anybody waits for them or not.
    Live,
    /// As fast as they are taken.
    AsTaken,
}

/// Pictures from memory, over and over, `rate_hz` of them a second of capture time.
pub struct Replay {
    pub pictures: Arc<Vec<GrayImage>>,
    pub pace: Pace,
    pub rate_hz: f64,
    pub n_frames: u64,
    pub next: u64,
    pub started: Option<Instant>,
    pub spent: Vec<GrayImage>,
}

impl Replay {
    pub fn new(pictures: &Arc<Vec<GrayImage>>, pace: Pace, rate_hz: f64, n_frames: u64) -> Self {
        let pictures = Arc::clone(pictures);
        Replay { pictures, pace, rate_hz, n_frames, next: 0, started: None, spent: Vec::new() }
    }
}

impl Source for Replay {
    fn next(&mut self, patience: Duration) -> Next {
        if self.n_frames <= self.next {
            return Next::End;
        }
        let capture_s = self.next as f64 / self.rate_hz;
        if self.is_live() {
            let started = *self.started.get_or_insert_with(Instant::now);
            let due = started + Duration::from_secs_f64(capture_s);
            let wait = due.saturating_duration_since(Instant::now());
            std::thread::sleep(wait.min(patience));
            if patience < wait {
                return Next::Nothing;
            }
        }
        let picture = &self.pictures[self.next as usize % self.pictures.len()];
        let (number, name) = (self.next, String::new());
        self.next += 1;
        let mut shown = self.spent.pop().unwrap_or_else(|| GrayImage::filled(0, 0, 0));
        (shown.width_px, shown.height_px) = (picture.width_px, picture.height_px);
        shown.data.clone_from(&picture.data);
        Next::Frame(Frame { number, capture_s, name, content: Content::Image(shown) })
    }

    fn reuse(&mut self, spent: GrayImage) {
        self.spent.push(spent);
    }

    fn is_live(&self) -> bool {
        matches!(self.pace, Pace::Live)
    }
}
