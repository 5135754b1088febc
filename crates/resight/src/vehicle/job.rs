//! Frames to motions to the answer.

use super::speed::speed_at;
use super::words::{Contents, answer};
use super::{VehicleAnswer, VehicleRequest};
use crate::core::Pose;
use crate::core::temporal::vehicle::{
    FrameMotion, VehicleAlarmConfig, VehicleConfig, ground_plane, vehicle, vehicle_alarm,
};
use crate::error::Error;
use crate::formats::check_image_size;
use crate::landmarks::{Landmarks, NoParallax, Parallax};
use crate::video::{self, Video, ffmpeg::Decoded};
use crate::{FileError, GrayImage};
use std::path::{Path, PathBuf};
use std::time::Duration;

/// An image with its time.
#[derive(Debug, Clone, PartialEq)]
pub struct VehicleFrame {
    /// Seconds from the first frame.
    pub t_s: f64,
    /// The image.
    pub image: GrayImage,
}

/// A frame may be this share of `every_s` early.
const EARLY: f64 = 0.02;
/// Pairs farther apart than this many times `every_s` are no pairs: frames are missing.
const LATE: f64 = 3.0;
/// Time to wait for a frame before checking again.
const PATIENCE: Duration = Duration::from_secs(1);

/// Determines the rotation of the camera from the frames of a video.
///
/// # Errors
/// A video that cannot be read or states no times, an image of another size than the camera's, numbers that cannot be.
pub fn vehicle_from_video(path: impl AsRef<Path>, request: &VehicleRequest) -> Result<VehicleAnswer, Error> {
    let path = path.as_ref();
    let mut frames = Motions::new(request)?;
    let mut video = Video::open(path)?;
    let mut first_s = None;
    loop {
        let decoded = video.decoded(PATIENCE);
        match decoded {
            Decoded::Frame(shot) => {
                let Some(time_s) = shot.time_s else {
                    let reason =
                        "states no times of its frames; convert it, or give its images with their interval";
                    return Err(FileError::new(path, reason.to_string()).into());
                };
                let t_s = time_s - *first_s.get_or_insert(time_s);
                frames.push(VehicleFrame { t_s, image: shot.image })?;
            }
            Decoded::End(None) => return frames.answer(&path.display().to_string()),
            Decoded::Nothing => {}
            other => match video::complaint(&other) {
                Some(_) if matches!(other, Decoded::Damaged(_)) => frames.n_damaged += 1,
                Some(reason) => return Err(FileError::new(path, reason).into()),
                None => {}
            },
        }
    }
}

/// Determines the rotation of the camera from images taken at a constant interval.
///
/// # Errors
/// An image that cannot be read or has another size than the camera's, numbers that cannot be.
pub fn vehicle_from_images(
    images: &[PathBuf],
    interval_s: f64,
    request: &VehicleRequest,
) -> Result<VehicleAnswer, Error> {
    if !(0.0 < interval_s && interval_s.is_finite()) {
        return Err(Error::request(format!(
            "the interval between images is {interval_s} s; it must be positive"
        )));
    }
    let read = |(i, path): (usize, &PathBuf)| {
        Ok(VehicleFrame { t_s: i as f64 * interval_s, image: GrayImage::read(path)? })
    };
    let name = images.first().map_or_else(String::new, |path| path.display().to_string());
    vehicle_from_frames(images.iter().enumerate().map(read), &name, request)
}

/// Determines the rotation of the camera from frames in order of time. `name` is the name of the drive.
///
/// # Errors
/// The first of a frame, an image of another size than the camera's, numbers that cannot be.
pub fn vehicle_from_frames(
    frames: impl IntoIterator<Item = Result<VehicleFrame, Error>>,
    name: &str,
    request: &VehicleRequest,
) -> Result<VehicleAnswer, Error> {
    let mut motions = Motions::new(request)?;
    for frame in frames {
        motions.push(frame?)?;
    }
    motions.answer(name)
}

