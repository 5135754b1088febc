//! The single wrong constraint, where the network contradicts itself or cannot be solved: docs/math/survey.md eq. (23).
//!
//! Each distance is tried with its decimal point moved, then each suspect constraint is left out. The constraint that explains everything is
//! named, and the positions are solved without it. Explanations are sought without the points that nothing checks.

use super::arrange::{Depth, best_of};
use super::solve::settle;
use super::starts::{Draft, control_points};
use super::{
    Adjusted, Constraint, DecimalSlip, Frame, Item, NetworkProblem, Suspect, exchange, snoop, spread,
};
use crate::Error;

/// The misplaced decimal points that are tried: by one digit first, then two or three.
const SLIPS: [&[i32]; 2] = [&[1, -1], &[2, -2, 3, -3]];
/// Largest number of constraints that are left out one by one.
const MOST_REMOVED: usize = 40;
/// The number of suspects of the whole network that are left out one by one.
const MOST_SUSPECTS: usize = 6;
/// Two explanations whose χ² differ by less than this cannot be distinguished.
const TIED_CHI2: f64 = 9.0;
/// The prediction of the others must contradict the constraint by this many standard deviations.
const LEAST_SIGMAS: f64 = 4.0;
/// A distance has a misplaced decimal point if it is the predicted one times a power of ten to within this share, or to five standard
/// deviations.
const SLIP_TOLERANCE: f64 = 0.03;

/// A network without one constraint, and its prediction of that constraint.
struct Explanation {
    suspect: Suspect,
    without: Adjusted,
}

/// A network without the points that nothing checks, which follow every change of the rest without adding to χ²: docs/math/survey.md eq. (28).
struct Checked<'a> {
    network: &'a NetworkProblem<'a>,
    /// The indices of its constraints in the network.
    kept: Vec<usize>,
    /// The new index of each point that it has.
    number: Vec<Option<usize>>,
    n_points: usize,
}

impl<'a> Checked<'a> {
    fn new(network: &'a NetworkProblem<'a>) -> Self {
        // For each point: its image points, its planes, and whether it has anything else.
        let mut about = vec![(0, 0, false); network.n_points];
        for constraint in network.constraints {
            for point in constraint.points().into_iter().flatten() {
                let (n_pixels, n_planes, is_known) = &mut about[point];
                match constraint {
                    Constraint::ImagePoint { .. } => *n_pixels += 1,
                    Constraint::OnPlane { .. } => *n_planes += 1,
                    _ => *is_known = true,
                }
            }
        }
        let mut n_points = 0;
        let mut next = || {
            n_points += 1;
            n_points - 1
        };
        let is_checked = |(n_pixels, n_planes, is_known): &(usize, usize, bool)| {
            *is_known || 1 < *n_pixels || 1 < *n_planes
        };
        let number: Vec<_> = about.iter().map(|about| is_checked(about).then(&mut next)).collect();
        let has = |f: &Constraint| f.points().into_iter().flatten().all(|p| number[p].is_some());
        let kept = (0..network.constraints.len()).filter(|i| has(&network.constraints[*i])).collect();
        Checked { network, kept, number, n_points }
    }

    fn is_everything(&self) -> bool {
        self.n_points == self.network.n_points
    }

    /// Returns the constraints that it has of those of the network, or of as many in their place.
    fn constraints(&self, all: &[Constraint]) -> Vec<Constraint> {
        let renumbered = |i: &usize| {
            let mut constraint = all[*i];
            constraint.renumber(|p| self.number[p]).then_some(constraint)
        };
        self.kept.iter().filter_map(renumbered).collect()
    }

    fn problem<'b>(&self, constraints: &'b [Constraint]) -> NetworkProblem<'b>
    where
        'a: 'b,
    {
        NetworkProblem { constraints, n_points: self.n_points, ..*self.network }
    }
}

/// Returns the best of all arrangements of a network.
pub(super) fn attempt(network: &NetworkProblem, depth: Depth) -> Result<Adjusted, Error> {
    best_of(network, &control_points(network)?, depth)
}

