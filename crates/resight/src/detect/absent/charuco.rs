//! A ChArUco board that differs from the stated one: exchanged rows and columns, the other pattern, another marker size or dictionary.

use super::tags::{self, Wanted, named};
use super::{last_id, shows};
use crate::GrayImage;
use crate::detect::every_tag::{EveryTagFinder, FamilyTags};
use crate::detect::homography::{Homography, PlanePoint};
use crate::detect::tags::FoundTag;
use resight_core::target::Charuco;
use resight_core::{Pixel, Target};

/// Describes what an image shows instead of a board.
pub(super) fn instead(board: &Charuco, image: &GrayImage) -> Option<String> {
    let count = board.rows * board.columns / 2;
    let wanted = Wanted {
        family: &board.dictionary,
        ids: (0..count).collect(),
        named: format!("ids 0 to {} where the board has them", last_id(0, count)),
        way_out: "correct `dictionary`",
    };
    let own = EveryTagFinder::new(&board.dictionary).ok()?.find(image).into_iter().next();
    let other = match &own {
        Some(_) => None,
        None => EveryTagFinder::new("any").ok()?.find(image).into_iter().next(),
    };
    let Some(markers) = own.as_ref().or(other.as_ref()) else { return tags::instead(&wanted, image) };
    let stated = Charuco { dictionary: dictionary_of(board, markers), ..board.clone() };
    let seen = match &other {
        Some(other) => format!(
            "no tag of {} is there, but tags of {} are: {}",
            board.dictionary,
            other.family,
            named(other)
        ),
        None => format!("markers of {} are there: {}", board.dictionary, named(markers)),
    };
    let fits =
        |(found, _): &(Charuco, String)| *found != *board && shows(&Target::Charuco(found.clone()), image);
    if let Some((found, what)) = candidates(&stated, markers).into_iter().find(fits) {
        let is_other = found.dictionary != board.dictionary;
        let seen = if is_other { format!("{seen}; correct `dictionary`") } else { seen };
        return Some(if what.is_empty() { seen } else { format!("{seen}; the board is found with {what}") });
    }
    Some(match other {
        Some(_) => format!(
            "{seen}; they are not markers of such a board (tags beside each other are of kind `aprilgrid`)"
        ),
        None => format!(
            "tags of {} are there, but none with {}: {}",
            board.dictionary,
            wanted.named,
            named(markers)
        ),
    })
}

/// Returns the stated dictionary if its markers were found, else the dictionary of the markers that were.
fn dictionary_of(board: &Charuco, markers: &FamilyTags) -> String {
    if markers.family.starts_with("DICT") { markers.family.clone() } else { board.dictionary.clone() }
}

/// Returns the boards that may have these markers, each with the change of the file that it needs; the stated one first.
fn candidates(board: &Charuco, markers: &FamilyTags) -> Vec<(Charuco, String)> {
    let (rows, columns) = (board.rows, board.columns);
    let swapped = Charuco { rows: columns, columns: rows, ..board.clone() };
    let other_pattern = |board: &Charuco| Charuco { legacy_pattern: !board.legacy_pattern, ..board.clone() };
    let pattern = format!("`legacy_pattern` {}", !board.legacy_pattern);
    let exchanged = format!("rows and columns exchanged: `rows` {columns}, `columns` {rows}");
    let mut all = vec![
        (board.clone(), String::new()),
        (swapped.clone(), exchanged.clone()),
        (other_pattern(board), pattern.clone()),
        (other_pattern(&swapped), format!("{exchanged}, {pattern}")),
    ];
    let shape = Shape::of(&markers.tags);
    if let Some(columns) = shape.columns {
        let last = markers.tags.iter().map(|tag| tag.id).max().unwrap_or(0);
        let rows = (2 * (last + 1)).div_ceil(columns);
        let other = Charuco { rows, columns, ..board.clone() };
        let what = format!("`rows` {rows} and `columns` {columns}");
        all.push((other_pattern(&other), format!("{what}, {pattern}")));
        all.push((other, what));
    }
    let Some(ratio) = shape.marker_squares else { return all };
    // A view determines the ratio to half a per cent of a square.
    let marker_m = (200.0 * ratio).round() / 200.0 * board.square_m;
    let with_marker = |(other, what): &(Charuco, String)| {
        let what = if what.is_empty() { String::new() } else { format!("{what}, ") };
        (Charuco { marker_m, ..other.clone() }, format!("{what}`marker_m` about {}", rounded(marker_m)))
    };
    let resized: Vec<_> = all.iter().map(with_marker).collect();
    all.extend(resized);
    all
}

/// Rounds to three significant figures.
fn rounded(x: f64) -> String {
    let scale = 10f64.powi(2 - x.abs().log10().floor() as i32);
    format!("{}", (x * scale).round() / scale)
}

/// Properties of the board that follow from the markers alone.
struct Shape {
    /// Squares per row: the difference between the ids of a marker and the one two squares below.
    columns: Option<u32>,
    /// Edge of a marker divided by the edge of a square.
    marker_squares: Option<f64>,
}

impl Shape {
    fn of(tags: &[FoundTag]) -> Self {
        let frames: Vec<Option<Homography>> = tags.iter().map(frame).collect();
        let centre = |tag: &FoundTag| tag.corners.iter().sum::<Pixel>() / 4.0;
        // The nearest marker on the diagonal is one square to the right and one down, in marker edges 1 / ratio each.
        let mut ratios = Vec::new();
        for (tag, frame) in tags.iter().zip(&frames) {
            let Some(frame) = frame else { continue };
            let places = tags.iter().filter(|other| other.id != tag.id).map(|other| frame.at(&centre(other)));
            let is_diagonal =
                |at: &PlanePoint| (at.x.abs() - at.y.abs()).abs() < 0.2 * at.x.abs().max(at.y.abs());
            let nearest = places.filter(is_diagonal).map(|at| 0.5 * (at.x.abs() + at.y.abs()));
            ratios
                .extend(nearest.reduce(f64::min).map(f64::recip).filter(|ratio| (0.2..1.0).contains(ratio)));
        }
        let ratio = median(ratios);
        let mut steps = Vec::new();
        for ((tag, frame), ratio) in tags.iter().zip(&frames).filter_map(|pair| Some((pair, ratio?))) {
            let Some(frame) = frame else { continue };
            let below = PlanePoint::new(0.0, 2.0 / ratio);
            let is_below = |other: &&FoundTag| (frame.at(&centre(other)) - below).norm() < 0.5 / ratio;
            steps.extend(tags.iter().find(is_below).map(|other| f64::from(other.id) - f64::from(tag.id)));
        }
        let columns = median(steps).filter(|step| (2.0..1000.0).contains(step)).map(|step| step as u32);
        Shape { columns, marker_squares: ratio }
    }
}

/// Returns the map from the image to the plane of a marker, in its edges, with the origin at its centre and y down.
fn frame(tag: &FoundTag) -> Option<Homography> {
    let square = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];
    let pairs: Vec<_> =
        square.iter().zip(tag.corners).map(|((x, y), pixel)| (PlanePoint::new(*x, *y), pixel)).collect();
    Homography::fit(&pairs)?.inverse()
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied()
}
