//! Image points from a CSV file: `photo, point, u_px, v_px` and optionally `sigma_px`, columns by name in any order.
//!
//! Cells may be quoted as spreadsheets do; lines that begin with # are remarks. Every complaint has its line.

use crate::FileError;
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

/// Rows accepted in one file: a person image points, no program does.
const MAX_ROWS: usize = 20_000;
const NEEDED: [&str; 4] = ["photo", "point", "u_px", "v_px"];

/// Reads a file of image points.
///
/// # Errors
/// Unreadable files, missing columns, cells that are no numbers, each with its line.
pub fn read_image_points(path: &Path) -> Result<Vec<ImagePoint>, FileError> {
    let text = crate::input::read_text(path, crate::input::Kind::Literal)?;
    let text = text.strip_prefix('\u{feff}').unwrap_or(&text);
    let is_row = |(_, line): &(usize, &str)| !line.trim().is_empty() && !line.trim_start().starts_with('#');
    let mut lines = text.lines().enumerate().map(|(i, line)| (i + 1, line)).filter(is_row);
    let (number, header) = lines
        .next()
        .ok_or_else(|| FileError::new(path, "is empty; a header line photo,point,u_px,v_px is needed"))?;
    let header = cells(header);
    let column = |name: &str| header.iter().position(|cell| cell == name);
    let missing: Vec<&str> = NEEDED.into_iter().filter(|name| column(name).is_none()).collect();
    if !missing.is_empty() {
        let reason = format!("no column {}; the header has {}", missing.join(", "), header.join(", "));
        return Err(FileError::at_line(path, number, reason));
    }
    let sigma = column("sigma_px");
    let at = NEEDED.map(|name| column(name).unwrap_or_default());
    let row = |(line, text): (usize, &str)| {
        let cells = cells(text);
        let cell = |column: usize| cells.get(column).map_or("", String::as_str);
        let number = |column: usize| match cell(column).parse::<f64>() {
            Ok(x) if x.is_finite() => Ok(x),
            _ => {
                let reason = format!("`{}` in column {} is no number", cell(column), header[column]);
                Err(FileError::at_line(path, line, reason))
            }
        };
        let sigma_px = sigma.filter(|column| !cell(*column).is_empty()).map(number).transpose()?;
        let (photo, point) = (cell(at[0]).to_string(), cell(at[1]).to_string());
        if photo.is_empty() || point.is_empty() {
            return Err(FileError::at_line(path, line, "photo and point must have names"));
        }
        Ok(ImagePoint { photo, point, u_px: number(at[2])?, v_px: number(at[3])?, sigma_px })
    };
    let image_points = lines.map(row).collect::<Result<Vec<_>, _>>()?;
    if MAX_ROWS < image_points.len() {
        return Err(FileError::new(
            path,
            format!("holds {} rows; the limit is {MAX_ROWS}", image_points.len()),
        ));
    }
    Ok(image_points)
}

/// Cells of a line, trimmed; commas inside quotes do not part.
fn cells(line: &str) -> Vec<String> {
    let (mut cells, mut cell, mut quoted) = (Vec::new(), String::new(), false);
    for letter in line.chars() {
        match letter {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(std::mem::take(&mut cell)),
            other => cell.push(other),
        }
    }
    cells.push(cell);
    cells.iter().map(|cell| cell.trim().to_string()).collect()
}
