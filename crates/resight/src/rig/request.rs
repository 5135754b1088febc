//! The request for a rig, except for what its cameras observed.

use super::NamedTarget;
use crate::core::Target;
use crate::core::explanation::Tolerance;
use crate::core::multiview::rig::KnownDistance;
use crate::error::Error;
use crate::formats::{self, NamedCamera, TagOptions};
use crate::input::not_among;
use std::path::{Path, PathBuf};

/// The cameras and targets of a rig, and all prior knowledge about them.
///
/// Cameras and targets come from files ([`RigRequest::read_camera`], [`RigRequest::read_target`]) or from memory
/// ([`RigRequest::add_camera`], [`RigRequest::add_target`]).
#[derive(Debug, Clone, Default)]
pub struct RigRequest {
    /// The cameras, with unique names. Their placements are not used.
    pub cameras: Vec<NamedCamera>,
    /// The targets, with unique names. Detections that state each point's position need none.
    pub targets: Vec<(String, Target)>,
    /// Names of targets that are mounted on one body, a list for each body. Their poses relative to each other are unknown, but constant.
    pub fixed_together: Vec<Vec<String>>,
    /// The target that does not move relative to the cameras, and whose frame is the world.
    pub world: Option<String>,
    /// The camera whose frame is the frame of the rig; by default the first by name.
    pub reference: Option<String>,
    /// Distances between the centres of two cameras, measured otherwise.
    pub known_distances: Vec<CameraDistance>,
    /// Frames within this time of each other, seconds, are one view, whatever their names; by default frames of the same name are one view.
    pub sync_tolerance_s: Option<f64>,
    /// By how much a camera's pose may move under another explanation of the observations before the rig is inconsistent.
    pub tolerance: Tolerance,
    /// Whether the lenses are adjusted together with the rig. The covariance of a camera file is what is known of its lens; a file without one
    /// gives initial values and the lens model.
    pub adjust_lenses: bool,
    /// Whether the time from one row of a rolling shutter to the next, which all cameras share, is estimated with their time offsets.
    pub rolling_shutter: bool,
    /// Whether the answer's JSON holds the covariance of all cameras together, which grows with the square of their number.
    pub joint_covariance: bool,
    /// Files from which the cameras and targets were read: the answer lists them with their digests.
    pub files: Vec<PathBuf>,
    /// Remarks on those files.
    pub remarks: Vec<String>,
    /// The command line, if the job was run from one: the answer, its page and its scene repeat it.
    pub command: Option<String>,
}

/// A distance between the centres of two cameras.
#[derive(Debug, Clone, PartialEq)]
pub struct CameraDistance {
    /// Name of one camera.
    pub a: String,
    /// Name of another.
    pub b: String,
    /// The distance, metres.
    pub distance_m: f64,
    /// Its standard deviation, metres.
    pub sigma_m: f64,
}

impl RigRequest {
    /// Adds a camera under this name.
    pub fn add_camera(&mut self, name: impl Into<String>, camera: crate::core::Camera) {
        self.cameras.push(NamedCamera {
            name: name.into(),
            camera,
            placement: None,
            intrinsics_covariance: None,
        });
    }

    /// Adds a target under this name.
    pub fn add_target(&mut self, name: impl Into<String>, target: Target) {
        self.targets.push((name.into(), target));
    }

    /// Adds a camera of a file in any supported format under this name; without a name, all cameras of the file under their own names.
    /// `FILE#NAME` selects one of several.
    ///
    /// # Errors
    /// What is wrong with the file, and where; a name that another camera already has.
    pub fn read_camera(&mut self, name: Option<&str>, file: impl AsRef<Path>) -> Result<(), Error> {
        let file = file.as_ref();
        let (path, picked) = formats::split_spec(file);
        if name.is_some() || picked.is_some() {
            let (camera, remarks) = formats::read_camera_with_remarks(file)?;
            self.remarks.extend(remarks.iter().map(|remark| format!("warning: {remark}")));
            self.cameras.push(NamedCamera { name: name.map_or(camera.name, str::to_string), ..camera });
        } else {
            let read = formats::read_cameras(path)?;
            let remark = |warning: &String| format!("warning: {}: {warning}", path.display());
            self.remarks.extend(read.warnings.iter().map(remark));
            self.cameras.extend(read.cameras);
        }
        self.files.push(path.to_owned());
        check_camera_names(&self.cameras)
    }

    /// Adds the target of a file under this name, by default that of the file without its extension.
    ///
    /// # Errors
    /// What is wrong with the file, and where; a name that another target already has.
    pub fn read_target(&mut self, name: Option<&str>, path: impl AsRef<Path>) -> Result<(), Error> {
        let path = path.as_ref();
        let file = formats::read_target_with(path, &TagOptions::default())?;
        let remark = |warning: &String| format!("warning: {}: {warning}", path.display());
        self.remarks.extend(file.warnings.iter().map(remark));
        let stem = path.file_stem().unwrap_or_default().to_string_lossy();
        self.targets.push((name.unwrap_or(&stem).to_string(), file.target));
        self.files.push(path.to_path_buf());
        self.check_target_names()
    }

    /// Refuses cameras and targets that share a name, and invalid numbers.
    pub(super) fn check(&self) -> Result<(), Error> {
        if self.cameras.is_empty() {
            return Err(Error::request("no camera is given: the cameras' intrinsics are needed"));
        }
        check_camera_names(&self.cameras)?;
        self.check_target_names()?;
        match self.sync_tolerance_s {
            Some(s) if !(0.0 < s && s.is_finite()) => Err(Error::request(format!(
                "the tolerance of synchronisation is {s} s; a positive number is needed"
            ))),
            _ => Ok(()),
        }
    }

