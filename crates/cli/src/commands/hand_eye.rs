//! `hand-eye`: where the camera (or the rig) is mounted on a robot or vehicle, from known motions.

use super::rig::{self, AnswerArgs, ObservationArgs, SolvingArgs, unanswered};
use crate::args::{not_negative, positive};
use crate::output::{Outcome, print_answer, remark, with_progress};
use crate::text::line;
use anyhow::{Result, bail};
use clap::Args;
use resight::answer::{HandEyeAnswer, SolvedHandEye};
use resight::core::multiview::hand_eye::{GripperNoise, HandEyeConfig, Height, Mounting};
use resight::core::{Matrix6, Point, Pose};
use resight::formats::pose_list::{LengthUnit, PoseListOptions, RotationWord};
use resight::formats::write_atomically;
use resight::report::words::{budget, coordinate, degrees, length, sigmas, translation_sigma_m};
use resight::rig::{HandEyeRequest, HandEyeViews, RobotFile, ViewPoses, read_robot_file, read_view_poses};
use std::path::{Path, PathBuf};

/// Computes how a camera or rig is mounted on a robot or vehicle (hand–eye calibration).
///
/// A rig of several cameras is solved first. The robot's own noise is estimated from the views unless it is given.
#[derive(Debug, Args)]
#[command(after_help = "Example:
  resight hand-eye --motions motions.csv --camera cam=cam.yaml --target board.toml --images cam='*.jpg'")]
#[command(after_long_help = "Examples:
  resight hand-eye --motions motions.csv --camera cam=cam.yaml --target board.toml --images cam='*.jpg' --json
  resight hand-eye --motions motions.csv --poses poses.jsonl
  resight hand-eye --motions robot.csv --rotation kuka --poses poses.jsonl --eye-to-hand
  resight hand-eye --motions robot.npy --poses target.npy --tolerance-mm 1
  resight hand-eye --motions easy_handeye2_demo.samples")]
pub struct HandEyeArgs {
    /// Poses of the gripper, or of the vehicle's body (CSV, .npy, JSON, YAML).
    ///
    /// The columns of a table are view,qw,qx,qy,qz,x_m,y_m,z_m (x_in_base = base_from_gripper · x_in_gripper) and optionally sigma_deg,sigma_mm, or those of
    /// another convention. Samples of easy_handeye and MoveIt hold the poses of the target too.
    #[arg(long, help_heading = "Robot", value_name = "FILE")]
    motions: PathBuf,
    /// What the numbers of a rotation in --motions mean, where the file does not state it.
    ///
    /// quaternion-wxyz, quaternion-xyzw, abb, ur, rotvec-rad, rotvec-deg, rpy-rad, rpy-deg, fanuc, mitsubishi, yaskawa, kuka, abb-zyx, zyx-rad,
    /// staubli, xyz-rad, kawasaki or zyz-rad.
    #[arg(long, help_heading = "Robot", value_name = "NAME", value_parser = RotationWord::parse)]
    rotation: Option<RotationWord>,
    /// Unit of the positions in --motions [default: by the columns, else of the --rotation, else m].
    #[arg(long, hide_short_help = true, help_heading = "Robot", value_name = "m|cm|mm", value_parser = LengthUnit::parse)]
    length: Option<LengthUnit>,
    /// States that --motions holds gripper_from_base.
    #[arg(long, hide_short_help = true, help_heading = "Robot")]
    inverse: bool,
    /// Poses from `locate` or `solve` (-o), or cam_from_target in any format of --motions, instead of images or detections.
    #[arg(long, value_name = "POSES", conflicts_with_all = ["images", "detections", "cameras", "targets"])]
    poses: Option<PathBuf>,
    #[command(flatten)]
    observed: ObservationArgs,
    #[command(flatten)]
    solving: SolvingArgs,
    /// States that the target is on the gripper and the camera stands still.
    #[arg(long, help_heading = "Robot")]
    eye_to_hand: bool,
    /// Standard deviation of the robot's orientation [default: estimated from the views].
    ///
    /// It is used where the file has no sigma_deg; 0 means an exact robot.
    #[arg(long, hide_short_help = true, help_heading = "Robot", value_name = "DEG", requires = "robot_sigma_mm", value_parser = not_negative)]
    robot_sigma_deg: Option<f64>,
    /// Standard deviation of the robot's position [default: estimated from the views].
    ///
    /// It is used where the file has no sigma_mm; 0 means an exact robot.
    #[arg(long, hide_short_help = true, help_heading = "Robot", value_name = "MM", requires = "robot_sigma_deg", value_parser = not_negative)]
    robot_sigma_mm: Option<f64>,
    /// Height of the camera above the gripper's origin, where the robot rotates about parallel axes only.
    ///
    /// It is the camera's position along --height-axis in metres, from the base's origin with --eye-to-hand. Vehicles need it.
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Robot",
        value_name = "M",
        allow_negative_numbers = true
    )]
    known_height_m: Option<f64>,
    /// Standard deviation of that height.
    #[arg(long, hide_short_help = true, help_heading = "Robot", value_name = "MM", requires = "known_height_m", default_value = "1", value_parser = positive)]
    height_sigma_mm: f64,
    /// Direction of that height in the gripper's frame (the base's with --eye-to-hand).
    #[arg(
        long,
        hide_short_help = true,
        help_heading = "Robot",
        value_name = "X,Y,Z",
        requires = "known_height_m",
        default_value = "0,0,1",
        allow_hyphen_values = true
    )]
    height_axis: String,
    #[command(flatten)]
    output: AnswerArgs,
}

