//! What is in an image that does not show the target looked for: other ids of a tag's family, tags of another family, or a part of a
//! chessboard whose place in the board does not show.

use super::chessboard::{ChessboardFinder, Outcome};
use super::joints::CornerWindow;
use super::tags::TagFinder;
use crate::GrayImage;
use resight_core::Target;
use resight_core::target::Chessboard;

/// Families in common use, tried in this order where the right one shows no tag.
const FAMILIES: [&str; 3] = ["tag36h11", "tag25h9", "tag16h5"];
/// Ids named in a sentence.
const MOST_NAMED: usize = 8;

/// Which tags an image shows instead of those of a target, or which part of a chessboard, in a sentence; none for other targets and where
/// nothing of that kind is seen. A search of the whole image for each family: for images in which the target was not found.
pub fn instead_of(target: &Target, image: &GrayImage) -> Option<String> {
    let (family, what, is_map) = match target {
        Target::Tag(tag) => (tag.family.as_str(), format!("id {}", tag.id), false),
        Target::TagMap(map) => (map.family.as_str(), "an id of the map".to_owned(), true),
        Target::Chessboard(board) => return part_of(board, image),
        _ => return None,
    };
    if let Some(ids) = ids(family, image) {
        return Some(format!("tags of {family} are there, but none with {what}: {ids}"));
    }
    let others = FAMILIES.iter().filter(|other| **other != family);
    let (other, ids) = others.filter_map(|other| Some((other, ids(other, image)?))).next()?;
    let way_out =
        if is_map { "state the family in the map, or with --tag-family" } else { "correct `family`" };
    Some(format!("no tag of {family} is there, but tags of {other} are: {ids}; {way_out}"))
}

/// Which part of a board is seen whose place is not known.
fn part_of(board: &Chessboard, image: &GrayImage) -> Option<String> {
    let Outcome::Part { columns, rows, places } =
        ChessboardFinder::new(board, CornerWindow::Clear).ok()?.look(image)
    else {
        return None;
    };
    Some(format!(
        "{columns} × {rows} corners of a checker pattern are there, which could be any of {places} parts of the {} × {} board; show the white \
         margin on enough of its sides, or all of it",
        board.columns, board.rows
    ))
}

/// The ids of a family that an image shows; none where it shows no tag of it or the family is unknown.
fn ids(family: &str, image: &GrayImage) -> Option<String> {
    let found = TagFinder::new(family).ok()?.find(image);
    let mut ids: Vec<u32> = found.iter().map(|tag| tag.id).collect();
    ids.dedup();
    let named: Vec<String> = ids.iter().take(MOST_NAMED).map(u32::to_string).collect();
    let more = if MOST_NAMED < ids.len() { ", …" } else { "" };
    (!ids.is_empty()).then(|| format!("{}{more}", named.join(", ")))
}
