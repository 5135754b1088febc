//! The answers of a capture: one for each kept view, and one at the end.

use super::intrinsics::{CameraIntrinsics, CoverageObject, ParameterObject};
use super::{SchemaNumber, Status};
use schemars::JsonSchema;
use serde::Serialize;

/// A view that a capture has kept. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CaptureViewAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `capture_view`.
    pub kind: &'static str,
    /// The status of the intrinsics so far.
    pub status: Status,
    /// The status in a sentence.
    pub message: String,
    /// The view's name.
    pub view: String,
    /// The frame of the source that it was.
    pub frame: String,
    /// Points of the target in it.
    pub n_points: usize,
    /// Frames so far.
    pub n_frames: usize,
    /// Parameters so far, as those of `intrinsics`; null where the views determine no camera yet.
    pub parameters: Option<Vec<ParameterObject>>,
    /// How far the capture has come.
    pub progress: ProgressObject,
    /// The view that helps most next.
    pub next_view: Option<SuggestionObject>,
}

/// How far a capture has come, and how far it has to go.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ProgressObject {
    /// Whether it is enough: the intrinsics are `ok`, and every number below is as good as needed.
    pub is_enough: bool,
    /// Views kept.
    pub n_views: usize,
    /// Views that take part in the intrinsics.
    pub n_used: usize,
    /// Needed.
    pub needed_views: usize,
    /// Largest standard deviation of the projection at the centres of the cells of the image with corners, px; null where it is not known.
    pub worst_px: Option<f64>,
    /// Needed, px.
    pub needed_px: f64,
    /// Part of the cells of the image with a corner.
    pub coverage_share: f64,
    /// Needed.
    pub needed_coverage: f64,
}

/// The view that helps most next.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct SuggestionObject {
    /// The view in a sentence.
    pub message: String,
    /// The closed outline of the target's points there: column and row, px; through an ordinary lens while the camera is unknown.
    pub outline_px: Vec<[f64; 2]>,
    /// Projection uncertainty with this view, root mean square over the image, px; null while the camera is unknown.
    pub then_px: Option<f64>,
}

/// The result of a capture. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CaptureAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `capture`.
    pub kind: &'static str,
    /// `ok` where it is enough; `undecided` where the intrinsics are `ok` but not good enough yet; otherwise the status of the intrinsics.
    pub status: Status,
    /// The status in a sentence, with what is missing.
    pub message: String,
    /// Frames looked at.
    pub n_frames: usize,
    /// Frames that were not kept, by reason.
    pub refused: Vec<RefusedObject>,
    /// Remarks on the images.
    pub remarks: Vec<String>,
    /// The views kept, in order.
    pub views: Vec<KeptViewObject>,
    /// How far the capture has come.
    pub progress: ProgressObject,
    /// The view that helps most next; null where it is enough.
    pub next_view: Option<SuggestionObject>,
    /// The intrinsics: the answer of `resight intrinsics` for the kept images.
    pub camera: CameraIntrinsics,
}

/// Frames that were not kept for one reason.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct RefusedObject {
    /// `not_found`, `unusable`, `few_points`, `other_size`, `moving`, `first` (of a sequence: whether it moves is unknown), `alike`, `same_tilt`,
    /// `taken_back`, `little_new` or `full`.
    pub reason: &'static str,
    /// How many.
    pub n: usize,
}

/// A view that was kept.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct KeptViewObject {
    /// Its name, and that of its file where kept images are written.
    pub view: String,
    /// The frame of the source that it was.
    pub frame: String,
}

/// A capture while it runs, as a page shows it.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CaptureStateObject {
    /// The status that the answer would have.
    pub status: Status,
    /// It in a sentence; what is missing is in `missing`.
    pub message: String,
    /// Whether the camera may be relied on and written, enough or not.
    pub is_usable: bool,
    /// What is missing, each in a clause.
    pub missing: Vec<String>,
    /// Frames looked at.
    pub n_frames: usize,
    /// Frames that were not kept, by reason.
    pub refused: Vec<RefusedObject>,
    /// Remarks on the images.
    pub remarks: Vec<String>,
    /// Columns and rows of the images, px; null before the first.
    pub size_px: Option<[u32; 2]>,
    /// The last frame; null before the first, and after a view was taken back.
    pub last: Option<LookObject>,
    /// The lens model so far; null where the views determine no camera yet.
    pub model: Option<&'static str>,
    /// Parameters so far.
    pub parameters: Option<Vec<ParameterObject>>,
    /// How far the capture has come.
    pub progress: ProgressObject,
    /// The corners of the kept views by cell of the image; null before the first image.
    pub coverage: Option<CoverageObject>,
    /// The view that helps most next; null before the first image.
    pub next_view: Option<SuggestionObject>,
    /// The kept views, in order, each with what was known with it.
    pub views: Vec<CaptureStepObject>,
}

/// What became of a frame.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LookObject {
    /// Its name.
    pub frame: String,
    /// The view as which it is kept; null where it is not.
    pub view: Option<String>,
    /// Why it is not kept, as in `refused`; null where it is.
    pub reason: Option<&'static str>,
    /// What became of it, in a sentence.
    pub message: String,
    /// Points of the target in it.
    pub n_points: usize,
}

/// A kept view, and the camera matrix that was known with it.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CaptureStepObject {
    /// Its name.
    pub view: String,
    /// The frame of the source that it was.
    pub frame: String,
    /// Points of the target in it.
    pub n_points: usize,
    /// Focal lengths and principal point; null where the views up to it determine no camera.
    pub parameters: Option<Vec<ParameterObject>>,
    /// Largest standard deviation of the projection, as in `progress`.
    pub worst_px: Option<f64>,
    /// Part of the cells of the image with a corner.
    pub coverage_share: f64,
}
