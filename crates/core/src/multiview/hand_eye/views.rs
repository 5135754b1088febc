//! The data of each view, in one form for both mountings, with coordinates of moderate size.
//!
//! A vehicle's base may be a map with coordinates of millions of metres: the origin of the moving side is moved to the mean of the robot poses,
//! so that no lever arm is longer than the scene. docs/math/hand_eye.md eqs. (2), (3).

use super::{Candidate, HandEyeConfig, HandEyeView, HandEyeViewResult, Mounting, RejectedView};
use crate::covariance::is_covariance;
use crate::locate::consistency::measured_scale;
use crate::multiview::relative::{check_pose, information_of};
use crate::multiview::rig_pose::{RigAmbiguity, RigCost, RigView, check_views, locate_rig};
use crate::{Error, Matrix6, Pose, Vector6};
use nalgebra::{DMatrix, Matrix3, SMatrix, SVector, Vector3};

/// Kinds of noise: the gripper's orientation about its own origin (rad²), its orientation about the base's origin (rad²), as of the first joints
/// of an arm, and its position (m²), each the variance per axis.
pub(super) const KINDS: usize = 3;
/// The kind that takes part only where the views need it.
pub(super) const IN_BASE: usize = 1;

/// A view with at least one candidate.
#[derive(Clone)]
pub(super) struct Known<'a> {
    /// Its index in the given list.
    pub index: usize,
    /// H, shifted.
    pub carrier_from_holder: Pose,
    /// Covariance of its left motion, carrier frame, shifted: the stated one, or the current estimate.
    pub covariance: Option<Matrix6>,
    /// For views without stated noise: the covariance of each kind of noise for unit variance.
    pub parts: Option<[Matrix6; KINDS]>,
    /// Their current estimate.
    pub variances: [f64; KINDS],
    pub candidates: Vec<Candidate>,
    /// Whether the candidates are given, and not those of the points.
    is_given: bool,
    pub seen: &'a [RigView<'a>],
    centre: Centre,
}

impl Known<'_> {
    /// Returns χ² and redundancy of the points, with the pose of a candidate; `None` without points or redundancy.
    pub fn pixels(&self, candidate: usize) -> Option<(f64, usize)> {
        let cost = RigCost::new(self.seen);
        let redundancy = (2 * cost.n_points()).saturating_sub(6);
        let chi2 = cost.residual_sums(&self.candidates[candidate].cam_from_target).0;
        (chi2.is_finite() && 0 < redundancy).then_some((chi2, redundancy))
    }

    /// Returns a carrier pose as `base_from_gripper` (shifted), the covariance of its left motion there, and `base_from_gripper` as reported.
    pub fn in_base(&self, carrier_from_holder: &Pose, covariance: &Matrix6) -> (Pose, Matrix6, Pose) {
        match self.centre.mounting {
            Mounting::TargetOnGripper => (*carrier_from_holder, *covariance, self.carrier_from_holder),
            Mounting::CameraOnGripper => {
                let inverse = carrier_from_holder.inverse();
                (
                    inverse,
                    carrier_from_holder.inverse_covariance(covariance),
                    self.carrier_from_holder.inverse(),
                )
            }
        }
    }

    /// Returns the variance of the gripper's position, per axis, for unit variance of rotations about the base's origin, m².
    pub fn base_lever2(&self) -> f64 {
        2.0 / 3.0 * (self.gripper_in_base() + self.centre.centre_in_base).norm_squared()
    }

    /// Returns the covariance of T for unit variance of each kind of noise; `None` where the noise is stated.
    pub fn parts_in_camera(&self, poses: &Poses) -> Option<[Matrix6; KINDS]> {
        let ad = poses.cam_from_carrier.adjoint();
        self.parts.map(|parts| parts.map(|part| ad * part * ad.transpose()))
    }

    /// Returns the gripper's pose in the shifted base.
    pub fn base_from_gripper(&self) -> Pose {
        match self.centre.mounting {
            Mounting::TargetOnGripper => self.carrier_from_holder,
            Mounting::CameraOnGripper => self.carrier_from_holder.inverse(),
        }
    }

    /// Returns the gripper's origin in the shifted base.
    pub fn gripper_in_base(&self) -> Vector3<f64> {
        self.base_from_gripper().translation
    }
}