/// See `HandEyeArgs`.
pub fn run(args: &HandEyeArgs) -> Result<Outcome> {
    if let Some(path) = &args.output.output {
        crate::files::must_be_writable(path)?;
    }
    crate::files::must_exist(&args.motions)?;
    let RobotFile { robot, seen, mounting, mut remarks } =
        read_robot_file(&args.motions, &args.pose_list_options(), args.robot_noise())?;
    let views = args.views(seen, &mut remarks)?;
    remarks.iter().for_each(|text| remark(&format!("warning: {text}")));
    let mut config = args.config()?;
    config.mounting = mounting.unwrap_or(config.mounting);
    let request = HandEyeRequest { robot, views, config, remarks };
    match with_progress(|| resight::hand_eye(request))? {
        HandEyeAnswer::Solved(solved) => answer(&solved, &args.output),
        HandEyeAnswer::Unsolved(reason) => unanswered(&args.output, "HAND-EYE", &reason),
    }
}

impl HandEyeArgs {
    fn pose_list_options(&self) -> PoseListOptions {
        PoseListOptions {
            rotation: self.rotation,
            length: self.length,
            is_inverse: self.inverse,
            eye_to_hand: self.eye_to_hand,
        }
    }

    /// The observations given, else those in the file of the motions; adds remarks on their file.
    fn views(&self, seen: Option<Vec<ViewPoses>>, remarks: &mut Vec<String>) -> Result<HandEyeViews> {
        if let Some(poses) = &self.poses {
            crate::files::must_exist(poses)?;
            let (views, others) = read_view_poses(poses)?;
            remarks.extend(others);
            return Ok(HandEyeViews::Poses(views));
        }
        if let (Some(seen), true) = (seen, self.observed.is_empty()) {
            return Ok(HandEyeViews::Poses(seen));
        }
        let request = rig::request(&self.observed, &self.solving)?;
        for (name, target) in &request.targets {
            super::warn_of_scale(Path::new(name), target, "hand-eye");
        }
        Ok(HandEyeViews::Points(Box::new(rig::observed(&self.observed, &request)?)))
    }

    fn robot_noise(&self) -> Option<GripperNoise> {
        let sigmas = self.robot_sigma_deg.zip(self.robot_sigma_mm);
        sigmas.map(|(deg, mm)| GripperNoise { sigma_rad: deg.to_radians(), sigma_m: 1e-3 * mm })
    }

