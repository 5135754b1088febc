//! Places and noise of a rig, learned from frame sets while all is well.
//!
//! ```text
//!   v_c  residual of a camera from the weighted mean of its star, rig frame     ρ_c = 6 − tr((ΣW)⁻¹ W_c)  its redundancy
//!   s_c² = Σ v_cᵀ W_c v_c / Σ ρ_c, repeated        docs/math/monitor.md eqs. (26)–(28)
//! ```

use super::RigReference;
use super::filter::ObservationNoise;
use super::star::{CameraReading, TargetObservation, inverse, star};
use crate::multiview::rig::{Observation, RigConfig, RigProblem, solve_rig};
use crate::temporal::monitor::learn::{LEAST_READINGS, LearnConfig};
use crate::temporal::monitor::priors::{MEDIAN, OUTLIER};
use crate::temporal::monitor::unsettled::{self, Found, Sample, Unrest, Unsettled};
use crate::{Camera, Error, Matrix6, Pose, Vector6};
use nalgebra::DMatrix;

/// What all cameras saw at one time.
#[derive(Debug, Clone)]
pub struct FrameSet<'a> {
    /// When, seconds.
    pub t_s: f64,
    /// Of any cameras and targets.
    pub target_observations: Vec<TargetObservation<'a>>,
}

/// Rounds of weighting.
const ROUNDS: usize = 8;
/// Sights of a camera below which its noise is taken to be that of all cameras.
const FEW: usize = 10;
/// Residuals much smaller than the sigmas say are luck or a detector that smooths: at most this much is believed.
const LEAST_SCALE: f64 = 0.25;

/// Estimates the extrinsics from frame sets in which cameras observe targets together, and the noise of an observation.
///
/// # Errors
/// `TooFewPoints` for fewer than twenty frame sets in which two cameras see a target; those of `solve_rig`.
pub fn learn_rig(
    lenses: &[Camera],
    frame_sets: &[FrameSet],
    config: &LearnConfig,
) -> Result<RigReference, Error> {
    let shared = frame_sets.iter().filter(|frame_set| 2 <= frame_set.target_observations.len()).count();
    if shared < LEAST_READINGS {
        return Err(Error::TooFewPoints { seen: shared, needed: LEAST_READINGS });
    }
    let solution = solve(lenses, frame_sets)?;
    let cam_from_rig: Vec<Pose> = solution.cameras.iter().map(|camera| camera.cam_from_rig).collect();
    let noise = learn_observation_noise(&cam_from_rig, frame_sets, config);
    let n = 6 * lenses.len();
    let covariance = solution.joint_covariance.unwrap_or_else(|| DMatrix::zeros(n, n));
    // The adjustment took every pixel's error for its own and for new in every frame set.
    let span_s = frame_sets.last().zip(frame_sets.first()).map_or(0.0, |(last, first)| last.t_s - first.t_s);
    let of = |noise: &ObservationNoise| {
        let independent = (0.5 * span_s / noise.correlated_time_s).max(1.0).min(frame_sets.len() as f64);
        noise.white + noise.correlated * frame_sets.len() as f64 / independent
    };
    let widest = noise.iter().map(of).fold(solution.noise_scale, f64::max) / solution.noise_scale;
    Ok(RigReference { cam_from_rig, covariance: covariance * widest, noise })
}

/// A camera that moved, relative to the others, while the places of a rig were learned.
#[derive(Debug, Clone, PartialEq)]
pub struct RigUnsettled {
    /// Which.
    pub camera: usize,
    /// Others of which one may have moved instead: of two cameras it cannot be known which.
    pub alternatives: Vec<usize>,
    /// How; `reading` counts frame sets.
    pub unsettled: Unsettled,
}

