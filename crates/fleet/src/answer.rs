//! Answers as JSON, as printed by `batch` and `fleet-report`.

use crate::assess::{Assessment, CameraVerdict, Found, Motion};
use crate::cameras::Cameras;
use crate::layout::Columns;
use crate::run::Done;
use crate::words::{expected, utc};
use resight::answer::{SchemaNumber, TransformObject};
use resight::core::{Matrix6, Vector6};
use resight::formats::cells;
use resight::report::verdict::Status;
use resight::report::words::sigmas;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// What a cluster says of a job that it has done.
#[derive(Debug, Clone, PartialEq, Deserialize)]
pub struct ClusterAnswer {
    /// Rows by status: ok, ambiguous, degenerate, inconsistent, implausible, anything else.
    pub counts: [u64; 6],
    /// Cameras of the table.
    pub cameras: usize,
    /// Files of the output.
    pub parts: usize,
    /// Files of the input that could not be read, and why.
    pub failed: Vec<(PathBuf, String)>,
}

/// What a run of `batch` comes to.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BatchObject {
    schema: SchemaNumber,
    status: Status,
    output: String,
    rows: u64,
    /// Rows by status.
    statuses: BTreeMap<&'static str, u64>,
    cameras: usize,
    seconds: f64,
    rows_per_s: f64,
    /// Pieces of the output, and those of them that an earlier run, cut off, had written.
    parts: usize,
    resumed_parts: usize,
    /// Files, pieces of files, and rows of the table of cameras, that could not be read.
    failed: Vec<FailedObject>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct FailedObject {
    file: String,
    reason: String,
}

/// Rows of each status in the order of `CameraState::counts`.
const WORDS: [&str; 6] = ["ok", "ambiguous", "degenerate", "inconsistent", "implausible", "error"];

impl BatchObject {
    /// Creates the answer for a run with these cameras and this duration.
    pub fn of(done: &Done, cameras: &Cameras, output: &Path, seconds: f64) -> Self {
        let answer = ClusterAnswer {
            counts: done.state.counts(),
            cameras: cameras.len(),
            parts: done.parts,
            failed: cameras.rejected.iter().chain(&done.failed).cloned().collect(),
        };
        BatchObject { resumed_parts: done.resumed_parts, ..Self::of_cluster(answer, output, seconds) }
    }

    /// Of a job on many machines.
    pub fn of_cluster(answer: ClusterAnswer, output: &Path, seconds: f64) -> Self {
        let ClusterAnswer { counts, cameras, parts, failed } = answer;
        let (rows, is_whole) =
            (counts.iter().sum(), failed.is_empty() && counts[1..].iter().all(|n| *n == 0));
        let failed = failed
            .into_iter()
            .map(|(file, reason)| FailedObject { file: file.display().to_string(), reason });
        BatchObject {
            schema: SchemaNumber,
            status: if is_whole { Status::Ok } else { Status::Error },
            output: output.display().to_string(),
            rows,
            statuses: WORDS.into_iter().zip(counts).collect(),
            cameras,
            seconds,
            rows_per_s: rows as f64 / seconds.max(1e-9),
            parts,
            resumed_parts: 0,
            failed: failed.collect(),
        }
    }

    /// Returns whether every row is `ok` and everything was read.
    pub fn status(&self) -> Status {
        self.status
    }

    /// Returns whether anything could not be read: a file, a part of one, or a row of the table of cameras.
    pub fn is_damaged(&self) -> bool {
        !self.failed.is_empty()
    }

    /// For people.
    pub fn in_words(&self) -> String {
        let counts: Vec<String> =
            self.statuses.iter().filter(|(_, n)| 0 < **n).map(|(word, n)| format!("{n} {word}")).collect();
        let mut text = format!(
            "{} rows of {} cameras in {:.1} s ({:.0} rows a second) written to {}\n  {}\n",
            self.rows,
            self.cameras,
            self.seconds,
            self.rows_per_s,
            self.output,
            counts.join(", ")
        );
        if 0 < self.resumed_parts {
            text += &format!(
                "  {} of {} parts were there from a run that was cut off\n",
                self.resumed_parts, self.parts
            );
        }
        for failed in &self.failed {
            text += &format!("  not read: {}\n", failed.reason);
        }
        text
    }
}

