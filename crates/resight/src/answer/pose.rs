//! The answer of a job that finds one pose, and the JSON object that it becomes.

pub use super::budget::rows;
use super::budget::{BudgetPartObject, parts};
use super::georeference::GeoreferencedPose;
use super::print::PrintedScaleObject;
use super::{Agreement, EstimatedFocal, SchemaNumber};
use crate::core::Pose;
use crate::core::budget::Budget;
use crate::core::locate::PoseEstimate;
use crate::core::locate::choose::{Ambiguity, Hypothesis, Minimum};
use crate::core::locate::consistency::Consistency;
use crate::core::locate::observability::{Axis, Observability};
use crate::core::multiview::tag_map::DisplacedTag;
use crate::core::solve::configuration::{Configuration, Geometry, Measure};
use crate::core::solve::line_plus_one::Weakness;
use crate::locate::{IntrinsicsCost, PointsCause};
use crate::report::verdict::{Status, Verdict, weakness_figures};
use crate::report::words::{sigmas, translation_sigma_m};
use schemars::JsonSchema;
use serde::{Serialize, Serializer};
use serde_json::Value;
use std::collections::BTreeMap;

/// The answer about one view: a status, a sentence, and the pose where there is one. Serialises to the JSON object of the command line.
#[derive(Debug, Clone)]
pub struct PoseAnswer {
    /// Name of the view: the image's path, or the `view` column.
    pub view: String,
    /// Status and sentence.
    pub verdict: Verdict,
    /// The pose, when there is one.
    pub estimate: Option<PoseEstimate>,
    /// The parts of the pose's covariance by their sources; `None` where lines or the focal length are estimated with.
    pub budget: Option<Budget>,
    /// The motion that the points determine least.
    pub observability: Option<Observability>,
    /// Number of points.
    pub n_points: usize,
    /// Number of lines.
    pub n_lines: usize,
    /// Unit of image coordinates: `px`, `normalized` or `unit of f`.
    pub image_unit: &'static str,
    /// Root mean square of the standard deviations used, in `image_unit`.
    pub sigma_px: Option<f64>,
    /// Root mean square of the standard deviations of the known points, metres; `None` when all points are exact.
    pub point_sigma_m: Option<f64>,
    /// Standard deviations of the intrinsics used, as stated; `None` when the intrinsics are exact.
    pub intrinsics_sigma: Option<BTreeMap<String, f64>>,
    /// How much the uncertain intrinsics add to the uncertainty of the position.
    pub intrinsics_cost: Option<IntrinsicsCost>,
    /// The focal length, where it was estimated with the pose.
    pub estimated_focal: Option<EstimatedFocal>,
    /// The measured scale of a printed target; `None` where the target's file states none.
    pub printed_scale: Option<PrintedScaleObject>,
    /// Names of the points; the index of the largest residual refers to them.
    pub names: Vec<String>,
    /// The image size for which the intrinsics were stated, where they were scaled to another.
    pub scaled_from_px: Option<[u32; 2]>,
    /// Inputs that took no part, with the reasons.
    pub skipped: Vec<String>,
    /// The rows that agree, where wrong rows were searched for.
    pub agreement: Option<Agreement>,
    /// Likely causes where the points contradict each other, the most likely first.
    pub causes: Vec<PointsCause>,
    /// Tags that are not where the map states them.
    pub left_out: Vec<DisplacedTag>,
    /// Tags of a map that contradict each other.
    pub contradicting: Vec<u32>,
    /// Where the camera is on the Earth, where the points are given there.
    pub georeference: Option<GeoreferencedPose>,
    /// What is unusual about the input, such as lengths that are hardly metres.
    pub remarks: Vec<String>,
}

/// A rigid transform as JSON has it.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct TransformObject {
    rotation_wxyz: [f64; 4],
    translation_m: [f64; 3],
    matrix: [[f64; 4]; 4],
}

impl From<Pose> for TransformObject {
    fn from(b_from_a: Pose) -> Self {
        TransformObject {
            rotation_wxyz: b_from_a.quaternion_wxyz(),
            translation_m: b_from_a.translation.into(),
            matrix: b_from_a.matrix(),
        }
    }
}

#[derive(Debug, Serialize, JsonSchema)]
struct OtherObject {
    /// That it, and not the first, is the right one.
    probability: f64,
    cam_from_target: TransformObject,
    target_from_cam: TransformObject,
    covariance: [[f64; 6]; 6],
    sigma_rad: [f64; 3],
    sigma_m: [f64; 3],
    rms_px: f64,
    chi2: f64,
}

#[derive(Debug, Serialize, JsonSchema)]
struct AmbiguityObject {
    verdict: &'static str,
    ratio: Option<f64>,
    delta_chi2: Option<f64>,
    other: Option<OtherObject>,
}

