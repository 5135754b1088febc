//! The expected accuracy of one view of known points from an assumed pose. docs/math/advise.md eqs. (1)–(6).

use crate::locate::choose::{DUPLICATE_SIGMAS, Minimum, UNCERTAIN_GATE_CHI2};
use crate::locate::common::{Common, Dependence};
use crate::locate::curvature::{along_the_ridge, is_bent, with_curvature};
use crate::locate::problem::Problem;
use crate::locate::refine::{OVERFLOW, refine};
use crate::locate::{Config, locate};
use crate::pose::{ROTATION_TOLERANCE, off_rotation, symmetric};
use crate::solve::line_plus_one::Weakness;
use crate::statistics::normal::upper_tail;
use crate::target::KnownPoint;
use crate::{Camera, Correspondence, Error, Matrix6, Pose};

/// A planned view: camera, target, pose, and the standard deviation of the points in the image.
#[derive(Debug, Clone, Copy)]
pub struct View<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Its assumed pose: x_in_cam = cam_from_target · x_in_target.
    pub cam_from_target: Pose,
    /// The points that it will observe.
    pub points: &'a [KnownPoint],
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: f64,
    /// Covariance of the camera's intrinsics, row by row, in the order of `Camera::parameters`; `None` where they are exact.
    pub intrinsics_covariance: Option<&'a [f64]>,
}

/// A camera, the accuracy of points in its image, and the uncertainty of its intrinsics.
#[derive(Debug, Clone, Copy)]
pub struct Optics<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: f64,
    /// As in [`View::intrinsics_covariance`].
    pub intrinsics_covariance: Option<&'a [f64]>,
}

impl<'a> Optics<'a> {
    /// Returns the view of these points from a pose.
    pub fn view(&self, cam_from_target: Pose, points: &'a [KnownPoint]) -> View<'a> {
        let Optics { camera, sigma_px, intrinsics_covariance } = *self;
        View { camera, cam_from_target, points, sigma_px, intrinsics_covariance }
    }
}

impl<'a> View<'a> {
    /// Returns the settings of `locate` for such an image.
    pub(crate) fn config(&self) -> Config<'a> {
        Config { intrinsics_covariance: self.intrinsics_covariance, ..Config::default() }
    }
}

/// Why the first-order figures of a view cannot be trusted.
#[derive(Debug, Clone, Copy, PartialEq)]
#[non_exhaustive]
pub enum FirstOrderLimit {
    /// The likelihood is bent: in its worst direction the standard deviation that `locate` will state is `ratio` times the first-order one. This
    /// is usual for flat targets seen nearly frontally.
    Bent {
        /// The ratio described above.
        ratio: f64,
        /// Largest ratio with which the first-order figures hold within 5 %.
        allowed: f64,
    },
    /// Another pose predicts the points `separation_sigma` standard deviations of the pixels away.
    Ambiguous {
        /// The separation described above; 0 where the image does not distinguish the two.
        separation_sigma: f64,
        /// Smallest separation with which hardly one image in a hundred has two answers.
        needed_sigma: f64,
    },
}

/// A bend that increases the worst standard deviation by this factor makes it wrong by 5 %: docs/math/advise.md section 2.
pub(crate) const ALLOWED_BEND: f64 = 1.05;
/// Two poses this many standard deviations apart leave 1.2 % of images ambiguous: docs/math/advise.md eq. (5).
pub const NEEDED_SEPARATION_SIGMA: f64 = 6.0;

/// The expected accuracy of a view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Expectation {
    /// 6×6 covariance of the small left motion `[rotation_rad; translation_m]`, camera frame: the Cramér–Rao bound of the pixels, plus the
    /// contribution of uncertain intrinsics.
    pub covariance: Matrix6,
    /// The same covariance for exact intrinsics.
    pub exact_intrinsics_covariance: Matrix6,
    /// `covariance`, widened by the bend of the likelihood: what `locate` will state on average.
    pub stated_covariance: Matrix6,
    /// Greatest factor by which the bend increases a first-order standard deviation: 1 where nothing is bent.
    pub bend_ratio: f64,
    /// Distance between the points' images in the nearest other pose, in standard deviations of the pixels, without the part that uncertain
    /// intrinsics would explain; infinite where there is no other pose.
    pub separation_sigma: f64,
    /// Difference of χ² below which `locate` calls two poses ambiguous.
    pub gate_chi2: f64,
    /// Why a line and one point off it determine this pose weakly.
    pub weakness: Option<Weakness>,
}

impl Expectation {
    /// Returns the probability that the answer will be `ambiguous`: docs/math/advise.md eq. (5).
    pub fn chance_ambiguous(&self) -> f64 {
        chance_below(self.separation_sigma, self.gate_chi2)
    }

    /// Returns the probability that the wrong pose will fit better: docs/math/advise.md eq. (4).
    pub fn chance_wrong(&self) -> f64 {
        chance_below(self.separation_sigma, 0.0)
    }

    /// Returns the effects that the first-order figures neglect, the most severe first; empty where they hold within 5 %.
    pub fn first_order_limits(&self) -> Vec<FirstOrderLimit> {
        let (ratio, separation_sigma) = (self.bend_ratio, self.separation_sigma);
        let ambiguous =
            FirstOrderLimit::Ambiguous { separation_sigma, needed_sigma: NEEDED_SEPARATION_SIGMA };
        let bent = FirstOrderLimit::Bent { ratio, allowed: ALLOWED_BEND };
        let first_order_valid = [NEEDED_SEPARATION_SIGMA <= separation_sigma, ratio <= ALLOWED_BEND];
        [ambiguous, bent]
            .into_iter()
            .zip(first_order_valid)
            .filter(|(_, first_order_valid)| !first_order_valid)
            .map(|(first_order_limit, _)| first_order_limit)
            .collect()
    }
}

