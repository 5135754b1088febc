//! Advice for a target over a volume: how uncertain and how often ambiguous its poses are, and which change helps.

use super::maps::TargetMaps;
use crate::Error;
use crate::answer::advise::{OutlookObject, TargetAdvice, TargetChange, VolumeOutlook};
use crate::answer::{SchemaNumber, Status};
use crate::core::advise::Optics;
use crate::core::advise::change::{Tried, cost, tried};
use crate::core::advise::volume::{Outlook, Shape, Volume, outlook, poses};
use crate::core::{Camera, Target};

/// Views tried over the whole volume, over each of its parts, and for each change.
const VIEWS: usize = 1500;
const VIEWS_OF_PART: usize = 400;
const VIEWS_OF_CHANGE: usize = 600;
/// Number of parts of the ranges of distance and tilt.
const PARTS: usize = 3;

/// A question about a target.
#[derive(Debug, Clone, Copy)]
pub struct TargetRequest<'a> {
    /// The camera.
    pub camera: &'a Camera,
    /// Covariance of its intrinsics, row by row, in the order of `Camera::parameters`; none: exact.
    pub intrinsics_covariance: Option<&'a [f64]>,
    /// The target.
    pub target: &'a Target,
    /// Standard deviation of u and v, pixels.
    pub sigma_px: f64,
    /// The volume in which the camera may be.
    pub volume: Volume,
    /// Whether to draw maps, which takes seconds.
    pub pictures: bool,
}

/// Computes how well a target is observed over a volume and its parts, and which change of it helps.
///
/// # Errors
/// A camera without an image size.
pub fn advise_target(request: &TargetRequest) -> Result<TargetAdvice, Error> {
    super::must_have_image(request.camera)?;
    let TargetRequest { camera, target, sigma_px, volume, pictures, intrinsics_covariance } = *request;
    let optics = Optics { camera, sigma_px, intrinsics_covariance };
    let shape = Shape::of(target);
    let over = |volume: &Volume, n| outlook(&shape, &optics, &poses(&shape, camera, volume, n));
    let whole = over(&volume, VIEWS);
    let parts = parts(&volume).into_iter().map(|part| row(&part, &over(&part, VIEWS_OF_PART)));
    let all = tried(target, &optics, &volume, VIEWS_OF_CHANGE);
    let changes = all.into_iter().enumerate().map(|(i, tried)| change(i + 1, tried, &whole)).collect();
    let maps = TargetMaps { shape: &shape, optics, volume };
    Ok(TargetAdvice {
        target: (target.kind(), shape.points.len()),
        outlooks: std::iter::once(row(&volume, &whole)).chain(parts).collect(),
        changes,
        pictures: match pictures {
            false => Vec::new(),
            true => super::drawn([
                ("target-image.png".to_owned(), maps.over_image()),
                ("around-x.png".to_owned(), Some(maps.around(true))),
                ("around-y.png".to_owned(), Some(maps.around(false))),
            ]),
        },
    })
}

fn status(o: &Outlook) -> Status {
    if o.position_m.is_some() { Status::Ok } else { Status::Degenerate }
}

fn row(volume: &Volume, o: &Outlook) -> VolumeOutlook {
    VolumeOutlook {
        schema: SchemaNumber,
        kind: "outlook",
        status: status(o),
        distance_m: volume.distance_m,
        tilt_rad: volume.tilt_rad,
        outlook: o.into(),
    }
}

fn change(rank: usize, tried: Tried, now: &Outlook) -> TargetChange {
    let Tried { change, outlook } = tried;
    TargetChange {
        schema: SchemaNumber,
        kind: "change",
        status: status(&outlook),
        rank,
        key: change.key,
        from: change.from,
        to: change.to,
        enlarges_target: change.enlarges_target,
        cost_ratio: cost(&outlook) / cost(now),
        outlook: OutlookObject::from(&outlook),
        change,
    }
}

/// Divides the volume by distance and by tilt.
fn parts(volume: &Volume) -> Vec<Volume> {
    let part = |[a, b]: [f64; 2], i: usize| {
        let at = |k: usize| a + (b - a) * k as f64 / PARTS as f64;
        [at(i), at(i + 1)]
    };
    let count = |[a, b]: [f64; 2]| if a < b { PARTS } else { 1 };
    let (n, m) = (count(volume.distance_m), count(volume.tilt_rad));
    let cell = |(i, j)| Volume {
        distance_m: part(volume.distance_m, i),
        tilt_rad: part(volume.tilt_rad, j),
        ..*volume
    };
    (0..n).flat_map(|i| (0..m).map(move |j| (i, j))).map(cell).collect()
}
