//! The pose of the next board of a rig. Each view has an unknown board pose of its own, which is eliminated:
//! docs/math/advise.md eqs. (14)–(17).

use super::expect::{FirstOrderLimit, Optics, correspondence_of, expect};
use super::volume::{Shape, pixel_of_image_share};
use crate::least_squares::PivotedPose;
use crate::locate::choose::Minimum;
use crate::locate::common::{Common, Dependence};
use crate::locate::problem::Problem;
use crate::locate::refine::{centroid, normal_equations};
use crate::target::KnownPoint;
use crate::{Camera, Correspondence, Error, Matrix6, Point, Pose};
use nalgebra::{DMatrix, Matrix6xX};

/// A camera of a rig with its approximate pose.
#[derive(Debug, Clone, Copy)]
pub struct RigCamera<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// x_in_cam = cam_from_rig · x_in_rig.
    pub cam_from_rig: Pose,
    /// Covariance of its intrinsics, row by row, in the order of `Camera::parameters`; `None` where they are exact.
    pub intrinsics_covariance: Option<&'a [f64]>,
}

/// A rig being calibrated by views of one board.
#[derive(Debug, Clone, Copy)]
pub struct RigPlan<'a> {
    /// The cameras, two or more.
    pub cameras: &'a [RigCamera<'a>],
    /// The reference camera, in whose frame the poses of the others are stated.
    pub reference: usize,
    /// The board.
    pub board: &'a Shape,
    /// Standard deviation of each pixel coordinate.
    pub sigma_px: f64,
}

/// What is to be minimised.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Criterion {
    /// The position of the least certain camera, in its worst direction (E-optimal in the positions).
    #[default]
    Worst,
    /// The sum of all variances of all positions (A-optimal).
    Trace,
    /// The volume of the whole uncertainty, including rotations (D-optimal).
    Determinant,
}

/// The information of the views so far about the cameras relative to the reference: 6 rows per camera except the reference, in order, for small
/// left motions `[rotation_rad; translation_m]` of each `cam_from_rig`. It starts from a very weak prior: 10 rad and 1 km.
#[derive(Debug, Clone, PartialEq)]
pub struct RigInformation {
    matrix: DMatrix<f64>,
    reference: usize,
    lenses: Vec<LensInformation>,
}

/// The derivative of the camera positions with respect to a camera's uncertain intrinsics: K and C of docs/math/advise.md eq. (18).
#[derive(Debug, Clone, PartialEq)]
struct LensInformation {
    camera: usize,
    by_places: DMatrix<f64>,
    covariance: DMatrix<f64>,
}

/// The uncertainty of one camera relative to the reference.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CameraOutlook {
    /// Index of the camera.
    pub camera: usize,
    /// 6×6 covariance of the small left motion of its `cam_from_rig`, camera frame.
    pub covariance: Matrix6,
    /// Greatest standard deviation of rotation.
    pub rotation_rad: f64,
    /// Greatest standard deviation of position.
    pub position_m: f64,
    /// The same for exact intrinsics; `None` where all are exact.
    pub position_exact_intrinsics_m: Option<f64>,
    /// Whether the views determine its rotation at all (to better than half a radian).
    pub is_determined: bool,
}

/// A pose for the next board, and the uncertainty of the rig with it.
#[derive(Debug, Clone, PartialEq)]
pub struct Suggestion {
    /// x_in_rig = rig_from_board · x_in_board.
    pub rig_from_board: Pose,
    /// The cameras that would observe it, completely or well enough.
    pub seen_by: Vec<usize>,
    /// The uncertainty of each camera except the reference, in order.
    pub cameras: Vec<CameraOutlook>,
    /// The limits of the camera with the fewest: empty where one camera alone determines the board's pose without a limit.
    pub first_order_limits: Vec<FirstOrderLimit>,
    /// The information with this view.
    pub information: RigInformation,
}

