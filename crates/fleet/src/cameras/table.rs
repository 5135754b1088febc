//! A table of cameras, a row each: `camera, fx_px, fy_px, cx_px, cy_px`, and what else is known.

use super::{FleetCamera, Site};
use crate::FleetError;
use crate::words::of_other_unit;
use resight::FileError;
use resight::core::camera::{BrownConrady, CameraMatrix, ImageSize, Pinhole};
use resight::core::{Camera, Lens, Point};
use resight::input::table::{Table, TableRow, how_file_is_read};
use std::collections::HashMap;
use std::path::Path;

const MATRIX: [&str; 4] = ["fx_px", "fy_px", "cx_px", "cy_px"];
/// OpenCV's coefficients, in its order.
const DISTORTION: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];
/// Names of east and north, the first pair that there is.
const MAPS: [[&str; 2]; 2] = [["longitude_deg", "latitude_deg"], ["east_m", "north_m"]];

struct Columns {
    camera: usize,
    matrix: [usize; 4],
    distortion: [Option<usize>; 5],
    size: [Option<usize>; 2],
    points: Vec<[usize; 3]>,
    site: Option<usize>,
    map: Option<[usize; 2]>,
}

/// The cameras, what is wrong with the rows that are none, and remarks.
pub(super) type Read = (Vec<FleetCamera>, Vec<FileError>, Vec<String>);

pub(super) fn read(path: &Path) -> Result<Read, FleetError> {
    let table = Table::open(path, "camera,fx_px,fy_px,cx_px,cy_px")?;
    let columns = columns(&table)?;
    let (mut cameras, mut rejected) = (Vec::new(), Vec::new());
    let mut lines: HashMap<String, u64> = HashMap::new();
    let other = ["x0_mm", "x0_cm"].into_iter().filter(|name| table.find(name).is_some());
    let remarks = other.filter_map(of_other_unit).chain(how_file_is_read(path)).collect();
    table.each_or_torn(|row| {
        match row.and_then(|row| camera(&columns, &row, &mut lines)) {
            Ok(camera) => cameras.push(camera),
            Err(reason) => rejected.push(reason),
        }
        Ok::<(), FleetError>(())
    })?;
    match rejected.first() {
        Some(_) if cameras.is_empty() => Err(rejected.swap_remove(0).into()),
        _ => Ok((cameras, rejected, remarks)),
    }
}

fn columns(table: &Table) -> Result<Columns, FleetError> {
    let mut points = Vec::new();
    while let Some(x) = table.find(&format!("x{}_m", points.len())) {
        let n = points.len();
        points.push([x, table.need(&format!("y{n}_m"), None)?, table.need(&format!("z{n}_m"), None)?]);
    }
    let map = MAPS.iter().find_map(|[east, north]| Some([table.find(east)?, table.find(north)?]));
    let need = |name: &str| table.need(name, None);
    Ok(Columns {
        camera: need("camera")?,
        matrix: [need(MATRIX[0])?, need(MATRIX[1])?, need(MATRIX[2])?, need(MATRIX[3])?],
        distortion: DISTORTION.map(|name| table.find(name)),
        size: ["width_px", "height_px"].map(|name| table.find(name)),
        points,
        site: table.find("site"),
        map,
    })
}

/// `lines` are those of the names so far.
fn camera(
    columns: &Columns,
    row: &TableRow<'_>,
    lines: &mut HashMap<String, u64>,
) -> Result<FleetCamera, FileError> {
    let name = row
        .text(columns.camera)
        .ok_or_else(|| row.complaint(columns.camera, "is empty; a name is needed"))?;
    let [fx_px, fy_px, cx_px, cy_px] = numbers(row, &columns.matrix)?;
    let matrix = CameraMatrix { fx_px, fy_px, cx_px, cy_px };
    let [k1, k2, p1, p2, k3] = columns.distortion.map(|column| row.optional_number(column));
    let coefficients = [k1?, k2?, p1?, p2?, k3?].map(|k| k.unwrap_or(0.0));
    let lens = match coefficients.iter().all(|k| *k == 0.0) {
        true => Pinhole::new(matrix).map(Lens::from),
        false => BrownConrady::new(matrix, &coefficients).map(Lens::from),
    };
    let lens = lens.map_err(|reason| row.complaint_of(&reason.to_string()))?;
    let camera = FleetCamera {
        name: name.to_string(),
        camera: Camera { lens, size: size(columns, row)? },
        points: points(columns, row)?,
        site: site(columns, row)?,
    };
    if let Some(line) = lines.get(name) {
        let what = format!(
            "is `{name}` as in line {line}, whose camera is used; give each camera a name of its own"
        );
        return Err(row.complaint(columns.camera, &what));
    }
    lines.insert(camera.name.clone(), row.line);
    Ok(camera)
}

fn numbers<const N: usize>(row: &TableRow<'_>, columns: &[usize; N]) -> Result<[f64; N], FileError> {
    let mut numbers = [0.0; N];
    for (number, column) in numbers.iter_mut().zip(columns) {
        *number = row.number(*column)?;
        if !number.is_finite() {
            return Err(row.complaint(*column, &format!("is {number}; a finite number is needed")));
        }
    }
    Ok(numbers)
}

/// None where both cells are empty.
fn size(columns: &Columns, row: &TableRow<'_>) -> Result<Option<ImageSize>, FileError> {
    let [Some(width), Some(height)] = columns.size else { return Ok(None) };
    let side = |column: usize| -> Result<Option<u32>, FileError> {
        let Some(side) = row.optional_number(Some(column))? else { return Ok(None) };
        if side.fract() != 0.0 || !(1.0..=1e6).contains(&side) {
            let what = format!("is {side}; a whole number of pixels from 1 to 1000000 is needed");
            return Err(row.complaint(column, &what));
        }
        Ok(Some(side as u32))
    };
    Ok(side(width)?.zip(side(height)?).map(|(width_px, height_px)| ImageSize { width_px, height_px }))
}

/// None where every cell is empty.
fn points(columns: &Columns, row: &TableRow<'_>) -> Result<Option<Vec<Point>>, FileError> {
    let is_filled = |column: &[usize; 3]| column.iter().any(|i| row.text(*i).is_some());
    let filled: Vec<&[usize; 3]> = columns.points.iter().take_while(|column| is_filled(column)).collect();
    if filled.is_empty() {
        return Ok(None);
    }
    if filled.len() < 3 {
        let what = format!("has {} points; 3 or more are needed", filled.len());
        return Err(row.complaint(columns.camera, &what));
    }
    filled.into_iter().map(|column| numbers(row, column).map(Point::from)).collect::<Result<_, _>>().map(Some)
}

fn site(columns: &Columns, row: &TableRow<'_>) -> Result<Option<Site>, FileError> {
    let name = columns.site.and_then(|i| row.text(i));
    let east_north = match columns.map.filter(|map| map.iter().all(|i| row.text(*i).is_some())) {
        Some(map) => Some(numbers(row, &map)?),
        None => None,
    };
    let is_known = name.is_some() || east_north.is_some();
    Ok(is_known.then(|| Site { name: name.unwrap_or_default().to_string(), east_north }))
}
