//! The usual faults of points, pixels and labels, where views contradict each other or no camera explains them: what explains the views with a lens of which
//! nothing is known is corrected, and the camera is estimated again. docs/math/suspects.md section 5.

use super::model::central_matrix;
use super::{Finding, IntrinsicsConfig, IntrinsicsOutcome, Severity};
use crate::camera::{BrownConrady, ImageSize};
use crate::locate::suspects::{Explanation, Free, corrected, explanations_of_views};
use crate::{Camera, Correspondence, Error};

/// So many corrections are tried by estimating the camera again.
const MOST_TRIED: usize = 4;

/// Puts the fault first without which the views determine a camera and agree.
pub(super) fn examined<V: AsRef<[Correspondence]>>(
    views: &[V],
    size: ImageSize,
    config: &IntrinsicsConfig,
    mut outcome: IntrinsicsOutcome,
    solve: impl Fn(&[Vec<Correspondence>], ImageSize, &IntrinsicsConfig) -> Result<IntrinsicsOutcome, Error>,
) -> IntrinsicsOutcome {
    let findings = match &mut outcome {
        IntrinsicsOutcome::Solved(solved) => &mut solved.findings,
        IntrinsicsOutcome::Refused(refusal) => &mut refusal.findings,
    };
    let is_contradiction = |f: &Finding| {
        f.severity() == Severity::Inconsistent
            || matches!(f, Finding::NoCamera { .. } | Finding::Undetermined { .. })
    };
    if findings.iter().any(is_contradiction) {
        let views: Vec<&[Correspondence]> = views.iter().map(AsRef::as_ref).collect();
        findings.splice(..0, fault(&views, size, |views| solve(views, size, config)));
    }
    outcome
}

fn fault(
    views: &[&[Correspondence]],
    size: ImageSize,
    solve: impl Fn(&[Vec<Correspondence>]) -> Result<IntrinsicsOutcome, Error>,
) -> Option<Finding> {
    let side_px = f64::from(size.width_px.max(size.height_px));
    let lens = BrownConrady::new(central_matrix(size, side_px), &[0.0; 4]).ok()?;
    let camera = Camera { lens: lens.into(), size: Some(size) };
    let usable: Vec<_> = views.iter().copied().filter(|seen| super::LEAST_POINTS <= seen.len()).collect();
    let explains = |one: Explanation| {
        let IntrinsicsOutcome::Solved(found) = solve(&corrected(views, &camera, &one)?).ok()? else {
            return None;
        };
        let is_good = found.severity() == Severity::Remark;
        is_good.then_some(Finding::UsualFault { faults: one.faults })
    };
    explanations_of_views(&usable, &camera, Free::LENS).into_iter().take(MOST_TRIED).find_map(explains)
}
