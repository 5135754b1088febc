//! Everything that is shown of a session, in one object.

use crate::advice::Advice;
use crate::command::{MeasuredKind, Template};
use crate::figures::Figure;
use crate::lines::Overlay;
use crate::snap::Snapped;
use resight::answer::PoseObject;
use schemars::JsonSchema;
use serde::Serialize;

/// What a page shows. Pixels are those of the file: (0, 0) is the centre of the top-left one.
#[derive(Debug, Serialize, JsonSchema)]
pub struct View {
    /// Counts the changes.
    pub version: u64,
    /// Number of the photograph that this is a view of.
    pub photo_index: usize,
    /// That photograph.
    pub photo: Option<PhotoView>,
    /// All photographs.
    pub photos: Vec<PhotoView>,
    /// Its lens.
    pub lens: Option<LensView>,
    /// What the points are.
    pub template: Template,
    /// How exactly points are placed by hand.
    pub sigma_px: f64,
    /// Its points.
    pub points: Vec<PointView>,
    /// Names of points that other photographs show and this one does not yet.
    pub names_elsewhere: Vec<String>,
    /// The distances typed.
    pub distances: Vec<DistanceView>,
    /// What is still needed.
    pub missing: Vec<StepText>,
    /// Why the last command was refused.
    pub error: Option<StepText>,
    /// The pose, as `resight solve --json` has it.
    pub answer: Option<PoseObject>,
    /// Whether the answer is that of an earlier state, kept while what is stated now gives none.
    pub is_old: bool,
    /// Why what is stated now gives no answer.
    pub refusal: Option<StepText>,
    /// Which of the poses that fit is drawn: 0 as answered.
    pub chosen_pose: usize,
    /// What the pose means.
    pub figures: Vec<Figure>,
    /// What is drawn over the photograph.
    pub overlay: Option<Overlay>,
    /// Where the next point would help most; none while one is dragged.
    pub advice: Option<Advice>,
    /// What is measured.
    pub measurements: Vec<MeasurementView>,
    /// Changes when anything of the measurements changes.
    pub n_measured: u64,
    /// Whether their values are those of an earlier state: newer ones follow.
    pub is_measuring: bool,
    /// Whether a bird's-eye view can be asked for.
    pub birdseye: Option<BirdseyeView>,
    /// The answer to `snap`.
    pub snap: Option<Snapped>,
    /// What is drawn.
    pub show: ShowView,
    /// Whether there is a change to take back.
    pub can_undo: bool,
    /// Whether there is one to make again.
    pub can_redo: bool,
}

impl View {
    /// Returns the status of the answer, where there is one that is up to date.
    pub fn status(&self) -> Option<&'static str> {
        self.answer.as_ref().filter(|_| !self.is_old).map(|answer| answer.status().name())
    }
}

/// A photograph.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PhotoView {
    /// Its file name.
    pub name: String,
    /// SHA-256 of its file, in hexadecimal: what it is known by.
    pub sha256: String,
    /// Columns.
    pub width_px: u32,
    /// Rows.
    pub height_px: u32,
    /// Whether a focal length follows from its EXIF.
    pub has_exif_lens: bool,
    /// The camera of the list that its EXIF names, where that does not state the focal length.
    pub common_camera: Option<&'static str>,
    /// What to do where its EXIF does not state the focal length.
    pub exif_advice: Option<String>,
    /// Whether it has a lens of its own, stated or estimated, that another photograph may take.
    pub lends_lens: bool,
}

/// The lens of a photograph.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LensView {
    /// `given`, `estimated`, `open` (to be estimated, and not determined yet) or `refused`.
    pub state: &'static str,
    /// In words.
    pub words: String,
    /// Name of its model.
    pub model: Option<String>,
    /// Horizontal field of view.
    pub hfov_deg: Option<f64>,
    /// What one must know of it.
    pub remark: Option<String>,
    /// Why it is refused.
    pub error: Option<String>,
}

/// A point of the photograph.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PointView {
    /// Its name.
    pub name: String,
    /// Column.
    pub u_px: f64,
    /// Row.
    pub v_px: f64,
    /// Standard deviation of both: of a detector, of what it snapped to, or of a hand.
    pub sigma_px: f64,
    /// Where it is: typed, by distances, or by several photographs.
    pub position_m: Option<[f64; 3]>,
    /// 95 % half widths of it where photographs gave it.
    pub half_width_95_m: Option<[f64; 3]>,
    /// How far the pose puts it from where it was clicked.
    pub residual_px: Option<f64>,
    /// How much of the point's own error the pose takes up: 0 none, 1 all of it, so that nothing checks it.
    pub leverage: Option<f64>,
    /// Whether it fits worst: of several points one always does.
    pub is_worst: bool,
    /// Whether it fits worse than its own error and that of the pose explain (one of a thousand right ones does).
    pub is_suspect: bool,
}

/// A distance.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct DistanceView {
    /// One end.
    pub a: String,
    /// The other.
    pub b: String,
    /// As typed.
    pub distance_m: f64,
    /// Its standard deviation.
    pub sigma_m: f64,
    /// What it is by the places of its ends.
    pub computed_m: Option<f64>,
}

/// A sentence and the step it belongs to.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct StepText {
    /// `photograph`, `lens`, `marks` or `measure`.
    pub step: &'static str,
    /// The sentence.
    pub text: String,
}

/// Something measured.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct MeasurementView {
    /// Its name.
    pub name: String,
    /// What it is.
    pub what: MeasuredKind,
    /// Number of its photograph.
    pub photo: usize,
    /// Its points in the photograph.
    pub points: Vec<[f64; 2]>,
    /// Status word of the network.
    pub status: Option<&'static str>,
    /// Its value; x of a position.
    pub value: Option<f64>,
    /// Half of the 95 % interval.
    pub half_width_95: Option<f64>,
    /// Lower end of it.
    pub low: Option<f64>,
    /// Upper end.
    pub high: Option<f64>,
    /// All values: three of a position.
    pub values: Vec<f64>,
    /// Lower and upper end of the 95 % interval of each.
    pub intervals_95: Vec<[f64; 2]>,
    /// Unit of the values.
    pub unit: &'static str,
    /// In words.
    pub words: String,
    /// Why there is no value.
    pub error: Option<String>,
}

/// A bird's-eye view.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BirdseyeView {
    /// Changes when the image would.
    pub version: u64,
}

/// What is drawn.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ShowView {
    /// The grid.
    pub grid: bool,
    /// The axes.
    pub axes: bool,
}
