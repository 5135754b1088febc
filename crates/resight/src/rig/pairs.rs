//! Reads relative poses of pairs of cameras: our own CSV, and Caliscope's stereograph JSON.
//!
//! ```text
//! a,b,qw,qx,qy,qz,x_m,y_m,z_m,sigma_deg,sigma_mm     x_in_b = b_from_a · x_in_a; or a column rmse instead of the sigmas, or neither
//! cam1,cam2,0.98,0.01,-0.19,0.03,-0.41,0.02,0.11,0.05,0.8
//! ```
//! Caliscope (BSD-2-Clause) writes `{"stereo_A_B": {"rotation": 3×3, "translation": 3 or 3×1, "RMSE": …}}` with x_in_B = R x_in_A + t, in
//! the unit of its board, metres.

use super::names::natural;
use crate::FileError;
use crate::core::multiview::pose_graph::{PairNoise, RelativePose};
use crate::core::{Matrix6, Pose};
use crate::input::table::{Table, TableRow};
use nalgebra::{Matrix3, Vector3, Vector6};
use serde::Deserialize;
use std::path::Path;

/// Pairs of cameras from a file.
#[derive(Debug, Clone, PartialEq)]
pub struct PairFile {
    /// The cameras' names in natural order; the pairs' indices refer to it.
    pub cameras: Vec<String>,
    /// The pairs, in the order of the file.
    pub pairs: Vec<RelativePose>,
}

/// A pair with names.
struct Row {
    a: String,
    b: String,
    b_from_a: Pose,
    noise: PairNoise,
}

/// Largest deviation of a quaternion from unit length: six digits leave 1e-6, a typing error far more.
const MAX_LENGTH_DEFECT: f64 = 1e-3;
/// Largest entry of RᵀR − 1 of a rotation matrix.
const MAX_ROTATION_DEFECT: f64 = 1e-5;

/// Reads pairs, recognising the format by its first character.
///
/// # Errors
/// With line or key: missing columns, a quaternion whose order is not stated or that is not unit, invalid numbers.
pub fn read_pairs(path: impl AsRef<Path>) -> Result<PairFile, FileError> {
    let path = path.as_ref();
    let bytes = crate::input::read(path, crate::input::Kind::Literal)?;
    pairs_from_bytes(path, &bytes)
}

/// Reads as `read_pairs`, from bytes in memory; `path` is used in messages only.
///
/// # Errors
/// The errors of `read_pairs`.
pub fn pairs_from_bytes(path: impl AsRef<Path>, bytes: &[u8]) -> Result<PairFile, FileError> {
    let path = path.as_ref();
    let text = std::str::from_utf8(bytes).map_err(|_| FileError::new(path, "not UTF-8 text"))?;
    let text = text.trim_start_matches('\u{feff}');
    let rows = if text.trim_start().starts_with('{') { stereograph(path, text)? } else { table(path, text)? };
    if rows.is_empty() {
        return Err(FileError::new(path, "no pair in it"));
    }
    let mut cameras: Vec<String> = rows.iter().flat_map(|row| [row.a.clone(), row.b.clone()]).collect();
    cameras.sort_by(|a, b| natural(a, b));
    cameras.dedup();
    let place = |name: &str| cameras.iter().position(|camera| camera == name).unwrap_or_default();
    let pair = |row: &Row| RelativePose {
        a: place(&row.a),
        b: place(&row.b),
        b_from_a: row.b_from_a,
        noise: row.noise,
    };
    let pairs = rows.iter().map(pair).collect();
    Ok(PairFile { cameras, pairs })
}

/// Columns of our own file.
struct Columns {
    names: [usize; 2],
    pose: [usize; 7],
    sigmas: Option<[usize; 2]>,
    rmse: Option<usize>,
}

fn table(path: &Path, text: &str) -> Result<Vec<Row>, FileError> {
    let table = Table::of_bytes(path, text.as_bytes(), "a,b,qw,qx,qy,qz,x_m,y_m,z_m")?;
    let columns = Columns::of(&table)?;
    let mut rows = Vec::new();
    table.each(|row| {
        rows.push(columns.row(&row)?);
        Ok::<(), FileError>(())
    })?;
    Ok(rows)
}

/// The names of the numbers of a pose, in this library's order.
const POSE: [&str; 7] = ["qw", "qx", "qy", "qz", "x_m", "y_m", "z_m"];

