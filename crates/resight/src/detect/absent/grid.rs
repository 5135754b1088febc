//! An AprilGrid that differs from the stated one: the ids and positions of its tags show its layout.

use super::tags::{self, Wanted, named};
use super::{INVERTED, MIRRORED, inverted, last_id, mirrored, shows};
use crate::GrayImage;
use crate::detect::every_tag::{EveryTagFinder, FamilyTags};
use crate::detect::homography::{Homography, PlanePoint};
use crate::detect::tags::FoundTag;
use resight_core::Target;
use resight_core::target::AprilGrid;

/// OpenCV's dictionaries hold the codes of AprilTag rotated by half a turn.
const TURNED: [(&str, &str); 3] = [
    ("tag36h11", "DICT_APRILTAG_36h11"),
    ("tag25h9", "DICT_APRILTAG_25h9"),
    ("tag16h5", "DICT_APRILTAG_16h5"),
];

/// Describes what an image shows instead of a grid.
pub(super) fn instead(grid: &AprilGrid, image: &GrayImage) -> Option<String> {
    let count = grid.rows * grid.columns;
    let wanted = Wanted {
        family: &grid.family,
        ids: (grid.first_id..=last_id(grid.first_id, count)).collect(),
        named: format!("ids {} to {}", grid.first_id, last_id(grid.first_id, count)),
        way_out: "their layout is not that of the file",
    };
    let whole = Target::AprilGrid(grid.clone());
    let mut finder = EveryTagFinder::new(&grid.family).ok()?;
    if let Some(own) = finder.find(image).first() {
        return Some(of_family(grid, &wanted, own, image));
    }
    if shows(&whole, &mirrored(image)) {
        return Some(MIRRORED.to_owned());
    }
    if shows(&whole, &inverted(image)) {
        return Some(INVERTED.to_owned());
    }
    let found = EveryTagFinder::new("any").ok()?.find(image);
    let of_other = |other: &FamilyTags| {
        let stated = AprilGrid { family: other.family.clone(), ..grid.clone() };
        let what = followed(grid, &stated, other, image)?;
        Some(format!(
            "no tag of {} is there, but tags of {} are: {}; {what}",
            grid.family,
            other.family,
            named(other)
        ))
    };
    found.iter().find_map(of_other).or_else(|| tags::instead(&wanted, image))
}

/// Returns the change of the file with which the grid is found; `stated` has the family of the tags that are there.
fn followed(grid: &AprilGrid, stated: &AprilGrid, tags: &FamilyTags, image: &GrayImage) -> Option<String> {
    let candidates = candidates(grid, stated, tags);
    let fits =
        |(other, _): &(AprilGrid, String)| *other != *grid && shows(&Target::AprilGrid(other.clone()), image);
    candidates.into_iter().find(fits).map(|(_, what)| what)
}

/// Tags of the right family were found, but other ids or another layout.
fn of_family(grid: &AprilGrid, wanted: &Wanted, own: &FamilyTags, image: &GrayImage) -> String {
    let has_wanted = own.tags.iter().any(|tag| wanted.ids.contains(&tag.id));
    if let Some(what) = followed(grid, grid, own, image) {
        let seen =
            if has_wanted { "its tags are there in another layout".to_owned() } else { none_of(wanted, own) };
        return format!("{seen}; {what}");
    }
    if !has_wanted {
        return none_of(wanted, own);
    }
    match Steps::of(&own.tags, 1.0 + grid.tag_spacing_ratio) {
        Some(Steps { right: 1, up }) if up < -1 => format!(
            "its tags are there, but numbered from the top row down ({} tags a row); a grid's ids run from the bottom row up, so give the tags as \
             kind `tag_map`, or print the grid with `resight print`",
            -up
        ),
        Some(Steps { right, up }) => format!(
            "its tags are there in another layout: the id grows by {right} to the right of a tag and by {up} above it, where 1 and {} are stated",
            grid.columns
        ),
        None => {
            format!("tags {} of it are there, too few or too unclear to tell where the grid is", named(own))
        }
    }
}

fn none_of(wanted: &Wanted, own: &FamilyTags) -> String {
    format!("tags of {} are there, but none with {}: {}", wanted.family, wanted.named, named(own))
}

