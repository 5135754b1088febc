//! A chessboard that differs from the stated one: another number of corners, or tags in its squares.

use super::shows;
use super::tags::named;
use crate::GrayImage;
use crate::detect::chessboard::{ChessboardFinder, Outcome};
use crate::detect::every_tag::EveryTagFinder;
use crate::detect::joints::CornerWindow;
use resight_core::Target;
use resight_core::target::Chessboard;

/// Describes what an image shows instead of a board.
pub(super) fn instead(board: &Chessboard, image: &GrayImage) -> Option<String> {
    tags_on_board(image).or_else(|| other_grid(board, image))
}

/// Looks for a plain chessboard where a target of another kind should be.
pub(super) fn plain(image: &GrayImage) -> Option<String> {
    let any = Chessboard { rows: 6, columns: 9, square_m: 0.03 };
    let (rows, columns) = ChessboardFinder::new(&any, CornerWindow::Clear).ok()?.largest_grid(image)?;
    let (rows, columns) = (rows.min(columns) as u32, rows.max(columns) as u32);
    shows(&Target::Chessboard(Chessboard { rows, columns, ..any }), image).then(|| {
        format!(
            "a chessboard of {rows} × {columns} inner corners is there: its target has `kind = \"chessboard\"`, `rows = {rows}`, `columns = {columns}` and `square_m`"
        )
    })
}

/// Looks for a chessboard of another size.
fn other_grid(board: &Chessboard, image: &GrayImage) -> Option<String> {
    let finder = ChessboardFinder::new(board, CornerWindow::Clear).ok()?;
    let (places, rows, columns) = match finder.look(image) {
        Outcome::Part { columns, rows, places } => (places, rows.min(columns), rows.max(columns)),
        _ => {
            let (rows, columns) = finder.largest_grid(image)?;
            (0, rows as u32, columns as u32)
        }
    };
    let wanted = (board.rows.min(board.columns), board.rows.max(board.columns));
    let seen = format!("a grid of {rows} × {columns} inner corners is there");
    // A part of the board has no edges on some sides, and is not a board of another size.
    let is_whole = places == 0
        && (rows, columns) != wanted
        && shows(&Target::Chessboard(Chessboard { rows, columns, ..*board }), image);
    let hint = if is_whole && wanted == (rows + 1, columns + 1) {
        "rows and columns count inner corners, one less than squares".to_owned() // Squares were counted.
    } else if is_whole {
        format!("rows and columns count inner corners: correct them to {rows} and {columns}")
    } else if 0 < places {
        format!(
            "it could be any of {places} parts of the {} × {} board; show the white margin on enough of its sides, or all of it; if this is all of it, correct rows and columns, which count inner corners, to {rows} and {columns}",
            wanted.0, wanted.1
        )
    } else {
        "where the board ends does not show; show all of it with its white margin, sharp and evenly lit"
            .to_owned()
    };
    Some(format!("{seen}; {hint}"))
}

/// Fewer tags than this do not indicate a board.
const LEAST_TAGS: usize = 3;

/// Looks for tags in the squares of a board that should be a plain chessboard.
fn tags_on_board(image: &GrayImage) -> Option<String> {
    let found = EveryTagFinder::new("any").ok()?.find(image);
    let most = found.first().filter(|most| LEAST_TAGS <= most.tags.len())?;
    Some(format!(
        "tags of {} are there: {}; a board with tags in its squares is of kind `charuco`, tags beside each other one of kind `aprilgrid`",
        most.family,
        named(most)
    ))
}
