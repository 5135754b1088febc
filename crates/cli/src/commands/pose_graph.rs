//! `pose-graph`: the cameras of a rig from the relative poses of pairs of them.

use super::rig::{AnswerArgs, named, unanswered};
use crate::args::positive;
use crate::output::{Outcome, print_answer, remark, with_progress};
use crate::text::line;
use anyhow::Result;
use clap::Args;
use resight::answer::pose_graph::PairAgreement;
use resight::answer::{PoseGraphAnswer, SolvedPoseGraph};
use resight::core::multiview::pose_graph::PairSigma;
use resight::core::{Matrix6, Pose};
use resight::formats::write_atomically;
use resight::input::table::how_file_is_read;
use resight::report::words::{budget, coordinate, degrees, length, position_sigma_m, sigmas};
use resight::rig::pairs::read_pairs;
use resight::rig::{PoseGraphMethod, PoseGraphRequest};
use std::path::PathBuf;

/// Computes the extrinsics of several cameras from the relative poses of pairs of them.
///
/// All pairs are weighed together; pairs that contradict the others are named. Without stated sigmas the noise of a pair is estimated
/// from how well loops of pairs close.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight pose-graph pairs.csv --reference cam1 -o rig.toml")]
#[command(after_long_help = "Examples:
  resight pose-graph pairs.csv --reference cam1 -o rig.toml
  resight pose-graph stereograph.json --reference 8 --chain --json")]
pub struct PoseGraphArgs {
    /// Relative poses of pairs of cameras (CSV), or Caliscope's stereograph JSON.
    ///
    /// The columns are a,b,qw,qx,qy,qz,x_m,y_m,z_m (x_in_b = b_from_a · x_in_a) and sigma_deg,sigma_mm, or rmse, or neither.
    #[arg(value_name = "PAIRS")]
    pairs: PathBuf,
    /// Camera files whose intrinsics are written into the file of -o.
    ///
    /// Without them that file holds poses only. Without NAME= every camera of a file has its own name.
    #[arg(long = "camera", value_name = "[NAME=]FILE", num_args = 1..)]
    cameras: Vec<String>,
    /// The camera whose frame is the rig's [default: the first by name]
    #[arg(long, value_name = "NAME")]
    reference: Option<String>,
    /// Uses for each camera the one chain of pairs whose errors add up to least, instead of all pairs.
    #[arg(long)]
    chain: bool,
    /// Standard deviation of the rotation of a pair of median rmse [default: estimated].
    ///
    /// It is estimated from how well the pairs agree.
    #[arg(long, help_heading = "Noise", value_name = "DEG", requires = "pair_sigma_mm", value_parser = positive)]
    pair_sigma_deg: Option<f64>,
    /// Standard deviation of the translation of a pair of median rmse.
    #[arg(long, help_heading = "Noise", value_name = "MM", requires = "pair_sigma_deg", value_parser = positive)]
    pair_sigma_mm: Option<f64>,
    /// Adds the joint covariance of all cameras to the JSON.
    ///
    /// `compare` uses it. The file of -o always holds it.
    #[arg(long, hide_short_help = true, help_heading = "Output")]
    joint_covariance: bool,
    #[command(flatten)]
    output: AnswerArgs,
}

/// See `PoseGraphArgs`.
pub fn run(args: &PoseGraphArgs) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        crate::files::must_be_writable(path)?;
    }
    crate::files::must_exist(&args.pairs)?;
    let lenses = named::request(&args.cameras, &[])?;
    lenses.remarks.iter().chain(&how_file_is_read(&args.pairs)).for_each(|text| remark(text));
    let sigma = args.pair_sigma_deg.zip(args.pair_sigma_mm);
    let request = PoseGraphRequest {
        reference: args.reference.clone(),
        method: if args.chain { PoseGraphMethod::Chain } else { PoseGraphMethod::Joint },
        median_sigma: sigma.map(|(deg, mm)| PairSigma { sigma_rad: deg.to_radians(), sigma_m: 1e-3 * mm }),
        joint_covariance: args.joint_covariance,
        ..PoseGraphRequest::new(read_pairs(&args.pairs)?)
    };
    let solved = match with_progress(|| resight::pose_graph(&request))? {
        PoseGraphAnswer::Solved(solved) => solved,
        PoseGraphAnswer::Unsolved(reason) => return unanswered(&args.output, "RIG", &reason),
    };
    if let Some(path) = &args.output.output {
        write_atomically(path, solved.file(&lenses.cameras)?.as_bytes())?;
    }
    print_answer(args.output.json, &solved, &words(&solved), solved.status())?;
    Ok(Outcome::of([solved.status()]))
}

/// Where a camera is in the rig, each coordinate with its standard deviation, and that of its direction.
fn place(cam_from_rig: &Pose, covariance: Option<&Matrix6>) -> String {
    let place = cam_from_rig.origin();
    let Some(covariance) = covariance else {
        let [x, y, z] = [place.x, place.y, place.z].map(|x| 1e3 * x);
        return format!("x {x:+.1}   y {y:+.1}   z {z:+.1} mm in the rig");
    };
    let sigma_m = position_sigma_m(cam_from_rig, covariance);
    let [x, y, z] = [0, 1, 2].map(|i| coordinate(place[i], sigma_m[i]));
    let turn = sigmas(covariance).0.into_iter().fold(0.0, f64::max);
    format!("x {x}   y {y}   z {z} in the rig, direction ± {}", degrees(turn))
}

fn words(solved: &SolvedPoseGraph) -> String {
    let mut out = match solved.contradiction() {
        Some(sentence) => format!("INCONSISTENT   {sentence}.\n\n"),
        None => "OK   ".to_string(),
    };
    out.push_str(&format!("RIG   {}\n\n", solved.message()));
    for (name, (cam_from_rig, covariance)) in solved.cameras.iter().zip(&solved.cam_from_rig) {
        line(&mut out, name, &place(cam_from_rig, covariance.as_ref().filter(|c| 0.0 < c.trace())));
    }
    for (i, name) in solved.cameras.iter().enumerate() {
        if let Some(text) = solved.budget(i).as_ref().and_then(budget) {
            line(&mut out, "budget", &format!("{name} {text}"));
        }
    }
    if let Some(sigma) = solved.solution.as_ref().and_then(|s| s.median_sigma) {
        let (rotation, translation) = (degrees(sigma.sigma_rad), length(sigma.sigma_m));
        line(&mut out, "noise", &format!("a pair of median error is known to {rotation} and {translation}"));
    }
    let by_size = |a: &PairAgreement, b: &PairAgreement| {
        let size = |p: &PairAgreement| p.disagreement_sigma.unwrap_or(p.residual_rad);
        size(b).total_cmp(&size(a))
    };
    let mut worst = solved.agreements();
    worst.sort_by(by_size);
    for pair in worst.into_iter().take(5) {
        let verdict = match (pair.is_suspicious, pair.is_used) {
            (false, _) => "",
            (true, false) => "   SUSPICIOUS, left out",
            (true, true) => "   SUSPICIOUS: it or another of its loop",
        };
        let text = format!("{} and {} off{verdict}", degrees(pair.residual_rad), length(pair.residual_m));
        line(&mut out, &format!("{}-{}", pair.a, pair.b), &text);
    }
    out
}
