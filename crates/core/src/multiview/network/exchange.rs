//! Two exchanged labels of one photograph: tried where a network contradicts itself, and named where the exchange makes everything agree.

use super::{Adjusted, Constraint, NetworkProblem};

/// Two points of a photograph whose labels are exchanged.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Exchange {
    /// Index of the photograph.
    pub photo: usize,
    /// Index of one point.
    pub a: usize,
    /// Index of the other point.
    pub b: usize,
}

/// The number of pairs of labels that are tried: each is a whole adjustment.
const MOST_PAIRS: usize = 30;
/// Two exchanges whose χ² differ by less than this cannot be distinguished.
const TIED_CHI2: f64 = 9.0;

/// Two image points of one photograph: constraint, photograph, point.
struct Pair {
    first: (usize, usize, usize),
    second: (usize, usize, usize),
    n_control_points: usize,
    n_suspected: usize,
}

/// Returns the network with those two labels exchanged that make everything agree; none where no exchange or several of them do. `suspected` are
/// constraints that may be wrong; `is_explained` says that one of them alone explains the contradiction, so that only exchanges with it are
/// tried. `agreed` solves a network and returns it where its constraints agree.
pub(super) fn exchanged(
    network: &NetworkProblem,
    suspected: &[usize],
    is_explained: bool,
    agreed: impl Fn(&NetworkProblem) -> Option<Adjusted>,
) -> Option<Adjusted> {
    let mut pairs = pairs(network, suspected);
    pairs.retain(|pair| !is_explained || 0 < pair.n_suspected);
    // Control points come first because they determine the pose of the photograph.
    pairs.sort_by_key(|pair| (2 - pair.n_control_points, 2 - pair.n_suspected));
    pairs.truncate(MOST_PAIRS);
    let attempt = |pair: &Pair| {
        let mut constraints = network.constraints.to_vec();
        exchange(&mut constraints, pair.first.0, pair.second.0);
        let found = agreed(&NetworkProblem { constraints: &constraints, ..*network })?;
        let (a, b) = (pair.first.2.min(pair.second.2), pair.first.2.max(pair.second.2));
        let exchanged = Some(Exchange { photo: pair.first.1, a, b });
        Some(Adjusted { exchanged, is_inconsistent: true, ..found })
    };
    let mut tiers = pairs.chunk_by(|a, b| a.n_control_points == b.n_control_points);
    let mut found: Vec<Adjusted> = tiers.find_map(|tier| {
        let found: Vec<Adjusted> = tier.iter().filter_map(attempt).collect();
        (!found.is_empty()).then_some(found)
    })?;
    found.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let is_alone = found.get(1).is_none_or(|second| found[0].chi2 + TIED_CHI2 < second.chi2);
    found.into_iter().next().filter(|_| is_alone)
}

fn pairs(network: &NetworkProblem, suspected: &[usize]) -> Vec<Pair> {
    let image_points: Vec<(usize, usize, usize)> =
        network.constraints.iter().enumerate().filter_map(image_point).collect();
    let is_control_point = |p: usize| {
        let mut of_point = network.constraints.iter().filter(|f| f.points().contains(&Some(p)));
        of_point.any(|f| matches!(f, Constraint::Place { .. } | Constraint::Distance { .. }))
    };
    let count = |is: &dyn Fn(&(usize, usize, usize)) -> bool, both: [&(usize, usize, usize); 2]| {
        both.into_iter().filter(|point| is(point)).count()
    };
    let pair = |first: &(usize, usize, usize), second: &(usize, usize, usize)| Pair {
        first: *first,
        second: *second,
        n_control_points: count(&|point| is_control_point(point.2), [first, second]),
        n_suspected: count(&|point| suspected.contains(&point.0), [first, second]),
    };
    let of_first = |(n, first): (usize, &(usize, usize, usize))| -> Vec<Pair> {
        let others = image_points[n + 1..].iter().filter(|other| other.1 == first.1 && other.2 != first.2);
        others.map(|second| pair(first, second)).collect()
    };
    image_points.iter().enumerate().flat_map(of_first).collect()
}

/// Returns index, photograph and point of an image point.
fn image_point((index, constraint): (usize, &Constraint)) -> Option<(usize, usize, usize)> {
    match constraint {
        Constraint::ImagePoint { photo, point, .. } => Some((index, *photo, *point)),
        _ => None,
    }
}

fn exchange(constraints: &mut [Constraint], first: usize, second: usize) {
    let pixel_of = |constraint: &Constraint| match constraint {
        Constraint::ImagePoint { pixel, .. } => Some(*pixel),
        _ => None,
    };
    let pixels = [pixel_of(&constraints[second]), pixel_of(&constraints[first])];
    for (index, new) in [first, second].into_iter().zip(pixels) {
        if let (Constraint::ImagePoint { pixel, .. }, Some(new)) = (&mut constraints[index], new) {
            *pixel = new;
        }
    }
}
