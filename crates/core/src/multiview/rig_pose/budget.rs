//! The error budget of a rig's pose: docs/math/budget.md section 7.
//!
//! ```text
//!   of one camera: J by the rig's motion about the pivot, K by its intrinsics, U = [J K], W⁻¹ of pixels and points
//!   D covariance of the rig's motion that moves the pixels as the camera's own does, and of the intrinsics  ·  S = UᵀWU
//!   E = D (1 + S D)⁻¹   ·   gain of a point (Jᵀ − JᵀWU E Uᵀ) W,   of motion and intrinsics JᵀWU (1 − E S)
//! ```

use super::apart::Apart;
use super::cost::as_pivoted_motion;
use super::{RigCost, RigPoseEstimate, RigView, minima_scale};
use crate::budget::{Budget, ErrorSource, excess};
use crate::least_squares::PivotedPose;
use crate::locate::choose::Minimum;
use crate::locate::curvature::{Cost, along_the_ridge, is_bent, range_share};
use crate::locate::refine::{OVERFLOW, UNDETERMINED, information};
use crate::locate::{Config, locate};
use crate::pose::symmetric;
use crate::{Error, Matrix6, Point};
use nalgebra::{DMatrix, Dyn, Matrix2, OMatrix, SMatrix, U2, U6};

/// A covariance that is larger than its parts by more than this was widened after the pose was found.
const WIDENED: f64 = 1.001;

impl RigPoseEstimate {
    /// The parts of its covariance by their sources, which add up to it. `views` are those of the pose; after a consensus, with the points that
    /// agree.
    ///
    /// # Errors
    /// Those of [`locate_rig`](super::locate_rig) about its input; `DegenerateView` where numbers overflow.
    pub fn budget(&self, views: &[RigView]) -> Result<Budget, Error> {
        super::check_views(views)?;
        let mut seeing = views.iter().filter(|view| !view.seen.is_empty());
        let mut budget = match (seeing.next(), seeing.next()) {
            (Some(only), None) => of_one(only)?,
            _ => self.of_several(views)?,
        };
        let sum = budget.covariance();
        let ratio = self.covariance.diagonal().component_div(&sum.diagonal()).mean();
        if WIDENED < ratio {
            budget.add(ErrorSource::Residuals, &(sum * (ratio - 1.0)));
        }
        budget.adding_up_to(&self.covariance).ok_or(OVERFLOW)
    }

    fn of_several(&self, views: &[RigView]) -> Result<Budget, Error> {
        let cost = &RigCost::new(views);
        let pivot = cost.pivot();
        let place = PivotedPose::new(&self.rig_from_target, &pivot);
        let mut pulls = Budget::default();
        for view in views.iter().filter(|view| !view.seen.is_empty()) {
            add_view(&mut pulls, view, &place, &pivot).ok_or(OVERFLOW)?;
        }
        let inverse = pulls.covariance().cholesky().ok_or(UNDETERMINED)?.inverse();
        let mut transport = Matrix6::identity();
        transport.fixed_view_mut::<3, 3>(3, 0).copy_from(&place.pivot_in_cam.cross_matrix());
        let mut budget = pulls.transformed(&(transport * inverse));
        let near = budget.covariance();
        let minimum = Minimum {
            cam_from_target: self.rig_from_target,
            covariance: near,
            chi2: self.chi2,
            rms_px: self.rms_px,
            log_determinant: 0.0,
        };
        let held = &cost.held_at(&self.rig_from_target);
        let straight = || near + range_share(&minimum, &pivot);
        let bent = if is_bent(&minimum, held) { along_the_ridge(&minimum, held)[1] } else { straight() };
        budget.add(ErrorSource::Bend, &excess(&bent, &near).unwrap_or(bent - near));
        let sum = budget.covariance();
        let noise_scale = minima_scale(self);
        budget.add(ErrorSource::Residuals, &(sum * (noise_scale - 1.0)));
        let apart = Apart::new(cost, &self.rig_from_target, noise_scale).scale();
        budget.add(ErrorSource::SharedInView, &(sum * noise_scale * (apart - 1.0)));
        Ok(budget)
    }
}

