//! `rig-pose`: where a known rig is, from points seen by any of its cameras.

use crate::args::{OutputArgs, positive};
use crate::output::{Outcome, Printer};
use crate::robust::RobustArgs;
use crate::text::line;
use anyhow::Result;
use clap::Args;
use resight::answer::RigPoseAnswer;
use resight::report::verdict::figures;
use resight::report::words::{budget, coordinate, degrees, length, position_sigma_m};
use resight::rig_pose::{RigPoseRequest, TableRemarks, read_known_rig, read_rig_points, rig_poses};
use std::path::PathBuf;

/// Computes where a known rig is, from points seen by any of its cameras.
///
/// The columns are those of `solve` and camera: camera,x_m,y_m,z_m,u_px,v_px and optionally view, id, sigma_px and sigma_m. Three points over
/// all cameras are enough. Each view gets one pose of the rig, in file order; its ± holds the places and the intrinsics of the cameras as far
/// as the rig file states their covariance.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight rig-pose points.csv --rig rig.toml --sigma-px 0.3")]
#[command(after_long_help = "Examples:
  resight rig-pose points.csv --rig rig.toml --sigma-px 0.3
  resight rig-pose matches.csv --rig rig.toml --sigma-px 1 --robust 4 --json")]
pub struct RigPose {
    /// CSV file of points with a header line.
    #[arg(value_name = "POINTS.csv")]
    points: PathBuf,
    /// The rig: a file with several cameras and their poses, as `resight rig -o` writes it, or of another program.
    #[arg(long, value_name = "FILE")]
    rig: PathBuf,
    /// Standard deviation of u and v where the file has no sigma_px.
    #[arg(long, help_heading = "Noise", value_name = "S", default_value = "0.5", allow_negative_numbers = true, value_parser = positive)]
    sigma_px: f64,
    #[command(flatten)]
    robust: RobustArgs,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `RigPose`.
pub fn run(args: &RigPose) -> Result<Outcome> {
    args.output.check()?;
    crate::files::must_exist(&args.points)?;
    crate::files::must_exist(&args.rig)?;
    let rig = read_known_rig(&args.rig)?;
    resight::formats::remarks(&args.rig)
        .iter()
        .for_each(|text| crate::output::remark(&format!("warning: {}: {text}", args.rig.display())));
    let views = read_rig_points(&args.points, &rig)?;
    let request = RigPoseRequest { sigma_px: args.sigma_px, robust_threshold_px: args.robust.threshold_px() };
    let answers = rig_poses(&rig, &views, &request);
    let mut printer = Printer::new(&args.output, answers.len());
    TableRemarks::of(&views)
        .all()
        .for_each(|text| printer.remark(&format!("warning: {}: {text}", args.points.display())));
    for answer in &answers {
        printer.result(answer, &words(answer), answer.status)?;
    }
    printer.finish()
}

fn words(answer: &RigPoseAnswer) -> String {
    let mut out = format!("{}   {}\n", answer.view, answer.status.name().to_uppercase());
    if let (Some(e), Some(sigma_rad), Some(sigma_m)) = (&answer.estimate, answer.sigma_rad, answer.sigma_m) {
        let place = e.rig_from_target.origin();
        // The standard deviations are along the rig's axes; those along the target's follow from the same covariance.
        let along = position_sigma_m(&e.rig_from_target, &e.covariance);
        let axes = ["x", "y", "z"]
            .iter()
            .enumerate()
            .map(|(i, axis)| format!("{axis} {}", coordinate(place[i], along[i])));
        line(&mut out, "rig at", &format!("{}   (target frame)", axes.collect::<Vec<_>>().join("   ")));
        let turned = sigma_rad.map(degrees).join(" ");
        line(&mut out, "rotation", &format!("± {turned} about the rig's x y z"));
        if let Some(text) = answer.parts.as_ref().and_then(budget) {
            line(&mut out, "budget", &text);
        }
        if let Some(exact) = answer.sigma_exact_intrinsics_m {
            let norm = |s: [f64; 3]| s.iter().map(|x| x * x).sum::<f64>().sqrt();
            line(
                &mut out,
                "intrinsics",
                &format!(
                    "their uncertainty makes the position ± {}, ± {} with exact ones",
                    length(norm(sigma_m)),
                    length(norm(exact))
                ),
            );
        }
    }
    for fit in &answer.cameras {
        let rms = fit.rms_px.map_or_else(String::new, |px| format!(", rms {} px", figures(px)));
        line(&mut out, "camera", &format!("{}: {} of {} points{rms}", fit.name, fit.n_inliers, fit.n_points));
    }
    if let Some(a) = &answer.agreement {
        let text = format!(
            "{} of {} points agree to within {} px (confidence {:.4}, {} samples)",
            a.n_inliers, answer.n_points, a.threshold_px, a.confidence, a.n_samples
        );
        line(&mut out, "agreement", &text);
    }
    line(&mut out, "verdict", &answer.message);
    answer.remarks.iter().for_each(|remark| line(&mut out, "remark", remark));
    out
}