/// Which camera moved amid these frame sets; none where they may be a reference. The cameras need only be near `cam_from_rig`. What is found
/// falsely is, over all cameras, at most once in `1 / FALSE_ALARM_PROBABILITY` tests: docs/math/monitor.md section 8.
pub fn unsettled_rig(
    cam_from_rig: &[Pose],
    frame_sets: &[FrameSet],
    config: &LearnConfig,
) -> Option<RigUnsettled> {
    config.check().ok()?;
    let of_frame_set = |(i, frame_set)| stars(frame_set, cam_from_rig).into_iter().map(move |star| (i, star));
    let stars: Vec<(usize, (f64, Vec<CameraReading>))> =
        frame_sets.iter().enumerate().flat_map(of_frame_set).collect();
    let n = cam_from_rig.len();
    let series: Vec<Vec<(usize, Sample)>> =
        (0..n).map(|camera| relative_motions(camera, &stars, cam_from_rig)).collect();
    let found = |camera: usize| {
        let samples: Vec<Sample> = series[camera].iter().map(|(_, sample)| *sample).collect();
        // Frames of cameras that do not fire together wander as the target is carried: that is noise here, and is learned as such.
        let found = unsettled::find(&samples, config, n).filter(|found| found.unrest != Unrest::Wander)?;
        Some((camera, found, samples))
    };
    let mut all: Vec<(usize, Found, Vec<Sample>)> = (0..n).filter_map(found).collect();
    all.sort_by(|a, b| b.1.log_evidence.total_cmp(&a.1.log_evidence));
    let (camera, found, samples) = all.first()?;
    let is_alternative =
        |other: &&(usize, Found, Vec<Sample>)| found.log_evidence - ALTERNATIVE < other.1.log_evidence;
    Some(RigUnsettled {
        camera: *camera,
        alternatives: all[1..].iter().filter(is_alternative).map(|other| other.0).collect(),
        unsettled: unsettled::described(found, samples, config, series[*camera][found.sample].0),
    })
}

/// Of two cameras the one for which the readings are e⁹ times as likely is the one that moved: as Δχ² = 18 elsewhere.
const ALTERNATIVE: f64 = 9.0;

/// Where a camera is, in its own old frame, against what the others of each star say, with the frame set of each.
fn relative_motions(
    camera: usize,
    stars: &[(usize, (f64, Vec<CameraReading>))],
    cam_from_rig: &[Pose],
) -> Vec<(usize, Sample)> {
    let rig_from_cam: Vec<Matrix6> = cam_from_rig.iter().map(|place| place.inverse().adjoint()).collect();
    let own_from_rig = cam_from_rig[camera].adjoint();
    let (scales, offsets) = (vec![1.0; rig_from_cam.len()], vec![Vector6::zeros(); rig_from_cam.len()]);
    let sample = |(frame_set, (t_s, star)): &(usize, (f64, Vec<CameraReading>))| {
        let own = star.iter().find(|reading| reading.camera == camera)?;
        let others: Vec<CameraReading> =
            star.iter().copied().filter(|reading| reading.camera != camera).collect();
        let weighted = weighted(&others, &rig_from_cam, &scales, &offsets);
        let spread = inverse(&weighted.iter().map(|(w, _)| w).sum())?;
        let mean = spread * weighted.iter().map(|(w, z)| w * z).sum::<Vector6>();
        let motion = own.motion - own_from_rig * mean;
        let covariance = own.covariance + own_from_rig * spread * own_from_rig.transpose();
        Some((*frame_set, Sample { t_s: *t_s, motion, covariance }))
    };
    stars.iter().filter_map(sample).collect()
}

fn solve(lenses: &[Camera], frame_sets: &[FrameSet]) -> Result<crate::multiview::rig::RigSolution, Error> {
    let target_observations = || {
        frame_sets
            .iter()
            .enumerate()
            .flat_map(|(view, m)| m.target_observations.iter().map(move |g| (view, g)))
    };
    let n_targets =
        target_observations().map(|(_, target_observation)| target_observation.target + 1).max().unwrap_or(0);
    let observations: Vec<Observation> = target_observations()
        .map(|(view, target_observation)| Observation {
            camera: target_observation.camera,
            view,
            target: target_observation.target,
            seen: target_observation.seen.to_vec(),
        })
        .collect();
    let body_of_target: Vec<usize> = (0..n_targets).collect();
    let problem = RigProblem {
        cameras: lenses,
        body_of_target: &body_of_target,
        n_views: frame_sets.len(),
        observations: &observations,
    };
    solve_rig(&problem, &RigConfig { joint_covariance: true, ..RigConfig::default() })
}

/// A residual of one camera in one frame set.
struct Residual {
    t_s: f64,
    camera: usize,
    /// In units of the stated noise: white if that is true.
    whitened: Vector6,
    redundancy: f64,
}

