//! A camera and its natural landmarks: the rotation since the reference image, and the decision from it while no target is observed.

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

/// The landmarks of one camera and their monitor.
pub(super) struct LandmarkWatch {
    landmarks: Option<Landmarks>,
    /// Present from the first observation on, which provides the uncertainty of an observation.
    monitor: Option<Monitor>,
    /// The rotation in the previous image, which is near the next one.
    near: Option<Matrix3<f64>>,
    first_s: Option<f64>,
    /// Time of the last attempt to take a reference image, seconds.
    tried_s: Option<f64>,
    config: LiveConfig,
    /// Covariance of the intrinsics.
    intrinsics: Option<IntrinsicsCovariance>,
    /// The settings on which its state depends; none where the reference image was taken in this session.
    settings: Option<BTreeMap<String, String>>,
}

/// Errors common to all landmarks that last for minutes (moving shadows, a lens that warms up), px of the image. Two images in quick succession
/// do not show them.
const LASTING_PX: f64 = 0.1;
/// Assumed size of a translation in the test, m². Readings contain no information on it, so any size serves.
const TRANSLATION_M2: f64 = 1.0;
/// Variance of the translation in a reading, m²: 10⁴ readings of zero are worth one. docs/math/turn.md section 4.
const UNKNOWN_M2: f64 = 1e4;
/// Interval between attempts to take a reference image while a target is observed, seconds: an attempt is slow, and the target must not wait for
/// it.
const TRY_AGAIN_S: f64 = 1.0;

impl LandmarkWatch {
    /// # Errors
    /// Fails for a reference image with too few landmarks, or of another size than the camera's.
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

    /// Returns all that a restart needs; none where there is nothing yet, or the reference image is this session's own.
    pub fn record(&self) -> Option<LandmarksRecord> {
        let (monitor, settings) = self.monitor.as_ref().zip(self.settings.clone())?;
        Some(LandmarksRecord { settings, monitor: monitor.snapshot().into() })
    }

    /// Continues from the state of another session.
    ///
    /// # Errors
    /// The reason why the record does not belong to these landmarks; nothing has changed then.
    pub fn restore(&mut self, record: &LandmarksRecord) -> Result<(), String> {
        let own = self.settings.as_ref().ok_or("the image of the landmarks is taken anew")?;
        if let Some(words) = changed(&record.settings, own) {
            return Err(words);
        }
        let mut monitor = Monitor::restore(&record.monitor.snapshot()).map_err(|e| e.to_string())?;
        // A state of a version that did not estimate the noise.
        if !monitor.measures_noise() {
            monitor.measure_noise(&[]);
        }
        self.monitor = Some(monitor);
        Ok(())
    }

    /// Discards a reference image of this session, because the camera moved while its target's reference was learned: the image may be older
    /// than the motion.
    pub fn begin_anew(&mut self) {
        if self.settings.is_none() {
            (self.landmarks, self.monitor, self.near, self.tried_s) = (None, None, None, None);
        }
    }

    /// Discards the reference image, also a given one, because the camera was moved on purpose: a later image becomes the reference.
    pub fn learn_anew(&mut self) {
        self.settings = None;
        self.begin_anew();
    }

    /// Uses the landmarks for all targets where none was observed; without targets they count as target 0. `has_moved` states whether a target
    /// may have moved: the image is then no reference.
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

    /// Returns the states at a time, given those from the targets.
    pub fn states(&self, t_s: f64, mut targets: Vec<State>) -> Vec<State> {
        if targets.is_empty() {
            targets.push(State::Stale { for_s: 0.0, reason: None });
        }
        targets.into_iter().map(|target| self.state_of(t_s, target)).collect()
    }

    /// Returns the state from the target itself where the target is observed.
    fn state_of(&self, t_s: f64, target: State) -> State {
        let own = match &self.monitor {
            Some(monitor) => monitor.watch(t_s).into(),
            // The reference image was just taken; the next one is the first that is compared with it.
            None if self.has_just_learned(t_s) => State::Learning { readings: 1, needed: 2 },
            None => State::Stale { for_s: self.first_s.map_or(0.0, |first_s| t_s - first_s), reason: None },
        };
        match (target, own) {
            // The reason is known for the target.
            (State::Stale { reason, .. }, State::Stale { for_s, .. }) => State::Stale { for_s, reason },
            (State::Stale { .. } | State::Learning { readings: 0, .. }, own) => own,
            (target, _) => target,
        }
    }

    fn has_just_learned(&self, t_s: f64) -> bool {
        let is_recent = |tried_s: f64| t_s - tried_s <= self.config.monitor.stale_after_s;
        self.landmarks.is_some() && self.tried_s.is_some_and(is_recent)
    }

    /// Returns the rotation in this frame, or the reason why there is none.
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

    /// Makes the first image with enough landmarks the reference, whether a target is observed in it or not: a later one, taken when the target
    /// is gone, may follow a sudden motion.
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
            // The noise of landmarks is estimated from image to image; errors that last are not visible there and are expected at least as large
            // as stated.
            if let Some(monitor) = &mut self.monitor {
                monitor.measure_noise(&[]);
            }
        }
        if let Some(monitor) = &mut self.monitor {
            monitor.push(reading);
        }
    }

    /// Adds the result to every target; a reason is appended to the target's own.
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

/// Reason why no image is taken as a reference.
const MOVED: &str = "the target may have moved, so this is no reference image of the landmarks";

/// Returns the image of a frame with its lens, or the reason why there is none.
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

/// Returns the pose of the camera relative to that of the reference image: a rotation, and a translation without information.
fn reading(t_s: f64, landmark_observation: &LandmarkObservation) -> Reading {
    Reading {
        t_s,
        a_from_b: Pose::new(landmark_observation.relative_rotation.now_from_reference, Vector3::zeros()),
        covariance: with_translation(&landmark_observation.relative_rotation.covariance, UNKNOWN_M2),
        is_consistent: landmark_observation.relative_rotation.is_consistent(),
    }
}

/// Returns the reference, whose image has the errors of a reading.
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

/// Returns the covariance of the rotation that moves the image by `LASTING_PX` about each axis; about the optical axis, at a quarter of its
/// width.
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

    /// Landmarks without an observation do not make an observed target stale, and do not replace it.
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
