//! The joint estimate of chosen intrinsics and every pose, by maximum likelihood: docs/math/frames.md section 2.
//!
//! Starts from the intrinsics given and the poses they lead to. Wrong intrinsics can turn a view to its mirror pose: after convergence
//! each view is solved again with the new intrinsics, and where that fits better the joint minimum is sought from there.

use super::equations::{Direction, equations, pivots};
use super::{Group, MAX_RELATIVE_SIGMA, SkippedFrame, View, located, redundancy, scales, view, weakest};
use crate::least_squares::PivotedPose;
use crate::least_squares::shared::{SharedEquations, SharedMinimum, SharedState, minimize_shared};
use crate::locate::consistency::noise_scale;
use crate::{Camera, Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::{DMatrix, DVector};

/// Which focal lengths are estimated.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Focal {
    /// None.
    Held,
    /// One factor: fx and fy keep their ratio.
    #[default]
    Common,
    /// fx and fy independently.
    Separate,
}

/// Which intrinsics are estimated; the others are taken as given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Free {
    /// Focal lengths.
    pub focal: Focal,
    /// Principal point.
    pub principal_point: bool,
    /// Every other parameter of the lens model.
    pub distortion: bool,
}

/// A frame's pose, refined with the intrinsics.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct RefinedFrame {
    /// Index of the frame.
    pub frame: usize,
    /// The pose.
    pub cam_from_target: Pose,
    /// 6×6 covariance of its small left motion, the uncertainty of the intrinsics included.
    pub covariance: Matrix6,
    /// Sum of squared residuals over their variances.
    pub chi2: f64,
    /// Points of the frame.
    pub n_points: usize,
}

/// Intrinsics and poses with their covariances.
#[derive(Debug, Clone, PartialEq)]
pub struct RefinedIntrinsics {
    /// The camera with the refined intrinsics.
    pub camera: Camera,
    /// Their n × n covariance row by row, in the order of `Camera::parameters`, zero where held: as `locate::Config` takes it.
    pub covariance: Vec<f64>,
    /// Every frame that took part.
    pub frames: Vec<RefinedFrame>,
    /// Frames that did not take part.
    pub skipped: Vec<SkippedFrame>,
    /// Sum of squared residuals over their variances, over all frames.
    pub chi2: f64,
    /// Two for each point, less six for each frame, less the free intrinsics.
    pub degrees_of_freedom: usize,
    /// Factor in all covariances: χ² per degree of freedom where it proves the stated sigmas too small, else 1.
    pub noise_scale: f64,
}

impl RefinedIntrinsics {
    /// Returns the standard deviations in the order of `Camera::parameters`; zero where held.
    pub fn sigmas(&self) -> Vec<f64> {
        let n = self.camera.parameters().len();
        (0..n).map(|i| self.covariance[i * n + i].sqrt()).collect()
    }
}

/// Largest number of rounds in which views change to a better pose; it bounds the work only, since each change lowers χ².
const MAX_ROUNDS: usize = 5;
/// A pose found again is a different one if it lowers χ² by more than this: far less than one σ, far more than rounding.
const SAME_CHI2: f64 = 1e-3;

/// Estimates the chosen intrinsics of `camera` and the pose of every frame, each the correspondences of one view.
///
/// Bearings are derived anew from the pixels. Frames without a pose are skipped and named.
///
/// # Errors
/// `TooFewFrames` when no frame has a pose; `UndeterminedIntrinsics` when the frames do not determine a chosen parameter;
/// `NotConverged` when no minimum is reached.
pub fn refine_intrinsics<F: AsRef<[Correspondence]>>(
    frames: &[F],
    camera: &Camera,
    free: Free,
) -> Result<RefinedIntrinsics, Error> {
    let (mut views, skipped) = located(frames, camera);
    if views.is_empty() {
        return Err(Error::TooFewFrames { seen: 0, needed: 1 });
    }
    let (mut camera, directions) = (camera.clone(), directions(camera, free));
    let pivots = pivots(&views);
    for _ in 0..MAX_ROUNDS {
        let solution = minimum(&views, &pivots, &camera, &directions)?;
        camera = changed(&camera, &directions, &solution.state.change)?;
        if !take_better_poses(&mut views, &pivots, &camera, &solution) {
            return answer(&views, &pivots, camera, &directions, &solution, skipped);
        }
    }
    Err(Error::NotConverged { steps: MAX_ROUNDS })
}

/// Returns the directions of the chosen parameters.
fn directions(camera: &Camera, free: Free) -> Vec<Direction> {
    let parameters = camera.parameters();
    let of = |group: Group| -> Vec<Direction> {
        let indices = (0..parameters.len()).filter(|i| Group::of(parameters[*i].0) == group);
        indices.map(|i| Direction::from_iter([(i, 1.0)])).collect()
    };
    let focal = of(Group::FocalLength);
    let mut directions = match free.focal {
        Focal::Held => Vec::new(),
        Focal::Separate => focal,
        Focal::Common => {
            // Change per unit of the first one: fx and fy grow in proportion.
            let indices = focal.iter().flatten().map(|(i, _)| *i);
            let first = parameters[0].1;
            vec![indices.map(|i| (i, parameters[i].1 / first)).collect()]
        }
    };
    if free.principal_point {
        directions.extend(of(Group::PrincipalPoint));
    }
    if free.distortion {
        directions.extend(of(Group::Distortion));
    }
    directions
}

/// Returns the camera with its parameters moved along the directions.
fn changed(camera: &Camera, directions: &[Direction], change: &DVector<f64>) -> Result<Camera, Error> {
    let mut values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
    for (direction, change) in directions.iter().zip(change.iter()) {
        for (i, by) in direction {
            values[*i] += by * change;
        }
    }
    camera.with_parameters(&values)
}