/// Returns the same solution, or a better one without the constraint that is wrong.
pub(super) fn explained(network: &NetworkProblem, whole: Result<Adjusted, Error>) -> Result<Adjusted, Error> {
    let is_line = |a: &Adjusted| !contradicts(a) && spread::of_adjusted(network, a).is_some();
    if whole.as_ref().is_ok_and(|a| !is_doubtful(network, a) || is_line(a)) {
        return whole;
    }
    let checked = Checked::new(network);
    let constraints = checked.constraints(network.constraints);
    let part = checked.problem(&constraints);
    let own = (!checked.is_everything()).then(|| attempt(&part, Depth::Together));
    let of_part = own.as_ref().unwrap_or(&whole);
    let slips = SLIPS.iter().map(|powers| slips(&part, of_part, powers)).find(|found| !found.is_empty());
    let is_slip = slips.is_some();
    let mut found = slips.unwrap_or_else(|| removals(&part, of_part));
    found.iter_mut().for_each(|e| e.suspect.constraint = checked.kept[e.suspect.constraint]);
    if !is_slip && let Some(exchanged) = exchanged(&checked, &whole, of_part, &found) {
        return Ok(exchanged);
    }
    found.sort_by(|a, b| a.without.chi2.total_cmp(&b.without.chi2));
    let mut found = found.into_iter();
    let Some(first) = found.next() else { return whole };
    let least = first.without.chi2;
    let tied: Vec<Suspect> =
        found.take_while(|e| e.without.chi2 < least + TIED_CHI2).map(|e| e.suspect).collect();
    let is_worth_all = of_part.as_ref().is_ok_and(|w| lost(w) <= lost(&first.without));
    let mut best = match whole {
        // Nothing shows which of them is wrong, so all take part.
        Ok(whole) if !tied.is_empty() && is_worth_all => whole,
        whole => {
            let index = first.suspect.constraint;
            let without = match checked.is_everything() {
                true => Some(first.without),
                false => without_suspect(network, &first.suspect),
            };
            let Some(without) = without else { return whole };
            Adjusted { left_out: vec![index], ..without }
        }
    };
    best.is_inconsistent = true;
    best.suspects = [vec![first.suspect], tied].concat();
    best.constraints = network.constraints.to_vec();
    Ok(best)
}

/// Returns the whole network without the constraint that explains everything.
fn without_suspect(network: &NetworkProblem, suspect: &Suspect) -> Option<Adjusted> {
    let index = suspect.constraint;
    let near = match suspect.slip {
        Some(slip) => {
            let constraints = with_slip(network, index, slip.power_of_ten)?;
            Some(attempt(&NetworkProblem { constraints: &constraints, ..*network }, Depth::Single).ok()?)
        }
        None => None,
    };
    without(network, index, near).map(|explanation| explanation.without)
}

/// Returns the network with labels, columns or axes exchanged, if that explains everything.
fn exchanged(
    checked: &Checked,
    whole: &Result<Adjusted, Error>,
    of_part: &Result<Adjusted, Error>,
    found: &[Explanation],
) -> Option<Adjusted> {
    let of_whole =
        || whole.as_ref().map_or(Vec::new(), |w| w.suspects.iter().map(|s| s.constraint).collect());
    let (suspected, is_explained) = match found {
        [] => (of_whole(), false),
        found => (found.iter().map(|e| e.suspect.constraint).collect(), true),
    };
    let chi2 = |with: &NetworkProblem| {
        let constraints = checked.constraints(with.constraints);
        let part = checked.problem(&constraints);
        attempt(&part, Depth::Single).ok().filter(|agreed| explains(&part, of_part, agreed)).map(|a| a.chi2)
    };
    let (exchanged, constraints) = exchange::exchanged(checked.network, &suspected, is_explained, chi2)?;
    let with = NetworkProblem { constraints: &constraints, ..*checked.network };
    Some(Adjusted { exchanged, is_inconsistent: true, ..attempt(&with, Depth::Single).ok()? })
}

/// Returns whether something is wrong: constraints contradict each other, or a control point in a photograph was left out together with the
/// constraints on it.
fn is_doubtful(network: &NetworkProblem, adjusted: &Adjusted) -> bool {
    contradicts(adjusted) || adjusted.lost_control_points(network).next().is_some()
}

fn contradicts(adjusted: &Adjusted) -> bool {
    adjusted.is_inconsistent || !adjusted.suspects.is_empty()
}

/// Returns whether a network without a constraint, or with another value of it, explains everything.
fn explains(network: &NetworkProblem, whole: &Result<Adjusted, Error>, found: &Adjusted) -> bool {
    let keeps = whole.as_ref().is_ok_and(|w| lost(found) <= lost(w)) || whole.is_err();
    let is_checked = 0 < found.degrees_of_freedom;
    keeps && is_checked && !is_doubtful(network, found)
}

/// Returns how many points, photographs and planes have no place.
fn lost(adjusted: &Adjusted) -> usize {
    adjusted.undetermined.len()
}

/// Returns the distances that agree with all others once their decimal point is moved.
fn slips(network: &NetworkProblem, whole: &Result<Adjusted, Error>, powers: &[i32]) -> Vec<Explanation> {
    let mut found = Vec::new();
    for index in 0..network.constraints.len() {
        for power in powers {
            let Some(constraints) = with_slip(network, index, *power) else { continue };
            let with = NetworkProblem { constraints: &constraints, ..*network };
            let corrected = attempt(&with, Depth::Single).ok().filter(|c| explains(network, whole, c));
            found.extend(corrected.and_then(|c| slip(network, index, *power, c)));
        }
    }
    found
}

