//! Reads what is compared: rigs and poses, from files of cameras and from the JSON of answers.

use crate::Error;
use crate::core::{Matrix6, Pose};
use crate::formats::read_places;
use crate::rig::places::{PlacedCamera, PlacedRig, placed, placed_frames};
use serde_json::Value;
use std::path::Path;

/// One of the two calibrations.
#[derive(Debug, Clone)]
pub enum Compared {
    /// Cameras with poses relative to each other.
    Rig {
        /// The name used in messages, such as the file.
        name: String,
        /// The cameras.
        rig: PlacedRig,
    },
    /// A pose for each view.
    Poses {
        /// The name used in messages, such as the file.
        name: String,
        /// The views.
        views: Vec<ViewPoses>,
    },
}

impl Compared {
    pub(super) fn name(&self) -> &str {
        match self {
            Compared::Rig { name, .. } | Compared::Poses { name, .. } => name,
        }
    }
}

/// The poses of the camera in one view.
#[derive(Debug, Clone)]
pub struct ViewPoses {
    /// Its name.
    pub view: String,
    /// cam_from_target and its covariance for every pose that fits, the best first; empty where there is no pose.
    pub poses: Vec<(Pose, Matrix6)>,
}

/// Reads a file by its content: a rig (our own file, any camera file with poses, the JSON object of a rig) or poses (JSON Lines of pose
/// answers). The second value lists what is unusual about the file.
///
/// # Errors
/// What is wrong with the file, and where.
pub fn read(path: impl AsRef<Path>) -> Result<(Compared, Vec<String>), Error> {
    let path = path.as_ref();
    // Folders and recordings are read by the readers of rigs below.
    let bytes = match path.is_dir() || crate::recording::is_recording(path) {
        true => Vec::new(),
        false => crate::input::read(path, crate::input::Kind::Results)?,
    };
    let text = String::from_utf8(bytes).unwrap_or_default(); // What is no text is no JSON either.
    let lines: Option<Vec<Value>> = text
        .lines()
        .filter(|line| !line.trim().is_empty())
        .map(|line| serde_json::from_str::<Value>(line).ok().filter(Value::is_object))
        .collect();
    let name = path.display().to_string();
    let in_file = |reason: String| Error::request(format!("{name}: {reason}"));
    match lines.as_deref() {
        Some([only]) if only["cameras"].is_object() && only.get("reference").is_some() => {
            let reason = || only["contradiction"].as_str().unwrap_or("no reason is stated");
            let warnings = (only["status"] == "inconsistent")
                .then(|| format!("the rig in this file is inconsistent: {}", reason()));
            let rig = rig_object(only).map_err(in_file)?;
            Ok((Compared::Rig { name, rig }, warnings.into_iter().collect()))
        }
        Some([first, ..]) if first.get("cam_from_target").is_some() => {
            let lines = lines.iter().flatten().enumerate();
            let views = lines.map(|(i, line)| {
                view(line).map_err(|reason| Error::request(format!("{name}:{}: {reason}", i + 1)))
            });
            let views = views.collect::<Result<_, Error>>()?;
            Ok((Compared::Poses { name, views }, Vec::new()))
        }
        Some([first, ..]) if first.get("status").is_some() => {
            let reason = first["message"].as_str().unwrap_or("");
            Err(in_file(format!("holds no rig and no poses: {reason}")))
        }
        _ => {
            let (rig, warnings) = camera_file(path)?;
            Ok((Compared::Rig { name, rig }, warnings))
        }
    }
}

fn camera_file(path: &Path) -> Result<(PlacedRig, Vec<String>), Error> {
    let file = read_places(path)?;
    let cameras = match file.cameras.is_empty() {
        true => placed_frames(&file.relations),
        false => placed(&file.cameras),
    };
    let cameras = cameras.map_err(|reason| Error::request(format!("{} {reason}", path.display())))?;
    let rig = match &file.joint {
        None => PlacedRig { cameras, joint: None, noise_degrees_of_freedom: None },
        Some(joint) => PlacedRig::with_joint(cameras, &joint.cameras, &joint.rows())
            .map(|rig| PlacedRig { noise_degrees_of_freedom: joint.noise_degrees_of_freedom, ..rig })
            .map_err(|reason| Error::request(format!("{}: {reason}", path.display())))?,
    };
    Ok((rig, file.warnings))
}

