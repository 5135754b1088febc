//! `georeference`: coordinates of pixels of a map image.

use crate::args::{OutputArgs, positive};
use crate::map::{finite, system};
use crate::output::{Outcome, Printer};
use anyhow::Result;
use clap::Args;
use resight::georeference::{CoordinateSystem, read_map_image, read_map_points};
use std::path::PathBuf;

/// Gives pixels of a map image their coordinates: an orthophoto beside a photograph becomes points for `solve`.
///
/// MAP is a GeoTIFF (tie point and pixel scale, or a transformation), or an image with a world file beside it (.tfw, .jgw, .pgw). POINTS.csv has
/// the columns map_u_px,map_v_px and optionally id and map_sigma_px; other columns, such as u_px,v_px of the same point in a photograph,
/// are kept. Pixel (0, 0) is the centre of the top-left pixel.
#[derive(Debug, Args)]
#[command(after_help = "Example: resight georeference ortho.tif pairs.csv --height-m 34 --points points.csv")]
pub struct Georeference {
    /// The map image: a GeoTIFF, or a TIFF, PNG or JPEG with a world file.
    #[arg(value_name = "MAP")]
    image: PathBuf,
    /// Pixels of the map image, CSV with a header line.
    #[arg(value_name = "POINTS.csv")]
    pixels: PathBuf,
    /// Writes the rows with their coordinates as a table that `solve` reads.
    #[arg(long, short, value_name = "FILE.csv")]
    points: Option<PathBuf>,
    /// Height of all points, where the table has no column height_m.
    #[arg(long, value_name = "M", allow_negative_numbers = true, value_parser = finite)]
    height_m: Option<f64>,
    /// System of a map that does not state it: EPSG:4326, EPSG:32633, or a UTM zone such as 33N.
    #[arg(long, value_name = "SYSTEM", value_parser = system)]
    crs: Option<CoordinateSystem>,
    /// Standard deviation of each coordinate of a pixel of the map.
    #[arg(long, value_name = "S", default_value = "1", allow_negative_numbers = true, value_parser = positive)]
    map_sigma_px: f64,
    #[command(flatten)]
    output: OutputArgs,
}

/// See `Georeference`.
pub fn run(args: &Georeference) -> Result<Outcome> {
    args.output.check()?;
    args.points.as_deref().map_or(Ok(()), crate::files::must_be_writable)?;
    crate::files::must_exist(&args.image)?;
    crate::files::must_exist(&args.pixels)?;
    let map = read_map_image(&args.image, args.crs.as_ref())?;
    let found = read_map_points(&args.pixels, &map, args.height_m, args.map_sigma_px)?;
    let mut printer = Printer::new(&args.output, found.answers.len());
    found
        .remarks
        .iter()
        .for_each(|text| printer.remark(&format!("warning: {}: {text}", args.image.display())));
    for answer in &found.answers {
        let words = format!(
            "{}   {}   {} ± {}\n",
            answer.id,
            answer.status.name().to_uppercase(),
            answer.message,
            resight::report::words::length(answer.sigma_m)
        );
        printer.result(answer, &words, answer.status)?;
    }
    if let Some(path) = &args.points {
        resight::formats::write_atomically(path, found.csv.as_bytes())?;
    }
    printer.finish()
}