/// The budget of the only camera that observes anything, carried into the rig.
fn of_one(view: &RigView) -> Result<Budget, Error> {
    let config = Config { intrinsics_covariance: view.intrinsics_covariance, ..Config::default() };
    let found = locate(view.seen, view.camera, &config)?;
    let of_camera = found.budget(view.seen, view.camera, &config)?;
    let mut budget = of_camera.transformed(&view.cam_from_rig.inverse().adjoint());
    if let Some(own) = &view.cam_from_rig_covariance {
        budget.add(ErrorSource::CameraPoses, &view.cam_from_rig.inverse_covariance(own));
    }
    Ok(budget)
}

/// Adds the pulls of one camera: JᵀW R W J of each source's covariance R. `None` where a point leaves the field.
fn add_view(sums: &mut Budget, view: &RigView, place: &PivotedPose, pivot: &Point) -> Option<()> {
    let n_lens = view.intrinsics_covariance.map_or(0, |_| view.camera.parameters().len());
    let n = 6 + n_lens;
    let mut own = DMatrix::<f64>::zeros(n, n);
    if let Some(covariance) = &view.cam_from_rig_covariance {
        own.view_mut((0, 0), (6, 6)).copy_from(&as_pivoted_motion(view, covariance, &place.pivot_in_cam));
    }
    if let Some(rows) = view.intrinsics_covariance {
        own.view_mut((6, 6), (n_lens, n_lens)).copy_from(&DMatrix::from_row_slice(n_lens, n_lens, rows));
    }
    let (mut points, mut s) = (Vec::with_capacity(view.seen.len()), DMatrix::<f64>::zeros(n, n));
    for c in view.seen {
        let y = place.rotation * (c.x_in_target - pivot);
        let x_in_cam = view.cam_from_rig * (y + place.pivot_in_cam);
        let (_, jacobian) = view.camera.project_with_jacobian(&x_in_cam)?;
        let by_rig = jacobian * view.cam_from_rig.rotation;
        let mut by = OMatrix::<f64, U2, Dyn>::zeros(n);
        by.fixed_columns_mut::<3>(0).copy_from(&(-by_rig * y.cross_matrix()));
        by.fixed_columns_mut::<3>(3).copy_from(&by_rig);
        if 0 < n_lens {
            for (i, column) in view.camera.intrinsics_jacobian(&x_in_cam)?.iter().enumerate() {
                by.column_mut(6 + i).copy_from(column);
            }
        }
        let weight = information(c, &jacobian);
        s += by.transpose() * weight * &by;
        let of_point = jacobian * jacobian.transpose() * (c.sigma_m * c.sigma_m);
        let [uu, uv, vv] = c.pixel_covariance();
        points.push((by, weight, Matrix2::new(uu, uv, uv, vv), of_point));
    }
    let shared = &own * (DMatrix::identity(n, n) + &s * &own).try_inverse()?;
    let by_motion = s.fixed_rows::<6>(0).into_owned();
    let pulled = &by_motion * &shared;
    let [mut pixels, mut target] = [Matrix6::zeros(); 2];
    for (by, weight, of_pixel, of_point) in &points {
        let motion = by.fixed_columns::<6>(0).transpose();
        let gain: SMatrix<f64, 6, 2> = (motion - &pulled * by.transpose()) * weight;
        pixels += gain * of_pixel * gain.transpose();
        target += gain * of_point * gain.transpose();
    }
    let gain: OMatrix<f64, U6, Dyn> = &by_motion - &pulled * &s;
    let part = |from: usize, many: usize| {
        let gain = gain.columns(from, many);
        symmetric(&(gain * own.view((from, from), (many, many)) * gain.transpose()))
    };
    sums.add(ErrorSource::Pixels, &pixels);
    sums.add(ErrorSource::Target, &target);
    sums.add(ErrorSource::CameraPoses, &part(0, 6));
    sums.add(ErrorSource::Lens, &part(6, n_lens));
    Some(())
}
