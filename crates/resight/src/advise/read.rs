//! Reads points and poses for the advice from files.

use crate::core::target::KnownPoint;
use crate::core::{Point, Pose};
use crate::input::table::{Table, TableRow};
use crate::{Error, FileError};
use std::path::Path;

/// A point of a CSV file.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPoint {
    /// The column `id`, or the number of the row.
    pub name: String,
    /// Its position and the uncertainty of that.
    pub known: KnownPoint,
    /// The columns `u_px` and `v_px`, where both have a value.
    pub pixel: Option<[f64; 2]>,
}

/// Largest number of rows; no survey has more.
const MOST: usize = 100_000;

/// The positions of the columns.
struct Columns {
    space: [usize; 3],
    id: Option<usize>,
    sigma: Option<usize>,
    image: Option<(usize, usize)>,
}

/// Reads the points of a CSV file: columns x_m, y_m, z_m; optionally id, sigma_m, u_px and v_px.
///
/// # Errors
/// What is wrong with the file, and in which line.
pub fn read_points(path: impl AsRef<Path>) -> Result<Vec<MeasuredPoint>, Error> {
    let path = path.as_ref();
    let table = Table::open(path, "x_m,y_m,z_m")?;
    let columns = Columns::of(&table)?;
    let mut found = Vec::new();
    table.each(|row| {
        if MOST <= found.len() {
            return Err(FileError::new(path, format!("more than {MOST} rows")));
        }
        found.push(columns.point(&row, found.len() + 1)?);
        Ok(())
    })?;
    Ok(found)
}

impl Columns {
    fn of(table: &Table) -> Result<Self, FileError> {
        let space = [table.need("x_m", None)?, table.need("y_m", None)?, table.need("z_m", None)?];
        let (id, sigma) = (table.find("id"), table.find("sigma_m"));
        Ok(Columns { space, id, sigma, image: table.find("u_px").zip(table.find("v_px")) })
    }

    fn point(&self, row: &TableRow<'_>, n: usize) -> Result<MeasuredPoint, FileError> {
        let number = |column: usize| match row.number(column)? {
            x if x.is_finite() => Ok(x),
            x => Err(row.complaint(column, &format!("is {x}; a finite number is needed"))),
        };
        let is_filled = |column: &usize| row.text(*column).is_some();
        let sigma_m = self.sigma.filter(is_filled).map(number).transpose()?.unwrap_or(0.0);
        if sigma_m < 0.0 {
            return Err(row.complaint_of(&format!("sigma_m is {sigma_m}; it must be 0 or more")));
        }
        let [x, y, z] = self.space;
        let position = Point::new(number(x)?, number(y)?, number(z)?);
        let pixel = match self.image.filter(|(u, v)| is_filled(u) && is_filled(v)) {
            Some((u, v)) => Some([number(u)?, number(v)?]),
            None => None,
        };
        let name = self.id.and_then(|column| row.text(column));
        let name = name.map_or_else(|| n.to_string(), str::to_string);
        Ok(MeasuredPoint { name, known: KnownPoint { position, sigma_m }, pixel })
    }
}

/// Reads the poses under `key` (or its other names) of a file of JSON objects, one per line; a single object may span several lines.
///
/// # Errors
/// What is wrong with the file, and in which object.
pub fn read_poses(path: impl AsRef<Path>, keys: &[&str]) -> Result<Vec<Pose>, Error> {
    let path = path.as_ref();
    let text = crate::input::read_text(path, crate::input::Kind::Results)?;
    let mut found = Vec::new();
    for (n, object) in serde_json::Deserializer::from_str(&text).into_iter::<serde_json::Value>().enumerate()
    {
        let wrong = |reason: String| FileError::new(path, format!("object {}: {reason}", n + 1));
        let object = object.map_err(|reason| wrong(reason.to_string()))?;
        let pose = keys.iter().find_map(|key| object.get(key)).filter(|v| !v.is_null());
        let Some(pose) = pose else { continue };
        found.push(pose_of(pose).map_err(|reason| wrong(format!("`{}`: {reason}", keys[0])))?);
    }
    if found.is_empty() {
        return Err(FileError::new(path, format!("no object with `{}`", keys[0])).into());
    }
    Ok(found)
}

fn pose_of(value: &serde_json::Value) -> Result<Pose, String> {
    fn list<const N: usize>(value: &serde_json::Value, key: &str) -> Result<[f64; N], String> {
        let numbers: Option<Vec<f64>> =
            value.get(key).and_then(|v| v.as_array()).and_then(|v| v.iter().map(|x| x.as_f64()).collect());
        let all = numbers.and_then(|v| <[f64; N]>::try_from(v).ok());
        all.ok_or_else(|| format!("{N} numbers `{key}` are needed"))
    }
    let (wxyz, translation) = (list::<4>(value, "rotation_wxyz")?, list::<3>(value, "translation_m")?);
    let length: f64 = wxyz.iter().map(|x| x * x).sum::<f64>().sqrt();
    if !((length - 1.0).abs() < 1e-3) {
        return Err(format!("rotation_wxyz has length {length:.4}; a unit quaternion w,x,y,z is needed"));
    }
    Ok(Pose::from_quaternion_wxyz(wxyz, translation.into()))
}
