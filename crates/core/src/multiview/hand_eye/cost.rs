//! The cost of X and Z, and its minimum: docs/math/hand_eye.md eqs. (12)–(16).
//!
//! ```text
//!   T = X H Z,  X ← Exp(ξ) X, Z ← Exp(ζ) Z:  T ← Exp(ξ + Ad(X H) ζ) T
//!   S = Ad(X) Σ_H Ad(X)ᵀ, the motion of T that the hand's noise makes
//! ```

use super::noise::{Besides, Effects, Normal};
use super::views::{KINDS, Known, Poses, centre};
use super::{HandEyeConfig, Height};
use crate::budget::ErrorSource;
use crate::least_squares::PivotedPose;
use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::locate::curvature::Cost;
use crate::multiview::relative::residual;
use crate::multiview::rig_pose::RigCost;
use crate::{Error, Matrix6, Vector6};
use nalgebra::{DMatrix, DVector, Matrix3};

/// The kind of a view's residual.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Level {
    /// Its pose.
    Poses,
    /// Its pixels, where it has points, with their variances multiplied by `pixel_scale`.
    Points { pixel_scale: f64 },
}

/// A minimum.
#[derive(Clone)]
pub(super) struct Fit {
    pub poses: Poses,
    /// 12×12.
    pub covariance: DMatrix<f64>,
    pub chi2: f64,
    pub degrees_of_freedom: usize,
}

/// The information of one view about its T: cost, gradient and information of its left motion.
struct Share {
    chi2: f64,
    gradient: Vector6,
    information: Matrix6,
}

/// The weights of poses depend on X, by which the gripper's noise is transformed; each round changes them to second order only.
const MAX_ROUNDS: usize = 10;
/// The weights have converged when a round changes χ² by less than this.
const SETTLED_CHI2: f64 = 1e-6;

/// Finds the minimum over the views used, each with the given candidate.
pub(super) fn fit(
    start: &Poses,
    known: &[Known],
    used: &[(usize, usize)],
    config: &HandEyeConfig,
    level: Level,
) -> Result<Fit, Error> {
    let mut poses = *start;
    let mut before = f64::INFINITY;
    for round in 1..=MAX_ROUNDS {
        let weights = weights(known, used, &poses)?;
        let evaluate = |poses: &Poses| equations(poses, known, used, &weights, config, level);
        let moved = |poses: &Poses, step: &DVector<f64>| {
            Some(Poses {
                cam_from_carrier: poses.cam_from_carrier.moved(&step.fixed_rows::<6>(0).into_owned()),
                holder_from_target: poses.holder_from_target.moved(&step.fixed_rows::<6>(6).into_owned()),
            })
        };
        let solution = minimize_dense(poses, evaluate, moved).filter(|s| s.is_minimum());
        let solution = solution.ok_or(Error::NotConverged { steps: round })?;
        poses = solution.state;
        let chi2 = solution.equations.chi2;
        if (before - chi2).abs() < SETTLED_CHI2 * (1.0 + chi2) || round == MAX_ROUNDS {
            let information = solution.equations.information;
            let covariance = information.cholesky().ok_or(Error::NotConverged { steps: round })?.inverse();
            return Ok(Fit {
                poses,
                covariance,
                chi2,
                degrees_of_freedom: redundancy(known, used, config, level),
            });
        }
        before = chi2;
    }
    Err(Error::NotConverged { steps: MAX_ROUNDS })
}

fn redundancy(known: &[Known], used: &[(usize, usize)], config: &HandEyeConfig, level: Level) -> usize {
    let numbers = |view: &Known| match level {
        Level::Points { .. } if !view.seen.is_empty() => {
            2 * view.seen.iter().map(|v| v.seen.len()).sum::<usize>()
        }
        _ => 6,
    };
    let all: usize = used.iter().map(|(view, _)| numbers(&known[*view])).sum();
    (all + usize::from(config.height.is_some())).saturating_sub(12)
}

