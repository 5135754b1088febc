//! Decides whether the answer is consistent, and if not, why. docs/math/hand_eye.md section 7.

use super::alternatives::{alternatives, better_convention, resized};
use super::causes::{HandEyeCause, large_noise};
use super::settle::{Larger, Settled};
use super::{HandEyeConfig, HandEyeView, TargetSize};
use crate::camera::BrownConrady;
use crate::locate::consistency::{is_inconsistent, loses_too_many};
use crate::multiview::intrinsics_check::{IntrinsicsCheck, check_intrinsics};
use crate::multiview::rig_pose::RigCost;
use crate::{Camera, Correspondence, Lens};

/// Smaller errors of size do not make the answer wrong: their contribution enters the covariance.
pub(crate) const MAX_SIZE_ERROR: f64 = 0.005;
/// χ² with one degree of freedom, 4.5 standard deviations: a probability of 7e-6.
const SIZE_CHI2: f64 = 20.25;
/// Corrections of intrinsics that move the rays by less (root mean square, relative to the focal length) do not make the answer wrong.
const MAX_RAY_SHIFT: f64 = 1e-3;
/// Probability of blaming correct intrinsics here: below that of the check itself, which only warns.
const MAX_INTRINSICS_P: f64 = 1e-5;

/// The causes, the most likely first, and the target's size as measured by the gripper.
pub(super) struct Verdict {
    pub causes: Vec<HandEyeCause>,
    pub size: Option<TargetSize>,
    /// An error of size that is proven, but small.
    pub small: Option<Larger>,
    /// The camera that the pixels of all views fit better, where they contradict the given one.
    pub lens: Option<Camera>,
}

/// χ² of the poses for the stated or estimated noise.
pub(super) struct Residuals {
    pub poses: (f64, usize),
    pub pixels: (f64, usize),
}

pub(super) fn judged(
    views: &[HandEyeView],
    settled: &Settled,
    residuals: &Residuals,
    config: &HandEyeConfig,
) -> Verdict {
    let ratio = |(chi2, degrees_of_freedom): (f64, usize)| (chi2 / degrees_of_freedom.max(1) as f64).sqrt();
    let contradicts = |(chi2, degrees_of_freedom): (f64, usize)| is_inconsistent(chi2, degrees_of_freedom);
    let mut seen = Vec::new();
    seen.extend(large_noise(settled));
    if contradicts(residuals.poses) {
        seen.push(HandEyeCause::StatedNoise { ratio: ratio(residuals.poses) });
    }
    let (n_rejected, n_views) = (settled.known.len() - settled.used().len(), settled.known.len());
    if loses_too_many(n_rejected, n_views) {
        seen.push(HandEyeCause::ManyContradict { n_rejected, n_views });
    }
    let larger = settled.larger(config).map(|larger| widened(larger, settled, residuals));
    let proven = larger.filter(|larger| settled.measures_size() && is_proven(larger, settled));
    let wrong = proven.filter(|larger| MAX_SIZE_ERROR < larger.part.abs());
    let (lens, of_lens) = intrinsics(settled, contradicts(residuals.pixels)).unzip();
    let mut causes: Vec<HandEyeCause> = of_lens.flatten().into_iter().collect();
    if causes.is_empty() && !seen.is_empty() {
        causes.extend(alternatives(views, settled, config));
    }
    if causes.is_empty() && seen.is_empty() {
        causes.extend(better_convention(views, settled, config));
    }
    if let (true, Some(larger)) = (causes.is_empty() && large_noise(settled).is_none(), wrong) {
        causes.push(resized(views, settled, &larger, config));
    }
    causes.append(&mut seen);
    if contradicts(residuals.pixels) {
        causes.push(HandEyeCause::Pixels { ratio: ratio(residuals.pixels) });
    }
    let size = larger.map(|larger| TargetSize { ratio: 1.0 + larger.part, sigma: larger.sigma });
    Verdict { causes, size, small: proven.filter(|_| wrong.is_none()), lens }
}

/// Widens the uncertainty of the size where the stated noise is too small.
fn widened(larger: Larger, settled: &Settled, residuals: &Residuals) -> Larger {
    let scale = match settled.variances {
        Some(_) => 1.0,
        None => crate::locate::consistency::noise_scale(residuals.poses.0, residuals.poses.1),
    };
    Larger { sigma: larger.sigma * scale.sqrt(), ..larger }
}

