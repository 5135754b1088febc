//! What a notebook shows of an object: tables in HTML, whose every cell is escaped.

use pyo3::prelude::*;

/// A table of named values, one a row.
pub fn named<'a>(py: Python<'_>, rows: impl IntoIterator<Item = (&'a str, String)>) -> PyResult<String> {
    let escape = py.import("html")?.getattr("escape")?;
    let mut html = String::from("<table>");
    for (name, text) in rows {
        let [name, text]: [String; 2] =
            [escape.call1((name,))?.extract()?, escape.call1((text,))?.extract()?];
        html.push_str(&format!("<tr><th>{name}</th><td style=\"text-align:left\">{text}</td></tr>"));
    }
    html.push_str("</table>");
    Ok(html)
}

/// A table of columns below their names, and how many rows it leaves out.
pub fn columns(py: Python<'_>, columns: &[(String, Vec<String>)], left_out: usize) -> PyResult<String> {
    let escape = py.import("html")?.getattr("escape")?;
    let line = |tag: &str, cells: Vec<&str>| -> PyResult<String> {
        let mut html = String::from("<tr>");
        for cell in cells {
            let cell: String = escape.call1((cell,))?.extract()?;
            html.push_str(&format!("<{tag}>{cell}</{tag}>"));
        }
        Ok(html + "</tr>")
    };
    let mut html = String::from("<table>");
    html.push_str(&line("th", columns.iter().map(|(name, _)| name.as_str()).collect())?);
    for row in 0..columns.first().map_or(0, |(_, cells)| cells.len()) {
        html.push_str(&line("td", columns.iter().map(|(_, cells)| cells[row].as_str()).collect())?);
    }
    html.push_str("</table>");
    if 0 < left_out {
        html.push_str(&format!("<p>and {left_out} more rows</p>"));
    }
    Ok(html)
}
