//! The file of a reference: the pose with which a camera is compared, and the noise of its readings.

use resight::FileError;
use resight_core::temporal::monitor::{DriftNoise, Reference};
use resight_core::{Matrix6, Pose};
use serde::{Deserialize, Serialize};
use std::path::Path;

type Rows = [[f64; 6]; 6];

/// The file as TOML. Covariances are of the small left motion `[rotation_rad; translation_m]` in the camera frame.
#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    bias_time_s: f64,
    reference_covariance: Rows,
    reading_covariance: Rows,
    bias_covariance: Rows,
    #[serde(alias = "daily_covariance")]
    diurnal_covariance: Rows,
    cam_from_target: Transform,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Transform {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

/// Returns the reference as text; numbers keep every digit.
///
/// # Errors
/// A number that TOML cannot hold.
pub fn to_text(reference: &Reference) -> Result<String, String> {
    let noise = &reference.noise;
    let file = File {
        bias_time_s: noise.bias_time_s,
        reference_covariance: rows(&noise.reference),
        reading_covariance: rows(&noise.reading),
        bias_covariance: rows(&noise.bias),
        diurnal_covariance: rows(&noise.diurnal),
        cam_from_target: Transform {
            rotation_wxyz: reference.a_from_b.quaternion_wxyz(),
            translation_m: reference.a_from_b.translation.into(),
        },
    };
    toml::to_string(&file).map_err(|e| e.to_string())
}

/// Reads what `to_text` wrote.
///
/// # Errors
/// A missing file or key, an invalid quaternion, a covariance that is not symmetric, or invalid noise.
pub fn read(path: impl AsRef<Path>) -> Result<Reference, FileError> {
    let path = path.as_ref();
    let reported = |reason: String| FileError::new(path, reason);
    let text = resight::input::read_text(path, resight::input::Kind::Text)
        .map_err(|fault| reported(format!("cannot be read: {}", fault.reason)))?;
    let file: File = toml::from_str(&text).map_err(|e| reported(format!("is no reference: {e}")))?;
    let wxyz = file.cam_from_target.rotation_wxyz;
    let norm = wxyz.iter().map(|q| q * q).sum::<f64>().sqrt();
    if !((norm - 1.0).abs() < 1e-6) {
        return Err(reported(format!("rotation_wxyz has the length {norm}; a rotation's is 1")));
    }
    let noise = DriftNoise {
        reference: matrix(&file.reference_covariance).map_err(reported)?,
        reading: matrix(&file.reading_covariance).map_err(reported)?,
        bias: matrix(&file.bias_covariance).map_err(reported)?,
        bias_time_s: file.bias_time_s,
        diurnal: matrix(&file.diurnal_covariance).map_err(reported)?,
    };
    let a_from_b = Pose::from_quaternion_wxyz(wxyz, file.cam_from_target.translation_m.into());
    let reference = Reference { a_from_b, noise };
    reference.check().map_err(|e| reported(e.to_string()))?;
    Ok(reference)
}

fn rows(matrix: &Matrix6) -> Rows {
    std::array::from_fn(|i| std::array::from_fn(|j| matrix[(i, j)]))
}

fn matrix(rows: &Rows) -> Result<Matrix6, String> {
    let matrix = Matrix6::from_fn(|i, j| rows[i][j]);
    let largest = matrix.abs().max();
    if !matrix.iter().all(|x| x.is_finite()) || 1e-9 * largest < (matrix - matrix.transpose()).abs().max() {
        return Err("a covariance is not symmetric or holds no numbers".to_string());
    }
    Ok(matrix)
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector6;

    #[test]
    fn own_file_round_trips() {
        let spread = |s: f64| Matrix6::from_diagonal(&Vector6::new(s, s, s, 0.3 * s, s, s)) / 3.0;
        let noise = DriftNoise {
            reference: spread(1e-7),
            reading: spread(1e-6),
            bias: Matrix6::zeros(),
            bias_time_s: 60.0,
            diurnal: spread(1e-9),
        };
        let a_from_b = Pose::exp(&Vector6::new(0.1, 0.2, -0.3, 1.0, 2.0, 3.0));
        let path = std::env::temp_dir().join(format!("reference-{}.toml", std::process::id()));
        std::fs::write(&path, to_text(&Reference { a_from_b, noise }).expect("text")).expect("written");
        let read = read(&path).expect("read");
        std::fs::remove_file(&path).expect("removed");
        assert_eq!(read.noise, noise);
        assert!(read.a_from_b.angle_to_rad(&a_from_b) < 1e-15);
        assert_eq!(read.a_from_b.translation, a_from_b.translation);
    }

    /// Reads a reference written by version 1.
    #[test]
    fn keys_of_version_1_are_read() {
        let noise = DriftNoise {
            reference: Matrix6::identity(),
            reading: Matrix6::identity(),
            bias: Matrix6::zeros(),
            bias_time_s: 60.0,
            diurnal: Matrix6::identity() * 0.25,
        };
        let text = to_text(&Reference { a_from_b: Pose::identity(), noise }).expect("text");
        let earlier = text.replace("diurnal_covariance", "daily_covariance");
        assert_ne!(text, earlier);
        let path = std::env::temp_dir().join(format!("earlier-reference-{}.toml", std::process::id()));
        std::fs::write(&path, earlier).expect("written");
        assert_eq!(read(&path).expect("read").noise, noise);
        std::fs::remove_file(&path).expect("removed");
    }

    #[test]
    fn noise_that_is_none_is_named() {
        let noise = DriftNoise {
            reference: Matrix6::identity(),
            reading: Matrix6::identity(),
            bias: Matrix6::identity(),
            bias_time_s: 0.0,
            diurnal: Matrix6::identity(),
        };
        let text = |noise| to_text(&Reference { a_from_b: Pose::identity(), noise }).expect("text");
        let path = std::env::temp_dir().join(format!("no-reference-{}.toml", std::process::id()));
        let negative = DriftNoise { diurnal: -noise.diurnal, bias_time_s: 1.0, ..noise };
        for (noise, named) in [(noise, "bias_time_s"), (negative, "variance in a reference")] {
            std::fs::write(&path, text(noise)).expect("written");
            let error = read(&path).expect_err("no noise").to_string();
            assert!(error.contains(named), "{error}");
        }
        std::fs::remove_file(&path).expect("removed");
    }
}