impl Columns {
    fn of(table: &Table) -> Result<Self, FileError> {
        let need = |name: &str| {
            let order = "which number of the quaternion is the scalar must be stated by name";
            table.need(name, name.starts_with('q').then_some(order))
        };
        let mut pose = [0; 7];
        for (place, name) in pose.iter_mut().zip(POSE) {
            *place = need(name)?;
        }
        let sigmas = match (table.find("sigma_deg"), table.find("sigma_mm")) {
            (Some(turn), Some(shift)) => Some([turn, shift]),
            (None, None) => None,
            _ => return Err(table.complaint("sigma_deg and sigma_mm belong together; one is missing")),
        };
        let rmse = table.find("rmse");
        if sigmas.is_some() && rmse.is_some() {
            return Err(table.complaint("both sigmas and rmse; keep the sigmas, or the rmse"));
        }
        Ok(Columns { names: [need("a")?, need("b")?], pose, sigmas, rmse })
    }

    fn row(&self, row: &TableRow<'_>) -> Result<Row, FileError> {
        let number = |column: usize| match row.number(column)? {
            x if x.is_finite() => Ok(x),
            x => Err(row.complaint(column, &format!("is {x}, which is not a finite number"))),
        };
        let positive = |column: usize| match number(column)? {
            x if 0.0 < x => Ok(x),
            x => Err(row.complaint(column, &format!("is {x}; it must be positive"))),
        };
        let name = |column: usize| {
            let empty = || row.complaint(column, "is empty; a camera's name is needed");
            row.text(column).map(str::to_owned).ok_or_else(empty)
        };
        let mut v = [0.0; 7];
        for (x, column) in v.iter_mut().zip(self.pose) {
            *x = number(column)?;
        }
        let b_from_a = pose_from_numbers(&v).map_err(|reason| row.complaint_of(&reason))?;
        let noise = match (self.sigmas, self.rmse) {
            (Some([turn, shift]), _) => {
                PairNoise::Covariance(isotropic(positive(turn)?.to_radians(), 1e-3 * positive(shift)?))
            }
            (None, Some(rmse)) => PairNoise::Error(positive(rmse)?),
            (None, None) => PairNoise::Error(1.0),
        };
        Ok(Row { a: name(self.names[0])?, b: name(self.names[1])?, b_from_a, noise })
    }
}

/// Converts `[qw, qx, qy, qz, x_m, y_m, z_m]` to a pose.
///
/// # Errors
/// A sentence, for a quaternion that is not unit to three digits.
pub fn pose_from_numbers(v: &[f64; 7]) -> Result<Pose, String> {
    let [w, x, y, z, ..] = *v;
    let length = (w * w + x * x + y * y + z * z).sqrt();
    if !((length - 1.0).abs() < MAX_LENGTH_DEFECT) {
        return Err(format!("the quaternion has length {length:.6}; it must be 1"));
    }
    Ok(Pose::from_quaternion_wxyz([w, x, y, z], Vector3::new(v[4], v[5], v[6])))
}

/// Returns the covariance with one standard deviation for all rotations and one for all shifts.
pub fn isotropic(sigma_rad: f64, sigma_m: f64) -> Matrix6 {
    let (r, t) = (sigma_rad * sigma_rad, sigma_m * sigma_m);
    Matrix6::from_diagonal(&Vector6::new(r, r, r, t, t, t))
}

/// A pair as Caliscope writes it.
#[derive(Deserialize)]
struct StereoPair {
    rotation: [[f64; 3]; 3],
    translation: Translation,
    #[serde(rename = "RMSE")]
    rmse: Option<f64>,
}

/// A translation, written as a list or as a column.
#[derive(Deserialize)]
#[serde(untagged)]
enum Translation {
    List([f64; 3]),
    Column([[f64; 1]; 3]),
}

fn stereograph(path: &Path, text: &str) -> Result<Vec<Row>, FileError> {
    let known: serde_json::Map<String, serde_json::Value> = serde_json::from_str(text)
        .map_err(|e| FileError { path: path.to_path_buf(), line: Some(e.line()), reason: e.to_string() })?;
    let rows = known.into_iter().map(|(key, value)| {
        stereo_pair(&key, value).map_err(|reason| FileError::new(path, format!("`{key}`: {reason}")))
    });
    rows.collect()
}