    fn check_target_names(&self) -> Result<(), Error> {
        match duplicate(self.targets.iter().map(|(name, _)| name.as_str())) {
            Some(name) => Err(Error::request(format!(
                "two targets are called `{name}`; give each a name: --target NAME=FILE"
            ))),
            None => Ok(()),
        }
    }

    /// Returns the targets, each on a body of its own.
    pub(super) fn named_targets(&self) -> Vec<NamedTarget> {
        let target = |(body, (name, target)): (usize, &(String, Target))| NamedTarget {
            name: name.clone(),
            target: Some(target.clone()),
            body,
        };
        self.targets.iter().enumerate().map(target).collect()
    }

    /// Puts targets that are mounted together on one body.
    pub(super) fn fix_together(&self, targets: &mut [NamedTarget]) -> Result<(), Error> {
        for names in &self.fixed_together {
            let [first, others @ ..] = &names[..] else { return Err(too_few_to_fix(names)) };
            if others.is_empty() {
                return Err(too_few_to_fix(names));
            }
            let first = target_number(targets, first, "--fixed-together")?;
            for name in others {
                let other = target_number(targets, name, "--fixed-together")?;
                join(targets, first, other);
            }
        }
        Ok(())
    }

    /// Returns the index of the target at rest.
    pub(super) fn world_target(&self, targets: &[NamedTarget]) -> Result<Option<usize>, Error> {
        let Some(name) = &self.world else { return Ok(None) };
        let target = target_number(targets, name, "--world")?;
        let body = targets[target].body;
        match targets.iter().filter(|t| t.body == body).count() {
            1 => Ok(Some(target)),
            _ => Err(Error::request(format!(
                "--world {name}: this target is fixed together with others, which move; the world stands still"
            ))),
        }
    }

    /// Returns the index of the reference camera among cameras in canonical order.
    pub(super) fn reference_among(&self, names: &[String]) -> Result<usize, Error> {
        number_of(self.reference.as_deref(), names)
    }

    /// Returns the known distances between cameras in canonical order, sorted independently of the request's order.
    pub(super) fn distances_among(&self, names: &[String]) -> Result<Vec<KnownDistance>, Error> {
        let known = self.known_distances.iter().map(|distance| distance.among(names));
        let mut known = known.collect::<Result<Vec<_>, _>>()?;
        known.sort_by(|x, y| (x.a, x.b).cmp(&(y.a, y.b)).then(x.distance_m.total_cmp(&y.distance_m)));
        Ok(known)
    }
}

impl CameraDistance {
    fn among(&self, names: &[String]) -> Result<KnownDistance, Error> {
        let CameraDistance { a, b, distance_m, sigma_m } = self;
        let wrong =
            |what: &str| Error::request(format!("--known-distance-m {a},{b},{distance_m},{sigma_m}: {what}"));
        let camera = |name: &String| {
            let found = names.iter().position(|known| known == name);
            found.ok_or_else(|| wrong(&not_among(name, "camera", names)))
        };
        let (x, y) = (camera(a)?, camera(b)?);
        if x == y {
            return Err(wrong("these are one camera; a distance is between two"));
        }
        if ![*distance_m, *sigma_m].iter().all(|length| 0.0 < *length && length.is_finite()) {
            return Err(wrong("the distance and its standard deviation must be positive numbers"));
        }
        Ok(KnownDistance { a: x.min(y), b: x.max(y), distance_m: *distance_m, sigma_m: *sigma_m })
    }
}

/// Returns the index of the camera with this name; without a name, of the first.
pub(super) fn number_of(reference: Option<&str>, names: &[String]) -> Result<usize, Error> {
    let Some(name) = reference else { return Ok(0) };
    let found = names.iter().position(|known| known == name);
    found.ok_or_else(|| Error::request(format!("--reference {name}: {}", not_among(name, "camera", names))))
}

/// Refuses two cameras with the same name.
pub(super) fn check_camera_names(cameras: &[NamedCamera]) -> Result<(), Error> {
    match duplicate(cameras.iter().map(|camera| camera.name.as_str())) {
        Some(name) => Err(Error::request(format!(
            "two cameras are called `{name}`; give each a name: --camera NAME=FILE"
        ))),
        None => Ok(()),
    }
}

/// Returns a name that occurs a second time.
fn duplicate<'a>(mut names: impl Iterator<Item = &'a str>) -> Option<&'a str> {
    let mut seen = std::collections::BTreeSet::new();
    names.find(|name| !seen.insert(*name))
}

fn too_few_to_fix(names: &[String]) -> Error {
    let names = names.join(",");
    Error::request(format!("--fixed-together {names}: two names or more are needed, separated by commas"))
}

/// Joins the bodies of two targets.
pub(super) fn join(targets: &mut [NamedTarget], a: usize, b: usize) {
    let (kept, gone) = (targets[a].body, targets[b].body);
    targets.iter_mut().filter(|target| target.body == gone).for_each(|target| target.body = kept);
}

fn target_number(targets: &[NamedTarget], name: &str, flag: &str) -> Result<usize, Error> {
    targets.iter().position(|target| target.name == name).ok_or_else(|| {
        let names: Vec<String> = targets.iter().map(|target| target.name.clone()).collect();
        Error::request(format!("{flag} {name}: {}", not_among(name, "target", &names)))
    })
}