/// Returns the joint minimum reached from the views' poses and the given camera.
fn minimum(
    views: &[View],
    pivots: &[Point],
    camera: &Camera,
    directions: &[Direction],
) -> Result<SharedMinimum, Error> {
    let placed = views.iter().zip(pivots);
    let start = placed.map(|(view, pivot)| PivotedPose::new(&view.minimum.cam_from_target, pivot)).collect();
    let evaluate = |state: &SharedState| {
        let camera = changed(camera, directions, &state.change).ok()?;
        equations(views, pivots, &state.places, &camera, directions, None)
    };
    let solution = minimize_shared(start, directions.len(), evaluate)
        .ok_or(Error::NoSolution { n_points: views.iter().map(|view| view.seen.len()).sum() })?;
    if solution.is_minimum() {
        return Ok(solution);
    }
    // Along a direction that the frames leave undetermined the iteration does not converge; the error then names that direction.
    let reached = changed(camera, directions, &solution.state.change)?;
    covariance_of_directions(&solution.equations, views, &reached, directions)?;
    Err(Error::NotConverged { steps: solution.steps })
}

/// Puts the solution's poses into the views, or the poses found again with the new camera where those fit better; returns whether any fits
/// better.
fn take_better_poses(
    views: &mut [View],
    pivots: &[Point],
    camera: &Camera,
    solution: &SharedMinimum,
) -> bool {
    let mut any = false;
    let refined = solution.state.places.iter().zip(pivots).zip(solution.equations.chi2_of_views());
    for (old, ((place, pivot), chi2)) in views.iter_mut().zip(refined) {
        match view(old.frame, &old.seen, camera) {
            Ok(found) if found.minimum.chi2 < chi2 - SAME_CHI2 * (1.0 + chi2) => {
                *old = found;
                any = true;
            }
            _ => {
                old.minimum.cam_from_target = place.pose(pivot);
                old.minimum.chi2 = chi2;
            }
        }
    }
    any
}

fn answer(
    views: &[View],
    pivots: &[Point],
    camera: Camera,
    directions: &[Direction],
    solution: &SharedMinimum,
    skipped: Vec<SkippedFrame>,
) -> Result<RefinedIntrinsics, Error> {
    let SharedEquations { chi2, .. } = solution.equations;
    let degrees_of_freedom = redundancy(views).saturating_sub(directions.len());
    let noise_scale = noise_scale(chi2, degrees_of_freedom);
    let no_pose = Error::NoSolution { n_points: views.iter().map(|view| view.seen.len()).sum() };
    let small = covariance_of_directions(&solution.equations, views, &camera, directions)? * noise_scale;
    let poses = solution.equations.pose_covariances(&(&small / noise_scale)).ok_or(no_pose)?;
    let frame = |((view, pivot), (place, pose)): ((&View, &Point), (&PivotedPose, &Matrix6))| {
        let turned = about_camera(pose, &place.pivot_in_cam) * noise_scale;
        let cam_from_target = place.pose(pivot);
        let (chi2, n_points) = (view.minimum.chi2, view.seen.len());
        RefinedFrame { frame: view.frame, cam_from_target, covariance: turned, chi2, n_points }
    };
    let frames = views.iter().zip(pivots).zip(solution.state.places.iter().zip(&poses)).map(frame).collect();
    let covariance = covariance_of_parameters(&small, directions, camera.parameters().len());
    Ok(RefinedIntrinsics { camera, covariance, frames, skipped, chi2, degrees_of_freedom, noise_scale })
}

/// Returns the marginal covariance of the free parameters, docs/math/frames.md eq. (5); refuses undetermined parameters, eq. (9).
fn covariance_of_directions(
    equations: &SharedEquations,
    views: &[View],
    camera: &Camera,
    directions: &[Direction],
) -> Result<DMatrix<f64>, Error> {
    let n_points = views.iter().map(|view| view.seen.len()).sum();
    let information = equations.reduced().ok_or(Error::NoSolution { n_points })?.information;
    let (parameters, scales) = (camera.parameters(), scales(views, camera));
    let of_directions: Vec<f64> = directions.iter().map(|d| scales[d[0].0]).collect();
    match weakest(&information, &of_directions) {
        Some((at, seen)) if !(seen <= MAX_RELATIVE_SIGMA) => {
            let parameter = parameters[directions[at][0].0].0;
            Err(Error::UndeterminedIntrinsics { parameter, seen, needed: MAX_RELATIVE_SIGMA })
        }
        _ => Ok(information.cholesky().map(|c| c.inverse()).unwrap_or_default()),
    }
}

/// Returns the covariance of all parameters from that of the free directions: D Σ Dᵀ.
fn covariance_of_parameters(small: &DMatrix<f64>, directions: &[Direction], n: usize) -> Vec<f64> {
    let mut covariance = vec![0.0; n * n];
    for (a, left) in directions.iter().enumerate() {
        for (b, right) in directions.iter().enumerate() {
            for (i, by_left) in left {
                for (j, by_right) in right {
                    covariance[i * n + j] += by_left * by_right * small[(a, b)];
                }
            }
        }
    }
    covariance
}

/// Returns the covariance of the left motion from that about the pivot: ν_left = ν + c × ω, docs/math/refine.md eq. (7).
fn about_camera(about_pivot: &Matrix6, pivot_in_cam: &Point) -> Matrix6 {
    let mut to_camera = Matrix6::identity();
    to_camera.fixed_view_mut::<3, 3>(3, 0).copy_from(&pivot_in_cam.cross_matrix());
    crate::pose::symmetric(&(to_camera * about_pivot * to_camera.transpose()))
}
