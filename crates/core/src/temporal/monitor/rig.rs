//! Did a camera of a rig move? The drift change detector of cameras that see targets together, wherever the targets are carried.
//!
//! Each frame set gives the cameras' relative poses; the target's own place is taken out. One sequential test watches the whole rig at one
//! stated rate of false alarms, and says which camera moved, or that two or more explain what is seen equally well.
//! Derivation: docs/math/monitor.md, section 7.

mod star;
mod filter;
mod evidence;
mod which;
mod held;
mod typical;
mod noises;
mod earlier;
mod restore;
mod learn;

pub use filter::ObservationNoise;
pub use learn::{FrameSet, RigUnsettled, learn_observation_noise, learn_rig, unsettled_rig};
pub use star::TargetObservation;

use super::attribute::{Attribution, MovedNode};
use super::axis::DAY_S;
use super::priors::CHOSEN;
use super::test::LEAST_EVIDENCE;
use super::{Drift, MonitorConfig, Watch, check, is_likely};
use crate::locate::consistency::Consistency;
use crate::statistics::chi_square::tail;
use crate::{Error, Matrix6, Pose};
use evidence::Evidence;
use filter::{Innovation, Propagated, RigFilter};
use held::{Held, ReadingSet};
use nalgebra::DMatrix;
use noises::Noises;
use typical::Typical;

/// A share of contradictory readings of a camera beyond which the monitor says so.
const MOSTLY: f64 = 0.5;
/// Readings over which that share is taken.
const SHARE_OVER: f64 = 20.0;

/// What the cameras are compared with.
#[derive(Debug, Clone, PartialEq)]
pub struct RigReference {
    /// x_in_cam = cam_from_rig · x_in_rig of each camera when all was well.
    pub cam_from_rig: Vec<Pose>,
    /// Covariance of all small left motions `[rotation_rad; translation_m]` together, 6 rows a camera.
    pub covariance: DMatrix<f64>,
    /// What is no drift, for each camera.
    pub noise: Vec<ObservationNoise>,
}

/// What moved, as far as it is known.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MovedCameras {
    /// Cameras, each with its motion.
    pub moved: Vec<MovedNode>,
    /// Other sets that explain what is seen about as well: when there are any, it is not decided which of them moved.
    pub alternatives: Vec<Vec<usize>>,
    /// Since when, seconds; zero where nothing moved.
    pub began_s: f64,
}

/// The change detector of a rig.
#[derive(Debug, Clone, PartialEq)]
pub struct RigMonitor {
    reference: RigReference,
    config: MonitorConfig,
    /// Where each camera has been since its last change, in its frame of the reference.
    old_from_level: Vec<Pose>,
    noises: Noises,
    evidence: Evidence,
    held: Held,
    typical: Typical,
    last_onset_s: f64,
    last_s: f64,
    /// When each camera last saw a target at all, and when others saw it too, seconds.
    observed_s: Vec<f64>,
    seen_s: Vec<f64>,
    inconsistent_share: Vec<f64>,
    drifts: Vec<Option<Drift>>,
    /// An alarm whose camera is not decided.
    open: Option<Open>,
    /// Sets that might have moved instead of those that `drifts` names.
    alternatives: Vec<Vec<usize>>,
    /// Frame sets left out: outliers that nothing confirmed.
    pub outliers: u64,
    /// Frame sets with a time before that of the last one; they are left out.
    pub out_of_order: u64,
}

/// An alarm, and what is known about it.
#[derive(Debug, Clone, PartialEq)]
struct Open {
    attribution: Attribution,
    drifts: Vec<Drift>,
}

/// Chance of a frame set as far from what was expected as this, or farther: it waits for others.
const SURPRISE: f64 = 1e-6;

impl RigMonitor {
    /// Starts at `t_s`, seconds, of the same clock as the frame sets.
    ///
    /// # Errors
    /// `InvalidSetting` for a rate, period or time that is not positive, numbers that do not fit together, or noise that is none.
    pub fn new(reference: &RigReference, config: &MonitorConfig, t_s: f64) -> Result<Self, Error> {
        check(config)?;
        reference.check()?;
        let n = reference.cam_from_rig.len();
        Ok(RigMonitor {
            config: *config,
            old_from_level: vec![Pose::identity(); n],
            noises: Noises::new(reference),
            evidence: Evidence::default(),
            held: Held::default(),
            typical: Typical::new(n),
            last_onset_s: f64::MIN,
            last_s: t_s,
            observed_s: vec![t_s; n],
            seen_s: vec![t_s; n],
            inconsistent_share: vec![0.0; n],
            drifts: vec![None; n],
            open: None,
            alternatives: Vec::new(),
            outliers: 0,
            out_of_order: 0,
            reference: reference.clone(),
        })
    }

