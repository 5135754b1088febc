//! Kalibr target YAML, and Basalt's JSON duplicate of the aprilgrid.

use super::document::{Document, Fault};
use super::entry::Entry;
use super::{Format, TargetFormat};
use crate::core::Target;
use crate::core::target::{AprilGrid, Chessboard, CircleGrid};

pub(super) const FORMAT: TargetFormat = TargetFormat {
    format: Format::KalibrTarget,
    recognises: |document| {
        document.root.get("target_type").is_some() || document.root.get("tagSpacing").is_some()
    },
    read,
    traps: &[
        "In an aprilgrid tagSize is the outer edge of the black square in metres, tagSpacing the gap \
            divided by tagSize (a ratio, not metres).",
        "An aprilgrid keeps Kalibr's frame: origin at the bottom-left tag, x right, y up, z towards the \
            viewer. A checkerboard and a circlegrid have ours (y down, z into the surface), not Kalibr's.",
        "In a circlegrid spacingMeters is the distance between rows; circles of one row of an asymmetric grid are twice as far apart. \
            Points are the centres of the circles, not of their images.",
    ],
};

fn read(document: &Document) -> Result<(Target, Vec<String>), Fault> {
    let root = document.entry();
    let kind = root.get("target_type").map_or(Ok("aprilgrid"), |k| k.text())?;
    match kind {
        "aprilgrid" => aprilgrid(&root),
        "checkerboard" => checkerboard(&root),
        "circlegrid" => circlegrid(&root),
        other => Err(root.need("target_type")?.fault(format!(
            "unknown target_type `{other}`; aprilgrid, checkerboard and circlegrid are read"
        ))),
    }
}

fn aprilgrid(root: &Entry<'_>) -> Result<(Target, Vec<String>), Fault> {
    let grid = AprilGrid {
        family: "tag36h11".into(),
        rows: root.need("tagRows")?.side(1)?,
        columns: root.need("tagCols")?.side(1)?,
        tag_size_m: root.need("tagSize")?.number()?,
        tag_spacing_ratio: root.need("tagSpacing")?.number()?,
        first_id: 0,
    };
    let mut warnings = Vec::new();
    if 1.0 <= grid.tag_size_m {
        warnings.push(format!(
            "tagSize {} is read as metres; a tag of {} m is large",
            grid.tag_size_m, grid.tag_size_m
        ));
    }
    let ratio = grid.tag_spacing_ratio;
    if !(0.05..=1.0).contains(&ratio) {
        warnings.push(format!(
            "tagSpacing {ratio} is the gap divided by the tag size; usual boards have 0.2 to 0.3"
        ));
    }
    Ok((Target::AprilGrid(grid), warnings))
}

/// Kalibr's rows and columns count inner corners; its squares may be oblong, ours are square.
fn checkerboard(root: &Entry<'_>) -> Result<(Target, Vec<String>), Fault> {
    let (row, column) = (root.need("rowSpacingMeters")?, root.need("colSpacingMeters")?);
    let square_m = column.number()?;
    if row.number()? != square_m {
        return Err(row.fault(format!(
            "differs from colSpacingMeters ({square_m}); only boards of squares are supported"
        )));
    }
    let board = Chessboard {
        rows: root.need("targetRows")?.side(2)?,
        columns: root.need("targetCols")?.side(2)?,
        square_m,
    };
    Ok((Target::Chessboard(board), Vec::new()))
}

/// Kalibr's rows and columns are those of OpenCV; its file states no diameter.
fn circlegrid(root: &Entry<'_>) -> Result<(Target, Vec<String>), Fault> {
    let grid = CircleGrid {
        rows: root.need("targetRows")?.side(2)?,
        columns: root.need("targetCols")?.side(2)?,
        spacing_m: root.need("spacingMeters")?.number()?,
        diameter_m: None,
        asymmetric: root.get("asymmetricGrid").map_or(Ok(false), |flag| flag.flag())?,
    };
    Ok((Target::CircleGrid(grid), Vec::new()))
}
