//! The record of each camera and of its configuration.

use crate::live::rig::RigConfig;
use crate::live::{LiveCamera, LiveConfig, Watched};
use resight::GrayImage;
use resight::rig::digest::sha256;
use resight_core::temporal::monitor::learn::LearnConfig;
use resight_core::temporal::monitor::{MonitorConfig, Reading};
use resight_core::temporal::snapshot::Snapshot;
use resight_core::{Camera, Matrix6, Pose, Target};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A camera with all its targets.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct CameraRecord {
    pub name: String,
    /// Capture time of the last frame, seconds, and its time by the clock of the machine.
    pub last_s: f64,
    pub last_unix_s: f64,
    /// Hash of the last image, hexadecimal.
    #[serde(default, alias = "last_picture")]
    pub last_image: Option<String>,
    pub pairs: Vec<PairRecord>,
    /// The record of its landmarks, where those of a saved image are watched.
    #[serde(default)]
    pub landmarks: Option<LandmarksRecord>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct LandmarksRecord {
    /// The settings on which the state depends, by name.
    pub settings: BTreeMap<String, String>,
    pub monitor: SnapshotRecord,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct PairRecord {
    pub target: String,
    /// The settings on which the state depends, by name.
    pub settings: BTreeMap<String, String>,
    pub tracker: SnapshotRecord,
    pub stage: StageRecord,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub(in crate::live) enum StageRecord {
    Starting,
    Learning(Vec<ReadingRecord>),
    Watching(SnapshotRecord),
    /// Time of the last observation, seconds.
    Following(Option<f64>),
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct SnapshotRecord {
    version: u32,
    numbers: Vec<f64>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub(in crate::live) struct ReadingRecord {
    t_s: f64,
    /// Column by column, as all matrices here.
    rotation: Vec<f64>,
    translation_m: [f64; 3],
    covariance: Vec<f64>,
    is_consistent: bool,
    /// Number of key frames of a video up to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    key_frames: Option<u64>,
}

impl From<Snapshot> for SnapshotRecord {
    fn from(snapshot: Snapshot) -> Self {
        SnapshotRecord { version: snapshot.version, numbers: snapshot.numbers }
    }
}

impl CameraRecord {
    /// Leaves out records with a number that is not finite, which JSON cannot hold and no session could use; returns their names.
    pub fn without_holes(mut self) -> (Self, Vec<String>) {
        let mut left_out = Vec::new();
        self.pairs.retain(|pair| {
            let is_whole = pair.is_finite();
            if !is_whole {
                left_out.push(pair.target.clone());
            }
            is_whole
        });
        if self.landmarks.take_if(|landmarks| !landmarks.monitor.is_finite()).is_some() {
            left_out.push("landmarks".to_string());
        }
        (self, left_out)
    }
}

impl PairRecord {
    fn is_finite(&self) -> bool {
        let stage = match &self.stage {
            StageRecord::Starting => true,
            StageRecord::Learning(readings) => readings.iter().all(ReadingRecord::is_finite),
            StageRecord::Watching(monitor) => monitor.is_finite(),
            StageRecord::Following(last_s) => last_s.is_none_or(f64::is_finite),
        };
        stage && self.tracker.is_finite()
    }
}

impl SnapshotRecord {
    pub fn is_finite(&self) -> bool {
        self.numbers.iter().all(|number| number.is_finite())
    }

    pub fn len(&self) -> usize {
        self.numbers.len()
    }

    pub fn snapshot(&self) -> Snapshot {
        Snapshot { version: self.version, numbers: self.numbers.clone() }
    }
}

impl From<(&Reading, Option<u64>)> for ReadingRecord {
    fn from((reading, key_frames): (&Reading, Option<u64>)) -> Self {
        ReadingRecord {
            t_s: reading.t_s,
            rotation: reading.a_from_b.rotation.as_slice().to_vec(),
            translation_m: reading.a_from_b.translation.into(),
            covariance: reading.covariance.as_slice().to_vec(),
            is_consistent: reading.is_consistent,
            key_frames,
        }
    }
}

impl ReadingRecord {
    fn is_finite(&self) -> bool {
        let numbers = self.rotation.iter().chain(&self.translation_m).chain(&self.covariance);
        self.t_s.is_finite() && numbers.into_iter().all(|number| number.is_finite())
    }

    /// Returns none where the record has a wrong count of numbers.
    pub fn reading(&self) -> Option<(Reading, Option<u64>)> {
        let of_size = self.rotation.len() == 9 && self.covariance.len() == 36;
        let reading = || Reading {
            t_s: self.t_s,
            a_from_b: Pose::new(
                nalgebra::Matrix3::from_column_slice(&self.rotation),
                self.translation_m.into(),
            ),
            covariance: Matrix6::from_column_slice(&self.covariance),
            is_consistent: self.is_consistent,
        };
        of_size.then(|| (reading(), self.key_frames))
    }
}

/// Returns the settings on which a state depends: with any of them changed it would be a state of something else.
pub(in crate::live) fn settings(
    camera: &Camera,
    watched: &Watched,
    config: &LiveConfig,
) -> BTreeMap<String, String> {
    // States of version 1 hold the hash of a text in which the diurnal variation had another name.
    let as_before = |reference| hash(&format!("{reference:?}").replace("diurnal: ", "daily: "));
    let reference = watched.reference.as_ref().map(as_before);
    let own = [
        ("target", digest(watched.target.as_ref())),
        ("reference", reference.unwrap_or_else(|| "learned".to_string())),
    ];
    with_common(camera, config, own)
}

/// Returns the settings of landmarks, with their image in place of a target.
pub(in crate::live) fn landmark_settings(
    camera: &Camera,
    picture: &GrayImage,
    config: &LiveConfig,
) -> BTreeMap<String, String> {
    with_common(camera, config, [("image", sha256(&picture.data)[..16].to_string())])
}

/// Returns the settings of a rig with hand-held targets.
pub(in crate::live) fn rig_settings(
    cameras: &[LiveCamera],
    rig: &RigConfig,
    config: &LiveConfig,
) -> BTreeMap<String, String> {
    let lenses: Vec<(&str, &Camera)> =
        cameras.iter().map(|camera| (camera.name.as_str(), &camera.camera)).collect();
    let targets = cameras.first().map(|camera| camera.targets.as_slice()).unwrap_or_default();
    let targets: Vec<(&str, &Target)> =
        targets.iter().map(|watched| (watched.name.as_str(), watched.target.as_ref())).collect();
    let own = [
        ("cameras", digest(&lenses)),
        ("targets", digest(&targets)),
        ("places", rig.reference.as_ref().map_or("learned".to_string(), digest)),
        ("sync_tolerance_s", rig.sync_tolerance_s.to_string()),
    ];
    common(config).into_iter().chain(named(own)).collect()
}

fn with_common<const N: usize>(
    camera: &Camera,
    config: &LiveConfig,
    own: [(&str, String); N],
) -> BTreeMap<String, String> {
    common(config).into_iter().chain(named([("camera", digest(camera))])).chain(named(own)).collect()
}

fn named<const N: usize>(own: [(&str, String); N]) -> impl Iterator<Item = (String, String)> {
    own.into_iter().map(|(name, value)| (name.to_string(), value))
}

fn common(config: &LiveConfig) -> BTreeMap<String, String> {
    let MonitorConfig {
        false_alarms_per_day,
        decision_period_s,
        stale_after_s,
        tolerance_rotation_rad,
        tolerance_translation_m,
    } = &config.monitor;
    let LearnConfig { bias, bias_time_s, diurnal } = &config.correlated;
    let all = [
        ("false_alarms_per_day", false_alarms_per_day.to_string()),
        ("decision_period_s", decision_period_s.to_string()),
        ("stale_after_s", stale_after_s.to_string()),
        ("tolerance_rotation_rad", tolerance_rotation_rad.to_string()),
        ("tolerance_translation_m", tolerance_translation_m.to_string()),
        ("bias", digest(bias)),
        ("bias_time_s", bias_time_s.to_string()),
        ("diurnal", digest(diurnal)),
        ("motion", format!("{:?}", config.track)),
        ("learn_readings", config.learn_readings.to_string()),
    ];
    named(all).collect()
}

/// Returns a digest in place of what is too long to be written.
fn digest(of: &impl std::fmt::Debug) -> String {
    hash(&format!("{of:?}"))
}

fn hash(text: &str) -> String {
    sha256(text.as_bytes())[..16].to_string()
}

/// Names of settings in states of version 1, and the present names.
const EARLIER: [[&str; 2]; 3] =
    [["unseen_after_s", "stale_after_s"], ["daily", "diurnal"], ["picture", "image"]];

fn with_names_of_today(settings: &BTreeMap<String, String>) -> BTreeMap<String, String> {
    let today =
        |name: &str| EARLIER.iter().find(|names| names[0] == name).map_or(name, |names| names[1]).to_string();
    settings.iter().map(|(name, value)| (today(name), value.clone())).collect()
}

/// Returns the settings that differ, in words; none where all agree.
pub(in crate::live) fn changed(
    was: &BTreeMap<String, String>,
    is: &BTreeMap<String, String>,
) -> Option<String> {
    let was = &with_names_of_today(was);
    let value = |of: &BTreeMap<String, String>, name: &str| of.get(name).cloned().unwrap_or_default();
    let differs = |name: &&String| was.get(*name) != is.get(*name);
    let words: Vec<String> = is
        .keys()
        .chain(was.keys().filter(|name| !is.contains_key(*name)))
        .filter(differs)
        .map(|name| format!("{name} was {} and is {}", value(was, name), value(is, name)))
        .collect();
    (!words.is_empty()).then(|| words.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pair(target: &str, number: f64) -> PairRecord {
        let numbers = |number| SnapshotRecord { version: 1, numbers: vec![1.0, number] };
        PairRecord {
            target: target.to_string(),
            settings: BTreeMap::new(),
            tracker: numbers(0.0),
            stage: StageRecord::Watching(numbers(number)),
        }
    }

    /// A state written by version 1 is used: the settings have changed only in name.
    #[test]
    fn states_of_version_1_are_read() {
        let settings = |names: [&str; 3]| -> BTreeMap<String, String> {
            names.map(|name| (name.to_string(), "5".to_string())).into_iter().collect()
        };
        let was = settings(["unseen_after_s", "daily", "learn_readings"]);
        assert_eq!(changed(&was, &settings(["stale_after_s", "diurnal", "learn_readings"])), None);
        let words = changed(&was, &settings(["stale_after_s", "diurnal", "motion"])).expect("a change");
        assert!(words.contains("learn_readings was 5"), "{words}");
        let text =
            r#"{"name": "gate", "last_s": 1.0, "last_unix_s": 2.0, "last_picture": "ab", "pairs": []}"#;
        let record: CameraRecord = serde_json::from_str(text).expect("a record");
        assert_eq!(record.last_image.as_deref(), Some("ab"));
    }

    #[test]
    fn one_pair_without_numbers_does_not_spoil_the_others() {
        let landmarks = LandmarksRecord {
            settings: BTreeMap::new(),
            monitor: SnapshotRecord { version: 1, numbers: vec![f64::NAN] },
        };
        let record = CameraRecord {
            name: "gate".to_string(),
            last_s: 1.0,
            last_unix_s: 2.0,
            last_image: None,
            pairs: vec![pair("door", 3.0), pair("wall", f64::INFINITY)],
            landmarks: Some(landmarks),
        };
        let (whole, left_out) = record.without_holes();
        assert_eq!(left_out, ["wall", "landmarks"]);
        let names: Vec<&str> = whole.pairs.iter().map(|pair| pair.target.as_str()).collect();
        assert!(names == ["door"] && whole.landmarks.is_none());
        let text = serde_json::to_string(&whole).expect("JSON");
        serde_json::from_str::<CameraRecord>(&text).expect("what was written is read");
    }
}