/// Returns S.
fn gripper_noise(view: &Known, poses: &Poses) -> Option<Matrix6> {
    let ad = poses.cam_from_carrier.adjoint();
    view.covariance.map(|covariance| ad * covariance * ad.transpose())
}

/// The source of each kind of noise.
pub(super) const SOURCES: [ErrorSource; KINDS] =
    [ErrorSource::RobotAtGripper, ErrorSource::RobotInBase, ErrorSource::RobotAtGripper];

/// Returns what each kind of noise contributes to left S leftᵀ. A stated noise is the gripper's.
fn pulls_of_robot(view: &Known, poses: &Poses, left: &Matrix6) -> [(ErrorSource, Matrix6); KINDS] {
    let stated = || [gripper_noise(view, poses).unwrap_or_default(); KINDS];
    let parts = view.parts_in_camera(poses);
    let factors = if parts.is_some() { view.variances } else { [1.0, 0.0, 0.0] };
    let parts = parts.unwrap_or_else(stated);
    core::array::from_fn(|k| (SOURCES[k], left * parts[k] * left.transpose() * factors[k]))
}

/// Returns the covariance of Log(A T⁻¹): that of the measured pose plus that of the gripper.
pub(super) fn spread(view: &Known, candidate: usize, poses: &Poses) -> Matrix6 {
    let own = view.candidates[candidate].covariance;
    gripper_noise(view, poses).map_or(own, |hand| own + hand)
}

fn weights(known: &[Known], used: &[(usize, usize)], poses: &Poses) -> Result<Vec<Matrix6>, Error> {
    let weight = |&(view, candidate): &(usize, usize)| {
        let spread = spread(&known[view], candidate, poses);
        spread.cholesky().map(|c| c.inverse()).ok_or(Error::NotConverged { steps: 0 })
    };
    used.iter().map(weight).collect()
}

/// Returns the candidate that agrees best with X and Z, and its χ² (including how much worse it fits its own view).
pub(super) fn nearest(view: &Known, poses: &Poses) -> (usize, f64) {
    let predicted = poses.cam_from_target(view);
    let chi2 = |candidate: usize| {
        let r = (view.candidates[candidate].cam_from_target * predicted.inverse()).log();
        let distance =
            spread(view, candidate, poses).cholesky().map_or(f64::INFINITY, |c| r.dot(&c.solve(&r)));
        (candidate, distance + view.candidates[candidate].delta_chi2)
    };
    (0..view.candidates.len()).map(chi2).min_by(|a, b| a.1.total_cmp(&b.1)).unwrap_or((0, f64::INFINITY))
}

fn equations(
    poses: &Poses,
    known: &[Known],
    used: &[(usize, usize)],
    weights: &[Matrix6],
    config: &HandEyeConfig,
    level: Level,
) -> Option<DenseEquations> {
    let mut equations = DenseEquations::new(12);
    for (&(view, candidate), weight) in used.iter().zip(weights) {
        let view = &known[view];
        let share = match level {
            Level::Points { pixel_scale } if !view.seen.is_empty() => {
                of_points(view, candidate, poses, pixel_scale)?
            }
            _ => of_pose(view, candidate, weight, poses),
        };
        let by_holder = (poses.cam_from_carrier * view.carrier_from_holder).adjoint();
        add(&mut equations, &share, &by_holder);
    }
    if let Some(height) = &config.height {
        add_height(&mut equations, height, poses, known);
    }
    equations.chi2.is_finite().then_some(equations)
}

/// Adds a view by eq. (13): Ad(X H) maps a motion of Z to one of T.
fn add(equations: &mut DenseEquations, share: &Share, by_holder: &Matrix6) {
    equations.chi2 += share.chi2;
    let across = share.information * by_holder;
    let blocks = [
        ((0, 0), share.information),
        ((0, 6), across),
        ((6, 0), across.transpose()),
        ((6, 6), by_holder.tr_mul(&across)),
    ];
    for (at, addend) in blocks {
        let mut block = equations.information.fixed_view_mut::<6, 6>(at.0, at.1);
        block += addend;
    }
    for (row, addend) in [(0, share.gradient), (6, by_holder.tr_mul(&share.gradient))] {
        let mut gradient = equations.gradient.fixed_rows_mut::<6>(row);
        gradient += addend;
    }
}