/// X and Z.
#[derive(Debug, Clone, Copy)]
pub(super) struct Poses {
    pub cam_from_carrier: Pose,
    pub holder_from_target: Pose,
}

impl Poses {
    /// Returns the left motions of X and Z from other ones.
    pub fn motion_from(&self, other: &Poses) -> SVector<f64, 12> {
        let by_camera = (self.cam_from_carrier * other.cam_from_carrier.inverse()).log();
        let by_target = (self.holder_from_target * other.holder_from_target.inverse()).log();
        SVector::from_iterator(by_camera.iter().chain(&by_target).copied())
    }

    /// Returns T = X H Z.
    pub fn cam_from_target(&self, view: &Known) -> Pose {
        self.cam_from_carrier * view.carrier_from_holder * self.holder_from_target
    }
}

/// The shift of the base's origin, metres, and the frame to which it belongs.
#[derive(Debug, Clone, Copy)]
pub(super) struct Centre {
    centre_in_base: Vector3<f64>,
    mounting: Mounting,
}

impl Centre {
    fn carrier_from_holder(&self, base_from_gripper: &Pose) -> Pose {
        let shifted = shift(-self.centre_in_base) * *base_from_gripper;
        if self.mounting == Mounting::CameraOnGripper { shifted.inverse() } else { shifted }
    }

    /// Returns the covariance of the left motion of the shifted H from that of `base_from_gripper`.
    fn carried(&self, base_from_gripper: &Pose, covariance: &Matrix6) -> Matrix6 {
        let ad = shift(-self.centre_in_base).adjoint();
        self.carried_from_shifted(base_from_gripper, &(ad * covariance * ad.transpose()))
    }

    /// Returns the same covariance from that in the shifted base.
    fn carried_from_shifted(&self, base_from_gripper: &Pose, shifted: &Matrix6) -> Matrix6 {
        match self.mounting {
            Mounting::TargetOnGripper => *shifted,
            Mounting::CameraOnGripper => {
                (shift(-self.centre_in_base) * *base_from_gripper).inverse_covariance(shifted)
            }
        }
    }

    /// Returns the contribution of each kind of noise to the covariance of a gripper pose without a stated one.
    fn parts(&self, base_from_gripper: &Pose, spread_m: f64) -> [Matrix6; KINDS] {
        let hand = base_from_gripper.translation - self.centre_in_base;
        parts_in_base(&hand, &-self.centre_in_base, spread_m)
            .map(|part| self.carried_from_shifted(base_from_gripper, &part))
    }

    /// Returns poses and covariance for the base as given.
    pub fn undone(&self, poses: &Poses, covariance: &DMatrix<f64>) -> (Poses, DMatrix<f64>) {
        let back = shift(self.centre_in_base);
        if self.mounting == Mounting::TargetOnGripper {
            let cam_from_carrier = poses.cam_from_carrier * back.inverse();
            return (Poses { cam_from_carrier, ..*poses }, covariance.clone());
        }
        let mut ad = DMatrix::identity(12, 12);
        ad.fixed_view_mut::<6, 6>(6, 6).copy_from(&back.adjoint());
        let holder_from_target = back * poses.holder_from_target;
        (Poses { holder_from_target, ..*poses }, &ad * covariance * ad.transpose())
    }

    /// Returns the height in the shifted carrier.
    pub fn height_m(&self, direction: &Vector3<f64>, height_m: f64) -> f64 {
        match self.mounting {
            Mounting::CameraOnGripper => height_m,
            Mounting::TargetOnGripper => height_m - direction.dot(&self.centre_in_base),
        }
    }
}