/// Variances of an unknown pose, rad² and m².
const UNKNOWN: [f64; 2] = [1e2, 1e6];
/// A rotation with a larger standard deviation counts as unknown.
const DETERMINED_RAD: f64 = 0.5;
/// A camera that observes fewer points of a board is not used.
const LEAST_POINTS: usize = 6;
/// A board seen at a flatter angle than this (cosine of 75°) is not found.
const LEAST_COSINE: f64 = 0.26;

impl RigInformation {
    /// Returns the information before any view.
    pub fn nothing(plan: &RigPlan) -> Self {
        let n = 6 * plan.cameras.len().saturating_sub(1);
        let variance = |i: usize| if i % 6 < 3 { UNKNOWN[0] } else { UNKNOWN[1] };
        let matrix = DMatrix::from_fn(n, n, |i, j| if i == j { 1.0 / variance(i) } else { 0.0 });
        let lens = |(camera, own): (usize, &RigCamera)| {
            let n_parameters = own.camera.parameters().len();
            // A covariance of another size is refused where a view is expected.
            let rows = own.intrinsics_covariance.filter(|rows| rows.len() == n_parameters * n_parameters)?;
            let covariance = DMatrix::from_row_slice(n_parameters, n_parameters, rows);
            Some(LensInformation { camera, by_places: DMatrix::zeros(n, n_parameters), covariance })
        };
        let lenses = plan.cameras.iter().enumerate().filter_map(lens).collect();
        RigInformation { matrix, reference: plan.reference, lenses }
    }

    /// Returns the covariance of all poses: the contributions of the views and of uncertain intrinsics, docs/math/advise.md eq. (18).
    fn covariance(&self) -> Option<DMatrix<f64>> {
        let by_views = self.matrix.clone().cholesky()?.inverse();
        let mut covariance = by_views.clone();
        for lens in &self.lenses {
            let moved = &by_views * &lens.by_places;
            covariance += &moved * &lens.covariance * moved.transpose();
        }
        Some(covariance)
    }

    /// Returns the uncertainty of each camera except the reference.
    pub fn cameras(&self) -> Option<Vec<CameraOutlook>> {
        let covariance = self.covariance()?;
        let mut cameras: Vec<CameraOutlook> =
            (0..covariance.nrows() / 6).map(|i| self.camera(i, &covariance)).collect();
        if !self.lenses.is_empty() {
            let exact = self.matrix.clone().cholesky()?.inverse();
            for (i, camera) in cameras.iter_mut().enumerate() {
                camera.position_exact_intrinsics_m = Some(self.camera(i, &exact).position_m);
            }
        }
        Some(cameras)
    }

    fn camera(&self, row: usize, joint: &DMatrix<f64>) -> CameraOutlook {
        let covariance: Matrix6 = joint.fixed_view::<6, 6>(6 * row, 6 * row).into_owned();
        let (rotation_rad, position_m) = super::expect::worst_sigmas(&covariance);
        let camera = if row < self.reference { row } else { row + 1 };
        CameraOutlook {
            camera,
            covariance,
            rotation_rad,
            position_m,
            position_exact_intrinsics_m: None,
            is_determined: rotation_rad < DETERMINED_RAD,
        }
    }

    /// Returns minus ln det of the covariance.
    fn log_determinant(&self) -> f64 {
        let root = match self.lenses.is_empty() {
            true => self.matrix.clone().cholesky(),
            false => self.covariance().and_then(|c| c.cholesky()?.inverse().cholesky()),
        };
        root.map_or(f64::NEG_INFINITY, |c| 2.0 * c.l().diagonal().iter().map(|x| x.ln()).sum::<f64>())
    }
}

/// A camera's contribution to a view: its index, and the information about the board's pose in its frame.
struct Share {
    camera: usize,
    information: Matrix6,
    /// The derivative of the pose with respect to uncertain intrinsics: G of docs/math/refine.md eq. (9), one column per parameter; `None` where
    /// exact.
    lens: Option<Matrix6xX<f64>>,
}

