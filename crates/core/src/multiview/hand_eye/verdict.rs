//! Decides whether the answer is consistent, and if not, why. docs/math/hand_eye.md section 7.

use super::alternatives::{alternatives, better_convention, resized};
use super::causes::{HandEyeCause, large_noise};
use super::consensus::fit_with_noise;
use super::cost::nearest;
use super::settle::{Effect, Settled};
use super::shared::SharedError;
use super::{HandEyeConfig, HandEyeView, TargetSize};
use crate::camera::BrownConrady;
use crate::explanation::Weighed;
use crate::locate::consistency::{is_inconsistent, loses_too_many, measured_scale};
use crate::multiview::intrinsics_check::{Group, IntrinsicsCheck, check_intrinsics, focal_length};
use crate::multiview::rig_pose::RigCost;
use crate::{Camera, Correspondence, Lens, Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, Matrix3, SVector};

/// Smaller errors of size do not make the answer wrong: their contribution enters the covariance.
const MAX_SIZE_ERROR: f64 = 0.01;
/// … and smaller errors of the focal length: right files of two robots of four seem 2 and 2.6 % off, by what else their poses share.
const MAX_FOCAL_ERROR: f64 = 0.04;
/// χ² with one degree of freedom, 4.5 standard deviations: a probability of 7e-6.
const PROVEN_CHI2: f64 = 20.25;
/// Corrections of intrinsics that move the rays by less (root mean square, relative to the focal length) do not make the answer wrong.
const MAX_RAY_SHIFT: f64 = 1e-3;
/// Probability of blaming correct intrinsics here: below that of the check itself, which only warns.
const MAX_INTRINSICS_P: f64 = 1e-5;
/// Standard deviation of an error of a size or of a lens where there is one.
const SHARED_SIGMA: f64 = 0.05;
/// Odds of each kind of shared error before the views are seen.
const SHARED_ODDS: f64 = 0.1;
/// Least gain of the log-likelihood of the gripper's motions by another lens, unless they contradict it: a coarse robot tells little.
pub(super) const CONFIRMED_GAIN: f64 = -3.0;
/// … and to this part the product of its two standard deviations must fall where other views agree.
pub(super) const CONFIRMED_NOISE: f64 = 0.5;

/// The causes, the most likely first, and the target's size as measured by the gripper.
pub(super) struct Verdict {
    pub causes: Vec<HandEyeCause>,
    pub size: Option<TargetSize>,
    /// The explanations of the views that are probable enough, none for the input as stated: the covariance holds the others.
    pub explanations: Vec<Weighed<Option<Effect>>>,
}

impl Verdict {
    /// Returns what a shared error adds to the covariance, 12×12: docs/math/hand_eye.md eq. (31).
    pub fn added(probability: f64, effect: &Effect) -> DMatrix<f64> {
        let shift = effect.shift * effect.shift.transpose();
        let open = effect.by_part * effect.by_part.transpose() * (effect.sigma * effect.sigma);
        DMatrix::from_fn(12, 12, |i, j| probability * (shift[(i, j)] + open[(i, j)]))
    }

    /// Returns the errors that all views may share, the most probable first, each with its probability.
    pub fn shared(&self) -> impl Iterator<Item = (f64, &Effect)> {
        shared(&self.explanations)
    }

    /// Returns the most probable shared error, where it is more probable than all else.
    pub fn likely(&self) -> Option<&Effect> {
        self.shared().find(|(probability, _)| 0.5 < *probability).map(|(_, effect)| effect)
    }
}

/// χ² of the poses for the stated or estimated noise, and of the pixels of single views.
pub(super) struct Residuals {
    pub poses: (f64, usize),
    pub pixels: (f64, usize),
    /// Root mean square of the pixels' residuals, relative to the focal length.
    pub rays: f64,
}

/// The camera that the pixels of all views fit better, where they contradict the given one.
pub(super) struct OtherLens {
    pub camera: Camera,
    /// The cause, where it matters.
    pub cause: HandEyeCause,
    /// Whether it moves the rays by more than those of good files, or the pixels contradict the given one.
    pub is_large: bool,
}

