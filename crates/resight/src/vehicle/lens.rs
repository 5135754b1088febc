//! The drive through lenses within the uncertainty of the intrinsics: docs/math/vehicle.md eq. (18).

use super::pair::PairTimes;
use crate::core::multiview::two_view::{BearingPair, TwoViewConfig, refine_two_view};
use crate::core::temporal::vehicle::{FrameMotion, LensVariation};
use crate::core::{Camera, Pose};
use crate::locate::IntrinsicsCovariance;
use nalgebra::{DMatrix, SymmetricEigen};

/// Cameras that differ from the stated one by one standard deviation along each principal axis of its covariance, with their motions.
pub(super) struct OtherLenses {
    stated: Camera,
    /// Camera k + l and camera k − l; `None` where there is no such lens.
    cameras: Vec<[Option<Camera>; 2]>,
    pub motions: Vec<LensVariation>,
}

/// Principal axes with a smaller share of the variance, each parameter in its own standard deviation, are rounding.
const LEAST_SHARE: f64 = 1e-9;

impl OtherLenses {
    /// None where the intrinsics are exact.
    pub fn new(camera: &Camera, intrinsics: Option<&IntrinsicsCovariance>) -> Self {
        let columns = intrinsics.map_or_else(Vec::new, |known| columns(camera, known));
        let values: Vec<f64> = camera.parameters().iter().map(|(_, value)| *value).collect();
        let moved = |column: &[f64], sign: f64| {
            let moved: Vec<f64> = values.iter().zip(column).map(|(value, by)| value + sign * by).collect();
            camera.with_parameters(&moved).ok()
        };
        let cameras: Vec<_> =
            columns.iter().map(|column| [moved(column, 1.0), moved(column, -1.0)]).collect();
        let empty = || LensVariation { plus: Vec::new(), minus: Vec::new() };
        OtherLenses { stated: camera.clone(), motions: cameras.iter().map(|_| empty()).collect(), cameras }
    }

    /// Adds a pair of frames without parallax, which is one through every lens.
    pub fn still(&mut self, motion: &FrameMotion) {
        for side in self.motions.iter_mut().flat_map(|motions| [&mut motions.plus, &mut motions.minus]) {
            side.push(motion.clone());
        }
    }

    /// Adds a pair of frames, from the same pixels.
    pub fn push(&mut self, pairs: &[BearingPair], near: &Pose, times: &PairTimes) {
        for (cameras, motions) in self.cameras.iter().zip(&mut self.motions) {
            for (camera, side) in cameras.iter().zip([&mut motions.plus, &mut motions.minus]) {
                let Some(camera) = camera else { continue };
                let pairs: Vec<BearingPair> =
                    pairs.iter().filter_map(|pair| through(pair, &self.stated, camera)).collect();
                if let Ok(view) = refine_two_view(&pairs, near, &TwoViewConfig::default()) {
                    side.push(times.motion(&pairs, &view));
                }
            }
        }
    }
}

/// Columns l with Σ l lᵀ the covariance of the intrinsics.
fn columns(camera: &Camera, known: &IntrinsicsCovariance) -> Vec<Vec<f64>> {
    let n = camera.parameters().len();
    let covariance = DMatrix::from_row_slice(n, n, &known.covariance(camera));
    let sigma = covariance.diagonal().map(|variance| variance.max(0.0).sqrt());
    let unit = |i: usize, j: usize| match sigma[i] * sigma[j] {
        0.0 => 0.0,
        product => covariance[(i, j)] / product,
    };
    let eigen = SymmetricEigen::new(DMatrix::from_fn(n, n, unit));
    let axes = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
    axes.filter(|(share, _)| LEAST_SHARE < **share)
        .map(|(share, axis)| axis.iter().zip(&sigma).map(|(a, sigma)| a * sigma * share.sqrt()).collect())
        .collect()
}

/// The pair of the same pixels.
fn through(pair: &BearingPair, from: &Camera, to: &Camera) -> Option<BearingPair> {
    let [first, second] =
        [pair.first, pair.second].map(|bearing| to.bearing(&from.project(&bearing.into_inner())?).ok());
    Some(BearingPair { first: first?, second: second?, ..*pair })
}
