//! Known correspondences from a CSV file: columns by name in any order, every complaint with its line.

use anyhow::{Context, Result, bail};
use std::path::Path;

/// Rows accepted in one file; more is a job for a batch tool.
const MAX_ROWS: usize = 5_000_000;

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
pub fn read(path: &Path, normalized: bool) -> Result<Vec<View>> {
    let file = std::fs::File::open(path).with_context(|| path.display().to_string())?;
    let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).comment(Some(b'#')).from_reader(file);
    let header = reader.headers().map_err(|e| complaint(path, &e))?.clone();
    if header.is_empty() {
        bail!("{}: the file is empty; a header line x_m,y_m,z_m,… is needed", path.display());
    }
    let columns = columns(path, &header, normalized)?;
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let mut views: Vec<View> = Vec::new();
    let mut index = std::collections::HashMap::new();
    for (n, record) in reader.records().enumerate() {
        let record = record.map_err(|e| complaint(path, &e))?;
        if MAX_ROWS <= n {
            bail!("{}: more than {MAX_ROWS} rows; split the file", path.display());
        }
        let name = columns.view.and_then(|i| record.get(i)).unwrap_or(&file_name).to_string();
        let at = *index.entry(name.clone()).or_insert_with(|| {
            views.push(View { name, rows: Vec::new() });
            views.len() - 1
        });
        let row = row(path, &columns, &header, &record, views[at].rows.len())?;
        views[at].rows.push(row);
    }
    if views.is_empty() {
        bail!("{}: no rows below the header", path.display());
    }
    Ok(views)
}

fn columns(path: &Path, header: &csv::StringRecord, normalized: bool) -> Result<Columns> {
    let names: Vec<&str> = header.iter().map(|name| name.trim_start_matches('\u{feff}')).collect();
    let find = |wanted: &str| names.iter().position(|name| *name == wanted);
    if let [only] = names[..]
        && let Some(mark) = [';', '\t'].into_iter().find(|mark| only.contains(*mark))
    {
        let mark = if mark == ';' { "semicolons" } else { "tabs" };
        bail!(
            "{}:1: the cells are separated by {mark}; write commas between cells and points in numbers (x_m,y_m,… and 0.5)",
            path.display()
        );
    }
    let need = |wanted: &str| {
        find(wanted).with_context(|| {
            let hint = match (wanted, normalized) {
                ("u_px" | "v_px", false) if find("xn").is_some() => {
                    " (for columns xn,yn add --normalized)".to_string()
                }
                ("xn" | "yn", true) if find("u_px").is_some() => {
                    " (for columns u_px,v_px leave out --normalized)".to_string()
                }
                _ => crate::files::nearest(wanted, names.iter().map(|n| n.to_string()))
                    .map(|n| format!("; did you mean `{n}` to be `{wanted}`?"))
                    .unwrap_or_default(),
            };
            format!("{}:1: no column `{wanted}`; the columns are {}{hint}", path.display(), names.join(","))
        })
    };
    if let Some(twice) =
        names.iter().enumerate().find(|(i, name)| !name.is_empty() && names[..*i].contains(name))
    {
        bail!("{}:1: column `{}` appears twice", path.display(), twice.1);
    }
    let [u, v] = if normalized { ["xn", "yn"] } else { ["u_px", "v_px"] };
    Ok(Columns {
        space: [need("x_m")?, need("y_m")?, need("z_m")?],
        image: [need(u)?, need(v)?],
        view: find("view"),
        id: find("id"),
        sigma: find("sigma_px"),
        sigma_m: find("sigma_m"),
    })
}

fn row(
    path: &Path,
    columns: &Columns,
    header: &csv::StringRecord,
    record: &csv::StringRecord,
    n: usize,
) -> Result<Row> {
    let line = record.position().map_or(0, |p| p.line());
    let number = |i: usize| -> Result<f64> {
        let (text, column) =
            (record.get(i).unwrap_or(""), header.get(i).unwrap_or("").trim_start_matches('\u{feff}'));
        let shown: String = text.chars().take(40).collect();
        text.parse().ok().with_context(|| match text {
            "" => format!("{}:{line}: column `{column}` is empty; a number is needed", path.display()),
            _ => format!("{}:{line}: column `{column}` is `{shown}`, which is not a number", path.display()),
        })
    };
    let filled = |i: &usize| record.get(*i).is_some_and(|text| !text.is_empty());
    Ok(Row {
        line,
        name: columns
            .id
            .filter(filled)
            .and_then(|i| record.get(i))
            .map_or_else(|| n.to_string(), str::to_string),
        x_in_target: [number(columns.space[0])?, number(columns.space[1])?, number(columns.space[2])?],
        image: [number(columns.image[0])?, number(columns.image[1])?],
        sigma: columns.sigma.filter(filled).map(number).transpose()?,
        sigma_m: columns.sigma_m.filter(filled).map(number).transpose()?,
    })
}

/// A CSV error as `FILE:LINE: reason`.
fn complaint(path: &Path, error: &csv::Error) -> anyhow::Error {
    let line = error.position().map(|p| format!(":{}", p.line())).unwrap_or_default();
    let reason = match error.kind() {
        csv::ErrorKind::UnequalLengths { expected_len, len, .. } => {
            format!("{len} cells where the header has {expected_len}")
        }
        csv::ErrorKind::Utf8 { .. } => "not UTF-8 text".to_string(),
        _ => error.to_string(),
    };
    anyhow::anyhow!("{}{line}: {reason}", path.display())
}
