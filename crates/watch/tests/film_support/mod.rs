//! A camera that rotates or shifts between two rendered films, each image with its own noise and compressed as a network camera does it: errors
//! of corners that depend on where in its pixel and in its block a corner lies stay as long as the camera does.

#![allow(dead_code)] // The table of rendered films has more targets than the test.

use nalgebra::{Vector3, Vector6};
use resight::GrayImage;
use resight::core::camera::{ImageSize, Pinhole};
use resight::core::target::{Chessboard, MapTag, Tag, TagMap};
use resight::core::temporal::monitor::Drift;
use resight::core::{Camera, CameraMatrix, Lens, Pose, Target};
use resight::render::{Finish, Pcg, Scene, Style, render};
use resight_watch::live::{CameraWatcher, LiveCamera, LiveConfig, State, Watched};
use resight_watch::source::pictures::{Clock, ImageFiles};
use resight_watch::source::{Content, Frame};
use std::sync::Arc;

const WIDTH_PX: u32 = 480;
const HEIGHT_PX: u32 = 360;
const FOCAL_PX: f64 = 800.0;
const RANGE_M: f64 = 1.2;

/// What is filmed.
#[derive(Clone)]
pub struct Film {
    pub target: Target,
    /// Quality of the JPEG images; none: not compressed.
    pub jpeg: Option<u8>,
    /// Of each pixel, grey levels.
    pub noise_grey: f64,
    pub blur_px: f64,
    /// Where the camera's frame is in its old frame after the step, `[rotation_rad; translation_m]`.
    pub old_from_new: Vector6<f64>,
    pub readings_before: usize,
    pub readings_after: usize,
    /// Of the place, and of the noise.
    pub seed: u64,
}

/// What is said of it.
pub struct Told {
    /// At the alarm and at the end.
    pub drifts: Option<[Drift; 2]>,
    /// Readings from the step to the alarm.
    pub delay: usize,
    pub false_alarms: usize,
}

pub fn tag() -> Target {
    Target::Tag(Tag { family: "tag36h11".to_string(), id: 3, size_m: 0.16 })
}

pub fn board() -> Target {
    Target::Chessboard(Chessboard { rows: 5, columns: 7, square_m: 0.05 })
}

pub fn map() -> Target {
    let at = |(id, (x, y)): (usize, (f64, f64))| MapTag {
        id: id as u32,
        size_m: 0.12,
        world_from_tag: Pose::exp(&Vector6::new(0.0, 0.0, 0.0, x, y, 0.0)),
        sigma_m: 0.0005,
        sigma_rad: 0.002,
    };
    let places = [(-0.12, -0.1), (0.12, -0.1), (-0.12, 0.1), (0.12, 0.1)];
    let tags = places.into_iter().enumerate().map(at).collect();
    Target::TagMap(TagMap { family: "tag36h11".to_string(), tags, joint_covariance: None })
}

fn camera() -> Camera {
    let [cx_px, cy_px] = [WIDTH_PX, HEIGHT_PX].map(|pixels| 0.5 * f64::from(pixels - 1));
    let matrix = CameraMatrix { fx_px: FOCAL_PX, fy_px: FOCAL_PX, cx_px, cy_px };
    let lens = Lens::Pinhole(Pinhole::new(matrix).expect("a lens"));
    Camera { lens, size: Some(ImageSize { width_px: WIDTH_PX, height_px: HEIGHT_PX }) }
}

/// The tilted target, its middle somewhere near that of the image.
fn place(target: &Target, seed: u64) -> Pose {
    let mut random = Pcg::new(seed);
    let mut within = |most: f64| random.between(-most, most);
    let turned = Vector6::new(0.3 + within(0.2), -0.5 + within(0.2), within(0.5), 0.0, 0.0, 0.0);
    let middle = match target {
        Target::Chessboard(board) => {
            let half = |corners: u32| -0.5 * f64::from(corners - 1) * board.square_m;
            Vector6::new(0.0, 0.0, 0.0, half(board.columns), half(board.rows), 0.0)
        }
        _ => Vector6::zeros(),
    };
    Pose::exp(&Vector6::new(0.0, 0.0, 0.0, within(0.03), within(0.03), RANGE_M))
        * Pose::exp(&turned)
        * Pose::exp(&middle)
}

