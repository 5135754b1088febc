//! A circle grid that differs from the stated one: another number of rows or columns, or the other kind of grid.

use super::shows;
use crate::GrayImage;
use crate::detect::circles::CircleFinder;
use resight_core::Target;
use resight_core::target::CircleGrid;

/// Names the grid that was searched for.
pub(super) fn wanted(grid: &CircleGrid) -> String {
    format!("circle grid ({}, spacing_m {})", named(grid), grid.spacing_m)
}

fn named(grid: &CircleGrid) -> String {
    let kind = if grid.asymmetric { "asymmetric" } else { "symmetric" };
    format!("{kind}, {} rows × {} columns", grid.rows, grid.columns)
}

/// Describes the grid that an image shows instead; `None` where it shows none.
pub(super) fn instead(grid: &CircleGrid, image: &GrayImage) -> Option<String> {
    let (seen, is_all) = CircleFinder::new(grid).largest_grid(image)?;
    let (rows, columns) = (seen.rows, seen.columns);
    let there = format!("a grid of circles is there ({})", named(&seen));
    if !is_all || !shows(&Target::CircleGrid(seen), image) {
        return Some(format!(
            "{there}; where it ends does not show: show all of it with a white margin as wide as its spacing"
        ));
    }
    let way_out = if seen == *grid {
        return None;
    } else if seen.asymmetric != grid.asymmetric {
        format!("correct the target: asymmetric = {}, rows = {rows}, columns = {columns}", seen.asymmetric)
    } else if (rows, columns) == (grid.columns, grid.rows) {
        format!("rows and columns are exchanged: correct them to {rows} and {columns}")
    } else {
        format!("correct rows and columns, which count circles, to {rows} and {columns}")
    };
    Some(format!("{there}; {way_out}"))
}
