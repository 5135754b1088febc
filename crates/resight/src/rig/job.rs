//! Solves for a rig from images or detections: the jobs of `resight rig`.

use super::detections::{self, Detections};
use super::frame_sets::{FrameSets, name_views};
use super::gather::{Gathered, gather};
use super::images::{self, CameraImage, ImageOptions};
use super::lenses;
use super::observed::{Collected, LeftOut, observations};
use super::relative::in_world;
use super::request::RigRequest;
use super::{InputFile, NamedRig, NamedTarget, RigRun, digest};
use crate::answer::{RigAnswer, SolvedRig, Status, Unsolved};
use crate::core::explanation::Tolerance;
use crate::core::multiview::rig::{
    FrameStamps, KnownDistance, RigConfig, SharedViews, UncertainTags, faults_of_unsolved, shared_views,
    solve_rig, time_offsets,
};
use crate::core::target::Feature;
use crate::core::{Error as MathError, Target};
use crate::error::Error;
use crate::report::rig::corrections_of_unsolved;
use crate::report::words::found_nowhere;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

/// Solves for the rig of cameras from images or videos of targets that they observe together.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/demo"))?;
/// use resight::rig::{CameraImage, RigRequest};
/// let (mut request, mut images) = (RigRequest::default(), Vec::new());
/// request.read_target(None, "grid.toml")?;
/// for camera in ["left", "right"] {
///     request.read_camera(Some(camera), format!("{camera}.toml"))?;
///     let image = resight::GrayImage::read(format!("{camera}.png"))?;
///     images.push(CameraImage::in_memory(camera, "the only view", image));
/// }
/// let answer = resight::rig_from_images(&images, &Default::default(), &request)?;
/// assert_eq!(answer.status(), resight::Status::Ok);
/// # Ok(())
/// # }
/// ```
///
/// An answer without a rig has a status: `NotFound` where no image shows a target, `NotConnected` where no chain of shared views connects the
/// cameras, `Error` where they do not determine it.
///
/// # Errors
/// A file that cannot be read, a target that cannot be detected, a request that is incomplete or names something unknown. An image that cannot
/// be used is left out, and the answer names it.
pub fn rig_from_images(
    images: &[CameraImage],
    options: &ImageOptions,
    request: &RigRequest,
) -> Result<RigAnswer, Error> {
    Ok(ObservedRig::from_images(images, options, request)?.solve())
}

/// Solves for the rig of cameras from points that were already detected in their images.
///
/// ```
/// # fn main() -> Result<(), Box<dyn std::error::Error>> {
/// # std::env::set_current_dir(concat!(env!("CARGO_MANIFEST_DIR"), "/../../testdata/rig"))?;
/// use resight::rig::{Detections, RigRequest};
/// let mut request = RigRequest::default();
/// request.read_camera(None, "cameras.toml")?; // Every camera of the file.
/// let answer = resight::rig_from_detections(&Detections::files(&["detections.csv".into()]), &request)?;
/// assert_eq!(answer.status(), resight::Status::Ok);
/// for camera in &answer.solved().ok_or("no rig")?.run.solution.cameras {
///     println!("{:?}", camera.cam_from_rig);
/// }
/// # Ok(())
/// # }
/// ```
///
/// # Errors
/// The errors of [`rig_from_images`]; a row with numbers that cannot be used.
pub fn rig_from_detections(detections: &Detections, request: &RigRequest) -> Result<RigAnswer, Error> {
    Ok(ObservedRig::from_detections(detections, request)?.solve())
}

/// Cameras, targets and observations, checked and in canonical order: the input of the solver.
#[derive(Debug, Clone)]
pub struct ObservedRig {
    /// The observations by camera, view and target.
    pub gathered: Gathered,
    /// Observations that never took part, with the reasons.
    pub left_out: Vec<LeftOut>,
    /// Number of frames without a counterpart from another camera.
    pub n_alone: usize,
    /// Remarks on files and observations.
    pub remarks: Vec<String>,
    reference: usize,
    known_distances: Vec<KnownDistance>,
    inputs: Vec<InputFile>,
    command: Option<String>,
    tolerance: Tolerance,
    joint_covariance: bool,
    adjust_lenses: bool,
    rolling_shutter: bool,
    /// Whether frames taken at the same time are matched by name, rather than by time.
    is_named: bool,
}