/// What another lens does to the answer.
pub(super) struct ByLens {
    /// By how much X and Z move.
    pub shift: SVector<f64, 12>,
    /// Whether the gripper's motions confirm it: ℓ of the poses does not fall, or their noise does.
    pub is_confirmed: bool,
}

/// Returns how a left motion of Z, about the base's or hand's origin, moves the target about its own, whose position is wanted.
fn about_target(settled: &Settled) -> Matrix6 {
    Pose::new(Matrix3::identity(), -settled.fit.poses.holder_from_target.translation).adjoint()
}

/// Returns the motions of X and Z, the latter about the target's origin.
fn motions(shift: &SVector<f64, 12>, settled: &Settled) -> [Vector6; 2] {
    [shift.fixed_rows::<6>(0).into_owned(), about_target(settled) * shift.fixed_rows::<6>(6)]
}

/// Returns whether a motion of X or that of Z matters.
fn is_beyond(shift: &SVector<f64, 12>, (covariance, settled, config): Beside) -> bool {
    let block = |at: usize| -> Matrix6 { covariance.fixed_view::<6, 6>(at, at).into_owned() };
    let ([of_x, of_z], there) = (motions(shift, settled), about_target(settled));
    config.tolerance.is_exceeded(&of_x, &block(0))
        || config.tolerance.is_exceeded(&of_z, &(there * block(6) * there.transpose()))
}

/// What a motion is judged beside: the covariance without shared errors, 12×12, and the answer.
type Beside<'a> = (&'a DMatrix<f64>, &'a Settled<'a>, &'a HandEyeConfig);

/// Decides about an answer of which `covariance`, 12×12, is that without shared errors.
pub(super) fn judged(
    views: &[HandEyeView],
    settled: &Settled,
    (residuals, covariance): (&Residuals, &DMatrix<f64>),
    of_lens: Option<(OtherLens, Option<ByLens>)>,
    config: &HandEyeConfig,
) -> Verdict {
    let beside = (covariance, settled, config);
    let ratio = |(chi2, degrees_of_freedom): (f64, usize)| (chi2 / degrees_of_freedom.max(1) as f64).sqrt();
    let contradicts = |(chi2, degrees_of_freedom): (f64, usize)| is_inconsistent(chi2, degrees_of_freedom);
    let mut seen = Vec::new();
    seen.extend(large_noise(settled));
    if contradicts(residuals.poses) {
        seen.push(HandEyeCause::StatedNoise { ratio: ratio(residuals.poses) });
    }
    let (n_rejected, n_views) = (settled.known.len() - settled.used().len(), settled.known.len());
    if loses_too_many(n_rejected, n_views) && rejected_matter((covariance, settled, config)) {
        seen.push(HandEyeCause::ManyContradict { n_rejected, n_views });
    }
    let effect = |error: SharedError| Some(widened(settled.effect(error, config)?, settled));
    let effects: Vec<Effect> = SharedError::ALL.into_iter().filter_map(effect).collect();
    let larger = effects.iter().find(|effect| effect.error == SharedError::Size);
    let size = larger.map(|larger| TargetSize { ratio: 1.0 + larger.part, sigma: larger.sigma });
    let explanations = explanations(effects, settled, config);
    let mut causes: Vec<HandEyeCause> =
        of_lens.and_then(|(lens, by)| blamed(lens, by.as_ref(), beside)).into_iter().collect();
    // A wrong lens may come with a wrong mounting, which contradicts the gripper's motions far more than the lens does.
    if !seen.is_empty() {
        causes.extend(alternatives(views, settled, config));
    }
    if causes.is_empty() && seen.is_empty() {
        causes.extend(better_convention(views, settled, config));
    }
    if causes.is_empty() && large_noise(settled).is_none() {
        causes.extend(wrong(views, &explanations, beside));
    }
    causes.append(&mut seen);
    if contradicts(residuals.pixels) && MAX_RAY_SHIFT < residuals.rays {
        causes.push(HandEyeCause::Pixels { ratio: ratio(residuals.pixels) });
    }
    Verdict { causes, size, explanations }
}

/// More than this part of the views is not left out by chance, whatever they say.
const MAX_REJECTED_PART: f64 = 0.25;

