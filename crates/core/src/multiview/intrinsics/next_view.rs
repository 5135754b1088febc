//! Selects the view to take next: among views of flat targets at several positions, distances and tilts, the one after which the projection over
//! the image is most certain. docs/math/intrinsics.md section 9.

use super::adjust::{Fit, Seen, Shared, equations};
use super::projection::{Held, derivatives, grid, worse_variance};
use crate::camera::ImageSize;
use crate::least_squares::PivotedPose;
use crate::{Camera, Correspondence, Pixel, Point, Pose, Vector6};
use nalgebra::{DMatrix, Dyn, Matrix2x3, OMatrix, U2, Vector3};

/// Where a target is to be in the image, and how it is tilted.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Position of the target's centre in the image.
    pub centre: Pixel,
    /// The angle by which it should be tilted, rad, about …
    pub tilt_rad: f64,
    /// … this axis in the image, rad from the u axis towards the v axis: a tilt about v (90°) moves the target's right edge towards the
    /// camera.
    pub axis_rad: f64,
    /// Its size in the image, as a part of the image's shorter side.
    pub part: f64,
}

/// A recommended view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NextView {
    /// Where the target should be.
    pub placement: Placement,
    /// Its pose there, for a target with the axes of the camera where it is not tilted.
    pub cam_from_target: Pose,
    /// Its distance, metres.
    pub distance_m: f64,
    /// Root mean square projection uncertainty over the image, px: now …
    pub now_px: f64,
    /// … and with this view.
    pub then_px: f64,
}

/// Positions in the image, as parts of its sides.
const PLACES: [f64; 3] = [0.2, 0.5, 0.8];
/// Tilts, rad.
const TILTS_RAD: [f64; 2] = [0.0, 0.7];
/// Number of directions of the tilt axis.
const AXES: usize = 4;
/// Sizes of the target in the image, as parts of its shorter side.
const SIZES: [f64; 2] = [0.35, 0.7];
/// A view counts if at least this part of the target is in the image, or as much as every view so far has shown: a detector may need all of it.
const VISIBLE: f64 = 0.7;

/// The uncertainty of the projection over the image, and what one more view would make of it.
#[derive(Debug, Clone)]
pub struct Forecast {
    known: Known,
    /// The corners that fix the camera's rotation.
    held: Held,
    /// The derivatives of the projection at the positions of a grid, with respect to a rotation and to the parameters.
    places: Vec<(Matrix2x3<f64>, Rows)>,
    /// Root mean square over the grid, px, which is finer where `now_px` is computed.
    of_grid_px: f64,
}

/// What is known before the view.
#[derive(Debug, Clone)]
pub(super) struct Known {
    /// The shared unknowns, among them every coefficient that is possibly needed.
    pub(super) shared: Shared,
    /// Their covariance, singular where a coefficient is known to be zero.
    pub(super) covariance: DMatrix<f64>,
    /// Factor on the variances of the corners of a further view.
    pub(super) noise: f64,
    /// Root mean square uncertainty of the projection over the image, px.
    pub(super) now_px: f64,
}

type Rows = OMatrix<f64, U2, Dyn>;

impl Forecast {
    /// Prepares the forecast.
    pub(super) fn new(fit: &Fit, size: ImageSize, known: Known) -> Self {
        let camera = &known.shared.camera;
        let corners = fit.seen.iter().flat_map(|view| view.points.iter().map(|c| c.pixel));
        let held = Held::new(camera, corners);
        let places = grid(size, 9, 7).filter_map(|pixel| derivatives(camera, &pixel)).collect();
        let mut forecast = Forecast { known, held, places, of_grid_px: 0.0 };
        forecast.of_grid_px = forecast.rms_px(&forecast.held, &forecast.known.covariance);
        forecast
    }

    /// Returns the root mean square over the grid of the standard deviations along the worse directions, with the rotation that corners hold.
    fn rms_px(&self, held: &Held, covariance: &DMatrix<f64>) -> f64 {
        let rotation = held.rotation_of_change();
        let directions = &self.known.shared.directions;
        let variance = |(by_rotation, by_parameters): &(Matrix2x3<f64>, Rows)| {
            let row = by_parameters + by_rotation * &rotation;
            let row = Rows::from_fn(covariance.nrows(), |i, j| {
                directions.get(j).map_or(0.0, |d| d.iter().map(|(p, by)| row[(i, *p)] * by).sum())
            });
            worse_variance(&(&row * covariance * row.transpose()))
        };
        let sum: f64 = self.places.iter().map(variance).sum();
        (sum / self.places.len().max(1) as f64).sqrt()
    }

    /// Returns the root mean square projection uncertainty over the image, px.
    pub fn now_px(&self) -> f64 {
        self.known.now_px
    }