/// What `batch --explain` finds in a file.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ColumnsObject {
    schema: SchemaNumber,
    status: Status,
    file: String,
    rows: Option<usize>,
    columns: Vec<ColumnObject>,
    missing: Vec<String>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct ColumnObject {
    name: String,
    kind: String,
    /// What it is taken for; none: it is not used.
    used_as: Option<String>,
}

impl ColumnsObject {
    /// Of a file.
    pub fn of(path: &Path, columns: Columns, rows: Option<usize>) -> Self {
        let column = |(name, kind, used): (String, String, String)| ColumnObject {
            name,
            kind,
            used_as: Some(used).filter(|used| !used.is_empty()),
        };
        ColumnsObject {
            schema: SchemaNumber,
            status: if columns.missing.is_empty() { Status::Ok } else { Status::Error },
            file: path.display().to_string(),
            rows,
            columns: columns.columns.into_iter().map(column).collect(),
            missing: columns.missing,
        }
    }

    /// `error` where columns are missing.
    pub fn status(&self) -> Status {
        self.status
    }

    /// For people.
    pub fn in_words(&self) -> String {
        let rows = self.rows.map_or(String::new(), |rows| format!(", {rows} rows"));
        let mut text = format!("{}{rows}\n", self.file);
        let width = cells::width(self.columns.iter().map(|column| column.name.as_str()));
        for ColumnObject { name, kind, used_as } in &self.columns {
            let used = used_as.as_deref().unwrap_or("not used");
            text += &format!("  {}  {kind:24}  {used}\n", cells::left(name, width));
        }
        for missing in &self.missing {
            text += &format!("  missing: {missing}\n");
        }
        text
    }
}

/// One camera of a fleet.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct FleetCameraObject {
    schema: SchemaNumber,
    camera: String,
    status: Status,
    found: String,
    message: String,
    /// The motion with the most evidence.
    motion: Option<MotionObject>,
    /// All motions, in order of time.
    events: Vec<MotionObject>,
    /// Where the camera is at the end in its own frame of the beginning, where it moved more than once.
    now: Option<NowObject>,
    cam_from_target: Option<TransformObject>,
    /// 6×6, `[rotation_rad; translation_m]`, left perturbation in the camera frame.
    covariance: Option<[[f64; 6]; 6]>,
    detectable: Option<DetectableObject>,
    statuses: BTreeMap<&'static str, u64>,
    first_s: Option<f64>,
    last_s: Option<f64>,
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct MotionObject {
    /// `step`, `ramp`, `excursion` (away for a single period), or `pending` (a step that the last period alone shows).
    kind: &'static str,
    since_s: f64,
    since_sigma_s: f64,
    /// When a ramp ended; null where it continues, and of other motions.
    until_s: Option<f64>,
    until_sigma_s: Option<f64>,
    /// Whether it may be larger: a single period holds an unknown share of it.
    is_at_least: bool,
    chi2: f64,
    degrees_of_freedom: u32,
    rotation_deg: [f64; 3],
    rotation_sigma_deg: [f64; 3],
    translation_m: [f64; 3],
    translation_sigma_m: [f64; 3],
    rotation_alone_deg: Option<[f64; 3]>,
}