/// Returns whether the error exceeds chance; with few views the noise itself is uncertain, and t replaces the normal distribution, eq. (26).
fn is_proven(larger: &Larger, settled: &Settled) -> bool {
    let redundancy = f64::max(1.0, 3.0 * settled.used().len() as f64 - 7.0);
    let t = larger.part / larger.sigma;
    SIZE_CHI2 < redundancy * (t * t / redundancy).ln_1p()
}

/// Returns χ² and redundancy of single views, each with a pose of its own.
pub(super) fn pixels(settled: &Settled) -> (f64, usize) {
    let of_view = |(view, candidate): &(usize, usize)| {
        let view = &settled.known[*view];
        let cost = RigCost::new(view.seen);
        let chi2 = cost.residual_sums(&view.candidates[*candidate].cam_from_target).0;
        let redundancy = (2 * cost.n_points()).saturating_sub(6);
        (chi2.is_finite() && 0 < redundancy).then_some((chi2, redundancy))
    };
    let all = settled.used();
    all.iter().filter_map(of_view).fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1))
}

/// Tests the intrinsics where one camera saw every view. Where the pixels contradict them, returns the camera that they fit better, and the cause if it
/// matters.
fn intrinsics(settled: &Settled, is_certain: bool) -> Option<(Camera, Option<HandEyeCause>)> {
    let mut camera: Option<&Camera> = None;
    let mut frames: Vec<&[Correspondence]> = Vec::new();
    for (view, _) in settled.used() {
        let [only] = settled.known[view].seen else { return None };
        if camera.is_some_and(|camera| camera != only.camera) {
            return None;
        }
        camera = Some(only.camera);
        frames.push(only.seen);
    }
    // A lens without distortion is tested for distortion too.
    let with_distortion = match &camera?.lens {
        Lens::Pinhole(pinhole) => BrownConrady::new(pinhole.matrix, &[0.0; 4]).ok(),
        _ => None,
    };
    let camera = &match with_distortion {
        Some(lens) => Camera { lens: Lens::BrownConrady(lens), size: camera?.size },
        None => camera?.clone(),
    };
    let check = check_intrinsics(&frames, camera).ok()?;
    if check.blamed.is_empty() {
        return None;
    }
    let values: Vec<f64> =
        camera.parameters().iter().zip(offsets(camera, &check)).map(|((_, x), offset)| x + offset).collect();
    let better = camera.with_parameters(&values).ok()?;
    let matters = check.p_value < MAX_INTRINSICS_P && MAX_RAY_SHIFT < ray_shift(settled, camera, &check);
    if !matters && !is_certain {
        return Some((better, None));
    }
    let groups = check.blamed.iter().map(|blame| blame.group).collect();
    let blamed = check.blamed.iter().flat_map(|blame| &blame.parameters);
    let focal = blamed.filter(|doubt| ["f", "fx_px"].contains(&doubt.name));
    let focal_ratio = focal.map(|doubt| 1.0 + doubt.offset / doubt.given).next();
    Some((better, Some(HandEyeCause::Intrinsics { groups, focal_ratio })))
}

/// Returns what to add to each parameter, zero where it is not blamed.
fn offsets(camera: &Camera, check: &IntrinsicsCheck) -> Vec<f64> {
    let blamed: Vec<_> = check.blamed.iter().flat_map(|blame| &blame.parameters).collect();
    let offset =
        |name: &str| blamed.iter().find(|doubt| doubt.name == name).map_or(0.0, |doubt| doubt.offset);
    camera.parameters().iter().map(|(name, _)| offset(name)).collect()
}

/// Returns the root mean square motion of the pixels due to the blamed offsets, relative to the focal length.
fn ray_shift(settled: &Settled, camera: &Camera, check: &IntrinsicsCheck) -> f64 {
    let parameters = camera.parameters();
    let offsets = offsets(camera, check);
    let focal = parameters.iter().find(|(name, _)| ["f", "fx_px"].contains(name)).map_or(f64::NAN, |p| p.1);
    let (mut sum, mut n) = (0.0, 0usize);
    for (view, candidate) in settled.used() {
        let view = &settled.known[view];
        let pose = view.candidates[candidate].cam_from_target;
        for c in view.seen.iter().flat_map(|one| one.seen) {
            let columns = camera.intrinsics_jacobian(&(pose * c.x_in_target)).unwrap_or_default();
            let moved: nalgebra::Vector2<f64> =
                columns.iter().zip(&offsets).map(|(by, offset)| by * *offset).sum();
            (sum, n) = (sum + moved.norm_squared(), n + 1);
        }
    }
    (sum / n.max(1) as f64).sqrt() / focal
}