/// Motions between key frames.
struct Motions<'a> {
    request: &'a VehicleRequest,
    motions: Vec<FrameMotion>,
    /// The last key frame; its landmarks, unless it has too few.
    last: Option<(f64, Option<Landmarks>)>,
    near: Option<Pose>,
    n_frames: usize,
    n_pairs: usize,
    n_still: usize,
    n_damaged: usize,
    /// Pairs without a motion, and the last reason.
    failed: (usize, Option<NoParallax>),
}

impl<'a> Motions<'a> {
    fn new(request: &'a VehicleRequest) -> Result<Self, Error> {
        request.check()?;
        Ok(Motions {
            request,
            motions: Vec::new(),
            last: None,
            near: None,
            n_frames: 0,
            n_pairs: 0,
            n_still: 0,
            n_damaged: 0,
            failed: (0, None),
        })
    }

    /// Takes a frame; those between two key frames are skipped.
    fn push(&mut self, frame: VehicleFrame) -> Result<(), Error> {
        self.n_frames += 1;
        let every_s = self.request.every_s;
        if let Some((last_s, _)) = self.last
            && frame.t_s - last_s < every_s * (1.0 - EARLY)
        {
            return Ok(());
        }
        let camera = check_image_size(&self.request.camera, frame.image.width_px, frame.image.height_px)
            .map_err(Error::request)?;
        if let Some((last_s, landmarks)) = self.last.take()
            && frame.t_s - last_s <= LATE * every_s
        {
            self.pair(last_s, landmarks.as_ref(), &frame);
        }
        self.last = Some((frame.t_s, Landmarks::new(&frame.image, &camera).ok()));
        Ok(())
    }

    fn pair(&mut self, last_s: f64, landmarks: Option<&Landmarks>, frame: &VehicleFrame) {
        self.n_pairs += 1;
        let (t_s, duration_s) = (0.5 * (last_s + frame.t_s), frame.t_s - last_s);
        let found = match landmarks {
            Some(landmarks) => landmarks.parallax(&frame.image, self.near.as_ref()),
            None => Err(NoParallax::Blank { corners: 0, needed: 1 }),
        };
        let speed_m_s = speed_at(&self.request.speeds, t_s);
        match found {
            Ok(Parallax { pairs, view }) => {
                let ground = ground_plane(&pairs, &view, speed_m_s.is_none_or(|speed| 0.0 <= speed));
                self.near = Some(view.second_from_first);
                self.motions.push(FrameMotion {
                    ground,
                    speed_m_s,
                    ..FrameMotion::new(t_s, duration_s, &view)
                });
            }
            Err(NoParallax::Still) => {
                self.n_still += 1;
                self.near = None;
                let still = FrameMotion::without_direction(t_s, duration_s);
                self.motions.push(FrameMotion { speed_m_s, ..still });
            }
            Err(reason) => {
                self.near = None;
                self.failed = (self.failed.0 + 1, Some(reason));
            }
        }
    }

    fn answer(self, name: &str) -> Result<VehicleAnswer, Error> {
        if self.n_frames == 0 {
            return Err(Error::request("no image is given"));
        }
        let config = VehicleConfig { speed_relative_sigma: self.request.speed_relative_sigma };
        let estimate = vehicle(&self.motions, &config)?;
        let alarms = VehicleAlarmConfig {
            false_alarms_per_day: self.request.false_alarms_per_day,
            tolerance_rad: self.request.tolerance_rad,
            ..VehicleAlarmConfig::default()
        };
        let alarm = match &estimate.travel {
            Ok(travel) => Some(vehicle_alarm(&self.motions, travel, &alarms)?),
            Err(_) => None,
        };
        let contents = Contents {
            name,
            estimate: &estimate,
            alarm: alarm.as_ref(),
            n_frames: self.n_frames,
            n_pairs: self.n_pairs,
            n_still: self.n_still,
            n_damaged: self.n_damaged,
            failed: &self.failed,
        };
        Ok(answer(&contents))
    }
}