impl From<&Motion> for MotionObject {
    fn from(m: &Motion) -> Self {
        MotionObject {
            kind: m.kind,
            since_s: m.since_s,
            since_sigma_s: m.since_sigma_s,
            until_s: m.until_s.map(|until| until[0]),
            until_sigma_s: m.until_s.map(|until| until[1]),
            is_at_least: m.is_at_least,
            chi2: m.chi2,
            degrees_of_freedom: 6,
            rotation_deg: m.rotation_deg,
            rotation_sigma_deg: m.rotation_sigma_deg,
            translation_m: m.translation_m,
            translation_sigma_m: m.translation_sigma_m,
            rotation_alone_deg: m.rotation_alone_deg,
        }
    }
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct NowObject {
    rotation_deg: [f64; 3],
    rotation_sigma_deg: [f64; 3],
    translation_m: [f64; 3],
    translation_sigma_m: [f64; 3],
}

impl NowObject {
    fn of(y: &Vector6, covariance: &Matrix6) -> Self {
        let (rotation_rad, translation_m) = sigmas(covariance);
        NowObject {
            rotation_deg: [0, 1, 2].map(|i| y[i].to_degrees()),
            rotation_sigma_deg: rotation_rad.map(f64::to_degrees),
            translation_m: [3, 4, 5].map(|i| y[i]),
            translation_sigma_m: translation_m,
        }
    }
}

#[derive(Debug, Clone, Serialize, JsonSchema)]
struct DetectableObject {
    within_s: f64,
    rotation_deg: [f64; 3],
    translation_m: [f64; 3],
}

impl From<&CameraVerdict> for FleetCameraObject {
    fn from(v: &CameraVerdict) -> Self {
        FleetCameraObject {
            schema: SchemaNumber,
            camera: v.camera.clone(),
            status: v.found.status(),
            found: v.found.name().to_string(),
            message: v.message.clone(),
            motion: v.motion().map(MotionObject::from),
            events: v.events.iter().map(MotionObject::from).collect(),
            now: v.now.as_ref().map(|(y, covariance)| NowObject::of(y, covariance)),
            cam_from_target: v.cam_from_target.map(|(pose, _)| TransformObject::from(pose)),
            covariance: v
                .cam_from_target
                .map(|(_, c)| std::array::from_fn(|i| std::array::from_fn(|j| c[(i, j)]))),
            detectable: v.detectable.as_ref().map(|d| DetectableObject {
                within_s: d.within_s,
                rotation_deg: d.rotation_rad.map(f64::to_degrees),
                translation_m: d.translation_m,
            }),
            statuses: WORDS.into_iter().zip(v.counts).collect(),
            first_s: v.span_s.map(|span| span.0),
            last_s: v.span_s.map(|span| span.1),
        }
    }
}

/// For people: how many of what, then a line for each camera that is not steady, `most` of them.
pub fn in_words(fleet: &Assessment, most: usize) -> String {
    let counts = fleet.counts();
    let count = |found: Found| counts.get(found.name()).copied().unwrap_or(0);
    let mut text = format!("{} cameras: {} moved", fleet.cameras.len(), count(Found::Moved));
    let others = [
        Found::WrongMap,
        Found::Dead,
        Found::Clock,
        Found::Wandering,
        Found::TooFew,
        Found::Unknown,
        Found::Steady,
    ];
    for found in others {
        if 0 < count(found) {
            text += &format!(", {} {}", count(found), found.name().replace('_', " "));
        }
    }
    text += &format!(
        "\n  at the stated rate of false alarms {} of those that stayed are expected to be called moved\n",
        expected(fleet.expected_false_alarms)
    );
    for unread in &fleet.unread {
        text += &format!("  not read: {unread}\n");
    }
    if let Some(changes) = &fleet.changes {
        text += &format!("  since {}: {} cameras changed\n", utc(changes.since_s), changes.cameras.len());
    }
    for together in &fleet.together {
        text += &format!("  {}\n", together.in_words());
    }
    let listed: Vec<&CameraVerdict> = fleet.cameras.iter().filter(|v| v.found != Found::Steady).collect();
    for v in listed.iter().take(most) {
        text += &format!(
            "{:20} {:10} {}\n",
            v.camera,
            v.found.name().replace('_', " ").to_uppercase(),
            v.message
        );
    }
    if most < listed.len() {
        text += &format!("… and {} more; --json has them all\n", listed.len() - most);
    }
    text
}
