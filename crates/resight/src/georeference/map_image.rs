//! Coordinates of pixels of a map image: a GeoTIFF, or an image with a world file.
//!
//! Pixel (0, 0) is the centre of the top-left pixel, as everywhere; a world file has its coordinates there, and a GeoTIFF at the corner of that
//! pixel unless its raster is of points (GeoTIFF 1.1, section 7.1).

use super::columns::{checked, within_utm};
use super::earth::{Geographic, Utm};
use super::system::CoordinateSystem;
use super::tiff::TiffTags;
use crate::answer::SchemaNumber;
use crate::answer::georeference::MapPointAnswer;
use crate::input::table::Table;
use crate::input::{self, Kind};
use crate::measure::table::cell;
use crate::report::verdict::Status;
use crate::{Error, FileError};
use std::fs::File;
use std::path::{Path, PathBuf};

/// A degree of latitude, m: how large a pixel in degrees is.
const DEGREE_M: f64 = 111_320.0;
/// A pixel that is larger than this is no pixel of a map in degrees.
const LARGEST_PIXEL_DEG: f64 = 0.1;
/// Tags of a TIFF.
const IMAGE_WIDTH: u16 = 256;
const IMAGE_LENGTH: u16 = 257;
const MODEL_PIXEL_SCALE: u16 = 33550;
const MODEL_TIE_POINT: u16 = 33922;
const MODEL_TRANSFORMATION: u16 = 34264;
const GEO_KEY_DIRECTORY: u16 = 34735;
/// Keys of a GeoTIFF, and values of theirs.
const RASTER_TYPE: u16 = 1025;
const RASTER_OF_POINTS: u16 = 2;
const GEOGRAPHIC_TYPE: u16 = 2048;
const PROJECTED_TYPE: u16 = 3072;
const PROJECTED_UNITS: u16 = 3076;
const USER_DEFINED: u16 = 32767;
const METRE: u16 = 9001;

/// A map image: what a pixel's coordinates are.
#[derive(Debug, Clone, PartialEq)]
pub struct MapImage {
    /// Width and height.
    pub size_px: [u32; 2],
    /// x = a u + b v + c, y = d u + e v + f: x is easting or longitude, y northing or latitude.
    pub affine: [f64; 6],
    /// The system of x and y.
    pub system: CoordinateSystem,
}

/// Reads where a map image is: from its GeoTIFF tags, or from the world file beside it (`.tfw`, `.jgw`, `.pgw`, `.wld`), whose system is `stated`.
///
/// # Errors
/// An image without either; tags or numbers that are no map; units that are not metres or degrees; a system that contradicts the stated one.
pub fn read_map_image(
    path: impl AsRef<Path>,
    stated: Option<&CoordinateSystem>,
) -> Result<MapImage, FileError> {
    let path = path.as_ref();
    let tagged = match of_tiff(path)? {
        Some(tagged) => tagged,
        None => Tagged { size_px: size_of(path)?, ..Tagged::default() },
    };
    let fault = |reason: String| FileError::new(path, reason);
    let (affine, source) = match tagged.affine {
        Some(affine) => (affine, path.to_path_buf()),
        None => world_file(path)?,
    };
    let system = match (tagged.system, stated) {
        (Some(found), Some(stated)) if found != *stated => {
            return Err(fault(format!("the image is in {found}, but {stated} was stated; leave --crs out")));
        }
        (Some(found), _) => found,
        (None, Some(stated)) => stated.clone(),
        (None, None) => CoordinateSystem::Grid(None),
    };
    let map = MapImage { size_px: tagged.size_px, affine, system };
    map.check().map_err(|reason| FileError::new(source, reason))?;
    Ok(map)
}

impl MapImage {
    fn check(&self) -> Result<(), String> {
        let [a, b, _, d, e, _] = self.affine;
        let determinant = a * e - b * d;
        if self.affine.iter().any(|x| !x.is_finite()) || !(0.0 < determinant.abs()) {
            return Err("its numbers are no map: a pixel must be an area of the ground".into());
        }
        let (w, h) = (f64::from(self.size_px[0]), f64::from(self.size_px[1]));
        let corners = [[0.0, 0.0], [w - 1.0, h - 1.0]].map(|[u, v]| self.xy(u, v));
        match &self.system {
            CoordinateSystem::Geographic => corners
                .into_iter()
                .try_for_each(|[lon_deg, lat_deg]| checked(Geographic { lat_deg, lon_deg, height_m: 0.0 }).map(|_| ())),
            CoordinateSystem::Utm(_) => corners.into_iter().try_for_each(within_utm),
            CoordinateSystem::Grid(None)
                if determinant.abs().sqrt() < LARGEST_PIXEL_DEG
                    && corners.iter().flatten().all(|x| x.abs() <= 180.0) =>
            {
                Err("its coordinates look like degrees; state --crs EPSG:4326, or the system that they are in".into())
            }
            CoordinateSystem::Grid(_) => Ok(()),
        }
    }