    /// Returns the root mean square projection uncertainty with one more view of these points, px; `None` where the camera has no pose for them.
    pub fn with_view_px(&self, points: &[Correspondence]) -> Option<f64> {
        let weights = vec![1.0; points.len()];
        let view = Seen::located(0, points, weights, &self.known.shared.camera).ok()?;
        self.with(&view)
    }

    /// Computes docs/math/intrinsics.md eq. (15).
    fn with(&self, view: &Seen) -> Option<f64> {
        let Known { shared, covariance, noise, now_px } = &self.known;
        let place = PivotedPose::new(&view.cam_from_target, &view.pivot);
        let added = equations(std::slice::from_ref(view), &[place], shared)?.reduced()?.information / *noise;
        let identity = DMatrix::identity(covariance.nrows(), covariance.nrows());
        let then = covariance * (identity + added * covariance).try_inverse()?;
        let mut held = self.held.clone();
        for c in &view.points {
            if let Some(pixel) = shared.camera.project(&(view.cam_from_target * c.x_in_target)) {
                held.add(&shared.camera, &pixel);
            }
        }
        Some(now_px * self.rms_px(&held, &then) / self.of_grid_px).filter(|px| px.is_finite())
    }
}

/// Returns the best of the grid of views; `None` where no view shows the target.
pub(super) fn next_view(fit: &Fit, size: ImageSize, forecast: &Forecast) -> Option<NextView> {
    let model = fit.seen.iter().max_by_key(|view| view.points.len())?;
    let fewest = fit.seen.iter().map(|view| view.points.len()).min()?;
    let needed = (VISIBLE * model.points.len() as f64).max(fewest as f64).max(6.0);
    let mut best: Option<NextView> = None;
    for placement in candidates(size) {
        let Some(view) = imagined(fit, model, size, &placement) else { continue };
        if (view.points.len() as f64) < needed {
            continue;
        }
        let Some(then_px) = forecast.with(&view) else { continue };
        if best.is_none_or(|best| then_px < best.then_px) {
            let distance_m = (view.cam_from_target * view.pivot).norm();
            let (cam_from_target, now_px) = (view.cam_from_target, forecast.now_px());
            best = Some(NextView { placement, cam_from_target, distance_m, now_px, then_px });
        }
    }
    best
}

fn candidates(size: ImageSize) -> impl Iterator<Item = Placement> {
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let places =
        PLACES.iter().flat_map(move |u| PLACES.iter().map(move |v| Pixel::new(u * width, v * height)));
    places.flat_map(|centre| {
        TILTS_RAD.iter().flat_map(move |tilt_rad| {
            let axes = if *tilt_rad == 0.0 { 1 } else { 2 * AXES };
            (0..axes).flat_map(move |axis| {
                let axis_rad = std::f64::consts::PI * axis as f64 / AXES as f64;
                SIZES.iter().map(move |part| Placement { centre, tilt_rad: *tilt_rad, axis_rad, part: *part })
            })
        })
    })
}

impl Placement {
    /// Returns the pose of a target whose points lie between two corners of a box; `None` where the centre is outside the camera's field.
    pub fn cam_from_target(&self, camera: &Camera, size: ImageSize, [low, high]: [Point; 2]) -> Option<Pose> {
        let towards = camera.bearing(&self.centre).ok()?.into_inner();
        let shorter = f64::from(size.width_px.min(size.height_px));
        let distance = camera.matrix()?.fx_px * (high - low).amax() / (self.part * shorter);
        let turn = |w: Vector3<f64>| Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
        let axis = Vector3::new(self.axis_rad.cos(), self.axis_rad.sin(), 0.0);
        let rotation = turn(axis * self.tilt_rad);
        let middle: Point = 0.5 * (low + high);
        Some(Pose::new(rotation, towards * distance - rotation * middle))
    }
}

/// Returns a view of the points of the target that are in the image; `None` where there is none.
fn imagined(fit: &Fit, model: &Seen, size: ImageSize, placement: &Placement) -> Option<Seen> {
    let camera = &fit.shared.camera;
    let bounds = model.points.iter().fold([model.pivot; 2], |[low, high], c| {
        [low.zip_map(&c.x_in_target, f64::min), high.zip_map(&c.x_in_target, f64::max)]
    });
    let cam_from_target = placement.cam_from_target(camera, size, bounds)?;
    let in_image = |c: &&Correspondence| {
        camera.project(&(cam_from_target * c.x_in_target)).is_some_and(|pixel| camera.contains(&pixel))
    };
    let points: Vec<Correspondence> = model.points.iter().filter(in_image).copied().collect();
    if points.is_empty() {
        return None;
    }
    let weights = vec![1.0; points.len()];
    let pivot = crate::locate::refine::centroid(&points);
    Some(Seen { view: 0, points, weights, pivot, cam_from_target, has_rival: false })
}
