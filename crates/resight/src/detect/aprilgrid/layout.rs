//! Selects the decoded tags that form one grid: each tag predicts the positions of the others.
//!
//! The homography of a tag's four corners predicts its neighbours to a fraction of a pitch, whereas a different layout (exchanged rows and
//! columns, tags printed in the other convention, a second grid beside the first) is off by a pitch or more. Tags that predict each other are
//! joined, so that the lens may bend the grid from one end to the other.

use super::super::apriltag::DecodedTag;
use super::super::homography::{Homography, PlanePoint};
use super::super::sigma;
use super::print::GridPrint;
use resight_core::Pixel;

/// How the decoded tags of an image relate to the grid.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Layout {
    /// The tags that have the layout of the grid; empty if there are none.
    Grid(Vec<DecodedTag>),
    /// The number of grids in view.
    Copies(usize),
    /// Most tags do not have the layout of the grid.
    Otherwise,
}

/// A tag agrees with another's prediction to within this share of their distance, in tag edges,
const AGREES: f64 = 0.35;
/// and within this many edges: a misread id or another layout is off by a pitch, which is more than one edge.
const AGREES_EDGES: f64 = 0.6;
/// A tag does not predict tags farther away than this, in tag edges, because its corners are not accurate enough.
const REACH_EDGES: f64 = 4.5;
/// A second group of at least this many tags is another grid; one alone is a separate tag, or misread.
const LEAST_OF_COPY: usize = 2;

/// Analyses tags of one border width; a position may have been read twice.
pub(super) fn of(tags: Vec<DecodedTag>, print: &GridPrint) -> Layout {
    let tags = one_a_place(tags);
    let mut groups = groups(&tags, print);
    groups.sort_by_key(|group| std::cmp::Reverse(group.len()));
    let Some(main) = groups.first().cloned() else { return Layout::Grid(tags) };
    let ids = |group: &[usize]| group.iter().map(|i| tags[*i].id).collect::<Vec<_>>();
    let known = ids(&main);
    let is_copy =
        |group: &&Vec<usize>| LEAST_OF_COPY <= group.len() && ids(group).iter().any(|id| known.contains(id));
    let n_copies = groups[1..].iter().filter(is_copy).count();
    if 0 < n_copies && LEAST_OF_COPY <= main.len() {
        return Layout::Copies(1 + n_copies);
    }
    // Beyond a gap, tags of the same grid have no decoded neighbour.
    let mut grid: Vec<usize> = main;
    for group in &groups[1..] {
        let fits = group.iter().all(|i| is_predicted(&tags, &grid, *i, print));
        if fits {
            grid.extend(group);
        }
    }
    let mut all = ids(&(0..tags.len()).collect::<Vec<_>>());
    all.sort_unstable();
    all.dedup();
    if 2 * grid.len() <= all.len() && 1 < all.len() {
        return Layout::Otherwise;
    }
    let mut grid: Vec<DecodedTag> = grid.into_iter().map(|i| tags[i]).collect();
    grid.sort_by_key(|tag| tag.id);
    Layout::Grid(grid)
}

/// Keeps the clearest of several readings of one square.
fn one_a_place(mut tags: Vec<DecodedTag>) -> Vec<DecodedTag> {
    tags.sort_by(|a, b| a.id.cmp(&b.id).then(b.margin_gray.total_cmp(&a.margin_gray)));
    let mut kept: Vec<DecodedTag> = Vec::with_capacity(tags.len());
    for tag in tags {
        let is_same = |other: &&DecodedTag| {
            (centre(other) - centre(&tag)).norm() < 0.5 * sigma::shortest_edge_px(&other.corners)
        };
        match kept.iter().position(|other| is_same(&other)) {
            Some(k) if kept[k].margin_gray < tag.margin_gray => kept[k] = tag,
            Some(_) => {}
            None => kept.push(tag),
        }
    }
    kept.sort_by(|a, b| a.id.cmp(&b.id).then(b.margin_gray.total_cmp(&a.margin_gray)));
    kept
}

fn centre(tag: &DecodedTag) -> Pixel {
    tag.corners.iter().sum::<Pixel>() / 4.0
}

/// Returns the centre of a tag on the grid, in tag edges.
fn place(id: u32, print: &GridPrint) -> PlanePoint {
    print.place(id, 3) + PlanePoint::new(0.5, 0.5)
}

fn pairs(tag: &DecodedTag, print: &GridPrint) -> [(PlanePoint, Pixel); 4] {
    [0, 1, 2, 3].map(|k: u8| (print.place(tag.id, k), tag.corners[k as usize]))
}

/// Returns groups of indices of tags that predict each other's positions.
fn groups(tags: &[DecodedTag], print: &GridPrint) -> Vec<Vec<usize>> {
    let maps: Vec<Option<Homography>> = tags.iter().map(|tag| Homography::fit(&pairs(tag, print))).collect();
    let mut group: Vec<usize> = (0..tags.len()).collect();
    for (i, j) in (0..tags.len()).flat_map(|i| (0..i).map(move |j| (i, j))) {
        let is_joined = tags[i].id != tags[j].id
            && (agrees(maps[i].as_ref(), &tags[i], &tags[j], print)
                || agrees(maps[j].as_ref(), &tags[j], &tags[i], print));
        if is_joined && group[i] != group[j] {
            let (from, to) = (group[i], group[j]);
            group.iter_mut().filter(|g| **g == from).for_each(|g| *g = to);
        }
    }
    let of = |g: usize| (0..tags.len()).filter(|i| group[*i] == g).collect::<Vec<usize>>();
    (0..tags.len()).map(of).filter(|members| !members.is_empty()).collect()
}

/// Checks whether one tag predicts all corners of another.
fn agrees(map: Option<&Homography>, from: &DecodedTag, to: &DecodedTag, print: &GridPrint) -> bool {
    let apart = (place(from.id, print) - place(to.id, print)).norm();
    let Some(map) = map.filter(|_| apart <= REACH_EDGES) else { return false };
    let edge_px = sigma::shortest_edge_px(&to.corners);
    pairs(to, print)
        .iter()
        .all(|(x, pixel)| (map.at(x) - pixel).norm() < (AGREES * apart).min(AGREES_EDGES) * edge_px)
}

/// Checks whether the nearest tags of a grid predict another tag to within half a pitch.
fn is_predicted(tags: &[DecodedTag], grid: &[usize], other: usize, print: &GridPrint) -> bool {
    let at = place(tags[other].id, print);
    let mut near: Vec<&DecodedTag> = grid.iter().map(|i| &tags[*i]).collect();
    near.sort_by(|a, b| {
        (place(a.id, print) - at).norm().total_cmp(&(place(b.id, print) - at).norm()).then(a.id.cmp(&b.id))
    });
    let known: Vec<(PlanePoint, Pixel)> =
        near.into_iter().take(4).flat_map(|tag| pairs(tag, print)).collect();
    let edge_px = sigma::shortest_edge_px(&tags[other].corners);
    Homography::fit(&known).is_some_and(|map| {
        pairs(&tags[other], print)
            .iter()
            .all(|(x, pixel)| (map.at(x) - pixel).norm() < AGREES_EDGES * edge_px)
    })
}
