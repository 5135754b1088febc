//! A row a point becomes a row a view: points of one camera, view and time that follow each other.

use crate::arrays::{names, numbers};
use crate::layout::{Layout, PointColumns};
use arrow_array::builder::{Float64Builder, ListBuilder, StringBuilder};
use arrow_array::{ArrayRef, RecordBatch};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef};
use std::sync::Arc;

/// Points of one view that are accepted; the next ones begin another.
const MOST_POINTS: usize = 100_000;

/// Views being put together.
#[derive(Default)]
pub struct Assembler {
    open: Option<View>,
    done: Vec<View>,
}

#[derive(Clone)]
struct View {
    camera: Option<String>,
    name: Option<String>,
    time_s: f64,
    /// Sum of the points' variances.
    variance: f64,
    pixels: Vec<f64>,
    points_m: Vec<f64>,
}

impl View {
    fn is_same(&self, camera: Option<&str>, name: Option<&str>, time_s: f64) -> bool {
        let is_same_time = self.time_s.to_bits() == time_s.to_bits();
        is_same_time
            && self.camera.as_deref() == camera
            && self.name.as_deref() == name
            && self.pixels.len() / 2 < MOST_POINTS
    }
}

impl Assembler {
    /// Takes in the next rows; those of a last view wait for more.
    pub fn push(&mut self, batch: &RecordBatch, layout: &Layout) {
        let PointColumns::Points { pixels, points_m } = &layout.points else { return };
        let (cameras, camera) = names(batch.column(layout.camera));
        let view = layout.view.map(|column| names(batch.column(column)));
        let time = layout.time.map(|column| numbers(batch.column(column)));
        let sigma = layout.sigma_px.map(|column| numbers(batch.column(column)));
        let pixels = pixels.map(|column| numbers(batch.column(column)));
        let points = points_m.map(|column| numbers(batch.column(column)));
        for row in 0..batch.num_rows() {
            let camera = cameras.get(camera[row] as usize).map(String::as_str);
            let name =
                view.as_ref().and_then(|(names, rows)| names.get(rows[row] as usize)).map(String::as_str);
            let time_s = time.as_ref().map_or(f64::NAN, |times| times[row]);
            let open = self.open_for(camera, name, time_s);
            open.variance += sigma.as_ref().map_or(f64::NAN, |sigmas| sigmas[row].powi(2));
            open.pixels.extend(pixels.iter().map(|column| column[row]));
            open.points_m.extend(points.iter().map(|column| column[row]));
        }
    }

    fn open_for(&mut self, camera: Option<&str>, name: Option<&str>, time_s: f64) -> &mut View {
        let is_same = self.open.as_ref().is_some_and(|open| open.is_same(camera, name, time_s));
        if !is_same {
            self.done.extend(self.open.take());
        }
        self.open.get_or_insert_with(|| View {
            camera: camera.map(str::to_owned),
            name: name.map(str::to_owned),
            time_s,
            variance: 0.0,
            pixels: Vec::new(),
            points_m: Vec::new(),
        })
    }

    /// Whole views that wait.
    pub fn waiting(&self) -> usize {
        self.done.len()
    }

    /// No more rows come.
    pub fn finish(&mut self) {
        self.done.extend(self.open.take());
    }

    /// The first `most` whole views, as rows of lists; `layout` is that of the points. Points of one view that state different sigmas
    /// count with the root of their mean square.
    ///
    /// # Errors
    /// The message of Arrow about columns that do not match.
    pub fn take(&mut self, most: usize, layout: &Layout) -> Result<(RecordBatch, Layout), ArrowError> {
        let views: Vec<View> = self.done.drain(..most.min(self.done.len())).collect();
        let (mut camera, mut view) = (StringBuilder::new(), StringBuilder::new());
        let (mut time, mut sigma) = (Float64Builder::new(), Float64Builder::new());
        let mut pixels = ListBuilder::new(Float64Builder::new());
        let mut points = ListBuilder::new(Float64Builder::new());
        for one in &views {
            camera.append_option(one.camera.as_deref());
            view.append_option(one.name.as_deref());
            time.append_option(Some(one.time_s).filter(|t| !t.is_nan()));
            sigma.append_value((one.variance / (one.pixels.len() / 2) as f64).sqrt());
            pixels.values().append_slice(&one.pixels);
            pixels.append(true);
            points.values().append_slice(&one.points_m);
            points.append(true);
        }
        let columns: Vec<ArrayRef> = vec![
            Arc::new(camera.finish()),
            Arc::new(time.finish()),
            Arc::new(view.finish()),
            Arc::new(sigma.finish()),
            Arc::new(pixels.finish()),
            Arc::new(points.finish()),
        ];
        Ok((RecordBatch::try_new(of_views(), columns)?, assembled(layout)))
    }
}

fn of_views() -> SchemaRef {
    let list = || DataType::List(Arc::new(Field::new_list_field(DataType::Float64, true)));
    Arc::new(Schema::new(vec![
        Field::new("camera", DataType::Utf8, true),
        Field::new("time_s", DataType::Float64, true),
        Field::new("view", DataType::Utf8, true),
        Field::new("sigma_px", DataType::Float64, true),
        Field::new("points_px", list(), true),
        Field::new("points_m", list(), true),
    ]))
}

/// The positions of the columns of whole views.
pub fn assembled(layout: &Layout) -> Layout {
    Layout {
        camera: 0,
        time: layout.time.map(|_| 1),
        view: layout.view.map(|_| 2),
        sigma_px: layout.sigma_px.map(|_| 3),
        points: PointColumns::Lists { pixels: 4, points_m: Some(5) },
    }
}
