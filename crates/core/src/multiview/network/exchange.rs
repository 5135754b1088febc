//! Two exchanged labels of one photograph: tried where a network contradicts itself, and named where everything then agrees.

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

/// The number of pairs of labels that are tried.
const MOST_PAIRS: usize = 60;
/// Two exchanges whose χ² differ by less than this cannot be distinguished.
const TIED_CHI2: f64 = 9.0;

/// Returns the network with those two labels exchanged that make everything agree; none where no exchange or several of them do. `agreed` solves a
/// network and returns it where its constraints agree.
pub(super) fn exchanged(
    network: &NetworkProblem,
    agreed: impl Fn(&NetworkProblem) -> Option<Adjusted>,
) -> Option<Adjusted> {
    let clicks: Vec<(usize, usize, usize)> =
        network.constraints.iter().enumerate().filter_map(click).collect();
    let is_known = |p: usize| {
        let mut of_point = network.constraints.iter().filter(|f| f.points().contains(&Some(p)));
        of_point.any(|f| matches!(f, Constraint::Place { .. } | Constraint::Distance { .. }))
    };
    let pairs = clicks.iter().enumerate().flat_map(|(n, first)| {
        clicks[n + 1..]
            .iter()
            .filter(|second| second.1 == first.1 && second.2 != first.2)
            .map(move |s| (*first, *s))
    });
    // Control points first: they determine the pose of the photograph.
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_by_key(|(first, second)| 2 - usize::from(is_known(first.2)) - usize::from(is_known(second.2)));
    let tried = pairs.into_iter().take(MOST_PAIRS).filter_map(|(first, second)| {
        let mut constraints = network.constraints.to_vec();
        exchange(&mut constraints, first.0, second.0);
        let with = NetworkProblem { constraints: &constraints, ..*network };
        let found = agreed(&with)?;
        let exchange = Exchange { photo: first.1, a: first.2.min(second.2), b: first.2.max(second.2) };
        Some(Adjusted { exchanged: Some(exchange), is_inconsistent: true, ..found })
    });
    let mut found: Vec<Adjusted> = tried.collect();
    found.sort_by(|a, b| a.chi2.total_cmp(&b.chi2));
    let is_alone = found.get(1).is_none_or(|second| found[0].chi2 + TIED_CHI2 < second.chi2);
    found.into_iter().next().filter(|_| is_alone)
}

/// Returns index, photograph and point of an image point.
fn click((index, constraint): (usize, &Constraint)) -> Option<(usize, usize, usize)> {
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
