//! The poses of all targets by what was known and by a walk together.
//!
//! Both covariances hold for small motions. A common motion of a whole map is none: the tilt of the one tag in whose frame it is turns everything.
//! Poses are therefore compared after the rigid motion that brings them nearest to each other.
//!
//! ```text
//!   p_k, P  poses in the world as known, and their covariance   ·   a_k, Σ  those of the walk in a frame of its own   ·   X_k  world_from_target
//!   η_k = log(p_k (F X_k)⁻¹)  left of them after the common motion F   ·   ξ = log F     docs/math/map.md eqs. (8)–(10)
//! ```

use crate::least_squares::dense::{DenseEquations, minimize_dense};
use crate::{Pose, Vector6};
use nalgebra::{Cholesky, DMatrix, DVector, Dyn};

/// What is taken as exact is known to a micrometre and a microradian: no map is better, and every matrix has an inverse.
const EXACT: f64 = 1e-6;
/// Rounds of the mean of motions; each leaves of the rest a share as large as the motions.
const MEANS: usize = 4;

/// A pose of the answer.
pub(super) struct Placed {
    pub(super) target: usize,
    pub(super) world_from_target: Pose,
}

/// All poses, ascending in target, and the covariance of their left motions together, world frame.
pub(super) struct Merged {
    pub(super) placed: Vec<Placed>,
    pub(super) joint: DMatrix<f64>,
}

/// Poses of some targets with their information.
struct Measured {
    /// Index into the unknowns, and the pose.
    poses: Vec<(usize, Pose)>,
    information: DMatrix<f64>,
    /// Whether their frame is the world, so that the common motion counts.
    is_in_world: bool,
}

/// Returns the factor of a covariance.
pub(super) fn factor(covariance: &DMatrix<f64>) -> Option<Cholesky<f64, Dyn>> {
    let mut regular = covariance.clone();
    (0..regular.nrows()).for_each(|i| regular[(i, i)] += EXACT * EXACT);
    regular.cholesky()
}

/// Returns the columns [I; I; …] of a motion that all of n poses share.
pub(super) fn columns(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(6 * n, 6, |i, j| if i % 6 == j { 1.0 } else { 0.0 })
}

/// Returns the most probable poses of the targets `known` in the world and of those `walked` in the map of a walk, each with their covariance
/// together. `world_from_map` is where the walk is at first.
pub(super) fn merged(
    known: Vec<(usize, Pose)>,
    prior: &DMatrix<f64>,
    walked: Vec<(usize, Pose)>,
    of_walk: &DMatrix<f64>,
    world_from_map: &Pose,
) -> Option<Merged> {
    let mut targets: Vec<usize> = known.iter().chain(&walked).map(|(target, _)| *target).collect();
    targets.sort_unstable();
    targets.dedup();
    let index = |target: usize| targets.binary_search(&target).unwrap_or_default();
    let mut start = vec![Pose::identity(); targets.len()];
    walked.iter().for_each(|(target, pose)| start[index(*target)] = *world_from_map * *pose);
    known.iter().for_each(|(target, pose)| start[index(*target)] = *pose);
    let indexed = |poses: Vec<(usize, Pose)>| poses.into_iter().map(|(target, pose)| (index(target), pose));
    let both = [
        Measured {
            poses: indexed(known).collect(),
            information: factor(prior)?.inverse(),
            is_in_world: true,
        },
        Measured {
            poses: indexed(walked).collect(),
            information: without_common(of_walk)?,
            is_in_world: false,
        },
    ];
    let evaluate = |poses: &Vec<Pose>| {
        let mut sum = DenseEquations::new(6 * poses.len());
        both.iter().for_each(|measured| measured.add_to(&mut sum, poses));
        Some(sum)
    };
    let motion = |step: &DVector<f64>, i: usize| Vector6::from(step.fixed_rows::<6>(6 * i));
    let moved = |poses: &Vec<Pose>, step: &DVector<f64>| {
        Some(poses.iter().enumerate().map(|(i, pose)| pose.moved(&motion(step, i))).collect())
    };
    let found = minimize_dense(start, evaluate, moved)?;
    let joint = found.equations.information.cholesky()?.inverse();
    let placed = targets.iter().zip(&found.state);
    let placed = placed.map(|(target, pose)| Placed { target: *target, world_from_target: *pose }).collect();
    Some(Merged { placed, joint: (&joint + joint.transpose()) * 0.5 })
}

/// Returns the information that is left with the common motion unknown: Λ of eq. (9).
fn without_common(covariance: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let inverse = factor(covariance)?.inverse();
    let by_common = &inverse * columns(covariance.nrows() / 6);
    let common = by_common.tr_mul(&columns(covariance.nrows() / 6)).cholesky()?;
    let lost = &by_common * common.solve(&by_common.transpose());
    Some(inverse - lost)
}

impl Measured {
    /// Returns the common motion F, and the errors η, with ξ where it counts.
    fn errors(&self, unknown: &[Pose]) -> (Pose, DVector<f64>) {
        let first = |(i, pose): &(usize, Pose)| *pose * unknown[*i].inverse();
        let mut common = match self.is_in_world {
            true => Pose::identity(),
            false => self.poses.first().map_or_else(Pose::identity, first),
        };
        let of = |common: &Pose, (i, pose): &(usize, Pose)| (*pose * (*common * unknown[*i]).inverse()).log();
        for _ in 0..MEANS {
            let sum: Vector6 = self.poses.iter().map(|one| of(&common, one)).sum();
            common = common.moved(&(sum / f64::max(self.poses.len() as f64, 1.0)));
        }
        let xi = if self.is_in_world { common.log() } else { Vector6::zeros() };
        let errors = self.poses.iter().flat_map(|one| (of(&common, one) + xi).data.0[0]);
        (common, DVector::from_iterator(6 * self.poses.len(), errors))
    }

    /// Adds the cost of the poses with its derivatives: eqs. (9) and (10).
    fn add_to(&self, sum: &mut DenseEquations, unknown: &[Pose]) {
        let (common, errors) = self.errors(unknown);
        let pull = &self.information * &errors;
        let by = common.adjoint();
        sum.chi2 += errors.dot(&pull);
        for (a, (i, _)) in self.poses.iter().enumerate() {
            let mut gradient = sum.gradient.fixed_rows_mut::<6>(6 * i);
            gradient += by.tr_mul(&pull.fixed_rows::<6>(6 * a));
            for (b, (j, _)) in self.poses.iter().enumerate() {
                let mut block = sum.information.fixed_view_mut::<6, 6>(6 * i, 6 * j);
                block += by.tr_mul(&(self.information.fixed_view::<6, 6>(6 * a, 6 * b) * by));
            }
        }
    }
}
