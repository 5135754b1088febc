//! Reads image points from a CSV file: `photo, point, u_px, v_px` and optionally `sigma_px`, columns by name in any order.

use crate::FileError;
use crate::input::table::Table;
use std::path::Path;

/// One row.
#[derive(Debug, Clone, PartialEq)]
pub struct ImagePoint {
    /// Name of the photograph.
    pub photo: String,
    /// Name of the point.
    pub point: String,
    /// Column.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard deviation of each, where the cell is filled.
    pub sigma_px: Option<f64>,
}

/// Largest number of rows in one file: image points are marked by people, not by programs.
const MAX_ROWS: usize = 20_000;

/// Reads a file of image points.
///
/// # Errors
/// Unreadable files, missing columns, cells that are not numbers, each with its line.
pub fn read_image_points(path: impl AsRef<Path>) -> Result<Vec<ImagePoint>, FileError> {
    let path = path.as_ref();
    let table = Table::open(path, "photo,point,u_px,v_px")?;
    let need = |name: &str| table.need(name, None);
    let (photo, point, u, v) = (need("photo")?, need("point")?, need("u_px")?, need("v_px")?);
    let sigma = table.find("sigma_px");
    let mut image_points = Vec::new();
    table.each(|row| {
        let (Some(photo), Some(point)) = (row.text(photo), row.text(point)) else {
            return Err(row.complaint_of("photo and point must have names"));
        };
        let finite = |column: usize| match row.number(column)? {
            x if x.is_finite() => Ok(x),
            x => Err(row.complaint(column, &format!("is {x}; it must be a finite number"))),
        };
        if MAX_ROWS <= image_points.len() {
            return Err(FileError::new(path, format!("more than {MAX_ROWS} rows; that is the limit")));
        }
        let sigma_px = sigma.filter(|column| row.text(*column).is_some()).map(finite).transpose()?;
        let (photo, point) = (photo.to_string(), point.to_string());
        image_points.push(ImagePoint { photo, point, u_px: finite(u)?, v_px: finite(v)?, sigma_px });
        Ok(())
    })?;
    Ok(image_points)
}