/// Returns whether the views that were left out would move the answer beyond its covariance, where the gripper's noise explains them too.
fn rejected_matter(beside: Beside) -> bool {
    let (_, settled, config) = beside;
    let mut known = settled.known.clone();
    let n_rejected = known.len() - settled.used().len();
    if MAX_REJECTED_PART * (known.len() as f64) < n_rejected as f64 {
        return true;
    }
    let poses = &settled.fit.poses;
    let all: Vec<(usize, usize)> =
        known.iter().enumerate().map(|(at, view)| (at, nearest(view, poses).0)).collect();
    let Ok((fit, _)) = fit_with_noise(poses, &mut known, &all, config) else { return true };
    is_beyond(&fit.poses.motion_from(poses), beside)
}

/// Returns the cause that the pixels give, unless it moves the camera by no more than its covariance, or the gripper's motions do not confirm it.
fn blamed(lens: OtherLens, by_lens: Option<&ByLens>, beside: Beside) -> Option<HandEyeCause> {
    let is_fault = match by_lens {
        Some(by) => {
            let is_judged = lens.is_large || beside.2.tolerance.is_stated();
            is_judged && by.is_confirmed && is_beyond(&by.shift, beside)
        }
        None => lens.is_large,
    };
    is_fault.then_some(lens.cause)
}

fn shared(explanations: &[Weighed<Option<Effect>>]) -> impl Iterator<Item = (f64, &Effect)> {
    explanations.iter().filter_map(|one| Some((one.probability, one.what.as_ref()?)))
}

/// Returns the explanations of the views that are probable enough, the most probable first, eq. (30): the input as stated, and errors that all views share.
fn explanations(
    mut effects: Vec<Effect>,
    settled: &Settled,
    config: &HandEyeConfig,
) -> Vec<Weighed<Option<Effect>>> {
    let mut all = vec![Weighed::new(None, 0.0, vec![Vector6::zeros(); 2])];
    if let Some(without) = settled.log_likelihood(config) {
        let scale = settled.scale();
        let log_odds =
            |effect: &Effect| (SHARED_ODDS / SHARED_SIGMA).ln() + (effect.log_likelihood - without) / scale;
        effects.retain(|effect| {
            let is_measured = effect.error != SharedError::Size || settled.measures_size();
            is_measured && effect.sigma < SHARED_SIGMA && log_odds(effect).is_finite()
        });
        let of = |effect: Effect| {
            let motions = motions(&effect.shift, settled).to_vec();
            Weighed::new(Some(effect.clone()), log_odds(&effect), motions)
        };
        all.extend(effects.into_iter().map(of));
    }
    Weighed::weigh(&mut all);
    all.retain(Weighed::is_probable);
    all
}

/// Returns the shared errors that explain the views and move the answer beyond its covariance, the most probable first; none unless the most probable is
/// proven and large.
fn wrong(
    views: &[HandEyeView],
    explanations: &[Weighed<Option<Effect>>],
    beside: Beside,
) -> Vec<HandEyeCause> {
    let (_, settled, config) = beside;
    let matters = |(probability, effect): (f64, &Effect)| {
        let most = if effect.error == SharedError::Size { MAX_SIZE_ERROR } else { MAX_FOCAL_ERROR };
        let is_large = is_proven(effect, settled) && most < effect.part.abs();
        let is_best = 0.5 < probability && config.tolerance.is_stated();
        (is_large || is_best) && is_beyond(&effect.shift, beside)
    };
    if !shared(explanations).next().is_some_and(matters) {
        return Vec::new();
    }
    let cause = |(_, effect): (f64, &Effect)| match effect.error {
        SharedError::Size => resized(views, settled, effect, config),
        SharedError::Lens(error) => HandEyeCause::Lens { error, part: effect.part, sigma: effect.sigma },
    };
    shared(explanations).map(cause).collect()
}

/// Widens the uncertainty of an error as that of the answer.
fn widened(effect: Effect, settled: &Settled) -> Effect {
    Effect { sigma: effect.sigma * settled.scale().sqrt(), ..effect }
}

