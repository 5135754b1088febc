//! From observations to the answer.

use super::{MapImage, MapLeftOut, MapRequest, Observed, TagRow, TagView, observed, table};
use crate::answer::map::{MapAnswer, SolvedMap, unsolved};
use crate::core::correspondence::correspond;
use crate::core::multiview::map::{KnownTarget, MapConfig, MapObservation, MapProblem, solve_map};
use crate::core::target::{Tag, TagMap};
use crate::core::{Camera, Correspondence, Target};
use crate::error::Error;
use crate::report::face;
use nalgebra::DMatrix;
use std::collections::{BTreeMap, BTreeSet};

/// Makes a map from images or a video, in the order in which they were taken.
///
/// # Errors
/// A family or size that does not exist, a known map of another family, an image file list that is empty. An image that cannot be used is left
/// out, and the answer names it.
pub fn map_from_images(images: &[MapImage], request: &MapRequest) -> Result<MapAnswer, Error> {
    request.check()?;
    solved(observed::of_images(images, request)?, request)
}

/// Makes a map from corners of tags that were already found, in the order in which they were seen.
///
/// # Errors
/// As of [`map_from_images`]; rows with numbers that cannot be used.
pub fn map_from_rows(rows: &[TagRow], request: &MapRequest) -> Result<MapAnswer, Error> {
    request.check()?;
    solved(table::of_rows(rows, request)?, request)
}

/// Largest number of tags: all of them have one covariance together, whose rows are six for each.
const MOST_TAGS: usize = 500;

/// Observations by index, and the names of the indices.
struct Indexed {
    ids: Vec<u32>,
    observations: Vec<MapObservation>,
    /// Ids that were seen mirrored, with the number of views.
    mirrored: BTreeMap<u32, usize>,
}

fn solved(mut observed: Observed, request: &MapRequest) -> Result<MapAnswer, Error> {
    let camera = observed.camera.camera.clone();
    let indexed = indexed(&mut observed, &camera, request)?;
    if MOST_TAGS < indexed.ids.len() {
        let n = indexed.ids.len();
        return Err(Error::request(format!(
            "{n} tags are seen or known; a map has at most {MOST_TAGS}: map parts"
        )));
    }
    if indexed.observations.is_empty() {
        return Ok(MapAnswer::Unsolved(unsolved::nothing_seen(&observed, request, &indexed.mirrored)));
    }
    let index = |id: u32| indexed.ids.binary_search(&id).ok();
    let reference = match request.reference {
        Some(id) => Some(index(id).ok_or_else(|| not_seen(id, &indexed.ids))?),
        None => None,
    };
    let known: Vec<KnownTarget> = request
        .known
        .iter()
        .flat_map(|map| &map.tags)
        .filter_map(|tag| Some(KnownTarget { target: index(tag.id)?, world_from_target: tag.world_from_tag }))
        .collect();
    let all = |map: &TagMap| map.covariance_of(&(0..map.tags.len()).collect::<Vec<usize>>());
    let known_covariance: Option<DMatrix<f64>> = request.known.as_ref().map(all);
    let problem = MapProblem {
        camera: &camera,
        n_views: observed.views.len(),
        n_targets: indexed.ids.len(),
        observations: &indexed.observations,
    };
    let config = MapConfig {
        reference,
        known: &known,
        known_covariance: known_covariance.as_ref(),
        intrinsics: observed.camera.intrinsics_covariance.as_ref(),
        scale_sigma: 0.0,
    };
    match solve_map(&problem, &config) {
        Err(reason) => {
            Ok(MapAnswer::Unsolved(unsolved::failed(&reason, &observed, &indexed.ids, &indexed.mirrored)))
        }
        Ok(solution) => {
            if let Some(reason) = unsolved::other_world(&solution, request, &indexed.ids) {
                return Ok(MapAnswer::Unsolved(reason));
            }
            let sizes_m = indexed.ids.iter().map(|id| request.size_of(*id).unwrap_or_default()).collect();
            Ok(MapAnswer::Solved(Box::new(SolvedMap {
                family: request.family.clone(),
                known_ids: request.known.iter().flat_map(|map| &map.tags).map(|tag| tag.id).collect(),
                n_images: observed.n_images,
                views: observed.views.into_iter().map(|view| view.name).collect(),
                left_out: observed.left_out,
                remarks: observed.remarks,
                ids: indexed.ids,
                sizes_m,
                mirrored: indexed.mirrored,
                solution,
                joint_covariance: request.joint_covariance,
            })))
        }
    }
}

fn not_seen(id: u32, ids: &[u32]) -> Error {
    let seen: Vec<String> = ids.iter().map(u32::to_string).collect();
    Error::request(format!(
        "--reference {id}: no view shows this tag; those seen are {}",
        if seen.is_empty() { "none".to_string() } else { seen.join(", ") }
    ))
}

/// Brings views into the form of the solver; tags that are seen mirrored are left out.
fn indexed(observed: &mut Observed, camera: &Camera, request: &MapRequest) -> Result<Indexed, Error> {
    let seen = observed.views.iter().flat_map(|view| view.tags.iter().map(|(id, _)| *id));
    let known = request.known.iter().flat_map(|map| map.tags.iter().map(|tag| tag.id));
    let ids: BTreeSet<u32> = seen.chain(known).collect();
    let ids: Vec<u32> = ids.into_iter().collect();
    let (mut observations, mut mirrored) = (Vec::new(), BTreeMap::new());
    for (view, TagView { name, tags }) in observed.views.iter().enumerate() {
        for (id, detections) in tags {
            let Ok(target) = ids.binary_search(id) else { continue };
            let Some(size_m) = request.size_of(*id) else {
                return Err(Error::request(format!(
                    "tag {id} has no size; state the outer edge of the black square of all tags with --size-m, or of this one"
                )));
            };
            let tag = Target::Tag(Tag { family: request.family.clone(), id: *id, size_m });
            let mut leave_out = |reason: String| {
                let (view, what) = (name.clone(), format!("tag {id}"));
                observed.left_out.push(MapLeftOut { view, what, reason });
            };
            if face::is_mirrored(&tag, detections) == Some(true) {
                *mirrored.entry(*id).or_insert(0) += 1;
                leave_out(format!("it {}", face::MIRRORED));
                continue;
            }
            let (found, skipped) = correspond(detections, &tag, camera);
            for reason in skipped.into_iter().filter_map(|skipped| skipped.reason) {
                leave_out(reason.to_string());
            }
            let seen: Vec<_> = found.into_iter().map(|(_, point)| point).collect();
            if 4 <= seen.len() && !has_equal_corners(&seen) {
                observations.push(MapObservation { view, target, seen });
            } else if !seen.is_empty() {
                leave_out(format!("it has {} different corners; 4 are needed", seen.len()));
            }
        }
    }
    Ok(Indexed { ids, observations, mirrored })
}

/// Returns whether two corners have one pixel.
fn has_equal_corners(seen: &[Correspondence]) -> bool {
    seen.iter().enumerate().any(|(i, a)| seen[..i].iter().any(|b| a.pixel == b.pixel))
}