impl ObservedRig {
    /// Searches images and videos for the request's targets, on all cores.
    ///
    /// # Errors
    /// The errors of [`rig_from_images`].
    pub fn from_images(
        images: &[CameraImage],
        options: &ImageOptions,
        request: &RigRequest,
    ) -> Result<Self, Error> {
        let estimated = lenses::estimated(images, options, request)?;
        let request = estimated.as_ref().unwrap_or(request);
        let mut collected = Collected::new(request)?;
        images::collect(images, options, &mut collected)?;
        Self::of(collected, request)
    }

    /// Takes points that were already detected.
    ///
    /// # Errors
    /// The errors of [`rig_from_detections`].
    pub fn from_detections(detections: &Detections, request: &RigRequest) -> Result<Self, Error> {
        let mut collected = Collected::new(request)?;
        detections::collect(detections, &mut collected)?;
        Self::of(collected, request)
    }

    fn of(mut collected: Collected, request: &RigRequest) -> Result<Self, Error> {
        request.fix_together(&mut collected.targets)?;
        let world = request.world_target(&collected.targets)?;
        let sets = name_views(&mut collected.frames, request.sync_tolerance_s)?;
        collected.check_duplicates()?;
        collected.check_copies()?;
        let inputs = inputs(&collected.files)?;
        let Collected { cameras, targets, frames, left_out, mut remarks, .. } = collected;
        let FrameSets { n_alone, remarks: of_sets } = sets;
        remarks.extend(of_sets);
        let gathered = gather(cameras, targets, observations(frames), world);
        let names = camera_names(&gathered.rig);
        Ok(ObservedRig {
            reference: request.reference_among(&names)?,
            known_distances: request.distances_among(&names)?,
            gathered,
            left_out,
            n_alone,
            remarks,
            inputs,
            command: request.command.clone(),
            tolerance: request.tolerance,
            joint_covariance: request.joint_covariance,
            adjust_lenses: request.adjust_lenses,
            rolling_shutter: request.rolling_shutter,
            is_named: request.sync_tolerance_s.is_none(),
        })
    }

    /// Returns the answer where no camera observed a target, with what the first frame shows instead.
    pub(super) fn nothing_found(&self) -> Option<Unsolved> {
        let Gathered { rig, .. } = &self.gathered;
        let seen = || rig.cameras.iter().find_map(|c| Collected::explanation(&self.left_out, &c.name));
        let seen = if rig.observations.is_empty() { seen()? } else { return None };
        let n_images = self.left_out.iter().filter(|one| one.what == "frame").count();
        Some(Unsolved::new(Status::NotFound, found_nowhere(n_images, &seen)))
    }

    /// Checks that a target was observed and that shared views connect the cameras, then solves.
    pub fn solve(self) -> RigAnswer {
        if let Some(nothing) = self.nothing_found() {
            return RigAnswer::Unsolved(nothing);
        }
        let shared = shared_views(&self.gathered.rig.problem());
        if 1 < shared.groups.len() {
            return RigAnswer::Unsolved(not_connected(
                &shared,
                &self.gathered.rig,
                self.is_named,
                &self.left_out,
            ));
        }
        match self.solved() {
            Ok(solved) => RigAnswer::Solved(Box::new(solved)),
            Err(unsolved) => RigAnswer::Unsolved(unsolved),
        }
    }

