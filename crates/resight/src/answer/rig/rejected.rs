//! The frames, observations and points that took no part in a rig, with the reasons.

use super::{SolvedRig, camera_name, target_name};
use crate::core::multiview::rig::ObservationResult;
use crate::report::rig::rejection_sentence;
use schemars::JsonSchema;
use serde::Serialize;

#[derive(Serialize, JsonSchema)]
pub(super) struct RejectedObject {
    /// `frame`, `observation` or `point`.
    kind: &'static str,
    camera: String,
    view: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    target: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    id: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    residual_px: Option<f64>,
    reason: String,
}

/// Returns the frames and points that never took part, then what the solver left out.
pub(super) fn rejected(solved: &SolvedRig) -> Vec<RejectedObject> {
    let before = solved.left_out.iter().map(|left_out| {
        let id = left_out.what.strip_prefix("point ").map(str::to_string);
        RejectedObject {
            kind: if id.is_some() { "point" } else { "frame" },
            camera: left_out.camera.clone(),
            view: left_out.view.clone(),
            target: None,
            id,
            residual_px: None,
            reason: left_out.reason.clone(),
        }
    });
    let found = solved.run.solution.observations.iter().enumerate();
    before.chain(found.flat_map(|(i, result)| rejected_of(solved, i, result))).collect()
}

fn rejected_of(solved: &SolvedRig, i: usize, result: &ObservationResult) -> Vec<RejectedObject> {
    let observation = &solved.run.rig.observations[i];
    let object = |kind: &'static str, id: Option<String>, residual_px: Option<f64>, reason: String| {
        let (camera, view) = (camera_name(solved, observation.camera), solved.taken_in[i].clone());
        let target = Some(target_name(solved, observation.target));
        RejectedObject { kind, camera, view, target, id, residual_px, reason }
    };
    if let Some(reason) = &result.rejected {
        return vec![object("observation", None, None, rejection_sentence(reason))];
    }
    let points = result.residuals_px.iter().zip(&solved.points[i]);
    let out = points.filter_map(|(residual, name)| match residual {
        Some((_, true)) => None,
        Some((e, false)) => {
            let reason = "farther off than its sigma allows".to_string();
            Some(object("point", Some(name.clone()), Some(e.norm()), reason))
        }
        None => Some(object("point", Some(name.clone()), None, "projects nowhere from there".to_string())),
    });
    out.collect()
}