    fn config(&self) -> Result<HandEyeConfig> {
        let mounting = if self.eye_to_hand { Mounting::TargetOnGripper } else { Mounting::CameraOnGripper };
        let tolerance = self.solving.tolerance.tolerance();
        let Some(height_m) = self.known_height_m else {
            return Ok(HandEyeConfig { mounting, height: None, tolerance });
        };
        let numbers: Vec<f64> = self.height_axis.split(',').filter_map(|x| x.trim().parse().ok()).collect();
        let [x, y, z] = numbers[..] else {
            bail!("--height-axis {}: three numbers separated by commas are needed", self.height_axis);
        };
        let height = Height {
            direction_in_carrier: Point::new(x, y, z),
            height_m,
            sigma_m: 1e-3 * self.height_sigma_mm,
        };
        Ok(HandEyeConfig { mounting, height: Some(height), tolerance })
    }
}

fn answer(solved: &SolvedHandEye, output: &AnswerArgs) -> Result<Outcome> {
    if let Some(sentence) = &solved.rig_contradiction {
        remark(&format!("warning: the rig is INCONSISTENT: {sentence}"));
    }
    let json = format!("{}\n", serde_json::to_string(solved)?);
    if let Some(path) = &output.output {
        write_atomically(path, json.as_bytes())?;
    }
    print_answer(output.json, solved, &words(solved), solved.status())?;
    Ok(Outcome::of([solved.status()]))
}

fn words(solved: &SolvedHandEye) -> String {
    let found = &solved.solution;
    let mut out = format!("HAND-EYE   {}: {}\n", solved.status().name().to_uppercase(), solved.message());
    for cause in solved.causes().iter().skip(1) {
        line(&mut out, "and", cause);
    }
    let (carrier, holder) = solved.pose_names();
    let poses = [
        (&carrier[..], place(&found.cam_from_carrier, &found.carrier_covariance), &found.carrier_budget),
        (holder, place(&found.holder_from_target, &found.holder_covariance), &found.holder_budget),
    ];
    for (name, pose, parts) in poses {
        line(&mut out, name, &pose);
        if let Some(text) = budget(parts) {
            line(&mut out, "budget", &text);
        }
    }
    crate::text::explained(&mut out, &solved.explanations(), found.is_inconsistent);
    let [first, second, third] = found.rotations_rad.map(degrees);
    let text = format!("{first} {second} {third} about three axes, root mean square between views");
    line(&mut out, "rotations", &text);
    line(
        &mut out,
        "fit",
        &format!("χ² {:.1} for {} degrees of freedom", found.chi2, found.degrees_of_freedom),
    );
    if let Some(noise) = &found.gripper_noise {
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
    for view in solved.agreements().iter().filter(|view| view.is_used) {
        if let (Some(turn), Some(shift)) = (view.residual_rad, view.residual_m) {
            line(&mut out, &view.view, &format!("{} and {} off", degrees(turn), length(shift)));
        }
    }
    for rejected in solved.rejected() {
        line(&mut out, "left out", &format!("{}: {}", rejected.view, rejected.reason));
    }
    out
}

/// Rotation vector with the largest standard deviation of the rotation, and each number of the translation with its own.
fn place(b_from_a: &Pose, covariance: &Matrix6) -> String {
    let (r, t) = (b_from_a.log(), b_from_a.translation);
    let turn = sigmas(covariance).0.into_iter().fold(0.0, f64::max);
    let sigma_m = translation_sigma_m(b_from_a, covariance);
    let [x, y, z] = [0, 1, 2].map(|i| coordinate(t[i], sigma_m[i]));
    format!(
        "rotation [{:+.6} {:+.6} {:+.6}] rad ± {}, translation [{x}, {y}, {z}]",
        r[0],
        r[1],
        r[2],
        degrees(turn)
    )
}
