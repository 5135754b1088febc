//! The position of the next point, given those already measured: docs/math/advise.md eqs. (1), (2), (7).

use super::expect::{NEEDED_SEPARATION_SIGMA, View, correspondence_of, worst_sigmas};
use super::ground::GroundLength;
use crate::least_squares::PivotedPose;
use crate::locate::choose::{DUPLICATE_SIGMAS, Minimum};
use crate::locate::common::{Common, Dependence};
use crate::locate::locate;
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations};
use crate::target::KnownPoint;
use crate::{Error, Matrix6, Point};
use nalgebra::{Matrix2, Matrix2x6, Vector2};

/// The quantity to be determined.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Aim {
    /// The camera's position, in its worst direction, metres.
    Place,
    /// The rotation, about its worst axis, radians.
    Rotation,
    /// A length measured on a plane, metres.
    Length(GroundLength),
}

impl Aim {
    /// Returns the standard deviation of the aim for a pose of this covariance: metres, or radians for `Rotation`.
    pub fn sigma(&self, covariance: &Matrix6) -> f64 {
        match self {
            Aim::Place => worst_sigmas(covariance).1,
            Aim::Rotation => worst_sigmas(covariance).0,
            Aim::Length(length) => length.sigma_m(covariance),
        }
    }
}

/// A view with one more point.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gain {
    /// 6×6 covariance of the small left motion `[rotation_rad; translation_m]`, camera frame, from all points.
    pub covariance: Matrix6,
    /// Distance between the points' images in the nearest other pose, in standard deviations of the pixels; infinite without one. It is
    /// first-order about each of the poses that the earlier points allow.
    pub separation_sigma: f64,
}

/// The points measured so far, prepared for trying one more at many positions.
pub struct NextPoint<'a> {
    view: View<'a>,
    pivot: Point,
    place: PivotedPose,
    information: Matrix6,
    /// The other poses that the points so far allow.
    alternatives: Vec<Minimum>,
    /// The assumed pose.
    at: Minimum,
    /// The derivative of the points so far with respect to the intrinsics.
    lens: Dependence,
}

impl<'a> NextPoint<'a> {
    /// Prepares a view of three points or more.
    ///
    /// # Errors
    /// Errors of `locate`: too few points, points on a line, …; `InvalidSetting` for a pose without a rotation or a point that is not visible.
    pub fn new(view: View<'a>) -> Result<Self, Error> {
        let seen = view.correspondences()?;
        let estimate = locate(&seen, view.camera, &view.config())?;
        let pivot = centroid(&seen);
        let place = PivotedPose::new(&view.cam_from_target, &pivot);
        let normal = normal_equations(&place, &pivot, &Problem::new(&seen, view.camera));
        let information = normal.ok_or(Error::NoSolution { n_points: seen.len() })?.information();
        let is_other = |m: &Minimum| {
            let turns: f64 = (0..3).map(|i| m.covariance[(i, i)]).sum();
            DUPLICATE_SIGMAS * turns.sqrt() < m.cam_from_target.angle_to_rad(&view.cam_from_target)
        };
        let alternatives = estimate.minima().map(|h| h.minimum).filter(is_other).collect();
        let at = Minimum::assumed(&view.cam_from_target);
        let common = Common { intrinsics: view.intrinsics_covariance, scale_sigma: [0.0; 2] };
        let lens = Dependence::at(&at, &Problem::new(&seen, view.camera), &common)?;
        Ok(NextPoint { view, pivot, place, information, alternatives, at, lens })
    }

    /// Returns the covariance from the points so far; `None` where they do not determine the pose.
    pub fn covariance(&self) -> Option<Matrix6> {
        self.at_camera(&self.information, &self.lens)
    }

    /// Returns the view with a further point; `None` where the camera does not see it.
    pub fn with(&self, further: &KnownPoint) -> Option<Gain> {
        let c = correspondence_of(&self.view, further)?;
        let problem = Problem::new(core::slice::from_ref(&c), self.view.camera);
        let added = normal_equations(&self.place, &self.pivot, &problem)?.information();
        let lens = self.lens.and(&self.at, &c, &problem)?;
        let covariance = self.at_camera(&(self.information + added), &lens)?;
        let separation = |m: &Minimum| self.separation_squared(m, further, &c.pixel);
        let least = self.alternatives.iter().map(separation).fold(f64::INFINITY, f64::min);
        Some(Gain { covariance, separation_sigma: least.max(0.0).sqrt() })
    }

    /// Ranks the candidates that the camera sees, by index, the best first: those with which the pose remains ambiguous come last.
    pub fn ranked(&self, candidates: &[KnownPoint], aim: &Aim) -> Vec<(usize, Gain)> {
        let gains = candidates.iter().enumerate().filter_map(|(i, c)| Some((i, self.with(c)?)));
        let mut keyed: Vec<(bool, f64, usize, Gain)> = gains
            .map(|(i, g)| (g.separation_sigma < NEEDED_SEPARATION_SIGMA, aim.sigma(&g.covariance), i, g))
            .collect();
        keyed.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        keyed.into_iter().map(|(_, _, i, gain)| (i, gain)).collect()
    }

    /// Returns the covariance of left motions from the information about the pivot, docs/math/refine.md eq. (7), plus that of the intrinsics,
    /// eq. (9).
    fn at_camera(&self, information: &Matrix6, lens: &Dependence) -> Option<Matrix6> {
        let about_pivot = information.cholesky()?.inverse();
        let mut u = Matrix6::identity();
        u.fixed_view_mut::<3, 3>(3, 0).copy_from(&self.place.pivot_in_cam.cross_matrix());
        let covariance = crate::pose::symmetric(&(u * about_pivot * u.transpose()));
        let covariance = crate::pose::symmetric(&(covariance + lens.share(&covariance)));
        covariance.sum().is_finite().then_some(covariance)
    }

    /// Returns χ² of a second solution if it also has to explain a further point: docs/math/advise.md eq. (7).
    fn separation_squared(&self, alternative: &Minimum, further: &KnownPoint, pixel: &Vector2<f64>) -> f64 {
        let x_in_cam = alternative.cam_from_target * further.position;
        let Some((elsewhere, by_point)) = self.view.camera.project_with_jacobian(&x_in_cam) else {
            return f64::INFINITY;
        };
        let mut by_motion = Matrix2x6::zeros();
        by_motion.fixed_view_mut::<2, 3>(0, 0).copy_from(&-(by_point * x_in_cam.cross_matrix()));
        by_motion.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_point);
        let d = pixel - elsewhere;
        let own = Matrix2::identity() * self.view.sigma_px.powi(2)
            + by_point * by_point.transpose() * further.sigma_m.powi(2);
        let spread = own + by_motion * alternative.covariance * by_motion.transpose();
        spread.try_inverse().map_or(0.0, |inverse| alternative.chi2 + d.dot(&(inverse * d)))
    }
}

/// Selects the first of a ranked list and those after it that are at least `apart_m` from all selected before; at most `n`.
pub fn spread_out(candidates: &[KnownPoint], ranked: &[(usize, Gain)], apart_m: f64, n: usize) -> Vec<usize> {
    let mut taken: Vec<usize> = Vec::new();
    for (i, _) in ranked {
        let is_apart = |j: &usize| apart_m <= (candidates[*i].position - candidates[*j].position).norm();
        if taken.len() < n && taken.iter().all(is_apart) {
            taken.push(*i);
        }
    }
    taken
}
