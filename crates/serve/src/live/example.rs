//! The example of the tab Live: two cameras that look at a tag, rendered by the program itself, so that it needs neither a camera nor a network.
//! After a while one of them is moved suddenly, and an alarm waits to be acknowledged.

use super::{Live, run};
use anyhow::Result;
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::Tag;
use resight::core::temporal::monitor::learn::LearnConfig;
use resight::core::{Camera, CameraMatrix, Lens, Matrix6, Pose, Target, Vector6};
use resight::render::{Finish, Scene, Style, clutter, render};
use resight_watch::live::{LiveCamera, LiveConfig, Watched};
use resight_watch::source::{Content, Frame, Next, Source};
use resight_watch::{Log, Request};
use std::sync::Arc;
use std::time::{Duration, Instant};

const SIZE_PX: [u32; 2] = [640, 480];
const FOCAL_PX: f64 = 600.0;
/// Time between two images of a camera.
const PERIOD: Duration = Duration::from_millis(200);
/// Readings from which a reference is learned: four seconds.
const LEARN_READINGS: usize = 20;
/// When one camera is moved, and by how much: a motion that is invisible to the eye.
const MOVES_AFTER: Duration = Duration::from_secs(12);
const MOVES_DEG: f64 = 0.5;
/// Images of a pose, each with noise of its own.
const VARIANTS: u64 = 4;
/// Correlated errors that are allowed for: a hundredth of a degree, a tenth of a millimetre.
const CORRELATED: f64 = 1e-8;

/// Draws the cameras and watches them, on a thread of its own, until the program ends.
///
/// # Errors
/// No thread to be had.
pub fn start() -> Result<Arc<Live>> {
    let known = Matrix6::identity() * CORRELATED;
    let correlated = LearnConfig { bias: known, bias_time_s: 60.0, diurnal: known };
    let config = LiveConfig { correlated, learn_readings: LEARN_READINGS, ..LiveConfig::default() };
    let cameras =
        [("gate", -0.4, true), ("yard", 0.5, false)].map(|(name, turn, moves)| camera(name, turn, moves));
    let cameras: Vec<LiveCamera> = cameras.into_iter().collect::<Result<_>>()?;
    let request = Request { is_once: false, ..Request::new(cameras, config) };
    let live = Arc::new(Live::new(&request));
    let shown = Arc::clone(&live);
    std::thread::Builder::new()
        .name("example".to_owned())
        .spawn(move || run(&shown, request, &Log::new(|_| {})))?;
    Ok(live)
}

fn tag() -> Target {
    Target::Tag(Tag { family: "tag36h11".to_owned(), id: 3, size_m: 0.16 })
}

/// Creates a camera that sees the tag, rotated about the vertical.
fn camera(name: &str, turn_rad: f64, moves: bool) -> Result<LiveCamera> {
    let [width_px, height_px] = SIZE_PX;
    let middle = |n: u32| 0.5 * f64::from(n) - 0.5;
    let matrix =
        CameraMatrix { fx_px: FOCAL_PX, fy_px: FOCAL_PX, cx_px: middle(width_px), cy_px: middle(height_px) };
    let camera =
        Camera { lens: Lens::Pinhole(Pinhole::new(matrix)?), size: Some(ImageSize { width_px, height_px }) };
    let pose = Pose::exp(&Vector6::new(0.0, 0.0, 0.0, 0.05, -0.02, 0.9))
        * Pose::exp(&Vector6::new(0.3, turn_rad, 0.1, 0.0, 0.0, 0.0));
    let moved = Pose::exp(&Vector6::new(0.0, -MOVES_DEG.to_radians(), 0.0, 0.0, 0.0, 0.0)) * pose;
    let film = |pose: Pose, first: u64| -> Result<Vec<GrayImage>> {
        (first..first + VARIANTS).map(|seed| drawn(&camera, pose, seed)).collect()
    };
    let still = film(pose, 1)?;
    let after = if moves { film(moved, 1 + VARIANTS)? } else { Vec::new() };
    let source = Drawn { still, after, began: Instant::now(), number: 0 };
    let watched = Watched { name: "sign".to_owned(), target: Arc::new(tag()), reference: None };
    Ok(LiveCamera {
        name: name.to_owned(),
        camera,
        targets: vec![watched],
        intrinsics: None,
        landmarks: None,
        source: Box::new(source),
    })
}

fn drawn(camera: &Camera, cam_from_target: Pose, seed: u64) -> Result<GrayImage> {
    let clutter = clutter::words(30, SIZE_PX, 12.0, 30.0, 7);
    let scene = Scene { clutter, ..Scene::of(tag(), cam_from_target, Style::default()) };
    Ok(render(&scene, camera, &Finish { seed, samples_per_axis: 3, ..Finish::default() })?)
}

/// Images from memory, five a second.
struct Drawn {
    still: Vec<GrayImage>,
    after: Vec<GrayImage>,
    began: Instant,
    number: u64,
}

impl Source for Drawn {
    fn next(&mut self, patience: Duration) -> Next {
        let since = PERIOD.saturating_mul(u32::try_from(self.number).unwrap_or(u32::MAX));
        let wait = (self.began + since).saturating_duration_since(Instant::now());
        std::thread::sleep(wait.min(patience));
        if patience < wait {
            return Next::Nothing;
        }
        let is_moved = MOVES_AFTER <= since && !self.after.is_empty();
        let film = if is_moved { &self.after } else { &self.still };
        // The order is irregular, so that the noise does not repeat.
        let image = film[(self.number.wrapping_mul(2_654_435_761) >> 7) as usize % film.len()].clone();
        let number = self.number;
        self.number += 1;
        Next::Frame(Frame {
            number,
            capture_s: since.as_secs_f64(),
            name: String::new(),
            content: Content::Image(image),
        })
    }

    fn is_live(&self) -> bool {
        true
    }
}
