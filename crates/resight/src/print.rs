//! Prints targets on paper at exact scale, as PDF and SVG, and corrects for the printer's error: the job of `resight print`.
//!
//! target → ink (what `render` draws, as outlines) → sheet (with rulers, cut marks and text) → pages → PDF or SVG. Both writers draw one list
//! of shapes. Lengths are millimetres; y points down from the top left of the page.

mod content;
mod layout;
mod measured;
mod paper;
mod pdf;
mod ruler;
pub mod shape;
mod sheet;
mod svg;
mod tags;
mod text;
mod tiles;

use crate::answer::print::{PrintAnswer, PrintedScaleObject, Tiles};
use crate::answer::{SchemaNumber, Status};
use crate::error::Error;
use crate::formats;
use content::Content;
pub use measured::MeasuredRulers;
pub use paper::Paper;
use resight_core::Target;
use sheet::Laid;
pub use tags::sheet_of_tags;

/// The target to print, and the paper.
#[derive(Debug, Clone)]
pub struct PrintRequest {
    /// The target. It is printed as designed: a printed scale belongs to an earlier print.
    pub target: Target,
    /// The paper; it is rotated where that saves pages.
    pub paper: Paper,
    /// The files to write.
    pub format: PrintFormat,
    /// Whether the target file is written too.
    pub writes_target: bool,
    /// Lengths measured on the rulers of the printed sheet; the target file written then carries the scale.
    pub measured: Option<MeasuredRulers>,
    /// Diameter of the dots of a `line_plus_one` target, metres, by default a third of the smallest distance between two; of a `circle_grid`,
    /// by default what it states.
    pub dot_diameter_m: Option<f64>,
    /// The name of the files, also printed on the sheet.
    pub name: String,
}

/// The format of the pages.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum PrintFormat {
    /// One file of all pages.
    Pdf,
    /// One file per page.
    Svg,
    /// Nothing: only the target file.
    TargetFile,
}

/// Largest number of pages of one target; a larger one should be printed by a copy shop, on paper of its own size.
const MOST_PAGES: usize = 400;
/// More squares or tags than any camera resolves; the limit keeps a malicious request from filling the memory.
const MOST_CELLS: u64 = 100_000;

/// Prints a target at exact scale on pages, and writes its target file.
///
/// # Errors
/// A target that is not printable, or invalid: unknown families, ids beyond the family, invalid sizes; paper too small for a ruler, or more than
/// 400 pages of it; measured lengths that are off by more than 5 %.
pub fn print_target(request: &PrintRequest) -> Result<PrintAnswer, Error> {
    check_extent(&request.target)?;
    request.paper.check()?;
    if request.measured.is_some() && !request.writes_target {
        return Err(Error::request("what the rulers say goes into the target file; have it written"));
    }
    let contents = content::contents(request)?;
    let sheets =
        contents.iter().map(|c| layout::lay(c, &request.paper)).collect::<Result<Vec<Laid>, Error>>()?;
    let n_pages = sheets.iter().map(|sheet| sheet.pages.len()).sum();
    if MOST_PAGES < n_pages {
        return Err(too_many_pages(n_pages, &request.paper));
    }
    let first = sheets.first().ok_or_else(|| Error::request("the target has nothing to print"))?;
    let target = match &request.measured {
        Some(rulers) => rulers.applied(&request.target, first.ruler_mm, sheets.len())?,
        None => request.target.design().clone(),
    };
    let mut answer = PrintAnswer {
        schema: SchemaNumber,
        status: Status::Ok,
        kind: request.target.kind(),
        files: Vec::new(),
        paper: request.paper.name(),
        page_size_mm: first.pages.first().map_or([0.0; 2], |page| page.size_mm),
        n_pages,
        tiles: first.tiles.map(|[rows, columns]| Tiles { rows, columns }),
        ruler_mm: first.ruler_mm,
        printed_scale: target.printed_scale().map(PrintedScaleObject::from),
        warnings: warnings(request, &contents, &sheets),
        message: message(request, &contents, &sheets, n_pages),
        contents: Vec::new(),
    };
    draw(request, &sheets, &mut answer);
    if request.writes_target {
        answer.files.push(format!("{}.toml", request.name));
        answer.contents.push(formats::own_target_file(&target, &comment(&contents, first)).into_bytes());
    }
    Ok(answer)
}