/// Returns the contribution of the pose itself, eq. (12).
fn of_pose(view: &Known, candidate: usize, weight: &Matrix6, poses: &Poses) -> Share {
    let (r, jacobian) = residual(&view.candidates[candidate].cam_from_target, &poses.cam_from_target(view));
    let weighted: Matrix6 = jacobian.transpose() * weight;
    Share { chi2: r.dot(&(weight * r)), gradient: weighted * r, information: weighted * jacobian }
}

/// The pixels of all cameras about the gripper's most probable motion m, with variances `pixel_scale` times the stated ones.
struct AtPixels {
    hand: Matrix6,
    m: Vector6,
    chi2: f64,
    gradient: Vector6,
    information: Matrix6,
    /// Of the gripper's motion: (1 + information · hand)⁻¹.
    share: Matrix6,
}

fn at_pixels(view: &Known, candidate: usize, poses: &Poses, pixel_scale: f64) -> Option<AtPixels> {
    let cost = RigCost::new(view.seen);
    let pivot = cost.pivot();
    let predicted = poses.cam_from_target(view);
    let hand = gripper_noise(view, poses).unwrap_or_default();
    let measured = &view.candidates[candidate];
    let (r, _) = residual(&measured.cam_from_target, &predicted);
    let m = hand * (hand + measured.covariance).cholesky()?.solve(&r);
    let place = PivotedPose::new(&predicted.moved(&m), &pivot);
    let normal = cost.normal_equations(&place, &pivot)?;
    let mut about_pivot = Matrix6::identity();
    let cross: Matrix3<f64> = -place.pivot_in_cam.cross_matrix();
    about_pivot.fixed_view_mut::<3, 3>(3, 0).copy_from(&cross);
    let information = about_pivot.transpose() * normal.information() * about_pivot / pixel_scale;
    let gradient = normal.gradient_at_camera(&place.pivot_in_cam) / pixel_scale;
    let share = (Matrix6::identity() + information * hand).try_inverse()?;
    Some(AtPixels { hand, m, chi2: normal.chi2 / pixel_scale, gradient, information, share })
}

/// Returns the contribution of the pixels of all cameras, with variances `pixel_scale` times the stated ones and the gripper's motion eliminated
/// about its most probable value m, eqs. (14)–(15).
fn of_points(view: &Known, candidate: usize, poses: &Poses, pixel_scale: f64) -> Option<Share> {
    let AtPixels { hand, m, chi2, gradient, information, share } =
        at_pixels(view, candidate, poses, pixel_scale)?;
    let (eliminated, information) = (share * gradient, share * information);
    let moved = information * m;
    Some(Share {
        chi2: chi2 - gradient.dot(&(hand * eliminated)) + m.dot(&(eliminated * 2.0 + moved)),
        gradient: eliminated + moved,
        information: (information + information.transpose()) * 0.5,
    })
}

/// What each source contributes to the equations: the covariance of its pull in place of the information.
#[derive(Default)]
struct Pulls(Vec<(ErrorSource, DenseEquations)>);

impl Pulls {
    /// The sums of a source, which begin with zeros.
    fn of(&mut self, source: ErrorSource) -> &mut DenseEquations {
        let at = self.0.iter().position(|(known, _)| *known == source).unwrap_or(self.0.len());
        if at == self.0.len() {
            self.0.push((source, DenseEquations::new(12)));
        }
        &mut self.0[at].1
    }

    /// Adds the pulls on one view's T.
    fn add<const N: usize>(&mut self, by_holder: &Matrix6, pulls: [(ErrorSource, Matrix6); N]) {
        for (source, information) in pulls {
            let share = Share { chi2: 0.0, gradient: Vector6::zeros(), information };
            add(self.of(source), &share, by_holder);
        }
    }
}

