//! Reads the files of a rig, distinguishes them by their contents, and refuses impossible numbers.

use super::Status;
use crate::FileError;
use crate::core::{Camera, Matrix6, Pose};
use crate::formats::{CameraFile, Placement, read_cameras_from_bytes, scene};
use nalgebra::{Matrix6 as Dense, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::Path;

/// Metres: no rig is larger than the Earth, and squares of smaller numbers do not overflow.
const MOST_M: f64 = 1e8;

/// What the files hold.
pub(super) struct Source {
    pub answer: Option<(String, Answer)>,
    files: Vec<(String, CameraFile)>,
}

/// A camera with its pose.
pub(super) struct Placed {
    pub name: String,
    pub cam_from_rig: Pose,
    /// Covariance of its small left motion `[rotation_rad; translation_m]`, camera frame.
    pub covariance: Option<Matrix6>,
    pub counts: CameraIn,
}

/// What took no part.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
pub struct RejectedRow {
    /// `frame`, `observation` or `point`.
    pub(super) kind: String,
    pub(super) camera: String,
    pub(super) view: String,
    pub(super) target: Option<String>,
    pub(super) id: Option<String>,
    pub(super) residual_px: Option<f64>,
    pub(super) reason: String,
}

/// The parts of the JSON object of `resight rig` that are shown.
#[derive(Debug, Deserialize)]
pub(super) struct Answer {
    pub status: Status,
    #[serde(default)]
    pub message: String,
    pub contradiction: Option<String>,
    pub reference: Option<String>,
    pub rms_px: Option<f64>,
    pub n_views: Option<usize>,
    pub n_seen: Option<usize>,
    pub n_used: Option<usize>,
    #[serde(default)]
    pub cameras: BTreeMap<String, PlacedIn>,
    #[serde(default)]
    pub pairs: Vec<PairIn>,
    #[serde(default)]
    pub rejected: Vec<RejectedRow>,
    #[serde(default)]
    pub views: Vec<ViewIn>,
    pub scale: Option<ScaleIn>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ScaleIn {
    #[serde(default)]
    pub message: String,
}

#[derive(Debug, Deserialize)]
pub(super) struct PlacedIn {
    cam_from_rig: TransformIn,
    covariance: Option<[[f64; 6]; 6]>,
    #[serde(flatten)]
    counts: CameraIn,
}

/// Counts and judgements of one camera.
#[derive(Debug, Clone, Default, Deserialize)]
pub(super) struct CameraIn {
    pub status: Option<Status>,
    pub message: Option<String>,
    pub n_views: Option<usize>,
    pub n_seen: Option<usize>,
    pub n_used: Option<usize>,
    pub rms_px: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct TransformIn {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
}

impl TransformIn {
    /// Converts to a pose; the error is a sentence.
    pub fn pose(&self, what: &str) -> Result<Pose, String> {
        let norm = self.rotation_wxyz.iter().map(|q| q * q).sum::<f64>().sqrt();
        if !((norm - 1.0).abs() < 1e-3) {
            return Err(format!(
                "{what}: the quaternion rotation_wxyz has the length {norm:.3e}; 1 is needed"
            ));
        }
        match self.translation_m.iter().find(|x| !(x.abs() < MOST_M)) {
            Some(x) => {
                Err(format!("{what}: translation_m holds {x:.3e} m; less than {MOST_M:e} m is needed"))
            }
            None => Ok(Pose::from_quaternion_wxyz(
                self.rotation_wxyz.map(|q| q / norm),
                Vector3::from(self.translation_m),
            )),
        }
    }
}

#[derive(Debug, Deserialize)]
pub(super) struct PairIn {
    pub a: String,
    pub b: String,
    pub n_shared_views: usize,
    pub n_shared_views_used: Option<usize>,
    pub b_from_a: TransformIn,
    pub covariance: Option<[[f64; 6]; 6]>,
}

#[derive(Debug, Deserialize)]
pub(super) struct ViewIn {
    pub view: String,
    #[serde(flatten)]
    pub all: SeenIn,
    #[serde(default)]
    pub cameras: BTreeMap<String, SeenIn>,
    #[serde(default)]
    pub bodies: Vec<BodyIn>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
pub(super) struct SeenIn {
    pub n_seen: usize,
    pub n_used: usize,
    pub rms_px: Option<f64>,
}

#[derive(Debug, Deserialize)]
pub(super) struct BodyIn {
    pub target: String,
    pub rig_from_target: TransformIn,
}

impl Source {
    pub fn read(files: &[(&str, &str)]) -> Result<Self, FileError> {
        let mut source = Source { answer: None, files: Vec::new() };
        for (name, text) in files {
            source.add(plain(name), text)?;
        }
        match (&source.answer, source.files.is_empty()) {
            (None, true) => {
                Err(FileError::new("", "no file; give the answer of `resight rig --json`, or a rig file"))
            }
            _ => Ok(source),
        }
    }

    fn add(&mut self, name: String, text: &str) -> Result<(), FileError> {
        if !is_answer(text) {
            let read = read_cameras_from_bytes(Path::new(&name), text.as_bytes().to_vec())?;
            self.files.push((name, read));
            return Ok(());
        }
        if self.answer.is_some() {
            return Err(FileError::new(
                name,
                "a second answer of `resight rig`; give one, and rig files with it",
            ));
        }
        let fault = |reason: serde_json::Error| {
            FileError::new(&name, format!("this is no answer of `resight rig --json`: {reason}"))
        };
        self.answer = Some((name.clone(), serde_json::from_str(text).map_err(fault)?));
        Ok(())
    }

    /// Returns the name of the first file, for messages about all files.
    pub fn name(&self) -> &str {
        let answer = self.answer.as_ref().map(|(name, _)| name);
        answer.or(self.files.first().map(|(name, _)| name)).map_or("", String::as_str)
    }

    pub fn warnings(&self) -> Vec<String> {
        self.files.iter().flat_map(|(_, file)| file.warnings.iter().cloned()).collect()
    }

    pub fn lenses(&self) -> Result<Lenses<'_>, FileError> {
        let mut lenses = Lenses { by_name: BTreeMap::new(), files: &self.files, contradiction: None };
        for (name, file) in &self.files {
            for camera in &file.cameras {
                if lenses.by_name.insert(&camera.name, &camera.camera).is_some() {
                    let reason = format!("camera `{}` is in another file too; give it once", camera.name);
                    return Err(FileError::new(name, reason));
                }
            }
            lenses.contradiction = lenses.contradiction.or_else(|| file.contradiction.clone());
        }
        Ok(lenses)
    }
}

/// Returns a name without folders, short enough for a message.
fn plain(name: &str) -> String {
    let last = name.rsplit(['/', '\\']).next().unwrap_or_default();
    let kept: String = last.chars().filter(|c| !c.is_control()).take(80).collect();
    if kept.is_empty() { "file".to_owned() } else { kept }
}

/// Recognises an answer: no other JSON object has a status.
fn is_answer(text: &str) -> bool {
    #[derive(Deserialize)]
    struct Any {
        #[serde(default, rename = "status")]
        status: Option<serde::de::IgnoredAny>,
    }
    text.trim_start().starts_with('{')
        && serde_json::from_str::<Any>(text).is_ok_and(|any| any.status.is_some())
}

impl Answer {
    /// Returns the cameras with their poses.
    pub fn placed(&self) -> Result<Vec<Placed>, String> {
        let one = |(name, camera): (&String, &PlacedIn)| {
            let what = format!("camera {}", plain(name));
            Ok(Placed {
                name: name.clone(),
                cam_from_rig: camera.cam_from_rig.pose(&what)?,
                covariance: camera.covariance.map(|rows| covariance(&rows, &what)).transpose()?,
                counts: camera.counts.clone(),
            })
        };
        self.cameras.iter().map(one).collect()
    }
}

/// Returns the matrix if it is symmetric and has no negative diagonal element; the error is a sentence.
pub(super) fn covariance(rows: &[[f64; 6]; 6], what: &str) -> Result<Matrix6, String> {
    let c = Dense::from_fn(|i, j| rows[i][j]);
    let is_sound = c.iter().all(|x| x.abs() < MOST_M * MOST_M)
        && (0..6).all(|i| 0.0 <= c[(i, i)])
        && (c - c.transpose()).amax() <= 1e-6 * c.amax();
    match is_sound {
        true => Ok(c),
        false => Err(format!("{what}: its covariance is not symmetric with a diagonal of at least 0")),
    }
}

/// Cameras of rig files.
pub(super) struct Lenses<'a> {
    by_name: BTreeMap<&'a str, &'a Camera>,
    files: &'a [(String, CameraFile)],
    pub contradiction: Option<String>,
}

impl Lenses<'_> {
    pub fn of(&self, name: &str) -> Option<&Camera> {
        self.by_name.get(name).copied()
    }

    /// Returns the frame of the rig, the cameras placed in it, and the names of the other cameras.
    pub fn placed(&self) -> Result<(String, Vec<Placed>, Vec<String>), FileError> {
        let [(name, first), rest @ ..] = self.files else { return Ok(Default::default()) };
        let mut rig = first.clone();
        for (_, file) in rest {
            rig.cameras.extend(file.cameras.iter().cloned());
            rig.relations.extend(file.relations.iter().cloned());
        }
        let placed = scene(&rig, None).map_err(|reason| FileError::new(name, reason.to_string()))?;
        let (mut cameras, mut unplaced) = (Vec::new(), Vec::new());
        for (camera, at) in rig.cameras.iter().zip(&placed.scene_cameras) {
            let Some(rig_from_cam) = at.reference_from_cam else {
                unplaced.push(camera.name.clone());
                continue;
            };
            // Keeps the covariance of the camera in this frame, not that of another frame in the camera's.
            let is_its_own = |p: &&Placement| p.b == camera.name && p.a == placed.reference;
            cameras.push(Placed {
                name: camera.name.clone(),
                cam_from_rig: rig_from_cam.inverse(),
                covariance: camera.placement.as_ref().filter(is_its_own).and_then(|p| p.covariance),
                counts: CameraIn::default(),
            });
        }
        let far = cameras.iter().find(|one| !one.cam_from_rig.translation.iter().all(|x| x.abs() < MOST_M));
        match far {
            Some(one) => {
                let reason = format!("camera {} is farther than {MOST_M:e} m away; check the unit", one.name);
                Err(FileError::new(name, reason))
            }
            None => Ok((placed.reference, cameras, unplaced)),
        }
    }
}
