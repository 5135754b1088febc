//! Files of zones: TOML or JSON with polygons in pixels, or with the `coordinates` that recorders such as Frigate write.

use crate::core::camera::ImageSize;
use crate::input::{self, Kind};
use crate::{Error, FileError};
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Zones, and corners of one, that a file may have.
const MOST_ZONES: usize = 1000;
const MOST_CORNERS: usize = 10_000;
/// Digits of relative coordinates: a hundredth of a pixel of 1920.
const RELATIVE_DIGITS: usize = 5;

/// A polygon on an image.
#[derive(Debug, Clone, PartialEq)]
pub struct Zone {
    /// Its name.
    pub name: String,
    /// Its corners; pixel (0, 0) is the centre of the top-left pixel.
    pub polygon_px: Vec<[f64; 2]>,
    /// How its corners were written.
    notation: Notation,
}

/// How corners are written.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Notation {
    /// `polygon_px`.
    Pixels,
    /// `coordinates`, in parts of the image's width and height.
    Relative,
    /// `coordinates`, whole pixels.
    WholePixels,
}

/// The zones of one camera.
#[derive(Debug, Clone, PartialEq)]
pub struct ZonesFile {
    /// In file order.
    pub zones: Vec<Zone>,
    /// The size of the image that they are drawn on.
    pub size: ImageSize,
    /// Whether the size is stated in the file.
    is_sized: bool,
    is_json: bool,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Mirror {
    #[serde(skip_serializing_if = "Option::is_none")]
    width_px: Option<u32>,
    #[serde(skip_serializing_if = "Option::is_none")]
    height_px: Option<u32>,
    zone: Vec<MirrorZone>,
}

#[derive(Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct MirrorZone {
    name: String,
    #[serde(skip_serializing_if = "Option::is_none")]
    polygon_px: Option<Vec<[f64; 2]>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    coordinates: Option<String>,
}

/// Reads a file of zones. `size` is that of the camera's images, for a file that states none.
///
/// # Errors
/// What is wrong with the file, and in which zone; a size that is known from neither.
pub fn read_zones(path: impl AsRef<Path>, size: Option<ImageSize>) -> Result<ZonesFile, Error> {
    let path = path.as_ref();
    let text = input::read_text(path, Kind::Text)?;
    let is_json = text.trim_start().starts_with('{');
    let fault = |line: Option<usize>, reason: String| FileError { path: path.into(), line, reason };
    let file: Mirror = match is_json {
        true => serde_json::from_str(&text).map_err(|e| fault(Some(e.line()), e.to_string()))?,
        false => toml::from_str(&text).map_err(|e| {
            let (line, reason) = input::toml_reason(&text, &e);
            fault(line, reason)
        })?,
    };
    let stated = match (file.width_px, file.height_px) {
        (Some(width_px), Some(height_px)) if 0 < width_px && 0 < height_px => {
            Some(ImageSize { width_px, height_px })
        }
        (None, None) => None,
        _ => return Err(fault(None, "width_px and height_px must both be positive".into()).into()),
    };
    let Some(size) = stated.or(size) else {
        return Err(fault(
            None,
            "neither this file nor the camera's states an image size; add width_px and height_px".into(),
        )
        .into());
    };
    if file.zone.is_empty() || MOST_ZONES < file.zone.len() {
        return Err(fault(
            None,
            format!("has {} zones; 1 to {MOST_ZONES} are needed ([[zone]])", file.zone.len()),
        )
        .into());
    }
    let mut zones: Vec<Zone> = Vec::with_capacity(file.zone.len());
    for zone in file.zone {
        let of_zone = |reason: String| fault(None, format!("zone `{}`: {reason}", zone.name));
        if zones.iter().any(|other| other.name == zone.name) {
            return Err(of_zone("there are two of this name; names must differ".into()).into());
        }
        let (polygon_px, notation) = corners(&zone, size).map_err(of_zone)?;
        zones.push(Zone { name: zone.name.clone(), polygon_px, notation });
    }
    Ok(ZonesFile { zones, size, is_sized: stated.is_some(), is_json })
}

