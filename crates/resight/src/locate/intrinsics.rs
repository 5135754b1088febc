//! How well the intrinsics are known.

use crate::error::Error;
use resight_core::Camera;
use std::collections::BTreeMap;

/// Standard deviations of a camera's parameters, independent of one another; those not named are exact.
#[derive(Debug, Clone)]
pub struct IntrinsicsSigma {
    by_name: BTreeMap<String, f64>,
    /// fx of the camera file: images of another size have other pixels.
    stated_fx_px: Option<f64>,
}

impl IntrinsicsSigma {
    /// Of a camera at the size it was calibrated at; names as of `Camera::parameters`, each in its parameter's unit.
    ///
    /// # Errors
    /// `Intrinsics` for a parameter that the camera does not have, and for what is no standard deviation.
    pub fn new(by_name: BTreeMap<String, f64>, camera: &Camera) -> Result<Self, Error> {
        let known: Vec<&str> = camera.parameters().iter().map(|(name, _)| *name).collect();
        for (name, sigma) in &by_name {
            if !known.contains(&name.as_str()) {
                let model = camera.model_name();
                let reason = format!("this {model} camera has no `{name}`; it has {}", known.join(", "));
                return Err(Error::Intrinsics { reason });
            }
            if !(0.0 <= *sigma && sigma.is_finite()) {
                let reason =
                    format!("the standard deviation of `{name}` is {sigma}; a number of 0 or more is needed");
                return Err(Error::Intrinsics { reason });
            }
        }
        Ok(IntrinsicsSigma { by_name, stated_fx_px: camera.matrix().map(|k| k.fx_px) })
    }

    /// The covariance matrix row by row, in the order of `Camera::parameters`; parameters in pixels are scaled to the size
    /// of the camera given.
    pub fn covariance(&self, camera: &Camera) -> Vec<f64> {
        let scale = match (self.stated_fx_px, camera.matrix()) {
            (Some(stated), Some(k)) => k.fx_px / stated,
            _ => 1.0,
        };
        let parameters = camera.parameters();
        let n = parameters.len();
        let mut covariance = vec![0.0; n * n];
        for (i, (name, _)) in parameters.iter().enumerate() {
            let unit = if name.ends_with("_px") { scale } else { 1.0 };
            let sigma = self.by_name.get(*name).copied().unwrap_or(0.0) * unit;
            covariance[i * n + i] = sigma * sigma;
        }
        covariance
    }

    /// As given, for the results.
    pub fn stated(&self) -> BTreeMap<String, f64> {
        self.by_name.clone()
    }
}