    /// Takes in what all cameras saw at one time. A observation of a camera that the rig does not have is left out.
    pub fn push(&mut self, frame_set: &FrameSet) {
        if !frame_set.t_s.is_finite() || frame_set.t_s < self.last_s {
            self.out_of_order += 1;
            return;
        }
        self.last_s = frame_set.t_s;
        let known = frame_set
            .target_observations
            .iter()
            .filter(|target_observation| target_observation.camera < self.seen_s.len());
        let mut usable = FrameSet { t_s: frame_set.t_s, target_observations: Vec::new() };
        for target_observation in known {
            self.observed_s[target_observation.camera] = frame_set.t_s;
            let is_consistent = matches!(target_observation.estimate.consistency, Consistency::Consistent);
            let share = &mut self.inconsistent_share[target_observation.camera];
            *share += (f64::from(u8::from(!is_consistent)) - *share) / SHARE_OVER;
            if is_consistent {
                usable.target_observations.push(*target_observation);
            }
        }
        let stars = learn::stars(&usable, &self.places()).into_iter().map(|(_, star)| star).collect();
        let frame_set = ReadingSet { t_s: frame_set.t_s, stars };
        self.weigh(frame_set);
    }

    /// How things stand with a camera at `t_s`, relative to the others.
    pub fn watch(&self, camera: usize, t_s: f64) -> Watch {
        let Some(seen_s) = self.seen_s.get(camera) else { return Watch::Stale { for_s: 0.0 } };
        let for_s = t_s - seen_s;
        let is_alternative = !self.alternatives.is_empty()
            && (self.drifts[camera].is_some()
                || self.alternatives.iter().flatten().any(|alternative| *alternative == camera));
        match self.drifts[camera] {
            // What contradicted itself before the camera went blind says nothing of now.
            _ if self.config.stale_after_s < t_s - self.observed_s[camera] => Watch::Stale { for_s },
            _ if MOSTLY < self.inconsistent_share[camera] => Watch::Inconsistent,
            _ if self.config.stale_after_s < for_s => Watch::Stale { for_s },
            _ if is_alternative => Watch::Checking,
            Some(drift) => Watch::Drifted(self.refined(camera, &drift)),
            None if self.is_suspect(camera) => Watch::Checking,
            None => Watch::Steady,
        }
    }

    /// What moved since the reference, also while it is not seen now. Nothing: both lists are empty.
    pub fn moved(&self) -> MovedCameras {
        let settled = self.drifts.iter().enumerate().filter_map(|(camera, drift)| {
            let drift = self.refined(camera, drift.as_ref()?);
            Some((camera, drift))
        });
        let open = self.open.iter().flat_map(|open| {
            let cameras = open.attribution.moved.iter().map(|moved| moved.node);
            cameras.zip(open.drifts.iter().copied())
        });
        let mut all: Vec<(usize, Drift)> = open.chain(settled).collect();
        all.sort_by_key(|(camera, _)| *camera);
        all.dedup_by_key(|(camera, _)| *camera);
        let alternatives =
            self.open.as_ref().map_or(&self.alternatives, |open| &open.attribution.alternatives);
        let began_s = all.iter().map(|(_, drift)| drift.began_s).fold(f64::INFINITY, f64::min);
        let node = |(node, drift): &(usize, Drift)| MovedNode {
            node: *node,
            old_from_new: drift.old_from_new,
            covariance: drift.covariance,
        };
        MovedCameras {
            moved: all.iter().map(node).collect(),
            alternatives: alternatives.clone(),
            began_s: if began_s.is_finite() { began_s } else { 0.0 },
        }
    }

