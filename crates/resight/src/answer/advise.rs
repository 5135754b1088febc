//! The answers of the jobs that advise where to put a point, a target or a board.

use super::{SchemaNumber, Status, TransformObject};
use crate::advise::heat::HeatMap;
use crate::advise::words;
use crate::core::advise::change::Change;
use crate::core::advise::layout::LayoutWarning;
use crate::core::advise::volume::{Outlook, Spread};
use crate::core::advise::{Expectation, FirstOrderLimit};
use schemars::JsonSchema;
use serde::Serialize;
use std::collections::BTreeMap;

/// Standard deviations of a view.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct Figures {
    /// Greatest of the camera's position over all directions; null where the points do not determine it.
    pub sigma_position_m: Option<f64>,
    /// The same if the camera's intrinsics were exact; only where they are not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_position_exact_intrinsics_m: Option<f64>,
    /// Greatest of its rotation over all axes.
    pub sigma_rotation_rad: Option<f64>,
    /// Of the length asked for.
    pub sigma_length_m: Option<f64>,
    /// How far apart the nearest other pose shows the points, in standard deviations; null where there is none.
    pub separation_sigma: Option<f64>,
    /// Probability that the answer will be ambiguous.
    pub chance_ambiguous: f64,
    /// Whether these first-order figures hold within 5 %.
    pub first_order_valid: bool,
    /// Why not.
    pub first_order_limits: Vec<String>,
    /// What is wrong with the layout.
    pub layout_warnings: Vec<String>,
}

impl Figures {
    pub(crate) fn new(
        e: &Expectation,
        sigma_length_m: Option<f64>,
        layout_warnings: &[LayoutWarning],
    ) -> Self {
        let (rotation, place) = crate::core::advise::expect::worst_sigmas(&e.covariance);
        let first_order_limits = first_order_limits(&e.first_order_limits());
        let exact = crate::core::advise::expect::worst_sigmas(&e.exact_intrinsics_covariance).1;
        Figures {
            sigma_position_m: Some(place),
            sigma_position_exact_intrinsics_m: (e.covariance != e.exact_intrinsics_covariance)
                .then_some(exact),
            sigma_rotation_rad: Some(rotation),
            sigma_length_m,
            separation_sigma: Some(e.separation_sigma).filter(|d| d.is_finite()),
            chance_ambiguous: e.chance_ambiguous(),
            first_order_valid: first_order_limits.is_empty(),
            first_order_limits,
            layout_warnings: layout_warnings.iter().map(words::layout_warning).collect(),
        }
    }
}

/// Why a view's figures do not hold, in sentences.
pub(crate) fn first_order_limits(first_order_limits: &[FirstOrderLimit]) -> Vec<String> {
    first_order_limits.iter().map(words::first_order_limit).collect()
}

/// An image to go with advice: its file name and what it shows.
pub type Picture = (String, HeatMap);

/// Where to put the next point.
#[derive(Debug, Clone)]
pub struct PointsAdvice {
    /// The points so far.
    pub now: PointsNow,
    /// The next one, best first.
    pub suggestions: Vec<PointSuggestion>,
    /// What the other places would give.
    pub tried: TriedPlaces,
    /// What the figures are made small of: `length`, `rotation`, `camera's position`.
    pub aim: &'static str,
    /// What is unusual.
    pub remarks: Vec<String>,
    /// Maps, where they were asked for.
    pub pictures: Vec<Picture>,
}

/// What the points so far give.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PointsNow {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `now`.
    pub kind: &'static str,
    /// `degenerate` where no suggestion determines the pose.
    pub status: Status,
    /// How many points there are.
    pub n_points: usize,
    /// Standard deviation of u and v.
    pub sigma_px: f64,
    /// Where the camera is, target frame.
    pub camera_m: [f64; 3],
    /// Their standard deviations.
    #[serde(flatten)]
    pub figures: Figures,
}

/// One place for the next point.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct PointSuggestion {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `suggestion`.
    pub kind: &'static str,
    /// `ok` where the figures hold.
    pub status: Status,
    /// Counted from 1, the best.
    pub rank: usize,
    /// Name of the candidate; empty for a place of the grid.
    pub id: String,
    /// Where, target frame.
    pub x_in_target_m: [f64; 3],
    /// Standard deviations with it.
    #[serde(flatten)]
    pub figures: Figures,
}

/// All places tried.
#[derive(Debug, Clone, PartialEq)]
pub struct TriedPlaces {
    /// How many.
    pub n_tried: usize,
    /// The camera does not see these.
    pub n_hidden: usize,
    /// With these the pose stays ambiguous.
    pub n_ambiguous: usize,
    /// Standard deviation of the aim with the best, the middle and the worst of the others; radians for a rotation, else metres.
    pub sigma: Option<[f64; 3]>,
}

