//! What single and several pages share: a target with its cut marks, and lines of text.

use super::content::Content;
use super::shape::{Page, Shape};

/// Distance between the white around the target and a ruler: cut marks are in between.
pub(super) const TO_RULER_MM: f64 = 4.5;
pub(super) const FONT_MM: f64 = 2.4;
pub(super) const LINE_MM: f64 = 3.2;
/// Range of the cut marks, from the corner of the white.
pub(super) const CUT_MARK_MM: [f64; 2] = [0.8, 3.4];
pub(super) const CUT_STROKE_MM: f64 = 0.15;

/// A target on its pages.
#[derive(Debug, Clone)]
pub(super) struct Laid {
    pub pages: Vec<Page>,
    /// Designed lengths of the rulers along x and y.
    pub ruler_mm: [f64; 2],
    /// Rows and columns of pages, where it takes more than one.
    pub tiles: Option<[usize; 2]>,
}

/// Returns the target with its ink starting at `origin`, and marks along which its white is cut.
pub(super) fn placed(content: &Content, origin: [f64; 2], white: f64) -> Vec<Shape> {
    let mut shapes: Vec<Shape> = content.shapes.iter().map(|shape| shape.moved(origin)).collect();
    let [w, h] = content.size;
    let (left, right) = (origin[0] - white, origin[0] + w + white);
    let (top, bottom) = (origin[1] - white, origin[1] + h + white);
    for (x, outward_x) in [(left, -1.0), (right, 1.0)] {
        for (y, outward_y) in [(top, -1.0), (bottom, 1.0)] {
            let [near, far] = CUT_MARK_MM;
            let mark = |from, to| Shape::Line { from, to, width: CUT_STROKE_MM };
            shapes.push(mark([x + outward_x * near, y], [x + outward_x * far, y]));
            shapes.push(mark([x, y + outward_y * near], [x, y + outward_y * far]));
        }
    }
    shapes
}

pub(super) fn text_block(lines: &[String], at: [f64; 2]) -> Vec<Shape> {
    let line = |(i, text): (usize, &String)| Shape::Text {
        at: [at[0], at[1] + i as f64 * LINE_MM],
        size: FONT_MM,
        text: text.clone(),
    };
    lines.iter().enumerate().map(line).collect()
}
