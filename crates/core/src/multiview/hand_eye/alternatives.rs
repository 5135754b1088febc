//! Mistakes that would explain why views disagree: other sizes, inverted gripper poses, another order of quaternions, another convention of
//! rotations, shifted rows.
//!
//! They are tried only where the answer is inconsistent: each alternative in which the rotations of camera and gripper agree is solved completely,
//! and named where it reduces the noise.

use super::causes::{HandEyeCause, large_noise};
use super::settle::{Effect, Settled, settled};
use super::shared::SharedError;
use super::views::{Known, located};
use super::written::RotationConvention;
use super::{Candidate, HandEyeConfig, HandEyeView, MAX_GRIPPER_SIGMA_BY_REACH, MAX_GRIPPER_SIGMA_RAD};
use crate::Pose;
use crate::locate::consistency::loses_too_many;

/// An alternative must reduce the noise to this share.
const MAX_PART: f64 = 0.5;
/// Number of corrections of a size: each squares the error.
const SIZE_ROUNDS: usize = 6;
/// Initial ratios: as given, and millimetres instead of metres on either side.
const UNIT_STARTS: [f64; 3] = [1.0, 1e-3, 1e3];
/// Relative change of the size below which it has converged.
const SETTLED_SIZE: f64 = 1e-4;

/// Returns the likely cause: the alternative with the least noise, where one is far better than the input.
pub(super) fn alternatives(
    views: &[HandEyeView],
    found: &Settled,
    config: &HandEyeConfig,
) -> Option<HandEyeCause> {
    of_known(views, &found.known, config)
}

/// Returns the likely cause for views that give no answer.
pub(super) fn of_unsettled(views: &[HandEyeView], config: &HandEyeConfig) -> Option<HandEyeCause> {
    of_known(views, &located(views, config).ok()?.0, config)
}

fn of_known(views: &[HandEyeView], known: &[Known], config: &HandEyeConfig) -> Option<HandEyeCause> {
    let plain = plain(views, known);
    let given = settled(&plain, config).ok().map_or(f64::INFINITY, |settled| badness(&settled));
    let mut all: Vec<(HandEyeCause, Vec<HandEyeView>)> = vec![
        (HandEyeCause::InvertedGripper, with_hands(&plain, |i| plain[i].base_from_gripper.inverse())),
        (HandEyeCause::QuaternionOrder, with_hands(&plain, |i| reordered(&plain[i].base_from_gripper, 1))),
        (HandEyeCause::QuaternionOrder, with_hands(&plain, |i| reordered(&plain[i].base_from_gripper, 3))),
    ];
    let transposed = |i: usize| {
        let written = plain[i].base_from_gripper;
        Pose::new(written.rotation.transpose(), written.translation)
    };
    all.push((HandEyeCause::TransposedRotation, with_hands(&plain, transposed)));
    for by in [-1isize, 1] {
        all.push((HandEyeCause::ShiftedRows(by), shifted(&plain, by)));
    }
    let solved = solved(all, config);
    let sized = UNIT_STARTS.into_iter().find_map(|start| size_from(&plain, start, config));
    let rewritten = best_convention(&plain, config);
    let rewritten = rewritten.map(|(noise, convention)| (noise, HandEyeCause::Convention(convention)));
    let best = solved.chain(sized).chain(rewritten).min_by(|a, b| a.0.total_cmp(&b.0));
    best.filter(|(noise, _)| *noise < f64::min(1.0, MAX_PART * given)).map(|(_, cause)| cause)
}

/// Returns the convention of the rotations' numbers that brings views together, if it is another one than that of the file.
pub(super) fn other_convention(views: &[HandEyeView], config: &HandEyeConfig) -> Option<RotationConvention> {
    let plain = plain(views, &located(views, config).ok()?.0);
    let (noise, convention) = best_convention(&plain, config)?;
    (noise < 1.0).then_some(convention)
}

/// Least noise, in units of the largest plausible one, at which the other conventions of rotations are tried although nothing else is wrong: 0.1
/// degrees or 0.1 % of the way. What another convention changes is far more.
const DOUBTFUL: f64 = 0.05;

