//! The uncertainty of the intrinsics, and its effect on a pose.

use crate::error::Error;
use crate::formats::{NamedCamera, WriteError, own_file};
use crate::report::words::position_sigma_m;
use nalgebra::DMatrix;
use resight_core::locate::{Config, PoseEstimate, locate};
use resight_core::multiview::intrinsics_check::Group;
use resight_core::{Camera, Correspondence};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// Writes our own camera file of a lens, with the covariance of its intrinsics where there is one.
///
/// # Errors
/// A lens model that the format cannot hold.
pub fn camera_file(
    name: &str,
    camera: &Camera,
    intrinsics: Option<&IntrinsicsCovariance>,
) -> Result<String, WriteError> {
    let square = |known: &IntrinsicsCovariance| {
        let n = known.names.len();
        DMatrix::from_row_slice(n, n, &known.covariance(camera))
    };
    let intrinsics_covariance = intrinsics.map(square);
    own_file(&[NamedCamera {
        name: name.to_owned(),
        camera: camera.clone(),
        placement: None,
        intrinsics_covariance,
    }])
}

/// The covariance of a camera's intrinsics, for the image size of the calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct IntrinsicsCovariance {
    /// In the order of `Camera::parameters`.
    names: Vec<&'static str>,
    covariance: DMatrix<f64>,
    /// fx of the camera file, from which the scale for images of another size follows.
    stated_fx_px: Option<f64>,
}

impl IntrinsicsCovariance {
    /// Builds a covariance from independent standard deviations by name, as in `Camera::parameters` and in their units; parameters without one
    /// are exact.
    ///
    /// # Errors
    /// `Intrinsics` for a parameter that the camera does not have, and for an invalid standard deviation.
    pub fn independent(sigma_by_name: &BTreeMap<String, f64>, camera: &Camera) -> Result<Self, Error> {
        let parameters = camera.parameters();
        let names: Vec<&'static str> = parameters.iter().map(|(name, _)| *name).collect();
        let mut covariance = DMatrix::zeros(names.len(), names.len());
        for (name, sigma) in sigma_by_name {
            let Some(i) = names.iter().position(|known| known == name) else {
                let model = camera.model_name();
                let reason = format!("this {model} camera has no `{name}`; it has {}", names.join(", "));
                return Err(Error::Intrinsics { reason });
            };
            if !(0.0 <= *sigma && sigma.is_finite()) {
                let reason =
                    format!("the standard deviation of `{name}` is {sigma}; a number of 0 or more is needed");
                return Err(Error::Intrinsics { reason });
            }
            covariance[(i, i)] = sigma * sigma;
        }
        Ok(IntrinsicsCovariance { names, covariance, stated_fx_px: camera.matrix().map(|k| k.fx_px) })
    }

    /// Returns the covariance that a camera file states; `None` where it states none.
    pub fn of(camera: &NamedCamera) -> Option<Self> {
        let covariance = camera.intrinsics_covariance.clone()?;
        let names: Vec<&'static str> = camera.camera.parameters().iter().map(|(name, _)| *name).collect();
        let fits = covariance.nrows() == names.len() && covariance.ncols() == names.len();
        let stated_fx_px = camera.camera.matrix().map(|k| k.fx_px);
        fits.then_some(IntrinsicsCovariance { names, covariance, stated_fx_px })
    }

    /// Returns the covariance row by row, in the order of `Camera::parameters`; parameters in pixels are scaled to the size of the given camera.
    pub fn covariance(&self, camera: &Camera) -> Vec<f64> {
        self.rows(camera, |_| true)
    }

    /// Returns the covariance with only one kind of parameters uncertain; the others are exact.
    fn rows(&self, camera: &Camera, is_kept: impl Fn(&str) -> bool) -> Vec<f64> {
        let scale = match (self.stated_fx_px, camera.matrix()) {
            (Some(stated), Some(k)) => k.fx_px / stated,
            _ => 1.0,
        };
        let unit = |name: &str| match (is_kept(name), name.ends_with("_px")) {
            (false, _) => 0.0,
            (true, true) => scale,
            (true, false) => 1.0,
        };
        let units: Vec<f64> = self.names.iter().map(|name| unit(name)).collect();
        let n = units.len();
        (0..n * n).map(|k| self.covariance[(k / n, k % n)] * units[k / n] * units[k % n]).collect()
    }