/// Returns the constraints with the decimal point of a distance moved; none where the constraint is another one.
fn with_slip(network: &NetworkProblem, index: usize, power_of_ten: i32) -> Option<Vec<Constraint>> {
    let mut constraints = network.constraints.to_vec();
    let Constraint::Distance { distance_m, .. } = &mut constraints[index] else { return None };
    *distance_m /= 10f64.powi(power_of_ten);
    Some(constraints)
}

/// Returns the misplaced decimal point that a corrected network proves: the others alone predict the corrected distance.
fn slip(
    network: &NetworkProblem,
    index: usize,
    power_of_ten: i32,
    corrected: Adjusted,
) -> Option<Explanation> {
    let mut explanation = without(network, index, Some(corrected))?;
    let Constraint::Distance { distance_m, .. } = network.constraints[index] else { return None };
    let (_, off_m, sigma_m) = predicted(network, index, &explanation.without)?;
    let expected_m = distance_m - off_m;
    let tolerance_m = (SLIP_TOLERANCE * expected_m).max(5.0 * sigma_m);
    let is_slip = (distance_m / 10f64.powi(power_of_ten) - expected_m).abs() < tolerance_m;
    explanation.suspect.slip = is_slip.then_some(DecimalSlip { expected_m, sigma_m, power_of_ten });
    is_slip.then_some(explanation)
}

fn predicted(network: &NetworkProblem, index: usize, without: &Adjusted) -> Option<(f64, f64, f64)> {
    snoop::against_the_rest(&network.constraints[index], &without.state, &without.layout, &without.covariance)
}

/// Returns the constraints without which all others agree.
fn removals(network: &NetworkProblem, whole: &Result<Adjusted, Error>) -> Vec<Explanation> {
    let is_distance = |i: &usize| matches!(network.constraints[*i], Constraint::Distance { .. });
    let mut tried: Vec<usize> = match whole {
        Ok(whole) => whole.suspects.iter().take(MOST_SUSPECTS).map(|s| s.constraint).collect(),
        Err(_) => (0..network.constraints.len()).filter(|i| speaks_of_a_control_point(network, *i)).collect(),
    };
    tried.extend((0..network.constraints.len()).filter(is_distance));
    tried.sort_unstable();
    tried.dedup();
    let explains = |e: &Explanation| explains(network, whole, &e.without);
    tried.into_iter().take(MOST_REMOVED).filter_map(|i| without(network, i, None)).filter(explains).collect()
}

fn speaks_of_a_control_point(network: &NetworkProblem, index: usize) -> bool {
    match network.constraints[index] {
        Constraint::Place { .. } | Constraint::Distance { .. } => true,
        Constraint::ImagePoint { point, .. } => network.constraints.iter().any(|f| {
            matches!(f, Constraint::Place { .. } | Constraint::Distance { .. })
                && f.points().contains(&Some(point))
        }),
        _ => false,
    }
}

/// Solves the network without one constraint, from its own initial values or from positions that are near.
fn without(network: &NetworkProblem, index: usize, near: Option<Adjusted>) -> Option<Explanation> {
    let mut constraints = network.constraints.to_vec();
    constraints.remove(index);
    let rest = NetworkProblem { constraints: &constraints, ..*network };
    let draft = |near: Adjusted| Draft {
        control_points: if let Frame::ControlPoints(control_points) = near.frame {
            Some(control_points)
        } else {
            None
        },
        state: near.state,
        dropped: near.undetermined,
        alternatives: Vec::new(),
    };
    let found = match near {
        Some(near) => settle(&rest, draft(near), None).ok()?,
        None => attempt(&rest, Depth::Single).ok()?,
    };
    let (sigmas, off, _) = predicted(network, index, &found)?;
    let suspect = Suspect { constraint: index, sigmas, off: off.abs(), slip: None };
    (LEAST_SIGMAS < sigmas).then_some(Explanation { suspect, without: found })
}

impl Adjusted {
    /// Returns the control points that a photograph shows but that were left out, and the constraints on them.
    pub(super) fn lost_control_points<'a>(
        &'a self,
        network: &'a NetworkProblem,
    ) -> impl Iterator<Item = usize> + 'a {
        let clicked = |point: usize| {
            let is = |f: &Constraint| matches!(f, Constraint::ImagePoint { point: p, .. } if *p == point);
            network.constraints.iter().any(is)
        };
        let is_control_point = |point: usize| {
            let speaks =
                |f: &&Constraint| matches!(f, Constraint::Place { .. } | Constraint::Distance { .. });
            network.constraints.iter().filter(speaks).any(|f| f.points().contains(&Some(point)))
        };
        self.undetermined.iter().filter_map(move |(item, _)| match item {
            Item::Point(p) if clicked(*p) && is_control_point(*p) => Some(*p),
            _ => None,
        })
    }

    /// Returns the constraints that took part, except those on points or photographs without a pose.
    pub(super) fn used_constraints(&self) -> Vec<Constraint> {
        let is_used = |(i, _): &(usize, &Constraint)| !self.left_out.contains(i);
        self.constraints.iter().enumerate().filter(is_used).map(|(_, f)| *f).collect()
    }
}
