//! The prior of every lens: pixels are nearly square, the principal point is near the centre, the distortion is bounded. It is wide enough to
//! have no effect where the views determine the lens. docs/math/intrinsics.md section 3.

use crate::Camera;
use crate::camera::{BrownConrady, KannalaBrandt};
use crate::least_squares::shared::SharedEquations;
use crate::multiview::intrinsics_check::Direction;
use nalgebra::DVector;

/// Standard deviations of fy/fx − 1, of the principal point in parts of the width, of tangential coefficients, …
const ASPECT: f64 = 0.008;
const CENTRE: f64 = 0.04;
const TANGENTIAL: f64 = 0.005;
/// … of the displacement of the image's corner by a radial term, in parts of its radius, at this horizontal field of view; in proportion at
/// others.
const RADIAL: f64 = 0.3;
const FIELD_RAD: f64 = 1.2217;
/// Radial coefficients in order; the denominators of the rational model have no prior.
const RADIALS: [&str; 4] = ["k1", "k2", "k3", "k4"];

/// States that Σ by·parameter is `mean` ± `sigma`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Known {
    along: [(usize, f64); 2],
    mean: f64,
    sigma: f64,
}

/// Returns the prior for a camera of this model, size and approximate focal length; empty without an image size.
pub(super) fn known(camera: &Camera) -> Vec<Known> {
    let (Some(size), Some(matrix)) = (camera.size, camera.matrix()) else { return Vec::new() };
    let (width, height) = (f64::from(size.width_px), f64::from(size.height_px));
    let focal = matrix.fx_px;
    let one = |at: usize, mean: f64, sigma: f64| Known { along: [(at, 1.0), (at, 0.0)], mean, sigma };
    let aspect = Known { along: [(0, -1.0 / focal), (1, 1.0 / focal)], mean: 0.0, sigma: ASPECT };
    let mut all = vec![
        aspect,
        one(2, 0.5 * (width - 1.0), CENTRE * width),
        one(3, 0.5 * (height - 1.0), CENTRE * width),
    ];
    let parameters = camera.parameters();
    let is_rational = parameters.iter().any(|(name, _)| *name == "k6");
    let is_series = [BrownConrady::NAME, KannalaBrandt::NAME].contains(&camera.model_name());
    if is_rational || !is_series {
        return all;
    }
    let corner = 0.5 * width.hypot(height) / focal;
    let bend = RADIAL * 2.0 * (0.5 * width).atan2(focal) / FIELD_RAD;
    for (at, (name, _)) in parameters.iter().enumerate() {
        if let Some(order) = RADIALS.iter().position(|radial| radial == name) {
            all.push(one(at, 0.0, bend / corner.powi(2 * (order as i32 + 1))));
        } else if name.starts_with('p') {
            all.push(one(at, 0.0, TANGENTIAL));
        }
    }
    all
}

/// Returns what is known of a camera of this model, size and approximate focal length as rows a and values b: b − aᵀθ has variance 1 for the
/// parameters θ.
pub(in crate::multiview) fn rows(camera: &Camera) -> Vec<(DVector<f64>, f64)> {
    let n = camera.parameters().len();
    let row = |known: Known| {
        let mut a = DVector::zeros(n);
        known.along.iter().for_each(|(i, by)| a[*i] += by / known.sigma);
        (a, known.mean / known.sigma)
    };
    known(camera).into_iter().map(row).collect()
}

/// Adds what is known of `camera`, which may change along `directions`, to the equations of all views, whose noise has `noise` times the stated
/// variances.
pub(super) fn add(
    sums: &mut SharedEquations,
    known: &[Known],
    camera: &Camera,
    directions: &[Direction],
    noise: f64,
) {
    if !(0.0 < noise) || directions.is_empty() {
        return;
    }
    let parameters = camera.parameters();
    for Known { along, mean, sigma } in known {
        let value: f64 = along.iter().map(|(i, by)| by * parameters[*i].1).sum();
        let by_direction = |direction: &Direction| -> f64 {
            let pairs =
                direction.iter().flat_map(|(i, by)| along.iter().map(move |(j, times)| (i, by, j, times)));
            pairs.filter(|(i, _, j, _)| i == j).map(|(_, by, _, times)| by * times).sum()
        };
        let by_shared = DVector::from_fn(sums.n_shared(), |k, _| directions.get(k).map_or(0.0, by_direction));
        if by_shared.amax() > 0.0 {
            sums.add_known(mean - value, noise / (sigma * sigma), &by_shared);
        }
    }
}