/// One of the minima, the answer itself included.
#[derive(Debug, Serialize, JsonSchema)]
struct MinimumObject {
    cam_from_target: TransformObject,
    target_from_cam: TransformObject,
    covariance: [[f64; 6]; 6],
    rms_px: f64,
    chi2: f64,
    delta_chi2: f64,
    probability: f64,
    within_gate: bool,
}

/// The motion that the points show least.
#[derive(Debug, Serialize, JsonSchema)]
struct ObservabilityObject {
    weakest: &'static str,
    /// `[rotation_rad; shift_m]` about and of the target's centre, camera frame, one standard deviation.
    motion: [f64; 6],
    rotation_axis: &'static str,
    sigma_rad: f64,
    shift_axis: &'static str,
    sigma_m: f64,
    correlation: f64,
    correlated: bool,
    ratio: f64,
}

#[derive(Debug, Serialize, JsonSchema)]
struct MeasureObject {
    ratio: f64,
    threshold: f64,
}

/// What was measured on the points before anything was solved.
#[derive(Debug, Serialize, JsonSchema)]
struct GeometryObject {
    configuration: &'static str,
    length_m: f64,
    width_over_length: MeasureObject,
    line_height: Option<MeasureObject>,
    thickness_over_width: Option<MeasureObject>,
}

#[derive(Debug, Serialize, JsonSchema)]
struct WorstPoint {
    index: usize,
    name: String,
    residual_px: f64,
}

/// What makes the view weak: the number seen and the number needed, in standard deviations of a pixel.
#[derive(Debug, Serialize, JsonSchema)]
struct WeaknessObject {
    kind: &'static str,
    metric_sigma: f64,
    needed_sigma: f64,
}

/// The JSON object; keys without a value are null.
#[derive(Debug, Serialize, JsonSchema)]
pub struct PoseObject {
    schema: SchemaNumber,
    view: String,
    status: Status,
    method: Option<&'static str>,
    n_points: usize,
    /// Lines that took part, where there were any.
    #[serde(skip_serializing_if = "Option::is_none")]
    n_lines: Option<usize>,
    /// Of this pose among all that were found: its covariance holds only as far as it is the right one.
    probability: Option<f64>,
    cam_from_target: Option<TransformObject>,
    target_from_cam: Option<TransformObject>,
    covariance: Option<[[f64; 6]; 6]>,
    sigma_rad: Option<[f64; 3]>,
    sigma_m: Option<[f64; 3]>,
    /// Of the vector `cam_from_target.translation_m` itself, which a rotation of the camera changes too.
    sigma_translation_m: Option<[f64; 3]>,
    /// The parts of `covariance` by the sources of the errors.
    #[serde(skip_serializing_if = "Option::is_none")]
    budget: Option<Vec<BudgetPartObject>>,
    rms_px: Option<f64>,
    chi2: Option<f64>,
    degrees_of_freedom: Option<usize>,
    /// Root mean square of what all points share along one axis of the image, where that shows; `covariance` holds it.
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_error_px: Option<f64>,
    sigma_px: Option<f64>,
    image_unit: &'static str,
    point_sigma_m: Option<f64>,
    intrinsics_sigma: Option<BTreeMap<String, f64>>,
    /// What uncertain intrinsics cost the position.
    #[serde(skip_serializing_if = "Option::is_none")]
    intrinsics_cost: Option<IntrinsicsCost>,
    /// The focal length, where it was estimated with the pose.
    #[serde(skip_serializing_if = "Option::is_none")]
    estimated_focal: Option<EstimatedFocal>,
    /// The measured scale of a printed target; the points lie as printed, and `covariance` holds its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    printed_scale: Option<PrintedScaleObject>,
    /// The image size that the intrinsics are of, where they were scaled to this image's.
    #[serde(skip_serializing_if = "Option::is_none")]
    intrinsics_scaled_from_px: Option<[u32; 2]>,
    ambiguity: Option<AmbiguityObject>,
    minima: Option<Vec<MinimumObject>>,
    observability: Option<ObservabilityObject>,
    geometry: Option<GeometryObject>,
    worst_point: Option<WorstPoint>,
    weakness: Option<WeaknessObject>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    skipped: Vec<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    n_inliers: Option<usize>,
    /// Row numbers within the view, counted from 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    inliers: Option<Vec<usize>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    consensus: Option<Agreement>,
    /// Likely causes where the points contradict each other, the best first: the points agree once one of them is corrected.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    causes: Vec<PointsCause>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    left_out_tags: Vec<LeftOutTag>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    contradicting_tags: Vec<u32>,
    /// Where the camera is on the Earth, where the points are given there.
    #[serde(skip_serializing_if = "Option::is_none")]
    georeference: Option<GeoreferencedPose>,
    #[serde(skip_serializing_if = "Vec::is_empty")]
    remarks: Vec<String>,
    message: String,
}

