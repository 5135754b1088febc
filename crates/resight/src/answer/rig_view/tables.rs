//! Tables of a rig: views, pairs, and what took no part; and the poses of the targets.

use super::cameras::rows;
use super::read::{Answer, RejectedRow, SeenIn, covariance};
use crate::core::Point;
use nalgebra::Matrix3;
use schemars::JsonSchema;
use serde::Serialize;

/// Largest number of cells (views times cameras); beyond it only the views with the smallest share of points used are shown.
const MOST_CELLS: usize = 24_000;
const MOST_TARGETS: usize = 6_000;
const MOST_PAIRS: usize = 300;
const MOST_REJECTED: usize = 500;

/// What a camera, or all, saw in a view.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, JsonSchema)]
pub struct SeenCell {
    n_seen: usize,
    n_used: usize,
    rms_px: Option<f64>,
}

impl From<&SeenIn> for SeenCell {
    fn from(seen: &SeenIn) -> Self {
        SeenCell { n_seen: seen.n_seen, n_used: seen.n_used, rms_px: seen.rms_px }
    }
}

/// One view.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ViewRow {
    view: String,
    all: SeenCell,
    /// In the order of `cameras`; null where a camera saw nothing.
    cells: Vec<Option<SeenCell>>,
}

/// Two cameras.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct PairRow {
    a: String,
    b: String,
    n_shared_views: usize,
    n_shared_views_used: Option<usize>,
    distance_m: f64,
    /// Standard deviation of the distance.
    distance_sigma_m: Option<f64>,
    /// Angle of the rotation between the two.
    angle_rad: f64,
    /// Standard deviation of the rotation about the axis that is known worst.
    angle_sigma_rad: Option<f64>,
}

/// A target where it stood.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct TargetPlace {
    /// Name of the view.
    view: String,
    target: String,
    position_m: [f64; 3],
    /// Row by row: axes of the target are its columns.
    rotation: [[f64; 3]; 3],
}

/// The targets that are shown, and the positions of all.
pub(super) struct Targets {
    pub shown: Vec<TargetPlace>,
    pub one_in: usize,
    pub places: Vec<Point>,
}

pub(super) fn targets(answer: &Answer) -> Result<Targets, String> {
    let mut all = Vec::new();
    for view in &answer.views {
        for body in &view.bodies {
            let rig_from_target = body.rig_from_target.pose("a target in a view")?;
            all.push((view.view.clone(), body.target.clone(), rig_from_target));
        }
    }
    let one_in = all.len().div_ceil(MOST_TARGETS).max(1);
    let places = all.iter().map(|(_, _, rig_from_target)| rig_from_target.translation).collect();
    let place = |(view, target, rig_from_target): (String, String, crate::core::Pose)| TargetPlace {
        view,
        target,
        position_m: rig_from_target.translation.into(),
        rotation: rows(&rig_from_target),
    };
    Ok(Targets { shown: all.into_iter().step_by(one_in).map(place).collect(), one_in, places })
}

pub(super) fn views(answer: &Answer) -> Vec<ViewRow> {
    let most = (MOST_CELLS / answer.cameras.len().max(1)).max(1);
    let mut chosen: Vec<usize> = (0..answer.views.len()).collect();
    if most < chosen.len() {
        let share = |i: usize| {
            let all = answer.views[i].all;
            all.n_used as f64 / all.n_seen.max(1) as f64
        };
        chosen.sort_by(|a, b| share(*a).total_cmp(&share(*b)).then(a.cmp(b)));
        chosen.truncate(most);
        chosen.sort_unstable();
    }
    let row = |i: usize| {
        let view = &answer.views[i];
        let cells = answer.cameras.keys().map(|name| view.cameras.get(name).map(SeenCell::from));
        ViewRow { view: view.view.clone(), all: (&view.all).into(), cells: cells.collect() }
    };
    chosen.into_iter().map(row).collect()
}

/// Returns the pairs with the most shared views, and the number of the others.
pub(super) fn pairs(answer: &Answer) -> Result<(Vec<PairRow>, usize), String> {
    let mut all: Vec<_> = answer.pairs.iter().collect();
    all.sort_by_key(|pair| std::cmp::Reverse(pair.n_shared_views));
    let left_out = all.len().saturating_sub(MOST_PAIRS);
    let row = |pair: &&super::read::PairIn| {
        let b_from_a = pair.b_from_a.pose("a pair of cameras")?;
        let covariance = pair.covariance.map(|rows| covariance(&rows, "a pair of cameras")).transpose()?;
        let distance_m = b_from_a.translation.norm();
        // A small left rotation moves the origin of b perpendicular to the line between the two, so that only the translation changes the
        // distance.
        let along = b_from_a.translation / distance_m;
        let part = |at: usize| covariance.map(|c| Matrix3::from(c.fixed_view::<3, 3>(at, at)));
        let distance_sigma_m = part(3).map(|c| along.dot(&(c * along)).max(0.0).sqrt());
        Ok::<_, String>(PairRow {
            a: pair.a.clone(),
            b: pair.b.clone(),
            n_shared_views: pair.n_shared_views,
            n_shared_views_used: pair.n_shared_views_used,
            distance_m,
            distance_sigma_m: distance_sigma_m.filter(|sigma| sigma.is_finite()),
            angle_rad: b_from_a.angle_to_rad(&crate::core::Pose::identity()),
            angle_sigma_rad: part(0).map(|c| c.symmetric_eigenvalues().max().max(0.0).sqrt()),
        })
    };
    Ok((all.iter().take(MOST_PAIRS).map(row).collect::<Result<_, _>>()?, left_out))
}

/// Returns what was rejected as a whole, then the points with the largest residuals; and how many rows are left out.
pub(super) fn rejected(answer: &Answer) -> (Vec<RejectedRow>, usize) {
    let mut all = answer.rejected.clone();
    let key =
        |row: &RejectedRow| if row.kind == "point" { row.residual_px.unwrap_or(0.0) } else { f64::INFINITY };
    all.sort_by(|a, b| key(b).total_cmp(&key(a)));
    let left_out = all.len().saturating_sub(MOST_REJECTED);
    all.truncate(MOST_REJECTED);
    (all, left_out)
}
