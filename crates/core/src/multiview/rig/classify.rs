//! The selection of the points and observations that take part.
//!
//! A point takes part when its squared residual, in units of the variance that the inner half of all points shows, is below the gate; a
//! observation when most of its points do. docs/math/rig.md section 5.

use super::RejectedObservation;
use super::layout::Layout;
use super::sighted::{LocatedViews, MEDIAN_CHI2, median};
use crate::least_squares::rig::RigPoses;
use crate::locate::refine::whitened_residual;
use nalgebra::Vector2;

/// The residuals of one observation.
#[derive(Debug, Clone, Default)]
pub(super) struct Residuals {
    /// Observed − predicted, px, and the squared whitened length; none where a point cannot be projected.
    pub(super) points: Vec<Option<(Vector2<f64>, f64)>>,
}

/// The points that take part.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Parts {
    /// One entry for each observation and point.
    pub(super) is_used: Vec<Vec<bool>>,
    pub(super) rejected: Vec<Option<RejectedObservation>>,
    /// One entry for each body in a view.
    pub(super) is_active: Vec<bool>,
}

/// Computes the residuals of every point at `places`; none where the body takes no part.
pub(super) fn residuals(layout: &Layout, places: &RigPoses, is_active: &[bool]) -> Vec<Residuals> {
    let of_link = |(i, link): (usize, &crate::least_squares::rig::RigLink)| {
        let pivot = &layout.pivot_in_target[link.target];
        let cam_from_target = places.of_link(link, &layout.graph).pose(pivot);
        let seen = &layout.observations[i].seen;
        let point = |c| whitened_residual(&cam_from_target, c, layout.camera(i)).map(|(_, e, s)| (e, s));
        let points =
            if is_active[link.body] { seen.iter().map(point).collect() } else { vec![None; seen.len()] };
        Residuals { points }
    };
    layout.graph.links.iter().enumerate().map(of_link).collect()
}

/// Returns the variance in units of the stated one, from the median over all points that can be projected, corrected for the number of unknowns.
pub(super) fn robust_variance(residuals: &[Residuals], unknown: usize) -> f64 {
    let mut all: Vec<f64> = residuals.iter().flat_map(|r| r.points.iter().flatten().map(|p| p.1)).collect();
    let rows = 2.0 * all.len() as f64;
    let free = rows / (rows - unknown as f64).max(0.25 * rows);
    median(&mut all).map_or(1.0, |m| m / MEDIAN_CHI2 * free)
}

/// Selects the points and observations with the gate given as a squared residual.
pub(super) fn parts(
    residuals: &[Residuals],
    gate_chi2: f64,
    layout: &Layout,
    located_views: &LocatedViews,
    is_active: &[bool],
) -> Parts {
    let mut parts = Parts {
        is_used: Vec::with_capacity(residuals.len()),
        rejected: vec![None; residuals.len()],
        is_active: is_active.to_vec(),
    };
    for (i, r) in residuals.iter().enumerate() {
        let used: Vec<bool> = r.points.iter().map(|p| p.is_some_and(|p| p.1 <= gate_chi2)).collect();
        let n_used = used.iter().filter(|u| **u).count();
        let is_judged = gate_chi2 < f64::INFINITY && is_active[layout.graph.links[i].body];
        if is_judged && 2 * n_used <= used.len() {
            parts.rejected[i] = Some(RejectedObservation::Contradicts { rms_px: rms_px(r) });
            parts.is_used.push(vec![false; used.len()]);
        } else {
            parts.is_used.push(used);
        }
    }
    if gate_chi2 < f64::INFINITY {
        parts.reject_exact_targets(residuals, layout);
    }
    parts.drop_undetermined(layout, located_views);
    parts
}

/// Three points fit one of four poses exactly, so that nothing shows which is right.
const PROVEN_POINTS: usize = 4;

/// Returns the root mean square over the points that can be projected.
pub(super) fn rms_px(residuals: &Residuals) -> f64 {
    let (sum, n) =
        residuals.points.iter().flatten().fold((0.0, 0.0), |s, p| (s.0 + p.0.norm_squared(), s.1 + 1.0));
    (sum / f64::max(n, 1.0)).sqrt()
}

impl Parts {
    /// Rejects the observations of targets on bodies of which so many points are left out that the rest fits any of their poses.
    fn reject_exact_targets(&mut self, residuals: &[Residuals], layout: &Layout) {
        for target in (0..layout.first_target.len()).filter(|t| layout.graph.block_of_target[*t].is_some()) {
            let own = |i: &usize| {
                layout.observations[*i].target == target && self.rejected[*i].is_none() && 0 < self.n_used(*i)
            };
            let own: Vec<usize> = (0..residuals.len()).filter(own).collect();
            let n_used: usize = own.iter().map(|i| self.n_used(*i)).sum();
            let n_points: usize = own.iter().map(|i| self.is_used[*i].len()).sum();
            if n_used < PROVEN_POINTS.min(n_points) {
                for i in own {
                    self.rejected[i] =
                        Some(RejectedObservation::Contradicts { rms_px: rms_px(&residuals[i]) });
                    self.is_used[i].iter_mut().for_each(|used| *used = false);
                }
            }
        }
    }

    /// Drops every body in a view that has fewer than three points.
    fn drop_undetermined(&mut self, layout: &Layout, located_views: &LocatedViews) {
        for (body, range) in layout.ranges().into_iter().enumerate() {
            let n: usize = range.clone().map(|i| self.is_used[i].iter().filter(|u| **u).count()).sum();
            if self.is_active[body] && n < 3 {
                self.is_active[body] = false;
            }
            if !self.is_active[body] {
                self.drop_body(range, located_views);
            }
        }
    }

    /// Removes a body from a view, with all its observations.
    pub(super) fn drop_body(&mut self, range: core::ops::Range<usize>, located_views: &LocatedViews) {
        for i in range {
            self.is_used[i].iter_mut().for_each(|u| *u = false);
            let why =
                || located_views[i].as_ref().err().cloned().unwrap_or(crate::locate::refine::UNDETERMINED);
            self.rejected[i].get_or_insert_with(|| RejectedObservation::Undetermined(why()));
        }
    }

    pub(super) fn n_used(&self, observation: usize) -> usize {
        self.is_used[observation].iter().filter(|u| **u).count()
    }
}