/// Returns the grids that may have these tags, each with the change of the file that it needs. `stated` is the grid of the file, with the family of
/// the tags.
fn candidates(grid: &AprilGrid, stated: &AprilGrid, own: &FamilyTags) -> Vec<(AprilGrid, String)> {
    let ids = || own.tags.iter().map(|tag| tag.id);
    let (lowest, last) = (ids().min().unwrap_or(0), ids().max().unwrap_or(0));
    let is_stated = grid.first_id <= lowest && lowest < grid.first_id + grid.rows * grid.columns;
    let first_id = if is_stated { grid.first_id } else { lowest };
    let mut shapes = vec![[grid.rows, grid.columns], [grid.columns, grid.rows]];
    // In tags that are turned by half, the ids grow to the left and downwards.
    let steps = Steps::of(&own.tags, 1.0 + grid.tag_spacing_ratio);
    if let Some(Steps { right: 1 | -1, up }) = steps.filter(|steps| 1 < steps.right * steps.up) {
        let columns = up.unsigned_abs() as u32;
        shapes.push([(last - first_id) / columns + 1, columns]);
    }
    let mut all = Vec::new();
    for family in [Some(stated.family.as_str()), other_convention(&stated.family)].into_iter().flatten() {
        for [rows, columns] in &shapes {
            let family = family.to_owned();
            let other = AprilGrid { rows: *rows, columns: *columns, first_id, family, ..grid.clone() };
            let what = change(grid, stated, &other);
            all.push((other, what));
        }
    }
    all
}

/// Describes how to change the file of one grid into that of another.
fn change(grid: &AprilGrid, stated: &AprilGrid, other: &AprilGrid) -> String {
    let (mut causes, mut keys) = (Vec::new(), Vec::new());
    if other.family != stated.family {
        let by = if other.family.starts_with("DICT") { "OpenCV" } else { "AprilTag" };
        causes.push(format!("each tag is turned by half, as {by} prints them"));
    }
    if other.first_id != grid.first_id {
        keys.push(format!("`first_id` to {}", other.first_id));
    }
    if [other.rows, other.columns] != [grid.rows, grid.columns] {
        let is_exchanged = [other.rows, other.columns] == [grid.columns, grid.rows];
        causes.push(match is_exchanged {
            true => "rows and columns are exchanged".to_owned(),
            false => format!("it has {} tags a row", other.columns),
        });
        keys.push(format!("`rows` to {} and `columns` to {}", other.rows, other.columns));
    }
    if other.family != grid.family {
        keys.push(format!("`family` to {}", other.family));
    }
    let causes = if causes.is_empty() { String::new() } else { format!("{}: ", causes.join(", and ")) };
    format!("{causes}correct {}", keys.join(", "))
}

fn other_convention(family: &str) -> Option<&'static str> {
    let of = |(a, b): &(&'static str, &'static str)| match family {
        name if name == *a => Some(*b),
        name if name == *b => Some(*a),
        _ => None,
    };
    TURNED.iter().find_map(of)
}

/// The differences between the ids of a tag, of the tag on its right and of the tag above it, as seen with the tag upright.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Steps {
    right: i64,
    up: i64,
}

impl Steps {
    /// Returns the most common steps; `None` where too few tags have neighbours. `pitch` is in tag edges.
    fn of(tags: &[FoundTag], pitch: f64) -> Option<Self> {
        let (mut right, mut up) = (Vec::new(), Vec::new());
        for tag in tags {
            let square = [(0.0, 1.0), (1.0, 1.0), (1.0, 0.0), (0.0, 0.0)];
            let pairs: Vec<_> = square
                .iter()
                .zip(tag.corners)
                .map(|((x, y), u)| (PlanePoint::new(x - 0.5, y - 0.5), u))
                .collect();
            let Some(inverse) = Homography::fit(&pairs).and_then(|map| map.inverse()) else { continue };
            for other in tags {
                let centre = other.corners.iter().sum::<resight_core::Pixel>() / 4.0;
                let at = inverse.at(&centre) / pitch;
                let step = i64::from(other.id) - i64::from(tag.id);
                if (at - PlanePoint::new(1.0, 0.0)).norm() < NEXT {
                    right.push(step);
                } else if (at - PlanePoint::new(0.0, 1.0)).norm() < NEXT {
                    up.push(step);
                }
            }
        }
        Some(Steps { right: commonest(right)?, up: commonest(up)? })
    }
}

/// Largest distance between a neighbour and its expected position, in pitches; it has to allow for a wrongly stated spacing.
const NEXT: f64 = 0.35;

fn commonest(mut steps: Vec<i64>) -> Option<i64> {
    steps.sort_unstable();
    steps.chunk_by(|a, b| a == b).max_by_key(|same| same.len()).map(|same| same[0])
}
