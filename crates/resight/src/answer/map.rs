//! The answer of the job that makes a map of tags, and the JSON object that it becomes.

pub(crate) mod unsolved;
mod words;

use super::placed::JointObject;
use super::{SchemaNumber, Status, TransformObject, Unsolved, rows};
use crate::convert::of_one_tolerance;
use crate::core::multiview::map::{Gauge, MapSolution, TargetFault, TargetInMap};
use crate::core::target::{MapTag, TagMap};
use crate::core::{Matrix6, Target};
use crate::formats::{Field, WriteError, own_target_file, write_field_layout};
use crate::map::MapLeftOut;
use crate::report::words::{sigmas, translation_sigma_m};
use nalgebra::DMatrix;
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use std::collections::BTreeMap;

/// A map of tags, or why there is none. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum MapAnswer {
    /// The map; its status says whether all of it can be used.
    Solved(Box<SolvedMap>),
    /// Why there is none.
    Unsolved(Unsolved),
}

/// A map with everything needed to report it.
#[derive(Debug, Clone)]
pub struct SolvedMap {
    /// Family of the tags.
    pub family: String,
    /// The tags, ascending: those seen and those known before.
    pub ids: Vec<u32>,
    /// Their stated sizes, metres.
    pub sizes_m: Vec<f64>,
    /// Ids of the tags whose poses were known before.
    pub known_ids: Vec<u32>,
    /// Number of images or frames searched.
    pub n_images: usize,
    /// Names of the views, in the order in which they were taken.
    pub views: Vec<String>,
    /// What took no part, with the reasons.
    pub left_out: Vec<MapLeftOut>,
    /// What is unusual about the input.
    pub remarks: Vec<String>,
    /// Tags that were seen mirrored, with the number of views.
    pub mirrored: BTreeMap<u32, usize>,
    /// The solution; its indices are those of `ids` and `views`.
    pub solution: MapSolution,
    /// Whether the JSON object holds the covariance of all tags together.
    pub joint_covariance: bool,
}

impl MapAnswer {
    /// Returns whether the answer may be relied on.
    pub fn status(&self) -> Status {
        match self {
            MapAnswer::Solved(solved) => solved.status(),
            MapAnswer::Unsolved(unsolved) => unsolved.status,
        }
    }

    /// Returns the map, where there is one.
    pub fn solved(&self) -> Option<&SolvedMap> {
        match self {
            MapAnswer::Solved(solved) => Some(solved),
            MapAnswer::Unsolved(_) => None,
        }
    }
}

impl SolvedMap {
    /// Returns whether all of the map may be relied on: the worst of the adjustment's verdict and of the tags.
    pub fn status(&self) -> Status {
        if self.contradiction().is_some() {
            return Status::Inconsistent;
        }
        let of_tags = (0..self.ids.len()).map(|i| self.tag_status(i));
        of_tags.max_by_key(|status| severity(*status)).unwrap_or(Status::Error)
    }

    /// Returns the status of a tag, by its index.
    pub fn tag_status(&self, i: usize) -> Status {
        let tag = &self.solution.targets[i];
        let of_fault = |fault: &TargetFault| match fault {
            TargetFault::NotSeen if self.mirrored.contains_key(&self.ids[i]) => Status::Inconsistent,
            // Known before and not seen now: it is as it was.
            TargetFault::NotSeen if tag.world_from_target.is_some() => Status::Ok,
            TargetFault::NotSeen => Status::NotFound,
            TargetFault::Alone { .. } | TargetFault::NotConnected { .. }
                if tag.world_from_target.is_some() =>
            {
                Status::Ok
            }
            TargetFault::Alone { .. } | TargetFault::NotConnected { .. } => Status::NotConnected,
            TargetFault::Ambiguous { .. } => Status::Ambiguous,
            _ => Status::Inconsistent,
        };
        tag.faults.iter().map(of_fault).max_by_key(|status| severity(*status)).unwrap_or(Status::Ok)
    }

    /// Returns the map of the tags that may be relied on, as a target that other commands read; `None` where the whole is inconsistent or no tag
    /// is left.
    pub fn target(&self) -> Option<Target> {
        if self.contradiction().is_some() {
            return None;
        }
        let is_good = |position: &usize| self.tag_status(self.solution.placed[*position]) == Status::Ok;
        let kept: Vec<usize> = (0..self.solution.placed.len()).filter(is_good).collect();
        let tag = |position: &usize| {
            let i = self.solution.placed[*position];
            let tag = &self.solution.targets[i];
            let world_from_tag = tag.world_from_target?;
            let (sigma_rad, _) = sigmas(&tag.covariance);
            let sigma_m = translation_sigma_m(&world_from_tag, &tag.covariance);
            let rms = |x: [f64; 3]| (x.iter().map(|x| x * x).sum::<f64>() / 3.0).sqrt();
            let (sigma_m, sigma_rad) = (rms(sigma_m), rms(sigma_rad));
            Some(MapTag { id: self.ids[i], size_m: self.sizes_m[i], world_from_tag, sigma_m, sigma_rad })
        };
        let tags: Vec<MapTag> = kept.iter().filter_map(tag).collect();
        let at = |i: usize| 6 * kept[i / 6] + i % 6;
        let n = 6 * kept.len();
        let joint = DMatrix::from_fn(n, n, |i, j| self.solution.joint_covariance[(at(i), at(j))]);
        (!tags.is_empty()).then(|| {
            Target::TagMap(TagMap { family: self.family.clone(), tags, joint_covariance: Some(joint) })
        })
    }

