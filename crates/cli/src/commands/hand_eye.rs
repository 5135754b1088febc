//! `hand-eye`: where the camera (or the rig) is mounted on a robot or vehicle, from known motions.

mod robot_poses;

use super::rig::placed::KnownObject;
use super::rig::solving::Unsolved;
use super::rig::{self, AnswerArgs, ObservationArgs, Placed, SolvingArgs, unanswered};
use crate::args::{not_negative, positive};
use crate::output::{Outcome, print};
use crate::text::line;
use anyhow::{Result, bail};
use clap::Args;
use resight::core::hand_eye::{
    HandEye, HandEyeCause, HandEyeConfig, HandView, HandViewResult, Height, Mount, RejectedView,
    solve_hand_eye,
};
use resight::core::rig_pose::RigView;
use resight::core::{Matrix6, Point, Pose};
use resight::report::verdict::figures;
use resight::report::words::{degrees, length, sigmas};
use robot_poses::{Observation, RobotView};
use serde::Serialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// Where a camera or rig is mounted on a robot's gripper or a vehicle, and where the target stands (hand–eye calibration).
///
/// A rig of several cameras is solved first. The robot's own noise is estimated from the views unless it is given.
#[derive(Debug, Args)]
#[command(after_help = "Examples:
  resight hand-eye --motions motions.csv --camera cam=cam.yaml --target board.toml --images cam='*.jpg' --json
  resight hand-eye --motions motions.csv --poses poses.jsonl
  resight hand-eye --motions motions.csv --poses poses.jsonl --eye-to-hand")]
pub struct HandEyeArgs {
    /// Poses of the gripper (or of the vehicle's body): columns view,qw,qx,qy,qz,x_m,y_m,z_m
    /// (x_in_base = base_from_gripper · x_in_gripper) and optionally sigma_deg,sigma_mm.
    #[arg(long, value_name = "FILE.csv")]
    motions: PathBuf,
    /// Poses found already, instead of images or detections: what `locate` and `solve` wrote with -o.
    #[arg(long, value_name = "POSES.jsonl", conflicts_with_all = ["images", "detections", "cameras", "targets"])]
    poses: Option<PathBuf>,
    #[command(flatten)]
    observed: ObservationArgs,
    #[command(flatten)]
    solving: SolvingArgs,
    /// The target is on the gripper and the camera stands still.
    #[arg(long)]
    eye_to_hand: bool,
    /// Standard deviation of the robot's orientation where the file has no sigma_deg; 0 for an exact robot [default: estimated from the views]
    #[arg(long, value_name = "DEG", requires = "robot_sigma_mm", value_parser = not_negative)]
    robot_sigma_deg: Option<f64>,
    /// Standard deviation of the robot's position where the file has no sigma_mm; 0 for an exact robot [default: estimated from the views]
    #[arg(long, value_name = "MM", requires = "robot_sigma_deg", value_parser = not_negative)]
    robot_sigma_mm: Option<f64>,
    /// The camera's position along --height-axis, m from the gripper's origin (from the base's with --eye-to-hand): needed where the
    /// robot rotates about parallel axes only, as vehicles do.
    #[arg(long, value_name = "M", allow_negative_numbers = true)]
    known_height_m: Option<f64>,
    /// Standard deviation of that height.
    #[arg(long, value_name = "MM", requires = "known_height_m", default_value = "1", value_parser = positive)]
    height_sigma_mm: f64,
    /// Its direction in the gripper's frame (the base's with --eye-to-hand).
    #[arg(
        long,
        value_name = "X,Y,Z",
        requires = "known_height_m",
        default_value = "0,0,1",
        allow_hyphen_values = true
    )]
    height_axis: String,
    #[command(flatten)]
    output: AnswerArgs,
}

