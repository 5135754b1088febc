//! Why there is no map.

use super::super::{Status, Unsolved};
use crate::core::Error;
use crate::core::multiview::map::{Gauge, MapSolution};
use crate::map::{MapRequest, Observed};
use crate::report::face;
use crate::report::words::counted;
use std::collections::BTreeMap;

/// No tag in any view.
pub(crate) fn nothing_seen(
    observed: &Observed,
    request: &MapRequest,
    mirrored: &BTreeMap<u32, usize>,
) -> Unsolved {
    if let Some(id) = mirrored.keys().next() {
        return Unsolved::new(Status::Inconsistent, format!("tag {id} {}", face::MIRRORED));
    }
    let read = observed.views.len();
    let unread = observed.left_out.iter().find(|one| one.what == "image");
    let (status, message) = match (read, unread) {
        (0, Some(one)) => (
            Status::Error,
            format!(
                "none of {} can be used; {}: {}",
                counted(observed.n_images.max(1), "image"),
                one.view,
                one.reason
            ),
        ),
        _ => (
            Status::NotFound,
            format!(
                "no tag of family {} in {}; check --family (`resight detect IMAGE --family any` finds out), light and sharpness",
                request.family,
                counted(read, "view")
            ),
        ),
    };
    Unsolved::new(status, message)
}

/// The map is not in the world asked for, because no view joins it to that.
pub(crate) fn other_world(solution: &MapSolution, request: &MapRequest, ids: &[u32]) -> Option<Unsolved> {
    let Gauge::Reference { target } = &solution.gauge else { return None };
    let message = match (&request.known, request.reference) {
        (Some(_), _) => {
            "no view shows a tag of --known together with another tag, so that nothing places the map in its world; add views that do, or leave --known out".to_string()
        }
        (None, Some(id)) if ids.get(*target) != Some(&id) => format!(
            "--reference {id}: no view shows this tag together with another; add views that do, or choose another reference"
        ),
        _ => return None,
    };
    Some(Unsolved::new(Status::NotConnected, message))
}

/// The adjustment refused.
pub(crate) fn failed(
    reason: &Error,
    observed: &Observed,
    ids: &[u32],
    mirrored: &BTreeMap<u32, usize>,
) -> Unsolved {
    let seen: std::collections::BTreeSet<u32> =
        observed.views.iter().flat_map(|view| view.tags.iter().map(|(id, _)| *id)).collect();
    let seen: Vec<u32> = seen.into_iter().filter(|id| !mirrored.contains_key(id)).collect();
    match (reason, &seen[..]) {
        (Error::EmptyMap { .. }, [only]) => Unsolved::new(
            Status::NotConnected,
            format!(
                "only tag {only} is seen, so that there is nothing to map; take views that show two tags or more (one tag alone is a target: `resight locate`)"
            ),
        ),
        (Error::EmptyMap { n_views, .. }, _) => Unsolved {
            groups: seen.iter().map(|id| vec![id.to_string()]).collect(),
            ..Unsolved::new(
                Status::NotConnected,
                format!(
                    "none of {} shows two tags, so that nothing relates the {} seen; take views that show two or more at a time, each overlapping with the next",
                    counted(*n_views, "view"),
                    counted(seen.len(), "tag")
                ),
            )
        },
        (Error::InvalidObservation { view, target, reason, .. }, _) => {
            let (view, id) = (observed.views.get(*view), ids.get(*target));
            let view = view.map_or("", |view| view.name.as_str());
            Unsolved::new(
                Status::Error,
                format!("view {view}, tag {}: {reason}", id.copied().unwrap_or_default()),
            )
        }
        (reason, _) => Unsolved::new(Status::Error, reason.to_string()),
    }
}
