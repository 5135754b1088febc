//! The columns of a CSV file of detections.

use super::{DetectionRow, Reader, RowFault};
use crate::error::{Error, FileError};
use crate::input::table::{Table, TableRow};
use std::path::Path;

/// The positions of the columns.
struct Columns {
    camera: Option<usize>,
    view: Option<usize>,
    id: Option<usize>,
    corner: Option<usize>,
    space: Option<[usize; 3]>,
    image: [usize; 2],
    target: Option<usize>,
    body: Option<usize>,
    sigma_px: Option<usize>,
    sigma_m: Option<usize>,
    t_s: Option<usize>,
}

/// Returns the names of the cameras in a file, in natural order; none where no column states them.
pub(crate) fn camera_names(path: &Path) -> Result<Vec<String>, Error> {
    let table = Table::open(path, "camera,view,id,x_m,y_m,z_m,u_px,v_px")?;
    let Some(column) = table.find("camera") else { return Ok(Vec::new()) };
    let mut names = std::collections::BTreeSet::new();
    table.each(|cells| {
        names.insert(cells.text(column).unwrap_or_default().to_string());
        Ok::<(), Error>(())
    })?;
    let mut names: Vec<String> = names.into_iter().collect();
    names.sort_by(|a, b| crate::rig::names::natural(a, b));
    Ok(names)
}

/// Passes every row of a file to the reader.
pub(super) fn read(path: &Path, reader: &mut Reader) -> Result<(), Error> {
    let table = Table::open(path, "camera,view,id,x_m,y_m,z_m,u_px,v_px")?;
    let columns = columns(&table, reader)?;
    let only = reader.collected.cameras.first().map(|camera| camera.name.clone()).unwrap_or_default();
    table.each(|cells| {
        let row = row(&columns, &cells, reader, &only)?;
        reader.row(&row).map_err(|fault| Error::from(columns.complaint(&cells, fault)))
    })?;
    reader.collected.files.push(path.to_path_buf());
    Ok(())
}

fn columns(table: &Table, reader: &Reader) -> Result<Columns, FileError> {
    let (t_s, view) = (table.find("t_s"), table.find("view"));
    if view.is_none() && t_s.is_none() {
        table.need("view", Some("or `t_s`: which frames belong together"))?;
    }
    let target = table.find("target");
    let given = &reader.collected.targets;
    if target.is_none() && 1 < given.len() {
        let reason = format!("{} targets are given, so a column `target` is needed", given.len());
        return Err(table.complaint(reason));
    }
    let hint = "or --target FILE, which knows where its points are; then the column `id` is enough";
    let space = match given.is_empty() || table.find("x_m").is_some() {
        true => Some([table.need("x_m", Some(hint))?, table.need("y_m", None)?, table.need("z_m", None)?]),
        false => None,
    };
    let id = table.find("id");
    if space.is_none() && id.is_none() {
        table.need("id", Some("which point of the target each row is"))?;
    }
    // If there is only one camera, its rows need not name it.
    let camera = match reader.collected.cameras.len() {
        1 => table.find("camera"),
        _ => Some(table.need("camera", None)?),
    };
    let image = [table.need("u_px", None)?, table.need("v_px", None)?];
    let (corner, body) = (table.find("corner"), table.find("body"));
    let (sigma_px, sigma_m) = (table.find("sigma_px"), table.find("sigma_m"));
    Ok(Columns { camera, view, id, corner, space, image, target, body, sigma_px, sigma_m, t_s })
}

fn row<'a>(
    columns: &Columns,
    cells: &'a TableRow,
    reader: &Reader,
    only: &'a str,
) -> Result<DetectionRow<'a>, FileError> {
    let text = |column: Option<usize>| column.and_then(|i| cells.text(i));
    let target = text(columns.target);
    // Targets that are named only in rows have no points of their own.
    let is_known = match target {
        Some(name) => reader.targets.get(name).is_some_and(|i| reader.collected.targets[*i].target.is_some()),
        None => reader.collected.targets.first().is_some_and(|target| target.target.is_some()),
    };
    let position_m = match columns.space {
        Some([x, y, z]) if !is_known || cells.text(x).is_some() => {
            Some([cells.number(x)?, cells.number(y)?, cells.number(z)?])
        }
        _ => None,
    };
    // Without a column of views, the time as written is the name of the frame.
    let view = columns.view.or(columns.t_s).unwrap_or_default();
    let Some(view_name) = cells.text(view) else {
        return Err(cells.complaint(view, "is empty; name the view"));
    };
    Ok(DetectionRow {
        camera: match columns.camera {
            Some(column) => cells.text(column).unwrap_or_default(),
            None => only,
        },
        view: view_name,
        t_s: columns.t_s.map(|i| cells.number(i)).transpose()?,
        target,
        body: text(columns.body),
        id: text(columns.id),
        corner: text(columns.corner),
        position_m,
        image_px: [cells.number(columns.image[0])?, cells.number(columns.image[1])?],
        sigma_px: cells.optional_number(columns.sigma_px)?,
        sigma_m: cells.optional_number(columns.sigma_m)?,
        line: Some(cells.line),
    })
}

impl Columns {
    fn complaint(&self, cells: &TableRow, fault: RowFault) -> FileError {
        let column = match fault.column {
            "view" => self.view,
            "t_s" => self.t_s,
            "id" => self.id,
            "target" => self.target,
            "x_m" => self.space.map(|s| s[0]),
            "y_m" => self.space.map(|s| s[1]),
            "z_m" => self.space.map(|s| s[2]),
            "u_px" => Some(self.image[0]),
            "v_px" => Some(self.image[1]),
            "sigma_px" => self.sigma_px,
            "sigma_m" => self.sigma_m,
            _ => None,
        };
        cells.complaint(column.or(self.camera).unwrap_or(self.image[0]), &fault.what)
    }
}
