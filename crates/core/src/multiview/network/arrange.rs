//! The best of all arrangements of the control points and of the photographs' poses, and the second best.

use super::solve::{check_distances, settle};
use super::starts::{draft, undetermined};
use super::trilaterate::Places;
use super::{Adjusted, Constraint, NetworkProblem};
use crate::locate::consistency::{is_unlikely, unlikely_above};
use crate::{Error, Pose};

/// Largest number of alternative poses of photographs that are tried.
const MOST_ALTERNATIVES: usize = 12;
/// Largest number of arrangements that are tried in all where none fits.
const MOST_DRAFTS: usize = 60;
/// An arrangement that determines one item more may have a χ² larger by this: a mirrored photograph determines points without parallax, but at
/// wrong positions.
const COST_OF_LOSS_CHI2: f64 = 25.0;
/// Two arrangements are the same when their χ² and the photographs' poses agree to this.
const SAME: f64 = 1e-3;

/// An arrangement that converges slowly and whose χ² exceeds the best one's by more than this, times the factor that widens its variances, is
/// given up: the gate of a second solution is a tenth of it.
const FAR_CHI2: f64 = 100.0;

/// The extent of the search.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Depth {
    /// Tries no other poses.
    First,
    /// Tries other poses of one photograph at a time, and keeps only arrangements whose constraints may agree: used to test a hypothesis.
    Single,
    /// Also tries other poses of several photographs together where single ones fit badly.
    Together,
}

/// Poses that replace those of `locate`.
type Forced = Vec<(usize, Pose)>;

struct Search<'a> {
    network: &'a NetworkProblem<'a>,
    found: Vec<Adjusted>,
    refusal: Option<Error>,
    drafts: usize,
    /// χ² above which an arrangement is of no use.
    useless_above: Option<f64>,
}

/// Returns χ² plus the penalty of leaving points or photographs without a pose.
pub(super) fn cost(a: &Adjusted) -> f64 {
    a.chi2 + COST_OF_LOSS_CHI2 * a.undetermined.len() as f64
}

/// Returns the best of all arrangements.
pub(super) fn best_of(
    network: &NetworkProblem,
    arrangements: &[Places],
    depth: Depth,
) -> Result<Adjusted, Error> {
    let n_rows = network.constraints.iter().map(Constraint::n_rows).sum();
    let useless_above = (depth != Depth::Together).then(|| unlikely_above(n_rows));
    let mut search = Search { network, found: Vec::new(), refusal: None, drafts: 0, useless_above };
    let mut open: Vec<(usize, Forced)> = (0..arrangements.len()).map(|k| (k, Vec::new())).collect();
    for control_points in arrangements {
        // This error is returned only where no arrangement is solved: with photographs, the whole network shows better which distance is wrong.
        // solved.
        search.refusal = search.refusal.or(check_distances(network, control_points).err());
    }
    let deepest = match depth {
        Depth::First => 0,
        Depth::Single => 1,
        Depth::Together => network.camera_of_photo.len(),
    };
    for level in 0..=deepest {
        if open.is_empty() || (1 < level && search.fits()) {
            break;
        }
        let mut next = Vec::new();
        for (k, forced) in &open {
            if level <= 1 || search.drafts < MOST_DRAFTS {
                next.extend(search.follow(&arrangements[*k], forced).into_iter().map(|f| (*k, f)));
            }
        }
        open = next;
    }
    search.conclude()
}

impl Search<'_> {
    /// Adjusts one arrangement; returns the forced poses to try after it.
    fn follow(&mut self, control_points: &Places, forced: &Forced) -> Vec<Forced> {
        self.drafts += 1;
        let first = draft(self.network, control_points, forced);
        let last = forced.iter().map(|f| f.0 + 1).max().unwrap_or(0);
        let more = first.alternatives.iter().filter(|(photo, _)| last <= *photo).take(MOST_ALTERNATIVES);
        let with = |alternative: &(usize, Pose)| forced.iter().chain([alternative]).copied().collect();
        let next = more.map(with).collect();
        match settle(self.network, first, self.far_chi2()) {
            Ok(adjusted) => self.found.push(adjusted),
            Err(reason) if forced.is_empty() => self.refusal = self.refusal.take().or(Some(reason)),
            Err(_) => {}
        }
        next
    }

    /// Returns the χ² above which an arrangement is of no use, or is no alternative to one that determines everything.
    fn far_chi2(&self) -> Option<f64> {
        let whole = self.found.iter().filter(|a| a.undetermined.is_empty());
        whole.map(|a| a.chi2 + FAR_CHI2 * a.noise_scale).chain(self.useless_above).reduce(f64::min)
    }

    fn fits(&self) -> bool {
        self.found.iter().any(|a| a.undetermined.is_empty() && !is_unlikely(a.chi2, a.degrees_of_freedom))
    }

    fn conclude(self) -> Result<Adjusted, Error> {
        let mut found = self.found;
        found.sort_by(|a, b| cost(a).total_cmp(&cost(b)));
        let mut found = found.into_iter();
        let Some(mut best) = found.next() else {
            let reason = "no photograph has a place; image point at least four control points in each";
            return Err(self.refusal.unwrap_or(undetermined("photo", 0, reason, 0.0, 3.0)));
        };
        let alternative =
            found.find(|a| a.undetermined.len() == best.undetermined.len() && !is_same(a, &best));
        best.alternative_delta_chi2 = alternative.as_ref().map(|a| (a.chi2 - best.chi2) / best.noise_scale);
        best.alternative = alternative.map(Box::new);
        Ok(best)
    }
}

fn is_same(a: &Adjusted, b: &Adjusted) -> bool {
    let near = |(p, q): (&Pose, &Pose)| p.angle_to_rad(q) < SAME;
    (a.chi2 - b.chi2).abs() < SAME * (1.0 + b.chi2) && a.state.photos.iter().zip(&b.state.photos).all(near)
}
