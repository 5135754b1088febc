//! The record of a rig with hand-held targets in the state file; written and read by `live/rig/watched/record.rs`.

use super::record::SnapshotRecord;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// All that a restart needs.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct RigRecord {
    /// The settings on which the state depends, by name.
    pub settings: BTreeMap<String, String>,
    pub cameras: Vec<HeardRecord>,
    /// Capture time of the first and the last synchronised frame set, seconds.
    pub first_s: Option<f64>,
    pub last_s: f64,
    pub stage: StageRecord,
    /// Frames that wait for those of other cameras.
    pub waiting: Vec<FrameRecord>,
}

/// The last frame of a camera.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct HeardRecord {
    pub name: String,
    /// Capture time of the last frame, seconds, and its time by the clock of the machine.
    pub last: Option<(f64, f64)>,
    /// Time of its last observation of a target together with another camera, seconds.
    pub seen_s: Option<f64>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StageRecord {
    Learning(Vec<FrameSetRecord>),
    Watching(SnapshotRecord),
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrameSetRecord {
    pub t_s: f64,
    pub frames: Vec<FrameRecord>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct FrameRecord {
    pub camera: usize,
    pub t_s: f64,
    pub seen: Vec<SeenRecord>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct SeenRecord {
    pub target: usize,
    /// Columns and rows of the image, where the lens has a size.
    pub size_px: Option<[u32; 2]>,
    pub points: Vec<PointRecord>,
}

#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct PointRecord {
    pub x_in_target_m: [f64; 3],
    pub pixel: [f64; 2],
    pub sigma_px: f64,
    /// The entries uu, uv, vv.
    pub covariance_px2: Option<[f64; 3]>,
    pub sigma_m: f64,
}

impl RigRecord {
    /// Returns about how many numbers it holds.
    pub fn size(&self) -> usize {
        let points = |frame: &FrameRecord| frame.seen.iter().map(|seen| seen.points.len()).sum::<usize>();
        let of = |frames: &[FrameRecord]| 10 * frames.iter().map(points).sum::<usize>();
        let stage = match &self.stage {
            StageRecord::Watching(snapshot) => snapshot.len(),
            StageRecord::Learning(frame_sets) => frame_sets.iter().map(|set| of(&set.frames)).sum(),
        };
        stage + of(&self.waiting)
    }

    /// Returns whether JSON can hold the statistics; observations consist of finite numbers.
    pub fn is_finite(&self) -> bool {
        match &self.stage {
            StageRecord::Watching(snapshot) => snapshot.is_finite(),
            StageRecord::Learning(_) => true,
        }
    }
}