fn corners(zone: &MirrorZone, size: ImageSize) -> Result<(Vec<[f64; 2]>, Notation), String> {
    let (corners, notation) = match (&zone.polygon_px, &zone.coordinates) {
        (Some(polygon), None) => (polygon.clone(), Notation::Pixels),
        (None, Some(text)) => of_coordinates(text, size)?,
        _ => return Err("one of polygon_px and coordinates is needed".into()),
    };
    if corners.len() < 3 || MOST_CORNERS < corners.len() {
        return Err(format!("has {} corners; 3 to {MOST_CORNERS} are needed", corners.len()));
    }
    let [w, h] = [f64::from(size.width_px), f64::from(size.height_px)];
    // Recorders write the right edge as 1, or as the width.
    match corners.iter().find(|[u, v]| !((-1.0..=w + 1.0).contains(u) && (-1.0..=h + 1.0).contains(v))) {
        Some([u, v]) => Err(format!(
            "its corner ({u}, {v}) is outside the image of {w} × {h} px; state width_px and height_px if it was drawn on another size"
        )),
        None => Ok((corners, notation)),
    }
}

/// Reads `0.1,0.2,0.3,…`: x and y in turn, all from 0 to 1, or in pixels.
fn of_coordinates(text: &str, size: ImageSize) -> Result<(Vec<[f64; 2]>, Notation), String> {
    let numbers: Vec<f64> = text
        .split(',')
        .map(|part| {
            part.trim().parse().map_err(|_| format!("coordinates: `{}` is not a number", part.trim()))
        })
        .collect::<Result<_, String>>()?;
    if numbers.len() % 2 == 1 {
        return Err(format!(
            "coordinates are {} numbers; an x and a y for each corner are needed",
            numbers.len()
        ));
    }
    let pairs = numbers.chunks_exact(2);
    match numbers.iter().all(|x| (0.0..=1.0).contains(x)) {
        true => {
            let [w, h] = [f64::from(size.width_px), f64::from(size.height_px)];
            Ok((pairs.map(|p| [p[0] * w, p[1] * h]).collect(), Notation::Relative))
        }
        false => Ok((pairs.map(|p| [p[0], p[1]]).collect(), Notation::WholePixels)),
    }
}

impl Zone {
    /// Returns other corners as this zone's were written, where they were `coordinates`.
    pub(super) fn coordinates(&self, polygon_px: &[[f64; 2]], size: ImageSize) -> Option<String> {
        let [w, h] = [f64::from(size.width_px), f64::from(size.height_px)];
        let written = |[u, v]: &[f64; 2]| match self.notation {
            Notation::Pixels => None,
            Notation::Relative => {
                let [x, y] = [(u / w).clamp(0.0, 1.0), (v / h).clamp(0.0, 1.0)];
                Some(format!("{x:.RELATIVE_DIGITS$},{y:.RELATIVE_DIGITS$}"))
            }
            Notation::WholePixels => Some(format!("{:.0},{:.0}", u.clamp(0.0, w), v.clamp(0.0, h))),
        };
        Some(polygon_px.iter().map(written).collect::<Option<Vec<String>>>()?.join(","))
    }
}

impl ZonesFile {
    /// Writes other polygons in the format of this file, in the order of its zones.
    ///
    /// # Errors
    /// Text that TOML cannot hold.
    pub(super) fn with_polygons(&self, polygons: &[Vec<[f64; 2]>]) -> Result<String, Error> {
        let zone = |(zone, polygon): (&Zone, &Vec<[f64; 2]>)| {
            let coordinates = zone.coordinates(polygon, self.size);
            let polygon_px =
                coordinates.is_none().then(|| polygon.iter().map(|p| p.map(to_a_thousandth)).collect());
            MirrorZone { name: zone.name.clone(), polygon_px, coordinates }
        };
        let size = self.is_sized.then_some(self.size);
        let file = Mirror {
            width_px: size.map(|s| s.width_px),
            height_px: size.map(|s| s.height_px),
            zone: self.zones.iter().zip(polygons).map(zone).collect(),
        };
        let written = match self.is_json {
            true => serde_json::to_string_pretty(&file).map(|text| text + "\n").map_err(|e| e.to_string()),
            false => toml::to_string(&file).map_err(|e| e.to_string()),
        };
        written.map_err(Error::request)
    }
}

fn to_a_thousandth(x: f64) -> f64 {
    (1e3 * x).round() / 1e3
}