/// How well a target is seen over a volume, and which change of it helps.
#[derive(Debug, Clone)]
pub struct TargetAdvice {
    /// Its kind, number of points.
    pub target: (&'static str, usize),
    /// The whole volume, then its parts.
    pub outlooks: Vec<VolumeOutlook>,
    /// Changes, best first.
    pub changes: Vec<TargetChange>,
    /// Maps, where they were asked for.
    pub pictures: Vec<Picture>,
}

/// Median, 95 % quantile and worst of a standard deviation.
#[derive(Debug, Clone, Copy, Serialize, JsonSchema)]
pub struct SpreadObject {
    /// Half of the views are below.
    pub median: f64,
    /// 95 % of the views are below.
    pub p95: f64,
    /// The greatest.
    pub worst: f64,
}

impl From<Spread> for SpreadObject {
    fn from(s: Spread) -> Self {
        SpreadObject { median: s.median, p95: s.p95, worst: s.worst }
    }
}

/// What a target is worth over a volume.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct OutlookObject {
    /// Views tried.
    pub n_views: usize,
    /// In these the target does not fit into the image.
    pub n_out_of_view: usize,
    /// These do not determine the pose.
    pub n_undetermined: usize,
    /// Of the camera's position, worst direction, over the views.
    pub sigma_position_m: Option<SpreadObject>,
    /// Of the camera's position if its intrinsics were exact; only where they are not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_position_exact_intrinsics_m: Option<SpreadObject>,
    /// Of its rotation, worst axis.
    pub sigma_rotation_rad: Option<SpreadObject>,
    /// Share of answers that will be ambiguous.
    pub ambiguous: f64,
    /// Share of answers with the wrong pose first.
    pub wrong: f64,
    /// Share of views where first-order figures do not hold.
    pub first_order_fails: f64,
}

impl From<&Outlook> for OutlookObject {
    fn from(o: &Outlook) -> Self {
        OutlookObject {
            n_views: o.n_views,
            n_out_of_view: o.n_out_of_view,
            n_undetermined: o.n_undetermined,
            sigma_position_m: o.position_m.map(SpreadObject::from),
            sigma_position_exact_intrinsics_m: o.position_exact_intrinsics_m.map(SpreadObject::from),
            sigma_rotation_rad: o.rotation_rad.map(SpreadObject::from),
            ambiguous: o.ambiguous,
            wrong: o.wrong,
            first_order_fails: o.first_order_fails,
        }
    }
}

/// A target over the volume or one of its parts.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct VolumeOutlook {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `outlook`.
    pub kind: &'static str,
    /// `degenerate` where no view determines the pose.
    pub status: Status,
    /// From and to.
    pub distance_m: [f64; 2],
    /// From and to.
    pub tilt_rad: [f64; 2],
    /// What the target is worth there.
    #[serde(flatten)]
    pub outlook: OutlookObject,
}

/// A change of the target, and what it is worth then over the whole volume.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct TargetChange {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `change`.
    pub kind: &'static str,
    /// `degenerate` where no view determines the pose.
    pub status: Status,
    /// Counted from 1, the best.
    pub rank: usize,
    /// Of the target file.
    pub key: &'static str,
    /// Its value.
    pub from: f64,
    /// What it would be.
    pub to: f64,
    /// Whether the target becomes larger.
    pub enlarges_target: bool,
    /// Median of the position's sigma over the share of answers of use, over that of the target as it is: below 1 it helps.
    pub cost_ratio: f64,
    /// What the target is worth then.
    #[serde(flatten)]
    pub outlook: OutlookObject,
    /// The change itself.
    #[serde(skip)]
    pub change: Change,
}

/// Where to show the next board to a rig.
#[derive(Debug, Clone)]
pub struct BoardAdvice {
    /// The rig by the views so far.
    pub now: RigNow,
    /// The next boards, each with those before it.
    pub suggestions: Vec<BoardSuggestion>,
    /// What is unusual.
    pub remarks: Vec<String>,
    /// Maps, where they were asked for.
    pub pictures: Vec<Picture>,
}

/// What is known of a camera of a rig.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct CameraFigures {
    /// Whether the views determine its pose.
    pub determined: bool,
    /// Worst direction, relative to the reference.
    pub sigma_position_m: f64,
    /// The same if all intrinsics were exact; only where some are not.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sigma_position_exact_intrinsics_m: Option<f64>,
    /// Worst axis.
    pub sigma_rotation_rad: f64,
}

/// The rig by the views so far.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct RigNow {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `now`.
    pub kind: &'static str,
    /// `degenerate` where a camera's pose is not determined yet.
    pub status: Status,
    /// How many views there are.
    pub n_views: usize,
    /// The camera whose frame is the rig's.
    pub reference: String,
    /// The cameras by name.
    pub cameras: BTreeMap<String, CameraFigures>,
}

/// One board to show.
#[derive(Debug, Clone, Serialize, JsonSchema)]
pub struct BoardSuggestion {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `suggestion`.
    pub kind: &'static str,
    /// `ok` where the figures hold.
    pub status: Status,
    /// Counted from 1, the first to show.
    pub rank: usize,
    /// Where.
    pub rig_from_target: TransformObject,
    /// The board's centre.
    pub centre_in_rig_m: [f64; 3],
    /// Which way its front looks, rig frame.
    #[serde(skip)]
    pub front_in_rig: [f64; 3],
    /// Cameras that see it.
    pub seen_by: Vec<String>,
    /// The cameras by name, with it and those before it.
    pub cameras: BTreeMap<String, CameraFigures>,
    /// Whether these first-order figures hold.
    pub first_order_valid: bool,
    /// Why not.
    pub first_order_limits: Vec<String>,
}