/// Reads the object that `rig --json` prints.
fn rig_object(object: &Value) -> Result<PlacedRig, String> {
    let cameras = object["cameras"].as_object().ok_or("`cameras` is no table")?;
    let place = |(name, camera): (&String, &Value)| -> Result<PlacedCamera, String> {
        let key = |key: &'static str| move |reason: String| format!("camera {name}: {key}: {reason}");
        let cam_from_rig = pose(&camera["cam_from_rig"]).map_err(key("cam_from_rig"))?;
        // A chain of pairs, or pairs without a loop, may state no uncertainty.
        let covariance = match &camera["covariance"] {
            Value::Null => None,
            covariance => Some(matrix6(covariance).map_err(key("covariance"))?),
        };
        Ok(PlacedCamera { name: name.clone(), cam_from_rig, covariance })
    };
    let cameras: Vec<PlacedCamera> = cameras.iter().map(place).collect::<Result<_, String>>()?;
    let noise_degrees_of_freedom = object["noise_degrees_of_freedom"].as_f64();
    let Some(joint) = object.get("joint_covariance") else {
        return Ok(PlacedRig { cameras, joint: None, noise_degrees_of_freedom });
    };
    fn list<T: serde::de::DeserializeOwned>(joint: &Value, key: &str) -> Result<T, String> {
        serde_json::from_value(joint[key].clone())
            .map_err(|reason| format!("joint_covariance.{key}: {reason}"))
    }
    let (names, rows): (Vec<String>, Vec<Vec<f64>>) = (list(joint, "cameras")?, list(joint, "matrix")?);
    let rig = PlacedRig::with_joint(cameras, &names, &rows)?;
    Ok(PlacedRig { noise_degrees_of_freedom, ..rig })
}

/// Reads a line that `locate` or `solve` prints for a view.
fn view(line: &Value) -> Result<ViewPoses, String> {
    let view = line["view"].as_str().unwrap_or("").to_string();
    if line["cam_from_target"].is_null() {
        return Ok(ViewPoses { view, poses: Vec::new() });
    }
    let read = |object: &Value| -> Result<(Pose, Matrix6), String> {
        let key = |key: &'static str| move |reason: String| format!("{key}: {reason}");
        let cam_from_target = pose(&object["cam_from_target"]).map_err(key("cam_from_target"))?;
        Ok((cam_from_target, matrix6(&object["covariance"]).map_err(key("covariance"))?))
    };
    let mut poses = vec![read(line)?];
    let alternatives =
        line["minima"].as_array().into_iter().flatten().skip(1).filter(|m| m["within_gate"] == true);
    for alternative in alternatives {
        poses.push(read(alternative)?);
    }
    Ok(ViewPoses { view, poses })
}

fn pose(object: &Value) -> Result<Pose, String> {
    let q = numbers::<4>(&object["rotation_wxyz"]).ok_or("rotation_wxyz must be four numbers")?;
    let t = numbers::<3>(&object["translation_m"]).ok_or("translation_m must be three numbers")?;
    let length = q.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !((length - 1.0).abs() < 1e-6) {
        return Err(format!("rotation_wxyz has length {length}; a rotation is a quaternion of length 1"));
    }
    Ok(Pose::from_quaternion_wxyz(q, t.into()))
}

fn matrix6(value: &Value) -> Result<Matrix6, String> {
    let mut matrix = Matrix6::zeros();
    for i in 0..6 {
        let row = numbers::<6>(&value[i]).ok_or("must be 6 rows of 6 numbers")?;
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
