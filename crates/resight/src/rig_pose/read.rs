//! Reads the table of points: the columns of `solve`, and the camera of each.

use super::KnownCamera;
use crate::core::Point;
use crate::error::Error;
use crate::input::not_among;
use crate::input::table::{Table, TableRow, how_read};
use std::collections::HashMap;
use std::path::Path;

/// One point in one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct RigPoint {
    /// Line in the file, counted from 1.
    pub line: u64,
    /// Index of the camera in the rig.
    pub camera: usize,
    /// Column `id`, or the row's number within its view.
    pub name: String,
    /// Columns `x_m, y_m, z_m`.
    pub x_in_target: [f64; 3],
    /// Columns `u_px, v_px`.
    pub image: [f64; 2],
    /// Column `sigma_px`, where the cell is filled.
    pub sigma_px: Option<f64>,
    /// Column `sigma_m`, where the cell is filled.
    pub sigma_m: Option<f64>,
}

/// The rows of one view: the points that all cameras see at one time.
#[derive(Debug, Clone, PartialEq)]
pub struct RigPointsView {
    /// Column `view`, or the file's name.
    pub name: String,
    /// In file order.
    pub rows: Vec<RigPoint>,
    /// The remark on a table whose cells are not separated by commas.
    pub how_read: Option<String>,
}

/// Reads the views of a table in the order of first appearance; rows of a view need not be adjacent.
///
/// # Errors
/// What is wrong with the file, and in which line; a camera that the rig does not have.
pub fn read_rig_points(path: impl AsRef<Path>, rig: &[KnownCamera]) -> Result<Vec<RigPointsView>, Error> {
    let path = path.as_ref();
    let table = Table::open(path, "camera,x_m,y_m,z_m,u_px,v_px")?;
    let need = |name: &str| table.need(name, None);
    let camera = table
        .need("camera", Some("rig-pose needs the camera that sees each point; for one camera use `solve`"))?;
    let numbers = [need("x_m")?, need("y_m")?, need("z_m")?, need("u_px")?, need("v_px")?];
    let (view, id) = (table.find("view"), table.find("id"));
    let (sigma_px, sigma_m) = (table.find("sigma_px"), table.find("sigma_m"));
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let names: Vec<String> = rig.iter().map(|camera| camera.named.name.clone()).collect();
    let how_read = how_read(path);
    let mut views: Vec<RigPointsView> = Vec::new();
    let mut index = HashMap::new();
    table.each(|cells: TableRow<'_>| {
        let name = view.map_or(file_name.as_str(), |i| cells.text(i).unwrap_or_default());
        let at = *index.entry(name.to_string()).or_insert_with(|| {
            views.push(RigPointsView {
                name: name.to_string(),
                rows: Vec::new(),
                how_read: how_read.clone(),
            });
            views.len() - 1
        });
        let called = cells.text(camera).unwrap_or_default();
        let Some(camera) = names.iter().position(|name| name == called) else {
            let (file, line) = (path.display(), cells.line);
            return Err(Error::request(format!(
                "{file}, line {line}: {}",
                not_among(called, "camera", &names)
            )));
        };
        let rows = &mut views[at].rows;
        let [x, y, z, u, v] = numbers;
        let row = RigPoint {
            line: cells.line,
            camera,
            name: id.and_then(|i| cells.text(i)).map_or_else(|| rows.len().to_string(), str::to_string),
            x_in_target: [cells.number(x)?, cells.number(y)?, cells.number(z)?],
            image: [cells.number(u)?, cells.number(v)?],
            sigma_px: cells.optional_number(sigma_px)?,
            sigma_m: cells.optional_number(sigma_m)?,
        };
        rows.push(row);
        Ok(())
    })?;
    Ok(views)
}

/// Returns a remark where the coordinates of the points are implausible in metres.
fn unit_remark(views: &[RigPointsView]) -> Option<String> {
    let rows = views.iter().flat_map(|view| &view.rows);
    let points = rows.map(|row| (Point::from(row.x_in_target), row.sigma_m.unwrap_or(0.0)));
    crate::formats::plausible::of_uncertain_points(points)
}

/// The remarks on a whole table, which apply to every answer.
#[derive(Debug, Clone, Default)]
pub struct TableRemarks {
    /// Coordinates that are implausible in metres: with one, an answer that would be `ok` is `implausible`.
    pub sizes: Vec<String>,
    how_read: Option<String>,
}

impl TableRemarks {
    /// Collects the remarks on the views of a table.
    pub fn of(views: &[RigPointsView]) -> Self {
        let how_read = views.iter().find_map(|view| view.how_read.clone());
        TableRemarks { sizes: unit_remark(views).into_iter().collect(), how_read }
    }

    /// Returns all of them.
    pub fn all(&self) -> impl Iterator<Item = &String> {
        self.sizes.iter().chain(&self.how_read)
    }
}
