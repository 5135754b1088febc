//! Which single fact is wrong, where everything together contradicts itself or cannot be solved: docs/math/survey.md eq. (23).
//!
//! Each distance is tried with its decimal point moved, then each fact in question is taken out. What explains everything is named, and
//! the places are found without it.

use super::arrange::{Depth, best_of};
use super::solve::settle;
use super::starts::{Draft, marks};
use super::{Adjusted, DecimalSlip, Fact, Frame, Item, Survey, Suspect, snoop, spread};
use crate::Error;

/// Where a decimal point is put by mistake: one place first, then two or three.
const SLIPS: [&[i32]; 2] = [&[1, -1], &[2, -2, 3, -3]];
/// Facts taken out one by one.
const MOST_REMOVED: usize = 40;
/// Suspects of the whole survey that are taken out one by one.
const MOST_SUSPECTS: usize = 6;
/// Two explanations whose χ² differ by less than this cannot be told apart.
const TIED_CHI2: f64 = 9.0;
/// What the others foresee must contradict the fact by this many standard deviations.
const LEAST_SIGMAS: f64 = 4.0;
/// A distance slipped if it is the foreseen one times a power of ten to this part, or to five standard deviations.
const SLIP_TOLERANCE: f64 = 0.03;

/// A survey without one fact, and what it says of that fact.
struct Explanation {
    suspect: Suspect,
    without: Adjusted,
}

/// The best of all arrangements of a survey.
pub(super) fn attempt(survey: &Survey, depth: Depth) -> Result<Adjusted, Error> {
    best_of(survey, &marks(survey)?, depth)
}

/// The same answer, or a better one without the fact that is wrong.
pub(super) fn explained(survey: &Survey, whole: Result<Adjusted, Error>) -> Result<Adjusted, Error> {
    let is_line = |a: &Adjusted| !contradicts(a) && spread::of_adjusted(survey, a).is_some();
    if whole.as_ref().is_ok_and(|a| !is_doubtful(survey, a) || is_line(a)) {
        return whole;
    }
    let slips = SLIPS.iter().map(|powers| slips(survey, &whole, powers)).find(|found| !found.is_empty());
    let mut found = slips.unwrap_or_else(|| removals(survey, &whole));
    found.sort_by(|a, b| a.without.chi2.total_cmp(&b.without.chi2));
    let mut found = found.into_iter();
    let Some(first) = found.next() else { return whole };
    let least = first.without.chi2;
    let tied: Vec<Suspect> =
        found.take_while(|e| e.without.chi2 < least + TIED_CHI2).map(|e| e.suspect).collect();
    let mut best = match whole {
        // Nothing tells which of them is wrong: all take part.
        Ok(whole) if !tied.is_empty() && whole.undetermined.len() <= first.without.undetermined.len() => {
            whole
        }
        _ => Adjusted { left_out: vec![first.suspect.fact], ..first.without },
    };
    best.is_inconsistent = true;
    best.suspects = [vec![first.suspect], tied].concat();
    best.facts = survey.facts.to_vec();
    Ok(best)
}

/// Whether something is wrong: facts that contradict each other, or a mark that was clicked but left out, and what is known of it with it.
fn is_doubtful(survey: &Survey, adjusted: &Adjusted) -> bool {
    contradicts(adjusted) || adjusted.lost_marks(survey).next().is_some()
}

fn contradicts(adjusted: &Adjusted) -> bool {
    adjusted.is_inconsistent || !adjusted.suspects.is_empty()
}

/// Whether a survey without a fact, or with another value of it, explains everything.
fn explains(survey: &Survey, whole: &Result<Adjusted, Error>, found: &Adjusted) -> bool {
    let lost = |a: &Adjusted| a.undetermined.len();
    let keeps = whole.as_ref().is_ok_and(|w| lost(found) <= lost(w)) || whole.is_err();
    let is_checked = 0 < found.degrees_of_freedom;
    keeps && is_checked && !is_doubtful(survey, found)
}

/// Distances that fit all the rest once their decimal point is moved.
fn slips(survey: &Survey, whole: &Result<Adjusted, Error>, powers: &[i32]) -> Vec<Explanation> {
    let mut found = Vec::new();
    for (index, fact) in survey.facts.iter().enumerate() {
        let Fact::Distance { a, b, distance_m, sigma_m } = *fact else { continue };
        for power in powers {
            let mut facts = survey.facts.to_vec();
            let moved = Fact::Distance { a, b, distance_m: distance_m / 10f64.powi(*power), sigma_m };
            facts[index] = moved;
            let with = Survey { facts: &facts, ..*survey };
            let corrected = attempt(&with, Depth::Single).ok().filter(|c| explains(survey, whole, c));
            found.extend(corrected.and_then(|c| slip(survey, index, *power, c)));
        }
    }
    found
}

