//! Processes each frame of one camera, for every target that it watches.

mod expect;
mod landmarks;
mod learning;
mod view;
mod pair;
mod promises;
mod staying;
mod unseen;

use super::state::{CameraRecord, unix_s};
use super::{LiveCamera, LiveConfig, Observation, Promise, StageTimes, State};
use crate::source::{Content, Frame};
use landmarks::LandmarkWatch;
use pair::{FrameContent, Pair};
use resight::GrayImage;
use resight::detect::DetectError;
use resight::landmarks::LandmarksError;
use resight_core::temporal::monitor::{Deviation, Monitor, Reference, Unsettled};
use resight_core::{Camera, Error, Target};
use std::time::Instant;

/// Processes the frames of one camera, in order.
pub struct CameraWatcher {
    camera: Camera,
    pairs: Vec<Pair>,
    landmarks: Option<LandmarkWatch>,
    /// Hash of the last image: a camera that froze sends it again and again.
    last_image: Option<u64>,
    /// Capture time of the last frame of an earlier session: up to then all was taken in already.
    resumed_s: Option<f64>,
}

/// The result of a frame for one target.
pub struct FrameResult {
    /// The observation.
    pub observation: Observation,
    /// The current state.
    pub state: State,
    /// The reference, where this frame completed it.
    pub learned: Option<Box<Reference>>,
    /// The noise that was learned with this frame.
    pub promise: Option<Box<Promise>>,
    /// A motion of the camera during the readings that were to be the reference, where this frame showed it.
    pub unsettled: Option<Box<Unsettled>>,
}

impl CameraWatcher {
    /// # Errors
    /// A target that no detector knows, a reference image with too little to see, or a setting that cannot be.
    pub fn new(camera: &LiveCamera, config: &LiveConfig) -> Result<Self, CameraWatcherError> {
        let pair = |watched| Pair::new(&camera.camera, camera.intrinsics.as_ref(), watched, config);
        let pairs = camera.targets.iter().map(pair).collect::<Result<Vec<_>, _>>()?;
        let landmarks = camera.landmarks.as_ref();
        let intrinsics = camera.intrinsics.as_ref();
        let landmarks = landmarks
            .map(|watched| LandmarkWatch::new(&camera.camera, intrinsics, watched, config))
            .transpose()?;
        Ok(CameraWatcher {
            camera: camera.camera.clone(),
            pairs,
            landmarks,
            last_image: None,
            resumed_s: None,
        })
    }

    /// Returns the reference of each target, where it is known.
    pub(super) fn references(&self) -> impl Iterator<Item = Option<Reference>> {
        self.pairs.iter().map(Pair::reference)
    }

    /// Returns the monitor of each target, where it has started.
    pub(super) fn monitors(&self) -> impl Iterator<Item = Option<Monitor>> {
        self.pairs.iter().map(|pair| pair.monitor().cloned())
    }

    /// Returns everything that a restart needs, after a frame taken at `last_s` that arrived `ago_s` before now.
    pub(super) fn record(&self, name: &str, last_s: f64, ago_s: f64) -> CameraRecord {
        CameraRecord {
            name: name.to_string(),
            last_s,
            last_unix_s: unix_s() - ago_s,
            last_image: self.last_image.map(|hash| format!("{hash:016x}")),
            pairs: self.pairs.iter().map(Pair::record).collect(),
            landmarks: self.landmarks.as_ref().and_then(LandmarkWatch::record),
        }
    }

    /// Continues from the state of an earlier session; returns true where there was one. `refused` receives the indices of targets that start
    /// again, with the reasons.
    pub(super) fn restore(&mut self, record: &CameraRecord, mut refused: impl FnMut(usize, String)) -> bool {
        let mut is_any = false;
        for (target, pair) in self.pairs.iter_mut().enumerate() {
            match pair.restore(&record.pairs) {
                Ok(is_restored) => is_any |= is_restored,
                Err(reason) => refused(target, reason),
            }
        }
        if let (Some(landmarks), Some(record)) = (&mut self.landmarks, &record.landmarks) {
            match landmarks.restore(record) {
                Ok(()) => is_any = true,
                Err(reason) => refused(self.pairs.len(), reason),
            }
        }
        if is_any {
            self.resume(record.last_s);
            let hash = record.last_image.as_ref();
            self.last_image = hash.and_then(|hash| u64::from_str_radix(hash, 16).ok());
        }
        is_any
    }