    /// Returns x and y of a pixel: easting and northing, or longitude and latitude.
    pub fn xy(&self, u_px: f64, v_px: f64) -> [f64; 2] {
        let [a, b, c, d, e, f] = self.affine;
        [a * u_px + b * v_px + c, d * u_px + e * v_px + f]
    }

    /// Returns the root of a pixel's area on the ground, m.
    pub fn pixel_m(&self) -> f64 {
        let [a, b, _, d, e, f] = self.affine;
        let size = (a * e - b * d).abs().sqrt();
        match self.system {
            CoordinateSystem::Geographic => {
                size * DEGREE_M * f.to_radians().cos().max(0.0).sqrt() // A degree of longitude shrinks towards the poles.
            }
            _ => size,
        }
    }

    /// Returns the place on the Earth of a pixel; `None` in a grid whose place is unknown.
    fn geographic(&self, [x, y]: [f64; 2], utm: Option<&Utm>) -> Option<Geographic> {
        match self.system {
            CoordinateSystem::Geographic => Some(Geographic { lat_deg: y, lon_deg: x, height_m: 0.0 }),
            CoordinateSystem::Utm(_) => utm?.unproject([x, y], 0.0),
            CoordinateSystem::Grid(_) => None,
        }
    }

    /// Returns the answer for a pixel; `sigma_px` is that of each coordinate of the pixel.
    fn point(&self, id: String, [u, v]: [f64; 2], sigma_px: f64, utm: Option<&Utm>) -> MapPointAnswer {
        let [w, h] = self.size_px.map(f64::from);
        let is_inside = (-0.5..=w - 0.5).contains(&u) && (-0.5..=h - 0.5).contains(&v);
        let xy = self.xy(u, v);
        let place = self.geographic(xy, utm).filter(|_| is_inside);
        let is_projected = is_inside && self.system != CoordinateSystem::Geographic;
        let sigma_m = sigma_px * self.pixel_m();
        let message = match (is_inside, is_projected) {
            (false, _) => format!(
                "pixel ({u}, {v}) is outside the map image of {} × {} px; check the columns map_u_px and map_v_px",
                self.size_px[0], self.size_px[1]
            ),
            (_, true) => format!("easting {:.3} m, northing {:.3} m ({})", xy[0], xy[1], self.system),
            (_, false) => format!("latitude {:.8}°, longitude {:.8}°", xy[1], xy[0]),
        };
        MapPointAnswer {
            schema: SchemaNumber,
            kind: "map_point",
            status: if is_inside { Status::Ok } else { Status::Error },
            id,
            map_u_px: u,
            map_v_px: v,
            coordinate_system: self.system.clone(),
            lat_deg: place.map(|at| at.lat_deg),
            lon_deg: place.map(|at| at.lon_deg),
            easting_m: is_projected.then_some(xy[0]),
            northing_m: is_projected.then_some(xy[1]),
            sigma_m,
            message,
        }
    }
}

/// Pixels of a map image with their coordinates, and the table that `solve` reads.
#[derive(Debug, Clone, PartialEq)]
pub struct MapPoints {
    /// One answer for each row, in file order.
    pub answers: Vec<MapPointAnswer>,
    /// The rows with their coordinates, as CSV; rows outside the image are left out.
    pub csv: String,
    /// What the table lacks.
    pub remarks: Vec<String>,
}