/// Returns the convention that fits where the noise is plausible, but another convention explains most of it.
pub(super) fn better_convention(
    views: &[HandEyeView],
    found: &Settled,
    config: &HandEyeConfig,
) -> Option<HandEyeCause> {
    if !views.iter().any(|view| view.written.is_some()) {
        return None;
    }
    let plain = plain(views, &found.known);
    let given = badness(&settled(&plain, config).ok()?);
    if given < DOUBTFUL {
        return None;
    }
    let (noise, convention) = best_convention(&plain, config)?;
    (noise < MAX_PART * given).then_some(HandEyeCause::Convention(convention))
}

/// Returns the best of the other conventions and the noise with it.
fn best_convention(
    plain: &[HandEyeView<'static>],
    config: &HandEyeConfig,
) -> Option<(f64, RotationConvention)> {
    let written: Vec<_> = plain.iter().map(|view| view.written).collect::<Option<_>>()?;
    let given = written.first()?.convention;
    let others = RotationConvention::all().filter(|other| *other != given);
    let views = |convention| with_hands(plain, |i| written[i].base_from_gripper(convention));
    let all = others.map(|convention| (convention, views(convention))).collect();
    solved(all, config).min_by(|a, b| a.0.total_cmp(&b.0))
}

/// Differences of angles up to so many times the least, and by a tenth of the largest plausible noise more, may be due to chance.
const ANGLES_BY_LEAST: f64 = 2.0;
const ANGLES_BY_NOISE: f64 = 0.1;

/// Solves the alternatives whose rotations agree best, and returns the noise of each.
fn solved<T>(
    mut all: Vec<(T, Vec<HandEyeView<'static>>)>,
    config: &HandEyeConfig,
) -> impl Iterator<Item = (f64, T)> {
    let differences_rad: Vec<f64> = all.iter().map(|(_, views)| difference_of_angles_rad(views)).collect();
    let least_rad = differences_rad.iter().copied().fold(f64::INFINITY, f64::min);
    let most_rad = ANGLES_BY_LEAST * least_rad + ANGLES_BY_NOISE * MAX_GRIPPER_SIGMA_RAD;
    let mut agree = differences_rad.iter().map(|difference_rad| *difference_rad <= most_rad);
    all.retain(|_| agree.next() == Some(true));
    all.into_iter().filter_map(|(what, views)| Some((badness_of_alternative(&views, config)?, what)))
}

/// Returns by how much the angles of rotation between neighbouring views differ between camera and gripper, eq. (35): the lower quartile, because
/// both views of so many pairs are right where half of the views are.
fn difference_of_angles_rad(views: &[HandEyeView]) -> f64 {
    let difference = |pair: &[HandEyeView]| {
        let [a, b] = [&pair[0], &pair[1]];
        let gripper_rad = a.base_from_gripper.angle_to_rad(&b.base_from_gripper);
        let cameras = a.candidates.iter().flat_map(|a| b.candidates.iter().map(move |b| (a, b)));
        let camera_rad =
            |(a, b): (&Candidate, &Candidate)| a.cam_from_target.angle_to_rad(&b.cam_from_target);
        cameras.map(|of_two| (camera_rad(of_two) - gripper_rad).abs()).fold(f64::INFINITY, f64::min)
    };
    let mut all: Vec<f64> = views.windows(2).map(difference).collect();
    all.sort_by(f64::total_cmp);
    all.get(all.len() / 4).copied().unwrap_or(0.0)
}

/// Returns the size with which the views agree; the proven error itself where none is found.
pub(super) fn resized(
    views: &[HandEyeView],
    found: &Settled,
    larger: &Effect,
    config: &HandEyeConfig,
) -> HandEyeCause {
    let plain = plain(views, &found.known);
    let cause = size_from(&plain, 1.0, config).map(|(_, cause)| cause);
    cause.unwrap_or(HandEyeCause::Size { ratio: 1.0 + larger.part, sigma: larger.sigma })
}

/// Returns the views with poses only, and with unknown noise.
fn plain(views: &[HandEyeView], known: &[Known]) -> Vec<HandEyeView<'static>> {
    let view = |known: &Known| HandEyeView {
        base_from_gripper: views[known.index].base_from_gripper,
        gripper_covariance: None,
        written: views[known.index].written,
        candidates: known.candidates.clone(),
        seen: &[],
    };
    known.iter().map(view).collect()
}

fn with_hands(plain: &[HandEyeView<'static>], hand: impl Fn(usize) -> Pose) -> Vec<HandEyeView<'static>> {
    let view = |(i, view): (usize, &HandEyeView<'static>)| HandEyeView {
        base_from_gripper: hand(i),
        ..view.clone()
    };
    plain.iter().enumerate().map(view).collect()
}

/// Rotates the order of the quaternion's numbers.
fn reordered(pose: &Pose, by: usize) -> Pose {
    let mut numbers = pose.quaternion_wxyz();
    numbers.rotate_left(by);
    Pose::from_quaternion_wxyz(numbers, pose.translation)
}

/// Returns each view with the gripper pose `by` rows later; the ends have none.
fn shifted(plain: &[HandEyeView<'static>], by: isize) -> Vec<HandEyeView<'static>> {
    let of =
        |i: usize| i.checked_add_signed(by).and_then(|at| plain.get(at)).map(|view| view.base_from_gripper);
    let pair = |(i, view): (usize, &HandEyeView<'static>)| {
        Some(HandEyeView { base_from_gripper: of(i)?, ..view.clone() })
    };
    plain.iter().enumerate().filter_map(pair).collect()
}

/// Largest share of views that an alternative may leave out: among seven rows in disorder four may agree by chance, and with two of six left out
/// the four would represent all.
const MAX_LEFT_OUT: f64 = 0.2;

fn brings_together(settled: &Settled) -> bool {
    let n_views = settled.known.len() as f64;
    n_views - settled.used().len() as f64 <= MAX_LEFT_OUT * n_views
}

fn badness_of_alternative(views: &[HandEyeView], config: &HandEyeConfig) -> Option<f64> {
    settled(views, config).ok().filter(brings_together).map(|settled| badness(&settled))
}

/// Returns the disagreement of the views: the noise in units of the largest plausible one, infinite where many views contradict each other.
fn badness(settled: &Settled) -> f64 {
    let (n_views, n_used) = (settled.known.len(), settled.used().len());
    let Some([sigma_rad, sigma_m]) = settled.sigmas() else { return f64::INFINITY };
    if loses_too_many(n_views - n_used, n_views) {
        return f64::INFINITY;
    }
    (sigma_rad / MAX_GRIPPER_SIGMA_RAD).hypot(sigma_m / (MAX_GRIPPER_SIGMA_BY_REACH * settled.reach_m()))
}

/// Finds a ratio of sizes with which the views agree, and their agreement then.
fn size_from(
    plain: &[HandEyeView<'static>],
    start: f64,
    config: &HandEyeConfig,
) -> Option<(f64, HandEyeCause)> {
    let mut ratio = start;
    for _ in 0..SIZE_ROUNDS {
        let views = scaled(plain, ratio);
        let found = settled(&views, config).ok()?;
        let larger = found.effect(SharedError::Size, config)?;
        ratio *= 1.0 + larger.part;
        if !(0.0 < ratio && ratio.is_finite()) {
            return None;
        }
        if larger.part.abs() < SETTLED_SIZE + 0.1 * larger.sigma {
            let is_good = large_noise(&found).is_none() && brings_together(&found);
            let cause = HandEyeCause::Size { ratio, sigma: ratio * larger.sigma };
            return is_good.then(|| (badness(&found), cause));
        }
    }
    None
}

/// Returns the views with the target scaled by a ratio.
fn scaled(plain: &[HandEyeView<'static>], ratio: f64) -> Vec<HandEyeView<'static>> {
    let candidate = |candidate: &Candidate| {
        let mut scaled = *candidate;
        scaled.cam_from_target.translation *= ratio;
        let by = crate::Vector6::new(1.0, 1.0, 1.0, ratio, ratio, ratio);
        scaled.covariance = crate::Matrix6::from_fn(|i, j| candidate.covariance[(i, j)] * by[i] * by[j]);
        scaled
    };
    let view = |view: &HandEyeView<'static>| HandEyeView {
        candidates: view.candidates.iter().map(candidate).collect(),
        ..view.clone()
    };
    plain.iter().map(view).collect()
}
