//! The answers of the jobs that estimate and check intrinsics.

use super::budget::NumbersPartObject;
use super::{SchemaNumber, Status, TransformObject};
use crate::core::multiview::intrinsics::Severity;
use crate::formats::NamedCamera;
use schemars::JsonSchema;
use serde::Serialize;

/// The intrinsics of one or several cameras. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct IntrinsicsAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `intrinsics`.
    pub kind: &'static str,
    /// The worst of the cameras'.
    pub status: Status,
    /// Each camera, in order of its name.
    pub cameras: Vec<CameraIntrinsics>,
    /// What is unusual about files and observations.
    #[serde(skip)]
    pub remarks: Vec<String>,
}

impl IntrinsicsAnswer {
    pub(crate) fn new(cameras: Vec<CameraIntrinsics>, remarks: Vec<String>) -> Self {
        let status = worst(cameras.iter().map(|camera| camera.status));
        IntrinsicsAnswer { schema: SchemaNumber, kind: "intrinsics", status, cameras, remarks }
    }

    /// Returns the cameras whose intrinsics may be relied on, as a camera file holds them; they do not depend on the target's size, and so
    /// not on whether that is plausible.
    pub fn reliable(&self) -> Vec<NamedCamera> {
        self.cameras.iter().filter(|one| one.is_reliable()).filter_map(|one| one.camera.clone()).collect()
    }
}

impl CameraIntrinsics {
    /// Returns whether the intrinsics may be relied on.
    pub fn is_reliable(&self) -> bool {
        matches!(self.status, Status::Ok | Status::Implausible) && self.camera.is_some()
    }
}

/// Returns the first status that is not `Ok`, or `Ok` if there is none.
pub(crate) fn worst(statuses: impl IntoIterator<Item = Status>) -> Status {
    statuses.into_iter().find(|status| *status != Status::Ok).unwrap_or(Status::Ok)
}

/// One camera's intrinsics, or why there are none.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraIntrinsics {
    /// Its name.
    pub name: String,
    /// `ok`; `inconsistent` where the data contradict themselves; `implausible` where a size of the target hardly exists, on which the views'
    /// poses depend and the intrinsics do not; `degenerate` where they determine no camera; `not_found` without a target.
    pub status: Status,
    /// The status in a sentence, with the way out.
    pub message: String,
    /// What is wrong or weak, the worst first.
    pub findings: Vec<FindingObject>,
    /// The intrinsics; null where there are none.
    pub intrinsics: Option<IntrinsicsObject>,
    /// What took no part from the beginning.
    pub left_out: Vec<LeftOutObject>,
    /// As a camera file holds it.
    #[serde(skip)]
    pub camera: Option<NamedCamera>,
}

/// Above this a pixel's direction, in the mean over the image, is too uncertain for most uses, px; 0.3 is good.
pub const WEAK_PX: f64 = 1.0;

impl CameraIntrinsics {
    /// Returns whether the answer is `ok` and yet not what people accept.
    pub fn is_weak(&self) -> bool {
        let projection_px = self.intrinsics.as_ref().and_then(|found| found.projection.rms_px);
        self.status == Status::Ok && projection_px.is_some_and(|px| WEAK_PX < px)
    }
}

/// Something that the data show.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct FindingObject {
    /// A word for it.
    pub name: &'static str,
    /// How much it weighs.
    pub severity: SeverityObject,
    /// The number seen, the number needed, the way out.
    pub message: String,
}

/// How much a finding weighs.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum SeverityObject {
    /// The answer holds; something could be better.
    Remark,
    /// The answer's errors may be far larger than stated.
    Inconsistent,
    /// No answer.
    Degenerate,
}

impl From<Severity> for SeverityObject {
    fn from(severity: Severity) -> Self {
        match severity {
            Severity::Remark => SeverityObject::Remark,
            Severity::Inconsistent => SeverityObject::Inconsistent,
            Severity::Degenerate => SeverityObject::Degenerate,
        }
    }
}

/// An image, or a point of one, that took no part.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct LeftOutObject {
    /// Its view.
    pub view: String,
    /// A target, `point ID`, or `frame`.
    pub what: String,
    /// Why.
    pub reason: String,
}

/// The intrinsics with all that is known of them.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct IntrinsicsObject {
    /// The lens model, as in camera.toml.
    pub model: &'static str,
    /// Columns of the images.
    pub width_px: u32,
    /// Rows of the images.
    pub height_px: u32,
    /// Parameters in the order of the covariance.
    pub parameters: Vec<ParameterObject>,
    /// Covariance of the parameters, rows in their order; units px and 1.
    pub covariance: Vec<Vec<f64>>,
    /// The parts of the covariance by the sources of the errors.
    pub budget: Vec<NumbersPartObject>,
    /// Root mean square of the residuals, px of one coordinate.
    pub rms_px: f64,
    /// χ² with the stated sigmas.
    pub chi2: f64,
    /// Two for each corner, less six for each view, less the shared unknowns.
    pub degrees_of_freedom: usize,
    /// Factor on the stated variances, as the residuals show it.
    pub noise_scale: f64,
    /// Factor by which variances grew further, since views contradict each other.
    pub contradiction: f64,
    /// Lens models that were tried.
    pub tried: Vec<TriedObject>,
    /// Views that took part.
    pub views: Vec<IntrinsicsViewObject>,
    /// Bad views.
    pub bad_views: Vec<BadViewObject>,
    /// Bad corners of the other views.
    pub bad_corners: Vec<BadCornerObject>,
    /// Corners that took part.
    pub n_corners: usize,
    /// Stretch and bend of the target, where they were estimated.
    pub target_shape: Option<TargetShapeObject>,
    /// Corners by cell of the image.
    pub coverage: CoverageObject,
    /// Standard deviation of the projection over the image.
    pub projection: ProjectionObject,
    /// Views predicted by a camera of other views.
    pub held_out: Option<HeldOutObject>,
    /// The view to take next.
    pub next_view: Option<NextViewObject>,
}

