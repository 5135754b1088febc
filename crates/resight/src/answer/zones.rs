//! The answer of the job that moves zones with their camera.

use super::{SchemaNumber, Status};
use schemars::JsonSchema;
use serde::Serialize;

/// A zone after the camera has moved.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct ZoneAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `zone`.
    pub kind: &'static str,
    /// `ok`; `undecided` where a rotation does not explain the image to `limit_px`; `not_found` where the zone has left the image; `inconsistent` where
    /// the camera shifted more than was stated.
    pub status: Status,
    /// The zone's name.
    pub zone: String,
    /// The zone in the present image, clipped to it; null unless `ok`.
    pub polygon_px: Option<Vec<[f64; 2]>>,
    /// The same as a recorder writes it, where the zone was given so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub coordinates: Option<String>,
    /// How far the rotation moves its corners at most; null where the motion is contradicted.
    pub moved_px: Option<f64>,
    /// How far the moved zone may be off (95 %), by the uncertainty of the rotation, and by a shift, for everything at `nearest_m` or farther; null
    /// where no distance is stated and the camera may have shifted.
    pub error_px: Option<f64>,
    /// The limit of that.
    pub limit_px: f64,
    /// From which distance on everything in the zone is moved to within the limit; 0 where there was no shift, null where no distance suffices.
    pub holds_from_m: Option<f64>,
    /// The part of the moved zone that is in the image, 0 to 1.
    pub share_in_image: Option<f64>,
    /// The answer in a sentence.
    pub message: String,
}
