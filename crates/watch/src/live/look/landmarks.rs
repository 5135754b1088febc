//! A camera and its natural landmarks: the rotation since the reference image, and its decision, while no target is seen.

use super::{CameraWatcherError, FrameResult, micros};
use crate::live::state::{LandmarksRecord, changed, landmark_settings};
use crate::live::{LiveConfig, Observation, State, WatchedLandmarks};
use crate::source::{Content, Frame};
use nalgebra::{Matrix3, Vector3};
use resight::GrayImage;
use resight::landmarks::{LandmarkObservation, Landmarks};
use resight::locate::IntrinsicsCovariance;
use resight_core::temporal::monitor::{DriftNoise, Monitor, Reading, Reference};
use resight_core::{Camera, Matrix6, Pose};
use std::collections::BTreeMap;
use std::sync::Arc;
use std::time::Instant;

/// What a camera watches its landmarks with.
pub(super) struct LandmarkWatch {
    landmarks: Option<Landmarks>,
    /// From the first observation on, which says how uncertain one is.
    monitor: Option<Monitor>,
    /// The rotation of the image before: the next is near.
    near: Option<Matrix3<f64>>,
    first_s: Option<f64>,
    /// When a reference image was last tried, seconds.
    tried_s: Option<f64>,
    config: LiveConfig,
    /// How well the intrinsics are known.
    intrinsics: Option<IntrinsicsCovariance>,
    /// What its state depends on; none where the image is this session's own.
    settings: Option<BTreeMap<String, String>>,
}

/// Errors common to all landmarks that last for minutes (shadows that wander, a lens that warms up), px of the image. Two
/// images in quick succession do not show them.
const LASTING_PX: f64 = 0.1;
/// What the test takes for the size of a translation, m². Readings say nothing of it, so any size serves.
const TRANSLATION_M2: f64 = 1.0;
/// How badly a reading knows the translation, m²: 10⁴ readings that all say zero are worth one. Docs/math/turn.md section 4.
const UNKNOWN_M2: f64 = 1e4;
/// While a target is seen a reference image is tried this often, seconds: it takes long, and the target must not wait for it.
const TRY_AGAIN_S: f64 = 1.0;

impl LandmarkWatch {
    /// # Errors
    /// A reference image with too little to see, or of another size than the camera's.
    pub fn new(
        camera: &Camera,
        intrinsics: Option<&IntrinsicsCovariance>,
        watched: &WatchedLandmarks,
        config: &LiveConfig,
    ) -> Result<Self, CameraWatcherError> {
        let landmarks =
            watched.reference_image.as_ref().map(|picture| Landmarks::new(picture, camera)).transpose()?;
        let intrinsics = intrinsics.cloned();
        let landmarks = landmarks.map(|landmarks| landmarks.with_intrinsics(intrinsics.clone()));
        let settings =
            watched.reference_image.as_ref().map(|picture| landmark_settings(camera, picture, config));
        let config = config.clone();
        Ok(LandmarkWatch {
            landmarks,
            monitor: None,
            near: None,
            first_s: None,
            tried_s: None,
            config,
            intrinsics,
            settings,
        })
    }

    /// All that a restart needs; none where there is nothing yet, or the image is this session's own.
    pub fn record(&self) -> Option<LandmarksRecord> {
        let (monitor, settings) = self.monitor.as_ref().zip(self.settings.clone())?;
        Some(LandmarksRecord { settings, monitor: monitor.snapshot().into() })
    }

    /// Goes on where another session stopped.
    ///
    /// # Errors
    /// Why the record is not one of these landmarks; nothing has changed then.
    pub fn restore(&mut self, record: &LandmarksRecord) -> Result<(), String> {
        let own = self.settings.as_ref().ok_or("the image of the landmarks is taken anew")?;
        if let Some(words) = changed(&record.settings, own) {
            return Err(words);
        }
        let mut monitor = Monitor::restore(&record.monitor.snapshot()).map_err(|e| e.to_string())?;
        // A state of a version that believed the stated noise.
        if !monitor.measures_noise() {
            monitor.measure_noise(&[]);
        }
        self.monitor = Some(monitor);
        Ok(())
    }

    /// The camera moved while its target's reference was learned: an image that this session took may be from before.
    pub fn begin_anew(&mut self) {
        if self.settings.is_none() {
            (self.landmarks, self.monitor, self.near, self.tried_s) = (None, None, None, None);
        }
    }

    /// The camera was put somewhere else on purpose: a later image is the reference, also where one was given.
    pub fn learn_anew(&mut self) {
        self.settings = None;
        self.begin_anew();
    }

