//! Explains why a target was not found: which target was searched for, and what is in the image instead.
//!
//! All commands share this explanation. Each hint names a change of the target's file, or of the image, with which the target is found: before
//! the hint is printed, the search is run with that change. A match that chance explains (a code of 16 bits in a random square) is no hint.
//!
//! A search for other targets takes several searches of the whole image. It is therefore done when a user asks about one image, and only once in
//! a session of many images ([`Explainer`]).

mod charuco;
mod chessboard;
mod circles;
mod grid;
mod tags;

use super::Detector;
use super::dots::DotFinder;
use super::stop;
use crate::GrayImage;
use resight_core::Target;
use resight_core::target::LinePlusOne;

/// Explains in one sentence which target is not in the image, with its relevant number, and what is there instead.
///
/// Searches the whole image several times: use it for a single image, and [`missing`] for each frame of a sequence.
pub fn not_found(target: &Target, image: &GrayImage) -> String {
    match instead_of(target, image) {
        Some(seen) => format!("no {} in this image: {seen}", wanted(target)),
        None => format!("{}; check that all of it is visible, sharp and evenly lit", missing(target)),
    }
}

/// States which target is not in the image, without a search.
pub fn missing(target: &Target) -> String {
    format!("no {} in this image", wanted(target))
}

/// Explains only the first image of a session that does not show its target.
#[derive(Debug, Default)]
pub struct Explainer {
    is_spent: bool,
}

impl Explainer {
    /// Returns the message for an image without the target; `image` is called only where the image is searched for other targets. Images have to
    /// be given in their order, so that the explained one does not depend on threads.
    pub fn explain(&mut self, target: &Target, image: impl FnOnce() -> Option<GrayImage>) -> String {
        if std::mem::replace(&mut self.is_spent, true) {
            return missing(target);
        }
        image().map_or_else(|| missing(target), |image| not_found(target, &image))
    }
}

/// Names the target that was searched for.
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
        Target::CircleGrid(g) => circles::wanted(g),
        Target::LinePlusOne(_) => "target of three dots on a line and one off it".to_owned(),
        other => format!("{} target", other.kind()),
    }
}

fn last_id(first: u32, count: u32) -> u32 {
    first.saturating_add(count).saturating_sub(1)
}

/// Describes what an image shows instead of a target, with a remedy; `None` where nothing similar is found.
pub fn instead_of(target: &Target, image: &GrayImage) -> Option<String> {
    if super::is_blank(image) || stop::is_stopped() {
        return None;
    }
    let of_kind = match target.design() {
        Target::Tag(tag) => tags::instead(&tags::Wanted::of_tag(tag), image),
        Target::TagMap(map) => tags::instead(&tags::Wanted::of_map(map), image),
        Target::AprilGrid(grid) => grid::instead(grid, image),
        Target::Charuco(board) => charuco::instead(board, image),
        Target::Chessboard(board) => return chessboard::instead(board, image),
        Target::CircleGrid(grid) => circles::instead(grid, image).or_else(|| of_whole_image(target, image)),
        Target::LinePlusOne(dots) => other_dots(dots, image).or_else(|| of_whole_image(target, image)),
        _ => return None,
    };
    of_kind.or_else(|| chessboard::plain(image))
}

/// Counts the points of a target that an image shows.
fn n_points(target: &Target, image: &GrayImage) -> usize {
    Detector::new(target).and_then(|mut detector| detector.detect(image)).map_or(0, |found| found.len())
}

/// Checks whether the image shows enough of a target; by chance, another target yields only a few scattered points.
fn shows(target: &Target, image: &GrayImage) -> bool {
    let n = n_points(target, image);
    4 <= n && target.features().len().min(LEAST_POINTS) <= n
}

/// Number of points of a board that do not arise by chance: those of three tags, or as many corners.
const LEAST_POINTS: usize = 12;

/// Checks whether the mirrored or inverted image shows the target.
fn of_whole_image(target: &Target, image: &GrayImage) -> Option<String> {
    if shows(target, &mirrored(image)) {
        return Some(MIRRORED.to_owned());
    }
    shows(target, &inverted(image)).then(|| INVERTED.to_owned())
}

const MIRRORED: &str = "it is there mirrored; switch off the mirror mode of the camera, or print the target again without mirroring";
const INVERTED: &str = "it is there inverted, white on black; print it black on white, or invert the image";

/// Exchanges left and right.
fn mirrored(image: &GrayImage) -> GrayImage {
    let rows = image.data.chunks(image.width_px.max(1) as usize);
    GrayImage { data: rows.flat_map(|row| row.iter().rev().copied()).collect(), ..*image }
}

/// Exchanges black and white.
fn inverted(image: &GrayImage) -> GrayImage {
    GrayImage { data: image.data.iter().map(|gray| 255 - gray).collect(), ..*image }
}

/// Looks for dots that are not the target.
fn other_dots(target: &LinePlusOne, image: &GrayImage) -> Option<String> {
    let mirrored = mirrored(image);
    if 4 <= n_points(&Target::LinePlusOne(*target), &mirrored) {
        return Some(format!("{MIRRORED} (seen from behind, it looks the same)"));
    }
    let dots = DotFinder::default().dots(image).ok()?;
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
