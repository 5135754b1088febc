//! `--intrinsics-sigma`: how well the intrinsics are known.

use anyhow::{Result, bail};
use clap::Args;
use resight::core::Camera;
use resight::locate::{IntrinsicsSigma, Method};
use std::collections::BTreeMap;

/// The flag, for every command that solves.
#[derive(Debug, Clone, Args)]
pub struct IntrinsicsArgs {
    /// Standard deviations of the camera's parameters, which widen the covariance.
    ///
    /// For example fx_px=0.8,fy_px=0.8,cx_px=0.5,cy_px=0.5. They are independent of one another; parameters that are not named are exact.
    #[arg(long, hide_short_help = true, help_heading = "Noise", value_name = "NAME=S,…", value_delimiter = ',', value_parser = assignment)]
    intrinsics_sigma: Vec<(String, f64)>,
}

fn assignment(text: &str) -> Result<(String, f64), String> {
    let (name, value) = text.split_once('=').ok_or("NAME=S is needed, e.g. fx_px=0.8")?;
    match value.trim().parse::<f64>() {
        Ok(sigma) if 0.0 <= sigma && sigma.is_finite() => Ok((name.trim().to_string(), sigma)),
        _ => Err(format!("`{}` is no standard deviation; a number of 0 or more is needed", value.trim())),
    }
}

impl IntrinsicsArgs {
    /// Whether any were given.
    pub fn given(&self) -> bool {
        !self.intrinsics_sigma.is_empty()
    }

    /// The standard deviations for the camera they are meant for; none when none were given.
    pub fn check(&self, camera: &Camera, method: Method) -> Result<Option<IntrinsicsSigma>> {
        if !self.given() {
            return Ok(None);
        }
        if method == Method::Wang2004 {
            bail!(
                "--intrinsics-sigma: method wang2004 is the printed procedure, which carries no such uncertainty; use auto"
            );
        }
        let known: Vec<&str> = camera.parameters().iter().map(|(name, _)| *name).collect();
        let mut by_name = BTreeMap::new();
        for (name, sigma) in &self.intrinsics_sigma {
            if !known.contains(&name.as_str()) {
                let nearest = resight::input::nearest(name, known.iter().map(|n| n.to_string()));
                let hint = nearest.map(|n| format!("did you mean `{n}`? ")).unwrap_or_default();
                let model = camera.model_name();
                bail!(
                    "--intrinsics-sigma: this {model} camera has no `{name}`; {hint}It has {}",
                    known.join(", ")
                );
            }
            if by_name.insert(name.clone(), *sigma).is_some() {
                bail!("--intrinsics-sigma: `{name}` is given twice");
            }
        }
        Ok(Some(IntrinsicsSigma::new(by_name, camera)?))
    }
}