impl RigPlan<'_> {
    /// Returns the information after one more view, and the cameras of the view; `None` where fewer than two cameras see the board.
    pub fn with(
        &self,
        so_far: &RigInformation,
        rig_from_board: &Pose,
    ) -> Option<(RigInformation, Vec<usize>)> {
        let shares = self.shares(rig_from_board);
        if shares.len() < 2 {
            return None;
        }
        // Λ_cc' − Λ_c A_c (Σ AᵀΛA)⁻¹ A_c'ᵀ Λ_c', docs/math/advise.md eq. (16).
        let adjoint = |s: &Share| s.information * self.cameras[s.camera].cam_from_rig.adjoint();
        let coupled: Vec<Matrix6> = shares.iter().map(adjoint).collect();
        let of_board =
            |(s, c): (&Share, &Matrix6)| self.cameras[s.camera].cam_from_rig.adjoint().transpose() * c;
        let board: Matrix6 = shares.iter().zip(&coupled).map(of_board).sum();
        let board = crate::pose::symmetric(&board).cholesky()?.inverse();
        let mut matrix = so_far.matrix.clone();
        for (a, ca) in shares.iter().zip(&coupled) {
            for (b, cb) in shares.iter().zip(&coupled) {
                let (Some(i), Some(j)) = (self.row(a.camera), self.row(b.camera)) else { continue };
                let own = if a.camera == b.camera { a.information } else { Matrix6::zeros() };
                let block = own - ca * board * cb.transpose();
                let mut place = matrix.fixed_view_mut::<6, 6>(6 * i, 6 * j);
                place += block;
            }
        }
        let mut lenses = so_far.lenses.clone();
        for (a, lens) in shares.iter().filter_map(|s| Some((s, s.lens.as_ref()?))) {
            let Some(sum) = lenses.iter_mut().find(|l| l.camera == a.camera) else { continue };
            let by_board = self.cameras[a.camera].cam_from_rig.adjoint().transpose() * lens;
            for (b, cb) in shares.iter().zip(&coupled) {
                let Some(i) = self.row(b.camera) else { continue };
                let own = if a.camera == b.camera { lens.clone() } else { Matrix6xX::zeros(lens.ncols()) };
                let mut place = sum.by_places.rows_mut(6 * i, 6);
                place += own - cb * board * &by_board;
            }
        }
        let seen_by = shares.iter().map(|s| s.camera).collect();
        Some((RigInformation { matrix, reference: self.reference, lenses }, seen_by))
    }

    /// Returns the row of a camera among those that are estimated; `None` for the reference.
    fn row(&self, camera: usize) -> Option<usize> {
        (camera != self.reference).then(|| if camera < self.reference { camera } else { camera - 1 })
    }

    fn shares(&self, rig_from_board: &Pose) -> Vec<Share> {
        let share = |camera: usize| {
            let seen = self.seen(camera, rig_from_board)?;
            let own = &self.cameras[camera];
            let cam_from_board = own.cam_from_rig * *rig_from_board;
            let lens = match own.intrinsics_covariance {
                Some(rows) => Some(lens(&cam_from_board, &seen, own.camera, rows)?),
                None => None,
            };
            Some(Share { camera, information: information(&cam_from_board, &seen, own.camera)?, lens })
        };
        (0..self.cameras.len()).filter_map(share).collect()
    }

    fn optics(&self, camera: usize) -> Optics<'_> {
        let RigCamera { camera, intrinsics_covariance, .. } = self.cameras[camera];
        Optics { camera, sigma_px: self.sigma_px, intrinsics_covariance }
    }

    /// Returns the points of a board that a camera observes: all of them, or at least six if points have names, at an angle that is not too
    /// flat.
    pub fn seen(&self, camera: usize, rig_from_board: &Pose) -> Option<Vec<Correspondence>> {
        let own = self.cameras[camera];
        let cam_from_target = own.cam_from_rig * *rig_from_board;
        let shape = self.board;
        let to_camera = (cam_from_target.origin() - shape.centre()).try_normalize(0.0)?;
        if to_camera.dot(&shape.front_in_target) < LEAST_COSINE {
            return None;
        }
        let view = self.optics(camera).view(cam_from_target, &shape.points);
        let seen: Vec<Correspondence> =
            shape.points.iter().filter_map(|p| correspondence_of(&view, p)).collect();
        let whole = seen.len() == shape.points.len() && 4 <= seen.len();
        (whole || shape.works_in_part && LEAST_POINTS <= seen.len()).then_some(seen)
    }

    /// Returns boards that at least two cameras observe, from `n_tried` evenly distributed poses: at `distance_m` from one camera, tilted by up
    /// to 60° towards the centre of the cameras.
    pub fn candidates(&self, distance_m: [f64; 2], n_tried: usize) -> Vec<Pose> {
        (0..n_tried)
            .filter_map(|i| self.candidate(i, distance_m))
            .filter(|pose| 1 < self.shares(pose).len())
            .collect()
    }

    fn candidate(&self, index: usize, [near, far]: [f64; 2]) -> Option<Pose> {
        let own = &self.cameras[index % self.cameras.len()];
        let [d, t, a, r, u, v] = super::volume::even(index);
        let ray = own.camera.bearing(&pixel_of_image_share(own.camera, u, v)).ok()?.into_inner();
        let rig_from_cam = own.cam_from_rig.inverse();
        let centre_in_rig = rig_from_cam * (ray * (near + (far - near) * d));
        Some(self.rig_from_board_at(
            &centre_in_rig,
            t * 60f64.to_radians(),
            a * core::f64::consts::TAU,
            r * core::f64::consts::TAU,
        ))
    }

    /// Returns `rig_from_board` with the centre at a position, the centre of the cameras `tilt_rad` off its front normal in the direction
    /// `direction_rad` around it, and the board rolled by `roll_rad`.
    pub fn rig_from_board_at(
        &self,
        centre_in_rig: &Point,
        tilt_rad: f64,
        direction_rad: f64,
        roll_rad: f64,
    ) -> Pose {
        let n = self.cameras.len().max(1) as f64;
        let middle = self.cameras.iter().map(|c| c.cam_from_rig.origin()).sum::<Point>() / n;
        // A virtual camera with the rig's axes, at the centre of all cameras.
        let shape = self.board.cam_from_target(&(centre_in_rig - middle), tilt_rad, direction_rad, roll_rad);
        Pose::new(shape.rotation, shape.translation + middle)
    }

    /// Ranks the candidates, best first: the number of undetermined cameras counts first, then the criterion. At most `n_best`, no two with
    /// centres closer than a quarter of the distance between the nearest camera and the board.
    ///
    /// # Errors
    /// `EmptyRig` for fewer than two cameras; `InvalidSetting` where no candidate is seen by two.
    pub fn next(
        &self,
        so_far: &RigInformation,
        candidates: &[Pose],
        criterion: Criterion,
        n_best: usize,
    ) -> Result<Vec<Suggestion>, Error> {
        if self.cameras.len() < 2 {
            return Err(Error::EmptyRig);
        }
        let mut scored: Vec<(usize, f64, usize)> = candidates
            .iter()
            .enumerate()
            .filter_map(|(i, pose)| score(&self.with(so_far, pose)?.0, criterion).map(|(n, s)| (n, s, i)))
            .collect();
        scored.sort_by(|a, b| a.0.cmp(&b.0).then(a.1.total_cmp(&b.1)));
        let mut best: Vec<Suggestion> = Vec::new();
        for (_, _, i) in scored {
            if best.len() == n_best {
                break;
            }
            if best.iter().all(|b| self.are_apart(&b.rig_from_board, &candidates[i])) {
                best.extend(self.suggestion(so_far, &candidates[i]));
            }
        }
        let none = Error::InvalidSetting {
            setting: "the number of boards that two cameras see",
            seen: 0.0,
            needed: "at least one: check the rig's poses and the distances",
        };
        if best.is_empty() { Err(none) } else { Ok(best) }
    }

    fn are_apart(&self, a: &Pose, b: &Pose) -> bool {
        let centre = self.board.centre();
        let (a, b) = (a * &centre, b * &centre);
        let nearest = self.cameras.iter().map(|c| (c.cam_from_rig.origin() - a).norm());
        0.25 * nearest.fold(f64::INFINITY, f64::min) < (a - b).norm()
    }

    /// Returns the rig with one more board; `None` where fewer than two cameras see it.
    pub fn suggestion(&self, so_far: &RigInformation, rig_from_board: &Pose) -> Option<Suggestion> {
        let (information, seen_by) = self.with(so_far, rig_from_board)?;
        let first_order_limits = seen_by
            .iter()
            .map(|camera| self.first_order_limits(*camera, rig_from_board))
            .min_by_key(Vec::len)?;
        let cameras = information.cameras()?;
        Some(Suggestion {
            rig_from_board: *rig_from_board,
            seen_by,
            cameras,
            first_order_limits,
            information,
        })
    }

    fn first_order_limits(&self, camera: usize, rig_from_board: &Pose) -> Vec<FirstOrderLimit> {
        let Some(seen) = self.seen(camera, rig_from_board) else { return Vec::new() };
        let known = |c: &Correspondence| KnownPoint { position: c.x_in_target, sigma_m: c.sigma_m };
        let points: Vec<KnownPoint> = seen.iter().map(known).collect();
        let own = &self.cameras[camera];
        let cam_from_target = own.cam_from_rig * *rig_from_board;
        let view = self.optics(camera).view(cam_from_target, &points);
        expect(&view).map(|e| e.first_order_limits()).unwrap_or_default()
    }
}

