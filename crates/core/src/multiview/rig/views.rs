//! The views that cameras share, and the groups of connected cameras: a count without solving.

use super::{RigProblem, SharedViews};

/// Counts the views that cameras share, before anything is solved. Observations without points, or with an invalid index, are not counted.
pub fn shared_views(problem: &RigProblem) -> SharedViews {
    let n = problem.cameras.len();
    let mut seen: Vec<(usize, usize, usize)> = Vec::with_capacity(problem.observations.len());
    for s in problem.observations.iter().filter(|s| s.camera < n && !s.seen.is_empty()) {
        if let Some(body) = problem.body_of_target.get(s.target) {
            seen.push((s.view, *body, s.camera));
        }
    }
    seen.sort_unstable();
    seen.dedup();
    let counts = counts(&seen, n);
    let mut groups = Groups::new(n);
    for (a, row) in counts.iter().enumerate() {
        row.iter().enumerate().filter(|(_, count)| 0 < **count).for_each(|(b, _)| groups.join(a, b));
    }
    SharedViews { counts, groups: groups.members() }
}

/// Returns the number of views of each pair, where a view in which it shares two bodies counts once.
pub(super) fn counts(seen: &[(usize, usize, usize)], n: usize) -> Vec<Vec<usize>> {
    let mut counts = vec![vec![0; n]; n];
    let mut counted_in = vec![vec![None; n]; n];
    for together in seen.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        for (view, _, a) in together {
            for (_, _, b) in together {
                if counted_in[*a][*b] != Some(*view) {
                    counted_in[*a][*b] = Some(*view);
                    counts[*a][*b] += 1;
                }
            }
        }
    }
    counts
}

/// A union–find structure: which elements are connected.
pub(in crate::multiview) struct Groups {
    parent: Vec<usize>,
}

impl Groups {
    pub(in crate::multiview) fn new(n: usize) -> Self {
        Groups { parent: (0..n).collect() }
    }

    pub(in crate::multiview) fn root(&mut self, mut i: usize) -> usize {
        while self.parent[i] != i {
            self.parent[i] = self.parent[self.parent[i]];
            i = self.parent[i];
        }
        i
    }

    /// Joins two groups. The lower root remains, so that the result does not depend on the order of joining.
    pub(in crate::multiview) fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b)] = a.min(b);
    }

    /// Returns the groups, the largest first, among equals that with the lowest member.
    pub(in crate::multiview) fn members(&mut self) -> Vec<Vec<usize>> {
        let n = self.parent.len();
        let mut groups: Vec<Vec<usize>> = vec![Vec::new(); n];
        for i in 0..n {
            let root = self.root(i);
            groups[root].push(i);
        }
        groups.retain(|g| !g.is_empty());
        groups.sort_by_key(|g| (n - g.len(), g[0]));
        groups
    }
}
