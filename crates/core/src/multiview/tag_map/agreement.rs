//! Does every tag agree with the others, and which is the largest set that does?
//!
//! ```text
//!   T_t = χ²_t + g_tᵀ (N − N_t)⁻¹ g_t    by how much χ² falls when tag t is left out: χ² of eight, docs/math/tag_map.md eq. (7)
//! ```

use super::TagView;
use crate::least_squares::NormalEquations;
use crate::locate::PoseEstimate;
use crate::locate::choose::AMBIGUITY_GATE_CHI2;
use crate::locate::consistency::{Consistency, is_inconsistent, noise_scale};

/// Two coordinates of each of four corners.
pub(super) const DEGREES_OF_FREEDOM: usize = 8;
/// Sets tried of each size.
const MAX_SETS: usize = 400;
/// More tags than this are not left out: a view that needs it has another fault.
const MAX_LEFT_OUT: usize = 5;

/// What the tags of a view say of each other.
pub(super) enum Agreement {
    /// Every tag is where the others expect it, to within tolerances and noise.
    All,
    /// Some is not. `excess` is T of each tag.
    Doubtful { excess: Vec<f64> },
}

/// Whether the chosen tags agree at their common minimum.
pub(super) fn agreement(view: &TagView, chosen: &[usize], e: &PoseEstimate) -> Agreement {
    let excess = excess(view, chosen, e);
    let is_off = |t: &f64| {
        // What the others make of the noise; never less than what is stated.
        let rest = (e.chi2 - t).max(0.0);
        let scale = noise_scale(rest, e.degrees_of_freedom.saturating_sub(DEGREES_OF_FREEDOM));
        is_inconsistent(t / scale, DEGREES_OF_FREEDOM)
    };
    let is_all = matches!(e.consistency, Consistency::Consistent) && !excess.iter().any(is_off);
    if is_all { Agreement::All } else { Agreement::Doubtful { excess } }
}

/// T of each of the chosen tags; 0 where the others alone determine no pose.
fn excess(view: &TagView, chosen: &[usize], e: &PoseEstimate) -> Vec<f64> {
    if view.config.intrinsics_covariance.is_some() || view.config.target_scale_sigma != [0.0; 2] {
        return excess_by_solving(view, chosen, e);
    }
    let Some(equations) = view.equations(chosen, e) else { return vec![0.0; chosen.len()] };
    let of_tag = |tag: &Option<NormalEquations>| -> Option<f64> {
        let tag = tag.as_ref()?;
        let (rest, gradient) = (equations.all.information() - tag.information(), tag.gradient());
        Some(tag.chi2 + gradient.dot(&rest.cholesky()?.solve(&gradient)))
    };
    equations.of_tags.iter().map(|tag| of_tag(tag).filter(|t| t.is_finite()).unwrap_or(0.0)).collect()
}

/// As `excess`, each tag left out in turn: what uncertain intrinsics and scales explain is then out of both χ².
fn excess_by_solving(view: &TagView, chosen: &[usize], e: &PoseEstimate) -> Vec<f64> {
    let without = |tag: &usize| {
        let rest: Vec<usize> = chosen.iter().copied().filter(|i| i != tag).collect();
        view.locate(&rest).map_or(0.0, |rest| (e.chi2 - rest.chi2).max(0.0))
    };
    chosen.iter().map(without).collect()
}

/// The indices of the tags kept and their estimate: the fewest are left out with which the rest agree. None where two sets of that size
/// do about equally well, or where fewer than half or fewer than two would be left; where just half would be left, also where another half
/// agrees with itself: two small tags of four do so by chance.
pub(super) fn separate(view: &TagView, excess: &[f64]) -> Option<(Vec<usize>, PoseEstimate)> {
    let n = view.tags.len();
    let mut suspects: Vec<usize> = (0..n).collect();
    suspects.sort_by(|a, b| excess[*b].total_cmp(&excess[*a]));
    for k in 1..=MAX_LEFT_OUT.min(n / 2) {
        if n - k < 2 {
            break;
        }
        let within = (k..=n).take_while(|m| n_sets(*m, k) <= MAX_SETS).last().unwrap_or(k);
        match best(view, &suspects[..within], k) {
            Found::None => {}
            Found::Two => return None,
            Found::One(found) => return Some(*found),
        }
    }
    None
}

enum Found {
    None,
    One(Box<(Vec<usize>, PoseEstimate)>),
    /// Which of them, the data do not say.
    Two,
}

/// Of all sets that leave out `k` of the suspects, the one with the lowest χ², if the rest agrees with itself.
fn best(view: &TagView, suspects: &[usize], k: usize) -> Found {
    let mut solved: Vec<(Vec<usize>, PoseEstimate)> = Vec::new();
    each_set(suspects, k, &mut |left_out: &[usize]| {
        let kept: Vec<usize> = (0..view.tags.len()).filter(|i| !left_out.contains(i)).collect();
        if let Ok(e) = view.locate(&kept) {
            solved.push((kept, e));
        }
    });
    solved.sort_by(|a, b| a.1.chi2.total_cmp(&b.1.chi2));
    let mut solved = solved.into_iter();
    let Some((kept, e)) = solved.next() else { return Found::None };
    if !matches!(agreement(view, &kept, &e), Agreement::All) {
        return Found::None;
    }
    let noise = noise_scale(e.chi2, e.degrees_of_freedom);
    let is_half = 2 * k == view.tags.len();
    let is_alternative = |(other, of_other): (Vec<usize>, PoseEstimate)| {
        of_other.chi2 - e.chi2 < AMBIGUITY_GATE_CHI2 * noise
            || is_half && matches!(agreement(view, &other, &of_other), Agreement::All)
    };
    if solved.next().is_some_and(is_alternative) { Found::Two } else { Found::One(Box::new((kept, e))) }
}

/// n over k, no larger than needed to compare.
fn n_sets(n: usize, k: usize) -> usize {
    (0..k).fold(1usize, |sets, i| sets.saturating_mul(n - i) / (i + 1))
}

/// Calls with every set of `k` of the items.
fn each_set(items: &[usize], k: usize, call: &mut impl FnMut(&[usize])) {
    fn extend(items: &[usize], k: usize, set: &mut Vec<usize>, call: &mut impl FnMut(&[usize])) {
        if k == 0 {
            return call(set);
        }
        for (i, item) in items.iter().enumerate() {
            set.push(*item);
            extend(&items[i + 1..], k - 1, set, call);
            set.pop();
        }
    }
    extend(items, k, &mut Vec::with_capacity(k), call);
}