/// Reads a table of pixels of a map image (columns `map_u_px, map_v_px`, optionally `id`, `map_sigma_px`) and gives each its coordinates. Other
/// columns are kept. `height_m` is the height of all points, where the table has no such column; `sigma_px` that of a pixel, where none is stated.
///
/// # Errors
/// A table without these columns, or that has coordinates already.
pub fn read_map_points(
    path: impl AsRef<Path>,
    map: &MapImage,
    height_m: Option<f64>,
    sigma_px: f64,
) -> Result<MapPoints, Error> {
    let path = path.as_ref();
    let table = Table::open(path, "map_u_px,map_v_px")?;
    let columns = [table.need("map_u_px", None)?, table.need("map_v_px", None)?];
    let (id, sigma, height) = (table.find("id"), table.find("map_sigma_px"), table.find("height_m"));
    let added = match map.system {
        CoordinateSystem::Geographic => ["lat_deg", "lon_deg"],
        _ => ["easting_m", "northing_m"],
    };
    if let Some(twice) = added.into_iter().find(|name| table.find(name).is_some()) {
        return Err(table
            .complaint(format!("column `{twice}` is there already; remove it, or solve this table as it is"))
            .into());
    }
    if height.is_some() && height_m.is_some() {
        return Err(table.complaint("column `height_m` is there already; leave --height-m out").into());
    }
    let has_sigma = table.find("sigma_m").is_some();
    let zone = match map.system {
        CoordinateSystem::Utm(zone) => Some(zone),
        _ => None,
    };
    let kept: Vec<usize> =
        (0..table.header().len()).filter(|i| !columns.contains(i) && Some(*i) != sigma).collect();
    let header = kept.iter().map(|i| cell(&table.header()[*i])).chain(added.map(String::from));
    let further = [(zone.is_some(), "zone"), (height_m.is_some(), "height_m"), (!has_sigma, "sigma_m")];
    let further = further.into_iter().filter(|(is_added, _)| *is_added).map(|(_, name)| name.to_string());
    let mut csv = header.chain(further).collect::<Vec<_>>().join(",") + "\n";
    let utm = zone.and_then(Utm::new);
    let mut answers = Vec::new();
    table.each(|cells| {
        let [u, v] = [cells.number(columns[0])?, cells.number(columns[1])?];
        let sigma_px = cells.optional_number(sigma)?.unwrap_or(sigma_px);
        let name = id.and_then(|i| cells.text(i)).map_or_else(|| answers.len().to_string(), str::to_string);
        let answer = map.point(name, [u, v], sigma_px, utm.as_ref());
        if answer.status == Status::Ok {
            let [x, y] = map.xy(u, v);
            let kept = kept.iter().map(|i| cell(cells.text(*i).unwrap_or_default()));
            let coordinates = match map.system {
                CoordinateSystem::Geographic => [format!("{y:.10}"), format!("{x:.10}")],
                _ => [format!("{x:.4}"), format!("{y:.4}")],
            };
            let further = [
                zone.map(|zone| zone.to_string()),
                height_m.map(|h| h.to_string()),
                (!has_sigma).then(|| format!("{:.4}", answer.sigma_m)),
            ];
            csv +=
                &(kept.chain(coordinates).chain(further.into_iter().flatten()).collect::<Vec<_>>().join(",")
                    + "\n");
        }
        answers.push(answer);
        Ok::<(), FileError>(())
    })?;
    let mut remarks = Vec::new();
    if height.is_none() && height_m.is_none() {
        remarks.push("a map has no heights: `solve` needs a column height_m, from --height-m where the ground is level".to_string());
    }
    if let CoordinateSystem::Grid(Some(name)) = &map.system {
        remarks.push(format!("of {name} only the name is known here: its coordinates are taken as metres, and latitudes are unknown"));
    }
    if map.system == CoordinateSystem::Grid(None) {
        remarks.push(
            "the system of the map is not stated: latitudes and longitudes are unknown; state it with --crs"
                .to_string(),
        );
    }
    Ok(MapPoints { answers, csv, remarks })
}

/// What the tags of a GeoTIFF state.
#[derive(Debug, Default)]
struct Tagged {
    size_px: [u32; 2],
    affine: Option<[f64; 6]>,
    system: Option<CoordinateSystem>,
}

