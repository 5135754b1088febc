//! The layout of a page: rulers beside the target or below it, upright or rotated, with as much white as fits.

use super::content::Content;
use super::paper::Paper;
use super::ruler::{DEPTH_MM, SLACK_MM, longest_mm, ruler};
use super::shape::{Group, Page, Shape};
use super::sheet::{CUT_MARK_MM, FONT_MM, LINE_MM, Laid, TO_RULER_MM, placed, text_block};
use super::text::wrapped;
use super::tiles;
use crate::error::Error;

/// Blank edge of the paper on most printers.
const MARGIN_MM: f64 = 5.0;
/// Shorter rulers are inaccurate: other positions are tried first.
const GOOD_RULER_MM: f64 = 100.0;

/// Arranges the target on one page where it fits, otherwise on several.
pub(super) fn lay(content: &Content, paper: &Paper) -> Result<Laid, Error> {
    for least_ruler in [GOOD_RULER_MM, 0.0] {
        for white in content.white {
            for page in paper.both_ways() {
                for place in [beside, below] {
                    let placed = place(content, white, page);
                    if let Some((shapes, ruler_mm)) = placed.filter(|(_, r)| least_ruler <= r[0].min(r[1])) {
                        let groups = vec![Group { clip: None, shapes }];
                        return Ok(Laid {
                            pages: vec![Page { size_mm: page, groups }],
                            ruler_mm,
                            tiles: None,
                        });
                    }
                }
            }
        }
    }
    tiles::tile(content, paper)
}

type Placed = (Vec<Shape>, [f64; 2]);

/// Places the ruler along y to the left, the one along x below, and the text below that.
fn beside(content: &Content, white: f64, [width, height]: [f64; 2]) -> Option<Placed> {
    let [w, h] = content.size;
    let edge = white.max(MARGIN_MM);
    let strip = [TO_RULER_MM + DEPTH_MM[0], TO_RULER_MM + DEPTH_MM[1]];
    let lines = wrapped(&content.words, FONT_MM, width - 2.0 * MARGIN_MM);
    let text = lines.len() as f64 * LINE_MM;
    let free_x = width - (MARGIN_MM + strip[1] + white + w + edge);
    let free_y = height - (edge + h + white + strip[0] + text + MARGIN_MM);
    if free_x < 0.0 || free_y < 0.0 {
        return None;
    }
    let origin = [MARGIN_MM + strip[1] + white + 0.5 * free_x, edge + 0.5 * free_y];
    let bottom = origin[1] + h + white;
    let x_mm = longest_mm(width - 2.0 * MARGIN_MM - 3.0 * SLACK_MM)?;
    let y_mm = longest_mm(bottom - MARGIN_MM - 1.0)?;
    let start = |at: f64, length: f64, least: f64, most: f64| at.min(most - length).max(least);
    let x_from = [
        start(origin[0], x_mm, MARGIN_MM + SLACK_MM, width - MARGIN_MM - 2.0 * SLACK_MM),
        bottom + TO_RULER_MM,
    ];
    let y_from = [origin[0] - white - TO_RULER_MM, start(origin[1], y_mm, MARGIN_MM, bottom)];
    let mut shapes = on_page(placed(content, origin, white), [width, height]);
    shapes.extend(ruler(0, x_from, x_mm));
    shapes.extend(ruler(1, y_from, y_mm));
    shapes.extend(text_block(&lines, [MARGIN_MM, bottom + strip[0] + LINE_MM]));
    Some((shapes, [x_mm, y_mm]))
}

/// Places the ruler along y below the target at the left, and the other ruler and the text to its right.
fn below(content: &Content, white: f64, [width, height]: [f64; 2]) -> Option<Placed> {
    let [w, h] = content.size;
    let edge = white.max(MARGIN_MM);
    let top = edge + h + white + CUT_MARK_MM[1] + 1.0;
    let left = MARGIN_MM + DEPTH_MM[1] + SLACK_MM;
    let room = height - MARGIN_MM - top;
    let lines = wrapped(&content.words, FONT_MM, width - MARGIN_MM - left);
    let needed = DEPTH_MM[0] + 2.0 + lines.len() as f64 * LINE_MM;
    if width < w + 2.0 * edge || room < needed {
        return None;
    }
    let (x_mm, y_mm) = (longest_mm(width - MARGIN_MM - left - 3.0 * SLACK_MM)?, longest_mm(room - 2.0)?);
    let mut shapes = on_page(placed(content, [0.5 * (width - w), edge], white), [width, height]);
    shapes.extend(ruler(0, [left + SLACK_MM, top + 2.0], x_mm));
    shapes.extend(ruler(1, [MARGIN_MM + DEPTH_MM[1], top + 1.5], y_mm));
    shapes.extend(text_block(&lines, [left, top + 2.0 + DEPTH_MM[0] + LINE_MM]));
    Some((shapes, [x_mm, y_mm]))
}

/// Leaves out the cut marks for which white up to the paper's edge leaves no room.
fn on_page(shapes: Vec<Shape>, page: [f64; 2]) -> Vec<Shape> {
    let inside = |p: &[f64; 2]| (0..2).all(|i| 1.0 <= p[i] && p[i] <= page[i] - 1.0);
    let shows = |shape: &Shape| match shape {
        Shape::Line { from, to, .. } => inside(from) && inside(to),
        _ => true,
    };
    shapes.into_iter().filter(shows).collect()
}
