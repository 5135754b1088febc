//! Known correspondences from a CSV file.

use resight::FileError;
use resight::input::table::{Table, TableRow};
use std::collections::HashMap;
use std::path::Path;

/// One correspondence.
#[derive(Debug, Clone, PartialEq)]
pub struct Row {
    /// Line in the file, counted from 1.
    pub line: u64,
    /// Column `id`, or the row's number within its view.
    pub name: String,
    /// Columns `x_m, y_m, z_m`.
    pub x_in_target: [f64; 3],
    /// Columns `u_px, v_px` or `xn, yn`.
    pub image: [f64; 2],
    /// Column `sigma_px`, where the cell is filled.
    pub sigma: Option<f64>,
    /// Column `sigma_m`, where the cell is filled.
    pub sigma_m: Option<f64>,
}

/// The rows of one view, in file order.
#[derive(Debug, Clone, PartialEq)]
pub struct View {
    /// Column `view`, or the file's name.
    pub name: String,
    /// At least one.
    pub rows: Vec<Row>,
}

/// Where the columns are.
struct Columns {
    space: [usize; 3],
    image: [usize; 2],
    view: Option<usize>,
    id: Option<usize>,
    sigma: Option<usize>,
    sigma_m: Option<usize>,
}

/// Reads all views, in the order in which each first appears; rows of one view need not be adjacent.
pub fn read(path: &Path, normalized: bool) -> Result<Vec<View>, FileError> {
    let table = Table::open(path, "x_m,y_m,z_m")?;
    let columns = columns(&table, normalized)?;
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut views: Vec<View> = Vec::new();
    let mut index = HashMap::new();
    table.each(|cells| {
        let name = match columns.view {
            Some(i) => cells.text(i).unwrap_or_default(),
            None => &file_name,
        };
        let at = *index.entry(name.to_string()).or_insert_with(|| {
            views.push(View { name: name.to_string(), rows: Vec::new() });
            views.len() - 1
        });
        let row = row(&columns, &cells, views[at].rows.len())?;
        views[at].rows.push(row);
        Ok::<(), FileError>(())
    })?;
    Ok(views)
}

fn columns(table: &Table, normalized: bool) -> Result<Columns, FileError> {
    let other_kind = if normalized { "u_px" } else { "xn" };
    let hint = table.find(other_kind).map(|_| match normalized {
        true => "for columns u_px,v_px leave out --normalized",
        false => "for columns xn,yn add --normalized",
    });
    let [u, v] = if normalized { ["xn", "yn"] } else { ["u_px", "v_px"] };
    Ok(Columns {
        space: [table.need("x_m", None)?, table.need("y_m", None)?, table.need("z_m", None)?],
        image: [table.need(u, hint)?, table.need(v, hint)?],
        view: table.find("view"),
        id: table.find("id"),
        sigma: table.find("sigma_px"),
        sigma_m: table.find("sigma_m"),
    })
}

fn row(columns: &Columns, cells: &TableRow<'_>, n: usize) -> Result<Row, FileError> {
    let [x, y, z] = columns.space;
    let [u, v] = columns.image;
    let name = columns.id.and_then(|i| cells.text(i));
    Ok(Row {
        line: cells.line,
        name: name.map_or_else(|| n.to_string(), str::to_string),
        x_in_target: [cells.number(x)?, cells.number(y)?, cells.number(z)?],
        image: [cells.number(u)?, cells.number(v)?],
        sigma: cells.optional_number(columns.sigma)?,
        sigma_m: cells.optional_number(columns.sigma_m)?,
    })
}
