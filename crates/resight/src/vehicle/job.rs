//! Frames to motions to the answer.

use super::lens::OtherLenses;
use super::pair::PairTimes;
use super::speed::{LARGEST_GAP_S, speed_at};
use super::words::{Contents, answer, seconds};
use super::{VehicleAnswer, VehicleRequest};
use crate::core::Pose;
use crate::core::temporal::vehicle::{
    FrameMotion, VehicleAlarmConfig, VehicleConfig, vehicle, vehicle_alarm,
};
use crate::error::Error;
use crate::formats::check_image_size;
use crate::landmarks::{Landmarks, LandmarksError, NoParallax, Parallax};
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
/// Pairs of a drive at most: the motions of these, through all lenses within uncertain intrinsics, take half a gigabyte.
const MOST_PAIRS: usize = 100_000;
/// Time to wait for a frame before checking again.
const PATIENCE: Duration = Duration::from_secs(1);

/// Determines the rotation of the camera from the frames of a video.
///
/// # Errors
/// A video that cannot be read or states no times, an image of another size than the camera's, numbers that cannot be.
pub fn vehicle_from_video(path: impl AsRef<Path>, request: &VehicleRequest) -> Result<VehicleAnswer, Error> {
    let path = path.as_ref();
    let mut frames = Motions::new(request, 0.0)?;
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
    solved(images.iter().enumerate().map(read), interval_s, &name, request)
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
    solved(frames, 0.0, name, request)
}

fn solved(
    frames: impl IntoIterator<Item = Result<VehicleFrame, Error>>,
    interval_s: f64,
    name: &str,
    request: &VehicleRequest,
) -> Result<VehicleAnswer, Error> {
    let mut motions = Motions::new(request, interval_s)?;
    for frame in frames {
        motions.push(frame?)?;
    }
    motions.answer(name)
}

/// Motions between key frames.
struct Motions<'a> {
    request: &'a VehicleRequest,
    /// Time between the frames of a pair, seconds.
    every_s: f64,
    motions: Vec<FrameMotion>,
    /// The last key frame with its landmarks, unless it has too few.
    last: Option<(f64, Result<Landmarks, LandmarksError>)>,
    /// The last frame.
    before: Option<GrayImage>,
    /// Its time, seconds.
    end_s: f64,
    /// Frames that are equal to the one before.
    n_repeated: usize,
    near: Option<Pose>,
    /// Since the first key frame, which states the size of the images.
    others: Option<OtherLenses>,
    /// Size of the last key frame.
    size_px: [u32; 2],
    n_frames: usize,
    n_pairs: usize,
    n_still: usize,
    n_damaged: usize,
    /// Pairs without a motion, and the last reason.
    failed: (usize, Option<NoParallax>),
}

impl<'a> Motions<'a> {
    /// Pairs are `interval_s` apart at least.
    fn new(request: &'a VehicleRequest, interval_s: f64) -> Result<Self, Error> {
        request.check()?;
        Ok(Motions {
            request,
            every_s: request.every_s.max(interval_s),
            motions: Vec::new(),
            last: None,
            before: None,
            end_s: 0.0,
            n_repeated: 0,
            near: None,
            others: None,
            size_px: [0, 0],
            n_frames: 0,
            n_pairs: 0,
            n_still: 0,
            n_damaged: 0,
            failed: (0, None),
        })
    }

    /// Takes a frame; those between two key frames are skipped, and those that repeat the one before, whose time is not that of their image.
    fn push(&mut self, frame: VehicleFrame) -> Result<(), Error> {
        self.n_frames += 1;
        self.end_s = frame.t_s;
        if self.before.as_ref() == Some(&frame.image) {
            self.n_repeated += 1;
            return Ok(());
        }
        let is_early = |(last_s, _): &(f64, _)| frame.t_s - last_s < self.every_s * (1.0 - EARLY);
        if !self.last.as_ref().is_some_and(is_early) {
            self.key_frame(&frame)?;
        }
        self.before = Some(frame.image);
        Ok(())
    }