/// A tag that is not where the map says; numbers are null where the tag alone gives no pose.
#[derive(Debug, Serialize, JsonSchema)]
struct LeftOutTag {
    id: u32,
    distance_m: Option<f64>,
    rotation_rad: Option<f64>,
    limit_m: Option<f64>,
}

impl From<&DisplacedTag> for LeftOutTag {
    fn from(tag: &DisplacedTag) -> Self {
        let DisplacedTag { id, distance_m, rotation_rad, limit_m } = *tag;
        LeftOutTag { id, distance_m, rotation_rad, limit_m }
    }
}

impl Serialize for PoseAnswer {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        match self.image_unit {
            "px" => self.json().serialize(serializer),
            unit => {
                let object = serde_json::to_value(self.json()).map_err(serde::ser::Error::custom)?;
                in_unit(object, &unit.replace(' ', "_")).serialize(serializer)
            }
        }
    }
}

/// Converts one key.
pub(super) fn key_in_unit(key: String, unit: &str) -> String {
    match key.strip_suffix("_px") {
        Some(stem) if key != "intrinsics_scaled_from_px" => format!("{stem}_{unit}"),
        _ => key,
    }
}

/// Renames the keys so that they end in the unit of their values: `rms_px` becomes `rms_normalized` for normalised coordinates, and
/// `rms_unit_of_f` for a photogrammetric camera. The size of the image stays in pixels.
pub(super) fn in_unit(value: Value, unit: &str) -> Value {
    match value {
        Value::Object(keys) => {
            keys.into_iter().map(|(key, value)| (key_in_unit(key, unit), in_unit(value, unit))).collect()
        }
        Value::Array(values) => values.into_iter().map(|value| in_unit(value, unit)).collect(),
        other => other,
    }
}

impl PoseObject {
    /// Returns whether the pose may be relied on.
    pub fn status(&self) -> Status {
        self.status
    }
}

impl PoseAnswer {
    /// Returns whether the answer may be relied on.
    pub fn status(&self) -> Status {
        self.verdict.status
    }

    /// Returns the answer for a view that has no pose.
    pub fn without_pose(view: String, status: Status, message: impl Into<String>) -> Self {
        PoseAnswer {
            view,
            verdict: Verdict { status, message: message.into() },
            estimate: None,
            budget: None,
            observability: None,
            n_points: 0,
            n_lines: 0,
            image_unit: "px",
            sigma_px: None,
            point_sigma_m: None,
            intrinsics_sigma: None,
            intrinsics_cost: None,
            estimated_focal: None,
            printed_scale: None,
            names: Vec::new(),
            scaled_from_px: None,
            skipped: Vec::new(),
            agreement: None,
            causes: Vec::new(),
            left_out: Vec::new(),
            contradicting: Vec::new(),
            georeference: None,
            remarks: Vec::new(),
        }
    }

    /// Returns the JSON object.
    pub fn json(&self) -> PoseObject {
        let e = self.estimate.as_ref();
        let sigma = e.map(|e| sigmas(&e.covariance));
        PoseObject {
            schema: SchemaNumber,
            view: self.view.clone(),
            status: self.verdict.status,
            method: e.map(|e| crate::locate::method_name(e.method)),
            n_points: if self.n_lines == 0 { e.map_or(self.n_points, |e| e.n_points) } else { self.n_points },
            n_lines: (0 < self.n_lines).then_some(self.n_lines),
            probability: e.map(|e| e.probability),
            cam_from_target: e.map(|e| e.cam_from_target.into()),
            target_from_cam: e.map(|e| e.cam_from_target.inverse().into()),
            covariance: e.map(|e| rows(&e.covariance)),
            sigma_rad: sigma.map(|s| s.0),
            sigma_m: sigma.map(|s| s.1),
            sigma_translation_m: e.map(|e| translation_sigma_m(&e.cam_from_target, &e.covariance)),
            budget: self.budget.as_ref().map(parts),
            rms_px: e.map(|e| e.rms_px),
            chi2: e.map(|e| e.chi2),
            degrees_of_freedom: e.map(|e| e.degrees_of_freedom),
            shared_error_px: e.map(|e| e.shared_error_px).filter(|px| 0.0 < *px),
            sigma_px: self.sigma_px,
            image_unit: self.image_unit,
            point_sigma_m: self.point_sigma_m,
            intrinsics_sigma: self.intrinsics_sigma.clone(),
            intrinsics_cost: self.intrinsics_cost,
            estimated_focal: self.estimated_focal.clone(),
            printed_scale: self.printed_scale,
            intrinsics_scaled_from_px: self.scaled_from_px,
            ambiguity: e.map(ambiguity),
            minima: e.map(|e| e.minima().map(minimum).collect()),
            observability: self.observability.as_ref().map(observability),
            geometry: e.and_then(|e| e.geometry.as_ref()).map(geometry),
            worst_point: e.and_then(|e| self.worst_point(e)),
            weakness: e.and_then(|e| e.weakness.as_ref()).map(weakness),
            skipped: self.skipped.clone(),
            n_inliers: self.agreement.as_ref().map(|a| a.inliers.len()),
            inliers: self.agreement.as_ref().map(|a| a.inliers.clone()),
            consensus: self.agreement.clone(),
            causes: self.causes.clone(),
            left_out_tags: self.left_out.iter().map(LeftOutTag::from).collect(),
            contradicting_tags: self.contradicting.clone(),
            georeference: self.georeference.clone(),
            remarks: self.remarks.clone(),
            message: self.verdict.message.clone(),
        }
    }