/// Returns the remark that a job assumes the scale of a print to be exact, with its uncertainty; `None` where it is exact.
pub fn scale_remark(target: &Target, job: &str) -> Option<String> {
    let sigma = target.printed_scale()?.relative_sigma();
    (sigma != [0.0; 2]).then(|| {
        format!(
            "points are placed as printed, but {job} takes the printed scale as exact; its standard deviation, {:.3} % along x and {:.3} % along y, \
             is the same in every view and not in the answer's ±",
            100.0 * sigma[0],
            100.0 * sigma[1]
        )
    })
}

fn check_extent(target: &Target) -> Result<(), Error> {
    target.design().check()?;
    let (rows, columns) = match target.design() {
        Target::AprilGrid(t) => (t.rows, t.columns),
        Target::Chessboard(t) => (t.rows, t.columns),
        Target::Charuco(t) => (t.rows, t.columns),
        Target::CircleGrid(t) => (t.rows, t.columns),
        _ => return Ok(()),
    };
    match u64::from(rows) * u64::from(columns) {
        cells if cells <= MOST_CELLS => Ok(()),
        cells => Err(Error::request(format!(
            "{rows} rows × {columns} columns are {cells} squares, tags or circles; at most {MOST_CELLS} are printed: take fewer, larger ones"
        ))),
    }
}

fn too_many_pages(n_pages: usize, paper: &Paper) -> Error {
    Error::request(format!(
        "the target needs {n_pages} pages of {}; at most {MOST_PAGES} are written: give a larger --paper WIDTHxHEIGHT (mm), or a smaller target",
        paper.name()
    ))
}

fn draw(request: &PrintRequest, sheets: &[Laid], answer: &mut PrintAnswer) {
    let pages: Vec<&shape::Page> = sheets.iter().flat_map(|sheet| &sheet.pages).collect();
    match request.format {
        PrintFormat::Pdf => {
            answer.files.push(format!("{}.pdf", request.name));
            answer.contents.push(pdf::document(&pages));
        }
        PrintFormat::Svg => {
            for (i, page) in pages.iter().enumerate() {
                let number = if pages.len() == 1 { String::new() } else { format!("-{}", i + 1) };
                answer.files.push(format!("{}{number}.svg", request.name));
                answer.contents.push(svg::document(page).into_bytes());
            }
        }
        PrintFormat::TargetFile => {}
    }
}

fn warnings(request: &PrintRequest, contents: &[Content], sheets: &[Laid]) -> Vec<String> {
    let mut warnings = Vec::new();
    if request.target.printed_scale().is_some() && request.measured.is_none() {
        warnings.push(
            "the target file states the scale of an earlier print; this one is drawn as designed, and its rulers are to be measured anew".to_owned(),
        );
    }
    warnings.extend(formats::symmetry_warning(&request.target));
    if let Some([rows, columns]) = sheets.first().and_then(|sheet| sheet.tiles) {
        warnings.push(format!(
            "the target is larger than the paper and comes on {rows} × {columns} pages; joints are never exact: measure both rulers across them, on the \
             sheet put together, and prefer one large sheet where accuracy matters"
        ));
    }
    if 1 < contents.len() {
        warnings.push(format!(
            "the {} tags of this map are printed on sheets of their own: put each where the map says, and state its size_m as measured",
            contents.len()
        ));
    }
    warnings
}

fn message(request: &PrintRequest, contents: &[Content], sheets: &[Laid], n_pages: usize) -> String {
    let what = match contents {
        [one] => one.title.clone(),
        several => format!("{} tags", several.len()),
    };
    let [x, y] = sheets.first().map_or([0.0; 2], |sheet| sheet.ruler_mm);
    let pages = if n_pages == 1 { "1 page".to_owned() } else { format!("{n_pages} pages") };
    let paper = request.paper.name();
    match &request.measured {
        Some(rulers) => format!(
            "{what}: the rulers of {x} and {y} mm measure {} and {} mm ± {} mm",
            rulers.x_mm, rulers.y_mm, rulers.sigma_mm
        ),
        None => format!(
            "{what} on {pages} of {paper}; print at 100 %, then measure the rulers: {x} mm along x, {y} mm along y"
        ),
    }
}

fn comment(contents: &[Content], first: &Laid) -> String {
    let [x, y] = first.ruler_mm;
    let title = contents.first().map_or("", |c| c.title.as_str());
    format!(
        "{title}\nLengths are as designed. The rulers of the sheet are designed {x} mm long along x and {y} mm along y."
    )
}

#[cfg(test)]
mod tests;
