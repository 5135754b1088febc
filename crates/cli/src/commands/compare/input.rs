//! What is compared: rigs and poses, from files of cameras and from this program's own JSON.

use anyhow::{Context, Result, bail};
use resight::core::{Matrix6, Pose};
use resight::formats::read_cameras;
use resight::rig::places::{PlacedCamera, PlacedRig, placed};
use serde_json::Value;
use std::path::Path;

/// One of the two files.
pub enum Input {
    /// Cameras relative to each other.
    Rig(PlacedRig),
    /// A pose for each view.
    Poses(Vec<ViewPoses>),
}

/// What one view says about where its camera is.
pub struct ViewPoses {
    /// Its name.
    pub view: String,
    /// cam_from_target and covariance of every pose that fits, the best first; none where there is no pose.
    pub poses: Vec<(Pose, Matrix6)>,
}

/// Reads a file by its content.
pub fn read(path: &Path) -> Result<Input> {
    crate::files::must_exist(path)?;
    // Folders and recordings are for the readers of rigs below.
    let bytes = match path.is_dir() || resight::recording::is_recording(path) {
        true => Vec::new(),
        false => resight::input::read(path, resight::input::Kind::Results)?,
    };
    let text = String::from_utf8(bytes).unwrap_or_default(); // What is no text is no JSON either.
    let lines: Option<Vec<Value>> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(|line| serde_json::from_str::<Value>(line).ok().filter(Value::is_object))
        .collect();
    match lines.as_deref() {
        Some([only]) if only["cameras"].is_object() && only.get("reference").is_some() => {
            if only["status"] == "inconsistent" {
                let reason = only["contradiction"].as_str().unwrap_or("no reason is stated");
                crate::output::remark(&format!(
                    "warning: {}: the rig in this file is inconsistent: {reason}",
                    path.display()
                ));
            }
            rig_object(only).map(Input::Rig).with_context(|| path.display().to_string())
        }
        Some([first, ..]) if first.get("cam_from_target").is_some() => {
            let lines = lines.iter().flatten().enumerate();
            let poses =
                lines.map(|(i, line)| view(line).with_context(|| format!("{}:{}", path.display(), i + 1)));
            Ok(Input::Poses(poses.collect::<Result<_>>()?))
        }
        Some([first, ..]) if first.get("status").is_some() => {
            bail!(
                "{}: holds no rig and no poses: {}",
                path.display(),
                first["message"].as_str().unwrap_or("")
            )
        }
        _ => camera_file(path).map(Input::Rig),
    }
}

fn camera_file(path: &Path) -> Result<PlacedRig> {
    let file = read_cameras(path)?;
    file.warnings
        .iter()
        .for_each(|warning| crate::output::remark(&format!("warning: {}: {warning}", path.display())));
    let cameras = placed(&file.cameras).map_err(|reason| anyhow::anyhow!("{} {reason}", path.display()))?;
    match &file.joint {
        None => Ok(PlacedRig { cameras, joint: None, noise_degrees_of_freedom: None }),
        Some(joint) => PlacedRig::with_joint(cameras, &joint.cameras, &joint.rows())
            .map(|rig| PlacedRig { noise_degrees_of_freedom: joint.noise_degrees_of_freedom, ..rig })
            .map_err(|reason| anyhow::anyhow!("{}: {reason}", path.display())),
    }
}

/// What `rig --json` prints.
fn rig_object(object: &Value) -> Result<PlacedRig> {
    let cameras = object["cameras"].as_object().context("`cameras` is no table")?;
    let place = |(name, camera): (&String, &Value)| -> Result<PlacedCamera> {
        let cam_from_rig =
            pose(&camera["cam_from_rig"]).with_context(|| format!("camera {name}: cam_from_rig"))?;
        // A chain of pairs, or pairs without a loop, may not say how sure they are.
        let covariance = match &camera["covariance"] {
            Value::Null => None,
            covariance => Some(matrix6(covariance).with_context(|| format!("camera {name}: covariance"))?),
        };
        Ok(PlacedCamera { name: name.clone(), cam_from_rig, covariance })
    };
    let cameras: Vec<PlacedCamera> = cameras.iter().map(place).collect::<Result<_>>()?;
    let noise_degrees_of_freedom = object["noise_degrees_of_freedom"].as_f64();
    let Some(joint) = object.get("joint_covariance") else {
        return Ok(PlacedRig { cameras, joint: None, noise_degrees_of_freedom });
    };
    let names: Vec<String> =
        serde_json::from_value(joint["cameras"].clone()).context("joint_covariance.cameras")?;
    let rows: Vec<Vec<f64>> =
        serde_json::from_value(joint["matrix"].clone()).context("joint_covariance.matrix")?;
    let rig = PlacedRig::with_joint(cameras, &names, &rows).map_err(anyhow::Error::msg)?;
    Ok(PlacedRig { noise_degrees_of_freedom, ..rig })
}

/// What `locate` and `solve` print for a view.
fn view(line: &Value) -> Result<ViewPoses> {
    let view = line["view"].as_str().unwrap_or("").to_string();
    if line["cam_from_target"].is_null() {
        return Ok(ViewPoses { view, poses: Vec::new() });
    }
    let read = |object: &Value| -> Result<(Pose, Matrix6)> {
        let of_pose = pose(&object["cam_from_target"]).context("cam_from_target")?;
        Ok((of_pose, matrix6(&object["covariance"]).context("covariance")?))
    };
    let mut poses = vec![read(line)?];
    let rivals = line["minima"].as_array().into_iter().flatten().skip(1).filter(|m| m["within_gate"] == true);
    for rival in rivals {
        poses.push(read(rival)?);
    }
    Ok(ViewPoses { view, poses })
}

fn pose(object: &Value) -> Result<Pose> {
    let q = numbers::<4>(&object["rotation_wxyz"]).context("rotation_wxyz must be four numbers")?;
    let t = numbers::<3>(&object["translation_m"]).context("translation_m must be three numbers")?;
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !((length - 1.0).abs() < 1e-6) {
        bail!("rotation_wxyz has length {length}; a rotation is a quaternion of length 1");
    }
    Ok(Pose::from_quaternion_wxyz(q, t.into()))
}

fn matrix6(value: &Value) -> Result<Matrix6> {
    let mut matrix = Matrix6::zeros();
    for i in 0..6 {
        let row = numbers::<6>(&value[i]).context("must be 6 rows of 6 numbers")?;
        matrix.set_row(i, &row.into());
    }
    Ok(matrix)
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list = value.as_array().filter(|list| list.len() == N)?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}
