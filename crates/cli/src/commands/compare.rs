//! `compare`: what moved between two rigs or poses.

use crate::args::{OutputArgs, positive};
use crate::output::{Outcome, Printer, remark};
use crate::text::line;
use anyhow::Result;
use clap::Args;
use resight::compare::{
    self, CompareAnswer, CompareOptions, Compared, RigsCompared, ViewCompared, compare, evidence,
};
use resight::report::verdict::figures;
use std::path::{Path, PathBuf};

/// What moved between two calibrations, by how much, and how uncertain that is; exit status 3 when something did.
///
/// A and B are two rigs (rig.toml of `rig -o`, the JSON of `rig --joint-covariance --json`, or any camera file with poses), or two
/// files of poses (JSON Lines of `locate` and `solve`; poses of one view are compared). Rigs need no common frame: the largest
/// set of cameras whose relative poses agree is taken to have stayed, so a suddenly moved reference camera is itself what moved.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight compare monday.toml tuesday.toml
  resight compare monday.json tuesday.json --alpha 1e-6 --json
  resight compare factory.yaml now.yaml --sigma-mm 0.2 --sigma-deg 0.01")]
pub struct Compare {
    /// The rig or poses before.
    #[arg(value_name = "A")]
    before: PathBuf,
    /// The rig or poses after.
    #[arg(value_name = "B")]
    after: PathBuf,
    /// States the probability of reporting a motion when nothing moved.
    #[arg(long, value_name = "PROBABILITY", default_value = "1e-3", value_parser = chance)]
    alpha: f64,
    /// States the standard deviation of each coordinate of a camera's position, for files without a covariance.
    #[arg(long, value_name = "MM", requires = "sigma_deg", allow_negative_numbers = true, value_parser = positive)]
    sigma_mm: Option<f64>,
    /// States the standard deviation of a camera's rotation about each axis, for files without a covariance.
    #[arg(long, value_name = "DEG", requires = "sigma_mm", allow_negative_numbers = true, value_parser = positive)]
    sigma_deg: Option<f64>,
    #[command(flatten)]
    output: OutputArgs,
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
    let (before, after) = (read(&args.before)?, read(&args.after)?);
    let options = CompareOptions { alpha: args.alpha, ..CompareOptions::default() };
    let options = match (args.sigma_mm, args.sigma_deg) {
        (Some(mm), Some(degrees)) => options.with_sigmas(1e-3 * mm, degrees.to_radians()),
        _ => options,
    };
    let answer = compare(&before, &after, &options)?;
    let mut printer = Printer::new(&args.output, 1);
    match &answer {
        CompareAnswer::Rigs(rigs) => printer.result(rigs, &rigs_in_words(rigs), rigs.status)?,
        CompareAnswer::Views(views) => {
            for view in views {
                printer.result(view, &view_in_words(view), view.status)?;
            }
        }
    }
    let outcome = printer.finish()?;
    Ok(if answer.has_moved() { Outcome::Moved } else { outcome })
}

fn read(path: &Path) -> Result<Compared> {
    crate::files::must_exist(path)?;
    let (compared, warnings) = compare::read(path)?;
    warnings.iter().for_each(|warning| remark(&format!("warning: {}: {warning}", path.display())));
    Ok(compared)
}

fn rigs_in_words(rigs: &RigsCompared) -> String {
    let n_compared = rigs.unmoved.len() + rigs.moved.len();
    let mut out = format!("{}   {n_compared} cameras compared\n", rigs.verdict.name().to_uppercase());
    let evidence = evidence(rigs.chi2, rigs.degrees_of_freedom, rigs.p);
    line(&mut out, "verdict", &format!("{}; of all together {evidence}.", capital(&rigs.message)));
    for moved in &rigs.moved {
        line(&mut out, &moved.camera, &moved.message);
    }
    if !rigs.unmoved.is_empty() && !rigs.moved.is_empty() {
        line(&mut out, "stayed", &rigs.unmoved.join(", "));
    }
    for (only, side) in [(&rigs.only_in_a, "A"), (&rigs.only_in_b, "B")] {
        if !only.is_empty() {
            line(&mut out, "left out", &format!("{}: only in {side}", only.join(", ")));
        }
    }
    if let Some(degrees) = rigs.noise_degrees_of_freedom {
        let noise = format!(
            "estimated from loops of pairs with {} degrees of freedom; the chances allow for that",
            figures(degrees)
        );
        line(&mut out, "noise", &noise);
    }
    if let Some(assumed) = &rigs.assumed {
        line(&mut out, "assumed", assumed);
    }
    out
}

fn view_in_words(view: &ViewCompared) -> String {
    let mut out = format!("{}   {}\n", view.view, view.verdict.name().to_uppercase());
    line(&mut out, "verdict", &format!("{}.", view.message));
    out
}

fn capital(text: &str) -> String {
    match text.starts_with("nothing") || text.starts_with("something") {
        true => format!("{}{}", text[..1].to_uppercase(), &text[1..]),
        false => text.to_string(), // A camera's name keeps its spelling.
    }
}