    fn key_frame(&mut self, frame: &VehicleFrame) -> Result<(), Error> {
        let camera = check_image_size(&self.request.camera, frame.image.width_px, frame.image.height_px)
            .map_err(Error::request)?;
        self.size_px = [frame.image.width_px, frame.image.height_px];
        let intrinsics = self.request.intrinsics.as_ref();
        self.others.get_or_insert_with(|| OtherLenses::new(&camera, intrinsics));
        if let Some((last_s, landmarks)) = self.last.take()
            && frame.t_s - last_s <= LATE * self.every_s
        {
            if self.n_pairs == MOST_PAIRS {
                return Err(Error::request(format!(
                    "the drive has more than {MOST_PAIRS} pairs of frames {} s apart, up to {} s; cut it, or take frames farther apart",
                    self.every_s,
                    seconds(last_s)
                )));
            }
            self.pair(last_s, &landmarks, frame);
        }
        self.last = Some((frame.t_s, Landmarks::new(&frame.image, &camera)));
        Ok(())
    }

    fn pair(&mut self, last_s: f64, landmarks: &Result<Landmarks, LandmarksError>, frame: &VehicleFrame) {
        self.n_pairs += 1;
        let (t_s, duration_s) = (0.5 * (last_s + frame.t_s), frame.t_s - last_s);
        let found = match landmarks {
            Ok(landmarks) => landmarks.parallax(&frame.image, self.near.as_ref()),
            Err(LandmarksError::TooFew { seen, needed }) => {
                Err(NoParallax::Blank { corners: *seen, needed: *needed })
            }
            Err(LandmarksError::Size(_)) => Err(NoParallax::Size),
        };
        let times = PairTimes { t_s, duration_s, speed_m_s: speed_at(&self.request.speeds, t_s) };
        match found {
            Ok(Parallax { pairs, view }) => {
                self.near = Some(view.second_from_first);
                self.motions.push(times.motion(&pairs, &view));
                let others = self.others.as_mut();
                others.into_iter().for_each(|others| others.push(&pairs, &view.second_from_first, &times));
            }
            Err(NoParallax::Still) => {
                self.n_still += 1;
                self.near = None;
                let still = times.still();
                self.others.iter_mut().for_each(|others| others.still(&still));
                self.motions.push(still);
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
        if let (Some(first), Some(last)) = (self.request.speeds.first(), self.request.speeds.last())
            && !self.motions.is_empty()
            && self.motions.iter().all(|motion| motion.speed_m_s.is_none())
        {
            return Err(Error::request(format!(
                "the frames are from 0 s to {} s, the speeds from {} s to {} s; t_s must count seconds from the first frame, with a speed every {LARGEST_GAP_S} s at least",
                seconds(self.end_s),
                seconds(first.t_s),
                seconds(last.t_s)
            )));
        }
        let config = VehicleConfig { speed_relative_sigma: self.request.speed_relative_sigma };
        let variations = self.others.map_or_else(Vec::new, |others| others.motions);
        let estimate = vehicle(&self.motions, &variations, &config)?;
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
            n_repeated: self.n_repeated,
            end_s: self.end_s,
            every_s: self.every_s,
            failed: &self.failed,
            camera: &self.request.camera,
            is_lens_stated: self.request.intrinsics.is_some(),
            size_px: self.size_px,
        };
        Ok(answer(&contents))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::core::Camera;

    #[test]
    fn a_drive_has_an_end() {
        let request = VehicleRequest::new(Camera::normalized());
        let mut motions = Motions::new(&request, 0.0).unwrap();
        motions.n_pairs = MOST_PAIRS - 1;
        let frame = |i: u8| VehicleFrame {
            t_s: 0.25 * f64::from(i),
            image: GrayImage { width_px: 32, height_px: 32, data: vec![i; 32 * 32] },
        };
        motions.push(frame(0)).unwrap();
        motions.push(frame(1)).unwrap();
        let error = motions.push(frame(2)).unwrap_err().to_string();
        assert!(error.contains("more than 100000 pairs of frames 0.25 s apart"), "{error}");
    }
}
