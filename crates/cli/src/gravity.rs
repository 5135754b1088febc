//! `--gravity`: the direction of down, measured in the camera, as a prior of the pose.

use anyhow::{Result, bail};
use clap::Args;
use resight::core::locate::Method;
use resight::core::locate::prior::Prior;

/// The flags, for every command that solves from points.
#[derive(Debug, Clone, Args)]
pub struct GravityArgs {
    /// Direction of down in the camera frame (x right, y down, z forward), of any length.
    ///
    /// An accelerometer at rest reads up: give its negative reading, rotated into the camera frame. Every method uses the direction beside
    /// the points; `--method upright` needs it.
    #[arg(long, hide_short_help = true, help_heading = "Gravity", value_name = "X,Y,Z", allow_hyphen_values = true, value_parser = direction)]
    gravity: Option<[f64; 3]>,
    /// Standard deviation of that direction about each axis across it, in degrees.
    #[arg(long, hide_short_help = true, help_heading = "Gravity", value_name = "S", requires = "gravity", default_value = "1", allow_negative_numbers = true, value_parser = sigma)]
    gravity_sigma_deg: f64,
    /// Direction of down in the target frame, which --gravity needs.
    ///
    /// It is 0,0,-1 where the target's z points up (surveyed points) and 0,1,0 for a printed target that hangs upright.
    #[arg(long, hide_short_help = true, help_heading = "Gravity", value_name = "X,Y,Z", requires = "gravity", allow_hyphen_values = true, value_parser = direction)]
    target_down: Option<[f64; 3]>,
}

/// Three numbers, made a unit vector.
fn direction(text: &str) -> Result<[f64; 3], String> {
    let parts: Result<Vec<f64>, _> = text.split(',').map(|part| part.trim().parse::<f64>()).collect();
    let needed = "three numbers X,Y,Z that are not all zero are needed, e.g. 0.1,0.99,-0.05";
    let [x, y, z] = parts.ok().and_then(|p| <[f64; 3]>::try_from(p).ok()).ok_or(needed)?;
    let length = x.hypot(y).hypot(z);
    if !(length.is_normal()) {
        return Err(needed.to_string());
    }
    Ok([x / length, y / length, z / length])
}

fn sigma(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 < x && x < 90.0 => Ok(x),
        _ => Err("a positive number of degrees is needed".to_string()),
    }
}

impl GravityArgs {
    /// The prior; none when not given. Refused where the method cannot take it, or cannot do without it.
    pub fn check(&self, method: Method) -> Result<Vec<Prior>> {
        match (self.gravity, method) {
            (None, Method::Upright) => {
                bail!(
                    "--method upright needs the direction of down in the camera frame: add --gravity X,Y,Z (minus an accelerometer's reading at rest)"
                )
            }
            (Some(_), Method::Wang2004) => {
                bail!("--gravity: method wang2004 is the printed procedure, which takes no prior; use auto")
            }
            (None, _) => Ok(Vec::new()),
            // A wrong guess turns the whole answer over, and two points cannot contradict it.
            (Some(_), _) if self.target_down.is_none() => {
                bail!(
                    "--gravity needs the direction of down in the target's frame too: add --target-down 0,0,-1 where its z points up, or \
                     --target-down 0,1,0 for a printed target that hangs upright"
                )
            }
            (Some(down_in_cam), _) => Ok(vec![Prior::Gravity {
                down_in_target: self.target_down.unwrap_or_default().into(),
                down_in_cam: down_in_cam.into(),
                sigma_rad: self.gravity_sigma_deg.to_radians(),
            }]),
        }
    }
}