/// The slip that a corrected survey proves: the others alone foresee the corrected distance.
fn slip(survey: &Survey, index: usize, power_of_ten: i32, corrected: Adjusted) -> Option<Explanation> {
    let mut explanation = without(survey, index, Some(corrected))?;
    let Fact::Distance { distance_m, .. } = survey.facts[index] else { return None };
    let (_, off_m, sigma_m) = foreseen(survey, index, &explanation.without)?;
    let expected_m = distance_m - off_m;
    let tolerance_m = (SLIP_TOLERANCE * expected_m).max(5.0 * sigma_m);
    let is_slip = (distance_m / 10f64.powi(power_of_ten) - expected_m).abs() < tolerance_m;
    explanation.suspect.slip = is_slip.then_some(DecimalSlip { expected_m, sigma_m, power_of_ten });
    is_slip.then_some(explanation)
}

fn foreseen(survey: &Survey, index: usize, without: &Adjusted) -> Option<(f64, f64, f64)> {
    snoop::against_the_rest(&survey.facts[index], &without.state, &without.layout, &without.covariance)
}

/// Facts without which all the rest agrees.
fn removals(survey: &Survey, whole: &Result<Adjusted, Error>) -> Vec<Explanation> {
    let is_distance = |i: &usize| matches!(survey.facts[*i], Fact::Distance { .. });
    let mut tried: Vec<usize> = match whole {
        Ok(whole) => whole.suspects.iter().take(MOST_SUSPECTS).map(|s| s.fact).collect(),
        Err(_) => (0..survey.facts.len()).filter(|i| speaks_of_a_mark(survey, *i)).collect(),
    };
    tried.extend((0..survey.facts.len()).filter(is_distance));
    tried.sort_unstable();
    tried.dedup();
    let explains = |e: &Explanation| explains(survey, whole, &e.without);
    tried.into_iter().take(MOST_REMOVED).filter_map(|i| without(survey, i, None)).filter(explains).collect()
}

fn speaks_of_a_mark(survey: &Survey, index: usize) -> bool {
    match survey.facts[index] {
        Fact::Place { .. } | Fact::Distance { .. } => true,
        Fact::Click { point, .. } => survey.facts.iter().any(|f| {
            matches!(f, Fact::Place { .. } | Fact::Distance { .. }) && f.points().contains(&Some(point))
        }),
        _ => false,
    }
}

/// The survey without one fact, from its own starts or from places that are near.
fn without(survey: &Survey, index: usize, near: Option<Adjusted>) -> Option<Explanation> {
    let mut facts = survey.facts.to_vec();
    facts.remove(index);
    let rest = Survey { facts: &facts, ..*survey };
    let draft = |near: Adjusted| Draft {
        marks: if let Frame::Marks(marks) = near.frame { Some(marks) } else { None },
        state: near.state,
        dropped: near.undetermined,
        alternatives: Vec::new(),
    };
    let found = match near {
        Some(near) => settle(&rest, draft(near)).ok()?,
        None => attempt(&rest, Depth::Single).ok()?,
    };
    let (sigmas, off, _) = foreseen(survey, index, &found)?;
    let suspect = Suspect { fact: index, sigmas, off: off.abs(), slip: None };
    (LEAST_SIGMAS < sigmas).then_some(Explanation { suspect, without: found })
}

impl Adjusted {
    /// Marks that a photograph shows but that were left out, and what is known of them with them.
    pub(super) fn lost_marks<'a>(&'a self, survey: &'a Survey) -> impl Iterator<Item = usize> + 'a {
        let clicked = |point: usize| {
            let is = |f: &Fact| matches!(f, Fact::Click { point: p, .. } if *p == point);
            survey.facts.iter().any(is)
        };
        let is_mark = |point: usize| {
            let speaks = |f: &&Fact| matches!(f, Fact::Place { .. } | Fact::Distance { .. });
            survey.facts.iter().filter(speaks).any(|f| f.points().contains(&Some(point)))
        };
        self.undetermined.iter().filter_map(move |(item, _)| match item {
            Item::Point(p) if clicked(*p) && is_mark(*p) => Some(*p),
            _ => None,
        })
    }

    /// The facts that took part, but for those of what has no place.
    pub(super) fn used_facts(&self) -> Vec<Fact> {
        let is_used = |(i, _): &(usize, &Fact)| !self.left_out.contains(i);
        self.facts.iter().enumerate().filter(is_used).map(|(_, f)| *f).collect()
    }
}
