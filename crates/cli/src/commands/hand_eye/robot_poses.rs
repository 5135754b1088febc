//! Poses of the robot from a CSV file, poses of the target from `locate`'s JSON Lines, joined by the name of the view.

use crate::table::Table;
use anyhow::{Context, Result, bail};
use resight::core::hand_eye::{Candidate, HandView};
use resight::core::rig_pose::RigView;
use resight::core::{Matrix6, Pose};
use resight::rig::pairs::{isotropic, pose_from_numbers};
use serde::Deserialize;
use std::path::Path;

/// The pose of the gripper in one view.
pub struct Motion {
    view: String,
    base_from_gripper: Pose,
    covariance: Option<Matrix6>,
}

/// What one view shows.
pub struct Observation {
    /// Its name.
    pub view: String,
    /// Poses that fit; empty where points are given instead.
    pub candidates: Vec<Candidate>,
}

/// The robot's pose and what the camera observed.
pub struct RobotView {
    /// The view's name as the camera has it.
    pub view: String,
    motion: Motion,
    candidates: Vec<Candidate>,
}

impl RobotView {
    /// As the solver takes it.
    pub fn view<'a>(&self, seen: &'a [RigView<'a>]) -> HandView<'a> {
        HandView {
            base_from_hand: self.motion.base_from_gripper,
            hand_covariance: self.motion.covariance,
            candidates: self.candidates.clone(),
            seen,
        }
    }
}

/// Reads `view,qw,qx,qy,qz,x_m,y_m,z_m` and optionally `sigma_deg,sigma_mm`; `sigmas` (rad, m) where these are missing.
pub fn motions(path: &Path, sigmas: Option<(f64, f64)>) -> Result<Vec<Motion>> {
    crate::files::must_exist(path)?;
    let table = Table::open(path, "view,qw,qx,qy,qz,x_m,y_m,z_m")?;
    let order = "the order of the quaternion must be named: qw is its scalar";
    let view = table.need("view", None)?;
    let mut columns = [0; 7];
    for (column, name) in columns.iter_mut().zip(["qw", "qx", "qy", "qz", "x_m", "y_m", "z_m"]) {
        *column = table.need(name, name.starts_with('q').then_some(order))?;
    }
    let (turn, shift) = (table.find("sigma_deg"), table.find("sigma_mm"));
    if turn.is_some() != shift.is_some() {
        bail!("{}:1: sigma_deg and sigma_mm belong together; one is missing", path.display());
    }
    let mut motions: Vec<Motion> = Vec::new();
    table.each(|row| {
        let Some(name) = row.text(view) else {
            bail!("{}", row.complaint(view, "is empty; a view's name is needed"))
        };
        if motions.iter().any(|earlier| earlier.view == name) {
            bail!("{}", row.complaint(view, &format!("has `{name}` twice; give each view once")));
        }
        let mut v = [0.0; 7];
        for (x, column) in v.iter_mut().zip(columns) {
            *x = row.number(column)?;
        }
        let base_from_gripper = pose_from_numbers(&v)
            .map_err(|reason| anyhow::anyhow!("{}:{}: {reason}", path.display(), row.line))?;
        let own = row.optional_number(turn)?.zip(row.optional_number(shift)?);
        let sigma = own.map(|(deg, mm)| (deg.to_radians(), 1e-3 * mm)).or(sigmas);
        let covariance = sigma.map(|(rad, m)| isotropic(rad, m));
        motions.push(Motion { view: name.to_string(), base_from_gripper, covariance });
        Ok(())
    })?;
    Ok(motions)
}

/// The keys of the pose object that matter here.
#[derive(Deserialize)]
struct PoseLine {
    view: String,
    cam_from_target: Option<TransformLine>,
    covariance: Option<[[f64; 6]; 6]>,
    minima: Option<Vec<MinimumLine>>,
}

#[derive(Deserialize)]
struct TransformLine {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

#[derive(Deserialize)]
struct MinimumLine {
    cam_from_target: TransformLine,
    covariance: [[f64; 6]; 6],
    delta_chi2: f64,
    within_gate: bool,
}

/// Reads the JSON Lines of `locate` and `solve`; views without a pose come without candidates.
pub fn poses(path: &Path) -> Result<Vec<Observation>> {
    crate::files::must_exist(path)?;
    let text = resight::input::read_text(path, resight::input::Kind::Results)?;
    let mut seen: Vec<Observation> = Vec::new();
    for (n, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let at = || format!("{}:{}", path.display(), n + 1);
        let pose: PoseLine = serde_json::from_str(line).with_context(at)?;
        if seen.iter().any(|earlier| earlier.view == pose.view) {
            bail!("{}: view {} is there twice", at(), pose.view);
        }
        let candidates = candidates(&pose).map_err(|reason| anyhow::anyhow!("{}: {reason}", at()))?;
        seen.push(Observation { view: pose.view, candidates });
    }
    Ok(seen)
}

/// Every minimum within the gate; the answer alone where none are listed.
fn candidates(line: &PoseLine) -> Result<Vec<Candidate>, String> {
    let candidate = |pose: &TransformLine, covariance: &[[f64; 6]; 6], delta_chi2: f64| {
        let ([w, x, y, z], [tx, ty, tz]) = (pose.rotation_wxyz, pose.translation_m);
        let cam_from_target = pose_from_numbers(&[w, x, y, z, tx, ty, tz])?;
        let covariance = Matrix6::from_fn(|i, j| covariance[i][j]);
        Ok(Candidate { cam_from_target, covariance, delta_chi2 })
    };
    let listed = line.minima.iter().flatten().filter(|m| m.within_gate || m.delta_chi2 == 0.0);
    let listed: Vec<Candidate> = listed
        .map(|m| candidate(&m.cam_from_target, &m.covariance, m.delta_chi2.max(0.0)))
        .collect::<Result<_, String>>()?;
    match (listed.is_empty(), &line.cam_from_target, &line.covariance) {
        (true, Some(pose), Some(covariance)) => Ok(vec![candidate(pose, covariance, 0.0)?]),
        _ => Ok(listed),
    }
}

/// Views that both know, by name: as written, else by the file's name, else without its ending. What has no counterpart is named.
pub fn joined(mut motions: Vec<Motion>, seen: Vec<Observation>) -> (Vec<RobotView>, Vec<(String, String)>) {
    let (mut robot_views, mut left_out) = (Vec::new(), Vec::new());
    for Observation { view, candidates } in seen {
        let by = |key: fn(&str) -> &str| {
            let mut same = (0..motions.len()).filter(|i| key(&motions[*i].view) == key(&view));
            same.next().filter(|_| same.next().is_none())
        };
        match by(|name| name).or_else(|| by(file_name)).or_else(|| by(stem)) {
            Some(at) => robot_views.push(RobotView { view, motion: motions.swap_remove(at), candidates }),
            None => left_out.push((view, "no row of the motions has this view".to_string())),
        }
    }
    left_out.extend(motions.into_iter().map(|m| (m.view, "the camera has no such view".to_string())));
    left_out.sort();
    (robot_views, left_out)
}

fn file_name(view: &str) -> &str {
    view.rsplit(['/', '\\']).next().unwrap_or(view)
}

fn stem(view: &str) -> &str {
    file_name(view).rsplit_once('.').map_or(file_name(view), |(stem, _)| stem)
}
