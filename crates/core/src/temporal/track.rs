//! The pose of a camera over time: a filter on SE(3) that also decides between two poses.
//!
//! ```text
//!   X  cam_from_target, its error a left motion ξ     v  twist, of a moving camera: X(t + Δ) = Exp(v Δ) X(t)
//!   P  covariance of [ξ, δv]     e = Log(Z X⁻¹) innovation of a reading Z, S = P_ξξ + R its covariance, K = P_·ξ S⁻¹
//!   tracks: X with a weight; a reading continues each with each of its minima, as an outlier, or begins a new one
//! ```
//! Derivation: docs/math/track.md. Time enters as data.

mod filter;

use crate::covariance::is_covariance;
use crate::multiview::relative::check_pose;
use crate::temporal::snapshot::{Numbers, Rest, Snapshot, numbers};
use crate::{Error, Matrix6, Pose, Vector6};
use arrayvec::ArrayVec;
use filter::{Filter, Noise};

/// How the camera (or the target) moves between readings.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Motion {
    /// It stays, except for a random walk.
    Static {
        /// Standard deviation of the rotation about each axis after one second, radians.
        rotation_rad_per_sqrt_s: f64,
        /// Standard deviation of the shift along each axis after one second, metres.
        translation_m_per_sqrt_s: f64,
    },
    /// It continues with its velocity, except for a random change of it.
    ConstantVelocity {
        /// Standard deviation of the change of turning speed in one second, radians per second.
        rotation_rad_per_s_sqrt_s: f64,
        /// Standard deviation of the change of speed in one second, metres per second.
        translation_m_per_s_sqrt_s: f64,
    },
}

/// The tracker's model.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct TrackConfig {
    /// How it moves.
    pub motion: Motion,
    /// Share of outliers among the readings.
    pub outlier_probability: f64,
    /// Probability that it was moved between two readings.
    pub jump_probability: f64,
}

impl Default for TrackConfig {
    /// A mounted camera that moves at random by 0.006° and 0.1 mm in a second.
    fn default() -> Self {
        let motion = Motion::Static { rotation_rad_per_sqrt_s: 1e-4, translation_m_per_sqrt_s: 1e-4 };
        TrackConfig { motion, outlier_probability: 0.01, jump_probability: 1e-4 }
    }
}

/// One of the poses that an image allows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Candidate {
    /// The pose.
    pub cam_from_target: Pose,
    /// Its 6×6 covariance, left motion in the camera frame.
    pub covariance: Matrix6,
    /// Its probability among the candidates of the image.
    pub probability: f64,
}

/// Where it is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tracked {
    /// Time of this estimate, seconds.
    pub t_s: f64,
    /// The pose.
    pub cam_from_target: Pose,
    /// Its 6×6 covariance, left motion in the camera frame.
    pub covariance: Matrix6,
    /// `[rad/s; m/s]`, left twist in the camera frame; zero for a static camera.
    pub velocity: Vector6,
    /// Probability that it is this pose and not another one that also fits.
    pub probability: f64,
    /// eᵀS⁻¹e of the candidate taken: χ² with six degrees of freedom; none where none was.
    pub innovation_chi2: Option<f64>,
    /// Which candidate of the last reading belongs to this pose; none where the reading was an outlier.
    pub candidate: Option<usize>,
}

/// Of `snapshot`: raised when a field, or the meaning of one, changes.
const SNAPSHOT_VERSION: u32 = 1;
/// Poses followed at once.
const TRACKS: usize = 6;
/// Candidates looked at in a reading.
const CANDIDATES: usize = 4;
/// Tracks less probable than this are given up.
const LEAST_WEIGHT: f64 = 1e-9;
/// Two tracks nearer than this in χ² are one.
const SAME_CHI2: f64 = 4.0;

/// A pose that may be the true one.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Track {
    filter: Filter,
    probability: f64,
    innovation_chi2: Option<f64>,
    candidate: Option<usize>,
}

/// The filter.
#[derive(Debug, Clone, PartialEq)]
pub struct Tracker {
    config: TrackConfig,
    noise: Noise,
    tracks: ArrayVec<Track, TRACKS>,
    t_s: f64,
}

impl Tracker {
    /// Knows nothing yet.
    ///
    /// # Errors
    /// `InvalidSetting` for a process noise that is negative or no number, or a probability outside (0, 1).
    pub fn new(config: &TrackConfig) -> Result<Self, Error> {
        let noise = Noise::new(&config.motion)?;
        for (setting, seen) in [
            ("outlier_probability", config.outlier_probability),
            ("jump_probability", config.jump_probability),
        ] {
            if !(0.0 < seen && seen < 1.0) {
                return Err(Error::InvalidSetting {
                    setting,
                    seen,
                    needed: "it is a chance, between 0 and 1",
                });
            }
        }
        Ok(Tracker { config: *config, noise, tracks: ArrayVec::new(), t_s: f64::MIN })
    }

    /// All of its state: the tracker that `restore` makes of it continues as this one would.
    pub fn snapshot(&self) -> Snapshot {
        Snapshot::of(self, SNAPSHOT_VERSION)
    }

    /// Continues from a snapshot; the motion expected in the time since then widens the covariance.
    ///
    /// # Errors
    /// `SnapshotVersion`, `SnapshotNumbers` for numbers that are no tracker's, `InvalidSetting` as `new`.
    pub fn restore(snapshot: &Snapshot) -> Result<Self, Error> {
        let tracker: Tracker = snapshot.state(SNAPSHOT_VERSION)?;
        Ok(Tracker { tracks: tracker.tracks, t_s: tracker.t_s, ..Tracker::new(&tracker.config)? })
    }

