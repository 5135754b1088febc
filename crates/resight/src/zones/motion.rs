//! How a camera moved, from the JSON of `compare`, `landmarks` and `watch`.

use crate::Error;
use crate::core::covariance::is_covariance;
use crate::core::{Matrix6, Point, Pose, Vector6};
use crate::input::{self, Kind};
use crate::report::words::length;
use nalgebra::Matrix3;
use serde_json::Value;
use std::path::Path;

/// How a camera moved since its reference image.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraMotion {
    /// The camera, view or image that it is of.
    pub name: String,
    /// The present pose in the old camera frame.
    pub old_from_new: Pose,
    /// 6×6, `[rotation_rad; translation_m]`, left perturbation in the old camera frame.
    pub covariance: Matrix6,
    /// Columns and rows by which the image has shifted beside the rotation, and their standard deviations, where `landmarks` measured it.
    pub shift_px: Option<([f64; 2], [f64; 2])>,
    /// What is to be known about it.
    pub remarks: Vec<String>,
}

/// Largest χ² of three degrees of freedom for which a shift agrees with its prior, 99 %.
const AGREES: f64 = 11.345;

impl CameraMotion {
    /// Returns the motion of a camera that is known to have shifted by no more than a standard deviation along each axis: zones.md eqs. (8) and (9).
    ///
    /// # Errors
    /// A motion that contradicts that, in a sentence.
    pub(super) fn with_shift_prior(&self, sigma_m: f64) -> Result<CameraMotion, String> {
        let shift_m = self.old_from_new.translation;
        let of_shift = self.covariance.fixed_view::<6, 3>(0, 3).into_owned();
        // A variance of (1 nm)² keeps what is exact invertible.
        let spread =
            self.covariance.fixed_view::<3, 3>(3, 3) + Matrix3::identity() * (sigma_m * sigma_m + 1e-18);
        let inverse = spread.try_inverse().ok_or("the covariance of the shift has no inverse")?;
        let chi2 = (shift_m.transpose() * inverse * shift_m)[0];
        if AGREES < chi2 {
            return Err(format!(
                "the motion has a shift of {} that is not a chance of its covariance and {} (χ² {chi2:.0} for 3 degrees of freedom): the camera did shift; draw the zones again",
                length(shift_m.norm()),
                length(sigma_m)
            ));
        }
        let gain = of_shift * inverse;
        let covariance = self.covariance - gain * of_shift.transpose();
        let covariance = (covariance + covariance.transpose()) * 0.5;
        let old_from_new = self.old_from_new.moved(&(-gain * shift_m));
        let mut narrowed = CameraMotion { old_from_new, covariance, ..self.clone() };
        if sigma_m == 0.0 {
            // A rotation about the camera's own centre, without the rounding of the gain.
            narrowed.old_from_new.translation = Point::zeros();
            narrowed.covariance.rows_mut(3, 3).fill(0.0);
            narrowed.covariance.columns_mut(3, 3).fill(0.0);
        }
        Ok(narrowed)
    }
}

/// Reads the last motion of a file of JSON Lines: a comparison of poses or rigs, a rotation by landmarks, or an alarm of a session. `name` picks
/// one of several cameras or views.
///
/// # Errors
/// A file without a motion, several cameras and no name, numbers that are no pose or no covariance.
pub fn read_motion(path: impl AsRef<Path>, name: Option<&str>) -> Result<CameraMotion, Error> {
    let path = path.as_ref();
    let text = input::read_text(path, Kind::Results)?;
    let fault = |reason: String| Error::request(format!("{}: {reason}", path.display()));
    let mut found: Vec<CameraMotion> = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let value: Value = serde_json::from_str(line)
            .map_err(|_| fault(format!("line {}: no JSON object; the output of `compare --json`, `landmarks --json` or `watch --json` is needed", i + 1)))?;
        for motion in of_line(&value).map_err(|reason| fault(format!("line {}: {reason}", i + 1)))? {
            // Of one camera the last motion holds.
            found.retain(|other| other.name != motion.name);
            found.push(motion);
        }
    }
    let names = || found.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    match (name, found.len()) {
        (_, 0) => Err(fault(
            "holds no motion; `compare A B --json`, `landmarks REFERENCE IMAGE --json` and `watch --json` state one".into(),
        )),
        (None, 1) => Ok(found.swap_remove(0)),
        (None, n) => Err(fault(format!("holds motions of {n}: {}; pick one with --name", names()))),
        (Some(name), _) => match found.iter().find(|motion| motion.name == name) {
            Some(motion) => Ok(motion.clone()),
            None => Err(fault(format!("holds no motion of `{name}`; there are {}", names()))),
        },
    }
}