    /// Returns the promises of targets whose promise has changed.
    pub(super) fn promised(&mut self, t_s: f64) -> Vec<(usize, Promise)> {
        let pairs = self.pairs.iter_mut().enumerate();
        pairs.filter_map(|(target, pair)| Some((target, pair.promised(t_s)?))).collect()
    }

    /// Forgets what it compares with, and learns where the camera is from the next frame on.
    pub(super) fn learn_anew(&mut self) {
        self.pairs.iter_mut().for_each(Pair::learn_anew);
        self.landmarks.iter_mut().for_each(LandmarkWatch::learn_anew);
    }

    /// An earlier session took in all up to then.
    pub(super) fn resume(&mut self, last_s: f64) {
        self.resumed_s = Some(last_s);
    }

    /// Returns whether an earlier session processed the frame already.
    pub(super) fn is_old(&self, frame: &Frame) -> bool {
        let is_readable = !matches!(frame.content, Content::Unreadable(_));
        is_readable && self.resumed_s.is_some_and(|resumed_s| frame.capture_s <= resumed_s)
    }

    /// Handles an old frame, which does not affect the states: they are those at `now_s` without it.
    pub(super) fn passed_over(&self, frame: &Frame, waited_us: f64, now_s: f64) -> Vec<FrameResult> {
        let states = self.states(now_s).into_iter();
        let reason = Some(format!(
            "taken before {:.3} s, where the state file continues; for another recording give another state file",
            self.resumed_s.unwrap_or(now_s)
        ));
        let looked = |state| FrameResult {
            observation: Observation { reason: reason.clone(), ..blank(frame, waited_us, true) },
            state,
            learned: None,
            promise: None,
            unsettled: None,
        };
        states.map(looked).collect()
    }

    /// Takes note of how many key frames the source of a video has given, the next frame included.
    pub(super) fn count_key_frames(&mut self, of_source: Option<u64>) {
        self.pairs.iter_mut().for_each(|pair| pair.count_key_frames(of_source));
    }

    /// The next frame, for each target in turn. `waited_us` is how long it lay in the queue.
    pub fn take(&mut self, frame: &Frame, waited_us: f64) -> Vec<FrameResult> {
        let lens = self.lens(frame);
        let blank = blank(frame, waited_us, lens.is_ok() && !matches!(frame.content, Content::Unreadable(_)));
        let look = |pair: &mut Pair| {
            let sight = match (&frame.content, &lens) {
                (_, Err(reason)) => Err(reason.clone()),
                (Content::Image(image), Ok(lens)) => Ok(FrameContent::Image(image, lens)),
                (Content::Detections(detections), Ok(_)) => Ok(FrameContent::Detections(detections)),
                (Content::Unreadable(reason), Ok(_)) => Err(reason.clone()),
            };
            pair.take(frame, sight, blank.clone())
        };
        let mut looked: Vec<FrameResult> = self.pairs.iter_mut().map(look).collect();
        if let Some(landmarks) = &mut self.landmarks {
            if looked.iter().any(|looked| looked.unsettled.is_some()) {
                landmarks.begin_anew();
            }
            let has_moved = self.pairs.iter().any(|pair| pair.may_have_moved(frame.capture_s));
            landmarks.stand_in(frame, &lens, &mut looked, (blank, has_moved));
        }
        looked
    }

    /// Returns the deviations of the camera from the references of the session's start, unless reported before.
    pub(super) fn compared(&mut self, is_end: bool) -> Vec<(usize, Deviation)> {
        let pairs = self.pairs.iter_mut().enumerate();
        pairs.filter_map(|(target, pair)| Some((target, pair.compared(is_end)?))).collect()
    }