/// Returns the centre of all views.
pub(super) fn centre(known: &[Known]) -> Centre {
    let nowhere = Centre { centre_in_base: Vector3::zeros(), mounting: Mounting::CameraOnGripper };
    known.first().map_or(nowhere, |view| view.centre)
}

fn shift(by: Vector3<f64>) -> Pose {
    Pose::new(Matrix3::identity(), by)
}

/// Returns the views with a pose, and for each view without one the reason.
pub(super) fn located<'a>(
    views: &'a [HandEyeView<'a>],
    config: &HandEyeConfig,
) -> Result<(Vec<Known<'a>>, Vec<HandEyeViewResult>), Error> {
    check(views, config)?;
    let sum: Vector3<f64> = views.iter().map(|view| view.base_from_gripper.translation).sum();
    let centre = Centre { centre_in_base: sum / views.len().max(1) as f64, mounting: config.mounting };
    let from_centre =
        |view: &HandEyeView| (view.base_from_gripper.translation - centre.centre_in_base).norm_squared();
    let spread_m = (views.iter().map(from_centre).sum::<f64>() / views.len().max(1) as f64).sqrt();
    let (mut known, mut results) = (Vec::new(), Vec::new());
    for (index, view) in views.iter().enumerate() {
        let mut result = HandEyeViewResult { residual: None, candidate: None, chi2: None, rejected: None };
        match candidates(view) {
            Ok(candidates) => known.push(Known {
                index,
                carrier_from_holder: centre.carrier_from_holder(&view.base_from_gripper),
                covariance: view.gripper_covariance.map(|c| centre.carried(&view.base_from_gripper, &c)),
                parts: match view.gripper_covariance {
                    Some(_) => None,
                    None => Some(centre.parts(&view.base_from_gripper, spread_m)),
                },
                variances: [0.0; KINDS],
                candidates,
                is_given: !view.candidates.is_empty(),
                seen: view.seen,
                centre,
            }),
            Err(reason) => result.rejected = Some(RejectedView::Unlocated(reason)),
        }
        results.push(result);
    }
    measure_pixels(&mut known);
    Ok((known, results))
}

/// Reduces the covariances of poses whose points prove their stated noise too large: it would hide the noise of the gripper and every other error.
fn measure_pixels(known: &mut [Known]) {
    let best = |view: &Known| {
        let (chi2, redundancy) = view.pixels(0)?;
        (!view.is_given).then_some((chi2, redundancy))
    };
    let (chi2, redundancy) =
        known.iter().filter_map(best).fold((0.0, 0), |sum, one| (sum.0 + one.0, sum.1 + one.1));
    let scale = f64::min(1.0, measured_scale(chi2, redundancy));
    for candidate in known.iter_mut().filter(|view| !view.is_given).flat_map(|view| &mut view.candidates) {
        candidate.covariance *= scale;
        candidate.delta_chi2 /= scale;
    }
}

/// Returns the given candidates, or those determined by the points.
fn candidates(view: &HandEyeView) -> Result<Vec<Candidate>, Error> {
    if !view.candidates.is_empty() {
        return Ok(view.candidates.clone());
    }
    let found = locate_rig(view.seen)?;
    let candidate =
        |cam_from_target, covariance, chi2: f64| Candidate { cam_from_target, covariance, delta_chi2: chi2 };
    let best = candidate(found.rig_from_target, found.covariance, found.chi2);
    let other = match found.ambiguity {
        RigAmbiguity::Ambiguous { other: o, .. } => Some(candidate(o.rig_from_target, o.covariance, o.chi2)),
        RigAmbiguity::Unique { .. } => None,
    };
    // The answer of a single camera is the more probable pose, whose χ² need not be the lowest.
    let lowest = other.as_ref().map_or(best.delta_chi2, |o| o.delta_chi2.min(best.delta_chi2));
    let above = |c: Candidate| Candidate { delta_chi2: c.delta_chi2 - lowest, ..c };
    Ok([Some(best), other].into_iter().flatten().map(above).collect())
}