    /// Whether an outlier waits for others, or an alarm for a decision, that may be this camera's.
    fn is_suspect(&self, camera: usize) -> bool {
        let open = self.open.as_ref().is_some_and(|open| {
            open.attribution.moved.iter().any(|moved| moved.node == camera)
                || open.attribution.alternatives.iter().flatten().any(|alternative| *alternative == camera)
        });
        open || self.held.suspects().any(|suspect| suspect == camera)
    }

    /// Where the cameras are held to be: cam_from_rig now.
    fn places(&self) -> Vec<Pose> {
        let levels = self.old_from_level.iter().zip(&self.reference.cam_from_rig);
        levels.map(|(old_from_level, cam_from_rig)| old_from_level.inverse() * *cam_from_rig).collect()
    }

    /// A frame set that is as expected goes to the test; one that is not waits until others agree with it.
    fn weigh(&mut self, frame_set: ReadingSet) {
        let (ahead, carried) = self.noises.ahead(frame_set.t_s);
        let scale = self.noises.filter().1;
        let Some(innovation) = ahead.innovation(&frame_set.stars).map(|of| of.scaled(scale)) else { return };
        frame_set.cameras().for_each(|camera| self.seen_s[camera] = frame_set.t_s);
        if SURPRISE < tail(innovation.degrees_of_freedom(), innovation.chi2()) {
            self.outliers += self.held.clear(&frame_set);
            self.read(&frame_set, frame_set.t_s, (ahead, &carried), &innovation);
            self.decide();
            return;
        }
        let (passed, dropped) =
            self.held.push(frame_set, self.noises.filter(), &innovation, self.typical.variances());
        self.outliers += dropped;
        // Seen one after the other, reported at once: they say the same.
        let began_s = passed.first().map_or(0.0, |first| first.t_s);
        for frame_set in &passed {
            let (ahead, carried) = self.noises.ahead(frame_set.t_s);
            let scale = self.noises.filter().1;
            if let Some(innovation) = ahead.innovation(&frame_set.stars).map(|of| of.scaled(scale)) {
                self.read(frame_set, began_s, (ahead, &carried), &innovation);
            }
        }
        if !passed.is_empty() {
            self.decide();
        }
    }

    /// The test reads a frame set, to which the filter in use has been carried; a change may have begun at `onset_s`.
    fn read(
        &mut self,
        frame_set: &ReadingSet,
        onset_s: f64,
        (ahead, carried): (RigFilter, &Propagated),
        innovation: &Innovation,
    ) {
        self.evidence.predict(carried);
        self.typical.add(frame_set, &self.reference.noise);
        // A decision period has one onset, shared among its frame sets: were there only one place for it, no camera's motion would explain
        // the frame sets on both sides of a change elsewhere.
        // However slow the frame sets come, an onset weighs the time that it stands for: eq. (34).
        let most = (self.threshold() / LEAST_EVIDENCE).max(1.0);
        let periods = (onset_s - self.last_onset_s) / self.config.decision_period_s;
        let share = if self.last_onset_s == f64::MIN { 1.0 } else { periods.clamp(0.0, most) };
        if 0.0 < share {
            self.evidence.begin(onset_s, share, self.typical.variances(), self.noises.then());
            self.last_onset_s = onset_s;
        }
        self.evidence.add(innovation);
        self.noises.read(ahead, carried, innovation);
    }

    fn decide(&mut self) {
        let is_over = self.is_over();
        if self.open.is_none() && !is_over {
            return;
        }
        let Some(open) = self.attributed() else { return };
        if !self.matters(&open) && !self.has_moved() {
            return;
        }
        // Two cameras stay alternatives; among more, a wrong guess would make another camera seem to have moved.
        let is_decided = open.attribution.is_explained && open.attribution.alternatives.is_empty();
        if is_decided || self.seen_s.len() == 2 {
            self.start_again(&open);
        } else {
            self.open = Some(open);
        }
    }

    /// Whether R passes the threshold, also beside noise that grew, and beside errors like those that there were so far.
    fn is_over(&self) -> bool {
        let threshold = self.threshold();
        threshold <= self.evidence.statistic && {
            let log_r = self.evidence.log_statistic_against(|then| self.noises.log_against(then));
            let then = self.evidence.began().map(|began| began.onset.then);
            threshold.ln() <= self.noises.deflated(log_r, &then.unwrap_or_default())
        }
    }

