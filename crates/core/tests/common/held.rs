//! Every warning of an answer is in one of its budgets, or its status says it.

use resight_core::budget::{Budget, Warning};
use resight_core::multiview::hand_eye::HandEye;
use resight_core::multiview::intrinsics::{Severity, SolvedIntrinsics};
use resight_core::multiview::network::{Adjusted, NetworkStatus, Query};
use resight_core::multiview::pose_graph::PoseGraphSolution;
use resight_core::multiview::rig::RigSolution;
use std::fmt::Debug;

/// Every warning is in one of the budgets, or the status says it.
pub fn assert_all_held<D: Warning + Debug, M>(
    warnings: &[D],
    budgets: &[&Budget<M>],
    is_ok: bool,
    what: &str,
) {
    for warning in warnings {
        let is_held = budgets.iter().any(|budget| warning.accounted().is_held(budget, is_ok));
        assert!(is_held, "{what}: {warning:?} is in no number, status ok {is_ok}");
    }
}

pub fn assert_rig(found: &RigSolution, n_views: usize, what: &str) {
    let budgets: Vec<&Budget> = found.budgets.iter().collect();
    // The only camera is the frame itself and has no covariance.
    if 1 < budgets.len() {
        assert_all_held(&found.warnings(n_views), &budgets, !found.verdict.is_inconsistent, what);
    }
}

pub fn assert_hand_eye(found: &HandEye, what: &str) {
    let budgets = [&found.carrier_budget, &found.holder_budget];
    assert_all_held(&found.warnings(), &budgets, !found.is_inconsistent, what);
}

pub fn assert_graph(found: &PoseGraphSolution, what: &str) {
    let budgets: Vec<&Budget> = found.budgets.iter().collect();
    if budgets.len() > 1 {
        assert_all_held(&found.warnings(), &budgets, found.verdict.fault.is_none(), what);
    }
}

pub fn assert_intrinsics(found: &SolvedIntrinsics, what: &str) {
    assert_all_held(&found.findings, &[&found.budget], found.severity() == Severity::Remark, what);
}

pub fn assert_network(found: &Adjusted, query: &Query, what: &str) {
    if let Ok(budget) = found.budgets().of_query(query) {
        assert_all_held(&found.warnings(), &[&budget], found.status() == NetworkStatus::Ok, what);
    }
}
