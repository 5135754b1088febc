//! The map in sentences.

use super::{SolvedMap, Status};
use crate::core::multiview::map::{Gauge, TargetFault};
use crate::core::multiview::rig::Cause;
use crate::report::face;
use crate::report::verdict::figures;
use crate::report::words::{counted, degrees, length};

/// The scale of a survey is another where it is off by more than so many of its standard deviations …
const SCALE_SIGMAS: f64 = 4.0;
/// … and by more than a print may be.
const SCALE_OFF: f64 = 0.005;

/// `tags 3, 7`, `tag 3`.
fn tags(ids: &[u32]) -> String {
    let listed: Vec<String> = ids.iter().map(u32::to_string).collect();
    let noun = if ids.len() == 1 { "tag" } else { "tags" };
    format!("{noun} {}", listed.join(", "))
}

pub(super) fn gauge(solved: &SolvedMap) -> String {
    match &solved.solution.gauge {
        Gauge::Reference { target } => format!("the frame of tag {}", solved.ids[*target]),
        Gauge::Known { targets, .. } => {
            format!("that of the known map, by {}", tags(&solved.ids_of(targets)))
        }
    }
}

pub(super) fn contradiction(solved: &SolvedMap) -> Option<String> {
    let s = &solved.solution;
    if let Some(known) = known_contradiction(solved).or_else(|| scale_contradiction(solved)) {
        return Some(known);
    }
    if !s.verdict.is_inconsistent {
        return bridge_contradiction(solved);
    }
    let camera = &s.verdict.cameras[0];
    let way_out = match camera.cause {
        Some(Cause::Intrinsics) => {
            "the camera file does not fit these images (another camera, focus, zoom or image size): check it with `resight intrinsics --check`"
        }
        _ if s.verdict.is_noisy => {
            "the corners scatter far more than their sigmas state: blurred or rolling-shutter images, a wrong camera file or bent tags; move slower, or use another camera file"
        }
        _ => {
            "too many observations contradict the rest: tags that moved, ids that occur twice, images of another place, or a wrong camera file; see the tags and views named, and leave them out"
        }
    };
    let lost = match camera.n_lost {
        0 => String::new(),
        n => format!(", {n} of {} observations contradict the others", camera.n_observations),
    };
    let rms = figures(s.rms_px);
    let chi2 = figures(s.chi2 / s.degrees_of_freedom.max(1) as f64);
    Some(format!("the map is not to be relied on: rms {rms} px, χ²/dof {chi2} (expected 1){lost}; {way_out}"))
}

/// Where a tag stands at two places, one that alone joins two parts of the map may be two tags, and the parts be misplaced.
fn bridge_contradiction(solved: &SolvedMap) -> Option<String> {
    let s = &solved.solution;
    let is_apart = |i: &usize| {
        let is_one = |fault: &TargetFault| {
            matches!(fault, TargetFault::Elsewhere { .. } | TargetFault::Contradicts { .. })
        };
        s.targets[*i].world_from_target.is_some() && s.targets[*i].faults.iter().any(is_one)
    };
    let apart: Vec<usize> = (0..s.targets.len()).filter(is_apart).collect();
    (!s.bridges.is_empty() && !apart.is_empty()).then(|| {
        format!(
            "the map is not to be relied on: {} seem to stand at two places, and {} alone joins parts of the map, so that it may be one of these that is there twice; add views that show other tags of both parts",
            tags(&solved.ids_of(&apart)),
            tags(&solved.ids_of(&s.bridges))
        )
    })
}

/// Known tags determine the world where more of them agree than contradict.
fn known_contradiction(solved: &SolvedMap) -> Option<String> {
    let Gauge::Known { targets, .. } = &solved.solution.gauge else { return None };
    let is_displaced = |i: &usize| {
        let faults = &solved.solution.targets[*i].faults;
        faults.iter().any(|fault| matches!(fault, TargetFault::Displaced { .. }))
    };
    let displaced: Vec<usize> = (0..solved.ids.len()).filter(is_displaced).collect();
    let n_right = targets.iter().filter(|i| !is_displaced(i)).count();
    (n_right < displaced.len()).then(|| {
        format!(
            "{} of {} that are seen are not where the known map says: it is of another place or in another unit, or its ids are on other tags; check --known",
            displaced.len(),
            counted(n_right + displaced.len(), "known tag")
        )
    })
}

/// Compares lengths by the sizes of tags with those by known tags.
fn scale_contradiction(solved: &SolvedMap) -> Option<String> {
    let Gauge::Known { scale: Some([ratio, sigma]), .. } = &solved.solution.gauge else { return None };
    let off = (ratio - 1.0).abs();
    (SCALE_OFF < off && SCALE_SIGMAS * sigma < off).then(|| {
        format!(
            "lengths between the known tags are {} ± {} times those by the stated size of the tags; check --size-m (the outer edge of the black square) and the unit of the known map",
            figures(*ratio),
            figures(*sigma)
        )
    })
}

