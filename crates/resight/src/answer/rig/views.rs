//! The observations of each view of a rig.

use super::{SolvedRig, camera_name, first_target};
use crate::answer::TransformObject;
use crate::core::multiview::rig::{BodyInView, ObservationResult};
use crate::report::words::{sigmas, translation_sigma_m};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

#[derive(Serialize, JsonSchema)]
pub(super) struct ViewObject {
    view: String,
    n_seen: usize,
    n_used: usize,
    rms_px: Option<f64>,
    cameras: BTreeMap<String, SeenObject>,
    bodies: Vec<BodyObject>,
}

#[derive(Serialize, JsonSchema, Default)]
struct SeenObject {
    n_seen: usize,
    n_used: usize,
    rms_px: Option<f64>,
}

#[derive(Serialize, JsonSchema)]
struct BodyObject {
    body: usize,
    /// Of the first target of the body.
    target: String,
    rig_from_target: TransformObject,
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    /// Of the translation of `rig_from_target` itself, which a rotation changes too.
    sigma_translation_m: [f64; 3],
    n_used: usize,
    rms_px: f64,
}

pub(super) fn views(solved: &SolvedRig) -> Vec<ViewObject> {
    let mut views: Vec<ViewObject> = solved.run.rig.views.iter().map(|name| empty_view(name)).collect();
    let s = &solved.run.solution;
    let mut sums = vec![Sums::default(); views.len()];
    for (observation, result) in solved.run.rig.observations.iter().zip(&s.observations) {
        let sum = Sums::of(result);
        sums[observation.view].add(sum);
        let of_camera =
            views[observation.view].cameras.entry(camera_name(solved, observation.camera)).or_default();
        // If one camera sees two targets in a view, their squared residuals are added.
        let earlier = of_camera.rms_px.map_or(0.0, |rms| rms * rms * of_camera.n_used as f64);
        let total = Sums {
            n_seen: of_camera.n_seen + sum.n_seen,
            n_used: of_camera.n_used + sum.n_used,
            squares: earlier + sum.squares,
        };
        *of_camera = SeenObject { n_seen: total.n_seen, n_used: total.n_used, rms_px: total.rms_px() };
    }
    for (view, sum) in views.iter_mut().zip(&sums) {
        (view.n_seen, view.n_used, view.rms_px) = (sum.n_seen, sum.n_used, sum.rms_px());
    }
    for body in &s.bodies {
        views[body.view].bodies.push(body_object(solved, body));
    }
    views
}

fn empty_view(name: &str) -> ViewObject {
    let (cameras, bodies) = (BTreeMap::new(), Vec::new());
    ViewObject { view: name.to_string(), n_seen: 0, n_used: 0, rms_px: None, cameras, bodies }
}

/// Sums over residuals.
#[derive(Clone, Copy, Default)]
struct Sums {
    n_seen: usize,
    n_used: usize,
    squares: f64,
}

impl Sums {
    fn of(result: &ObservationResult) -> Self {
        let used = result.residuals_px.iter().flatten().filter(|(_, took_part)| *took_part);
        let (n_used, squares) = used.fold((0, 0.0), |(n, sum), (e, _)| (n + 1, sum + e.norm_squared()));
        Sums { n_seen: result.residuals_px.len(), n_used, squares }
    }

    fn add(&mut self, other: Sums) {
        self.n_seen += other.n_seen;
        self.n_used += other.n_used;
        self.squares += other.squares;
    }

    fn rms_px(&self) -> Option<f64> {
        (0 < self.n_used).then(|| (self.squares / self.n_used as f64).sqrt())
    }
}

fn body_object(solved: &SolvedRig, body: &BodyInView) -> BodyObject {
    let (sigma_rad, sigma_m) = sigmas(&body.covariance);
    BodyObject {
        body: body.body,
        target: first_target(solved, body.body),
        rig_from_target: body.rig_from_body.into(),
        sigma_rad,
        sigma_m,
        sigma_translation_m: translation_sigma_m(&body.rig_from_body, &body.covariance),
        n_used: body.n_used,
        rms_px: body.rms_px,
    }
}