fn stereo_pair(key: &str, value: serde_json::Value) -> Result<Row, String> {
    let (a, b) = names(key).ok_or("a pair of cameras is called stereo_A_B")?;
    let pair: StereoPair = serde_json::from_value(value).map_err(|e| e.to_string())?;
    let r = Matrix3::from_fn(|i, j| pair.rotation[i][j]);
    let defect = (r.transpose() * r - Matrix3::identity()).amax();
    if !(defect < MAX_ROTATION_DEFECT && 0.0 < r.determinant()) {
        return Err(format!("`rotation` is no rotation matrix (RᵀR − 1 up to {defect:.1e})"));
    }
    let t = match pair.translation {
        Translation::List(t) => t,
        Translation::Column(t) => t.map(|[x]| x),
    };
    let rmse = pair.rmse.unwrap_or(1.0);
    if !(0.0 < rmse && rmse.is_finite()) {
        return Err(format!("`RMSE` is {rmse}; it must be positive"));
    }
    Ok(Row { a, b, b_from_a: Pose::new(r, Vector3::from(t)), noise: PairNoise::Error(rmse) })
}

/// Splits `stereo_1_10`; names with underscores are split into halves with equal numbers of words.
fn names(key: &str) -> Option<(String, String)> {
    let words: Vec<&str> = key.strip_prefix("stereo_")?.split('_').collect();
    let (a, b) = words.split_at_checked(words.len() / 2).filter(|_| words.len().is_multiple_of(2))?;
    Some((a.join("_"), b.join("_")))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<PairFile, String> {
        pairs_from_bytes(Path::new("pairs.csv"), text.as_bytes()).map_err(|e| e.to_string())
    }

    #[test]
    fn columns_go_by_name() {
        let text = "z_m,b,a,qz,qy,qx,qw,x_m,y_m,sigma_mm,sigma_deg\n3,cam2,cam10,0,0,0,1,1,2,0.5,0.1\n";
        let file = read(text).unwrap();
        assert_eq!(file.cameras, ["cam2", "cam10"]);
        let pair = &file.pairs[0];
        assert_eq!((pair.a, pair.b), (1, 0));
        assert_eq!(pair.b_from_a.translation, Vector3::new(1.0, 2.0, 3.0));
        assert_eq!(pair.noise, PairNoise::Covariance(isotropic(0.1f64.to_radians(), 5e-4)));
    }

    #[test]
    fn what_is_wrong_is_said_with_its_line() {
        let head = "a,b,qw,qx,qy,qz,x_m,y_m,z_m";
        for (text, said) in [
            ("a,b,q0,q1,q2,q3,x_m,y_m,z_m\n".to_string(), "by name"),
            (format!("{head}\n"), "no rows"),
            (format!("{}\n1;2;1,5;0;0;0;1;2;3\n", head.replace(',', ";")), "length 1.500000"),
            (head.replace("x_m,y_m,z_m", "x_mm,y_mm,z_mm") + "\n1,2,1,0,0,0,1,2,3\n", "divide by 1000"),
            (format!("{head}\n1,2,1,0,0,0,1,2,nan\n"), "pairs.csv:2: column `z_m`"),
            (format!("{head}\n1,2,1,1,0,0,1,2,3\n"), "length 1.414"),
            (format!("{head}\n1,,1,0,0,0,1,2,3\n"), "column `b` is empty"),
            (format!("{head}\n1,2,1,0,0\n"), "5 cells where the header has 9"),
            (format!("{head},sigma_deg\n"), "belong together"),
            (format!("{head},rmse\n1,2,1,0,0,0,1,2,3,0\n"), "`rmse` is 0"),
            ("{\"stereo_1_2_3\": {}}".to_string(), "stereo_A_B"),
            (
                "{\"stereo_1_2\": {\"rotation\": [[2,0,0],[0,1,0],[0,0,1]], \"translation\": [0,0,0]}}"
                    .to_string(),
                "no rotation",
            ),
        ] {
            let error = read(&text).unwrap_err();
            assert!(error.contains(said), "{said}: {error}");
        }
    }

    #[test]
    fn stereo_pairs_are_read_with_their_error() {
        let text = "{\"stereo_cam_1_cam_2\": {\"rotation\": [[1,0,0],[0,1,0],[0,0,1]], \"translation\": [[1],[2],[3]], \"RMSE\": 0.5}}";
        let file = read(text).unwrap();
        assert_eq!(file.cameras, ["cam_1", "cam_2"]);
        assert_eq!(file.pairs[0].noise, PairNoise::Error(0.5));
        assert_eq!(file.pairs[0].b_from_a.translation.z, 3.0);
    }
}