    /// Returns the standard deviations that are not 0, by name, for the image size of the calibration.
    pub fn sigmas(&self) -> BTreeMap<String, f64> {
        let sigma = |(i, name): (usize, &&str)| ((*name).to_owned(), self.covariance[(i, i)].max(0.0).sqrt());
        self.names.iter().enumerate().map(sigma).filter(|(_, sigma)| 0.0 < *sigma).collect()
    }

    /// Returns how much the uncertain intrinsics add to the uncertainty of a pose: the predicted points are solved again with other covariances
    /// of the intrinsics. Without residuals no sigma is widened for an inadequate lens; the uncertainty of a print is kept.
    pub(super) fn cost(
        &self,
        estimate: &PoseEstimate,
        seen: &[Correspondence],
        camera: &Camera,
        target_scale_sigma: [f64; 2],
    ) -> Option<IntrinsicsCost> {
        let ideal = |c: &Correspondence| {
            let pixel = camera.project(&(estimate.cam_from_target * c.x_in_target))?;
            Some(Correspondence { pixel, bearing: camera.bearing(&pixel).ok()?, ..*c })
        };
        let ideal: Vec<Correspondence> = seen.iter().filter_map(ideal).collect();
        let with = |intrinsics_covariance: Option<&[f64]>| {
            locate(&ideal, camera, &Config { intrinsics_covariance, target_scale_sigma, ..Config::default() })
                .ok()
        };
        let sigma_m = |e: &PoseEstimate| position_sigma_m(&e.cam_from_target, &e.covariance).norm();
        let alone = |group: Group| {
            let covariance = self.rows(camera, |name| Group::of(name) == group);
            if covariance.iter().all(|x| *x == 0.0) {
                return None;
            }
            Some((group, sigma_m(&with(Some(&covariance))?)))
        };
        let largest = Group::ALL.into_iter().filter_map(alone).max_by(|a, b| a.1.total_cmp(&b.1))?;
        Some(IntrinsicsCost {
            position_sigma_m: sigma_m(estimate),
            with_exact_intrinsics_m: sigma_m(&with(None)?),
            mostly: largest.0.name(),
            by_that_alone_m: largest.1,
        })
    }
}

/// What uncertain intrinsics cost: standard deviations of the camera's position, the root of the sum over its three axes, metres.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct IntrinsicsCost {
    /// As answered.
    pub position_sigma_m: f64,
    /// If the intrinsics were exact.
    pub with_exact_intrinsics_m: f64,
    /// The kind of parameters that costs most: `focal length`, `principal point` or `distortion`.
    pub mostly: &'static str,
    /// If only these were uncertain.
    pub by_that_alone_m: f64,
}

impl IntrinsicsCost {
    /// Describes the cost in a sentence, with the calibration that would reduce it.
    pub fn words(&self) -> String {
        let mm = |m: f64| crate::report::words::length(m);
        let (now, exact) = (mm(self.position_sigma_m), mm(self.with_exact_intrinsics_m));
        if self.position_sigma_m < 1.1 * self.with_exact_intrinsics_m {
            return format!(
                "their uncertainty costs little: the position is ± {now}, ± {exact} with exact ones"
            );
        }
        let help = match self.mostly {
            "focal length" => "views of a board tilted by 30° and more determine it",
            "principal point" => {
                "views of a board that is turned about the optical axis and tilted determine it"
            }
            _ => "views of a board that reaches the corners of the image determine it",
        };
        format!(
            "their uncertainty makes the position ± {now}, ± {exact} with exact ones; mostly the {}: {help} (resight intrinsics)",
            self.mostly
        )
    }
}