    /// Returns the state for each target at a time, even when no frame has arrived.
    pub fn states(&self, t_s: f64) -> Vec<State> {
        let targets = self.pairs.iter().map(|pair| pair.state(t_s)).collect();
        match &self.landmarks {
            Some(landmarks) => landmarks.states(t_s, targets),
            None => targets,
        }
    }

    /// Returns the state for each target after the last frame.
    pub(super) fn states_at_the_end(&mut self, t_s: f64) -> Vec<State> {
        let targets = self.pairs.iter_mut().map(|pair| pair.state_at_the_end(t_s)).collect();
        match &self.landmarks {
            Some(landmarks) => landmarks.states(t_s, targets),
            None => targets,
        }
    }

    /// The lens at the size of this image, or why the image is none.
    fn lens(&mut self, frame: &Frame) -> Result<Camera, String> {
        match &frame.content {
            Content::Image(image) if self.is_frozen(image) => {
                Err("the same image as before: the camera or its stream is frozen".to_string())
            }
            Content::Image(image) => {
                resight::formats::check_image_size(&self.camera, image.width_px, image.height_px)
            }
            _ => Ok(self.camera.clone()),
        }
    }

    fn is_frozen(&mut self, image: &GrayImage) -> bool {
        let hash = fingerprint(&image.data);
        self.last_image.replace(hash) == Some(hash)
    }
}

/// Nothing seen yet.
fn blank(frame: &Frame, waited_us: f64, is_readable: bool) -> Observation {
    Observation {
        number: frame.number,
        capture_s: frame.capture_s,
        name: frame.name.clone(),
        is_readable,
        times: StageTimes { waited_us, ..StageTimes::default() },
        ..Observation::default()
    }
}

/// Why a camera cannot be watched.
#[derive(Debug, thiserror::Error)]
pub enum CameraWatcherError {
    /// A target that no detector knows.
    #[error(transparent)]
    Detect(#[from] DetectError),
    /// A reference image that shows too little.
    #[error(transparent)]
    Landmarks(#[from] LandmarksError),
    /// A setting that cannot be.
    #[error(transparent)]
    Setting(#[from] Error),
}

fn nothing(target: &Target) -> String {
    format!("no {} target in this frame", target.kind())
}

fn micros(since: Instant) -> f64 {
    since.elapsed().as_secs_f64() * 1e6
}

/// Computes FNV-1a over 32 bytes at a time, in four lanes, because a single one would wait for its multiplications.
fn fingerprint(data: &[u8]) -> u64 {
    const PRIME: u64 = 0x0000_0100_0000_01b3;
    let mut lanes = [0xcbf2_9ce4_8422_2325, 1, 2, 3];
    let (blocks, rest) = data.as_chunks::<32>();
    for block in blocks {
        let (words, _) = block.as_chunks::<8>();
        for (lane, word) in lanes.iter_mut().zip(words) {
            *lane = (*lane ^ u64::from_le_bytes(*word)).wrapping_mul(PRIME);
        }
    }
    let mixed = lanes.iter().fold(data.len() as u64, |hash, lane| (hash ^ lane).wrapping_mul(PRIME));
    rest.iter().fold(mixed, |hash, byte| (hash ^ u64::from(*byte)).wrapping_mul(PRIME))
}

#[cfg(test)]
mod tests {
    use super::fingerprint;

    /// Noise of one grey level anywhere makes another image; the length counts too.
    #[test]
    fn pictures_that_differ_in_one_pixel_differ() {
        let picture: Vec<u8> = (0..1003u32).map(|i| (i * i % 256) as u8).collect();
        let of_whole = fingerprint(&picture);
        assert_eq!(of_whole, fingerprint(&picture.clone()));
        for i in 0..picture.len() {
            let mut other = picture.clone();
            other[i] ^= 1;
            assert_ne!(of_whole, fingerprint(&other), "pixel {i}");
        }
        assert_ne!(fingerprint(&[0; 64]), fingerprint(&[0; 65]));
    }
}
