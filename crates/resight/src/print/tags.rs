//! Arranges a range of tags on one sheet, as a map of tags.

use crate::error::Error;
use crate::render::family::cells;
use resight_core::target::{MapTag, TagMap};
use resight_core::{Point, Pose, Target};

/// More tags than a family has.
const MOST_TAGS: u32 = 10_000;
/// White between the rims of neighbouring tags, in sizes: room for the number below each.
const BETWEEN_RIMS: f64 = 0.15;

/// Returns a sheet of tags with ids from `first` to `last`, row by row in `columns` columns (by default about square), with gaps of
/// `spacing_ratio` times the size (by default as much as their white rims need). The frame is that of the first tag.
///
/// # Errors
/// Unknown families and ids; invalid sizes; a gap that leaves the rims no room.
pub fn sheet_of_tags(
    family: &str,
    (first, last): (u32, u32),
    size_m: f64,
    columns: Option<u32>,
    spacing_ratio: Option<f64>,
) -> Result<Target, Error> {
    let count = last.checked_sub(first).filter(|n| *n < MOST_TAGS).map(|n| n + 1).ok_or_else(|| {
        Error::request(format!(
            "ids {first} to {last}: the last is not below the first, and a sheet has at most {MOST_TAGS} tags"
        ))
    })?;
    let known = |id: u32| cells(family, id).map_err(|e| Error::request(e.to_string()));
    let tag = known(first)?;
    known(last)?;
    if !(0.0 < size_m && size_m.is_finite()) {
        return Err(Error::request(format!("size_m is {size_m}; it must be positive, in metres")));
    }
    // The cells outside the square of width size_m, on both sides.
    let rims = (tag.per_side - tag.per_size) as f64 / tag.per_size as f64;
    let spacing = spacing_ratio.unwrap_or(rims + BETWEEN_RIMS);
    // White rims may overlap, as on OpenCV's GridBoard: one cell between two black frames is enough for a detector.
    let needed = if tag.has_black_frame() { 1.0 / tag.per_size as f64 } else { rims };
    let possible = needed <= spacing && spacing.is_finite();
    if !possible {
        return Err(Error::request(format!(
            "tag_spacing_ratio is {spacing}; a tag of {family} needs {needed:.3} between two of them"
        )));
    }
    let columns = columns.unwrap_or_else(|| f64::from(count).sqrt().ceil() as u32).clamp(1, count);
    let pitch_m = size_m * (1.0 + spacing);
    let tags = (0..count).map(|i| MapTag {
        id: first + i,
        size_m,
        world_from_tag: Pose::new(
            nalgebra::Matrix3::identity(),
            Point::new(f64::from(i % columns) * pitch_m, f64::from(i / columns) * pitch_m, 0.0),
        ),
        sigma_m: 0.0,
        sigma_rad: 0.0,
    });
    Ok(Target::TagMap(TagMap { family: family.to_owned(), tags: tags.collect(), joint_covariance: None }))
}
