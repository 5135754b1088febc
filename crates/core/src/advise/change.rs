//! Changes of a target's dimensions, one at a time: which of them help?

use super::expect::Optics;
use super::volume::{Outlook, Shape, Volume, outlook, poses};
use crate::target::{LinePlusOne, Target};

/// A target with one dimension changed; keys as in target.toml.
#[derive(Debug, Clone, PartialEq)]
pub struct Change {
    /// The dimension that is changed.
    pub key: &'static str,
    /// Its current value.
    pub from: f64,
    /// Its value in `target`.
    pub to: f64,
    /// The changed target.
    pub target: Target,
    /// Whether it becomes larger, and may not fit its location or the image.
    pub enlarges_target: bool,
}

/// Returns the changes worth trying for a kind of target as designed (the changed one is not printed yet); none for surveyed points and tag
/// maps.
pub fn changes(target: &Target) -> Vec<Change> {
    match target.design() {
        Target::LinePlusOne(t) => line_changes(t),
        Target::Tag(t) => {
            scaled("size_m", t.size_m, |to| Target::Tag(crate::target::Tag { size_m: to, ..t.clone() }))
        }
        Target::AprilGrid(t) => scaled("tag_size_m", t.tag_size_m, |to| {
            Target::AprilGrid(crate::target::AprilGrid { tag_size_m: to, ..t.clone() })
        }),
        Target::Chessboard(t) => {
            let mut found = scaled("square_m", t.square_m, |to| {
                Target::Chessboard(crate::target::Chessboard { square_m: to, ..*t })
            });
            let columns = t.columns + t.columns / 2;
            let to = Target::Chessboard(crate::target::Chessboard { columns, ..*t });
            found.push(change("columns", t.columns.into(), columns.into(), to, true));
            found
        }
        Target::Charuco(t) => scaled("square_m", t.square_m, |to| {
            let marker_m = t.marker_m * to / t.square_m;
            Target::Charuco(crate::target::Charuco { square_m: to, marker_m, ..t.clone() })
        }),
        Target::CircleGrid(t) => scaled("spacing_m", t.spacing_m, |to| {
            let diameter_m = t.diameter_m.map(|diameter| diameter * to / t.spacing_m);
            Target::CircleGrid(crate::target::CircleGrid { spacing_m: to, diameter_m, ..*t })
        }),
        _ => Vec::new(),
    }
}

fn change(key: &'static str, from: f64, to: f64, target: Target, enlarges_target: bool) -> Change {
    Change { key, from, to, target, enlarges_target }
}

fn scaled(key: &'static str, from: f64, with: impl Fn(f64) -> Target) -> Vec<Change> {
    [1.5, 2.0].iter().map(|factor| change(key, from, from * factor, with(from * factor), true)).collect()
}

/// Moves the fourth dot along the line and away from it, moves the middle dot, and extends the line.
fn line_changes(t: &LinePlusOne) -> Vec<Change> {
    let low = t.line_m.iter().copied().fold(f64::INFINITY, f64::min);
    let high = t.line_m.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let length = high - low;
    let middle = t.line_m.iter().position(|x| low < *x && *x < high).unwrap_or(1);
    let mut found = Vec::new();
    let mut push = |key, from: f64, to: f64, changed: LinePlusOne, enlarges_target| {
        if 1e-6 * length < (to - from).abs() {
            found.push(change(key, from, to, Target::LinePlusOne(changed), enlarges_target));
        }
    };
    for part in [-0.25, 0.0, 0.25, 0.75, 1.0, 1.25] {
        let to = low + part * length;
        let enlarges_target = !(0.0..=1.0).contains(&part);
        push("off_m[0]", t.off_m[0], to, LinePlusOne { off_m: [to, t.off_m[1]], ..*t }, enlarges_target);
    }
    for factor in [1.5, 2.0] {
        let to = t.off_m[1] * factor;
        push("off_m[1]", t.off_m[1], to, LinePlusOne { off_m: [t.off_m[0], to], ..*t }, true);
    }
    for part in [0.4, 0.6] {
        let mut line_m = t.line_m;
        line_m[middle] = low + part * length;
        push("line_m, the middle one", t.line_m[middle], line_m[middle], LinePlusOne { line_m, ..*t }, false);
    }
    for factor in [1.5, 2.0] {
        let along = |x: f64| low + (x - low) * factor;
        let to = LinePlusOne { line_m: t.line_m.map(along), off_m: [along(t.off_m[0]), t.off_m[1]] };
        push("line_m, its length", length, length * factor, to, true);
    }
    found
}

/// A change and its effect.
#[derive(Debug, Clone, PartialEq)]
pub struct Tried {
    /// The change.
    pub change: Change,
    /// Its outlook over views of the same volume, moved towards the image's centre as far as the changed target requires.
    pub outlook: Outlook,
}

/// Tries every change over `n` views of the volume; sorted by [`cost`], the best first.
pub fn tried(target: &Target, optics: &Optics, volume: &Volume, n: usize) -> Vec<Tried> {
    let one = |change: Change| {
        let shape = Shape::of(&change.target);
        Tried { outlook: outlook(&shape, optics, &poses(&shape, optics.camera, volume, n)), change }
    };
    let mut all: Vec<Tried> = changes(target).into_iter().map(one).collect();
    all.sort_by(|a, b| cost(&a.outlook).total_cmp(&cost(&b.outlook)));
    all
}

/// Returns the cost of a target over a volume: the median uncertainty of the camera's position divided by the share of views with one answer;
/// infinite where there is none.
pub fn cost(outlook: &Outlook) -> f64 {
    let views = outlook.n_views.max(1) as f64;
    let seen = 1.0 - (outlook.n_out_of_view + outlook.n_undetermined) as f64 / views;
    let usable = seen * (1.0 - outlook.ambiguous);
    outlook.position_m.map_or(f64::INFINITY, |place| place.median / usable.max(1e-9))
}