#[derive(Serialize)]
struct HandEyeObject {
    status: &'static str,
    mount: &'static str,
    /// `cam_from_gripper` (or `rig_from_gripper`, `cam_from_base`, `rig_from_base`) and `base_from_target` (or `gripper_from_target`).
    #[serde(flatten)]
    poses: BTreeMap<String, KnownObject>,
    n_views: usize,
    n_used: usize,
    chi2: f64,
    degrees_of_freedom: usize,
    pose_chi2: f64,
    pose_degrees_of_freedom: usize,
    noise_scale: f64,
    /// The robot's noise where it was estimated.
    #[serde(skip_serializing_if = "Option::is_none")]
    robot_noise: Option<RobotNoiseObject>,
    /// The target's size by the robot's motions, over the stated one.
    #[serde(skip_serializing_if = "Option::is_none")]
    target_size: Option<TargetSizeObject>,
    /// Root mean square rotation between views about three axes, the largest first.
    rotations_rad: [f64; 3],
    views: Vec<ViewObject>,
    rejected: Vec<RejectedObject>,
    /// Why the answer is not to be believed, the likely cause first.
    causes: Vec<String>,
    message: String,
}

/// Standard deviations per axis.
#[derive(Serialize)]
struct RobotNoiseObject {
    sigma_rad: f64,
    sigma_m: f64,
}

#[derive(Serialize)]
struct TargetSizeObject {
    ratio: f64,
    sigma: f64,
}

#[derive(Serialize)]
struct ViewObject {
    view: String,
    residual_rad: Option<f64>,
    residual_m: Option<f64>,
    chi2: Option<f64>,
    is_used: bool,
}

#[derive(Serialize)]
struct RejectedObject {
    view: String,
    reason: String,
}

/// What the question is about, for names.
struct Asked<'a> {
    config: HandEyeConfig,
    /// `cam` or `rig`.
    eye: &'static str,
    robot_views: &'a [RobotView],
    /// Views that took no part from the beginning.
    left_out: Vec<(String, String)>,
}

/// See `HandEyeArgs`.
pub fn run(args: &HandEyeArgs) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        crate::files::must_be_writable(path)?;
    }
    match &args.poses {
        Some(poses) => {
            let motions = robot_poses::motions(&args.motions, args.sigmas())?;
            let (robot_views, left_out) = robot_poses::joined(motions, robot_poses::poses(poses)?);
            let views: Vec<HandView> = robot_views.iter().map(|view| view.view(&[])).collect();
            let asked = Asked { config: args.config()?, eye: "cam", robot_views: &robot_views, left_out };
            answer(&asked, &views, &args.output)
        }
        None => on_observations(args),
    }
}

/// With points of one target; a rig that contradicts itself is no basis for a success.
fn on_observations(args: &HandEyeArgs) -> Result<Outcome> {
    let motions = robot_poses::motions(&args.motions, args.sigmas())?;
    let Placed { gathered, cam_from_rig, contradiction } =
        match rig::placed(&args.observed, &args.solving, &args.output)? {
            Ok(placed) => placed,
            Err(reason) => return unanswered(&args.output, &reason),
        };
    if let Some(sentence) = &contradiction {
        eprintln!("warning: the rig is INCONSISTENT: {sentence}");
    }
    let rig = &gathered.rig;
    if rig.targets.len() != 1 {
        bail!("hand-eye needs one target, {} are given; solve one target at a time", rig.targets.len());
    }
    let observed =
        rig.views.iter().map(|view| Observation { view: view.clone(), candidates: Vec::new() }).collect();
    let (robot_views, left_out) = robot_poses::joined(motions, observed);
    let of_view = |robot_view: &RobotView| -> Vec<RigView> {
        let number = rig.views.iter().position(|view| *view == robot_view.view);
        let sightings = rig.sightings.iter().filter(|s| Some(s.view) == number);
        let view = sightings.map(|s| RigView {
            camera: &rig.lenses[s.camera],
            cam_from_rig: cam_from_rig[s.camera],
            cam_from_rig_covariance: None,
            seen: &s.seen,
        });
        view.collect()
    };
    let rigs: Vec<Vec<RigView>> = robot_views.iter().map(of_view).collect();
    let views: Vec<HandView> = robot_views.iter().zip(&rigs).map(|(view, seen)| view.view(seen)).collect();
    let eye = if rig.cameras.len() == 1 { "cam" } else { "rig" };
    let asked = Asked { config: args.config()?, eye, robot_views: &robot_views, left_out };
    let outcome = answer(&asked, &views, &args.output)?;
    Ok(if contradiction.is_some() { Outcome::SomeUnanswered } else { outcome })
}