    /// Alarm at this R.
    fn threshold(&self) -> f64 {
        DAY_S / (self.config.decision_period_s * self.config.false_alarms_per_day)
    }

    fn has_moved(&self) -> bool {
        self.drifts.iter().any(Option::is_some)
    }

    /// The reference may err too.
    fn matters(&self, open: &Open) -> bool {
        let cameras = open.attribution.moved.iter().map(|moved| self.own_covariance(moved.node));
        let mut drifts = cameras.zip(&open.drifts);
        drifts
            .any(|(own, drift)| Drift { covariance: drift.covariance + own, ..*drift }.matters(&self.config))
    }

    /// Cameras that explain the evidence, with their motions.
    fn attributed(&self) -> Option<Open> {
        let began = self.evidence.began()?;
        let gathered = began.onset.gathered(began.course);
        let attribution = which::which(gathered, 1);
        let drift = |moved: &MovedNode| {
            let (level, doubt) = self.noises.level(moved.node);
            let gained = gathered.gained(moved.node);
            let motion = level + gained * moved.old_from_new;
            let first = self.drifts[moved.node];
            Drift {
                old_from_new: (self.old_from_level[moved.node] * Pose::exp(&motion)).log(),
                covariance: doubt + gained * moved.covariance * gained.transpose(),
                began_s: first.map_or(began.onset.t_s, |first| first.began_s),
                began_sigma_s: first.map_or(began.sigma_s, |first| first.began_sigma_s),
                course: first.map_or(began.course(), |first| first.course),
                course_probability: first.map_or(began.course_probability, |first| first.course_probability),
                rate: None,
                again: None,
            }
        };
        let drifts = attribution.moved.iter().map(drift).collect();
        (!attribution.moved.is_empty()).then_some(Open { attribution, drifts })
    }

    /// From here on the test asks whether anything moves away from where it is now; where the moved cameras are is learned anew, because
    /// the alarm chose its frame set. A camera back at its reference is steady again.
    fn start_again(&mut self, open: &Open) {
        for (moved, drift) in open.attribution.moved.iter().zip(&open.drifts) {
            let camera = moved.node;
            let doubt = drift.covariance + self.typical.spread(camera) + self.own_covariance(camera);
            let diurnal = self.reference.noise[camera].diurnal;
            let at_home = drift.covariance * CHOSEN + self.own_covariance(camera) + diurnal;
            let is_back = self.drifts[camera].is_some() && is_likely(&drift.old_from_new, &at_home);
            self.drifts[camera] = (!is_back).then_some(Drift { covariance: doubt, ..*drift });
            self.old_from_level[camera] =
                if is_back { Pose::identity() } else { Pose::exp(&drift.old_from_new) };
        }
        self.alternatives = open.attribution.alternatives.clone();
        if !self.has_moved() {
            self.alternatives.clear();
        }
        self.noises.begin(RigFilter::new(&self.places(), &self.prior(), &self.reference.noise));
        (self.evidence, self.held, self.open) = (Evidence::default(), Held::default(), None);
        self.last_onset_s = f64::MIN;
    }

    /// The reference's covariance, with cameras that moved as widely known as the alarm left them.
    fn prior(&self) -> DMatrix<f64> {
        let mut covariance = self.reference.covariance.clone();
        for (camera, drift) in self.drifts.iter().enumerate() {
            let Some(drift) = drift else { continue };
            covariance.rows_mut(6 * camera, 6).fill(0.0);
            covariance.columns_mut(6 * camera, 6).fill(0.0);
            covariance.fixed_view_mut::<6, 6>(6 * camera, 6 * camera).copy_from(&drift.covariance);
        }
        covariance
    }

    fn own_covariance(&self, camera: usize) -> Matrix6 {
        self.reference.covariance.fixed_view::<6, 6>(6 * camera, 6 * camera).into()
    }

    /// How far, with all that has been read since the alarm.
    fn refined(&self, camera: usize, drift: &Drift) -> Drift {
        let (motion, covariance) = self.noises.level(camera);
        let old_from_new = (self.old_from_level[camera] * Pose::exp(&motion)).log();
        Drift { old_from_new, covariance: covariance + self.own_covariance(camera), ..*drift }
    }
}
