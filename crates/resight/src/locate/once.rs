//! Equal observations are one: what repeats an earlier point and pixel takes no part, and the answer still speaks of the rows as given.

use super::NamedPoint;
use crate::answer::PoseAnswer;
use crate::report::words;
use resight_core::Correspondence;
use resight_core::correspondence::first_of_equals;
use resight_core::locate::consistency::Consistency;

/// Observations some of which repeat others.
pub(super) struct Once {
    /// Of each observation the first that says the same.
    first: Vec<usize>,
    /// Those that say something new.
    kept: Vec<usize>,
}

impl Once {
    /// None where every observation says something new.
    pub(super) fn of(seen: &[Correspondence]) -> Option<Self> {
        let first = first_of_equals(seen);
        let kept: Vec<usize> = (0..first.len()).filter(|i| first[*i] == *i).collect();
        (kept.len() < first.len()).then_some(Once { first, kept })
    }

    /// The answer of the observations that are left, in the numbers of the rows given.
    pub(super) fn answered(
        &self,
        points: &[NamedPoint],
        answer: impl FnOnce(&[NamedPoint]) -> PoseAnswer,
    ) -> PoseAnswer {
        let once: Vec<NamedPoint> = self.kept.iter().map(|i| points[*i].clone()).collect();
        let mut answer = answer(&once);
        answer.remarks.extend(words::repeated(self.first.len() - self.kept.len(), self.first.len()));
        if let Some(agreement) = &mut answer.agreement {
            agreement.of_rows(&self.first, &self.kept);
        }
        let consistency = answer.estimate.as_mut().map(|e| &mut e.consistency);
        if let Some(Consistency::Inconsistent { worst_point, .. }) = consistency {
            *worst_point = self.kept.get(*worst_point).copied().unwrap_or(*worst_point);
        }
        let others = answer.names.split_off(self.kept.len().min(answer.names.len()));
        answer.names = points.iter().map(|point| point.name.clone()).chain(others).collect();
        answer
    }
}
