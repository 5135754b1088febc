//! Mirrors of the tables of the scene file, and nothing else. Keys of scenes written for version 1 are read as aliases.

use super::QueryKind;
use serde::Deserialize;
use std::collections::BTreeMap;
use std::path::PathBuf;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SceneFile {
    #[serde(alias = "clicks")]
    pub(super) image_points: Option<PathBuf>,
    pub(super) sigma_px: Option<f64>,
    #[serde(default)]
    pub(super) lengths_are_metres: bool,
    #[serde(default)]
    pub(super) photo: Vec<PhotoEntry>,
    #[serde(default, alias = "mark")]
    pub(super) control_point: Vec<ControlPointEntry>,
    #[serde(default)]
    pub(super) known_distance: Vec<DistanceEntry>,
    /// The system of `easting_m` and `northing_m`.
    pub(super) crs: Option<String>,
    pub(super) plane: Option<PlaneEntry>,
    #[serde(default)]
    pub(super) upright: Vec<UprightEntry>,
    #[serde(default)]
    pub(super) query: Vec<QueryEntry>,
    pub(super) birdseye: Option<BirdseyeEntry>,
    /// Data of the page of `resight serve`.
    #[serde(rename = "session")]
    _session: Option<serde::de::IgnoredAny>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PhotoEntry {
    pub(super) name: String,
    pub(super) file: Option<PathBuf>,
    pub(super) camera: String,
    /// The contents of the camera file, instead of a path.
    pub(super) camera_text: Option<String>,
    #[serde(default)]
    pub(super) intrinsics_sigma: BTreeMap<String, f64>,
    #[serde(default, alias = "clicks")]
    pub(super) image_points: Vec<ImagePointEntry>,
    pub(super) pose: Option<PoseEntry>,
    pub(super) down_in_cam: Option<[f64; 3]>,
    pub(super) down_sigma_rad: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ImagePointEntry {
    pub(super) point: String,
    pub(super) u_px: f64,
    pub(super) v_px: f64,
    pub(super) sigma_px: Option<f64>,
}

/// x_in_cam = cam_from_world · x_in_world.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PoseEntry {
    pub(super) rotation_wxyz: [f64; 4],
    pub(super) translation_m: [f64; 3],
    pub(super) covariance: Option<[[f64; 6]; 6]>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ControlPointEntry {
    pub(super) name: String,
    pub(super) x_m: Option<f64>,
    pub(super) y_m: Option<f64>,
    pub(super) z_m: Option<f64>,
    pub(super) lat_deg: Option<f64>,
    pub(super) lon_deg: Option<f64>,
    pub(super) easting_m: Option<f64>,
    pub(super) northing_m: Option<f64>,
    pub(super) height_m: Option<f64>,
    #[serde(default)]
    pub(super) sigma_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct DistanceEntry {
    pub(super) a: String,
    pub(super) b: String,
    pub(super) distance_m: f64,
    pub(super) sigma_m: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct PlaneEntry {
    pub(super) points: Vec<String>,
    pub(super) sigma_m: Option<f64>,
    pub(super) z_m: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct UprightEntry {
    pub(super) foot: String,
    pub(super) top: String,
    pub(super) sigma_rad: Option<f64>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct QueryEntry {
    pub(super) kind: QueryKind,
    pub(super) points: Vec<String>,
    pub(super) name: Option<String>,
}

#[derive(Debug, Clone, Copy, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct BirdseyeEntry {
    pub(super) pixel_limit_m: Option<f64>,
    pub(super) error_limit_m: Option<f64>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A scene written for version 1.
    #[test]
    fn keys_of_version_1_are_read() {
        let text = [
            "clicks = \"points.csv\"",
            "[[mark]]",
            "name = \"A\"\nx_m = 1.0\ny_m = 2.0",
            "[[photo]]\nname = \"south\"\ncamera = \"camera.toml\"",
            "clicks = [{ point = \"A\", u_px = 1.0, v_px = 2.0 }]",
        ];
        let scene: SceneFile = toml::from_str(&text.join("\n")).expect("a scene");
        assert_eq!(scene.image_points, Some(PathBuf::from("points.csv")));
        assert_eq!((scene.control_point[0].name.as_str(), scene.photo[0].image_points[0].v_px), ("A", 2.0));
    }
}
