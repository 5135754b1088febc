//! The smallest set of cameras whose motions explain the frame sets since an onset, correlations between cameras included.
//!
//! ```text
//!   χ² left by the set s:  cᵀ D⁻¹ c − c_sᵀ (D_ss)⁻¹ c_s        docs/math/monitor.md eq. (25)
//! ```

use super::evidence::Gathered;
use crate::temporal::monitor::attribute::{Attribution, Fit, smallest};
use nalgebra::{DMatrix, DVector};

/// Information added to every coordinate, 1/rad² and 1/m²: a hundred radians or metres. It makes the common motion of all cameras,
/// which no camera sees, zero.
const FREE: f64 = 1e-4;

/// Sets of the observed cameras, with at least `at_least` members.
pub(super) fn which(gathered: &Gathered, at_least: usize) -> Attribution {
    let seen = seen(gathered);
    let all = explained(gathered, &seen);
    let determined = determined(gathered, &seen);
    smallest(&seen, at_least..=determined, |set| {
        let (motions, covariance, explained) = motions(gathered, set)?;
        let taken = set.len() - whole_groups(gathered, &seen, set);
        let degrees_of_freedom = 6 * (determined - taken);
        Some(Fit { motions, covariance, chi2: (all - explained).max(0.0), degrees_of_freedom })
    })
}

/// χ² that the motions of a set explain.
pub(super) fn explained(gathered: &Gathered, set: &[usize]) -> f64 {
    motions(gathered, set).map_or(0.0, |(_, _, explained)| explained)
}

/// Motions that are determined: all but one of each group of cameras that targets tie, whose common motion is not observable.
fn determined(gathered: &Gathered, seen: &[usize]) -> usize {
    seen.len() - whole_groups(gathered, seen, seen)
}

/// Groups of which all cameras that were seen are in the set.
fn whole_groups(gathered: &Gathered, seen: &[usize], set: &[usize]) -> usize {
    let is_whole = |group: &usize| {
        let of_group = |camera: &&usize| gathered.groups[**camera] == *group;
        seen.iter().filter(of_group).all(|camera| set.contains(camera))
    };
    let is_first = |camera: &&usize| {
        let group = gathered.groups[**camera];
        seen.iter().find(|other| gathered.groups[**other] == group) == Some(*camera)
    };
    seen.iter().filter(is_first).map(|camera| gathered.groups[*camera]).filter(is_whole).count()
}

/// Cameras that took part.
pub(super) fn seen(gathered: &Gathered) -> Vec<usize> {
    let has_information = |camera: &usize| 0.0 < gathered.information[(6 * camera, 6 * camera)];
    (0..gathered.score.len() / 6).filter(has_information).collect()
}

/// The motions of a set, their covariance and how much χ² they explain.
fn motions(gathered: &Gathered, set: &[usize]) -> Option<(DVector<f64>, DMatrix<f64>, f64)> {
    let n = 6 * set.len();
    let at = |i: usize| 6 * set[i / 6] + i % 6;
    let score = DVector::from_fn(n, |i, _| gathered.score[at(i)]);
    let information =
        DMatrix::from_fn(n, n, |i, j| gathered.information[(at(i), at(j))] + if i == j { FREE } else { 0.0 });
    let scale = information.diagonal().map(|v| 1.0 / v.sqrt());
    let scaled = DMatrix::from_fn(n, n, |i, j| information[(i, j)] * scale[i] * scale[j]);
    let inverse = if n == 0 { scaled } else { scaled.cholesky()?.inverse() };
    let covariance = DMatrix::from_fn(n, n, |i, j| inverse[(i, j)] * scale[i] * scale[j]);
    let motions = &covariance * &score;
    let explained = score.dot(&motions);
    explained.is_finite().then_some((motions, covariance, explained))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::temporal::monitor::rig::evidence::Onset;
    use crate::temporal::monitor::rig::evidence::tests::{SIGMA, difference};

    /// Four cameras in two groups that no target ties: two motions are determined, not three.
    #[test]
    fn groups_that_nothing_ties_have_a_free_motion_each() {
        let mut onset = Onset::new(0.0, 1.0, &DVector::from_element(24, SIGMA * SIGMA), Default::default());
        onset.add(&difference(4, [0, 1], 100.0 * SIGMA));
        onset.add(&difference(4, [2, 3], 5.75 * SIGMA));
        let gathered = onset.gathered(0);
        assert_eq!(
            (gathered.groups.as_slice(), determined(gathered, &seen(gathered))),
            (&[0, 0, 2, 2][..], 2)
        );
        // One in the first group leaves χ² = 33 in the second: too much for six numbers, though not for twelve.
        let moved = which(gathered, 1).moved;
        assert_eq!(moved.len(), 2, "{moved:?}");
        assert!(moved[0].node < 2 && 2 <= moved[1].node, "{moved:?}");
        onset.add(&difference(4, [1, 2], 0.0));
        let gathered = onset.gathered(0);
        assert_eq!((gathered.groups.as_slice(), determined(gathered, &seen(gathered))), (&[0; 4][..], 3));
    }
}