    /// Returns the file of the map (TOML) that other commands read, with the covariance of its tags together; `None` where there is no map that
    /// may be relied on.
    pub fn file(&self) -> Option<String> {
        let status = self.status();
        let why = if status == Status::Ok { String::new() } else { format!(", status {}", status.name()) };
        let left_out: Vec<String> = (0..self.ids.len())
            .filter(|i| self.tag_status(*i) != Status::Ok)
            .map(|i| self.ids[i].to_string())
            .collect();
        let left_out = match &left_out[..] {
            [] => String::new(),
            ids => format!("\nLeft out, because they are not to be relied on: tags {}.", ids.join(", ")),
        };
        let comment = format!("Map of tags by resight map{why}. World: {}.{left_out}", words::gauge(self));
        Some(own_target_file(&self.target()?, &comment))
    }

    /// Returns the map as a WPILib field layout; without a size of the field, that of the box around the tags.
    ///
    /// # Errors
    /// A map that may not be relied on, or that a layout cannot hold: tags of several sizes.
    pub fn field_layout(&self, size_m: Option<[f64; 2]>) -> Result<String, WriteError> {
        let Some(Target::TagMap(map)) = self.target() else {
            return Err(WriteError("the map is not to be relied on; no field layout is written".into()));
        };
        let [length_m, width_m] = size_m.unwrap_or_else(|| extent_m(&map));
        let target = Target::TagMap(of_one_tolerance(&map));
        Ok(write_field_layout(&target, &Field { length_m, width_m, keys_of_2027: false })?.text)
    }

    /// Explains why nothing of the map may be relied on; `None` where the adjustment is consistent.
    pub fn contradiction(&self) -> Option<String> {
        words::contradiction(self)
    }

    /// Returns the answer in sentences, one for each thing that matters.
    pub fn message(&self) -> String {
        words::message(self)
    }

    /// Returns what is wrong with a tag, by its index, with the way out; `None` where nothing is.
    pub fn tag_message(&self, i: usize) -> Option<String> {
        words::tag(self, i)
    }

    /// Returns the frame of the world in words.
    pub fn gauge_words(&self) -> String {
        words::gauge(self)
    }

    fn ids_of(&self, indices: &[usize]) -> Vec<u32> {
        indices.iter().map(|i| self.ids[*i]).collect()
    }
}

/// Orders statuses by how little of an answer can be used.
fn severity(status: Status) -> usize {
    match status {
        Status::Ok => 0,
        Status::NotFound => 1,
        Status::Ambiguous => 2,
        Status::NotConnected => 3,
        _ => 4,
    }
}

/// Returns the sides of the box around the tags along x and y, at least a metre.
fn extent_m(map: &TagMap) -> [f64; 2] {
    [0, 1].map(|axis| {
        let along = map.tags.iter().map(|tag| tag.world_from_tag.translation[axis]);
        let (low, high) =
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), x| (x.min(low), x.max(high)));
        (high - low).max(1.0)
    })
}

impl Serialize for SolvedMap {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        object(self).serialize(serializer)
    }
}

/// A map of tags.
#[derive(Serialize, JsonSchema)]
pub(super) struct MapObject {
    schema: SchemaNumber,
    /// `map`.
    kind: &'static str,
    status: Status,
    message: String,
    /// Why nothing of the map may be relied on; null where the adjustment is consistent.
    contradiction: Option<String>,
    family: String,
    world: WorldObject,
    /// The tags, by id.
    tags: Vec<TagObject>,
    /// Groups of ids that no view joins to the map.
    groups: Vec<Vec<u32>>,
    /// Ids that alone join two parts of the map: a second tag with such an id would go unnoticed.
    bridges: Vec<u32>,
    n_images: usize,
    /// Views that took part.
    n_views: usize,
    n_seen: usize,
    n_used: usize,
    rms_px: f64,
    chi2: f64,
    degrees_of_freedom: usize,
    noise_scale: f64,
    /// Variances beyond that, for errors that whole views share.
    view_scale: f64,
    /// Views that lose too many of their tags.
    contradicting_views: Vec<String>,
    left_out: Vec<LeftOutObject>,
    remarks: Vec<String>,
    /// With --joint-covariance: of the left motions of all tags, world frame.
    #[serde(skip_serializing_if = "Option::is_none")]
    joint_covariance: Option<JointObject>,
}