impl HandEyeArgs {
    fn sigmas(&self) -> Option<(f64, f64)> {
        self.robot_sigma_deg.zip(self.robot_sigma_mm).map(|(deg, mm)| (deg.to_radians(), 1e-3 * mm))
    }

    fn config(&self) -> Result<HandEyeConfig> {
        let mount = if self.eye_to_hand { Mount::TargetOnHand } else { Mount::CameraOnHand };
        let Some(height_m) = self.known_height_m else { return Ok(HandEyeConfig { mount, height: None }) };
        let numbers: Vec<f64> = self.height_axis.split(',').filter_map(|x| x.trim().parse().ok()).collect();
        let [x, y, z] = numbers[..] else {
            bail!("--height-axis {}: three numbers separated by commas are needed", self.height_axis);
        };
        let height = Height {
            direction_in_carrier: Point::new(x, y, z),
            height_m,
            sigma_m: 1e-3 * self.height_sigma_mm,
        };
        Ok(HandEyeConfig { mount, height: Some(height) })
    }
}

fn answer(asked: &Asked, views: &[HandView], output: &AnswerArgs) -> Result<Outcome> {
    let found = match solve_hand_eye(views, &asked.config) {
        Ok(found) => found,
        Err(reason) => {
            let status = match reason {
                resight::core::Error::DegenerateMotion { .. }
                | resight::core::Error::TooFewMotions { .. } => "degenerate",
                resight::core::Error::ViewsDisagree { .. } => "inconsistent",
                _ => "error",
            };
            let message = format!("{reason}{}", left_out(&asked.left_out));
            return unanswered(output, &Unsolved { status, message, groups: Vec::new() });
        }
    };
    let object = object(asked, &found);
    if let Some(path) = &output.output {
        let text = format!("{}\n", serde_json::to_string(&object)?);
        resight::formats::write_atomically(path, text.as_bytes())?;
    }
    match output.json {
        true => print(&format!("{}\n", serde_json::to_string(&object)?))?,
        false => print(&words(asked, &found, &object))?,
    }
    Ok(if found.is_inconsistent { Outcome::SomeUnanswered } else { Outcome::Answered })
}

fn left_out(views: &[(String, String)]) -> String {
    match views {
        [] => String::new(),
        [(view, reason), ..] => format!("; {} views took no part, e.g. {view}: {reason}", views.len()),
    }
}

/// Names of X and Z.
fn names(asked: &Asked) -> (String, &'static str) {
    match asked.config.mount {
        Mount::CameraOnHand => (format!("{}_from_gripper", asked.eye), "base_from_target"),
        Mount::TargetOnHand => (format!("{}_from_base", asked.eye), "gripper_from_target"),
    }
}

fn object(asked: &Asked, found: &HandEye) -> HandEyeObject {
    let (carrier, holder) = names(asked);
    let poses = BTreeMap::from([
        (carrier, KnownObject::of(&found.cam_from_carrier, &found.carrier_covariance)),
        (holder.to_string(), KnownObject::of(&found.holder_from_target, &found.holder_covariance)),
    ]);
    let view = |(robot_view, result): (&RobotView, &HandViewResult)| ViewObject {
        view: robot_view.view.clone(),
        residual_rad: result.residual.map(|r| r.fixed_rows::<3>(0).norm()),
        residual_m: result.residual.map(|r| r.fixed_rows::<3>(3).norm()),
        chi2: result.chi2,
        is_used: result.rejected.is_none(),
    };
    HandEyeObject {
        status: if found.is_inconsistent { "inconsistent" } else { "ok" },
        mount: if found.mount == Mount::CameraOnHand { "eye_in_hand" } else { "eye_to_hand" },
        poses,
        n_views: found.views.len(),
        n_used: found.n_used,
        chi2: found.chi2,
        degrees_of_freedom: found.degrees_of_freedom,
        pose_chi2: found.pose_chi2,
        pose_degrees_of_freedom: found.pose_degrees_of_freedom,
        noise_scale: found.noise_scale,
        robot_noise: found
            .hand_noise
            .map(|noise| RobotNoiseObject { sigma_rad: noise.sigma_rad, sigma_m: noise.sigma_m }),
        target_size: found.target_size.map(|size| TargetSizeObject { ratio: size.ratio, sigma: size.sigma }),
        rotations_rad: found.turns_rad,
        views: asked.robot_views.iter().zip(&found.views).map(view).collect(),
        rejected: rejected(asked, found),
        causes: found.causes.iter().map(HandEyeCause::to_string).collect(),
        message: message(found),
    }
}