/// Returns what the tags of a TIFF state; `None` for a file of another kind.
fn of_tiff(path: &Path) -> Result<Option<Tagged>, FileError> {
    let fault = |reason: String| FileError::new(path, reason);
    let damaged = |reason: std::io::Error| FileError::of_system(path, &reason);
    input::must_not_block(path)?;
    let Some(mut tags) = TiffTags::read(File::open(path).map_err(damaged)?).map_err(damaged)? else {
        return Ok(None);
    };
    let mut numbers = |tag: u16| tags.numbers(tag).map_err(damaged);
    let side = |found: Option<Vec<f64>>| {
        found.and_then(|list| list.first().copied()).map(|x| x as u32).filter(|x| 0 < *x)
    };
    let (width, height) = (side(numbers(IMAGE_WIDTH)?), side(numbers(IMAGE_LENGTH)?));
    let (width, height) = width.zip(height).ok_or_else(|| fault("is a TIFF without a size".into()))?;
    let scale = numbers(MODEL_PIXEL_SCALE)?;
    let tie = numbers(MODEL_TIE_POINT)?;
    let matrix = numbers(MODEL_TRANSFORMATION)?;
    let keys: Vec<u16> =
        numbers(GEO_KEY_DIRECTORY)?.unwrap_or_default().into_iter().map(|x| x as u16).collect();
    // Four numbers a key: its name, where its value is (0: here), how many, the value.
    let key = |name: u16| keys.chunks_exact(4).skip(1).find(|k| k[0] == name && k[1] == 0).map(|k| k[3]);
    let half = if key(RASTER_TYPE) == Some(RASTER_OF_POINTS) { 0.0 } else { 0.5 };
    let affine = match (matrix.as_deref(), scale.as_deref(), tie.as_deref()) {
        (Some(&[a, b, _, c, d, e, _, f, ..]), _, _) => Some([a, b, c, d, e, f]),
        (None, Some(&[sx, sy, ..]), Some(&[i, j, _, x, y, _])) => {
            Some([sx, 0.0, x - sx * i, 0.0, -sy, y + sy * j])
        }
        (None, None, None) => None,
        (None, _, Some(tie)) if 6 < tie.len() => {
            return Err(fault(format!(
                "it has {} tie points; one and a pixel scale, or a transformation, are needed: warp it first (gdalwarp)",
                tie.len() / 6
            )));
        }
        _ => {
            return Err(fault(
                "its GeoTIFF tags are incomplete: a tie point and a pixel scale are needed".into(),
            ));
        }
    };
    let affine = affine.map(|[a, b, c, d, e, f]| [a, b, c + half * (a + b), d, e, f + half * (d + e)]);
    let code = |name: u16| key(name).filter(|code| *code != USER_DEFINED && 0 < *code);
    if let Some(unit) = code(PROJECTED_UNITS).filter(|unit| *unit != METRE) {
        let unit = match unit {
            9002 => "feet".to_string(),
            9003 => "US survey feet".to_string(),
            other => format!("unit EPSG:{other}"),
        };
        return Err(fault(format!(
            "its coordinates are in {unit}; metres are needed: warp it first (gdalwarp -t_srs)"
        )));
    }
    let system =
        code(PROJECTED_TYPE).or(code(GEOGRAPHIC_TYPE)).map(|code| CoordinateSystem::of_epsg(code.into()));
    Ok(Some(Tagged { size_px: [width, height], affine, system }))
}

fn size_of(path: &Path) -> Result<[u32; 2], FileError> {
    let (width, height) = crate::image::size(path)?;
    Ok([width, height])
}

/// Returns the six numbers of the world file beside an image, and its path.
fn world_file(path: &Path) -> Result<([f64; 6], PathBuf), FileError> {
    let ending = path.extension().unwrap_or_default().to_string_lossy().into_owned();
    // The first and last letter of the image's ending and a w, or a w after the ending.
    let letters: Vec<char> = ending.chars().collect();
    let short = match letters.as_slice() {
        [first, .., last] => format!("{first}{last}w"),
        _ => "wld".to_string(),
    };
    let endings = [short, format!("{ending}w"), "wld".to_string()];
    let candidates =
        endings.iter().flat_map(|e| [e.to_lowercase(), e.to_uppercase()]).map(|e| path.with_extension(e));
    let Some(found) = candidates.into_iter().find(|file| file.is_file()) else {
        return Err(FileError::new(
            path,
            format!(
                "is no map: it has no GeoTIFF tags, and there is no world file {} beside it",
                path.with_extension(&endings[0]).display()
            ),
        ));
    };
    let text = input::read_text(&found, Kind::Text)?;
    let fault = |line: usize, reason: String| FileError::at_line(&found, line, reason);
    let mut numbers = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let number: f64 = line
            .trim()
            .replace(',', ".")
            .parse()
            .map_err(|_| fault(i + 1, format!("`{}` is not a number", shown(line))))?;
        numbers.push(number);
    }
    match numbers[..] {
        // A world file lists a, d, b, e, c, f.
        [a, d, b, e, c, f] => Ok(([a, b, c, d, e, f], found)),
        _ => {
            Err(fault(1, format!("a world file has six numbers, one a line; this one has {}", numbers.len())))
        }
    }
}

fn shown(line: &str) -> String {
    line.trim().chars().take(40).collect()
}
