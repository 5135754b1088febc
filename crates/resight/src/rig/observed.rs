//! The observations of a rig's cameras, from images or detections, as input of the solver.

use super::NamedTarget;
use super::gather::NamedObservation;
use super::request::RigRequest;
use crate::core::{Correspondence, Pixel};
use crate::error::Error;
use crate::formats::NamedCamera;
use std::collections::BTreeMap;
use std::path::PathBuf;

/// The reason for leaving out a frame without a target; for the first frame of a camera that observed none, what it shows instead is added.
pub(super) const NO_TARGET: &str = "no target in this image";

/// The observations in one frame.
#[derive(Debug, Clone)]
pub(crate) struct Frame {
    /// Index into the given cameras.
    pub camera: usize,
    /// Its view, or the index of the frame.
    pub name: String,
    /// When it was taken.
    pub t_s: Option<f64>,
    /// The targets (indices into those given) and their points.
    pub targets: Vec<(usize, Vec<(String, Correspondence)>)>,
}

/// An input that took no part, with the reason.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct LeftOut {
    /// Name of the camera.
    pub camera: String,
    /// Name of its frame.
    pub view: String,
    /// A target, `point ID`, or `frame`.
    pub what: String,
    /// Why, in a sentence.
    pub reason: String,
}

/// All observations.
#[derive(Debug)]
pub(crate) struct Collected {
    pub cameras: Vec<NamedCamera>,
    /// Whether the intrinsics are known; where they are to be estimated, detectors work without a lens.
    pub knows_lenses: bool,
    pub targets: Vec<NamedTarget>,
    pub frames: Vec<Frame>,
    pub left_out: Vec<LeftOut>,
    pub files: Vec<PathBuf>,
    pub remarks: Vec<String>,
}

impl Collected {
    /// Starts without observations.
    pub fn new(request: &RigRequest) -> Result<Self, Error> {
        request.check()?;
        Ok(Collected {
            cameras: request.cameras.clone(),
            knows_lenses: true,
            targets: request.named_targets(),
            frames: Vec::new(),
            left_out: Vec::new(),
            files: request.files.clone(),
            remarks: request.remarks.clone(),
        })
    }

    /// Returns what the first frame of a camera shows instead of a target, if the camera observed none.
    pub fn explanation(left_out: &[LeftOut], camera: &str) -> Option<String> {
        let of_frame = left_out.iter().filter(|one| one.camera == camera && one.what == "frame");
        of_frame.map(|one| &one.reason).find(|reason| *reason != NO_TARGET).cloned()
    }

    /// Refuses two points of the same name in one frame: one of them is mislabelled, and it is unknown which.
    pub fn check_duplicates(&self) -> Result<(), Error> {
        for frame in &self.frames {
            for (target, points) in &frame.targets {
                let mut names: Vec<&str> = points.iter().map(|(name, _)| name.as_str()).collect();
                names.sort_unstable();
                if let Some(duplicates) = names.windows(2).find(|pair| pair[0] == pair[1]) {
                    return Err(Error::request(format!(
                        "camera {}, view {}: point {} of target {} is there twice; remove one (corners of a tag need the column `corner`, several targets the column `target`)",
                        self.cameras[frame.camera].name,
                        frame.name,
                        duplicates[0],
                        self.targets[*target].name
                    )));
                }
            }
        }
        Ok(())
    }

    /// Refuses two cameras with every shared point at the same pixel, in all digits: the same images were given twice.
    pub fn check_copies(&self) -> Result<(), Error> {
        let mut by_camera: Vec<BTreeMap<Seen<'_>, &Pixel>> = vec![BTreeMap::new(); self.cameras.len()];
        for frame in &self.frames {
            for (target, points) in &frame.targets {
                let seen = points
                    .iter()
                    .map(|(name, point)| ((frame.name.as_str(), *target, name.as_str()), &point.pixel));
                by_camera[frame.camera].extend(seen);
            }
        }
        for (i, second) in by_camera.iter().enumerate() {
            for (first, other) in by_camera[..i].iter().zip(&self.cameras) {
                let mut n = 0;
                let shared =
                    second.iter().filter_map(|(key, pixel)| first.get(key).map(|other| (pixel, other)));
                let are_same = shared.inspect(|_| n += 1).all(|(pixel, other)| pixel == other);
                if are_same && LEAST_SHARED <= n {
                    return Err(Error::request(format!(
                        "cameras {} and {} show every point they share in the same pixel: were the images or rows of one given for both?",
                        other.name, self.cameras[i].name
                    )));
                }
            }
        }
        Ok(())
    }
}

/// With fewer points, equal pixels may be a coincidence, where pixels are whole numbers.
const LEAST_SHARED: usize = 4;

/// A point of a target in a view: the names of view and point, and the index of the target.
type Seen<'a> = (&'a str, usize, &'a str);

/// Splits frames by target, as input of the sorting.
pub(super) fn observations(frames: Vec<Frame>) -> Vec<NamedObservation> {
    let of_frame = |frame: Frame| {
        let Frame { camera, name, t_s, targets } = frame;
        let of_target =
            move |(target, points)| NamedObservation { camera, view: name.clone(), target, t_s, points };
        targets.into_iter().map(of_target)
    };
    frames.into_iter().flat_map(of_frame).collect()
}