fn of_line(line: &Value) -> Result<Vec<CameraMotion>, String> {
    let name = ["view", "camera", "name"].iter().find_map(|key| line[*key].as_str()).unwrap_or("camera");
    if line["rotation_rad"].is_array() {
        return Ok(vec![rotation(line, name)?]);
    }
    if line.get("old_from_new").is_some_and(|pose| !pose.is_null()) {
        return Ok(vec![motion(line, name)?]);
    }
    let nested = line["moved"].as_array().filter(|list| list.iter().all(Value::is_object));
    let nested = nested.or(line["motions"].as_array()).into_iter().flatten();
    nested
        .map(|object| {
            motion(object, object["camera"].as_str().or(object["name"].as_str()).unwrap_or("camera"))
        })
        .collect()
}

/// A pose, or a rotation and translation vector.
fn motion(object: &Value, name: &str) -> Result<CameraMotion, String> {
    let pose = &object["old_from_new"];
    let old_from_new = match numbers::<6>(pose) {
        Some(vector) => Pose::exp(&Vector6::from(vector)),
        None => {
            let wxyz = numbers::<4>(&pose["rotation_wxyz"])
                .ok_or("old_from_new.rotation_wxyz must be four numbers")?;
            let translation = numbers::<3>(&pose["translation_m"])
                .ok_or("old_from_new.translation_m must be three numbers")?;
            let length = wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
            if !((length - 1.0).abs() < 1e-6) {
                return Err(format!(
                    "old_from_new.rotation_wxyz has length {length}; a rotation is a quaternion of length 1"
                ));
            }
            Pose::from_quaternion_wxyz(wxyz, translation.into())
        }
    };
    let mut covariance = Matrix6::zeros();
    for i in 0..6 {
        let row = numbers::<6>(&object["covariance"][i]).ok_or("covariance must be 6 rows of 6 numbers")?;
        covariance.set_row(i, &row.into());
    }
    let mut remarks = Vec::new();
    if object["verdict"] == "unmoved" {
        remarks.push(
            "the comparison found no motion; the zones are moved by less than its uncertainty".to_string(),
        );
    }
    checked(CameraMotion { name: name.to_string(), old_from_new, covariance, shift_px: None, remarks })
}

/// A rotation alone, by natural landmarks.
fn rotation(line: &Value, name: &str) -> Result<CameraMotion, String> {
    let vector = numbers::<3>(&line["rotation_rad"]).ok_or("rotation_rad must be three numbers")?;
    let mut covariance = Matrix6::zeros();
    for i in 0..3 {
        let row = numbers::<3>(&line["rotation_covariance_rad2"][i])
            .ok_or("rotation_covariance_rad2 must be 3 rows of 3 numbers")?;
        (0..3).for_each(|j| covariance[(i, j)] = row[j]);
    }
    if line["is_consistent"] == false {
        return Err("most landmarks contradict the rotation; it is none to move zones by".into());
    }
    let [x, y, z] = vector;
    let old_from_new = Pose::exp(&Vector6::new(x, y, z, 0.0, 0.0, 0.0));
    let shift_px = numbers::<2>(&line["shift_px"]).zip(numbers::<2>(&line["shift_sigma_px"]));
    let remarks =
        vec!["landmarks measure a rotation only: the camera is taken not to have shifted".to_string()];
    checked(CameraMotion { name: name.to_string(), old_from_new, covariance, shift_px, remarks })
}

fn checked(motion: CameraMotion) -> Result<CameraMotion, String> {
    let pose = motion.old_from_new;
    let is_finite = pose.rotation.iter().chain(pose.translation.iter()).all(|x| x.is_finite());
    match is_finite && is_covariance(&motion.covariance) {
        true => Ok(motion),
        false => {
            Err("its pose or covariance is none: numbers are missing, infinite, or variances negative".into())
        }
    }
}

fn numbers<const N: usize>(value: &Value) -> Option<[f64; N]> {
    let list = value.as_array().filter(|list| list.len() == N)?;
    let mut numbers = [0.0; N];
    for (number, value) in numbers.iter_mut().zip(list) {
        *number = value.as_f64()?;
    }
    Some(numbers)
}
