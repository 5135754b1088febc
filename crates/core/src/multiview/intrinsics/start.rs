//! Finds a first camera without a start: focal lengths from the homographies of flat targets and from a grid, each with poses by the closed
//! forms; the best of them is selected after a short adjustment. docs/math/intrinsics.md section 1.

use super::adjust::{Fit, Seen, Shared, fit, located};
use super::model::{LensChoice, central_matrix, common_focal};
use crate::camera::ImageSize;
use crate::locate::refine::centroid;
use crate::{Camera, CameraMatrix, Correspondence, Lens, Pixel};
use nalgebra::{Matrix3, SMatrix, Vector3};

/// Number of views on which starts are tried, spread over the given order.
const MAX_VIEWS: usize = 12;
/// Focal lengths tried, in units of the image's longer side: from a fisheye to a telephoto lens, each 1.7 times the one before.
const FOCALS: [f64; 8] = [0.2, 0.33, 0.55, 0.9, 1.5, 2.6, 4.4, 8.0];
/// Number of focal lengths from which the adjustment starts.
const TRIED: usize = 3;
/// Residual of views without a pose: larger than any other.
const NO_POSE: f64 = f64::INFINITY;

/// Returns the best camera of a choice, adjusted to some of the views; `None` where no focal length gives most of them a pose.
pub(super) fn start(views: &[&[Correspondence]], size: ImageSize, choice: &LensChoice) -> Option<Camera> {
    let step = views.len().div_ceil(MAX_VIEWS).max(1);
    let some: Vec<&[Correspondence]> = views.iter().copied().step_by(step).collect();
    let side = f64::from(size.width_px.max(size.height_px));
    let by_homographies = focal_of_homographies(views, size).filter(|f| (0.05..20.0).contains(&(f / side)));
    let camera = |focal_px: f64| -> Option<Camera> {
        let lens: Lens = choice.lens(central_matrix(size, focal_px)).ok()?;
        Some(Camera { lens, size: Some(size) })
    };
    // If the homographies lead to an answer that fits, nothing else is tried.
    let first = by_homographies.and_then(camera).and_then(|camera| adjusted(&some, camera, choice));
    if let Some((_, camera)) = first.filter(|(badness, _)| *badness < good_px(&some, side)) {
        return Some(camera);
    }
    let focals = FOCALS.iter().map(|f| f * side).chain(by_homographies);
    let mut tried: Vec<(f64, Camera)> = focals
        .filter_map(camera)
        .map(|camera| (badness(&some, &camera), camera))
        .filter(|(badness, _)| *badness < NO_POSE)
        .collect();
    tried.sort_by(|a, b| a.0.total_cmp(&b.0));
    let adjusted = tried.into_iter().take(TRIED).filter_map(|(_, camera)| adjusted(&some, camera, choice));
    let best = adjusted.min_by(|a, b| a.0.total_cmp(&b.0));
    best.map(|(_, camera)| camera)
}

/// Returns the residual with which a start is accepted: five standard deviations of the corners, at most a thousandth of the image's side.
fn good_px(views: &[&[Correspondence]], side: f64) -> f64 {
    let mut sigmas: Vec<f64> = views.iter().flat_map(|points| points.iter()).map(|c| c.sigma_px).collect();
    sigmas.sort_by(f64::total_cmp);
    sigmas.get(sigmas.len() / 2).map_or(0.0, |sigma| (5.0 * sigma).min(1e-3 * side))
}

/// Returns the median over the views of the root mean square residual, px: half of the views may be bad.
fn badness(views: &[&[Correspondence]], camera: &Camera) -> f64 {
    let mut rms: Vec<f64> = views.iter().map(|points| rms_px(points, camera).unwrap_or(NO_POSE)).collect();
    rms.sort_by(f64::total_cmp);
    rms.get(rms.len() / 2).copied().unwrap_or(NO_POSE)
}

fn rms_px(points: &[Correspondence], camera: &Camera) -> Option<f64> {
    let weights = vec![1.0; points.len()];
    let cam_from_target = located(points, &weights, camera).ok()?.cam_from_target;
    let squared = points.iter().map(|c| {
        camera.project(&(cam_from_target * c.x_in_target)).map(|pixel| (pixel - c.pixel).norm_squared())
    });
    let sum: Option<f64> = squared.sum();
    Some((sum? / points.len() as f64).sqrt())
}