/// Views without a counterpart, then those that the solver left out.
fn rejected(asked: &Asked, found: &HandEye) -> Vec<RejectedObject> {
    let before = asked
        .left_out
        .iter()
        .map(|(view, reason)| RejectedObject { view: view.clone(), reason: reason.clone() });
    let solver = asked.robot_views.iter().zip(&found.views).filter_map(|(robot_view, result)| {
        let reason = match result.rejected.as_ref()? {
            RejectedView::Unlocated(reason) => reason.to_string(),
            RejectedView::Contradicts => {
                "contradicts the other views: a flipped pose, a robot pose of another view, or a target that moved".into()
            }
            _ => "took no part".into(),
        };
        Some(RejectedObject { view: robot_view.view.clone(), reason })
    });
    before.chain(solver).collect()
}

fn message(found: &HandEye) -> String {
    let used = format!("{} of {} views agree", found.n_used, found.views.len());
    if let Some(cause) = found.causes.first() {
        return format!("not to be believed ({used}): {cause}");
    }
    match found.noise_scale {
        scale if 1.0 < scale => {
            format!(
                "{used}; residuals are {} times what the sigmas say, and every ± is widened by as much",
                figures(scale.sqrt())
            )
        }
        _ => used,
    }
}

fn words(asked: &Asked, found: &HandEye, object: &HandEyeObject) -> String {
    let mut out = format!("HAND-EYE   {}: {}\n", object.status.to_uppercase(), object.message);
    for cause in object.causes.iter().skip(1) {
        line(&mut out, "and", cause);
    }
    let (carrier, holder) = names(asked);
    line(&mut out, &carrier, &place(&found.cam_from_carrier, &found.carrier_covariance));
    line(&mut out, holder, &place(&found.holder_from_target, &found.holder_covariance));
    let [first, second, third] = found.turns_rad.map(degrees);
    let text = format!("{first} {second} {third} about three axes, root mean square between views");
    line(&mut out, "rotations", &text);
    line(
        &mut out,
        "fit",
        &format!("χ² {:.1} for {} degrees of freedom", found.chi2, found.degrees_of_freedom),
    );
    if let Some(noise) = &found.hand_noise {
        let text = format!(
            "{} and {} (1σ per axis), estimated from the views",
            degrees(noise.sigma_rad),
            length(noise.sigma_m)
        );
        line(&mut out, "robot's noise", &text);
    }
    if let Some(size) = &found.target_size {
        let text = format!(
            "{:+.2} % ± {:.2} % by the robot's motions, over the stated size",
            100.0 * (size.ratio - 1.0),
            100.0 * size.sigma
        );
        line(&mut out, "target's size", &text);
    }
    for view in object.views.iter().filter(|view| view.is_used) {
        if let (Some(turn), Some(shift)) = (view.residual_rad, view.residual_m) {
            line(&mut out, &view.view, &format!("{} and {} off", degrees(turn), length(shift)));
        }
    }
    for rejected in &object.rejected {
        line(&mut out, "left out", &format!("{}: {}", rejected.view, rejected.reason));
    }
    out
}

/// Rotation vector, translation and the largest standard deviation of each.
fn place(b_from_a: &Pose, covariance: &Matrix6) -> String {
    let (r, t) = (b_from_a.log(), b_from_a.translation * 1e3);
    let (turn, shift) = sigmas(covariance);
    let largest = |s: [f64; 3]| s.into_iter().fold(0.0, f64::max);
    format!(
        "rotation [{:+.6} {:+.6} {:+.6}] rad, translation [{:+.2} {:+.2} {:+.2}] mm   ± {} and {}",
        r[0],
        r[1],
        r[2],
        t.x,
        t.y,
        t.z,
        degrees(largest(turn)),
        length(largest(shift))
    )
}
