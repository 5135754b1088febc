//! Points on the Earth: their coordinate system, and answers as features of a map.

use crate::args::positive;
use anyhow::Result;
use clap::Args;
use resight::formats::write_atomically;
use resight::georeference::features::on_earth;
use resight::georeference::{CoordinateSystem, Features, Ground};
use resight::points::PointsTable;
use std::path::PathBuf;

/// The flags, for every command that solves from points on the Earth.
#[derive(Debug, Clone, Args)]
pub struct MapArgs {
    /// System of easting_m and northing_m where the file has no column zone: EPSG:32633, or a UTM zone such as 33N.
    ///
    /// With UTM zones (WGS 84, or ETRS89, which is within a metre of it) and with lat_deg, lon_deg the answer has latitude, longitude and
    /// true north. Of another grid only the name is known: the answer is in easting and northing, and north is that of the grid.
    #[arg(long, hide_short_help = true, help_heading = "Map", value_name = "SYSTEM", value_parser = system)]
    pub crs: Option<CoordinateSystem>,
    /// Writes cameras, points and the ground that each image shows as GeoJSON.
    #[arg(long, hide_short_help = true, help_heading = "Map", value_name = "FILE")]
    geojson: Option<PathBuf>,
    /// Writes the same as KML, for Google Earth.
    #[arg(long, hide_short_help = true, help_heading = "Map", value_name = "FILE")]
    kml: Option<PathBuf>,
    /// Height of the ground that an image shows [default: the mean height of the view's points].
    #[arg(long, hide_short_help = true, help_heading = "Map", value_name = "M", allow_negative_numbers = true, value_parser = finite)]
    ground_height_m: Option<f64>,
    /// How far from the camera the ground that an image shows reaches at most [default: 1000, or ten times the camera's height].
    ///
    /// Ground farther away is left out: towards the horizon a pixel is hundreds of metres.
    #[arg(long, hide_short_help = true, help_heading = "Map", value_name = "M", allow_negative_numbers = true, value_parser = positive)]
    ground_limit_m: Option<f64>,
}

/// A coordinate system by its name.
pub fn system(text: &str) -> Result<CoordinateSystem, String> {
    text.parse()
}

/// Any number.
pub fn finite(text: &str) -> Result<f64, String> {
    text.parse::<f64>().ok().filter(|x| x.is_finite()).ok_or_else(|| "a number is needed".to_string())
}

impl MapArgs {
    /// Whether features are to be written.
    pub fn is_wanted(&self) -> bool {
        self.geojson.is_some() || self.kml.is_some()
    }

    /// The ground of the footprints.
    pub fn ground(&self) -> Ground {
        Ground { height_m: self.ground_height_m, limit_m: self.ground_limit_m }
    }

    /// Refuses what could not be written, before any work is done.
    pub fn check(&self, table: &PointsTable) -> Result<()> {
        if self.is_wanted() {
            on_earth(table.frame.as_ref())?;
        }
        self.geojson.iter().chain(&self.kml).try_for_each(|path| crate::files::must_be_writable(path))
    }

    /// Writes the files, and passes on what has no feature.
    pub fn write(&self, features: &Features) -> Result<()> {
        features.remarks.iter().for_each(|text| crate::output::remark(&format!("warning: {text}")));
        if let Some(path) = &self.geojson {
            write_atomically(path, features.geojson().as_bytes())?;
        }
        if let Some(path) = &self.kml {
            write_atomically(path, features.kml().as_bytes())?;
        }
        Ok(())
    }
}
