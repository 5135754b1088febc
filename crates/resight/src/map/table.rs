//! Corners of tags that were already found: rows in memory or of a CSV file.

use super::{MapRequest, Observed, TagView};
use crate::core::Pixel;
use crate::core::correspondence::Detection;
use crate::core::target::Feature;
use crate::error::Error;
use crate::input::table::{Table, TableRow};
use std::collections::BTreeMap;
use std::path::Path;

/// Squares of larger numbers, and their products, overflow.
const LARGEST: f64 = 1e60;

/// A corner of a tag in a view.
#[derive(Debug, Clone, PartialEq)]
pub struct TagRow {
    /// Name of the view; views are in the order of their first rows.
    pub view: String,
    /// Id of the tag. Where a view shows an id twice, the first rows of each corner are one tag, the second rows another.
    pub id: u32,
    /// 0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the upright tag.
    pub corner: u8,
    /// `[u, v]`, pixels.
    pub image_px: [f64; 2],
    /// Standard deviation of each coordinate, pixels; by default that of the request.
    pub sigma_px: Option<f64>,
    /// Line of the file, or the number of the row counted from 1.
    pub line: u64,
}

/// Reads a CSV file with the columns view,id,corner,u_px,v_px and optionally sigma_px.
///
/// # Errors
/// A missing column, a cell that is no number, an id or corner that cannot be.
pub fn read_tag_rows(path: &Path) -> Result<Vec<TagRow>, Error> {
    let table = Table::open(path, "view,id,corner,u_px,v_px")?;
    let view = table.need("view", Some("which image each row belongs to"))?;
    let id = table.need("id", Some("the id of the tag"))?;
    let corner =
        table.need("corner", Some("0 top-left, 1 top-right, 2 bottom-right, 3 bottom-left of the tag"))?;
    let (u, v) = (table.need("u_px", None)?, table.need("v_px", None)?);
    let sigma = table.find("sigma_px");
    let mut rows = Vec::new();
    table.each(|cells: TableRow<'_>| -> Result<(), Error> {
        let whole = |column: usize, most: f64, needed: &str| {
            let x = cells.number(column)?;
            match x.fract() == 0.0 && (0.0..=most).contains(&x) {
                true => Ok(x),
                false => Err(cells.complaint(column, &format!("is {x}; {needed}"))),
            }
        };
        let Some(name) = cells.text(view) else {
            return Err(cells.complaint(view, "is empty; name the view").into());
        };
        rows.push(TagRow {
            view: name.to_string(),
            id: whole(id, f64::from(u32::MAX), "an id is a whole number")? as u32,
            corner: whole(corner, 3.0, "a corner is 0, 1, 2 or 3")? as u8,
            image_px: [cells.number(u)?, cells.number(v)?],
            sigma_px: cells.optional_number(sigma)?,
            line: cells.line,
        });
        Ok(())
    })?;
    Ok(rows)
}

/// Collects rows into views.
pub(super) fn of_rows(rows: &[TagRow], request: &MapRequest) -> Result<Observed, Error> {
    let mut views: Vec<TagView> = Vec::new();
    let mut index: BTreeMap<&str, usize> = BTreeMap::new();
    for row in rows {
        let detection = detection(row, request.sigma_px)?;
        let at = *index.entry(&row.view).or_insert(views.len());
        if at == views.len() {
            views.push(TagView { name: row.view.clone(), tags: Vec::new() });
        }
        let tags = &mut views[at].tags;
        let has = |tag: &(u32, Vec<Detection>), corner: u8| tag.1.iter().any(|d| d.feature.corner == corner);
        let is_repeated = |d: &Detection| d.feature == detection.feature && d.pixel == detection.pixel;
        if tags.iter().any(|tag| tag.1.iter().any(is_repeated)) {
            continue;
        }
        match tags.iter_mut().find(|tag| tag.0 == row.id && !has(tag, row.corner)) {
            Some(tag) => tag.1.push(detection),
            None => tags.push((row.id, vec![detection])),
        }
    }
    Ok(Observed {
        camera: request.camera.clone(),
        n_images: views.len(),
        views,
        left_out: Vec::new(),
        remarks: Vec::new(),
    })
}

fn detection(row: &TagRow, sigma_px: f64) -> Result<Detection, Error> {
    let sigma_px = row.sigma_px.unwrap_or(sigma_px);
    let [u, v] = row.image_px;
    let refused = |column: &str, x: f64, needed: &str| {
        Err(Error::request(format!("line {}: {column} is {x:e}; {needed}", row.line)))
    };
    for (column, x) in [("u_px", u), ("v_px", v)] {
        if !x.is_finite() || LARGEST < x.abs() {
            return refused(column, x, "correct it or remove the row");
        }
    }
    if !(0.0 < sigma_px && sigma_px <= LARGEST) {
        return refused("sigma_px", sigma_px, "it must be positive");
    }
    if 3 < row.corner {
        return refused("corner", f64::from(row.corner), "a corner is 0, 1, 2 or 3");
    }
    Ok(Detection {
        feature: Feature { id: row.id, corner: row.corner },
        pixel: Pixel::new(u, v),
        sigma_px,
        lens_sigma_px: 0.0,
        covariance_px2: None,
    })
}