    fn worst_point(&self, estimate: &PoseEstimate) -> Option<WorstPoint> {
        match estimate.consistency {
            Consistency::Inconsistent { worst_point: index, worst_px, .. } => {
                let name = self.names.get(index).cloned().unwrap_or_else(|| index.to_string());
                Some(WorstPoint { index, name, residual_px: worst_px })
            }
            _ => None,
        }
    }
}

fn weakness(weakness: &Weakness) -> WeaknessObject {
    let (kind, metric_sigma, needed_sigma) = weakness_figures(weakness);
    WeaknessObject { kind, metric_sigma, needed_sigma }
}

fn ambiguity(estimate: &PoseEstimate) -> AmbiguityObject {
    match &estimate.ambiguity {
        Ambiguity::Unique { ratio } => AmbiguityObject {
            verdict: "unique",
            ratio: ratio.filter(|r| r.is_finite()),
            delta_chi2: None,
            other: None,
        },
        Ambiguity::Ambiguous { ratio, other } => AmbiguityObject {
            verdict: "ambiguous",
            ratio: Some(*ratio).filter(|r| r.is_finite()),
            delta_chi2: Some(other.chi2 - estimate.chi2),
            other: Some(other_object(other, estimate.others[0].map_or(0.0, |h| h.probability))),
        },
    }
}

fn other_object(other: &Minimum, probability: f64) -> OtherObject {
    let (sigma_rad, sigma_m) = sigmas(&other.covariance);
    OtherObject {
        probability,
        cam_from_target: other.cam_from_target.into(),
        target_from_cam: other.cam_from_target.inverse().into(),
        covariance: rows(&other.covariance),
        sigma_rad,
        sigma_m,
        rms_px: other.rms_px,
        chi2: other.chi2,
    }
}

fn minimum(h: Hypothesis) -> MinimumObject {
    let m = h.minimum;
    MinimumObject {
        cam_from_target: m.cam_from_target.into(),
        target_from_cam: m.cam_from_target.inverse().into(),
        covariance: rows(&m.covariance),
        rms_px: m.rms_px,
        chi2: m.chi2,
        delta_chi2: h.delta_chi2,
        probability: h.probability,
        within_gate: h.is_alternative,
    }
}

fn observability(o: &Observability) -> ObservabilityObject {
    ObservabilityObject {
        weakest: if o.is_shift { "shift" } else { "rotation" },
        motion: o.motion.into(),
        rotation_axis: axis_name(&o.rotation_axis),
        sigma_rad: o.sigma_rad,
        shift_axis: axis_name(&o.shift_axis),
        sigma_m: o.sigma_m,
        correlation: o.correlation,
        correlated: o.correlated(),
        ratio: o.ratio,
    }
}

fn axis_name(axis: &Axis) -> &'static str {
    match axis {
        Axis::LineOfSight => "line_of_sight",
        Axis::Horizontal => "horizontal",
        Axis::Vertical => "vertical",
        Axis::LineOfPoints => "line_of_points",
        _ => "oblique",
    }
}

fn geometry(g: &Geometry) -> GeometryObject {
    let measure = |m: Measure| MeasureObject { ratio: m.ratio, threshold: m.threshold };
    GeometryObject {
        configuration: match g.configuration {
            Configuration::Three => "three",
            Configuration::LinePlusOne { .. } => "line_plus_one",
            Configuration::Planar => "planar",
            Configuration::General => "general",
        },
        length_m: g.length_m,
        width_over_length: measure(g.width),
        line_height: g.line_height.map(measure),
        thickness_over_width: g.thickness.map(measure),
    }
}