/// Returns the camera after adjusting the focal length alone, then with the first coefficient; with its median residual.
fn adjusted(views: &[&[Correspondence]], camera: Camera, choice: &LensChoice) -> Option<(f64, Camera)> {
    let located = |(view, points): (usize, &&[Correspondence])| {
        Seen::located(view, points, vec![1.0; points.len()], &camera).ok()
    };
    let seen: Vec<Seen> = views.iter().enumerate().filter_map(located).collect();
    let mut directions: arrayvec::ArrayVec<_, 2> = [common_focal(&camera.parameters())].into_iter().collect();
    let mut best = fit(seen, Shared { camera, shape: None, directions: directions.to_vec(), noise: 0.0 })?;
    let first = choice
        .coefficients
        .first()
        .and_then(|name| best.shared.camera.parameters().iter().position(|(other, _)| other == name));
    if let Some(index) = first {
        directions.push([(index, 1.0)].into_iter().collect());
        let shared = Shared { directions: directions.to_vec(), ..best.shared.clone() };
        best = lower(fit(best.seen.clone(), shared), best);
    }
    Some((badness(views, &best.shared.camera), best.shared.camera))
}

fn lower(next: Option<Fit>, before: Fit) -> Fit {
    match next {
        Some(next) if next.chi2() < before.chi2() => next,
        _ => before,
    }
}

/// Returns the focal length for which the columns of the homographies of flat targets are best perpendicular and of equal length, with square
/// pixels and a central principal point: docs/math/intrinsics.md eqs. (1) to (3). `None` where no view is tilted, or targets are not flat.
pub(super) fn focal_of_homographies(views: &[&[Correspondence]], size: ImageSize) -> Option<f64> {
    let centre = central_matrix(size, 1.0);
    let side = f64::from(size.width_px.max(size.height_px));
    let (mut up, mut down) = (0.0, 0.0);
    for points in views {
        let Some(h) = homography(points, &centre, side) else { continue };
        let (a, b) = (h.column(0), h.column(1));
        // With ω = diag(w, w, 1), w = 1/f²: aᵀωb = 0 and aᵀωa = bᵀωb, both linear in w.
        for (xy, z) in [
            (a.x * b.x + a.y * b.y, a.z * b.z),
            (a.x * a.x + a.y * a.y - b.x * b.x - b.y * b.y, a.z * a.z - b.z * b.z),
        ] {
            up -= xy * z;
            down += xy * xy;
        }
    }
    let w = up / down;
    let focal = (1.0 / w).sqrt() * side;
    (0.0 < w && focal.is_finite()).then_some(focal)
}

/// Returns the homography from the target's plane z = constant to the image, in units of its side about the centre, with one scale over all
/// views (mean square of the first two columns 1).
fn homography(points: &[Correspondence], centre: &CameraMatrix, side: f64) -> Option<Matrix3<f64>> {
    let first = points.first()?;
    if points.len() < 4 || points.iter().any(|c| 1e-9 < (c.x_in_target.z - first.x_in_target.z).abs()) {
        return None;
    }
    let middle = centroid(points);
    let spread = points.iter().map(|c| (c.x_in_target - middle).norm_squared()).sum::<f64>();
    let scale = (spread / points.len() as f64).sqrt();
    let unit = |pixel: &Pixel| [(pixel.x - centre.cx_px) / side, (pixel.y - centre.cy_px) / side];
    let mut normal = SMatrix::<f64, 9, 9>::zeros();
    for c in points {
        let x = (c.x_in_target - middle) / scale;
        let (x, [u, v]) = (Vector3::new(x.x, x.y, 1.0), unit(&c.pixel));
        for (axis, value) in [(0, u), (1, v)] {
            let mut row = SMatrix::<f64, 9, 1>::zeros();
            for i in 0..3 {
                row[3 * axis + i] = x[i];
                row[6 + i] = -value * x[i];
            }
            normal += row * row.transpose();
        }
    }
    if !normal.iter().all(|value| value.is_finite()) {
        return None;
    }
    let eigen = normal.symmetric_eigen();
    let h = eigen.eigenvectors.column(eigen.eigenvalues.imin()).into_owned();
    let h = Matrix3::from_fn(|i, j| h[3 * i + j]);
    let size = (0.5 * (h.column(0).norm_squared() + h.column(1).norm_squared())).sqrt();
    (0.0 < size).then(|| h / size)
}
