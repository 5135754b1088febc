//! Cameras as text that machines hand to each other: every lens as the own camera file, every number to the last bit.

use super::{Cameras, FleetCamera, Site};
use crate::FleetError;
use resight::core::camera::ImageSize;
use resight::core::{Camera, Point};
use resight::formats::{NamedCamera, own_file, read_cameras_from_bytes};
use serde::{Deserialize, Serialize};
use std::path::Path;

#[derive(Serialize, Deserialize)]
struct Text {
    cameras_toml: String,
    cameras: Vec<Row>,
}

#[derive(Serialize, Deserialize)]
struct Row {
    name: String,
    /// Own camera files state a size, cameras of fleets need none: a stand-in is written, and this is what there is.
    size_px: Option<[u32; 2]>,
    points_m: Option<Vec<[f64; 3]>>,
    site: Option<(String, Option<[f64; 2]>)>,
}

impl Cameras {
    /// As text, for other machines.
    ///
    /// # Errors
    /// `Setting` for a lens that has no file.
    pub fn to_text(&self) -> Result<String, FleetError> {
        let named = self.names.iter().zip(&self.cameras).map(|(name, camera)| NamedCamera {
            name: name.clone(),
            camera: Camera { size: camera.size.or_else(|| stand_in(camera)), ..camera.clone() },
            placement: None,
            intrinsics_covariance: None,
        });
        let cameras_toml = own_file(&named.collect::<Vec<_>>()).map_err(setting)?;
        let row = |(number, name): (usize, &String)| Row {
            name: name.clone(),
            size_px: self.cameras[number].size.map(|size| [size.width_px, size.height_px]),
            points_m: self.points[number].as_ref().map(|points| points.iter().map(|p| (*p).into()).collect()),
            site: self.sites[number].as_ref().map(|site| (site.name.clone(), site.east_north)),
        };
        let cameras = self.names.iter().enumerate().map(row).collect();
        serde_json::to_string(&Text { cameras_toml, cameras }).map_err(setting)
    }

    /// The cameras of `to_text`.
    ///
    /// # Errors
    /// `Setting` for another text.
    pub fn of_text(text: &str) -> Result<Self, FleetError> {
        let Text { cameras_toml, cameras } = serde_json::from_str(text).map_err(setting)?;
        let lenses = read_cameras_from_bytes(Path::new("cameras"), cameras_toml.into_bytes())?.cameras;
        if lenses.len() != cameras.len() {
            let reason = format!("{} lenses of {} cameras; a lens for each is needed", lenses.len(), cameras.len());
            return Err(FleetError::Setting(reason));
        }
        let camera = |(row, lens): (Row, NamedCamera)| FleetCamera {
            name: row.name,
            camera: Camera { size: row.size_px.map(size), ..lens.camera },
            points: row.points_m.map(|points| points.into_iter().map(Point::from).collect()),
            site: row.site.map(|(name, east_north)| Site { name, east_north }),
        };
        Cameras::of(cameras.into_iter().zip(lenses).map(camera).collect())
    }
}

fn size([width_px, height_px]: [u32; 2]) -> ImageSize {
    ImageSize { width_px, height_px }
}

/// With the principal point in its middle.
fn stand_in(camera: &Camera) -> Option<ImageSize> {
    let side = |middle: f64| (2.0 * middle.abs() + 1.0).clamp(1.0, 1e6) as u32;
    camera.matrix().map(|k| size([side(k.cx_px), side(k.cy_px)]))
}

fn setting(reason: impl std::fmt::Display) -> FleetError {
    FleetError::Setting(reason.to_string())
}