/// Checks every number of every view.
fn check(views: &[HandEyeView], config: &HandEyeConfig) -> Result<(), Error> {
    config.tolerance.check()?;
    for (index, view) in views.iter().enumerate() {
        check_pose("view", index, &view.base_from_gripper)?;
        if let Some(covariance) = &view.gripper_covariance {
            check_gripper_covariance(index, covariance)?;
        }
        for candidate in &view.candidates {
            check_pose("view", index, &candidate.cam_from_target)?;
            information_of("view", index, &candidate.covariance)?;
            if !(0.0 <= candidate.delta_chi2 && candidate.delta_chi2.is_finite()) {
                let (what, seen) = ("delta_chi2 of a candidate", candidate.delta_chi2);
                return Err(Error::InvalidPose {
                    item: "view",
                    index,
                    what,
                    seen,
                    needed: "it must be 0 or more",
                });
            }
        }
        if !view.seen.is_empty() {
            check_views(view.seen)?;
        }
    }
    let Some(height) = config.height else { return Ok(()) };
    let numbers = [
        ("the length of the height's direction", height.direction_in_carrier.norm(), true),
        ("height_m", height.height_m, false),
        ("sigma_m of the height", height.sigma_m, true),
    ];
    for (setting, seen, positive) in numbers {
        if !seen.is_finite() || positive && seen <= 0.0 {
            let needed =
                if positive { "it must be positive and finite" } else { "it must be a finite number" };
            return Err(Error::InvalidSetting { setting, seen, needed });
        }
    }
    Ok(())
}

/// A motion may be exact in some directions: only negative eigenvalues beyond rounding are refused.
fn check_gripper_covariance(index: usize, covariance: &Matrix6) -> Result<(), Error> {
    let invalid = |what, seen, needed| Err(Error::InvalidPose { item: "view", index, what, seen, needed });
    if let Some(&seen) = covariance.iter().find(|x| !x.is_finite()) {
        return invalid("an entry of the gripper's covariance", seen, "it must be a finite number");
    }
    let skew = (covariance - covariance.transpose()).amax();
    if 1e-9 * covariance.amax() < skew {
        return invalid("the asymmetry of the gripper's covariance", skew, "it must be symmetric");
    }
    let least = covariance.symmetric_eigenvalues().min();
    if !is_covariance(covariance) {
        return invalid(
            "the least eigenvalue of the gripper's covariance",
            least,
            "no variance can be negative",
        );
    }
    Ok(())
}

/// A base farther from the robot poses than this multiple of their spread is the origin of a map, about which nothing rotates.
const MAX_BASE_DISTANCE: f64 = 30.0;

/// Returns Vₖ for left motions of `base_from_gripper`, for a gripper at `hand` and a base whose own origin is at `origin`, eq. (18).
fn parts_in_base(hand: &Vector3<f64>, origin: &Vector3<f64>, spread_m: f64) -> [Matrix6; KINDS] {
    let is_near = origin.norm() <= MAX_BASE_DISTANCE * spread_m;
    let position = Matrix6::from_diagonal(&Vector6::new(0.0, 0.0, 0.0, 1.0, 1.0, 1.0));
    let about_base = if is_near { rotation_about(origin) } else { Matrix6::zeros() };
    [rotation_about(hand), about_base, position]
}

/// Returns G Gᵀ, the covariance of a left motion for unit variance of rotations about a point.
fn rotation_about(p: &Vector3<f64>) -> Matrix6 {
    let mut g = SMatrix::<f64, 6, 3>::zeros();
    g.fixed_view_mut::<3, 3>(0, 0).fill_with_identity();
    g.fixed_view_mut::<3, 3>(3, 0).copy_from(&p.cross_matrix());
    g * g.transpose()
}