/// What determines the world.
#[derive(Serialize, JsonSchema)]
struct WorldObject {
    /// The tag whose frame it is; null where known tags determine it.
    reference: Option<u32>,
    /// The known tags that determine it.
    known: Vec<u32>,
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    /// Lengths by the known tags over lengths by the stated sizes; null with fewer than two known tags.
    scale: Option<f64>,
    scale_sigma: Option<f64>,
}

/// One tag.
#[derive(Serialize, JsonSchema)]
struct TagObject {
    id: u32,
    status: Status,
    /// What is wrong with it, and the way out; null where nothing is.
    message: Option<String>,
    size_m: f64,
    /// x_in_world = world_from_tag · x_in_tag; null where it has no pose.
    world_from_tag: Option<TransformObject>,
    /// 6×6 covariance of its small left motion `[rotation_rad; translation_m]`, world frame.
    covariance: Option<[[f64; 6]; 6]>,
    /// Standard deviations of the rotation about the world's axes.
    sigma_rad: Option<[f64; 3]>,
    /// Standard deviations of the position of its centre along the world's axes.
    sigma_m: Option<[f64; 3]>,
    n_views: usize,
    /// Its observations that contradict the map.
    n_rejected: usize,
    rms_px: f64,
    /// True size over stated size by all other tags; null where nothing tells.
    size_ratio: Option<f64>,
    size_ratio_sigma: Option<f64>,
    /// Other poses of the tag: a second solution, or another place where it stood.
    others: Vec<TransformObject>,
    is_known: bool,
}

#[derive(Serialize, JsonSchema)]
struct LeftOutObject {
    view: String,
    what: String,
    reason: String,
}

fn object(solved: &SolvedMap) -> MapObject {
    let s = &solved.solution;
    let left_out = |one: &MapLeftOut| LeftOutObject {
        view: one.view.clone(),
        what: one.what.clone(),
        reason: one.reason.clone(),
    };
    let names = solved.ids_of(&s.placed).iter().map(u32::to_string).collect();
    MapObject {
        schema: SchemaNumber,
        kind: "map",
        status: solved.status(),
        message: solved.message(),
        contradiction: solved.contradiction(),
        family: solved.family.clone(),
        world: world(solved),
        tags: (0..solved.ids.len()).map(|i| tag(solved, i)).collect(),
        groups: s.groups.iter().map(|group| solved.ids_of(group)).collect(),
        bridges: solved.ids_of(&s.bridges),
        n_images: solved.n_images,
        n_views: s.n_views,
        n_seen: s.n_seen,
        n_used: s.n_used,
        rms_px: s.rms_px,
        chi2: s.chi2,
        degrees_of_freedom: s.degrees_of_freedom,
        noise_scale: s.noise_scale,
        view_scale: s.view_scale,
        contradicting_views: s.contradicting_views.iter().map(|view| solved.views[*view].clone()).collect(),
        left_out: solved.left_out.iter().map(left_out).collect(),
        remarks: solved.remarks.clone(),
        joint_covariance: solved.joint_covariance.then(|| JointObject::of(names, &s.joint_covariance)),
    }
}

fn world(solved: &SolvedMap) -> WorldObject {
    match &solved.solution.gauge {
        Gauge::Reference { target } => WorldObject {
            reference: Some(solved.ids[*target]),
            known: Vec::new(),
            chi2: None,
            degrees_of_freedom: None,
            scale: None,
            scale_sigma: None,
        },
        Gauge::Known { targets, chi2, degrees_of_freedom, scale } => WorldObject {
            reference: None,
            known: solved.ids_of(targets),
            chi2: Some(*chi2),
            degrees_of_freedom: Some(*degrees_of_freedom),
            scale: scale.map(|s| s[0]),
            scale_sigma: scale.map(|s| s[1]),
        },
    }
}

fn tag(solved: &SolvedMap, i: usize) -> TagObject {
    let id = solved.ids[i];
    let found: &TargetInMap = &solved.solution.targets[i];
    let with_pose =
        |of: fn(&Matrix6) -> [[f64; 6]; 6]| found.world_from_target.map(|_| of(&found.covariance));
    let other = |fault: &TargetFault| match fault {
        TargetFault::Ambiguous { world_from_target, .. }
        | TargetFault::Elsewhere { world_from_target, .. } => Some((*world_from_target).into()),
        _ => None,
    };
    let scale = found.scale.as_ref().filter(|scale| scale.sigma.is_finite());
    TagObject {
        id,
        status: solved.tag_status(i),
        message: solved.tag_message(i),
        size_m: solved.sizes_m[i],
        world_from_tag: found.world_from_target.map(Into::into),
        covariance: with_pose(rows),
        sigma_rad: found.world_from_target.map(|_| sigmas(&found.covariance).0),
        sigma_m: found.world_from_target.map(|pose| translation_sigma_m(&pose, &found.covariance)),
        n_views: found.n_used,
        n_rejected: found.n_rejected,
        rms_px: found.rms_px,
        size_ratio: scale.map(|scale| scale.ratio),
        size_ratio_sigma: scale.map(|scale| scale.sigma),
        others: found.faults.iter().filter_map(other).collect(),
        is_known: solved.known_ids.contains(&id),
    }
}
