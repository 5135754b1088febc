//! Positions on the Earth in answers.

use super::{SchemaNumber, Status};
use crate::georeference::earth::Geographic;
use crate::georeference::system::CoordinateSystem;
use schemars::JsonSchema;
use serde::Serialize;

/// The origin of the frame in which a view was solved.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
#[serde(untagged)]
pub enum OriginObject {
    /// A place; the axes are east, north and up there.
    Place(Geographic),
    /// Of a grid; the axes are those of the grid.
    Grid {
        /// Easting, metres.
        easting_m: f64,
        /// Northing, metres.
        northing_m: f64,
        /// Height, metres.
        height_m: f64,
    },
}

/// Where a camera is on the Earth and where it looks.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct GeoreferencedPose {
    /// The system in which the points were given.
    pub coordinate_system: CoordinateSystem,
    /// `true` north, or that of the `grid`; headings are clockwise from it.
    pub north: &'static str,
    /// Origin of the target frame: x east, y north, z up.
    pub origin: OriginObject,
    /// Latitude of the camera, degrees; null in a grid whose place is unknown.
    pub lat_deg: Option<f64>,
    /// Longitude of the camera, degrees.
    pub lon_deg: Option<f64>,
    /// Height of the camera, above what the heights of the points are above.
    pub height_m: f64,
    /// Easting of the camera, where the points are in a projected system.
    pub easting_m: Option<f64>,
    /// Northing of the camera.
    pub northing_m: Option<f64>,
    /// Standard deviation of the camera's position towards the east.
    pub east_sigma_m: f64,
    /// Towards the north.
    pub north_sigma_m: f64,
    /// Upwards.
    pub height_sigma_m: f64,
    /// Covariance of east, north and up.
    pub position_covariance_m2: [[f64; 3]; 3],
    /// Heading of the optical axis, clockwise from north, 0 to 2π; null where it is not determined.
    pub heading_rad: Option<f64>,
    /// Its standard deviation.
    pub heading_sigma_rad: Option<f64>,
    /// By how much the optical axis points below the horizon.
    pub tilt_rad: f64,
    /// Its standard deviation.
    pub tilt_sigma_rad: f64,
    /// By how much the camera is rotated about its axis, clockwise as seen from behind it; null where the heading is.
    pub roll_rad: Option<f64>,
    /// Its standard deviation.
    pub roll_sigma_rad: Option<f64>,
    /// Heading of the image's upward direction, for cameras that look down; null for one that looks level.
    pub image_up_heading_rad: Option<f64>,
    /// Its standard deviation.
    pub image_up_heading_sigma_rad: Option<f64>,
    /// A true heading less the heading in the grid, where the points are in a UTM zone.
    pub grid_convergence_rad: Option<f64>,
}

/// The coordinates of a pixel of a map image.
#[derive(Debug, Clone, PartialEq, Serialize, JsonSchema)]
pub struct MapPointAnswer {
    /// The number of the JSON schema.
    pub schema: SchemaNumber,
    /// `map_point`.
    pub kind: &'static str,
    /// `ok`, or `error` where the pixel is outside the image.
    pub status: Status,
    /// Column `id`, or the row's number.
    pub id: String,
    /// Pixel of the map image.
    pub map_u_px: f64,
    /// Pixel of the map image.
    pub map_v_px: f64,
    /// The system of the map.
    pub coordinate_system: CoordinateSystem,
    /// Latitude, degrees; null where the map's grid is unknown.
    pub lat_deg: Option<f64>,
    /// Longitude, degrees.
    pub lon_deg: Option<f64>,
    /// Easting, where the map is in a projected system.
    pub easting_m: Option<f64>,
    /// Northing.
    pub northing_m: Option<f64>,
    /// Standard deviation of each coordinate: that of the pixel times its size.
    pub sigma_m: f64,
    /// The coordinates in a sentence, or what is wrong.
    pub message: String,
}
