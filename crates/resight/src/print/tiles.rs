//! Divides a target larger than its paper into overlapping pages, with marks for joining them.

use super::content::Content;
use super::paper::Paper;
use super::ruler::{DEPTH_MM, SLACK_MM, longest_mm, ruler};
use super::shape::{Group, Page, Shape};
use super::sheet::{CUT_STROKE_MM, FONT_MM, LINE_MM, Laid, TO_RULER_MM, placed, text_block};
use super::text::{width_mm, wrapped};
use super::{MOST_PAGES, too_many_pages};
use crate::error::Error;

/// Blank edge of each page, with the marks.
const MARGIN_MM: f64 = 12.0;
/// The overlap of neighbouring pages.
const OVERLAP_MM: f64 = 10.0;
/// Range of the marks of a joint, from the part that belongs to the target.
const MARK_MM: [f64; 2] = [1.0, 6.0];

/// The whole sheet at its full size.
struct Whole {
    shapes: Vec<Shape>,
    size: [f64; 2],
    ruler_mm: [f64; 2],
}

/// The numbers of pages across and down, and the part of the sheet on each page.
struct Tiling {
    page: [f64; 2],
    window: [f64; 2],
    columns: usize,
    rows: usize,
}

pub(super) fn tile(content: &Content, paper: &Paper) -> Result<Laid, Error> {
    let whole = whole(content)?;
    let tilings = paper.both_ways().into_iter().filter_map(|page| Tiling::new(page, whole.size));
    let tiling = tilings.min_by_key(|t| t.rows.saturating_mul(t.columns)).ok_or_else(|| {
        Error::request(format!(
            "{} leaves no room between margins of {MARGIN_MM} mm and overlaps of {OVERLAP_MM} mm; give a larger --paper",
            paper.name()
        ))
    })?;
    let n_pages = tiling.rows.saturating_mul(tiling.columns);
    if MOST_PAGES < n_pages {
        return Err(too_many_pages(n_pages, paper));
    }
    let pages =
        (0..n_pages).map(|i| tiling.page(&whole, i / tiling.columns, i % tiling.columns, &content.title));
    let pages = pages.collect();
    Ok(Laid { pages, ruler_mm: whole.ruler_mm, tiles: Some([tiling.rows, tiling.columns]) })
}

fn whole(content: &Content) -> Result<Whole, Error> {
    let ([w, h], white) = (content.size, content.white[0]);
    let strip = [TO_RULER_MM + DEPTH_MM[0], TO_RULER_MM + DEPTH_MM[1]];
    let origin = [strip[1] + white, white];
    let width = origin[0] + w + white;
    let lines = wrapped(&content.words, FONT_MM, width);
    let bottom = origin[1] + h + white;
    let room = |length: f64| {
        longest_mm(length).ok_or_else(|| {
            Error::request(format!(
                "the target is {w:.1} × {h:.1} mm, which leaves no room for a ruler of 20 mm"
            ))
        })
    };
    let (x_mm, y_mm) = (room(w + white - 3.0 * SLACK_MM)?, room(h + white)?);
    let mut shapes = placed(content, origin, white);
    shapes.extend(ruler(0, [origin[0], bottom + TO_RULER_MM], x_mm));
    shapes.extend(ruler(1, [strip[1] - TO_RULER_MM, origin[1]], y_mm));
    shapes.extend(text_block(&lines, [0.0, bottom + strip[0] + LINE_MM]));
    let height = bottom + strip[0] + (lines.len() as f64 + 0.5) * LINE_MM;
    // A long word of the text may be wider than a narrow target.
    let text_width = lines.iter().map(|line| width_mm(line, FONT_MM)).fold(0.0, f64::max);
    Ok(Whole { shapes, size: [width.max(text_width), height], ruler_mm: [x_mm, y_mm] })
}

impl Tiling {
    fn new(page: [f64; 2], sheet: [f64; 2]) -> Option<Self> {
        let window = page.map(|side| side - 2.0 * MARGIN_MM);
        let step = window.map(|side| side - OVERLAP_MM);
        let usable = step.iter().all(|side| OVERLAP_MM <= *side);
        // A float beyond the range of usize saturates, and is refused as too many pages.
        let count = |i: usize| (((sheet[i] - OVERLAP_MM) / step[i]).ceil().max(1.0)) as usize;
        usable.then(|| Tiling { page, window, columns: count(0), rows: count(1) })
    }

    /// Returns the distance between the windows of neighbouring pages.
    fn step(&self, axis: usize) -> f64 {
        self.window[axis] - OVERLAP_MM
    }

    fn page(&self, whole: &Whole, row: usize, column: usize, title: &str) -> Page {
        let first = [column as f64 * self.step(0), row as f64 * self.step(1)];
        let shown = [first, [first[0] + self.window[0], first[1] + self.window[1]]];
        let to_page = [MARGIN_MM - first[0], MARGIN_MM - first[1]];
        let part = whole.shapes.iter().filter_map(|shape| shape.within(&shown));
        let clip = [[MARGIN_MM; 2], [MARGIN_MM + self.window[0], MARGIN_MM + self.window[1]]];
        let part = Group { clip: Some(clip), shapes: part.map(|shape| shape.moved(to_page)).collect() };
        let marks = Group { clip: None, shapes: self.marks(row, column, title) };
        Page { size_mm: self.page, groups: vec![part, marks] }
    }

    /// Draws the marks of the joints and the page's number in the margins.
    fn marks(&self, row: usize, column: usize, title: &str) -> Vec<Shape> {
        let counts = [self.columns, self.rows];
        let at = [column, row];
        let mut shapes = Vec::new();
        for axis in [0, 1] {
            let near = MARGIN_MM + 0.5 * OVERLAP_MM;
            let far = MARGIN_MM + self.window[axis] - 0.5 * OVERLAP_MM;
            let before = (0 < at[axis]).then_some(near);
            let after = (at[axis] + 1 < counts[axis]).then_some(far);
            for along in before.into_iter().chain(after) {
                for (edge, outward) in [(MARGIN_MM, -1.0), (MARGIN_MM + self.window[1 - axis], 1.0)] {
                    shapes.push(joint_mark(axis, along, edge, outward));
                }
            }
        }
        let number = row * self.columns + column + 1;
        let text = format!(
            "Page {number} of {} (row {}, column {}). Cut along the marks at the left and the top, and lay the cut on the marks of the page before. {title}",
            self.columns * self.rows,
            row + 1,
            column + 1
        );
        shapes.extend(self.line_of_words(&text));
        shapes
    }

    /// Writes a line in the bottom margin, between the marks of the joints, shortened where it is too long.
    fn line_of_words(&self, text: &str) -> Option<Shape> {
        let size = 0.9 * FONT_MM;
        let room = self.window[0] - 2.0 * OVERLAP_MM;
        let line = wrapped(&[text.to_owned()], size, room).into_iter().next()?;
        let at = [MARGIN_MM + OVERLAP_MM, MARGIN_MM + self.window[1] + 4.0];
        Some(Shape::Text { at, size, text: line })
    }
}

/// Returns the mark across `axis` at `along`, outside an edge of the window.
fn joint_mark(axis: usize, along: f64, edge: f64, outward: f64) -> Shape {
    let at = |across: f64| if axis == 0 { [along, across] } else { [across, along] };
    let [near, far] = MARK_MM.map(|off| edge + outward * off);
    Shape::Line { from: at(near), to: at(far), width: CUT_STROKE_MM }
}
