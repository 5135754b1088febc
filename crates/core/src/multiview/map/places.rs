//! Where targets stand: at first one place for each neighbourhood in which a target is seen.
//!
//! Views of a target that are joined by other targets show it at one place. Where nothing else joins them, as before and after a round walk, they may
//! show two targets with one label; then each neighbourhood is a place of its own, until the adjustment shows that they agree. docs/math/map.md
//! section 2.

use super::{MapConfig, MapProblem};
use crate::multiview::rig::Groups;
use std::collections::BTreeMap;

/// A target at rest in some of the views.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Place {
    pub(super) target: usize,
    /// Indices of the problem's observations, ascending in view, at most one of each view.
    pub(super) observations: Vec<usize>,
}

/// The places of the targets that views join, and the others.
#[derive(Debug, Clone, Default)]
pub(super) struct Connected {
    /// The first is the reference's.
    pub(super) places: Vec<Place>,
    /// Observations of targets that a view shows more than once, in the map's group.
    pub(super) copies: Vec<usize>,
    /// Groups of targets not joined to the map.
    pub(super) groups: Vec<Vec<usize>>,
    /// For each target: the number of views that show it and no other target.
    pub(super) n_alone: Vec<usize>,
    /// Targets that alone join parts of the map.
    pub(super) bridges: Vec<usize>,
}

pub(super) fn connected(problem: &MapProblem, config: &MapConfig) -> Connected {
    let (views, copies) = views(problem);
    let mut connected = Connected { n_alone: vec![0; problem.n_targets], ..Connected::default() };
    let mut groups = Groups::new(problem.n_targets);
    let mut is_joined = vec![false; problem.n_targets];
    for shown in views.values() {
        let targets: Vec<usize> = shown.iter().map(|i| problem.observations[*i].target).collect();
        match targets[..] {
            [] => {}
            [only] => connected.n_alone[only] += 1,
            _ => {
                targets.windows(2).for_each(|pair| groups.join(pair[0], pair[1]));
                targets.iter().for_each(|t| is_joined[*t] = true);
            }
        }
    }
    let mut groups = groups.members();
    groups.iter_mut().for_each(|group| group.retain(|t| is_joined[*t]));
    groups.retain(|group| !group.is_empty());
    let Some(main) = main_group(&groups, config) else { return connected };
    let own = groups.remove(main);
    connected.groups = groups;
    let is_own = |i: &usize| own.binary_search(&problem.observations[*i].target).is_ok();
    connected.copies = copies.into_iter().filter(is_own).collect();
    let views: Vec<Vec<usize>> =
        views.into_values().filter(|shown| 1 < shown.len() && is_own(&shown[0])).collect();
    let split = own.iter().flat_map(|target| neighbourhoods(*target, &views, problem)).collect();
    (connected.places, connected.bridges) = rejoined(split, problem);
    let reference = config.reference.or(config.known.iter().map(|k| k.target).find(|t| own.contains(t)));
    bring_forward(&mut connected.places, reference);
    connected
}

/// Returns the observations of each view, one for each target, and those of targets that a view shows more than once.
fn views(problem: &MapProblem) -> (BTreeMap<usize, Vec<usize>>, Vec<usize>) {
    let mut order: Vec<usize> = (0..problem.observations.len()).collect();
    order.retain(|i| !problem.observations[*i].seen.is_empty());
    let key = |i: usize| (problem.observations[i].view, problem.observations[i].target);
    order.sort_by_key(|i| key(*i));
    let (mut views, mut copies) = (BTreeMap::<usize, Vec<usize>>::new(), Vec::new());
    for same in order.chunk_by(|a, b| key(*a) == key(*b)) {
        match same {
            [only] => views.entry(key(*only).0).or_default().push(*only),
            several => copies.extend(several),
        }
    }
    (views, copies)
}

/// Returns the group that becomes the map: the reference's, that with most known targets, or the largest.
fn main_group(groups: &[Vec<usize>], config: &MapConfig) -> Option<usize> {
    let with_reference = |group: &Vec<usize>| config.reference.is_some_and(|r| group.contains(&r));
    let n_known = |group: &Vec<usize>| config.known.iter().filter(|k| group.contains(&k.target)).count();
    let rank =
        |i: &usize| (with_reference(&groups[*i]), n_known(&groups[*i]), groups[*i].len(), usize::MAX - i);
    (0..groups.len()).max_by_key(rank)
}

/// Returns a place for each set of the target's views that other targets join.
fn neighbourhoods(target: usize, views: &[Vec<usize>], problem: &MapProblem) -> Vec<Place> {
    let target_of = |i: usize| problem.observations[i].target;
    let own: Vec<(usize, &Vec<usize>)> = views
        .iter()
        .filter_map(|shown| Some((*shown.iter().find(|i| target_of(**i) == target)?, shown)))
        .collect();
    let mut joined = Groups::new(problem.n_targets);
    let others = |shown: &Vec<usize>| -> Vec<usize> {
        shown.iter().map(|i| target_of(*i)).filter(|t| *t != target).collect()
    };
    for (_, shown) in &own {
        others(shown).windows(2).for_each(|pair| joined.join(pair[0], pair[1]));
    }
    let mut places: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for (observation, shown) in &own {
        if let Some(any) = others(shown).first() {
            places.entry(joined.root(*any)).or_default().push(*observation);
        }
    }
    places.into_values().map(|observations| Place { target, observations }).collect()
}

/// Joins places of one target again where without them the map would fall apart, those with most observations first.
fn rejoined(mut places: Vec<Place>, problem: &MapProblem) -> (Vec<Place>, Vec<usize>) {
    let mut bridges = Vec::new();
    loop {
        let mut groups = Groups::new(places.len());
        let mut first_of_view: BTreeMap<usize, usize> = BTreeMap::new();
        for (p, place) in places.iter().enumerate() {
            for i in &place.observations {
                groups.join(p, *first_of_view.entry(problem.observations[*i].view).or_insert(p));
            }
        }
        let mut best: Option<(usize, usize, usize)> = None;
        for a in 0..places.len() {
            for b in a + 1..places.len() {
                if places[a].target != places[b].target || groups.root(a) == groups.root(b) {
                    continue;
                }
                let n = places[a].observations.len().min(places[b].observations.len());
                if best.is_none_or(|(most, ..)| most < n) {
                    best = Some((n, a, b));
                }
            }
        }
        let Some((_, a, b)) = best else { return (places, bridges) };
        let gone = places.remove(b);
        bridges.push(gone.target);
        join(&mut places[a], gone, problem);
    }
}

/// Adds the observations of one place to another of the same target.
pub(super) fn join(place: &mut Place, other: Place, problem: &MapProblem) {
    place.observations.extend(other.observations);
    place.observations.sort_by_key(|i| (problem.observations[*i].view, *i));
}

/// Puts the place of the reference first: its frame is the map's. By default that of the first target with the most observations.
fn bring_forward(places: &mut [Place], reference: Option<usize>) {
    let n = |p: &Place| p.observations.len();
    let is_asked_for = |p: &Place| reference == Some(p.target);
    let rank = |i: &usize| (is_asked_for(&places[*i]), n(&places[*i]), usize::MAX - i);
    if let Some(first) = (0..places.len()).max_by_key(rank) {
        places[..=first].rotate_right(1);
    }
}