    /// Where no target was seen, the landmarks speak for all of them; without targets they are target 0. `has_moved` says whether a
    /// target may be elsewhere than it was: then the image is no reference.
    pub fn stand_in(
        &mut self,
        frame: &Frame,
        lens: &Result<Camera, String>,
        looked: &mut Vec<FrameResult>,
        (blank, has_moved): (Observation, bool),
    ) {
        if !matches!(frame.content, Content::Unreadable(_)) {
            self.first_s.get_or_insert(frame.capture_s);
        }
        if looked.is_empty() {
            let state = State::Stale { for_s: 0.0, reason: None };
            looked.push(FrameResult {
                observation: blank,
                state,
                learned: None,
                promise: None,
                unsettled: None,
            });
        }
        let is_seen = looked.iter().any(|looked| looked.observation.estimate.is_some());
        let observation = &mut looked[0].observation;
        let said = match self.landmarks {
            None if is_seen && !self.is_due(frame.capture_s) => Ok(()),
            None if has_moved => Err(MOVED.to_string()),
            None => self.learn(frame, lens, observation),
            Some(_) if is_seen => Ok(()),
            Some(_) => self.take(frame, lens, observation),
        };
        if !is_seen {
            self.tell(said, looked);
        }
        for looked in looked {
            looked.state = self.state_of(frame.capture_s, looked.state.clone());
        }
    }

    fn is_due(&self, t_s: f64) -> bool {
        self.tried_s.is_none_or(|tried_s| TRY_AGAIN_S <= (t_s - tried_s).abs())
    }

    /// How things stand at a time, given how they stand with the targets.
    pub fn states(&self, t_s: f64, mut targets: Vec<State>) -> Vec<State> {
        if targets.is_empty() {
            targets.push(State::Stale { for_s: 0.0, reason: None });
        }
        targets.into_iter().map(|target| self.state_of(t_s, target)).collect()
    }

    /// A target that is seen speaks for itself.
    fn state_of(&self, t_s: f64, target: State) -> State {
        let own = match &self.monitor {
            Some(monitor) => monitor.watch(t_s).into(),
            None => State::Stale { for_s: self.first_s.map_or(0.0, |first_s| t_s - first_s), reason: None },
        };
        match (target, own) {
            // Of the target it is known why.
            (State::Stale { reason, .. }, State::Stale { for_s, .. }) => State::Stale { for_s, reason },
            (State::Stale { .. } | State::Learning { readings: 0, .. }, own) => own,
            (target, _) => target,
        }
    }

    /// The rotation in this frame, or why there is none.
    fn take(
        &mut self,
        frame: &Frame,
        lens: &Result<Camera, String>,
        observation: &mut Observation,
    ) -> Result<(), String> {
        let (image, lens) = picture(frame, lens)?;
        let started = Instant::now();
        let Some(landmarks) = &self.landmarks else { return Ok(()) };
        let landmark_observation = landmarks.observe(image, self.near.as_ref());
        observation.times.detect_us += micros(started);
        self.near = landmark_observation
            .as_ref()
            .ok()
            .map(|landmark_observation| landmark_observation.relative_rotation.now_from_reference);
        let landmark_observation = landmark_observation.map_err(|e| e.to_string())?;
        let started = Instant::now();
        let reading = reading(frame.capture_s, &landmark_observation);
        self.decide(&reading, lens, &landmark_observation);
        observation.times.decide_us += micros(started);
        observation.n_points = landmark_observation.relative_rotation.used.len();
        observation.reading = Some(reading);
        observation.landmarks = Some(Arc::new(landmark_observation));
        Ok(())
    }

    /// The first image with enough to see becomes the reference, whether a target is seen in it or not: one taken later, when the
    /// target is gone, may be from after a sudden motion.
    fn learn(
        &mut self,
        frame: &Frame,
        lens: &Result<Camera, String>,
        observation: &mut Observation,
    ) -> Result<(), String> {
        let (image, lens) = picture(frame, lens)?;
        self.tried_s = Some(frame.capture_s);
        let started = Instant::now();
        let landmarks = Landmarks::new(image, lens);
        observation.times.detect_us += micros(started);
        let landmarks = landmarks.map_err(|e| e.to_string())?.with_intrinsics(self.intrinsics.clone());
        if observation.estimate.is_none() {
            observation.n_points = landmarks.count();
        }
        observation.reference_image = Some(Arc::new(image.clone()));
        (self.landmarks, self.near) = (Some(landmarks), Some(Matrix3::identity()));
        Ok(())
    }

    fn decide(&mut self, reading: &Reading, lens: &Camera, landmark_observation: &LandmarkObservation) {
        if self.monitor.is_none() {
            let reference = reference(
                &landmark_observation.relative_rotation.covariance,
                &correlated(lens, landmark_observation),
                &self.config,
            );
            self.monitor = Monitor::new(&reference, &self.config.monitor, reading.t_s).ok();
            // How exactly landmarks are found is seen from image to image; what lasts is not, and is expected as large as stated at least.
            if let Some(monitor) = &mut self.monitor {
                monitor.measure_noise(&[]);
            }
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.push(reading);
        }
    }

