//! A simulated day as files: cameras, views hour by hour in order of time, and the truth.

use super::{Fate, SimulatedFleet};
use crate::FleetError;
use arrow_array::types::Int32Type;
use arrow_array::{ArrayRef, DictionaryArray, Float64Array, Int32Array, RecordBatch, StringArray};
use arrow_schema::{DataType, Field, Schema, SchemaRef};
use parquet::arrow::ArrowWriter;
use parquet::basic::Compression;
use parquet::file::properties::WriterProperties;
use rayon::prelude::*;
use resight::core::statistics::random::{SplitMix64, mixed};
use resight::core::{Lens, Pixel};
use resight::formats::{stream_atomically, write_atomically};
use std::fmt::Write;
use std::io::BufWriter;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Length of a file of views, seconds.
const FILE_S: f64 = 3600.0;
/// Number of rows of a row group.
const GROUP: usize = 1 << 20;
/// Number of rows generated at a time.
const BATCH: usize = 65_536;

/// Writes `cameras.csv`, `truth.csv` and `views/NNN.parquet` into a folder. Returns the files of views.
///
/// # Errors
/// The error of the disk.
pub fn write_day(fleet: &SimulatedFleet, folder: &Path) -> Result<Vec<PathBuf>, FleetError> {
    let views = folder.join("views");
    std::fs::create_dir_all(&views).map_err(|e| FleetError::at(&views, e.to_string()))?;
    write_atomically(folder.join("cameras.csv"), cameras(fleet).as_bytes())?;
    write_atomically(folder.join("truth.csv"), truth(fleet).as_bytes())?;
    let day = &fleet.simulation;
    let (ticks, per_file) = (day.ticks(), ((FILE_S / day.every_s).round() as usize).max(1));
    let mut files = Vec::new();
    for (i, first) in (0..ticks).step_by(per_file).enumerate() {
        let path = views.join(format!("{i:03}.parquet"));
        write_views(fleet, first..ticks.min(first + per_file), &path)?;
        files.push(path);
    }
    Ok(files)
}

fn cameras(fleet: &SimulatedFleet) -> String {
    let points = (0..4).map(|k| format!("x{k}_m,y{k}_m,z{k}_m")).collect::<Vec<_>>().join(",");
    let mut text = format!(
        "camera,site,longitude_deg,latitude_deg,width_px,height_px,fx_px,fy_px,cx_px,cy_px,{points}\n"
    );
    for camera in &fleet.cameras {
        let Lens::Pinhole(model) = &camera.camera.lens else { continue };
        let (m, [east, north]) = (&model.matrix, camera.east_north);
        let _ = write!(text, "{},{},{east:.6},{north:.6},1920,1080", camera.name, camera.site);
        let _ = write!(text, ",{},{},{},{}", m.fx_px, m.fy_px, m.cx_px, m.cy_px);
        for x in &camera.map_points {
            let _ = write!(text, ",{},{},{}", x.x, x.y, x.z);
        }
        text.push('\n');
    }
    text
}

fn truth(fleet: &SimulatedFleet) -> String {
    let mut text = "camera,fate,at_s,rotation_deg,translation_m,offset_s\n".to_string();
    for camera in &fleet.cameras {
        let (at_s, rotation, shift, offset_s) = match camera.fate {
            Fate::Step { at_s, motion } | Fate::Drifting { at_s, motion } => {
                (at_s, motion.fixed_rows::<3>(0).norm().to_degrees(), motion.fixed_rows::<3>(3).norm(), 0.0)
            }
            Fate::Dead { at_s } => (at_s, 0.0, 0.0, 0.0),
            Fate::Clock { offset_s, from_s } => (from_s, 0.0, 0.0, offset_s),
            Fate::Steady | Fate::WrongMap => (0.0, 0.0, 0.0, 0.0),
        };
        let at_s = fleet.simulation.begin_s + at_s;
        let _ = writeln!(text, "{},{},{at_s},{rotation},{shift},{offset_s}", camera.name, camera.fate.name());
    }
    text
}

fn schema() -> SchemaRef {
    let dictionary = DataType::Dictionary(Box::new(DataType::Int32), Box::new(DataType::Utf8));
    let mut fields =
        vec![Field::new("camera", dictionary, true), Field::new("time_s", DataType::Float64, true)];
    for k in 0..4 {
        fields.push(Field::new(format!("u{k}_px"), DataType::Float64, true));
        fields.push(Field::new(format!("v{k}_px"), DataType::Float64, true));
    }
    Arc::new(Schema::new(fields))
}

type Row = (u32, f64, [Pixel; 4]);

fn write_views(fleet: &SimulatedFleet, ticks: std::ops::Range<usize>, path: &Path) -> Result<(), FleetError> {
    let names: ArrayRef = Arc::new(StringArray::from_iter_values(
        fleet.cameras.iter().map(|camera| camera.name.as_str()).chain(["cam-unheard-of"]),
    ));
    stream_atomically(path, |file| {
        let properties = WriterProperties::builder()
            .set_compression(Compression::SNAPPY)
            .set_dictionary_enabled(false)
            .set_column_dictionary_enabled("camera".into(), true)
            .set_max_row_group_row_count(Some(GROUP))
            .build();
        let mut writer = ArrowWriter::try_new(BufWriter::new(file), schema(), Some(properties))
            .map_err(std::io::Error::other)?;
        let at_once = (BATCH / fleet.cameras.len()).max(1);
        let ticks: Vec<usize> = ticks.collect();
        for some in ticks.chunks(at_once) {
            let rows: Vec<Row> = some.par_iter().flat_map_iter(|tick| rows_of(fleet, *tick)).collect();
            let batch = batch(&rows, &names).map_err(std::io::Error::other)?;
            writer.write(&batch).map_err(std::io::Error::other)?;
        }
        writer.close().map(|_| ()).map_err(std::io::Error::other)
    })?;
    Ok(())
}

/// Returns the rows of a time, with bad ones among them.
fn rows_of(fleet: &SimulatedFleet, tick: usize) -> Vec<Row> {
    let day = &fleet.simulation;
    let mut rng = SplitMix64::scattered(day.seed ^ mixed(!(tick as u64)));
    let row = |(number, camera): (usize, &super::SimulatedCamera)| {
        let (time_s, mut pixels) = camera.row(day, tick)?;
        let mut number = number as u32;
        if rng.uniform() < day.poison {
            match rng.below(3) {
                0 => pixels[rng.below(4)].x = f64::NAN,
                1 => pixels[rng.below(4)].y = 1e300,
                _ => number = fleet.cameras.len() as u32,
            }
        }
        Some((number, time_s, pixels))
    };
    fleet.cameras.iter().enumerate().filter_map(row).collect()
}

fn batch(rows: &[Row], names: &ArrayRef) -> Result<RecordBatch, arrow_schema::ArrowError> {
    let keys = Int32Array::from_iter_values(rows.iter().map(|(number, _, _)| *number as i32));
    let mut columns: Vec<ArrayRef> = vec![
        Arc::new(DictionaryArray::<Int32Type>::try_new(keys, names.clone())?),
        Arc::new(Float64Array::from_iter_values(rows.iter().map(|(_, time_s, _)| *time_s))),
    ];
    for k in 0..4 {
        columns.push(Arc::new(Float64Array::from_iter_values(rows.iter().map(|(_, _, pixels)| pixels[k].x))));
        columns.push(Arc::new(Float64Array::from_iter_values(rows.iter().map(|(_, _, pixels)| pixels[k].y))));
    }
    RecordBatch::try_new(schema(), columns)
}