/// Returns whether the error exceeds chance; with few views the noise itself is uncertain, and t replaces the normal distribution, eq. (26).
fn is_proven(effect: &Effect, settled: &Settled) -> bool {
    let redundancy = f64::max(1.0, 3.0 * settled.used().len() as f64 - 7.0);
    let t = effect.part / effect.sigma;
    PROVEN_CHI2 < redundancy * (t * t / redundancy).ln_1p()
}

/// Returns χ² and redundancy of single views, each with a pose of its own, and the root mean square of their residuals relative to the focal length.
pub(super) fn pixels(settled: &Settled) -> ((f64, usize), f64) {
    let used = settled.used();
    let all = used.iter().filter_map(|(view, candidate)| settled.known[*view].pixels(*candidate));
    let sum = all.fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    let (mut squares, mut n) = (0.0, 0usize);
    for (view, candidate) in used {
        let view = &settled.known[view];
        let focal = view.seen.iter().map(|one| focal_length(&one.camera.parameters())).fold(0.0, f64::max);
        let rms_px = RigCost::new(view.seen).residual_sums(&view.candidates[candidate].cam_from_target).1;
        if 0.0 < focal && rms_px.is_finite() {
            (squares, n) = (squares + (rms_px / focal).powi(2), n + 1);
        }
    }
    (sum, (squares / n.max(1) as f64).sqrt())
}

/// Tests the intrinsics where one camera saw every view. Where the pixels contradict them, returns the camera that they fit better, and the cause if it
/// moves the rays.
pub(super) fn other_lens(settled: &Settled, pixels: (f64, usize)) -> Option<OtherLens> {
    let camera = Some(settled.only_camera()?);
    // Noise that is stated too large would hide the lens.
    let scale = f64::min(1.0, measured_scale(pixels.0, pixels.1)).sqrt();
    let frame = |(view, _): &(usize, usize)| -> Vec<Correspondence> {
        let seen = settled.known[*view].seen.iter().flat_map(|one| one.seen);
        seen.map(|c| Correspondence { sigma_px: c.sigma_px * scale, ..*c }).collect()
    };
    let frames: Vec<Vec<Correspondence>> = settled.used().iter().map(frame).collect();
    let is_certain = is_inconsistent(pixels.0, pixels.1);
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
    let matters =
        check.p_value < MAX_INTRINSICS_P && MAX_RAY_SHIFT < offset_of_rays(settled, camera, &check, &frames);
    let groups = check.blamed.iter().map(|blame| blame.group).collect();
    let blamed = check.blamed.iter().flat_map(|blame| &blame.parameters);
    let focal = blamed.filter(|doubt| ["f", "fx_px"].contains(&doubt.name));
    let focal_ratio = focal.map(|doubt| 1.0 + doubt.offset / doubt.given).next();
    Some(OtherLens {
        camera: better,
        cause: HandEyeCause::Intrinsics { groups, focal_ratio },
        is_large: matters || is_certain,
    })
}

/// Returns what to add to each parameter, zero where it is not blamed.
fn offsets(camera: &Camera, check: &IntrinsicsCheck) -> Vec<f64> {
    let blamed: Vec<_> = check.blamed.iter().flat_map(|blame| &blame.parameters).collect();
    let offset =
        |name: &str| blamed.iter().find(|doubt| doubt.name == name).map_or(0.0, |doubt| doubt.offset);
    camera.parameters().iter().map(|(name, _)| offset(name)).collect()
}

/// Returns by how much the blamed offsets move the rays relative to the focal length: a focal length by all of its offset, since no pose makes up for it;
/// others by what the residuals show of theirs.
fn offset_of_rays(
    settled: &Settled,
    camera: &Camera,
    check: &IntrinsicsCheck,
    frames: &[Vec<Correspondence>],
) -> f64 {
    if check.blamed.iter().any(|blame| blame.group == Group::FocalLength) {
        return ray_shift(settled, camera, check);
    }
    let (n, variance) =
        frames.iter().flatten().fold((0.0, 0.0), |(n, sum), c| (n + 1.0, sum + c.sigma_px * c.sigma_px));
    let chi2 = check.statistic * check.noise_scale;
    (chi2 * variance / n).sqrt() / n.sqrt() / focal_length(&camera.parameters())
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
