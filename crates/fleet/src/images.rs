//! Images of many cameras to poses, one row an image: what a worker of a cluster does with a table of images.

use crate::FleetError;
use crate::answers::Answers;
use crate::batch::SolvedRows;
use crate::cameras::Cameras;
use crate::columns::{Column, Columns};
use arrow_array::ArrayRef;
use resight::GrayImage;
use resight::core::Target;
use resight::locate::{ImageLocator, LocateOptions};
use std::borrow::Cow;
use std::collections::HashMap;
use std::path::PathBuf;

/// An image of a table.
#[derive(Debug, Clone)]
pub enum ImageCell<'a> {
    /// The bytes of a PNG or JPEG.
    Bytes(Cow<'a, [u8]>),
    /// Where a file lies, as the worker sees it.
    Path(PathBuf),
    /// There is none.
    Missing,
}

/// Images of many cameras, one a row.
#[derive(Debug, Clone)]
pub struct ImageRows<'a> {
    /// The different cameras' names.
    pub names: Vec<String>,
    /// Which of them each row has.
    pub camera: Vec<u32>,
    /// Seconds; NaN where there is none.
    pub time_s: Vec<f64>,
    /// Names of the views, where there are some.
    pub view: Option<ArrayRef>,
    /// The images.
    pub images: Vec<ImageCell<'a>>,
}

impl<'a> ImageRows<'a> {
    /// Of a table with a column `camera`, and `time_s` and `view` where it has them, and its images.
    ///
    /// # Errors
    /// `Columns` where there is no column `camera`, or as many rows as images.
    pub fn of(columns: &Columns, images: Vec<ImageCell<'a>>) -> Result<Self, FleetError> {
        let find = |name: &str| columns.names.iter().position(|known| known == name);
        let Some(Column::Names { names, rows }) = find("camera").map(|i| &columns.columns[i]) else {
            let there = columns.names.join(", ");
            let reason = format!("no column `camera` (the camera's name); the columns are {there}");
            return Err(FleetError::Columns(reason));
        };
        if images.len() != columns.rows {
            let reason = format!("{} images in {} rows; one a row is needed", images.len(), columns.rows);
            return Err(FleetError::Columns(reason));
        }
        let time = find("time_s").map(|i| columns.columns[i].numbers().to_vec());
        Ok(ImageRows {
            names: names.clone(),
            camera: rows.to_vec(),
            time_s: time.unwrap_or_else(|| vec![f64::NAN; images.len()]),
            view: find("view").map(|i| columns.columns[i].array(images.len())),
            images,
        })
    }
}

/// Detects the target in each image and solves its pose. What is wrong with an image is its status, with a reason.
pub fn locate_rows(rows: ImageRows, cameras: &Cameras, target: &Target) -> SolvedRows {
    let mut answers = Answers::new(rows.images.len());
    let options = LocateOptions::default();
    let mut locators: HashMap<u32, Result<ImageLocator, String>> = HashMap::new();
    for (row, image) in rows.images.iter().enumerate() {
        let name = rows.camera.get(row).and_then(|name| rows.names.get(*name as usize));
        let Some(number) = name.and_then(|name| cameras.number(name)) else {
            answers.fail(row, UNKNOWN_CAMERA.into());
            continue;
        };
        let camera = &cameras.cameras()[number as usize];
        let locator = locators
            .entry(number)
            .or_insert_with(|| ImageLocator::new(camera, target, &options).map_err(|reason| reason.to_string()));
        match (locator, read(image)) {
            (Ok(locator), Ok(image)) => answers.take(row, &locator.locate(&image, String::new()).answer),
            (Err(reason), _) => answers.fail(row, reason.clone()),
            (_, Err(reason)) => answers.fail(row, reason),
        }
    }
    let ImageRows { names, camera, time_s, view, .. } = rows;
    SolvedRows { names, camera, time_s, view, answers }
}

const UNKNOWN_CAMERA: &str = "the camera of this image is not among the cameras; add it to the table";

fn read(image: &ImageCell) -> Result<GrayImage, String> {
    match image {
        ImageCell::Bytes(bytes) => GrayImage::decode(bytes).map_err(|reason| format!("the image {reason}")),
        ImageCell::Path(path) => GrayImage::read(path).map_err(|reason| reason.to_string()),
        ImageCell::Missing => Err("there is no image in this row".into()),
    }
}
