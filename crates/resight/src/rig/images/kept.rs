//! Detections kept in a folder, so that images that were searched before are not searched again.
//!
//! What is found depends on the bytes of the image, the target, the detector and, where it is known, the lens. The name of an entry is a digest of all
//! of these: an entry is never out of date, and one that cannot be read is made again.

use super::{CornerWindow, Seen};
use crate::core::correspondence::{Detection, PixelCovariance};
use crate::core::target::Feature;
use crate::core::{Camera, Pixel, Target};
use crate::image::exif;
use crate::rig::digest::sha256;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// When the folder is larger, the entries that were written first are removed until it is half as large.
const MOST_BYTES: u64 = 64 << 20;

/// A folder in which detections are kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptDetections {
    folder: PathBuf,
    detector: String,
}

/// What is kept of an image.
#[derive(Serialize, Deserialize)]
struct Entry {
    width_px: u32,
    height_px: u32,
    /// For each target its detections, or why they are none.
    targets: Vec<Result<Vec<Row>, String>>,
}

/// Id, corner, u, v, sigma, sigma of the lens, covariance (uu, uv, vv).
#[derive(Serialize, Deserialize)]
struct Row(u32, u8, f64, f64, f64, f64, Option<[f64; 3]>);

impl KeptDetections {
    /// Keeps detections in a folder, which is created when it is needed. `detector` changes with the program: other versions find other corners.
    pub fn new(folder: impl Into<PathBuf>, detector: impl Into<String>) -> Self {
        KeptDetections { folder: folder.into(), detector: detector.into() }
    }

    /// Returns where the detections of an image are kept: `lens` is the camera, where the detectors use it.
    pub(super) fn place(
        &self,
        image: &[u8],
        targets: &[Target],
        lens: Option<&Camera>,
        window: CornerWindow,
    ) -> PathBuf {
        let question = format!("{}\n{targets:?}\n{lens:?}\n{window:?}\n{}", self.detector, sha256(image));
        self.folder.join(format!("{}.json", sha256(question.as_bytes())))
    }

    /// Removes the oldest entries where the folder is large. Another process may remove them at the same time.
    pub(super) fn tidy(&self) {
        let entry = |entry: std::fs::DirEntry| {
            let about = entry.metadata().ok()?;
            Some((about.modified().unwrap_or(SystemTime::UNIX_EPOCH), about.len(), entry.path()))
        };
        let all = std::fs::read_dir(&self.folder).into_iter().flatten().flatten();
        let mut all: Vec<_> = all.filter_map(entry).filter(|(_, _, path)| is_entry(path)).collect();
        let mut bytes: u64 = all.iter().map(|(_, bytes, _)| bytes).sum();
        if bytes <= MOST_BYTES {
            return;
        }
        all.sort();
        for (_, size, path) in all {
            if bytes <= MOST_BYTES / 2 {
                break;
            }
            let _ = std::fs::remove_file(path);
            bytes -= size;
        }
    }
}

fn is_entry(path: &Path) -> bool {
    let stem = path.file_stem().and_then(|stem| stem.to_str());
    path.extension().is_some_and(|ending| ending == "json")
        && stem.is_some_and(|stem| stem.len() == 64 && stem.bytes().all(|b| b.is_ascii_hexdigit()))
}

/// Reads what is kept of an image of these bytes for so many targets; `None` where nothing is.
pub(super) fn read(place: &Path, image: &[u8], n_targets: usize) -> Option<Seen> {
    let text = std::fs::read(place).ok()?;
    let entry: Entry = serde_json::from_slice(&text).ok()?;
    let detection = |Row(id, corner, u, v, sigma_px, lens_sigma_px, covariance): Row| Detection {
        feature: Feature { id, corner },
        pixel: Pixel::new(u, v),
        sigma_px,
        lens_sigma_px,
        covariance_px2: covariance.map(|[uu_px2, uv_px2, vv_px2]| PixelCovariance { uu_px2, uv_px2, vv_px2 }),
    };
    let found = |rows: Vec<Row>| rows.into_iter().map(detection).collect();
    (entry.targets.len() == n_targets).then(|| Seen {
        size_px: [entry.width_px, entry.height_px],
        orientation: exif::orientation(image),
        targets: entry.targets.into_iter().map(|target| target.map(found)).collect(),
    })
}

/// Keeps what was seen; where the folder cannot be written, nothing is kept. An entry that is cut off is no JSON, and made again.
pub(super) fn write(place: &Path, seen: &Seen) {
    let row = |d: &Detection| {
        let covariance = d.covariance_px2.map(|c| [c.uu_px2, c.uv_px2, c.vv_px2]);
        Row(d.feature.id, d.feature.corner, d.pixel.x, d.pixel.y, d.sigma_px, d.lens_sigma_px, covariance)
    };
    let rows = |found: &Vec<Detection>| found.iter().map(row).collect();
    let targets =
        seen.targets.iter().map(|target| target.as_ref().map(rows).map_err(String::clone)).collect();
    let entry = Entry { width_px: seen.size_px[0], height_px: seen.size_px[1], targets };
    if let (Some(folder), Ok(text)) = (place.parent(), serde_json::to_vec(&entry)) {
        let _ = std::fs::create_dir_all(folder).and_then(|()| std::fs::write(place, text));
    }
}