/// Estimates the noise of each camera's observations from their agreement at the estimated extrinsics.
pub fn learn_observation_noise(
    cam_from_rig: &[Pose],
    frame_sets: &[FrameSet],
    config: &LearnConfig,
) -> Vec<ObservationNoise> {
    let stars: Vec<(f64, Vec<CameraReading>)> =
        frame_sets.iter().flat_map(|frame_set| stars(frame_set, cam_from_rig)).collect();
    let rig_from_cam: Vec<Matrix6> = cam_from_rig.iter().map(|place| place.inverse().adjoint()).collect();
    let mut scales = vec![1.0; cam_from_rig.len()];
    let mut offsets = vec![Vector6::zeros(); cam_from_rig.len()];
    let mut residuals = Vec::new();
    for _ in 0..ROUNDS {
        residuals =
            stars.iter().flat_map(|star| residuals_of(star, &rig_from_cam, &scales, &offsets)).collect();
        scales = new_scales(&residuals, &scales);
        offsets = new_offsets(&stars, &rig_from_cam, &scales, &offsets);
    }
    (0..cam_from_rig.len()).map(|camera| noise(camera, scales[camera], &residuals, config)).collect()
}

/// The stars of a frame set, one a target.
pub(super) fn stars(frame_set: &FrameSet, cam_from_rig: &[Pose]) -> Vec<(f64, Vec<CameraReading>)> {
    let mut targets: Vec<usize> =
        frame_set.target_observations.iter().map(|target_observation| target_observation.target).collect();
    targets.sort_unstable();
    targets.dedup();
    let of = |target: usize| {
        let is_own = |target_observation: &TargetObservation| {
            target_observation.target == target && target_observation.camera < cam_from_rig.len()
        };
        let own: Vec<TargetObservation> =
            frame_set.target_observations.iter().copied().filter(is_own).collect();
        (frame_set.t_s, star(&own, cam_from_rig))
    };
    targets.into_iter().map(of).filter(|(_, star)| 2 <= star.len()).collect()
}

/// Information and motion of each observation in the rig frame.
fn weighted(
    star: &[CameraReading],
    rig_from_cam: &[Matrix6],
    scales: &[f64],
    offsets: &[Vector6],
) -> Vec<(Matrix6, Vector6)> {
    let of = |reading: &CameraReading| {
        let ad = &rig_from_cam[reading.camera];
        let information = inverse(&(ad * reading.covariance * ad.transpose() * scales[reading.camera]));
        (information.unwrap_or_else(Matrix6::zeros), ad * (reading.motion - offsets[reading.camera]))
    };
    star.iter().map(of).collect()
}

fn residuals_of(
    (t_s, star): &(f64, Vec<CameraReading>),
    rig_from_cam: &[Matrix6],
    scales: &[f64],
    offsets: &[Vector6],
) -> Vec<Residual> {
    let weighted = weighted(star, rig_from_cam, scales, offsets);
    let Some(spread) = inverse(&weighted.iter().map(|(w, _)| w).sum()) else { return Vec::new() };
    let mean = spread * weighted.iter().map(|(w, z)| w * z).sum::<Vector6>();
    let residual = |(reading, (w, z)): (&CameraReading, &(Matrix6, Vector6))| {
        let factor = w.cholesky()?.l().transpose() * scales[reading.camera].sqrt();
        let redundancy = 6.0 - (spread * w).trace();
        Some(Residual { t_s: *t_s, camera: reading.camera, whitened: factor * (z - mean), redundancy })
    };
    star.iter().zip(&weighted).filter_map(residual).collect()
}