    fn solved(self) -> Result<SolvedRig, Unsolved> {
        let Gathered { mut rig, taken_in, stamps_s, points, world_view } = self.gathered;
        let intrinsics: Vec<_> =
            rig.cameras.iter().map(|camera| camera.intrinsics_covariance.clone()).collect();
        let tags = uncertain_tags(&rig.targets);
        // Poses between two cameras need the joint covariance.
        let config = RigConfig {
            reference: self.reference,
            joint_covariance: true,
            // What views agree on about the lenses is an error of every place.
            lens_errors: true,
            known_distances: &self.known_distances,
            intrinsics: &intrinsics,
            scale_sigma: scale_sigma(&rig.targets),
            displaced_tags: &tags,
            tolerance: self.tolerance,
            ..RigConfig::default()
        };
        let failed =
            |reason: MathError, rig: &NamedRig| Unsolved::new(Status::Error, in_names(&reason, rig, &points));
        let stamps_s: Option<Vec<f64>> = stamps_s.into_iter().collect();
        let times = stamps_s.map(|stamps_s| {
            let stamps = FrameStamps { stamps_s: &stamps_s, line_time: self.rolling_shutter };
            time_offsets(&rig.problem(), &config, &stamps)
        });
        let times = times.transpose().map_err(|reason| failed(reason, &rig))?.flatten();
        if let Some(times) = &times {
            rig.observations.clone_from(&times.observations);
        }
        let config = RigConfig { time_offsets: times.as_ref(), ..config };
        let (solution, lenses) = match self.adjust_lenses {
            true => lenses::solve(&mut rig, &config),
            false => solve_rig(&rig.problem(), &config).map(|solution| (solution, Vec::new())),
        }
        .map_err(|reason| {
            let faults = faults_of_unsolved(&rig.problem(), &config);
            let Unsolved { message, .. } = failed(reason, &rig);
            Unsolved::new(Status::Error, message + &corrections_of_unsolved(&rig, &faults))
        })?;
        let in_world = world_view
            .map(|view| in_world(&rig.problem(), &config, &solution, view))
            .transpose()
            .map_err(|reason| failed(reason, &rig))?;
        let world_target = rig.observations.iter().find(|s| Some(s.view) == world_view);
        let world_target = world_target.map(|s| rig.targets[s.target].name.clone());
        Ok(SolvedRig {
            run: RigRun { rig, solution, lenses, times, inputs: self.inputs, command: self.command },
            taken_in,
            points,
            in_world,
            world_target,
            left_out: self.left_out,
            n_alone: self.n_alone,
            remarks: self.remarks,
            joint_covariance: self.joint_covariance,
        })
    }
}

/// Returns the common uncertainty of all lengths that the printed scales leave, docs/math/printed_scale.md eq. (6); for several prints the
/// largest, as if all had the same error.
fn scale_sigma(targets: &[NamedTarget]) -> f64 {
    let of_target = |target: &NamedTarget| {
        let [x, y] = target.target.as_ref()?.printed_scale()?.relative_sigma();
        Some(0.5 * x.hypot(y))
    };
    targets.iter().filter_map(of_target).fold(0.0, f64::max)
}

/// Returns the tags of maps that are uncertain: together where the map has their covariance together, each by itself where it has tolerances.
pub(super) fn uncertain_tags(targets: &[NamedTarget]) -> Vec<UncertainTags> {
    let mut groups = Vec::new();
    for (index, named) in targets.iter().enumerate() {
        let Some(target) = &named.target else { continue };
        let Target::TagMap(map) = target.design() else { continue };
        let corners = |tag: &usize| {
            let id = map.tags[*tag].id;
            let corner = |corner| target.point(Feature { id, corner }).map(|point| point.position);
            Some([corner(0)?, corner(1)?, corner(2)?, corner(3)?])
        };
        let mut add = |tags: Vec<usize>| {
            let corners: Vec<_> = tags.iter().filter_map(corners).collect();
            if corners.len() == tags.len() {
                let covariance = map.covariance_of(&tags);
                groups.push(UncertainTags { target: index, corners_in_target: corners, covariance });
            }
        };
        if map.joint_covariance.is_some() {
            add((0..map.tags.len()).collect());
            continue;
        }
        let is_uncertain = |tag: &usize| 0.0 < map.tags[*tag].sigma_m.max(map.tags[*tag].sigma_rad);
        (0..map.tags.len()).filter(is_uncertain).for_each(|tag| add(vec![tag]));
    }
    groups
}

fn camera_names(rig: &NamedRig) -> Vec<String> {
    rig.cameras.iter().map(|camera| camera.name.clone()).collect()
}

/// Lists each file once, sorted by path, with its digest.
fn inputs(files: &[PathBuf]) -> Result<Vec<InputFile>, Error> {
    let mut files: Vec<&Path> = files.iter().map(PathBuf::as_path).collect();
    files.sort();
    files.dedup();
    let digest = |path: &Path| -> Result<InputFile, Error> {
        Ok(InputFile { path: path.display().to_string(), sha256: digest::sha256_of_file(path)? })
    };
    files.into_iter().map(digest).collect()
}

