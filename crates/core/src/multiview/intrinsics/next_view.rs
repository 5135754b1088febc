//! Selects the view to take next: among views of flat targets at several positions, distances and tilts, the one after which the projection over
//! the image is most certain. docs/math/intrinsics.md section 9.

use super::adjust::{Fit, Seen, equations};
use super::projection::{Projection, grid};
use crate::camera::ImageSize;
use crate::least_squares::PivotedPose;
use crate::{Correspondence, Pixel, Point, Pose, Vector6};
use nalgebra::{DMatrix, Vector3};

/// A recommended view.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NextView {
    /// Position of the target's centre in the image.
    pub centre: Pixel,
    /// The angle by which it should be tilted, rad, about …
    pub tilt_rad: f64,
    /// … this axis in the image, rad from the u axis towards the v axis: a tilt about v (90°) moves the target's left or right edge towards the
    /// camera.
    pub axis_rad: f64,
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
/// A view counts if at least this part of the target is in the image.
const VISIBLE: f64 = 0.7;

/// Returns the best of the grid of views; `None` where no view shows the target, or the fit has no covariance.
pub(super) fn next_view(
    fit: &Fit,
    size: ImageSize,
    covariance: &DMatrix<f64>,
    noise: f64,
) -> Option<NextView> {
    let model = fit.seen.iter().max_by_key(|view| view.points.len())?;
    let information = covariance.clone().try_inverse()?;
    let n = fit.shared.camera.parameters().len();
    let corners: Vec<Pixel> = fit.seen.iter().flat_map(|view| view.points.iter().map(|c| c.pixel)).collect();
    let zero = DMatrix::zeros(n, n);
    let projection = Projection::new(&fit.shared.camera, &zero, corners);
    let rows: Vec<_> = grid(size, 9, 7).filter_map(|pixel| projection.by_parameters(&pixel)).collect();
    let rms_px = |covariance: &DMatrix<f64>| {
        let of_place = |row: &nalgebra::OMatrix<f64, nalgebra::U2, nalgebra::Dyn>| {
            let small =
                nalgebra::OMatrix::<f64, nalgebra::U2, nalgebra::Dyn>::from_fn(covariance.nrows(), |i, j| {
                    fit.shared
                        .directions
                        .get(j)
                        .map_or(0.0, |d| d.iter().map(|(p, by)| row[(i, *p)] * by).sum())
                });
            (&small * covariance * small.transpose()).trace()
        };
        (rows.iter().map(of_place).sum::<f64>() / rows.len().max(1) as f64).sqrt()
    };
    let now_px = rms_px(covariance);
    let mut best: Option<NextView> = None;
    for (centre, tilt_rad, axis_rad, part) in candidates(size) {
        let Some(view) = imagined(fit, model, size, centre, tilt_rad, axis_rad, part) else { continue };
        let place = PivotedPose::new(&view.cam_from_target, &view.pivot);
        let Some(added) =
            equations(std::slice::from_ref(&view), &[place], &fit.shared).and_then(|e| e.reduced())
        else {
            continue;
        };
        let Some(then) = (&information + added.information / noise).cholesky().map(|c| c.inverse()) else {
            continue;
        };
        let then_px = rms_px(&then);
        if best.is_none_or(|best| then_px < best.then_px) && then_px.is_finite() {
            let distance_m = (view.cam_from_target * view.pivot).norm();
            best = Some(NextView { centre, tilt_rad, axis_rad, distance_m, now_px, then_px });
        }
    }
    best
}

fn candidates(size: ImageSize) -> impl Iterator<Item = (Pixel, f64, f64, f64)> {
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let places =
        PLACES.iter().flat_map(move |u| PLACES.iter().map(move |v| Pixel::new(u * width, v * height)));
    places.flat_map(|centre| {
        TILTS_RAD.iter().flat_map(move |tilt| {
            let axes = if *tilt == 0.0 { 1 } else { 2 * AXES };
            (0..axes).flat_map(move |axis| {
                let axis_rad = std::f64::consts::PI * axis as f64 / AXES as f64;
                SIZES.iter().map(move |part| (centre, *tilt, axis_rad, *part))
            })
        })
    })
}

/// Returns the view of the target with its centre at a pixel, tilted, at the distance where it fills a part of the image; `None` if hardly
/// visible.
fn imagined(
    fit: &Fit,
    model: &Seen,
    size: ImageSize,
    centre: Pixel,
    tilt_rad: f64,
    axis_rad: f64,
    part: f64,
) -> Option<Seen> {
    let camera = &fit.shared.camera;
    let towards = camera.bearing(&centre).ok()?.into_inner();
    let (low, high) = model.points.iter().fold((model.pivot, model.pivot), |(low, high), c| {
        (low.zip_map(&c.x_in_target, f64::min), high.zip_map(&c.x_in_target, f64::max))
    });
    let focal = camera.matrix()?.fx_px;
    let shorter = f64::from(size.width_px.min(size.height_px));
    let distance = focal * (high - low).amax() / (part * shorter);
    let turn = |w: Vector3<f64>| Pose::exp(&Vector6::new(w.x, w.y, w.z, 0.0, 0.0, 0.0)).rotation;
    let rotation = turn(Vector3::new(axis_rad.cos(), axis_rad.sin(), 0.0) * tilt_rad);
    let middle: Point = 0.5 * (low + high);
    let cam_from_target = Pose::new(rotation, towards * distance - rotation * middle);
    let in_image = |c: &&Correspondence| {
        camera.project(&(cam_from_target * c.x_in_target)).is_some_and(|pixel| camera.contains(&pixel))
    };
    let points: Vec<Correspondence> = model.points.iter().filter(in_image).copied().collect();
    if (points.len() as f64) < VISIBLE * model.points.len() as f64 || points.len() < 6 {
        return None;
    }
    let weights = vec![1.0; points.len()];
    let pivot = crate::locate::refine::centroid(&points);
    Some(Seen { view: 0, points, weights, pivot, cam_from_target, has_rival: false })
}