/// Variance components, outliers left out; cameras seen seldom have the noise of all.
fn new_scales(residuals: &[Residual], before: &[f64]) -> Vec<f64> {
    let scale = |own: &dyn Fn(&&Residual) -> bool| {
        let chosen: Vec<&Residual> = residuals.iter().filter(own).filter(|r| 0.5 < r.redundancy).collect();
        let mut sizes: Vec<f64> =
            chosen.iter().map(|r| r.whitened.norm_squared() * 6.0 / r.redundancy).collect();
        sizes.sort_by(f64::total_cmp);
        let typical = sizes.get(sizes.len() / 2).map_or(1.0, |median| (median / MEDIAN).max(LEAST_SCALE));
        let kept =
            chosen.iter().filter(|r| r.whitened.norm_squared() * 6.0 / r.redundancy < OUTLIER * typical);
        let (sum, redundancy) = kept.fold((0.0, 0.0), |(sum, redundancy), r| {
            (sum + r.whitened.norm_squared(), redundancy + r.redundancy)
        });
        (sizes.len(), if 0.0 < redundancy { sum / redundancy } else { 1.0 })
    };
    let (_, all) = scale(&|_| true);
    let of = |(camera, before): (usize, &f64)| {
        let (n, own) = scale(&|residual| residual.camera == camera);
        // Half way each round: two cameras that only see each other push their noise to and fro otherwise.
        (before * if n < FEW { all } else { own }.max(LEAST_SCALE)).sqrt()
    };
    before.iter().enumerate().map(of).collect()
}

/// What lasts through all frame sets is no noise: each camera's mean, relative to the others, one camera after the other.
fn new_offsets(
    stars: &[(f64, Vec<CameraReading>)],
    rig_from_cam: &[Matrix6],
    scales: &[f64],
    before: &[Vector6],
) -> Vec<Vector6> {
    let mut offsets = before.to_vec();
    for camera in 1..offsets.len() {
        let (mut normal, mut score) = (Matrix6::zeros(), Vector6::zeros());
        for (_, star) in stars {
            let weighted = weighted(star, rig_from_cam, scales, &offsets);
            let Some(own) = star.iter().position(|reading| reading.camera == camera) else { continue };
            let others = || weighted.iter().enumerate().filter(|(i, _)| *i != own).map(|(_, both)| both);
            let Some(spread) = inverse(&others().map(|(w, _)| w).sum()) else { continue };
            let mean = spread * others().map(|(w, z)| w * z).sum::<Vector6>();
            let Some(own_spread) = inverse(&weighted[own].0) else { continue };
            let Some(information) = inverse(&(spread + own_spread)) else { continue };
            normal += information;
            score += information * (weighted[own].1 - mean);
        }
        let step = inverse(&normal).map(|covariance| covariance * score);
        let cam_from_rig = rig_from_cam[camera].try_inverse();
        if let Some((step, cam_from_rig)) = step.zip(cam_from_rig) {
            offsets[camera] += cam_from_rig * step;
        }
    }
    offsets
}

/// The correlated part of a camera's noise: the correlation of neighbours, and the lag at which it has fallen to 1/e of that.
fn noise(camera: usize, scale: f64, residuals: &[Residual], config: &LearnConfig) -> ObservationNoise {
    let own: Vec<&Residual> = residuals.iter().filter(|r| r.camera == camera).collect();
    let kept: Vec<&&Residual> = own.iter().filter(|r| r.whitened.norm_squared() < OUTLIER * scale).collect();
    let power = kept.iter().map(|r| r.whitened.norm_squared()).sum::<f64>() / kept.len().max(1) as f64;
    let correlation = |lag: usize| {
        let pairs = kept.iter().zip(kept.iter().skip(lag));
        let sum: f64 = pairs.map(|(now, later)| now.whitened.dot(&later.whitened)).sum();
        sum / (kept.len().saturating_sub(lag).max(1) as f64 * power)
    };
    let span_s = kept.last().zip(kept.first()).map_or(0.0, |(last, first)| last.t_s - first.t_s);
    let step_s = span_s / kept.len().saturating_sub(1).max(1) as f64;
    // One standard error is added: too little that lasts is worse than too much.
    let error = 1.0 / (6.0 * kept.len().max(1) as f64).sqrt();
    let first = if kept.len() < FEW { 0.5 } else { (correlation(1) + error).clamp(0.0, 0.95) };
    let half = kept.len() / 2;
    let memory = (2..half).find(|lag| correlation(*lag) < first / std::f64::consts::E).unwrap_or(half.max(2));
    let correlated_time_s = (memory as f64 * step_s).max(f64::MIN_POSITIVE.sqrt());
    // Neighbours share what is left after one step.
    let correlated = (first * (step_s / correlated_time_s).exp()).min(0.95);
    ObservationNoise {
        white: scale * (1.0 - correlated),
        correlated: scale * correlated,
        correlated_time_s,
        bias: config.bias,
        diurnal: config.diurnal,
    }
}