/// Describes an error of the solver with names instead of indices.
fn in_names(reason: &MathError, rig: &NamedRig, points: &[Vec<String>]) -> String {
    let camera = |i: usize| rig.cameras[i].name.as_str();
    let target = |i: usize| rig.targets[i].name.as_str();
    let listed = |cameras: &[usize]| cameras.iter().map(|i| camera(*i)).collect::<Vec<_>>().join(", ");
    match reason {
        MathError::CameraNotObserved { camera: i, n_observations } => format!(
            "camera {} has {n_observations} observations and none gives a pose; add views in which it sees a target with four or more points, or leave it out",
            camera(*i)
        ),
        MathError::CamerasUnconnected { first, second, n_rejected, needed } => {
            let aside = match n_rejected {
                0 => String::new(),
                n => {
                    format!(" once {n} observations that contradict the others or give no pose are set aside")
                }
            };
            format!("cameras [{}] and [{}] are not connected{aside}; {needed}", listed(first), listed(second))
        }
        MathError::TargetUnconnected { target: i, .. } => format!(
            "target {} is never seen together with another target of its body; add a view in which one camera sees both, or leave --fixed-together (column body) out",
            target(*i)
        ),
        MathError::InvalidObservation { camera: c, view, target: t, reason } => {
            let found = rig.observations.iter().position(|s| (s.camera, s.view, s.target) == (*c, *view, *t));
            let reason = match (&**reason, found) {
                (MathError::Coincident { first, second, where_ }, Some(i)) => {
                    let (first, second) = (&points[i][*first], &points[i][*second]);
                    format!("points {first} and {second} coincide {where_}; remove one of them")
                }
                (reason, _) => reason.to_string(),
            };
            format!("camera {}, view {}, target {}: {reason}", camera(*c), rig.views[*view], target(*t))
        }
        other => other.to_string(),
    }
}

/// Explains that cameras of different groups have no view names in common, as where files or rows are named after their camera.
fn views_apart(shared: &SharedViews, rig: &NamedRig) -> Option<String> {
    let mut seeing = shared
        .groups
        .iter()
        .filter_map(|group| group.iter().find(|camera| 0 < shared.counts[**camera][**camera]));
    let (first, second) = (*seeing.next()?, *seeing.next()?);
    let views = |camera: usize| -> BTreeSet<usize> {
        rig.observations.iter().filter(|seen| seen.camera == camera).map(|seen| seen.view).collect()
    };
    let (of_first, of_second) = (views(first), views(second));
    let [a, b] = [of_first.first()?, of_second.first()?].map(|view| &rig.views[*view]);
    of_first.is_disjoint(&of_second).then(|| {
        let [first, second] = [first, second].map(|camera| &rig.cameras[camera].name);
        format!(
            "; views are matched by their names, and {first} (first view `{a}`) and {second} (first view `{b}`) share none: name what was taken at one time alike"
        )
    })
}

/// Returns the answer for groups of cameras that no chain of shared views connects.
fn not_connected(shared: &SharedViews, rig: &NamedRig, is_named: bool, left_out: &[LeftOut]) -> Unsolved {
    let names = camera_names(rig);
    let of_group = |group: &Vec<usize>| group.iter().map(|camera| names[*camera].clone()).collect();
    let groups: Vec<Vec<String>> = shared.groups.iter().map(of_group).collect();
    let blind: Vec<&str> =
        (0..names.len()).filter(|i| shared.counts[*i][*i] == 0).map(|i| names[i].as_str()).collect();
    let listed: Vec<String> = groups.iter().map(|group| group.join(", ")).collect();
    let blind_cameras = blind.clone();
    let blind = match &blind[..] {
        [] => String::new(),
        [only] => format!("; camera {only} saw nothing at all"),
        several => format!("; cameras {} saw nothing at all", several.join(", ")),
    };
    let seen = blind_cameras.iter().find_map(|name| Collected::explanation(left_out, name));
    let seen = seen.map(|seen| format!(" ({seen})")).unwrap_or_default();
    let apart = is_named.then(|| views_apart(shared, rig)).flatten().unwrap_or_default();
    let message = format!(
        "nothing connects the cameras {}{blind}{seen}{apart}; add views in which a camera of one group and a camera of another see the same target at the same time (a chain is enough), or, for targets that are mounted together, say --fixed-together",
        listed.iter().map(|group| format!("[{group}]")).collect::<Vec<_>>().join(" and ")
    );
    Unsolved { groups, ..Unsolved::new(Status::NotConnected, message) }
}