/// One parameter.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[schemars(rename = "IntrinsicParameterObject")]
pub struct ParameterObject {
    /// Its name, as in camera.toml.
    pub name: &'static str,
    /// Its value, px or 1.
    pub value: f64,
    /// Standard deviation.
    pub sigma: f64,
    /// Whether it was estimated; else it is zero, for the views do not need it.
    pub estimated: bool,
}

/// A lens model that was tried.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct TriedObject {
    /// The model and its coefficients.
    pub model: String,
    /// Root mean square of the residuals, px of one coordinate.
    pub rms_px: Option<f64>,
    /// Akaike's information criterion less that of the model taken; null where there is no answer.
    pub aic: Option<f64>,
    /// A parameter that the views leave open.
    pub undetermined: Option<&'static str>,
}

/// A view that took part.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct IntrinsicsViewObject {
    /// Its name.
    pub view: String,
    /// Corners that took part.
    pub n_corners: usize,
    /// Root mean square of its residuals, px of one coordinate.
    pub rms_px: f64,
    /// The target's pose.
    pub cam_from_target: TransformObject,
    /// 6×6, `[rotation_rad; translation_m]`.
    pub covariance: [[f64; 6]; 6],
    /// Column, row and residual (observed − predicted) of each corner, px.
    #[serde(skip)]
    pub residuals_px: Vec<[f64; 4]>,
}

/// A bad view.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BadViewObject {
    /// Its name.
    pub view: String,
    /// Why, with numbers.
    pub reason: String,
}

/// A bad corner.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BadCornerObject {
    /// Its view.
    pub view: String,
    /// Its name.
    pub point: String,
    /// Observed − predicted, px; null where the camera cannot see the point.
    pub residual_px: Option<[f64; 2]>,
}

/// Stretch and bend of a flat target.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct TargetShapeObject {
    /// Height over width, less what is stated; and standard deviation.
    pub stretch: [f64; 2],
    /// Height of the middle above the edges along x, metres; and standard deviation. null where the target is taken as flat.
    pub bend_x_m: Option<[f64; 2]>,
    /// The same along y.
    pub bend_y_m: Option<[f64; 2]>,
}

/// Corners by cell of a grid over the image, row by row.
#[derive(Debug, Clone, Serialize, JsonSchema)]
#[schemars(rename = "ImageCoverageObject")]
pub struct CoverageObject {
    /// Cells in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Corners by cell.
    pub counts: Vec<usize>,
    /// Part of the cells with a corner.
    pub share: f64,
}

/// Standard deviations over a grid from corner to corner of the image, row by row.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct ProjectionObject {
    /// Places in a row.
    pub columns: usize,
    /// Rows.
    pub rows: usize,
    /// Along the worse direction, px; null outside the lens model's field.
    pub sigma_px: Vec<Option<f64>>,
    /// Root mean square over the image.
    pub rms_px: Option<f64>,
}

/// Views predicted by a camera of other views.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct HeldOutObject {
    /// Residuals under the camera of the other half of the views: root mean square, px of one coordinate.
    pub rms_px: f64,
    /// The same views under the camera of all.
    pub with_all_px: f64,
    /// Chance that two halves of one camera's views differ as much.
    pub p: f64,
}

/// The view to take next.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct NextViewObject {
    /// Where the middle of the target should be, px.
    pub centre_px: [f64; 2],
    /// By how much it should be tilted, rad.
    pub tilt_rad: f64,
    /// Axis of the tilt in the image, rad from the u axis towards the v axis; about v (90°) the right edge moves towards the camera.
    pub axis_rad: f64,
    /// Distance, metres.
    pub distance_m: f64,
    /// Projection uncertainty, root mean square over the image, px, now.
    pub now_px: f64,
    /// With this view.
    pub then_px: f64,
    /// The view in a sentence.
    pub message: String,
}

/// Whether given intrinsics fit. Serialises to the JSON object of the command line.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct IntrinsicsCheckAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `intrinsics_check`.
    pub kind: &'static str,
    /// The worst of the cameras'.
    pub status: Status,
    /// Each camera.
    pub cameras: Vec<CameraCheck>,
    /// What is unusual about files and observations.
    #[serde(skip)]
    pub remarks: Vec<String>,
}

/// Whether one camera's intrinsics fit.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraCheck {
    /// Its name.
    pub name: String,
    /// `ok` where they fit, `inconsistent` where they do not, `degenerate` where the views cannot tell.
    pub status: Status,
    /// The answer in a sentence.
    pub message: String,
    /// Chance of such residuals if the intrinsics are right; null where the views cannot tell.
    pub p: Option<f64>,
    /// Every tested parameter: what is given, and what to add to it with all others free.
    pub offsets: Vec<OffsetObject>,
    /// Parameters that the views leave open.
    pub undetermined: Vec<&'static str>,
    /// Views that took part.
    pub n_views: usize,
    /// Variance of the residuals over the stated one.
    pub noise_scale: Option<f64>,
}

/// How far a parameter seems to be off.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct OffsetObject {
    /// Its name.
    pub name: &'static str,
    /// Value given, px or 1.
    pub given: f64,
    /// What to add to it.
    pub offset: f64,
    /// Standard deviation of that.
    pub sigma: f64,
    /// Whether it is of a kind that is blamed.
    pub blamed: bool,
}