/// Returns what each source contributes to the covariance of a minimum, 12×12: docs/math/budget.md eqs. (10), (11).
pub(super) fn parts(
    fit: &Fit,
    known: &[Known],
    used: &[(usize, usize)],
    config: &HandEyeConfig,
    level: Level,
) -> Option<Vec<(ErrorSource, DMatrix<f64>)>> {
    let weights = weights(known, used, &fit.poses).ok()?;
    let mut pulls = Pulls::default();
    for (&(view, candidate), weight) in used.iter().zip(&weights) {
        let view = &known[view];
        let by_holder = (fit.poses.cam_from_carrier * view.carrier_from_holder).adjoint();
        match level {
            Level::Points { pixel_scale } if !view.seen.is_empty() => {
                let at = at_pixels(view, candidate, &fit.poses, pixel_scale)?;
                pulls.add(&by_holder, at.pulls(pixel_scale));
                let left = at.share * at.information;
                pulls.add(&by_holder, pulls_of_robot(view, &fit.poses, &left));
            }
            _ => {
                let (own, gain) = pull_of_pose(view, candidate, weight, &fit.poses);
                pulls.add(&by_holder, [own]);
                pulls.add(&by_holder, pulls_of_robot(view, &fit.poses, &gain));
            }
        }
    }
    if let Some(height) = &config.height {
        add_height(pulls.of(ErrorSource::Priors), height, &fit.poses, known);
    }
    let part = |(source, pull): (ErrorSource, DenseEquations)| {
        (source, &fit.covariance * pull.information * &fit.covariance)
    };
    Some(pulls.0.into_iter().map(part).collect())
}

impl AtPixels {
    fn pulls(&self, pixel_scale: f64) -> [(ErrorSource, Matrix6); 2] {
        let of_pixels = self.share * self.information * self.share.transpose();
        let stated = f64::min(1.0, 1.0 / pixel_scale);
        [(ErrorSource::Pixels, of_pixels * stated), (ErrorSource::Residuals, of_pixels * (1.0 - stated))]
    }
}

/// Returns the pull of the measured pose, and the gain of its residual.
fn pull_of_pose(
    view: &Known,
    candidate: usize,
    weight: &Matrix6,
    poses: &Poses,
) -> ((ErrorSource, Matrix6), Matrix6) {
    let measured = &view.candidates[candidate];
    let (_, jacobian) = residual(&measured.cam_from_target, &poses.cam_from_target(view));
    let gain = jacobian.transpose() * weight;
    let own = if view.seen.is_empty() { ErrorSource::CameraPoses } else { ErrorSource::Pixels };
    ((own, gain * measured.covariance * gain.transpose()), gain)
}

/// Returns the information of the height about the effects.
pub(super) fn besides(poses: &Poses, known: &[Known], config: &HandEyeConfig) -> Besides {
    let mut equations = DenseEquations::new(12);
    if let Some(height) = &config.height {
        add_height(&mut equations, height, poses, known);
    }
    let mut besides =
        Besides { information: Normal::zeros(), gradient: Effects::zeros(), chi2: equations.chi2 };
    besides.information.fixed_view_mut::<12, 12>(0, 0).copy_from(&equations.information);
    besides.gradient.fixed_rows_mut::<12>(0).copy_from(&equations.gradient);
    besides
}

/// Adds the known coordinate of the camera's centre −Rᵀt: to first order d·(−Rᵀν), eq. (16).
fn add_height(equations: &mut DenseEquations, height: &Height, poses: &Poses, known: &[Known]) {
    let direction = height.direction_in_carrier.normalize();
    let stated_m = centre(known).height_m(&direction, height.height_m);
    let by_shift = -(poses.cam_from_carrier.rotation * direction) / height.sigma_m;
    let r = (stated_m - direction.dot(&poses.cam_from_carrier.origin())) / height.sigma_m;
    equations.chi2 += r * r;
    let mut gradient = equations.gradient.fixed_rows_mut::<3>(3);
    gradient += by_shift * r;
    let mut block = equations.information.fixed_view_mut::<3, 3>(3, 3);
    block += by_shift * by_shift.transpose();
}
