//! `compare`: what moved between two rigs or poses.

mod input;
mod rigs;
mod views;
mod words;

use crate::args::{OutputArgs, positive};
use crate::output::{Outcome, Printer};
use anyhow::{Result, bail};
use clap::Args;
use input::Input;
use resight::core::Matrix6;
use resight::core::temporal::compare::Moved;
use serde::Serialize;
use std::path::PathBuf;

/// What moved between two calibrations, by how much, and how sure that is; exit status 3 when something did.
///
/// A and B are two rigs (rig.toml of `rig -o`, the JSON of `rig --joint-covariance --json`, or any camera file with poses), or two
/// files of poses (JSON Lines of `locate` and `solve`; poses of one view are compared). Rigs need no common frame: the largest
/// set of cameras whose relative poses agree is taken to have stayed, so a knocked reference camera is itself what moved.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight compare monday.toml tuesday.toml
  resight compare monday.json tuesday.json --alpha 1e-6 --json
  resight compare factory.yaml now.yaml --sigma-mm 0.2 --sigma-deg 0.01")]
pub struct Compare {
    /// Before.
    #[arg(value_name = "A")]
    before: PathBuf,
    /// After.
    #[arg(value_name = "B")]
    after: PathBuf,
    /// Chance of saying that something moved when nothing did.
    #[arg(long, value_name = "CHANCE", default_value = "1e-3", value_parser = chance)]
    alpha: f64,
    /// Standard deviation of each coordinate of a camera's place, for files that state no covariance.
    #[arg(long, value_name = "MM", requires = "sigma_deg", allow_negative_numbers = true, value_parser = positive)]
    sigma_mm: Option<f64>,
    /// Standard deviation of a camera's turn about each axis, for files that state no covariance.
    #[arg(long, value_name = "DEG", requires = "sigma_mm", allow_negative_numbers = true, value_parser = positive)]
    sigma_deg: Option<f64>,
    #[command(flatten)]
    output: OutputArgs,
}

/// A motion as it is printed.
#[derive(Serialize)]
struct MotionObject {
    /// Where it now is, in its own old frame.
    old_from_new: resight::answer::TransformObject,
    covariance: [[f64; 6]; 6],
    moved_m: f64,
    moved_sigma_m: f64,
    turned_rad: f64,
    turned_sigma_rad: f64,
    /// About which it turned, in its own old frame; null where it hardly did.
    turn_axis: Option<[f64; 3]>,
    chi2: f64,
    dof: usize,
    p: f64,
}

fn chance(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(x) if 0.0 < x && x < 1.0 => Ok(x),
        _ => Err("a chance between 0 and 1 is needed, e.g. 1e-3".to_string()),
    }
}

/// See `Compare`.
pub fn run(args: &Compare) -> Result<Outcome> {
    args.output.check()?;
    let (before, after) = (input::read(&args.before)?, input::read(&args.after)?);
    let mut printer = Printer::new(&args.output, 1);
    let has_moved = match (before, after) {
        (Input::Rig(before), Input::Rig(after)) => rigs::compare(args, &before, &after, &mut printer)?,
        (Input::Poses(before), Input::Poses(after)) => views::compare(args, &before, &after, &mut printer)?,
        (Input::Rig(_), Input::Poses(_)) => bail!("{}", mixed(args, "a rig", "poses")),
        (Input::Poses(_), Input::Rig(_)) => bail!("{}", mixed(args, "poses", "a rig")),
    };
    let outcome = printer.finish()?;
    Ok(if has_moved { Outcome::Moved } else { outcome })
}

fn mixed(args: &Compare, a: &str, b: &str) -> String {
    let (before, after) = (args.before.display(), args.after.display());
    format!("{before} holds {a} and {after} {b}; compare two of a kind")
}

impl Compare {
    /// What --sigma-mm and --sigma-deg say about each pose of a file that says nothing.
    fn stated(&self) -> Option<Matrix6> {
        let (sigma_m, sigma_rad) = (1e-3 * self.sigma_mm?, self.sigma_deg?.to_radians());
        let variance = |i: usize| if i < 3 { sigma_rad * sigma_rad } else { sigma_m * sigma_m };
        Some(Matrix6::from_fn(|i, j| if i == j { variance(i) } else { 0.0 }))
    }
}

fn motion(moved: &Moved) -> MotionObject {
    let figures = words::Figures::of(moved);
    MotionObject {
        old_from_new: moved.old_from_new.into(),
        covariance: resight::answer::pose::rows(&moved.covariance),
        moved_m: figures.moved_m,
        moved_sigma_m: figures.moved_sigma_m,
        turned_rad: figures.turned_rad,
        turned_sigma_rad: figures.turned_sigma_rad,
        turn_axis: figures.axis,
        chi2: moved.chi2,
        dof: 6,
        p: moved.probability,
    }
}