/// The axis of a seeded motion.
pub fn axis(seed: u64) -> Vector3<f64> {
    let mut random = Pcg::new(seed ^ 0xA515);
    Vector3::from_fn(|_, _| random.normal()).normalize()
}

/// Images from one place.
struct Shots<'a> {
    clean: GrayImage,
    film: &'a Film,
    random: Pcg,
}

impl<'a> Shots<'a> {
    fn new(film: &'a Film, cam_from_target: Pose, seed: u64) -> Self {
        let scene = Scene::of(film.target.clone(), cam_from_target, Style::default());
        let (blur_sigma_px, samples_per_axis) = (film.blur_px, 8);
        let finish = Finish { noise_sigma: 0.0, blur_sigma_px, samples_per_axis, ..Finish::default() };
        let clean = render(&scene, &camera(), &finish).expect("an image");
        Shots { clean, film, random: Pcg::new(seed) }
    }

    fn next(&mut self) -> GrayImage {
        let sigma = self.film.noise_grey;
        let noisy = |grey: &u8| (f64::from(*grey) + sigma * self.random.normal()).round() as u8;
        let data = self.clean.data.iter().map(noisy).collect();
        let image = GrayImage { data, ..self.clean.clone() };
        match self.film.jpeg {
            Some(quality) => GrayImage::decode(&image.jpeg(quality).expect("a JPEG")).expect("an image"),
            None => image,
        }
    }
}

/// Watches a film at the default settings, a reading a second.
pub fn watch(film: &Film) -> Told {
    let watched =
        Watched { name: "target".to_string(), target: Arc::new(film.target.clone()), reference: None };
    let camera = LiveCamera {
        name: "camera".to_string(),
        camera: camera(),
        targets: vec![watched],
        intrinsics: None,
        landmarks: None,
        source: Box::new(ImageFiles::new(Vec::new(), Clock::Every(1.0))),
    };
    let mut look = CameraWatcher::new(&camera, &LiveConfig::default()).expect("a session");
    let old = place(&film.target, film.seed);
    let places = [old, Pose::exp(&film.old_from_new).inverse() * old];
    let (mut told, mut number) = (Told { drifts: None, delay: 0, false_alarms: 0 }, 0);
    for (i, n) in [film.readings_before, film.readings_after].into_iter().enumerate() {
        let mut shots = Shots::new(film, places[i], 1000 * film.seed + i as u64);
        for k in 0..n {
            let content = Content::Image(shots.next());
            let frame = Frame { number, capture_s: number as f64, name: number.to_string(), content };
            number += 1;
            let State::Drifted(drift) = look.take(&frame, 0.0).remove(0).state else { continue };
            match &mut told.drifts {
                _ if i == 0 => told.false_alarms += 1,
                Some(drifts) => drifts[1] = *drift,
                None => (told.drifts, told.delay) = (Some([*drift; 2]), k + 1),
            }
        }
    }
    told
}

/// eᵀ C⁻¹ e of a drift against the truth.
pub fn nees(drift: &Drift, truth: &Vector6<f64>) -> f64 {
    let error = (Pose::exp(truth).inverse() * Pose::exp(&drift.old_from_new)).log();
    drift.covariance.cholesky().map_or(f64::INFINITY, |factor| error.dot(&factor.solve(&error)))
}

/// `rotated`, `shifted` or `both`, as a drift is said in words.
pub fn kind(drift: &Drift) -> &'static str {
    match drift.alone() {
        Some(alone) if alone.axis < 3 => "rotated",
        Some(_) => "shifted",
        None if drift.pure_rotation().is_some() => "rotated",
        None => "both",
    }
}