    /// What was seen, for every target; a reason joins the target's own.
    fn tell(&self, seen: Result<(), String>, looked: &mut [FrameResult]) {
        let Some((first, others)) = looked.split_first_mut() else { return };
        for observation in
            std::iter::once(&mut first.observation).chain(others.iter_mut().map(|l| &mut l.observation))
        {
            observation.reason = match (&seen, observation.reason.take()) {
                (Ok(()), _) => None,
                (Err(reason), Some(own)) if own != *reason => Some(format!("{own}; {reason}")),
                (Err(reason), _) => Some(reason.clone()),
            };
        }
        for other in others {
            other.observation.landmarks.clone_from(&first.observation.landmarks);
            other.observation.reading = first.observation.reading;
            other.observation.n_points = first.observation.n_points;
        }
    }
}

/// Why no image is taken as a reference.
const MOVED: &str = "the target may have moved, so this is no reference image of the landmarks";

/// The image of a frame with its lens, or why there is none.
fn picture<'a>(
    frame: &'a Frame,
    lens: &'a Result<Camera, String>,
) -> Result<(&'a GrayImage, &'a Camera), String> {
    let lens = lens.as_ref().map_err(Clone::clone)?;
    match &frame.content {
        Content::Image(image) => Ok((image, lens)),
        Content::Unreadable(reason) => Err(reason.clone()),
        Content::Detections(_) => Err("landmarks are found in images, not in detections".into()),
    }
}

/// The camera now from the camera of the reference image: a rotation, and a translation of which nothing is known.
fn reading(t_s: f64, landmark_observation: &LandmarkObservation) -> Reading {
    Reading {
        t_s,
        a_from_b: Pose::new(landmark_observation.relative_rotation.now_from_reference, Vector3::zeros()),
        covariance: with_translation(&landmark_observation.relative_rotation.covariance, UNKNOWN_M2),
        is_consistent: landmark_observation.relative_rotation.is_consistent(),
    }
}

/// The reference image errs as a reading does.
fn reference(covariance: &Matrix3<f64>, correlated: &Matrix3<f64>, config: &LiveConfig) -> Reference {
    let known = &config.correlated;
    let rotation = |m: &Matrix6| m.fixed_view::<3, 3>(0, 0).into_owned();
    let noise = DriftNoise {
        reference: with_translation(covariance, TRANSLATION_M2),
        reading: with_translation(covariance, TRANSLATION_M2),
        bias: with_translation(&(correlated + rotation(&known.bias)), 0.0),
        bias_time_s: known.bias_time_s,
        diurnal: with_translation(&rotation(&known.diurnal), 0.0),
    };
    Reference { a_from_b: Pose::identity(), noise }
}

/// The rotation that moves the image by `LASTING_PX` about each axis; about the optical axis, at a quarter of its width.
fn correlated(lens: &Camera, landmark_observation: &LandmarkObservation) -> Matrix3<f64> {
    let ahead = lens.project_with_jacobian(&Vector3::z());
    let px_per_rad = ahead.map_or(1.0, |(_, slope)| slope.column(0).norm());
    let columns = |found: &resight::landmarks::Found| found.reference_px.x;
    let widest = landmark_observation.found.iter().map(columns).fold(1.0, f64::max);
    let relative_rotation = |px_per_rad: f64| (LASTING_PX / px_per_rad).powi(2);
    Matrix3::from_diagonal(&Vector3::new(
        relative_rotation(px_per_rad),
        relative_rotation(px_per_rad),
        relative_rotation(0.25 * widest),
    ))
}

fn with_translation(rotation: &Matrix3<f64>, translation_m2: f64) -> Matrix6 {
    let mut covariance = Matrix6::from_diagonal_element(translation_m2);
    covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation);
    covariance
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::live::CheckingReason;
    use resight_core::Lens;
    use resight_core::camera::{CameraMatrix, Pinhole};

    /// Landmarks that see nothing do not make a target unseen that is seen; nor do they speak for it.
    #[test]
    fn a_target_that_is_seen_speaks_for_itself() {
        let matrix = CameraMatrix { fx_px: 400.0, fy_px: 400.0, cx_px: 240.0, cy_px: 180.0 };
        let lens = Camera { lens: Lens::Pinhole(Pinhole { matrix }), size: None };
        let watched = WatchedLandmarks { reference_image: None };
        let landmarks = LandmarkWatch::new(&lens, None, &watched, &LiveConfig::default()).expect("landmarks");
        let learning = |readings| State::Learning { readings, needed: 50 };
        for seen in
            [State::Checking(CheckingReason::Different), State::Steady, State::Inconsistent, learning(1)]
        {
            assert_eq!(landmarks.states(7.0, vec![seen.clone()]), [seen]);
        }
        for unseen in [State::Stale { for_s: 6.0, reason: None }, learning(0)] {
            assert!(matches!(landmarks.states(7.0, vec![unseen])[0], State::Stale { .. }));
        }
    }
}
