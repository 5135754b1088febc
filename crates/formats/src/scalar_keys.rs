//! A camera with a key for each number: `fx`, `fy`, `cx`, `cy`, `k1` …; read only. Which pixel is (0, 0) such a file does not say; it is read as
//! OpenCV's. Formats that have such keys behind a prefix use the functions below.

use super::document::{Document, Fault, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::{CameraFormat, Contents, Format, NamedCamera, Reads, opencv};
use crate::core::Camera;
use crate::core::camera::{CameraMatrix, ImageSize};

/// `fx`, `fy`, `cx`, `cy` and the coefficients, each under its own key.
pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::PlainKeys,
    words: &[],
    reads: Some(Reads {
        recognises: |document| ["fx", "fy", "cx", "cy"].iter().all(|key| has_number(&document.entry(), key)),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "The file does not say whether pixel (0, 0) is the centre of the first pixel (as OpenCV has it, taken here) or its corner; that moves \
        cx and cy by 0.5 px.",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let (root, mut contents) = (document.entry(), Contents::default());
    let size = opencv::image_size(&root)?;
    let camera = one(&root, &root, "", opencv::is_fisheye(&root)?, size, &mut contents)?;
    contents.cameras.push(NamedCamera::new(document.stem(), camera, None));
    Ok(contents)
}

/// Whether a key is there and its value a number.
pub(super) fn has_number(entry: &Entry<'_>, key: &str) -> bool {
    entry.get(key).is_some_and(|found| matches!(found.node.value, Value::Number(_)))
}

/// The number of a key that may be missing.
pub(super) fn number_of(entry: &Entry<'_>, key: &str) -> Result<Option<f64>, Fault> {
    entry.get(key).map(|found| found.number()).transpose()
}

/// OpenCV's coefficients k1 k2 p1 p2 [k3 [k4 k5 k6]] behind a prefix; those that are not there are zero.
pub(super) fn brown_conrady(at: &Entry<'_>, prefix: &str) -> Result<LensNumbers, Fault> {
    const KEYS: [&str; 8] = ["k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"];
    let mut d = Vec::new();
    for key in KEYS {
        d.push(number_of(at, &format!("{prefix}{key}"))?.unwrap_or(0.0));
    }
    let used = d.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
    d.truncate([0, 4, 5, 8].into_iter().find(|n| used <= *n).unwrap_or(8));
    opencv::brown_conrady(at, d)
}

/// Kannala–Brandt's four coefficients under these keys.
pub(super) fn fisheye(at: &Entry<'_>, keys: [&str; 4]) -> Result<LensNumbers, Fault> {
    let mut k = [0.0; 4];
    for (value, key) in k.iter_mut().zip(keys) {
        *value = number_of(at, key)?.unwrap_or(0.0);
    }
    Ok(LensNumbers::KannalaBrandt(k))
}

/// fx, fy, cx, cy under these keys.
pub(super) fn matrix(at: &Entry<'_>, keys: [&str; 4]) -> Result<CameraMatrix, Fault> {
    let [fx_px, fy_px, cx_px, cy_px] = keys.map(|key| at.need(key)?.number());
    Ok(CameraMatrix { fx_px: fx_px?, fy_px: fy_px?, cx_px: cx_px?, cy_px: cy_px? })
}

/// A camera whose keys `fx` … `k1` … stand behind a prefix.
pub(super) fn one(
    blamed: &Entry<'_>,
    at: &Entry<'_>,
    prefix: &str,
    is_fisheye: bool,
    size: Option<ImageSize>,
    contents: &mut Contents,
) -> Result<Camera, Fault> {
    let key = |name: &str| format!("{prefix}{name}");
    let k = ["fx", "fy", "cx", "cy"].map(key);
    let lens = match is_fisheye {
        true => {
            let k = ["k1", "k2", "k3", "k4"].map(key);
            fisheye(at, [&k[0], &k[1], &k[2], &k[3]])?
        }
        false => brown_conrady(at, prefix)?,
    };
    lens::camera(blamed, &lens, matrix(at, [&k[0], &k[1], &k[2], &k[3]])?, size, &mut contents.warnings)
}
