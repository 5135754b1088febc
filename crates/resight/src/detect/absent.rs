//! A target was not found: the target that was sought, and the one in the image instead.

use super::chessboard::{ChessboardFinder, Outcome};
use super::dots::DotDetector;
use super::every_tag::{EveryTagFinder, FamilyTags};
use super::joints::CornerWindow;
use crate::GrayImage;
use resight_core::Target;
use resight_core::target::{Chessboard, LinePlusOne};

/// Ids named in a sentence.
const MOST_NAMED: usize = 8;

/// In one sentence: which target is not in the image, by which of its numbers, and what is there instead. Searches the whole image again,
/// for every family of tags: for images in which the target was not found.
pub fn not_found(target: &Target, image: &GrayImage) -> String {
    let wanted = wanted(target);
    match instead_of(target, image) {
        Some(seen) => format!("no {wanted} in this image: {seen}"),
        None => format!("no {wanted} in this image; check that all of it is visible, sharp and evenly lit"),
    }
}

/// The target that is sought.
fn wanted(target: &Target) -> String {
    match target.design() {
        Target::Tag(t) => format!("tag target ({} id {}, size_m {})", t.family, t.id, t.size_m),
        Target::TagMap(map) => format!("tag of the map ({}, {} tags)", map.family, map.tags.len()),
        Target::AprilGrid(g) => format!(
            "AprilGrid ({} × {} tags of {}, ids {} to {}, tag_size_m {})",
            g.rows,
            g.columns,
            g.family,
            g.first_id,
            last_id(g.first_id, g.rows * g.columns),
            g.tag_size_m
        ),
        Target::Chessboard(b) => {
            format!("chessboard ({} × {} inner corners, square_m {})", b.rows, b.columns, b.square_m)
        }
        Target::Charuco(b) => {
            format!(
                "ChArUco board ({} × {} squares, {}, square_m {})",
                b.rows, b.columns, b.dictionary, b.square_m
            )
        }
        Target::LinePlusOne(_) => "target of three dots on a line and one off it".to_owned(),
        other => format!("{} target", other.kind()),
    }
}

fn last_id(first: u32, count: u32) -> u32 {
    first.saturating_add(count).saturating_sub(1)
}

/// What an image shows instead of a target, with a remedy; none where nothing similar is seen.
pub fn instead_of(target: &Target, image: &GrayImage) -> Option<String> {
    match target.design() {
        Target::Tag(tag) => other_tags(&tag.family, &format!("id {}", tag.id), "correct `family`", image),
        Target::TagMap(map) => {
            let way_out = "state the family in the map, or with --tag-family";
            other_tags(&map.family, "an id of the map", way_out, image)
        }
        Target::AprilGrid(grid) => {
            let ids =
                format!("ids {} to {}", grid.first_id, last_id(grid.first_id, grid.rows * grid.columns));
            other_tags(&grid.family, &ids, "correct `family`", image)
        }
        Target::Charuco(board) => {
            let count = board.rows * board.columns / 2;
            let ids = format!("ids 0 to {} where the board has them", last_id(0, count));
            other_tags(&board.dictionary, &ids, "correct `dictionary`", image)
        }
        Target::Chessboard(board) => other_grid(board, image).or_else(|| markers_on_board(image)),
        Target::LinePlusOne(dots) => other_dots(dots, image),
        _ => None,
    }
}

/// Tags of the family with other ids, or else of another family.
fn other_tags(family: &str, wanted: &str, way_out: &str, image: &GrayImage) -> Option<String> {
    if let Some(own) = EveryTagFinder::new(family).ok()?.find(image).first() {
        return Some(format!("tags of {family} are there, but none with {wanted}: {}", named(own)));
    }
    let found = EveryTagFinder::new("any").ok()?.find(image);
    let other = found.first()?;
    Some(format!(
        "no tag of {family} is there, but tags of {} are: {}; {way_out}",
        other.family,
        named(other)
    ))
}

/// A few ids.
fn named(family: &FamilyTags) -> String {
    let mut ids: Vec<u32> = family.tags.iter().map(|tag| tag.id).collect();
    ids.dedup();
    let named: Vec<String> = ids.iter().take(MOST_NAMED).map(u32::to_string).collect();
    let more = if MOST_NAMED < ids.len() { ", …" } else { "" };
    format!("{}{more}", named.join(", "))
}

/// A chessboard of another size.
fn other_grid(board: &Chessboard, image: &GrayImage) -> Option<String> {
    let finder = ChessboardFinder::new(board, CornerWindow::Clear).ok()?;
    let (places, (rows, columns)) = match finder.look(image) {
        Outcome::Part { columns, rows, places } => {
            (places, (rows.min(columns) as usize, rows.max(columns) as usize))
        }
        _ => (0, finder.largest_grid(image)?),
    };
    let wanted = (board.rows.min(board.columns) as usize, board.rows.max(board.columns) as usize);
    let hint = if wanted == (rows + 1, columns + 1) {
        "rows and columns count inner corners, one less than squares".to_owned() // Squares were counted.
    } else if 0 < places {
        format!(
            "it could be any of {places} parts of the {} × {} board; show the white margin on enough of its sides, or all of it (rows and columns count inner corners)",
            wanted.0, wanted.1
        )
    } else {
        "rows and columns count inner corners: correct them, or show the whole board".to_owned()
    };
    Some(format!("a grid of {rows} × {columns} inner corners is there; {hint}"))
}

/// Tags in the squares of what should be a plain chessboard.
fn markers_on_board(image: &GrayImage) -> Option<String> {
    let found = EveryTagFinder::new("any").ok()?.find(image);
    let most = found.first()?;
    Some(format!(
        "tags of {} are there: {}; a board with tags in its squares is of kind `charuco`, tags beside each other one of kind `aprilgrid`",
        most.family,
        named(most)
    ))
}

/// Dots that are not the target.
fn other_dots(target: &LinePlusOne, image: &GrayImage) -> Option<String> {
    let dots = DotDetector::new(target).ok()?.dots(image).ok()?;
    let dark = dots.iter().filter(|dot| dot.contrast < 0.0).count();
    let (light, most) = (dots.len() - dark, dark.max(dots.len() - dark));
    let seen = format!("{dark} dark and {light} light dots are seen");
    match most {
        0 => None,
        1..=3 => Some(format!("{seen}, and four of one kind are needed, each whole inside the image")),
        _ => Some(format!(
            "{seen}, but no four of them lie as `line_m` and `off_m` say; check these, and that the target is seen from its front"
        )),
    }
}
