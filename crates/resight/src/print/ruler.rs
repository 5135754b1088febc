//! Rulers: lines of a known length with a mark at each end, with which the print is measured.

use super::shape::Shape;
use super::text::width_mm;

/// Lengths of rulers, mm. Neighbours differ by a fifth and more, so that one is not mistaken for another within the allowed error of 5 %.
const LENGTHS_MM: [f64; 14] =
    [2000.0, 1500.0, 1000.0, 800.0, 600.0, 500.0, 400.0, 300.0, 250.0, 200.0, 150.0, 100.0, 50.0, 20.0];
/// Width of the strokes: thin enough that the middle is visible to a few hundredths of a millimetre.
const STROKE_MM: f64 = 0.15;
const LABEL_MM: f64 = 2.2;
/// Distance from the line to the end of the labels: below a horizontal ruler, beside a vertical one.
pub(super) const DEPTH_MM: [f64; 2] = [5.5, 7.0];
/// Length by which the last label and the text extend beyond the end.
pub(super) const SLACK_MM: f64 = 4.0;

/// Returns the longest ruler that fits; `None` below 20 mm.
pub(super) fn longest_mm(room_mm: f64) -> Option<f64> {
    LENGTHS_MM.into_iter().find(|length| *length <= room_mm)
}

/// Draws a ruler along x (axis 0) with its marks below, or along y (axis 1) with its marks to the left, from a point.
pub(super) fn ruler(axis: usize, from: [f64; 2], length: f64) -> Vec<Shape> {
    let at = |along: f64, across: f64| match axis {
        0 => [from[0] + along, from[1] + across],
        _ => [from[0] - across, from[1] + along],
    };
    let line = |a, b| Shape::Line { from: a, to: b, width: STROKE_MM };
    let mut shapes = vec![line(at(0.0, 0.0), at(length, 0.0))];
    let labelled = if length <= 200.0 { 10 } else { 50 };
    for mm in 0..=length as usize {
        let along = mm as f64;
        let depth = match mm {
            _ if mm == 0 || along == length => 2.6,
            _ if mm.is_multiple_of(10) => 2.0,
            _ if mm.is_multiple_of(5) => 1.5,
            _ => 1.0,
        };
        // The end marks extend to both sides of the line.
        let above = if mm == 0 || along == length { -1.2 } else { 0.0 };
        shapes.push(line(at(along, above), at(along, depth)));
        if mm.is_multiple_of(labelled) || along == length {
            shapes.push(label(axis, at(along, 0.0), mm, along == length));
        }
    }
    shapes
}

fn label(axis: usize, mark: [f64; 2], mm: usize, is_last: bool) -> Shape {
    let text = match (is_last, axis) {
        (true, 0) => format!("{mm} mm, x"),
        _ => mm.to_string(),
    };
    let width = width_mm(&mm.to_string(), LABEL_MM);
    let at = match axis {
        0 => [mark[0] - 0.5 * width, mark[1] + 2.8 + 0.8 * LABEL_MM],
        _ => [mark[0] - 3.0 - width, mark[1] + 0.36 * LABEL_MM],
    };
    Shape::Text { at, size: LABEL_MM, text }
}