pub(super) fn message(solved: &SolvedMap) -> String {
    let s = &solved.solution;
    let n_ok = (0..solved.ids.len()).filter(|i| solved.tag_status(*i) == Status::Ok).count();
    let mut sentences = vec![format!(
        "{} of {} from {} of {}, rms {} px; world: {}",
        counted(n_ok, "tag"),
        solved.ids.len(),
        counted(s.n_views, "view"),
        counted(solved.n_images, "image"),
        figures(s.rms_px),
        gauge(solved)
    )];
    if let Some(why) = contradiction(solved) {
        sentences.insert(0, why);
    }
    for group in &s.groups {
        sentences.push(format!(
            "not connected: {} are never seen together with the others; add views that show one of them and a tag of the map",
            tags(&solved.ids_of(group))
        ));
    }
    if !s.bridges.is_empty() {
        let bridges = solved.ids_of(&s.bridges);
        sentences.push(format!(
            "{} alone joins parts of the map: that there is only one is not checked; add views that show other tags of both parts",
            tags(&bridges)
        ));
    }
    let wrong: Vec<u32> = (0..solved.ids.len())
        .filter(|i| solved.tag_status(*i) == Status::Inconsistent)
        .map(|i| solved.ids[i])
        .collect();
    if !wrong.is_empty() {
        sentences.push(format!("wrong: {}", tags(&wrong)));
    }
    let doubtful: Vec<u32> = (0..solved.ids.len())
        .filter(|i| solved.tag_status(*i) == Status::Ambiguous)
        .map(|i| solved.ids[i])
        .collect();
    if !doubtful.is_empty() {
        sentences.push(format!("two poses fit {}", tags(&doubtful)));
    }
    sentences.join("; ")
}

pub(super) fn tag(solved: &SolvedMap, i: usize) -> Option<String> {
    let said: Vec<String> =
        solved.solution.targets[i].faults.iter().map(|fault| of_fault(solved, i, fault)).collect();
    (!said.is_empty()).then(|| said.join("; "))
}

fn of_fault(solved: &SolvedMap, i: usize, fault: &TargetFault) -> String {
    let has_pose = solved.solution.targets[i].world_from_target.is_some();
    let view = |v: usize| solved.views[v].as_str();
    match fault {
        TargetFault::NotSeen => match solved.mirrored.get(&solved.ids[i]) {
            Some(_) => format!("it {}", face::MIRRORED),
            None => "no view shows it; its pose is the one known before".to_string(),
        },
        TargetFault::Alone { .. } | TargetFault::NotConnected { .. } if has_pose => {
            "no view shows it together with the others; its pose is the one known before".to_string()
        }
        TargetFault::Alone { n_views } => format!(
            "{} show it, and never another tag with it; add views that show it together with others",
            counted(*n_views, "view")
        ),
        TargetFault::NotConnected { group } => format!(
            "not connected: {} are never seen together with the others; add views that join them",
            tags(&solved.ids_of(&solved.solution.groups[*group]))
        ),
        TargetFault::Ambiguous { ratio, .. } => format!(
            "two poses fit about equally well (error ratio {}); add views of it from another side, or closer",
            figures(*ratio)
        ),
        TargetFault::Elsewhere { distance_m, rotation_rad, views, other_views, are_two, .. } => {
            let why = match are_two {
                true => "there are two tags with this id: change one of them, or leave the id out",
                false => {
                    "it was moved in between, or there are two tags with this id: map it again after it was moved, or change one of them"
                }
            };
            format!(
                "it stands at two places, {} and {} apart: at one in views {} to {}, at the other in views {} to {}; {why}",
                length(*distance_m),
                degrees(*rotation_rad),
                view(views[0]),
                view(views[1]),
                view(other_views[0]),
                view(other_views[1])
            )
        }
        TargetFault::Size { ratio, sigma } => format!(
            "its size is {} ± {} m by all other tags, stated {} m; measure it, or state its size",
            figures(ratio * solved.sizes_m[i]),
            figures(sigma * solved.sizes_m[i]),
            solved.sizes_m[i]
        ),
        TargetFault::Contradicts { n_lost, n_observations } => format!(
            "{n_lost} of {n_observations} observations contradict the map and agree on no other place: it moves, is bent, has another size than stated, or several tags have this id"
        ),
        TargetFault::Displaced { distance_m, rotation_rad } => format!(
            "it is {} and {} from where the known map says; it was moved, or the map is wrong there: measure it again",
            length(*distance_m),
            degrees(*rotation_rad)
        ),
        _ => "it cannot be used".to_string(),
    }
}