/// Returns the number of undetermined cameras and the criterion; smaller is better.
fn score(information: &RigInformation, criterion: Criterion) -> Option<(usize, f64)> {
    let cameras = information.cameras()?;
    let undetermined = cameras.iter().filter(|c| !c.is_determined).count();
    let determined = || cameras.iter().filter(|c| c.is_determined);
    let value = match criterion {
        Criterion::Worst => determined().map(|c| c.position_m).fold(0.0, f64::max),
        Criterion::Trace => determined().map(|c| c.covariance.fixed_view::<3, 3>(3, 3).trace()).sum::<f64>(),
        Criterion::Determinant => -information.log_determinant(),
    };
    Some((undetermined, value))
}

/// Returns G for a view of the board.
fn lens(
    cam_from_board: &Pose,
    seen: &[Correspondence],
    camera: &Camera,
    rows: &[f64],
) -> Option<Matrix6xX<f64>> {
    let common = Common { intrinsics: Some(rows), scale_sigma: [0.0; 2] };
    let dependence = Dependence::at(&Minimum::assumed(cam_from_board), &Problem::new(seen, camera), &common);
    Some(Matrix6xX::from_columns(dependence.ok()?.by_intrinsics()))
}

/// Returns the information of small left motions of `cam_from_board`, summed about the points' centroid and transformed to the camera.
fn information(cam_from_board: &Pose, seen: &[Correspondence], camera: &Camera) -> Option<Matrix6> {
    let pivot = centroid(seen);
    let place = PivotedPose::new(cam_from_board, &pivot);
    let about_pivot = normal_equations(&place, &pivot, &Problem::new(seen, camera))?.information();
    let mut back = Matrix6::identity();
    back.fixed_view_mut::<3, 3>(3, 0).copy_from(&-place.pivot_in_cam.cross_matrix());
    Some(crate::pose::symmetric(&(back.transpose() * about_pivot * back)))
}