/// Returns the probability that Δχ², normal with mean D² and standard deviation 2D, is below `gate`.
pub(crate) fn chance_below(separation_sigma: f64, gate: f64) -> f64 {
    let d = separation_sigma;
    if !d.is_finite() {
        return 0.0;
    }
    if d == 0.0 {
        return if 0.0 < gate { 1.0 } else { 0.5 };
    }
    upper_tail((d * d - gate) / (2.0 * d))
}

/// Returns the exact pixels of a view; `None` where a point is outside the image or the lens's field.
pub fn correspondences_in_view(view: &View) -> Option<Vec<Correspondence>> {
    view.points.iter().map(|p| correspondence_of(view, p)).collect()
}

/// Returns the exact pixel of one point.
pub(crate) fn correspondence_of(view: &View, p: &KnownPoint) -> Option<Correspondence> {
    let pixel = view.camera.project(&(view.cam_from_target * p.position))?;
    let is_inside = view.camera.size.is_none_or(|size| {
        let within = |x: f64, n: u32| -0.5 <= x && x <= f64::from(n) - 0.5;
        within(pixel.x, size.width_px) && within(pixel.y, size.height_px)
    });
    let c = Correspondence::new(view.camera, p.position, pixel, view.sigma_px).ok()?;
    is_inside.then_some(Correspondence { sigma_m: p.sigma_m, ..c })
}

impl View<'_> {
    /// Returns the exact pixels of the points.
    pub(super) fn correspondences(&self) -> Result<Vec<Correspondence>, Error> {
        let off = off_rotation(&self.cam_from_target.rotation);
        if !(off <= ROTATION_TOLERANCE) {
            let needed = "R Rᵀ must be the identity and det R positive";
            return Err(Error::InvalidSetting { setting: "cam_from_target", seen: off, needed });
        }
        correspondences_in_view(self).ok_or_else(|| out_of_view(self))
    }
}

/// Computes the expected accuracy of a view in which all points are visible.
///
/// # Errors
/// `InvalidSetting` for a pose without a rotation, a sigma that is not positive or a point that is not visible, and those of `locate`: too few
/// points, points on a line, …
pub fn expect(view: &View) -> Result<Expectation, Error> {
    let seen = view.correspondences()?;
    let estimate = locate(&seen, view.camera, &view.config())?;
    let minimum = refine(&view.cam_from_target, &seen, view.camera)?;
    let turns: f64 = (0..3).map(|i| minimum.covariance[(i, i)]).sum();
    let is_other =
        |m: &Minimum| DUPLICATE_SIGMAS * turns.sqrt() < m.cam_from_target.angle_to_rad(&view.cam_from_target);
    let others = estimate.minima().map(|h| h.minimum).filter(is_other);
    let nearest = others.min_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let problem = Problem::new(&seen, view.camera);
    let [near, by_pixels] = match is_bent(&minimum, &problem) {
        true => along_the_ridge(&minimum, &problem),
        false => [with_curvature(&minimum, &problem); 2],
    };
    let bend_ratio = greatest_ratio(&by_pixels, &minimum.covariance);
    let is_lost = |i: usize| by_pixels[(i, i)] < 0.0;
    if !bend_ratio.is_finite() || (0..6).any(is_lost) {
        return Err(OVERFLOW);
    }
    let common = Common { intrinsics: view.intrinsics_covariance, scale_sigma: [0.0; 2] };
    let lens = Dependence::at(&minimum, &problem, &common)?;
    Ok(Expectation {
        covariance: symmetric(&(minimum.covariance + lens.share(&minimum.covariance))),
        exact_intrinsics_covariance: minimum.covariance,
        stated_covariance: symmetric(&(by_pixels + lens.share(&near))),
        bend_ratio,
        separation_sigma: nearest.map_or(f64::INFINITY, |m| m.chi2.max(0.0).sqrt()),
        gate_chi2: match view.intrinsics_covariance {
            None => estimate.gate_chi2(),
            Some(_) => UNCERTAIN_GATE_CHI2,
        },
        weakness: estimate.weakness,
    })
}

/// Returns the error for the first point that is not visible.
fn out_of_view(view: &View) -> Error {
    let hidden = view.points.iter().position(|p| correspondence_of(view, p).is_none()).unwrap_or(0);
    Error::InvalidSetting {
        setting: "the place of a point",
        seen: hidden as f64,
        needed: "the point of this number (from 0) must be in front of the camera and inside its image",
    }
}

/// Returns the square root of the greatest eigenvalue of `small`⁻¹ `large`; infinite where `small` is not positive definite.
fn greatest_ratio(large: &Matrix6, small: &Matrix6) -> f64 {
    let Some(root) = small.cholesky() else { return f64::INFINITY };
    let Some(half) = root.l().solve_lower_triangular(large) else { return f64::INFINITY };
    let Some(whole) = root.l().solve_lower_triangular(&half.transpose()) else { return f64::INFINITY };
    whole.symmetric_eigenvalues().max().max(1.0).sqrt()
}

/// Returns the greatest standard deviations of the rotation over all axes, radians, and of the camera's position over all directions, metres.
pub fn worst_sigmas(covariance: &Matrix6) -> (f64, f64) {
    let worst = |at: usize| {
        let block: nalgebra::Matrix3<f64> = covariance.fixed_view::<3, 3>(at, at).into_owned();
        block.symmetric_eigenvalues().max().max(0.0).sqrt()
    };
    (worst(0), worst(3))
}