    /// Takes in a reading. None while nothing has been seen; readings before the last one's time, and candidates that are no
    /// numbers, are left out.
    pub fn push(&mut self, t_s: f64, candidates: &[Candidate]) -> Option<Tracked> {
        let usable: ArrayVec<(usize, &Candidate), CANDIDATES> =
            candidates.iter().enumerate().filter(|(_, c)| c.is_usable()).take(CANDIDATES).collect();
        if t_s.is_finite() && self.t_s <= t_s && !usable.is_empty() {
            let elapsed_s = if self.tracks.is_empty() { 0.0 } else { t_s - self.t_s };
            self.tracks.iter_mut().for_each(|track| track.filter.predict(&self.noise, elapsed_s));
            self.t_s = t_s;
            self.continue_with(&usable);
        }
        self.best()
    }

    /// The prediction for a later time without a new reading.
    pub fn predicted(&self, t_s: f64) -> Option<Tracked> {
        let mut later = self.clone();
        let elapsed_s = (t_s - self.t_s).max(0.0);
        later.tracks.iter_mut().for_each(|track| track.filter.predict(&self.noise, elapsed_s));
        later.t_s = self.t_s + elapsed_s;
        later.best()
    }

    /// Every track with every candidate, docs/math/track.md eqs. (5)–(8).
    fn continue_with(&mut self, candidates: &[(usize, &Candidate)]) {
        let mut all: ArrayVec<Track, { TRACKS * (CANDIDATES + 1) + CANDIDATES }> = ArrayVec::new();
        for (index, candidate) in candidates {
            let density = nowhere_special(candidate);
            let begun = if self.tracks.is_empty() { 1.0 } else { self.config.jump_probability };
            let filter = Filter::begin(&self.noise, candidate);
            all.push(Track {
                filter,
                probability: begun * candidate.probability * density,
                innovation_chi2: None,
                candidate: Some(*index),
            });
            for track in &self.tracks {
                all.extend(self.continued(track, *index, candidate));
            }
        }
        let density = nowhere_special(candidates[0].1);
        all.extend(self.tracks.iter().map(|track| Track {
            probability: track.probability * self.config.outlier_probability * density,
            innovation_chi2: None,
            candidate: None,
            ..*track
        }));
        self.keep(&mut all);
    }

    fn continued(&self, track: &Track, index: usize, candidate: &Candidate) -> Option<Track> {
        let (filter, chi2, density) = track.filter.updated(candidate)?;
        let stays = 1.0 - self.config.outlier_probability - self.config.jump_probability;
        let probability = track.probability * stays.max(f64::EPSILON) * candidate.probability * density;
        Some(Track { filter, probability, innovation_chi2: Some(chi2), candidate: Some(index) })
    }

    /// The most probable tracks, duplicates joined, weights adding up to one.
    fn keep(&mut self, all: &mut [Track]) {
        all.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        self.tracks.clear();
        let largest = all.first().map_or(0.0, |track| track.probability);
        for track in all.iter().filter(|track| LEAST_WEIGHT * largest < track.probability) {
            let duplicate =
                self.tracks.iter().position(|kept| kept.filter.chi2_to(&track.filter) < SAME_CHI2);
            match duplicate {
                Some(duplicate) => self.tracks[duplicate].probability += track.probability,
                None if self.tracks.is_full() => {}
                None => self.tracks.push(*track),
            }
        }
        let total: f64 = self.tracks.iter().map(|track| track.probability).sum();
        self.tracks.iter_mut().for_each(|track| track.probability /= total);
    }

    fn best(&self) -> Option<Tracked> {
        let best = self.tracks.iter().max_by(|a, b| a.probability.total_cmp(&b.probability))?;
        Some(Tracked {
            t_s: self.t_s,
            cam_from_target: best.filter.cam_from_target,
            covariance: best.filter.pose_covariance(),
            velocity: best.filter.velocity,
            probability: best.probability,
            innovation_chi2: best.innovation_chi2,
            candidate: best.candidate,
        })
    }
}

impl Candidate {
    fn is_usable(&self) -> bool {
        0.0 < self.probability
            && self.probability.is_finite()
            && check_pose("candidate", 0, &self.cam_from_target).is_ok()
            && is_covariance(&self.covariance)
    }
}

/// Density of a pose that may be anywhere: any rotation, any place within the distance to the target, eq. (6).
fn nowhere_special(candidate: &Candidate) -> f64 {
    let reach_m = 2.0 * candidate.cam_from_target.translation.norm().max(1e-3);
    1.0 / (8.0 * std::f64::consts::PI.powi(2) * reach_m.powi(3))
}

numbers!(Track { filter, probability, innovation_chi2, candidate });
numbers!(Tracker { config, noise, tracks, t_s });
numbers!(TrackConfig { motion, outlier_probability, jump_probability });

impl Numbers for Motion {
    fn put(&self, numbers: &mut Vec<f64>) {
        let (is_moving, rotation, translation) = match *self {
            Motion::Static { rotation_rad_per_sqrt_s: rotation, translation_m_per_sqrt_s: translation } => {
                (false, rotation, translation)
            }
            Motion::ConstantVelocity {
                rotation_rad_per_s_sqrt_s: rotation,
                translation_m_per_s_sqrt_s: translation,
            } => (true, rotation, translation),
        };
        is_moving.put(numbers);
        [rotation, translation].put(numbers);
    }

    fn take(rest: &mut Rest) -> Option<Self> {
        let is_moving = bool::take(rest)?;
        let [rotation, translation] = Numbers::take(rest)?;
        Some(if is_moving {
            Motion::ConstantVelocity {
                rotation_rad_per_s_sqrt_s: rotation,
                translation_m_per_s_sqrt_s: translation,
            }
        } else {
            Motion::Static { rotation_rad_per_sqrt_s: rotation, translation_m_per_sqrt_s: translation }
        })
    }
}
