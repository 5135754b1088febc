//! Cameras that are a rig: their places from a file, and targets that are hand-held.

use anyhow::{Result, bail};
use clap::Args;
use nalgebra::DMatrix;
use resight::core::{Matrix6, Pose};
use resight::formats::{CameraFile, NamedCamera, read_rig};
use resight::rig::places::{PlacedRig, placed};
use resight_watch::live::rig::RigConfig;
use std::path::PathBuf;

/// The rig.
#[derive(Debug, Args)]
#[command(next_help_heading = "Rig")]
pub struct RigArgs {
    /// Cameras with their names, intrinsics and extrinsics, instead of --camera.
    ///
    /// What `resight rig -o` writes, or any format it reads; several files are joined by their frames' names.
    #[arg(long, help_heading = None, value_name = "FILE", num_args = 1.., conflicts_with = "camera")]
    pub rig: Vec<PathBuf>,
    /// The target is hand-held, or the rig drives past it: only the cameras' relative poses are watched.
    ///
    /// In synchronised frame sets in which two of them see the target.
    #[arg(long, hide_short_help = true)]
    pub moving_target: bool,
    /// Frames of different cameras within this time are one synchronised frame set.
    #[arg(long, hide_short_help = true, value_name = "SECONDS", default_value_t = 0.02, value_parser = crate::args::seconds)]
    sync_tolerance_s: f64,
    /// Standard deviation of the rotations of the rig file where it states none; without it such extrinsics are learned anew.
    #[arg(long, hide_short_help = true, value_name = "DEG", requires_all = ["rig", "rig_sigma_mm"], value_parser = crate::args::positive)]
    rig_sigma_deg: Option<f64>,
    /// Standard deviation of its translations.
    #[arg(long, hide_short_help = true, value_name = "MM", requires = "rig_sigma_deg", value_parser = crate::args::positive)]
    rig_sigma_mm: Option<f64>,
}

impl RigArgs {
    /// The cameras of the rig file; none where there is no such file.
    pub fn cameras(&self) -> Result<Option<Vec<NamedCamera>>> {
        if self.rig.is_empty() {
            return Ok(None);
        }
        let CameraFile { cameras, warnings, .. } = read_rig(&self.rig)?;
        warnings.iter().for_each(|warning| crate::output::remark(warning));
        Ok(Some(cameras))
    }

    /// What the session watches; none where targets stand still.
    pub fn config(&self, cameras: Option<&[NamedCamera]>, n: usize) -> Result<Option<RigConfig>> {
        if !self.moving_target {
            return Ok(None);
        }
        if n < 2 {
            bail!("--moving-target with {n} camera: two are needed, that see the target together");
        }
        let reference = cameras.map(|cameras| self.reference(cameras)).transpose()?.flatten();
        Ok(Some(RigConfig { reference, sync_tolerance_s: self.sync_tolerance_s }))
    }

    /// Extrinsics and their covariance; none where their uncertainty is not stated.
    fn reference(&self, cameras: &[NamedCamera]) -> Result<Option<(Vec<Pose>, DMatrix<f64>)>> {
        let placed = placed(cameras).map_err(|reason| anyhow::anyhow!("the rig file {reason}"))?;
        let names: Vec<String> = cameras.iter().map(|camera| camera.name.clone()).collect();
        let rig = PlacedRig { cameras: placed, joint: None, noise_degrees_of_freedom: None };
        let places = rig.places(&names, self.stated().as_ref());
        Ok(places.map(|places| (places.cam_from_rig, places.covariance)))
    }

    fn stated(&self) -> Option<Matrix6> {
        let (sigma_rad, sigma_m) = (self.rig_sigma_deg?.to_radians(), 1e-3 * self.rig_sigma_mm?);
        let variance = |i: usize| if i < 3 { sigma_rad * sigma_rad } else { sigma_m * sigma_m };
        Some(Matrix6::from_fn(|i, j| if i == j { variance(i) } else { 0.0 }))
    }
}
