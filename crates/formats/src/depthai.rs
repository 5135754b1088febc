//! The calibration of Luxonis's OAK cameras as DepthAI stores it (`CalibrationHandler`, `eepromToJsonFile`); read only.
//!
//! `cameraData` is a list of [socket, camera], or a table. `distortionCoeff` is OpenCV's order (k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4 τx τy), of
//! a fisheye its first four. `extrinsics` is to_from_this: rotation and translation map this camera's points into those of
//! `toCameraSocket`, −1 where there is none; the translation is in centimetres (`getCameraExtrinsics`). Pixel origin as ours: the numbers
//! are OpenCV's.

use super::document::{Document, Fault, Value};
use super::entry::Entry;
use super::lens::{self, LensNumbers};
use super::scalar_keys::number_of;
use super::{CameraFormat, Contents, Format, NamedCamera, Placement, Reads, checks, opencv};
use crate::core::camera::ImageSize;
use crate::core::{Camera, Pose};
use nalgebra::Vector3;

pub(super) const FORMAT: CameraFormat = CameraFormat {
    format: Format::DepthAi,
    words: &[],
    reads: Some(Reads {
        recognises: |document| document.root.get("cameraData").is_some(),
        read,
        together: None,
    }),
    write: None,
    traps: &[
        "extrinsics map this camera's points into those of toCameraSocket (x_to = R x_this + t); t is this camera's position there, in \
            centimetres, and is read as metres. specTranslation is the design's, not measured.",
        "The intrinsics belong to the full sensor (width × height of the file); previews and video are cropped and scaled.",
        "Socket 0 is CAM_A (the colour camera), 1 CAM_B (left), 2 CAM_C (right).",
    ],
};

fn read(document: &Document) -> Result<Contents, Fault> {
    let mut contents = Contents::default();
    let all = document.entry().need("cameraData")?;
    for (socket, entry) in sockets(&all)? {
        let k = entry.need("intrinsicMatrix")?;
        if k.numbers()?.iter().all(|x| *x == 0.0) {
            contents.warnings.push(format!("{} was never calibrated (zeros); it is left out", name(socket)));
            continue;
        }
        let camera = camera(&entry, &k, &mut contents.warnings)?;
        let placement = placement(&entry, socket)?;
        contents.cameras.push(NamedCamera::new(name(socket), camera, placement));
    }
    Ok(contents)
}

/// `[[0, {…}], [1, {…}]]`, or `{"0": {…}}`.
fn sockets<'a>(all: &Entry<'a>) -> Result<Vec<(u32, Entry<'a>)>, Fault> {
    if let Value::Map(_) = all.node.value {
        let number = |entry: Entry<'a>| match entry.name().parse() {
            Ok(socket) => Ok((socket, entry)),
            Err(_) => Err(entry.fault("is no number of a socket")),
        };
        return all.entries()?.into_iter().map(number).collect();
    }
    let pair = |entry: Entry<'a>| match entry.items()?.as_slice() {
        [socket, camera] => Ok((socket.count(0)?, camera.clone())),
        other => {
            Err(entry.fault(format!("holds {} values; a socket and its camera are needed", other.len())))
        }
    };
    all.items()?.into_iter().map(pair).collect()
}

/// As DepthAI names them: CAM_A to CAM_J.
fn name(socket: u32) -> String {
    match char::from_u32('A' as u32 + socket) {
        Some(letter @ 'A'..='J') => format!("CAM_{letter}"),
        _ => format!("socket_{socket}"),
    }
}

fn camera(entry: &Entry<'_>, k: &Entry<'_>, warnings: &mut Vec<String>) -> Result<Camera, Fault> {
    let matrix = checks::camera_matrix(k)?;
    let distortion = entry.need("distortionCoeff")?;
    let d = distortion.numbers()?;
    let lens = match (number_of(entry, "cameraType")?.unwrap_or(0.0), d.as_slice()) {
        (0.0, d) => opencv::brown_conrady(&distortion, without_zeros(d))?,
        (1.0, [k1, k2, k3, k4, ..]) => LensNumbers::KannalaBrandt([*k1, *k2, *k3, *k4]),
        (1.0, d) => {
            return Err(distortion.fault(format!("holds {} coefficients; a fisheye takes 4", d.len())));
        }
        (other, _) => {
            return Err(entry
                .need("cameraType")?
                .fault(format!("is {other}; 0 (perspective) and 1 (fisheye) are read")));
        }
    };
    let size =
        ImageSize { width_px: entry.need("width")?.count(1)?, height_px: entry.need("height")?.count(1)? };
    lens::camera(k, &lens, matrix, Some(size), warnings)
}

/// All 14 are always there: those behind the last that is not zero are no part of the lens.
fn without_zeros(d: &[f64]) -> Vec<f64> {
    match lens::in_counts(d, &[4, 5, 8, 12]) {
        Some(_) if d.len() < 14 => d.to_vec(),
        Some(_) => {
            let used = d.iter().rposition(|x| *x != 0.0).map_or(0, |last| last + 1);
            let count = [4, 5, 8, 12].into_iter().find(|n| used <= *n).unwrap_or(d.len());
            d[..count].to_vec()
        }
        None => d.to_vec(),
    }
}

fn placement(entry: &Entry<'_>, socket: u32) -> Result<Option<Placement>, Fault> {
    let Some(extrinsics) = entry.get("extrinsics") else { return Ok(None) };
    let Some(to) = extrinsics.get("toCameraSocket").filter(|to| to.number() != Ok(-1.0)) else {
        return Ok(None);
    };
    let to = to.count(0)?;
    if to == socket {
        return Ok(None);
    }
    let t = extrinsics.need("translation")?;
    let metres = |key: &str| Ok(t.need(key)?.number()? * metres_per_unit(&extrinsics)?);
    let translation = Vector3::new(metres("x")?, metres("y")?, metres("z")?);
    let rotation = checks::rotation_matrix(&extrinsics.need("rotationMatrix")?)?;
    let b_from_a = Pose::new(rotation, translation);
    Ok(Some(Placement { b: name(to), a: name(socket), b_from_a, covariance: None }))
}

/// `LengthUnit`: centimetres where nothing is stated.
fn metres_per_unit(extrinsics: &Entry<'_>) -> Result<f64, Fault> {
    let Some(unit) = extrinsics.get("lengthUnit") else { return Ok(0.01) };
    match unit.count(0)? {
        0 => Ok(1.0),
        1 => Ok(0.01),
        2 => Ok(0.001),
        other => {
            Err(unit.fault(format!("is {other}; 0 (metres), 1 (centimetres) and 2 (millimetres) are read")))
        }
    }
}
