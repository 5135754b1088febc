//! KWIVER's `.krtd`: K, R, t and distortion as bare numbers, one camera a file; read only.
//!
//! `camera_perspective.cxx`: x_cam = R x_world + t, pixel = K · distorted point; camera axes x right, y down, z forward. Distortion is in
//! OpenCV's order k1 k2 p1 p2 k3 k4 k5 k6 (`camera_intrinsics.cxx`); one zero stands for none. No size of the image, no unit. Pixel (0, 0) is
//! taken as the centre of the first pixel, as VXL counts.

use super::document::{Document, Fault, Node, Syntax, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::Pose;
use nalgebra::{Matrix3, Vector3};

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::Krtd,
    words: &[],
    reads: Some(Reads {
        recognises: |document| document.syntax == Syntax::Lines && is_krtd(&document.text),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "R and t map the world into the camera (x_cam = R x_world + t); its position is -Rᵀ t.",
        "The file states neither the size of its image nor the unit of its world.",
    ],
};

const ROWS: usize = 7;

/// Seven rows of three numbers, of which the first three are a camera matrix, and one row of distortion at most: no table of points is so.
pub(super) fn is_krtd(text: &str) -> bool {
    let Some(rows) = rows(text) else { return false };
    let k = |i: usize, j: usize| rows[i].1.get(j).copied().unwrap_or(f64::NAN);
    (ROWS..=ROWS + 1).contains(&rows.len())
        && rows[..ROWS].iter().all(|(_, row)| row.len() == 3)
        && [k(1, 0), k(2, 0), k(2, 1), k(2, 2) - 1.0].iter().all(|x| *x == 0.0)
        && 0.0 < k(0, 0)
}

/// Lines of numbers with their place; none as soon as anything else is there.
fn rows(text: &str) -> Option<Vec<(usize, Vec<f64>)>> {
    let mut rows = Vec::new();
    for (i, line) in text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        if ROWS < rows.len() {
            return None;
        }
        rows.push((i + 1, line.split_whitespace().map(|w| w.parse().ok()).collect::<Option<Vec<f64>>>()?));
    }
    Some(rows)
}

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let rows = rows(&document.text).unwrap_or_default();
    let nodes: Vec<Node> = rows.iter().map(|(line, _)| Node { line: *line, value: Value::Null }).collect();
    let at = |i: usize, name: &str| Entry::called(name, &nodes[i]);
    if let Some(bad) = rows.iter().find(|(_, row)| row.iter().any(|x| !x.is_finite())) {
        return Err(Fault::at(bad.0, "holds a number that is not finite (a failed calibration?)"));
    }
    let matrix = |from: usize| Matrix3::from_fn(|i, j| rows[from + i].1[j]);
    let k = checks::without_skew(&at(0, "K"), &matrix(0))?;
    let r = checks::rotation(&at(3, "R"), &matrix(3))?;
    let t = Vector3::from_row_slice(&rows[6].1);
    let lens = match rows.get(ROWS) {
        None => LensNumbers::Pinhole,
        Some((_, d)) => lens_numbers(&at(ROWS, "distortion"), d)?,
    };
    let camera = lens::camera(&at(0, "K"), &lens, k, None, &mut contents.warnings)?;
    let name = document.stem();
    let b_from_a = Pose::new(r, t);
    let placement = Some(Placement { b: name.clone(), a: "world".into(), b_from_a, covariance: None });
    contents.cameras.push(NamedCamera::new(name, camera, placement));
    contents.warnings.push("the file states no image size".into());
    Ok(contents)
}

/// KWIVER uses coefficients in steps: 1, 2, 4, 5 or 8 of them.
fn lens_numbers(at: &Entry<'_>, d: &[f64]) -> Result<LensNumbers, Fault> {
    let mut d = d.to_vec();
    match d.len() {
        1 | 2 => d.resize(4, 0.0),
        4 | 5 | 8 => {}
        n => return Err(at.fault(format!("holds {n} coefficients; KWIVER's model takes 1, 2, 4, 5 or 8"))),
    }
    opencv::brown_conrady(at, d)
}
